"""Speeds of least fuel over a voyage: against another optimiser, and where no weather differs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from reproductions.voyages import (
    SEGMENT_M,
    Segment,
    compare,
    constant_fuel,
    constant_speed,
    least_fuel,
    summarise,
)

Floats = NDArray[np.float64]
SPEED = np.arange(3.0, 11.0, 0.01)


def segment(calm: float, waves: float) -> Segment:
    """Return a segment whose fuel per distance is a quadratic resistance and a force of waves."""
    return Segment(SPEED, 1e-4 * (calm * SPEED**2 + waves) * SPEED)


def test_the_least_fuel_is_that_of_another_optimiser() -> None:
    segments = [segment(1.0, 0.0), segment(1.0, 40.0), segment(1.6, 10.0)]
    found = least_fuel(segments, 3 * SEGMENT_M / 7.0)

    def fuel(two: Floats) -> float:
        last = 1.0 / (found.time_s / SEGMENT_M - (1.0 / two).sum())
        return float(
            sum(
                c * v**2 + w for c, w, v in zip((1, 1, 1.6), (0, 40, 10), (*two, last), strict=True)
            )
        )

    other = scipy.optimize.minimize(fuel, np.full(2, 7.0), method="Nelder-Mead", tol=1e-9)
    assert found.speeds == pytest.approx([*other.x, found.speeds[2]], abs=0.02)
    assert found.fuel_kg == pytest.approx(1e-4 * SEGMENT_M * other.fun, rel=1e-4)


def test_a_force_that_does_not_depend_on_the_speed_changes_no_speed() -> None:
    """Equal segments beside such a force are sailed at equal speeds; a constant lever costs more."""
    segments, time = [segment(1.0, 0.0), segment(1.0, 60.0)], 2 * SEGMENT_M / 7.0
    best = least_fuel(segments, time)
    assert best.speeds == pytest.approx([7.0, 7.0], abs=0.011)
    assert constant_speed(segments, best.time_s).fuel_kg == pytest.approx(best.fuel_kg, rel=1e-5)
    assert constant_fuel(segments, best.time_s).fuel_kg > 1.02 * best.fuel_kg


def test_every_plan_arrives_in_time_and_the_table_has_a_row_for_each_speed() -> None:
    segments = {"calm": segment(1.0, 0.0), "rough": segment(1.0, 60.0)}
    voyages = compare(segments, 3, seed=1)
    assert (voyages[["constant speed", "constant fuel flow"]] > -1e-3).all(axis=None)
    assert summarise(voyages)["voyages"].tolist() == [3, 3, 3, 3]
    time = 2 * SEGMENT_M / 6.5
    for plan in (constant_speed, constant_fuel):
        assert plan(list(segments.values()), time).time_s == pytest.approx(time)
