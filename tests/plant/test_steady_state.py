from __future__ import annotations

import csv
from pathlib import Path

import pytest

from shaftline.plant import Equilibrium, Ship, equilibrium, load_ship, ship_names
from shaftline.plant.dynamics import evaluate
from shaftline.plant.state import Inputs

DATA = Path(__file__).parents[2] / "reproductions" / "data"

with (DATA / "advance_velocity_thesis_working_points.csv").open() as stream:
    WORKING_POINTS = {row.pop("point"): row for row in csv.DictReader(stream)}

with (DATA.parents[1] / "plant" / "data" / "tito_neri_operating_points.csv").open() as stream:
    TUG_POINTS = {row.pop("point"): row for row in csv.DictReader(stream)}


def drive_of(ship: Ship) -> tuple[float, float]:
    if ship.name == "ddg-51-surrogate":
        return 6e5, 1.4
    return (5.89, 1.0) if ship.name.startswith("tito") else (22.0, 1.0)


def assert_steady(ship: Ship, point: Equilibrium) -> None:
    rate, _ = evaluate(ship.record(), point.state, point.inputs, point.outputs.pitch_ratio)
    moving = rate._replace(position=0.0, shaft_angle=0.0)
    assert moving == pytest.approx((0.0,) * len(moving), abs=1e-8)


def test_design_point_is_the_printed_one(design_point: Equilibrium) -> None:
    assert design_point.state.shaft_speed == pytest.approx(10.51, abs=0.02)
    assert design_point.state.ship_speed == pytest.approx(8.73, abs=0.04)


@pytest.mark.parametrize("name", "ABCD")
def test_working_points_are_the_printed_ones(frigate: Ship, name: str) -> None:
    printed = {key: float(value) for key, value in WORKING_POINTS[name].items() if value}
    found = equilibrium(frigate, printed["fuel_rack_mm"], printed["pitch_ratio"])
    wide = 0.03 if name == "A" else 0.015  # A is printed to 4.94 rad/s and 1.96 m/s
    assert found.state.shaft_speed == pytest.approx(printed["shaft_speed_rad_s"], rel=0.015)
    assert found.state.ship_speed == pytest.approx(printed["ship_speed_m_s"], rel=wide)
    assert found.outputs.advance_velocity == pytest.approx(
        printed["advance_velocity_m_s"], rel=0.015
    )
    assert found.outputs.brake_torque == pytest.approx(printed["engine_torque_N_m"], rel=wide)


@pytest.mark.parametrize("name", ship_names())
def test_every_ship_has_a_steady_state(name: str) -> None:
    ship = load_ship(name)
    assert_steady(ship, equilibrium(ship, *drive_of(ship)))


@pytest.mark.parametrize("point", "ABCDE")
def test_tug_turns_as_fast_as_measured(point: str) -> None:
    measured = {key: float(value) for key, value in TUG_POINTS[point].items()}
    ship = load_ship("tito-neri-staircase")
    found = equilibrium(ship, measured["motor_voltage_V"], 1.0)
    motor_speed = ship.transmission.gear_ratio * found.state.shaft_speed
    assert motor_speed == pytest.approx(measured["motor_speed_rad_s"], rel=0.05)
    assert found.state.motor_current == pytest.approx(measured["motor_current_A"], rel=0.05)


@pytest.mark.parametrize(
    "values",
    [
        {"prime_mover.lag_s": 1.5},
        {"propeller.inflow_lag_s": 2.0},
        {"pitch_actuator.offset": 0.05},
        {"ventilation.thrust_loss": 0.5},
        {"hull.current_m_s": 1.0},
        {"propeller.model": "four-quadrant"},
        {"hull.fixed": True},
    ],
    ids=lambda values: next(iter(values)),
)
def test_steady_with_each_extra_state(frigate: Ship, values: dict[str, object]) -> None:
    ship = frigate.with_values(values)
    assert_steady(ship, equilibrium(ship, 20.0, 1.2))


@pytest.mark.parametrize(("command", "blade"), [(1.2, 1.25), (1.6, 1.45), (0.2, 0.65)])
def test_blade_stands_at_its_command_within_its_range_and_its_offset(
    frigate: Ship, command: float, blade: float
) -> None:
    ship = frigate.with_values({"pitch_actuator.offset": 0.05})
    found = equilibrium(ship, 24.0, command)
    assert found.outputs.pitch_ratio == found.state.pitch_ratio == pytest.approx(blade, rel=1e-12)
    assert found.inputs.pitch_command == command


def test_lags_stand_where_they_lead(frigate: Ship) -> None:
    lags = {"prime_mover.lag_s": 1.5, "propeller.inflow_lag_s": 2.0, "hull.wake_slope_s_m": 0.004}
    found = equilibrium(frigate.with_values(lags), 20.0, 1.2, inflow=0.3)
    engine_speed = 7.38 * found.state.shaft_speed
    mapped = -45.5 * engine_speed + 1428.6 * 20.0 - 7381.0
    speed = found.state.ship_speed
    assert found.state.brake_torque == pytest.approx(mapped, rel=1e-12)
    assert found.state.inflow == pytest.approx((0.95 - 0.004 * speed) * speed + 0.3, rel=1e-12)
    assert found.state.position == 0.0


def test_what_acts_is_told_with_the_state(frigate: Ship) -> None:
    found = equilibrium(frigate, 20, 1, inflow=1, resistance_factor=2)
    assert found.inputs == Inputs(20.0, 1.0, 1.0, resistance_factor=2.0)
    *acting, outside = found.inputs
    assert all(isinstance(value, float) for value in (*acting, *outside))  # one type, for kernels


