from __future__ import annotations

from typing import Any

import numpy as np

from reproductions.speed import simulate_batch
from shaftline.observers import follow, get_observer, observer_names, simulated_measurements
from shaftline.observers.records import ESTIMATE, OBSERVER
from shaftline.plant import Equilibrium, Schedule, Ship, simulate
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, prepare
from shaftline.plant.together import GROUP
from shaftline.plant.waves import SEA, SYNC_STEPS

BLOCKS = 40
NAMES = observer_names()


def test_batch_equals_simulation_and_following(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    """Every observer on a ship of its own, the torque meter with its faults, blocks of half a second."""
    values = {"sensors.torque_gain": 1.02, "sensors.torque_delay_s": 0.1, "hull.current_m_s": 0.3}
    ship = frigate.with_values(values)
    n = len(NAMES)
    plants, states, memories = np.zeros(n, PLANT), np.zeros(n, STATE), np.zeros(n, MEMORY)
    seas, observers, estimates = np.zeros(n, SEA), np.zeros(n, OBSERVER), np.zeros(n, ESTIMATE)
    plants[:], seas[:] = ship.record(), thesis_sea
    states[:] = tuple(design_point.state)
    for i, name in enumerate(NAMES):
        observers[i] = get_observer(name).discretise(frigate, 0.05)  # the ship as it is believed
        prepare(plants[i], states[i], memories[i], seas[i], 22.0, UNDISTURBED, 0.05)

    steps = BLOCKS * SYNC_STEPS
    racks = np.repeat([22.0, 28.0], steps // 2)
    schedule = Schedule(lambda _: racks, 1.3)
    samples = simulate(ship, schedule, 0.05 * steps, initial=design_point.state, sea=thesis_sea)
    readings = simulated_measurements(samples)[:-1]  # each step's start
    expected = [follow(get_observer(name), frigate, readings, 0.05) for name in NAMES]

    for block in range(BLOCKS):
        first = block * SYNC_STEPS
        drive, pitch = np.full(n, racks[first]), np.full(n, 1.3)
        simulate_batch(
            plants,
            states,
            memories,
            seas,
            observers,
            estimates,
            np.zeros(1, GROUP)[0],
            drive,
            pitch,
            SYNC_STEPS,
            0.05,
        )
        last = first + SYNC_STEPS - 1
        for i, name in enumerate(NAMES):
            velocity, valid = expected[i]
            assert estimates[i]["advance_velocity"] == velocity[last], name
            assert bool(estimates[i]["valid"]) == valid[last], name
    np.testing.assert_array_equal(states["shaft_speed"], samples["shaft_speed"][-1])
