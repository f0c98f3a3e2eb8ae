"""What a step of the voltage tells of inertia and inductance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shaftline.mismatch.identification.drive_train import DriveTrain, drive_train, keys_of
from shaftline.mismatch.identification.step import evaluate_step, steps

from .benches import poles_approximate, recorded, staircase, tug


@pytest.mark.parametrize("name", ["sine", "staircase"])
@pytest.mark.parametrize("levels", [(5.89, 6.88), (6.88, 5.89), (5.89, 7.8)])
def test_one_step_tells_both(name: str, levels: tuple[float, ...]) -> None:
    """The paper's step, its reverse, and one of a third, where a linear rise would be 3 % off."""
    train = drive_train(tug(name))
    (one,) = steps(tug(name), staircase(tug(name), levels))
    found = evaluate_step(train, one)
    assert found.inertia == pytest.approx(train.inertia, rel=5e-3)
    assert found.electric_s * train.resistance == pytest.approx(train.inductance, rel=2e-3)


def test_without_propeller_the_rise_is_exponential() -> None:
    ship = tug().with_values({"propeller.torque_coefficient": 1e-4})
    (one,) = steps(ship, staircase(ship, (5.0, 6.0)))
    assert evaluate_step(drive_train(ship), one).inertia == pytest.approx(3.18e-5, rel=5e-3)


def test_viscous_friction_counts() -> None:
    ship = tug().with_values({"transmission.viscous_friction_engine_side_N_m_s_rad": 1e-3})
    (one,) = steps(ship, staircase(ship, (5.0, 6.0)))
    assert evaluate_step(drive_train(ship), one).inertia == pytest.approx(3.18e-5, rel=5e-3)


def test_its_own_time_constants_do_not_matter() -> None:
    train = drive_train(tug())
    wrong = replace(train, inertia=1.0, inductance=1.0)
    (one,) = steps(tug(), staircase(tug(), (5.89, 6.88)))
    assert evaluate_step(wrong, one) == evaluate_step(train, one)


def test_a_late_speed_is_known_to_be_late() -> None:
    ship = tug().with_values({"sensors.speed_delay_s": 0.005})
    (one,) = steps(ship, staircase(ship, (5.89, 6.88)))
    train = drive_train(ship)
    assert evaluate_step(train, one, 0.005).inertia == pytest.approx(train.inertia, rel=5e-3)
    assert evaluate_step(train, one).inertia > 1.03 * train.inertia


def test_without_current_the_inertia_alone() -> None:
    table = staircase(tug(), (5.89, 6.88)).drop(columns="motor_current_A")
    (one,) = steps(tug(), table)
    found = evaluate_step(drive_train(tug()), one)
    assert found.inertia == pytest.approx(3.18e-5, rel=1e-2)
    assert np.isnan(found.electric_s)


def test_a_slow_recording_knows_no_inductance() -> None:
    (one,) = steps(tug(), staircase(tug(), (5.89, 6.88), interval_s=5e-3))
    found = evaluate_step(drive_train(tug()), one)
    assert np.isnan(found.electric_s)
    assert found.inertia == pytest.approx(3.18e-5, rel=0.05)


def test_errors_are_those_of_white_noise() -> None:
    """Spread over 40 draws; the inertia's is stated for noise that repeats, and is larger."""
    table, train, rng = staircase(tug(), (5.89, 6.88)), drive_train(tug()), np.random.default_rng(3)
    found = []
    for _ in range(40):
        noisy = table.copy()
        noisy["motor_current_A"] += 0.01 * rng.standard_normal(len(table))
        found.append(evaluate_step(train, steps(tug(), noisy)[0]))
    spread = float(np.std([one.electric_s for one in found]))
    assert found[0].electric_error_s == pytest.approx(spread, rel=0.35)


def test_steps_too_large_or_too_small_are_no_steps() -> None:
    assert steps(tug(), staircase(tug(), (3.0, 6.0))) == []
    assert steps(tug(), staircase(tug(), (5.0, 5.05))) == []
    short = staircase(tug(), (5.0, 6.0, 5.5), hold_s=0.2)
    assert steps(tug(), short) == []  # never at rest


def test_half_the_inertia_by_the_misprinted_equation() -> None:
    """Eq. 31 as printed lacks the 2 that eqs. A26 and A34 ask for."""
    train = drive_train(tug())
    model = train.linear(train.equilibrium(5.89))
    printed = -model.c * 0.5 * model.damping / poles_approximate(model)[1]
    assert printed == pytest.approx(0.5 * model.mechanical_s)
    assert isinstance(keys_of(tug(), train), dict)
    assert isinstance(train, DriveTrain)


def test_a_supply_may_take_its_time() -> None:
    """A voltage that follows with 0.07 ms is a step that comes so much later."""
    table = staircase(tug(), (5.89, 6.88))
    time = np.arange(20000) * 1e-4
    volts = 5.89 + 0.99 * (1.0 - np.exp(-(time + 0.5e-4) / 7e-5))
    run = recorded(tug(), np.r_[np.full(20000, 5.89), volts])
    (plain,), (slow,) = steps(tug(), table), steps(tug(), run)
    assert slow.time[0] == pytest.approx(-7e-5, abs=1e-5)
    assert plain.time[0] == 0.0
    found = evaluate_step(drive_train(tug()), slow)
    assert found.inertia == pytest.approx(3.18e-5, rel=5e-3)
    assert found.electric_s == pytest.approx(6.03e-4 / 1.51, rel=0.06)
