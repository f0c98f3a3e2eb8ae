"""Which numbers a recording moves, and which of them the corrected ship carries."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import Options, diagnose
from shaftline.mismatch.identification.parameters import (
    MovableParameters,
    Start,
    start_with_free_parameters,
)
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.fitting import Fitter

from ..toy import FOULING, RESISTANCE, ROWS, Toy, bands, entry, white
from ..voyages import frigate_voyage, quick_frigate

HELD = np.arange(ROWS)


def numbers_of(
    truth: dict[str, float], known: float, free: tuple[str, ...] = ()
) -> MovableParameters:
    toy: Any = Toy(truth, white(0, 0.5, 2.0), known)
    start = start_with_free_parameters(toy.ship, free)
    toy.ship = start.ship
    toy.recorded = toy.measured
    return MovableParameters(start if free else Start(toy.ship, toy.ship), Fitter(toy, bands()))


def test_a_move_is_told_in_tolerances() -> None:
    """The resistance is 3 % higher and known to 2 %."""
    numbers = numbers_of({RESISTANCE: 1.03 * 3306.2}, 0.02)
    null = numbers.fitter.null
    assert numbers.values(null)[RESISTANCE] == pytest.approx(1.03 * 3306.2, rel=0.003)
    assert numbers.shifts(null)[RESISTANCE] == pytest.approx(1.5, abs=0.15)
    (told,) = numbers.changes(null, numbers.start.ship)
    assert (told.key, told.source, told.file, told.corrected) == (
        RESISTANCE,
        "tolerance",
        3306.2,
        3306.2,
    )
    # a slope of 0.02 of rms 1 in noise of rms 2 over 600 rows: about 2 / 0.02 / sqrt(600) = 4
    assert told.standard_error == pytest.approx(4.1, abs=2.0)


def test_a_number_that_hardly_moves_is_not_told() -> None:
    numbers = numbers_of({}, 0.02)
    assert numbers.changes(numbers.fitter.null, numbers.start.ship) == []


@pytest.mark.parametrize(("better", "carried"), [(20.0, True), (3.0, False), (-20.0, False)])
def test_the_corrected_ship_carries_what_the_data_set_aside_ask_for(
    better: float, carried: bool
) -> None:
    numbers = numbers_of({RESISTANCE: 1.03 * 3306.2}, 0.02)
    own = numbers.start.ship.record()["resistance_coefficient"]

    def judge(record: Any) -> float:
        return better if record["resistance_coefficient"] > own else 0.0

    ship = numbers.with_estimates(numbers.start.ship, numbers.fitter.null, judge, HELD)
    value = numbers.values(numbers.fitter.null)[RESISTANCE] if carried else 3306.2
    assert ship.parameter(RESISTANCE).value == value


def test_no_channel_may_be_followed_worse() -> None:
    """By a point of FitPercent here."""
    numbers = numbers_of({RESISTANCE: 1.03 * 3306.2}, 0.02)
    toy: Any = numbers.fitter.balances.replay
    toy.recorded = toy.nominal | {"hull": toy.nominal["hull"] + 20.0 * np.sin(HELD)}
    ship = numbers.with_estimates(
        numbers.start.ship, numbers.fitter.null, lambda r: float(r["resistance_coefficient"]), HELD
    )
    assert ship == numbers.start.ship


def test_a_free_number_goes_where_the_recording_has_it() -> None:
    numbers = numbers_of({RESISTANCE: 1.2 * 3306.2}, 0.0, (RESISTANCE,))
    moved = numbers.relinearised_ship()
    assert moved is not None
    assert moved.parameter(RESISTANCE).value == pytest.approx(1.2 * 3306.2, rel=0.003)
    near = numbers_of({}, 0.0, (RESISTANCE,))
    assert near.relinearised_ship() is None


def test_a_free_number_and_an_effect_are_told_apart() -> None:
    """Both act on the hull, each in its own way; the number is 20 % off."""
    numbers = numbers_of({RESISTANCE: 1.2 * 3306.2, FOULING: 0.3}, 0.0, (RESISTANCE,))
    fit = numbers.fitter.evaluate((SizedEffect(entry("hull-fouling (hull)"), (0.3,)),))
    assert numbers.values(fit)[RESISTANCE] == pytest.approx(1.2 * 3306.2, rel=0.003)
    (told,) = numbers.changes(fit, numbers.start.ship)
    (alone,) = numbers.changes(numbers.fitter.null, numbers.start.ship)
    assert told.standard_error < alone.standard_error  # of which fouling is the noise


def test_a_ship_with_a_number_far_off_is_put_right() -> None:
    """The resistance is 20 % higher: let move, it explains all; else an effect takes its place."""
    key = "hull.resistance_coefficient_N_s2_m2"
    true = quick_frigate().with_values({key: 1.2 * 3306.2, "prime_mover.lag_s": 1.5})
    table = frigate_voyage(true, seed=31, seconds=400.0)
    found = diagnose(quick_frigate(), table, options=Options(free=(key,)))
    assert [f.effect.id for f in found.findings] == ["engine-torque-lag"]
    assert found.corrected.parameter(key).value == pytest.approx(1.2 * 3306.2, rel=0.01)
    (number,) = (n for n in found.parameters if n.key == key)
    assert number.source == "free"
    assert number.shifts == pytest.approx(0.2 / 0.3, rel=0.05)
    assert 0.0 < number.standard_error < 0.02 * 3306.2
    assert found.fit_before["ship_speed_m_s"] < found.fit_after["ship_speed_m_s"] - 20.0
    assert found.ship == start_with_free_parameters(quick_frigate(), (key,)).ship
