"""Anti-spin controller at one instant: the equations of the paper written out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.anti_spin import ANTI_SPIN_MEMORY, AntiSpin, control_all, torque_meter_step
from shaftline.baselines.thrust_control import desired_speed, thrust_per_torque
from shaftline.baselines.ventilation import TORQUE_LOSS, bollard_gain, shaft_load
from shaftline.observers.torque_curve import model_torque
from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.dynamics import evaluate
from shaftline.plant.open_water import open_water

ROUGH = load_ship("frigate").with_values(
    {
        "transmission.coulomb_friction_propeller_side_N_m": 3000.0,
        "transmission.viscous_friction_propeller_side_N_m_s_rad": 300.0,
        "transmission.viscous_friction_engine_side_N_m_s_rad": 100.0,
        "propeller.relative_rotative_efficiency": 0.98,
        "propeller.entrained_inertia_kg_m2": 1600.0,
    }
)
LOW, HIGH = (rpm * math.pi / 30.0 / 7.38 for rpm in (350.0, 1000.0))


@pytest.fixture(scope="module")
def controller() -> AntiSpin:
    return AntiSpin(ROUGH, 0.5)


def test_step_of_the_measured_torque_is_that_of_the_plant(frigate: Ship) -> None:
    plant = frigate.record()
    start = equilibrium(frigate, 20.0, 1.4)
    measurements = [
        evaluate(plant, start.state, start.inputs._replace(drive=rack), 1.4)[1].shaft_torque
        for rack in (20.0, 26.0)
    ]
    engine_speed = float(plant["gear_ratio"]) * start.state.shaft_speed
    jump = torque_meter_step(plant, engine_speed, 20.0, 26.0)
    assert jump == pytest.approx(measurements[1] - measurements[0])


def test_thrust_per_torque_is_that_of_the_propeller(frigate: Ship) -> None:
    plant, settings = frigate.record(), AntiSpin(frigate).settings["law"]
    for j in (0.2, 0.7, 1.1):
        torque = model_torque(plant, j * 4.2 * 10.0 / (2.0 * math.pi), 10.0, 1.4)
        expected = open_water(plant["kt"], j, 1.4) / (4.2 * open_water(plant["kq"], j, 1.4))
        found = thrust_per_torque(settings, torque, 10.0, 1.4)
        assert found == pytest.approx(expected)
    # Limited to the end of the working range at a small torque.
    ends = [thrust_per_torque(settings, torque, 10.0, 1.4) for torque in (1e3, -1e5)]
    assert ends[0] == ends[1] > 0.0


def test_thrust_per_torque_from_bollard_to_the_working_ranges_end(controller: AntiSpin) -> None:
    plant, settings = ROUGH.record(), controller.settings["law"]

    def gain(j: float, pitch: float) -> float:
        kt, kq = open_water(plant["kt"], j, pitch), open_water(plant["kq"], j, pitch) / 0.98
        return float(kt / (4.2 * kq))

    bollard = model_torque(plant, 0.0, 10.0, 1.2)
    assert thrust_per_torque(settings, 1.2 * bollard, 10.0, 1.2) == pytest.approx(gain(0.0, 1.2))
    assert thrust_per_torque(settings, 1e5, 0.0, 1.2) == pytest.approx(gain(0.0, 1.2))
    assert thrust_per_torque(settings, 0.0, 10.0, 1.2) == pytest.approx(gain(0.9 * 1.2, 1.2))


def estimate_of(shaft_speed: float, loss: float, pitch: float) -> Any:
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    estimate["shaft_speed"], estimate["torque_loss"] = shaft_speed, loss
    estimate["measured_pitch"] = pitch
    return estimate


def desired(settings: Any, estimate: Any, thrust: float, pitch: float) -> float:
    """Eqs. 17 and 19, within the speeds of the engine."""
    plant = ROUGH.record()
    gain = bollard_gain(plant, pitch)
    torque = gain * estimate["shaft_speed"] ** 2 + estimate["torque_loss"]
    beyond = thrust / thrust_per_torque(settings, torque, float(estimate["shaft_speed"]), pitch)
    beyond -= estimate["torque_loss"]
    return min(max(math.copysign(math.sqrt(abs(beyond) / gain), beyond), LOW), HIGH)


@pytest.mark.parametrize(
    ("thrust", "loss"),
    [(1.2e5, -3e5), (2e5, -3e5), (1.2e5, -1e5), (1e3, -1e5), (1e3, 4e5), (9e5, -2e5)],
)
def test_desired_speed_gives_the_thrust_despite_the_loss(
    controller: AntiSpin, thrust: float, loss: float
) -> None:
    estimate = estimate_of(10.0, loss, 1.3)
    found = desired_speed(controller.settings["law"], estimate, thrust, 1.3)
    assert found == pytest.approx(desired(controller.settings["law"], estimate, thrust, 1.3))


def test_desired_speeds_reach_both_ends(controller: AntiSpin) -> None:
    assert desired_speed(
        controller.settings["law"], estimate_of(10.0, 4e5, 1.3), 1e3, 1.3
    ) == pytest.approx(LOW)
    assert desired_speed(
        controller.settings["law"], estimate_of(10.0, -3e5, 1.3), 9e5, 1.3
    ) == pytest.approx(HIGH)


def test_engines_that_do_not_step_make_no_jump(frigate: Ship) -> None:
    for key, value in (("lag_s", 0.5), ("dead_time_s", 0.2), ("rack_rate_limit_mm_s", 5.0)):
        slow = frigate.with_values({f"prime_mover.{key}": value})
        assert torque_meter_step(slow.record(), 74.0, 20.0, 26.0) == 0.0
    assert torque_meter_step(frigate.record(), 74.0, 20.0, 20.0) == 0.0


def instant(
    controller: AntiSpin,
    memory: Any,
    *,
    calm: float,
    thrust: float,
    speed: float,
    torque: float,
    pitch: float,
    ship: float,
    rack: float,
) -> float:
    """Return the rack of one ship at one instant; the memory changes."""
    memory["measured"] = [0.0, speed, torque, pitch, rack, ship, 0.0, 0.0]
    return float(control_all(controller.settings, memory, np.array([calm]), np.array([thrust]))[0])


def written_out(
    controller: AntiSpin,
    before: Any,
    after: Any,
    calm: float,
    thrust: float,
    speed: float,
    pitch: float,
) -> tuple[float, float]:
    """Eqs. 20 and 21 give the reference and Q_m from estimates and detection."""
    settings = controller.settings["law"]
    loss = float(after["estimate"]["torque_loss"])
    wanted = desired(settings, after["estimate"], thrust, pitch)
    if after["detection"]["ventilating"]:
        wanted = min(wanted, max(0.92 * calm, LOW))
    reference, rate, e1 = speed, 0.0, 0.0
    if before["started"]:
        e1 = float(before["error_integral"])
        cutoff, h = 1.5, 0.5  # critically damped
        away, old = float(before["reference"]) - wanted, float(before["reference_rate"])
        decay, turn = math.exp(-cutoff * h), old + cutoff * away
        reference = wanted + decay * (away + turn * h)
        rate = decay * (old - cutoff * turn * h)
    inertia = 53697.0 + 14411.0 + 1600.0
    gamma, kp, ki = 0.1, 0.6 * inertia, 0.05 * inertia
    demand = inertia * rate + loss + shaft_load(settings["observer"], pitch, reference - gamma * e1)
    demand += 300.0 * reference - (ki + gamma * kp) * e1 - kp * (speed - reference)
    return reference, demand


def test_controller_over_a_voyage_with_and_without_air(controller: AntiSpin) -> None:
    rng = np.random.default_rng(4)
    memory = np.zeros(1, ANTI_SPIN_MEMORY)
    plant, rack, detected, free = ROUGH.record(), 18.0, 0, 0
    for k in range(60):
        calm, thrust = 9.5, 1.25e5
        speed = 9.5 + 0.4 * math.sin(0.5 * k) + rng.normal(0.0, 0.02)
        air = 0.3 if 20 <= k < 40 else 1.0
        torque = air * (1.3e5 + rng.normal(0.0, 3e3))
        before = memory[0].copy()
        rack_before = rack
        rack = instant(
            controller,
            memory,
            calm=calm,
            thrust=thrust,
            speed=speed,
            torque=torque,
            pitch=1.3,
            ship=8.0,
            rack=rack_before,
        )
        after = memory[0]
        reference, demand = written_out(controller, before, after, calm, thrust, speed, 1.3)
        assert after["reference"] == pytest.approx(reference, rel=1e-9)
        assert after["shaft_torque"] == pytest.approx(demand, rel=1e-9)
        brake = (demand + 100.0 * speed) / (7.38 * 0.95)
        engine = 7.38 * speed
        limit = torque_limit(plant, engine)
        allowed = (min(brake, limit) + 45.5 * engine + 7381.0) / 1428.6
        assert rack == pytest.approx(min(max(allowed, 0.0), 40.0), rel=1e-9)
        integral, e2 = before["error_integral"], speed - reference
        if 0.0 < rack < 40.0 and brake < limit:
            free += 1
            assert after["error_integral"] == pytest.approx(integral + 0.5 * e2, abs=1e-12)
        detected += int(after["detection"]["ventilating"])
        jump = torque_meter_step(plant, engine, rack_before, rack)
        assert after["estimate"]["measured_torque"] == pytest.approx(torque + jump)
    assert 5 < detected < 55
    assert free > 40


@pytest.mark.parametrize("pitch", [0.3, 1.9])
def test_pitch_is_taken_within_the_ships_range(controller: AntiSpin, pitch: float) -> None:
    held = min(max(pitch, 0.6), 1.4)
    common = {"calm": 9.0, "thrust": 1e5, "speed": 9.0, "torque": 1e5, "ship": 7.0, "rack": 15.0}
    one, other = np.zeros(1, ANTI_SPIN_MEMORY), np.zeros(1, ANTI_SPIN_MEMORY)
    racks = [
        instant(controller, memory, pitch=p, **common)
        for memory, p in ((one, pitch), (other, held))
    ]
    assert racks[0] == racks[1]
    one["measured"] = other["measured"]  # apart from the pitch that was given
    assert one == other


def wound(
    controller: AntiSpin, reference: float, speed: float, torque: float, integral: float
) -> Any:
    """Return the rack and the change of the integral at a constant reference."""
    memory = np.zeros(1, ANTI_SPIN_MEMORY)
    instant(
        controller,
        memory,
        calm=9.0,
        thrust=1e5,
        speed=speed,
        torque=torque,
        pitch=1.3,
        ship=7.0,
        rack=15.0,
    )
    memory["reference"], memory["error_integral"] = reference, integral
    rack = instant(
        controller,
        memory,
        calm=9.0,
        thrust=1e5,
        speed=speed,
        torque=torque,
        pitch=1.3,
        ship=7.0,
        rack=15.0,
    )
    return (
        rack,
        float(memory["error_integral"][0]) - integral,
        speed - float(memory["reference"][0]),
    )


def test_integral_moves_away_from_a_limit_only(controller: AntiSpin) -> None:
    plant = ROUGH.record()
    # Much too slow: the engine is at its limit, and the integral is held.
    rack, moved, e2 = wound(controller, 14.0, 8.0, 1e5, 0.0)
    assert rack_torque(plant, 7.38 * 8.0, rack) == pytest.approx(torque_limit(plant, 7.38 * 8.0))
    assert e2 < 0.0
    assert moved == 0.0
    # The integral is also held at the end stop of the rack.
    short = AntiSpin(ROUGH.with_values({"prime_mover.rack_max_mm": 14.0}))
    rack, moved, e2 = wound(short, 11.0, 10.0, 1e5, 0.0)
    assert rack == 14.0
    assert rack_torque(plant, 73.8, rack) < 0.9 * torque_limit(plant, 73.8)
    assert e2 < 0.0
    assert moved == 0.0
    # Much too fast: no fuel, and the integral is held.
    rack, moved, e2 = wound(controller, 6.0, 12.0, 1e5, 0.0)
    assert rack == 0.0
    assert e2 > 0.0
    assert moved == 0.0
    # At a limit with an error that reduces the integral, the integral changes.
    rack, moved, e2 = wound(controller, 6.0, 9.0, 1e5, -200.0)
    assert rack_torque(plant, 7.38 * 9.0, rack) == pytest.approx(torque_limit(plant, 7.38 * 9.0))
    assert moved == pytest.approx(0.5 * e2)
    assert e2 > 0.0
    rack, moved, e2 = wound(controller, 12.0, 9.0, 1e5, 200.0)
    assert rack == 0.0
    assert moved == pytest.approx(0.5 * e2)
    assert e2 < 0.0


def test_without_anti_spin_air_changes_nothing() -> None:
    speeds = {}
    for switch in (True, False):
        controller, memory = AntiSpin(ROUGH, anti_spin=switch), np.zeros(1, ANTI_SPIN_MEMORY)
        for torque in (1.3e5, 4e4, 4e4, 4e4):
            instant(
                controller,
                memory,
                calm=9.5,
                thrust=1.25e5,
                speed=9.5,
                torque=torque,
                pitch=1.3,
                ship=8.0,
                rack=18.0,
            )
        assert memory["detection"]["ventilating"][0] == 1
        speeds[switch] = float(memory["reference"][0])
    assert speeds[True] < speeds[False] - 0.1