@pytest.mark.parametrize("pitch", [0.4, 0.7, 1.0, 1.2])
@pytest.mark.parametrize("rack", [8.0, 16.0, 24.0, 32.0])
def test_ferry_has_steady_states_over_its_range(rack: float, pitch: float) -> None:
    ferry = load_ship("ferry")
    found = equilibrium(ferry, rack, pitch)
    assert found.state.ship_speed > 0.5
    assert_steady(ferry, found)


@pytest.mark.parametrize("rack", [7.0, 9.0, 14.0, 22.0, 31.0, 40.0])
@pytest.mark.parametrize("pitch", [0.6, 1.0, 1.4])
def test_frigate_has_steady_states_over_its_range(frigate: Ship, rack: float, pitch: float) -> None:
    if (
        rack == 7.0 and pitch > 0.6
    ):  # below 80 % of idle speed, where fuel ceases to ignite: it stalls
        with pytest.raises(ValueError, match="no steady state with the shaft turning ahead"):
            equilibrium(frigate, rack, pitch)
        return
    assert_steady(frigate, equilibrium(frigate, rack, pitch))


@pytest.mark.parametrize(
    ("name", "rack", "pitch"),
    [("frigate", 10.0, 0.8), ("ferry", 6.4, 0.982), ("frigate-at-sea", 12.0, 1.327)],
)
def test_engine_that_could_also_labour_below_idle_speed_runs(
    name: str, rack: float, pitch: float
) -> None:
    ship = load_ship(name)
    shaft_speed = equilibrium(ship, rack, pitch).state.shaft_speed
    beside = [equilibrium(ship, rack, pitch + by).state.shaft_speed for by in (-0.05, 0.05)]
    assert shaft_speed == pytest.approx(sum(beside) / 2.0, rel=0.02)


def test_torque_source_finds_its_speed() -> None:
    tree = load_ship("tito-neri-sine").model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "torque-command", "torque_max_N_m": 0.2}
    ship = Ship.model_validate(tree)
    for torque in (0.02, 0.05, 0.2):
        found = equilibrium(ship, torque, 1.0)
        assert_steady(ship, found)
        assert found.outputs.propeller_torque == pytest.approx(3.0 * torque - 0.051, rel=1e-9)


def test_disturbances_shift_the_steady_state(frigate: Ship, design_point: Equilibrium) -> None:
    slow = equilibrium(frigate, 22.0, 1.4, resistance_factor=1.5)
    assert slow.state.ship_speed < design_point.state.ship_speed
    pushed = equilibrium(frigate, 22.0, 1.4, inflow=0.5)
    assert pushed.outputs.advance_velocity == pytest.approx(0.95 * pushed.state.ship_speed + 0.5)


RUNAWAY = {
    "grows for ever": "2.0",
    "hears no rest": "1 + z * z",
    "grows with the time": "0.1 + 0.01 * abs(z)",
}


@pytest.mark.parametrize("rate", RUNAWAY.values(), ids=RUNAWAY)
def test_state_of_a_term_that_never_rests_is_named(frigate: Ship, rate: str) -> None:
    term = {"id": "runaway", "acts_on": "thrust", "expression": "0 * z", "state": "z", "rate": rate}
    ship = Ship.model_validate(frigate.model_dump(exclude_unset=True) | {"term": [term]})
    with pytest.raises(ValueError, match="the state z of term 'runaway' does not come to rest"):
        equilibrium(ship, 22.0, 1.2)


@pytest.mark.parametrize(
    ("rate", "rest"),
    [
        ("(3 - z) / 5", 3.0),
        ("(z - 3) / 5", 3.0),  # which it leaves at the least push, but where it rests
        ("z + 1", -1.0),
        ("0 * z", 0.0),
    ],
)
def test_state_of_a_term_is_found_where_it_rests(frigate: Ship, rate: str, rest: float) -> None:
    term = {"id": "a", "acts_on": "thrust", "expression": "1e3 * z", "state": "z", "rate": rate}
    ship = Ship.model_validate(frigate.model_dump(exclude_unset=True) | {"term": [term]})
    found = equilibrium(ship, 22.0, 1.2)
    assert found.state.term_1 == pytest.approx(rest, abs=1e-9)
    assert_steady(ship, found)


def test_engine_that_gives_no_torque_has_no_steady_state(frigate: Ship) -> None:
    with pytest.raises(
        ValueError, match=r"frigate: no steady state .* drive 2 mm and pitch ratio 1"
    ):
        equilibrium(frigate, 2.0, 1.0)


def test_motor_without_a_load_has_a_steady_state_against_dry_friction(tmp_path: Path) -> None:
    """The torque at its meter is 0, so rounding errors of its own torque are large beside that."""
    file = tmp_path / "motor.toml"
    file.write_text(
        'name = "motor"\n[hull]\nfixed = true\n[propeller]\nmodel = "none"\n[prime_mover]\n'
        'type = "dc-motor"\nmotor_constant_V_s_rad = 0.045\n'
        "armature_resistance_ohm = 2.345014598390954\nvoltage_max_V = 12.0\n[transmission]\n"
        "gear_ratio = 1.0\nefficiency = 1.0\ninertia_engine_side_kg_m2 = 1.1798e-05\n"
        "inertia_propeller_side_kg_m2 = 0.0\n"
        "coulomb_friction_engine_side_N_m = 0.01506108504676442\n"
        "[integration]\ntime_step_s = 0.0025\n"
    )
    for voltage in (6.0, 8.39979, 11.0):
        found = equilibrium(load_ship(file), voltage, 1.0)
        current = 0.01506108504676442 / 0.045
        expected = (voltage - 2.345014598390954 * current) / 0.045
        assert found.state.shaft_speed == pytest.approx(expected, rel=1e-9)
