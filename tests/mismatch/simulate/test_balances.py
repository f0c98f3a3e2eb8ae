"""What each balance lacks, against balances written out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.balances import BALANCE_OF_RESIDUAL, Balances, time_derivative
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship

from ..voyages import frigate_voyage

ROWS, STEP = 80, 0.1
TIME = STEP * np.arange(ROWS)

BENCH = """
name = "bench"
[water]
density_kg_m3 = 1000.0
[hull]
fixed = true
[propeller]
model = "bollard"
diameter_m = 0.2
thrust_coefficient = 0.4
torque_coefficient = 0.05
relative_rotative_efficiency = 0.8
entrained_inertia_kg_m2 = 0.003
depth_m = 1.0
[prime_mover]
type = "dc-motor"
motor_constant_V_s_rad = 0.12
armature_resistance_ohm = 0.6
voltage_max_V = 30.0
[transmission]
gear_ratio = 3.0
efficiency = 0.9
inertia_engine_side_kg_m2 = 0.06
inertia_propeller_side_kg_m2 = 0.01
coulomb_friction_engine_side_N_m = 0.5
viscous_friction_propeller_side_N_m_s_rad = 0.02
[integration]
time_step_s = 0.01
"""

SPEED = 40.0 + 5.0 * np.sin(TIME)
VOLTS = np.where(TIME < 4.0, 25.0, 35.0)  # the supply ends at 30
TORQUE = 2.0 + 0.1 * TIME


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Ship:
    file = Path(tmp_path_factory.mktemp("bench")) / "bench.toml"
    file.write_text(BENCH)
    return load_ship(file)


def table(**columns: Any) -> pd.DataFrame:
    return pd.DataFrame(
        {"time_s": TIME, "motor_voltage_V": VOLTS, "shaft_speed_rad_s": SPEED} | columns
    )


def residuals(ship: Ship, recording: pd.DataFrame) -> dict[str, Any]:
    balances = Balances(JointReplay(ship, recording))
    rows = balances.residuals(balances.replay.recorded)
    return dict(zip(balances.names, rows, strict=True))


def by_hand() -> dict[str, Any]:
    """Torques [N m], thrust [N] and current [A] of the bench; Coulomb friction is no coordinate."""
    turns = SPEED / (2.0 * math.pi)
    current = (np.minimum(VOLTS, 30.0) - 0.12 * 3.0 * SPEED) / 0.6
    return {
        "drive": 0.12 * current * 3.0 * 0.9,
        "load": 1000.0 * turns**2 * 0.2**5 * 0.05 / 0.8 + 0.02 * SPEED,
        "thrust": 1000.0 * turns**2 * 0.2**4 * 0.4,
        "current": current,
        "spin": np.gradient(SPEED, STEP),
    }


def test_without_a_gauge_the_shaft_is_one_balance(bench: Ship) -> None:
    hand = by_hand()
    found = residuals(bench, table())
    assert list(found) == ["motor"]
    lacks = (0.06 + 0.01 + 0.003) * hand["spin"] + hand["load"] - hand["drive"]
    assert found["motor"] == pytest.approx(lacks, rel=1e-9, abs=1e-9)


def test_a_gauge_parts_motor_and_propeller(bench: Ship) -> None:
    hand = by_hand()
    found = residuals(bench, table(shaft_torque_N_m=TORQUE))
    assert list(found) == ["motor", "propeller"]
    assert found["motor"] == pytest.approx(0.06 * hand["spin"] + TORQUE - hand["drive"], abs=1e-9)
    assert found["propeller"] == pytest.approx(
        (0.01 + 0.003) * hand["spin"] + hand["load"] - TORQUE, abs=1e-9
    )


def test_thrust_and_current_are_measured_less_worked_out(bench: Ship) -> None:
    hand = by_hand()
    found = residuals(bench, table(thrust_N=100.0 + TIME, motor_current_A=20.0 - TIME))
    assert list(found) == ["motor", "thrust", "current"]
    assert found["thrust"] == pytest.approx(100.0 + TIME - hand["thrust"], abs=1e-9)
    assert found["current"] == pytest.approx(20.0 - TIME - hand["current"], abs=1e-9)
    assert {BALANCE_OF_RESIDUAL[name] for name in ("thrust", "current")} == {"propeller", "motor"}


def test_behind_the_gauge_of_a_shaft_without_a_propeller_is_its_load(bench: Ship) -> None:
    tree = bench.model_dump(exclude_unset=True)
    drive = Ship.model_validate(tree | {"propeller": {"model": "none"}})
    hand = by_hand()
    found = residuals(drive, table(shaft_torque_N_m=TORQUE, thrust_N=TIME))
    assert list(found) == ["motor", "load"]  # and no thrust, which nothing gives
    assert found["motor"] == pytest.approx(0.06 * hand["spin"] + TORQUE - hand["drive"], abs=1e-9)
    assert found["load"] == pytest.approx(0.01 * hand["spin"] + 0.02 * SPEED - TORQUE, abs=1e-9)
    assert BALANCE_OF_RESIDUAL["load"] == "motor"


def test_the_speed_of_an_angle_is_its_derivative(bench: Ship) -> None:
    """Formed alike of what was measured and what was simulated."""
    angle = 40.0 * TIME - 5.0 * np.cos(TIME)
    recording = table(shaft_angle_rad=angle).drop(columns="shaft_speed_rad_s")
    balances = Balances(JointReplay(bench, recording))
    assert balances.names == ["motor"]
    slope = np.gradient(angle, STEP)
    same = residuals(bench, table(shaft_speed_rad_s=slope))
    assert balances.residuals({"shaft_angle_rad": angle})[0] == pytest.approx(same["motor"])
    lacking = balances.residuals_against(balances.nominal)[0]
    simulated = balances.nominal["shaft_angle_rad"]
    assert lacking == pytest.approx(
        balances.residuals(balances.replay.measured)[0]
        - residuals(bench, table(shaft_speed_rad_s=np.gradient(simulated, STEP)))["motor"]
    )
    # where both were measured, the tachometer goes first
    both = Balances(JointReplay(bench, table(shaft_angle_rad=angle)))
    by_speed = residuals(bench, table())["motor"]
    assert both.residuals(both.replay.recorded)[0] == pytest.approx(by_speed)


def test_a_drive_that_holds_its_speed_has_no_balance(bench: Ship) -> None:
    tree = bench.model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "speed-command", "speed_max_rad_s": 60.0}
    held = Ship.model_validate(tree)
    hand = by_hand()
    found = residuals(held, table(shaft_torque_N_m=TORQUE, thrust_N=100.0 + TIME))
    assert list(found) == ["propeller", "thrust"]
    assert found["thrust"] == pytest.approx(100.0 + TIME - hand["thrust"], abs=1e-9)
    assert found["propeller"] == pytest.approx(
        (0.01 + 0.003) * hand["spin"] + hand["load"] - TORQUE, abs=1e-9
    )
    assert list(residuals(held, table(thrust_N=TIME))) == ["thrust"]


def test_units_stand_beside_the_names(bench: Ship) -> None:
    balances = Balances(
        JointReplay(bench, table(shaft_torque_N_m=TORQUE, thrust_N=TIME, motor_current_A=TIME))
    )
    assert dict(zip(balances.names, balances.units, strict=True)) == {
        "motor": "N m",
        "propeller": "N m",
        "thrust": "N",
        "current": "A",
    }
    assert (balances.moving, balances.has_torque, balances.prime_mover) == (False, True, "motor")


def test_the_hull_lacks_what_thrust_and_resistance_leave() -> None:
    frigate = load_ship("frigate").with_values(
        {
            "propeller.model": "bollard",
            "propeller.thrust_coefficient": 0.3,
            "propeller.torque_coefficient": 0.05,
            "hull.current_m_s": 0.5,
        }
    )
    voyage = frigate_voyage(seconds=20.0)
    found = residuals(frigate, voyage)
    assert list(found) == ["pitch-actuator", "engine", "propeller", "hull"]
    hull, screw = frigate.hull, frigate.propeller
    turns = voyage["shaft_speed_rad_s"].to_numpy() / (2.0 * math.pi)
    thrust = frigate.water.density_kg_m3 * turns**2 * screw.diameter_m**4 * 0.3
    speed = voyage["ship_speed_m_s"].to_numpy()
    push = hull.propellers * (1.0 - hull.thrust_deduction) * thrust
    drag = hull.resistance_coefficient_N_s2_m2 * (speed - 0.5) ** 2
    lacks = hull.mass_kg * np.gradient(speed, 0.2) - push + drag
    assert found["hull"] == pytest.approx(lacks, rel=1e-9)


def test_the_pitch_lacks_what_its_answer_to_the_command_leaves() -> None:
    offset = load_ship("frigate").with_values({"sensors.pitch_offset": 0.04})
    balances = Balances(JointReplay(offset, frigate_voyage(seconds=20.0)))
    measured = balances.replay.recorded
    rows = balances.residuals(measured)
    assert rows[0] == pytest.approx(measured["pitch_ratio"] - balances.nominal["pitch_ratio"])
    # the propeller is told the blades' own pitch
    plain = Balances(JointReplay(load_ship("frigate"), frigate_voyage(seconds=20.0)))
    read = plain.replay.recorded | {"pitch_ratio": measured["pitch_ratio"] - 0.04}
    assert rows[2] == pytest.approx(plain.residuals(read)[2], rel=1e-9)


def test_what_is_not_measured_is_that_of_the_nominal_ship() -> None:
    voyage = frigate_voyage(seconds=20.0).drop(columns=["ship_speed_m_s", "pitch_ratio"])
    balances = Balances(JointReplay(load_ship("frigate"), voyage))
    assert balances.names == ["engine", "propeller"]
    samples = balances.nominal_samples
    full = voyage.assign(ship_speed_m_s=samples["ship_speed"], pitch_ratio=samples["pitch_ratio"])
    both = Balances(JointReplay(load_ship("frigate"), full))
    assert both.names == ["engine", "propeller", "hull"]
    expected = both.residuals(both.replay.recorded)[:2]
    assert balances.residuals(balances.replay.recorded) == pytest.approx(expected, rel=1e-9)


def test_a_pitch_that_never_moves_is_no_balance() -> None:
    voyage = frigate_voyage(seconds=20.0)
    assert "pitch-actuator" in residuals(load_ship("frigate"), voyage)
    still = residuals(load_ship("frigate"), voyage.assign(pitch_ratio=1.2))
    assert list(still) == ["engine", "propeller", "hull"]


def test_lags_do_not_act_in_a_balance() -> None:
    voyage = frigate_voyage(seconds=20.0)
    late = load_ship("frigate").with_values(
        {"prime_mover.lag_s": 3.0, "propeller.inflow_lag_s": 2.0}
    )
    rows = [
        Balances(JointReplay(ship, voyage)).residuals(JointReplay(ship, voyage).recorded)
        for ship in (load_ship("frigate"), late)
    ]
    assert rows[0][1:] == pytest.approx(rows[1][1:], rel=1e-12)


def test_measured_water_acts_on_the_propeller() -> None:
    voyage = frigate_voyage(seconds=20.0)
    calm = residuals(load_ship("frigate"), voyage)["propeller"]
    slower = voyage.assign(inflow_velocity_m_s=0.8 * voyage["ship_speed_m_s"])  # 0.95 by its wake
    assert (residuals(load_ship("frigate"), slower)["propeller"] > calm + 1e3).all()
    airy = load_ship("frigate").with_values(
        {"propeller.cavitation_breakdown": 1.0, "propeller.cavitation_onset_number": 50.0}
    )
    deep, shallow = (
        residuals(airy, voyage.assign(propeller_submergence_m=depth))["propeller"]
        for depth in (9.0, 2.0)
    )
    assert (shallow < deep).all()


def test_a_simulation_lacks_what_the_recording_has_more() -> None:
    derated = {"prime_mover.derating_fraction": 0.1}
    true = load_ship("frigate").with_values(derated)
    balances = Balances(JointReplay(load_ship("frigate"), frigate_voyage(derated)))
    lacking = balances.residuals_against(balances.nominal)
    assert lacking == pytest.approx(
        balances.residuals(balances.replay.measured) - balances.residuals(balances.nominal)
    )
    assert lacking[1].mean() < -5e3  # a tenth of the engine's torque is not there
    own = balances.replay.simulated(balances.replay.simulate(true.record()))
    assert abs(balances.residuals_against(own)[1].mean()) < 200.0


def test_balances_of_the_ship_itself_lack_nothing() -> None:
    balances = Balances(JointReplay(load_ship("frigate"), frigate_voyage(seed=0)))
    lacking = balances.residuals(balances.nominal)
    # a central difference over steps of the demands is all that is left
    assert np.median(np.abs(lacking[balances.names.index("propeller")])) < 100.0
    assert np.median(np.abs(lacking[balances.names.index("engine")])) < 100.0
    assert np.median(np.abs(lacking[balances.names.index("hull")])) < 100.0


def test_a_channel_that_stands_still_has_no_balance() -> None:
    """Its residual would be 0 to the last digit, and no covariance could be inverted."""
    voyage = frigate_voyage(seed=0)
    moving = voyage.assign(thrust_N=1e6 + np.arange(len(voyage)))
    assert "thrust" in Balances(JointReplay(load_ship("frigate"), moving)).names
    still = voyage.assign(thrust_N=0.0)
    assert "thrust" not in Balances(JointReplay(load_ship("frigate"), still)).names


def test_rates_are_central_differences() -> None:
    assert time_derivative(np.array([0.0, 1.0, 4.0, 9.0]), 0.5) == pytest.approx(
        [2.0, 4.0, 8.0, 10.0]
    )


def test_loads_do_not_depend_on_the_rows_computed_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    balances = Balances(JointReplay(load_ship("frigate"), frigate_voyage(seconds=20.0)))
    measured = balances.replay.measured
    whole = balances.residuals(measured)
    monkeypatch.setattr("shaftline.mismatch.simulate.balances.BLOCK_ROWS", 7)
    np.testing.assert_array_equal(balances.residuals(measured), whole)


def test_a_ship_that_runs_away_is_refused_by_name(bench: Ship) -> None:
    recording = table()
    away: Any = SimpleNamespace(
        ship=bench,
        channels=["shaft_speed_rad_s"],
        recorded={},
        controllable=False,
        time_s=TIME,
        simulate_signals=lambda plant, names: dict.fromkeys(
            names, np.where(TIME < 2.0, SPEED, np.nan)
        ),
    )
    with pytest.raises(
        ValueError, match="bench: the simulated shaft_speed_rad_s is not finite from 2 s on"
    ):
        Balances(away)
    assert len(recording) == ROWS
