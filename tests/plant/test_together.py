"""Steps of several ships at once give the bits of single steps, and are taken where they can be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.core.compiled import compiled
from shaftline.core.lanes import LANES
from shaftline.plant import equilibrium, get_sea, load_ship, realise
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.ship import Ship
from shaftline.plant.state import STATE
from shaftline.plant.stepping import Disturbance, StepInputs, prepare, step
from shaftline.plant.together import GROUP, begin_lane, complete_lane, gather, respond
from shaftline.plant.waves import SEA

STEPS = 120
RESPONDED = 2


@compiled
def _disturbed(k: float, i: int) -> Disturbance:
    swing = 0.1 * np.sin(0.3 * k + i)
    return Disturbance(swing, 0.5 * swing, 1.0 + swing, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@compiled
def _acting(commands: Any, k: int, i: int) -> StepInputs:
    disturbed = _disturbed(k, i), _disturbed(k + 0.5, i), _disturbed(k + 1.0, i)
    return StepInputs(commands[k, 0, i], commands[k, 1, i], 0.0, *disturbed)


@compiled
def together(
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    commands: Any,
    dt: float,
    kept: Any,
    group: Any,
) -> int:
    """Step a batch; return how many steps of groups were computed at once."""
    at_once = 0
    for first in range(0, len(plants), LANES):
        count = gather(group, plants, states, first, len(plants))
        for k in range(commands.shape[0]):
            for lane in range(count):
                i = first + lane
                acting = _acting(commands, k, i)
                begin_lane(group, lane, plants[i], states[i], memories[i], seas[i], acting, dt)
            respond(group, plants, dt)
            at_once += group.status == RESPONDED
            for lane in range(count):
                i = first + lane
                outputs = complete_lane(
                    group, lane, plants[i], states[i], memories[i], seas[i],
                    _acting(commands, k, i), dt,
                )  # fmt: skip
                kept[k, i, 0], kept[k, i, 1] = outputs.thrust, outputs.shaft_torque
                kept[k, i, 2], kept[k, i, 3] = outputs.resistance, outputs.submergence
    return at_once


@compiled
def apart(
    plants: Any, states: Any, memories: Any, seas: Any, commands: Any, dt: float, kept: Any
) -> None:
    """Step each ship by itself."""
    for i in range(len(plants)):
        for k in range(commands.shape[0]):
            acting = _acting(commands, k, i)
            outputs = step(plants[i], states[i], memories[i], seas[i], acting, dt)
            kept[k, i, 0], kept[k, i, 1] = outputs.thrust, outputs.shaft_torque
            kept[k, i, 2], kept[k, i, 3] = outputs.resistance, outputs.submergence


def compare(
    ships: list[Ship], sea: str | None = None, low: float = 0.3, heading_rad: float = 0.0
) -> int:
    """Assert that a batch has the bits of single ships; return the steps computed at once."""
    n, rng, dt = len(ships), np.random.default_rng(3), ships[0].time_step_s
    plants, states = np.zeros(n, PLANT), np.zeros(n, STATE)
    memories, seas = np.zeros(n, MEMORY), np.zeros(n, SEA)
    commands = np.empty((STEPS, 2, n))
    calm = Disturbance(0.0, 0.0, 1.0)
    waves = None if sea is None else get_sea(sea)
    for i, ship in enumerate(ships):
        plants[i] = ship.record()
        most, pitch = float(plants[i]["drive_max"]), float(plants[i]["pitch_ratio_max"])
        states[i] = tuple(equilibrium(ship, 0.6 * most, 0.9 * pitch).state)
        states[i]["heading"] = heading_rad
        if waves is not None:
            seas[i] = realise(waves, ship.propeller.depth_m, seed=i)
        prepare(plants[i], states[i], memories[i], seas[i], 0.6 * most, calm, dt)
        commands[:, 0, i] = np.repeat(rng.uniform(low, 1.0, STEPS // 20), 20) * most
        commands[:, 1, i] = np.repeat(rng.uniform(0.5, 1.1, STEPS // 20), 20) * pitch
    other = states.copy(), memories.copy(), seas.copy()
    kept, alone = np.zeros((STEPS, n, 4)), np.zeros((STEPS, n, 4))
    at_once = together(plants, states, memories, seas, commands, dt, kept, np.zeros(1, GROUP)[0])
    apart(plants, *other, commands, dt, alone)
    assert np.array_equal(kept, alone)
    for found, single in zip((states, memories, seas), other, strict=True):
        assert found.tobytes() == single.tobytes()
    return int(at_once)


FRIGATE = load_ship("frigate")
EFFECTS: dict[str, dict[str, Any]] = {
    "none": {},
    "losses": {
        "propeller.cavitation_breakdown": 0.6,
        "propeller.cavitation_onset_number": 4.0,
        "propeller.roughness_drag": 0.002,
        "hull.fouling_fraction": 0.2,
        "hull.resistance_exponent": 2.3,
        "hull.resistance_reference_speed_m_s": 8.0,
    },
    "ventilation": {
        "ventilation.thrust_loss": 0.7,
        "ventilation.torque_loss": 0.5,
        "ventilation.surface_loss": 0.8,
        "propeller.depth_m": 2.0,
    },
    "actuators": {
        "pitch_actuator.backlash": 0.05,
        "pitch_actuator.dead_band": 0.01,
        "pitch_actuator.rate_limit_per_s": 0.05,
    },
    "friction": {
        "transmission.coulomb_friction_engine_side_N_m": 2000.0,
        "transmission.coulomb_asymmetry_fraction": 0.2,
        "transmission.viscous_friction_propeller_side_N_m_s_rad": 300.0,
        "transmission.quadratic_drag_N_m_s2_rad2": 40.0,
        "transmission.load_friction_fraction": 0.01,
        "transmission.arctangent_friction_engine_side_N_m": 500.0,
    },
    "lags": {
        "propeller.inflow_lag_s": 1.0,
        "prime_mover.lag_s": 0.5,
        "sensors.torque_lag_s": 0.3,
        "sensors.speed_delay_s": 0.2,
    },
}


@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("sea", [None, "state-6"])
def test_a_group_of_different_ships_has_the_bits_of_single_ones(
    effect: str, sea: str | None
) -> None:
    values = EFFECTS[effect]
    ships = [
        FRIGATE.with_values({**values, "hull.mass_kg": FRIGATE.hull.mass_kg * (1.0 + 0.05 * i)})
        for i in range(LANES)
    ]
    assert compare(ships, sea) == STEPS


def test_ships_that_stall_leave_the_group_to_single_steps_where_they_disagree() -> None:
    ships = [FRIGATE.with_values({"propeller.depth_m": 3.0 + 0.2 * i}) for i in range(LANES)]
    assert compare(ships, low=0.0) > STEPS // 2


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("frigate-turning", 0),
        ("frigate-at-sea", STEPS),
        ("ferry", STEPS),
        ("rov-thruster", 20),  # its motor brakes where others drive
        ("towing-tank", STEPS),
    ],
)
def test_every_kind_of_ship_has_the_bits_of_single_ones(name: str, least: int) -> None:
    ship = load_ship(name)
    found = compare([ship] * LANES)
    assert found == 0 if ship.turns else found >= least


def test_groups_need_as_many_ships_as_there_are_lanes_and_equal_equations() -> None:
    assert compare([FRIGATE] * (2 * LANES + 1)) == 2 * STEPS
    assert compare([FRIGATE] * (LANES - 1)) == 0
    fouled = FRIGATE.with_values({"hull.fouling_fraction": 0.2})
    assert compare([FRIGATE] * (LANES - 1) + [fouled]) == 0
    assert compare([FRIGATE] * LANES, heading_rad=0.1) == 0  # which only single steps keep
