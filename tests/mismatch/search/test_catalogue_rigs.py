"""Effects of servos, thrusters and their sensors: conceal each in a recording, find it again."""

from __future__ import annotations

import functools
import warnings
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Diagnosis, catalogue, diagnose
from shaftline.mismatch.recordings.excitation import shaft_runs_one_way
from shaftline.mismatch.search.catalogue import SizedEffect, applicable_effects, parse_entries
from shaftline.mismatch.search.trial_ship import TrialShip
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, ValidityWarning, load_ship
from shaftline.plant.replay import simulate_recording

from ..voyages import bench_tug, tug_run
from .test_catalogue import one_round  # noqa: F401 (a fixture)

ON_THE_BENCH: list[tuple[str, tuple[float, ...]]] = [
    ("command-delay (motor)", (0.06,)),
    ("command-lag (motor)", (0.3,)),
]

ON_THE_THRUSTER: list[tuple[str, tuple[float, ...]]] = [
    ("thrust-sensor-gain (sensor)", (0.85,)),
    ("thrust-sensor-bias (sensor)", (6.0,)),
    ("thrust-sensor-lag (sensor)", (0.3,)),
    ("current-sensor-gain (sensor)", (1.12,)),
    ("speed-sensor-gain (sensor)", (1.1,)),
    ("current-sensor-bias (sensor)", (-0.3,)),
    ("astern-thrust (propeller, thrust-alone)", (-0.3,)),
    ("thrust-loss (propeller)", (-0.2,)),
    ("torque-sensor-lag (sensor)", (0.25,)),
]

ON_A_HELD_SHAFT: list[tuple[str, tuple[float, ...]]] = [
    ("astern-thrust (propeller, on-a-rig)", (0.7,)),
]

NOISE = {
    "shaft_speed_rad_s": 0.3,
    "thrust_N": 0.4,
    "motor_current_A": 0.02,
    "shaft_torque_N_m": 0.004,
}
"""Of the thruster's channels."""


def steps(rows: int, size: float, hold: int, seed: int) -> Any:
    """Commands of either sign, each held over so many rows."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-size, size, -(-rows // hold)), hold)[:rows]


def recorded(ship: Ship, table: pd.DataFrame, noise: dict[str, float]) -> pd.DataFrame:
    """A recording of a ship under given commands, with noise on each channel."""
    rng = np.random.default_rng(7)
    run = simulate_recording(ship, table)[list(table)]
    for column, rms in noise.items():
        run[column] += rms * rng.standard_normal(len(run))
    return run


@functools.cache
def thruster() -> Ship:
    """The published thruster at a time step of 10 ms, with inertia behind a torque gauge."""
    tree = load_ship("rov-thruster").model_dump(exclude_unset=True)
    tree["prime_mover"]["armature_inductance_H"] = 0.0
    tree["integration"]["time_step_s"] = 0.01
    return Ship.model_validate(tree)


def thruster_run(ship: Ship) -> pd.DataFrame:
    """30 s of the thruster in both directions; all that such a rig measures."""
    rows = 1500
    top = 0.9 * ship.parameter("prime_mover.voltage_max_V").value
    table = pd.DataFrame(
        {"time_s": 0.02 * np.arange(rows), "motor_voltage_V": steps(rows, top, 50, 1)}
    )
    return recorded(ship, table.assign(**dict.fromkeys(NOISE, 0.0)), NOISE)


@functools.cache
def held_shaft() -> Ship:
    """A model's propeller on a rig that holds its speed, thrust and torque measured."""
    tree = load_ship("kvlcc2").model_dump(exclude_unset=True)
    tree = {k: v for k, v in tree.items() if k not in ("manoeuvring", "rudder")}
    tree["hull"] = {"fixed": True}
    return Ship.model_validate(tree)


def held_run(ship: Ship) -> pd.DataFrame:
    """A propeller that turns both ways at bollard pull."""
    time = np.arange(0.0, 300.0, 0.2)
    turns = 60.0 * np.sign(np.sin(time / 20.0)) * (0.7 + 0.3 * np.sin(time / 70.0))
    table = pd.DataFrame({"time_s": time, "shaft_speed_rad_s": turns, "thrust_N": 0.0})
    with warnings.catch_warnings():  # astern the curves of ahead rotation act
        warnings.simplefilter("ignore", ValidityWarning)
        run = recorded(ship, table, {"thrust_N": 0.05})
    return run.assign(shaft_speed_rad_s=turns)


def true_ship(nominal: Ship, plain: pd.DataFrame, label: str, values: tuple[float, ...]) -> Ship:
    """The ship with an effect of some size on it."""
    effect = next(e for e in catalogue() if e.label == label)
    trial_ship = TrialShip(Balances(JointReplay(nominal, plain)))
    return trial_ship.corrected((SizedEffect(effect, values),))


def names(found: Diagnosis) -> set[str]:
    """Ids of the first finding and of the effects that the recording cannot tell from it."""
    first = found.findings[0]
    return {first.effect.id, *(c.effect.id for c in first.rivals)}


