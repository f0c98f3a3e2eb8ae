"""Method 1: a staircase tells all six numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.identification.drive_train import (
    CONSTANT,
    FRICTION,
    INDUCTANCE,
    INERTIA,
    SIX,
)
from shaftline.mismatch.identification.step import step
from shaftline.plant import load_ship

from .benches import recorded, shares_off, staircase, tug

LEVELS = (3.91, 4.91, 5.89, 6.88)


def noisy(table: Any, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return table.assign(
        shaft_speed_rad_s=table["shaft_speed_rad_s"] + 0.3 * rng.standard_normal(len(table)),
        motor_current_A=table["motor_current_A"] + 0.02 * rng.standard_normal(len(table)),
    )


@pytest.mark.parametrize("name", ["sine", "staircase"])
def test_all_six_from_the_other_set(name: str) -> None:
    truth = tug(name)
    start = tug("staircase" if name == "sine" else "sine").with_values(
        {"water.density_kg_m3": truth.water.density_kg_m3}
    )
    found = step(start, [staircase(truth, LEVELS)])
    assert found.keys == SIX
    assert max(map(abs, shares_off(truth, found).values())) < 5e-3
    assert len(found.tables["steps"]) == 3


def test_one_step_beside_known_numbers() -> None:
    found = step(tug(), [staircase(tug(), (5.89, 6.88))], (INERTIA, INDUCTANCE))
    off = shares_off(tug(), found)
    assert abs(off["inertia_engine_side_kg_m2"]) < 4e-3
    assert abs(off["armature_inductance_H"]) < 2e-3


def test_errors_of_the_steady_numbers_are_carried_on() -> None:
    """An inertia beside uncertain constants is less sure than beside known ones, and goes with them."""
    table = noisy(staircase(tug(), LEVELS), 1)
    alone = step(tug(), [table], (INERTIA,))
    beside = step(tug(), [table], (CONSTANT, FRICTION, INERTIA))
    assert beside.standard_errors[2] > alone.standard_errors[0]
    assert abs(beside.correlation[0, 2]) > 0.1
    assert np.linalg.eigvalsh(beside.covariance)[0] > -1e-20


def test_order_of_the_keys_is_the_callers() -> None:
    table = noisy(staircase(tug(), LEVELS), 1)
    one, other = step(tug(), [table], SIX), step(tug(), [table], SIX[::-1])
    assert one.values == pytest.approx(other.values[::-1])
    assert one.covariance == pytest.approx(other.covariance[::-1, ::-1])


@pytest.mark.parametrize(
    ("make", "free", "message"),
    [
        (lambda: recorded(tug(), np.linspace(4.0, 7.0, 20000)), None, "steady: no steady state"),
        (lambda: staircase(tug(), (3.0, 6.0, 3.0)), None, "step: no step of motor_voltage_V"),
        (lambda: staircase(tug(), (5.89, 6.88)), None, "2 steady state.* 4 equations for 4"),
        (
            lambda: staircase(tug(), LEVELS).drop(columns="motor_current_A"),
            None,
            "step: prime_mover.armature_inductance_H needs motor_current_A",
        ),
        (
            lambda: staircase(tug(), (5.0, 6.0), interval_s=5e-3),
            (INDUCTANCE,),
            "the sampling interval of 0.005 s is too long",
        ),
        (
            lambda: staircase(tug(), LEVELS),
            ("propeller.inflow_lag_s",),
            "step: this method does not estimate propeller.inflow_lag_s",
        ),
    ],
)
def test_what_does_not_fit_is_refused(make: Any, free: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        step(tug(), [make()], free)


def test_another_ship_is_refused() -> None:
    with pytest.raises(ValueError, match="step: frigate needs a motor with a voltage"):
        step(load_ship("frigate"), [])
