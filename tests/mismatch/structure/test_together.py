"""Effects that are candidates only where effects and parameters are estimated together."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import diagnose
from shaftline.mismatch.search.catalogue import SizedEffect, catalogue
from shaftline.mismatch.search.trial_ship import TrialShip
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, simulate_recording

from . import rigs

ROWS, INTERVAL_S = 2000, 0.02


@pytest.fixture
def flywheel(servo: Ship) -> Ship:
    """A flywheel with viscous friction that a torque command drives."""
    return servo.with_values(
        {
            "prime_mover.torque_max_N_m": 1.0,
            "transmission.inertia_engine_side_kg_m2": 5e-3,
            "transmission.viscous_friction_engine_side_N_m_s_rad": 1e-2,
            "integration.time_step_s": 0.01,
        }
    )


def run(ship: Ship, seed: int = 0) -> pd.DataFrame:
    """Levels of the command of either sign, each held for 0.8 s; shaft speed with noise."""
    rng = np.random.default_rng(seed)
    table = pd.DataFrame({"time_s": INTERVAL_S * np.arange(ROWS)})
    table["motor_torque_N_m"] = np.repeat(rng.uniform(-1.0, 1.0, ROWS // 40), 40)
    true = simulate_recording(ship, table.assign(shaft_speed_rad_s=0.0))
    noise = 0.2 * rng.standard_normal(ROWS)
    return table.assign(shaft_speed_rad_s=true["shaft_speed_rad_s"] + noise)


def with_effects(ship: Ship, values: dict[str, tuple[float, ...]]) -> Ship:
    """A ship with effects of the catalogue, by label."""
    trial_ship = TrialShip(Balances(JointReplay(ship, run(ship))))
    entries = {effect.label: effect for effect in catalogue()}
    return trial_ship.corrected(tuple(SizedEffect(entries[k], v) for k, v in values.items()))


def test_a_curve_of_the_command_and_a_lag_are_found_together(flywheel: Ship) -> None:
    truth = {"command-curve (motor)": (1.0, 0.2), "command-lag (motor, torque)": (0.15,)}
    table = run(with_effects(flywheel, truth), seed=1)
    found = diagnose(flywheel, table)
    values = {f.effect.label: f.estimates[0] for f in found.findings}
    assert set(values) == set(truth)
    for label, (true, *_) in truth.items():
        low, high = values[label].ci95
        assert low < true < high
        assert values[label].value == pytest.approx(true, rel=0.1)
    assert found.verdict == "explained"


def test_a_drive_without_either_is_given_neither(flywheel: Ship) -> None:
    found = diagnose(flywheel, run(flywheel, seed=2))
    assert (found.verdict, found.findings) == ("nothing-missing", [])


def test_a_load_that_changes_with_the_angle_is_found_where_the_angle_is_measured(
    flywheel: Ship,
) -> None:
    """Gravity on a link: 0.3 sin + 0.1 cos of the angle; the commands swing it, but not over."""
    link = flywheel.with_values({"transmission.viscous_friction_engine_side_N_m_s_rad": 0.1})
    heavy = with_effects(link, {"angle-load (motor)": (0.3, 0.1)})
    rng = np.random.default_rng(4)
    table = run(flywheel)[["time_s", "motor_torque_N_m"]]
    table["motor_torque_N_m"] *= 0.25
    start = {"shaft_speed_rad_s": 0.0, "shaft_angle_rad": 0.5}
    true = simulate_recording(heavy, table.assign(**start))
    for column, noise in (("shaft_speed_rad_s", 0.05), ("shaft_angle_rad", 0.01)):
        table[column] = true[column] + noise * rng.standard_normal(ROWS)
    table.loc[0, ["shaft_speed_rad_s", "shaft_angle_rad"]] = 0.0, 0.5
    (found,) = diagnose(link, table).findings
    assert found.effect.label == "angle-load (motor)"
    assert [e.value for e in found.estimates] == pytest.approx([0.3, 0.1], rel=0.1)


@pytest.mark.parametrize(
    ("label", "column"),
    [
        ("current-sensor-lag (sensor)", "motor_current_A"),
        ("power-sensor-lag (sensor)", "electric_power_W"),
    ],
)
def test_a_slow_current_or_power_sensor_is_found(label: str, column: str) -> None:
    """A motor that follows steps of its voltage; the reading lags by 0.2 s."""
    ship = rigs.motor()
    table = rigs.run({}, 1)[["time_s", "motor_voltage_V", "shaft_speed_rad_s"]]
    true = simulate_recording(
        ship.with_values({f"sensors.{label.split('-')[0]}_lag_s": 0.2}),
        table.assign(**{column: 0.0}),
    )[column]
    noise = 0.02 * float(true.std()) * np.random.default_rng(3).standard_normal(len(table))
    (found,) = diagnose(ship, table.assign(**{column: true + noise})).findings
    assert found.effect.label == label
    assert found.estimates[0].value == pytest.approx(0.2, rel=0.05)