def check(found: Diagnosis, label: str, values: tuple[float, ...], rel: float = 0.15) -> None:
    """Check that an effect of some size was identified, or one that cannot be told from it."""
    assert found.verdict == "explained"
    assert label.split(" (")[0] in names(found)
    first = found.findings[0]
    if first.effect.label == label:
        assert [e.value for e in first.estimates] == pytest.approx(list(values), rel=rel)


@pytest.mark.parametrize(("label", "values"), ON_THE_BENCH, ids=[e for e, _ in ON_THE_BENCH])
def test_an_effect_of_a_drive_on_a_bench_is_identified(
    label: str, values: tuple[float, ...]
) -> None:
    ship = true_ship(bench_tug(), tug_run(), label, values)
    check(diagnose(bench_tug(), tug_run(ship, seed=1)), label, values)


@pytest.mark.parametrize(("label", "values"), ON_THE_THRUSTER, ids=[e for e, _ in ON_THE_THRUSTER])
def test_an_effect_on_a_thruster_s_channels_is_identified(
    label: str, values: tuple[float, ...]
) -> None:
    ship = true_ship(thruster(), thruster_run(thruster()), label, values)
    check(diagnose(thruster(), thruster_run(ship)), label, values)


def test_a_loss_of_thrust_is_not_told_from_a_sensor_s_gain_on_a_fixed_rig() -> None:
    """Nothing but the sensor feels the thrust of a rig that does not move."""
    ship = true_ship(thruster(), thruster_run(thruster()), "thrust-loss (propeller)", (-0.2,))
    assert names(diagnose(thruster(), thruster_run(ship))) == {"thrust-loss", "thrust-sensor-gain"}


def test_effects_of_an_angle_or_a_sensor_ask_for_its_column(servo: Ship) -> None:
    def ids(ship: Ship, *columns: str) -> set[str]:
        return {e.id for e in applicable_effects(ship, columns)}

    thrust = {"thrust-loss", "astern-thrust", "thrust-sensor-gain", "thrust-sensor-lag"}
    assert thrust <= ids(thruster(), "thrust_N")
    assert not thrust & ids(thruster(), "motor_current_A")
    assert not thrust & ids(servo, "thrust_N")
    current = {"current-sensor-gain", "current-sensor-bias"}
    assert current <= ids(thruster(), "motor_current_A")
    assert not current & ids(servo, "motor_current_A")
    # on a hull that moves a loss of thrust slows the ship: the thrust deduction's matter
    assert "thrust-loss" not in ids(load_ship("kvlcc2"), "thrust_N")
    frigate = ids(load_ship("frigate"), "thrust_N", "shaft_torque_N_m", "shaft_speed_rad_s")
    assert not {"astern-thrust", "torque-sensor-lag", "speed-sensor-gain", "command-lag"} & frigate
    # without the current, another motor constant and inertia would do as well
    assert "speed-sensor-gain" not in ids(thruster(), "shaft_speed_rad_s")
    assert "speed-sensor-gain" in ids(thruster(), "shaft_speed_rad_s", "motor_current_A")
    labels = {e.label for e in applicable_effects(thruster(), ["thrust_N"])}
    assert "astern-thrust (propeller, on-a-rig)" not in labels  # the motor's load says the same


def test_effects_of_reversing_are_offered_where_something_reverses() -> None:
    both = {e.id for e in applicable_effects(thruster(), ["thrust_N"])}
    ahead = {e.id for e in applicable_effects(thruster(), ["thrust_N"], one_way=True)}
    assert both - ahead == {"direction-asymmetry", "astern-thrust"}
    run = thruster_run(thruster())
    assert not shaft_runs_one_way(thruster(), [run])
    assert shaft_runs_one_way(thruster(), [run.abs()])
    # a shaft that a brake or its inertia turns the other way counts as well
    assert not shaft_runs_one_way(
        thruster(), [run.assign(motor_voltage_V=run["motor_voltage_V"].abs())]
    )


def test_a_plausible_range_whose_ends_are_swapped_is_refused() -> None:
    text = """
[[term]]
id = "drag"
balance = "motor"
acts_on = "load_torque"
expression = "c * shaft_speed"
[term.parameters]
c = { unit = "N m s/rad", probes = [1.0], plausible = [2.0, 1.0] }
"""
    with pytest.raises(ValueError, match=r"term drag: parameters\.c: .*low must be below high"):
        parse_entries(text)
    (own,) = parse_entries(text.replace("[2.0, 1.0]", "[0.0, 0.5], plausible_of = 'torque'"))
    assert (own.parameters[0].plausible, own.parameters[0].plausible_of) == ((0.0, 0.5), "torque")


@pytest.mark.parametrize(("label", "values"), ON_A_HELD_SHAFT, ids=[e for e, _ in ON_A_HELD_SHAFT])
def test_weaker_blades_astern_are_identified_on_a_rig_by_the_thrust(
    label: str, values: tuple[float, ...]
) -> None:
    ship = true_ship(held_shaft(), held_run(held_shaft()), label, values)
    check(diagnose(held_shaft(), held_run(ship)), label, values)
