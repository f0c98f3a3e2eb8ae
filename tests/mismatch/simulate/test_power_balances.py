"""What a measured power tells of each balance, by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.balances import STANDSTILL, Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship

from ...plant.test_fluid import fan

TIME = 0.1 * np.arange(80)
SPEED = 600.0 + 100.0 * np.sin(TIME)
LOAD = 1.2 * (SPEED / (2.0 * np.pi)) ** 2 * 0.2**5 * 0.017
MOVER = {
    "type": "speed-command",
    "speed_max_rad_s": 1300.0,
    "drive_efficiency": 0.8,
    "idle_power_W": 3.0,
}


def balances_of(ship: Ship, **columns: object) -> Balances:
    return Balances(JointReplay(ship, pd.DataFrame({"time_s": TIME, **columns})))


@pytest.mark.parametrize("column", ["shaft_power_W", "electric_power_W"])
def test_power_over_speed_is_the_torque_of_a_held_shaft(column: str) -> None:
    """A load 0.05 N m above the nominal one shows as a lack of -0.05 N m, wherever it is measured."""
    power = (LOAD + 0.05) * SPEED
    if column == "electric_power_W":
        power = power / 0.8 + 3.0
    found = balances_of(fan(prime_mover=MOVER), shaft_speed_rad_s=SPEED, **{column: power})
    assert (found.names, found.units, found.torque_column) == (["propeller"], ["N m"], column)
    usual = np.sqrt(np.mean(SPEED**2))
    share = SPEED**2 / (SPEED**2 + (STANDSTILL * usual) ** 2)
    (residual,) = found.residuals(found.replay.measured)
    np.testing.assert_allclose(residual, -0.05 * share, rtol=2e-3)


def test_about_standstill_a_power_tells_no_torque() -> None:
    speed = np.where(TIME < 4.0, 0.0, SPEED)
    power = np.where(TIME < 4.0, 0.5, LOAD * SPEED)  # an offset of the meter at rest
    found = balances_of(fan(), shaft_speed_rad_s=speed, shaft_power_W=power)
    (residual,) = found.residuals(found.replay.measured)
    assert np.abs(residual[:38]).max() < 1e-6
    assert np.isfinite(residual).all()


def test_a_torque_gauge_comes_before_a_power() -> None:
    found = balances_of(
        fan(prime_mover=MOVER),
        shaft_speed_rad_s=SPEED,
        shaft_torque_N_m=LOAD,
        shaft_power_W=LOAD * SPEED,
        electric_power_W=LOAD * SPEED / 0.8 + 7.0,
    )
    assert found.torque_column == "shaft_torque_N_m"
    assert list(zip(found.names, found.units, strict=True)) == [
        ("propeller", "N m"),
        ("electric-power", "W"),
    ]
    electric = found.residuals(found.replay.measured)[1]
    assert np.median(electric) == pytest.approx(
        4.0, abs=0.05
    )  # of 7 W, 3 W are the nominal idle power


def test_a_free_shaft_has_two_balances_by_its_power() -> None:
    tug = load_ship("tito-neri-sine")
    volts = 5.0 + np.sin(TIME)
    nominal = balances_of(tug, motor_voltage_V=volts, shaft_speed_rad_s=20.0 + np.sin(TIME))
    samples = nominal.replay.simulate(nominal.plant)
    found = balances_of(
        tug,
        motor_voltage_V=volts,
        shaft_speed_rad_s=np.array(samples["shaft_speed"]),
        shaft_power_W=np.array(samples["shaft_power"]),
    )
    assert found.names[:2] == ["motor", "propeller"]
    assert nominal.names[:1] == ["motor"]
    assert "propeller" not in nominal.names


@pytest.mark.parametrize(
    ("column", "name"), [("electric_power_W", "electric-power"), ("shaft_power_W", "shaft-power")]
)
def test_a_power_alone_is_a_balance_of_its_own(column: str, name: str) -> None:
    tug = load_ship("tito-neri-sine")
    signal = column.removesuffix("_W")
    volts = 5.0 + np.sin(TIME)
    plain = balances_of(tug, motor_voltage_V=volts, **{column: TIME})
    power = np.array(plain.replay.simulate(plain.plant)[signal]) + 2.0
    found = balances_of(tug, motor_voltage_V=volts, **{column: power})
    assert (found.names, found.units) == ([name], ["W"])
    (lacking,) = found.residuals_against(found.nominal)
    np.testing.assert_allclose(lacking, 2.0, atol=1e-3)
