"""Effects put onto a ship, and where each is first tried."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import catalogue
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.trial_ship import TrialShip, probe_scales
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import load_ship
from shaftline.plant.memory import HISTORY

from ..toy import FRICTION, ROWS, SPEED, Toy, entry, white
from ..turning import quick_tanker, swinging
from ..voyages import bench_tug, tug_run

ENGINE_FRICTION = entry("coulomb-friction (engine)")
EPISODE = entry("resistance-episode (hull)")


@pytest.fixture(scope="module")
def toy() -> Any:
    return Toy({}, white(0, 1.0, 1.0))


@pytest.fixture(scope="module")
def trial_ship(toy: Any) -> TrialShip:
    return TrialShip(toy)


def test_an_effect_sets_its_keys(trial_ship: TrialShip) -> None:
    assert trial_ship.settings(SizedEffect(ENGINE_FRICTION, (8000.0,))) == {FRICTION: 8000.0}
    episode = trial_ship.settings(SizedEffect(EPISODE, (0.5,), (60.0, 150.0)))
    assert episode == {
        "hull.episode_resistance_fraction": 0.5,
        "hull.episode_start_s": 60.0,
        "hull.episode_end_s": 150.0,
    }
    air = trial_ship.settings(SizedEffect(entry("ventilation (propeller)"), (0.4, 1.0)))
    assert air["ventilation.thrust_loss"] == pytest.approx(0.46)
    assert air["ventilation.static_head_share"] == air["ventilation.suction_gain"] == 0.0
    assert trial_ship.settings(SizedEffect(ENGINE_FRICTION, (1e9,))) == {FRICTION: 1e7}  # its range
    wake = trial_ship.settings(SizedEffect(entry("wake-speed-dependence (propeller)"), (0.02,)))
    assert wake["hull.wake_reference_speed_m_s"] == 7.0  # the mean of the nominal voyage


def test_records_and_ships_carry_the_same_numbers(trial_ship: TrialShip) -> None:
    effects = (SizedEffect(ENGINE_FRICTION, (8000.0,)), SizedEffect(EPISODE, (0.5,), (60.0, 150.0)))
    record, ship = trial_ship.record(effects), trial_ship.corrected(effects)
    assert record.tobytes() == ship.record().tobytes()
    assert ship.parameter(FRICTION).value == 8000.0
    assert trial_ship.record(()).tobytes() == trial_ship.nominal.tobytes()
    assert trial_ship.corrected(()) == trial_ship.ship


def test_an_effect_is_absent_at_the_ship_s_own_value() -> None:
    rubbing: Any = Toy(
        {}, white(0, 1.0, 1.0), ship=load_ship("frigate").with_values({FRICTION: 900.0})
    )
    own = TrialShip(rubbing)
    friction, gain = (
        ENGINE_FRICTION.parameters[0],
        entry("torque-sensor-gain (sensor)").parameters[0],
    )
    assert own.neutral(friction) == own.origin(friction) == 900.0
    assert own.neutral(gain) == own.origin(gain) == 1.0
    limit = entry("rack-rate-limit (engine)").parameters[0]
    assert own.neutral(limit) == math.inf
    assert own.origin(limit) == 0.0
    bend_at = entry("engine-torque-curvature (engine)").parameters[1]
    assert bend_at.absolute
    assert own.neutral(bend_at) == 0.0


def test_probes_are_scaled_by_the_nominal_voyage(trial_ship: TrialShip, toy: Any) -> None:
    friction = ENGINE_FRICTION.parameters[0]
    assert friction.of == "torque"
    assert trial_ship.probes(friction) == pytest.approx([2e5 * p for p in friction.probes])
    rms = float(np.sqrt(np.mean(SPEED**2)))
    viscous = entry("viscous-friction (engine)").parameters[0]
    assert trial_ship.probes(viscous) == pytest.approx([2e5 / rms * p for p in viscous.probes])
    drag = entry("quadratic-drag (motor)").parameters[0]
    assert trial_ship.probes(drag) == pytest.approx([2e5 / rms**2 * p for p in drag.probes])
    bend, bend_at = entry("engine-torque-curvature (engine)").parameters
    engine = 7.38 * float(np.mean(SPEED))
    assert trial_ship.probes(bend_at) == pytest.approx([p * engine for p in bend_at.probes])
    scale = 3e4 / (7.38 * rms) ** 2
    both = [-p * scale for p in reversed(bend.probes)] + [p * scale for p in bend.probes]
    assert trial_ship.probes(bend) == pytest.approx(both)


def test_probes_start_from_the_ship_s_own_value_and_stay_in_range(trial_ship: TrialShip) -> None:
    gain = entry("torque-sensor-gain (sensor)").parameters[0]
    steps = [*(-p for p in reversed(gain.probes)), *gain.probes]
    assert gain.signed
    assert trial_ship.probes(gain) == pytest.approx([1.0 + p for p in steps])
    fouling = entry("hull-fouling (hull)").parameters[0]
    low, high = trial_ship.range_of(fouling)
    assert (low, high) == (-0.5, 3.0)
    assert trial_ship.probes(fouling) == [-0.3, -0.1, -0.03, 0.03, 0.1, 0.3, 0.8]  # not -0.8
    ship = load_ship("frigate").with_values({fouling.key: 2.9})
    near: Any = Toy({}, white(0, 1.0, 1.0), ship=ship)
    assert TrialShip(near).probes(fouling) == pytest.approx([2.1, 2.6, 2.8, 2.87, 2.93, 3.0])


def test_trials_are_all_combinations(trial_ship: TrialShip) -> None:
    bend = entry("engine-torque-curvature (engine)")
    trials = list(trial_ship.trials(bend, [(0.0, 9.0)]))
    one, two = (trial_ship.probes(p) for p in bend.parameters)
    assert [t.values for t in trials] == [(a, b) for a in one for b in two]
    assert {t.window for t in trials} == {None}
    windows = [(0.0, 50.0), (50.0, 90.0)]
    episodes = list(trial_ship.trials(EPISODE, windows))
    assert [t.window for t in episodes[:: len(episodes) // 2]] == windows
    assert list(trial_ship.trials(EPISODE, [])) == []


def test_the_smallest_trials_are_those_nearest_to_none(trial_ship: TrialShip) -> None:
    (smallest,) = trial_ship.smallest_trials(ENGINE_FRICTION, [])
    assert smallest.values == (trial_ship.probes(ENGINE_FRICTION.parameters[0])[0],)
    bend = entry("engine-torque-curvature (engine)")
    near = list(trial_ship.smallest_trials(bend, []))
    scale = min(p for p in trial_ship.probes(bend.parameters[0]) if p > 0.0)
    assert [t.values[0] for t in near] == [scale] * len(
        bend.parameters[1].probes
    )  # the positive one
    current = entry("current (hull)")
    assert current.parameters[0].signed
    (drift,) = trial_ship.smallest_trials(current, [])
    assert drift.values[0] == min(p for p in trial_ship.probes(current.parameters[0]) if p > 0.0)
    assert len(list(trial_ship.smallest_trials(EPISODE, [(0.0, 50.0), (50.0, 90.0)]))) == 2


def test_scales_are_those_of_the_nominal_voyage(toy: Any) -> None:
    found = probe_scales(toy)
    drive, rms = toy.drive_rows, float(np.sqrt(np.mean(SPEED**2)))
    turns = float(SPEED.max()) / (2.0 * math.pi)
    water, screw = toy.ship.water, toy.ship.propeller
    pressure = 101325.0 - 1671.0 + water.density_kg_m3 * 9.81 * screw.depth_m
    line = toy.ship.transmission
    assert found == pytest.approx(
        {
            "unit": 1.0,
            "time_step": 0.05,
            "torque": 2e5,
            "torque/drive": 2e5 / float(np.sqrt(np.mean(drive**2))),
            "torque/shaft_speed": 2e5 / rms,
            "torque/shaft_speed/shaft_speed": 2e5 / rms**2,
            "brake_torque/engine_speed/engine_speed": 3e4 / (7.38 * rms) ** 2,
            "force": 1.5e5,
            "shaft_speed": rms,
            "engine_speed": 7.38 * float(SPEED.mean()),
            "ship_speed": 7.0,
            "drive": float(np.sqrt(np.mean(drive**2))),
            "drive_top": float(drive.max()),
            "current_top": 0.0,
            "current": 1e-9,
            "thrust": 2e5,
            "shaft_angle": 1.0,
            "torque/shaft_angle": 2e5,
            "torque_top": 7.38 * 3e4,
            "interval": 1.0,
            "record": ROWS - 1.0,
            "inertia": line.inertia_propeller_side_kg_m2 + 0.1 * line.inertia_engine_side_kg_m2,
            "shaft_time": (53697.0 + 14411.0) * rms / 2e5,
            "sigma_top": pressure / (0.5 * water.density_kg_m3 * (turns * screw.diameter_m) ** 2),
        }
    )
    used = {p.of for effect in catalogue() for p in effect.parameters}
    used |= {of for e in catalogue() for _, of in e.fixed if isinstance(of, str) and "." not in of}
    used = {
        of for of in used if "." not in of and not of.startswith("side_force/")
    }  # of one that turns
    outside = {name for name in used if name.startswith("force/")}
    assert outside == {
        "force/head_wind/head_wind",
        "force/rudder_angle/rudder_angle",
        "force/sway_speed/yaw_rate",
    }
    assert used - outside <= set(found)


@pytest.mark.parametrize("key", ["sensors.torque_delay_s", "sensors.speed_delay_s"])
def test_no_delay_is_tried_that_the_plant_cannot_look_back(
    monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setattr(Toy, "dt", 0.005)
    near: Any = Toy({}, white(0, 1.0, 1.0))
    ship = TrialShip(near)
    name = "torque-sensor-delay" if "torque" in key else "speed-sensor-delay"
    late = entry(f"{name} (sensor)")
    assert ship.range_of(late.parameters[0]) == (0.0, 0.005 * (HISTORY - 2))
    assert ship.settings(SizedEffect(late, (5.0,), None)) == {key: 0.005 * (HISTORY - 2)}
    assert all(value <= 0.005 * (HISTORY - 2) for value in ship.probes(late.parameters[0]))


def test_scales_have_no_sign_and_are_never_zero(toy: Any) -> None:
    samples = toy.nominal_samples
    astern: Any = SimpleNamespace(
        nominal_samples=samples
        | {"shaft_speed": -SPEED, "motor_current": np.array([-3.0, 2.0]), "propeller_torque": 0.0},
        plant=toy.plant,
        replay=SimpleNamespace(
            drive_rows=-toy.drive_rows,
            outside={},
            recorded={},
            runs=toy.runs,
            interval_s=2.0,
            every=4,
            ship=toy.ship,
        ),
    )
    found, ahead = probe_scales(astern), probe_scales(toy)
    for name in ("shaft_speed", "engine_speed", "sigma_top", "drive", "drive_top"):
        assert found[name] == pytest.approx(ahead[name])
    assert found["current_top"] == 3.0
    assert found["torque"] == 1e-9
    assert (found["interval"], found["record"]) == (0.5, ROWS - 1.0)
    gear = float(toy.plant["gear_ratio"])
    assert found["torque_top"] == ahead["torque_top"] == pytest.approx(3e4 * gear)


def test_a_delay_is_no_shorter_than_the_recording_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    (delay,) = entry("engine-dead-time (engine)").parameters
    (play,) = entry("pitch-backlash (pitch-actuator)").parameters
    toy: Any = Toy({}, white(0, 1.0, 1.0))
    assert TrialShip(toy).smallest_size(delay) == 0.5  # of rows a second apart
    assert TrialShip(toy).resolution(delay) == 1.0
    monkeypatch.setattr(Toy, "line", True)
    assert TrialShip(toy).smallest_size(delay) == 1.0
    monkeypatch.setattr(Toy, "every", 4)
    assert TrialShip(toy).smallest_size(delay) == 0.25
    assert TrialShip(toy).smallest_size(play) == 0.0
    toy.quantisation = {"pitch_ratio": 0.03}
    assert TrialShip(toy).smallest_size(play) == TrialShip(toy).resolution(play) == 0.03
    assert min(TrialShip(toy).probes(play)) >= 0.03


def test_scales_of_a_ship_that_turns_are_those_of_her_turning() -> None:
    balances = Balances(JointReplay(quick_tanker(), swinging(quick_tanker(), seconds=60.0)))
    found, samples = probe_scales(balances), balances.nominal_samples
    across = 3515.2 * rms_of(samples["ship_speed"] * samples["yaw_rate"])
    sway, yaw = rms_of(samples["sway_speed"]), rms_of(samples["yaw_rate"])
    assert found["side_force/sway_speed/sway_speed"] == pytest.approx(across / sway**2)
    drag = rms_of(samples["resistance"])
    assert found["force/sway_speed/yaw_rate"] == pytest.approx(drag / (sway * yaw))
    trial_ship = TrialShip(balances)
    damping = next(e for e in catalogue() if e.id == "yaw-damping").parameters[0]
    shares = np.array([-0.5, -0.2, -0.05, 0.05, 0.2, 0.5])
    assert trial_ship.probes(damping) == pytest.approx(-0.049 + 0.049 * shares)


def rms_of(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_a_plausible_range_counts_in_the_scale_that_it_names(
    trial_ship: TrialShip, toy: Any
) -> None:
    most = 3e4 * float(toy.plant["gear_ratio"])  # the engine's, at the shaft
    friction = entry("coulomb-friction (engine)").parameters[0]
    assert trial_ship.plausible_range(friction) == pytest.approx((0.0, most))
    lag = entry("engine-torque-lag (engine)").parameters[0]
    assert trial_ship.plausible_range(lag) == pytest.approx((0.0, 0.1 * (ROWS - 1.0)))
    fouling = entry("hull-fouling (hull)").parameters[0]
    assert trial_ship.plausible_range(fouling) == (-0.05, 1.0)
    current = entry("current (hull)").parameters[0]
    assert trial_ship.plausible_range(current) == (-math.inf, math.inf)


def test_a_motor_s_largest_torque_is_that_of_standstill() -> None:
    """K U / R at the highest voltage recorded, times the gear ratio."""
    tug, table = bench_tug(), tug_run()
    found = probe_scales(Balances(JointReplay(tug, table)))
    constant, resistance, gear = (
        tug.parameter(key).value
        for key in (
            "prime_mover.motor_constant_V_s_rad",
            "prime_mover.armature_resistance_ohm",
            "transmission.gear_ratio",
        )
    )
    top = float(table["motor_voltage_V"].abs().max())
    # a reversal at full speed draws more than that
    assert constant * top / resistance * gear <= found["torque_top"]
    assert found["torque_top"] < 2.0 * constant * top / resistance * gear
    at_rest = table.assign(motor_voltage_V=0.0)
    at_rest.loc[len(at_rest) - 1, "motor_voltage_V"] = 5.0  # comes too late to act
    found = probe_scales(Balances(JointReplay(tug, at_rest)))
    assert found["torque_top"] == pytest.approx(constant * 5.0 / resistance * gear)
