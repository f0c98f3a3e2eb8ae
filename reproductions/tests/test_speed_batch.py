"""A batch of ships equals each ship alone, to the last bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reproductions.speed import simulate_batch
from shaftline.observers.records import ESTIMATE, OBSERVER
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, realise, simulate
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, prepare
from shaftline.plant.together import GROUP
from shaftline.plant.waves import SEA, SYNC_STEPS, calm_sea

BUSY = {
    "prime_mover.lag_s": 0.4,
    "prime_mover.dead_time_s": 0.22,
    "propeller.inflow_lag_s": 0.5,
    "propeller.depth_m": 3.0,
    "ventilation.thrust_loss": 0.6,
    "pitch_actuator.backlash": 0.02,
    "sensors.torque_delay_s": 0.13,
    "sensors.speed_log_lag_s": 5.0,
}
VARIANTS: list[dict[str, Any]] = [
    {},
    {"hull.mass_kg": 2.5e6, "transmission.inertia_propeller_side_kg_m2": 2e4},
    BUSY,
    {"propeller.model": "four-quadrant"},
]
SEAS = ["calm", "thesis", "state-6", "state-4"]
DRIVES, PITCHES = [20.0, 27.0, 24.0], [1.4, 1.1, 1.2]


class Batch:
    """Several ships, each in its own sea, carried on with commands that change every half second."""

    def __init__(self, ships: list[Ship], seas: list[Any]) -> None:
        n = len(ships)
        self.plants = np.zeros(n, PLANT)
        self.states = np.zeros(n, STATE)
        self.memories = np.zeros(n, MEMORY)
        self.seas = np.zeros(n, SEA)
        for i, ship in enumerate(ships):
            self.plants[i] = ship.record()
            self.states[i] = tuple(equilibrium(ship, DRIVES[0], PITCHES[0]).state)
            self.seas[i] = seas[i]
            prepare(
                self.plants[i],
                self.states[i],
                self.memories[i],
                self.seas[i],
                DRIVES[0],
                UNDISTURBED,
                0.05,
            )

    def run(self, blocks: int) -> bytes:
        """The ships' states and memories after some blocks of half a second."""
        n = len(self.plants)
        for k in range(blocks):
            drive, pitch = DRIVES[k * 3 // blocks], PITCHES[k * 3 // blocks]
            simulate_batch(
                self.plants,
                self.states,
                self.memories,
                self.seas,
                np.zeros(0, OBSERVER),
                np.zeros(0, ESTIMATE),
                np.zeros(1, GROUP)[0],
                np.full(n, drive),
                np.full(n, pitch),
                SYNC_STEPS,
                0.05,
            )
        return self.states.tobytes() + self.memories.tobytes()


@pytest.fixture(scope="module")
def ships(frigate: Ship) -> list[Ship]:
    return [frigate.with_values(values) for values in VARIANTS]


@pytest.fixture(scope="module")
def seas() -> list[Any]:
    models = [get_sea(name) for name in SEAS]
    return [calm_sea() if sea is None else realise(sea, 4.0, 11) for sea in models]


def test_batch_equals_each_ship_alone(ships: list[Ship], seas: list[Any]) -> None:
    together = Batch(ships, seas)
    together.run(60)
    for i, (ship, sea) in enumerate(zip(ships, seas, strict=True)):
        alone = Batch([ship], [sea])
        alone.run(60)
        assert together.states[i].tobytes() == alone.states[0].tobytes()
        assert together.memories[i].tobytes() == alone.memories[0].tobytes()


@pytest.mark.parametrize("i", range(len(VARIANTS)))
def test_batch_equals_the_kept_trajectory(ships: list[Ship], seas: list[Any], i: int) -> None:
    def in_thirds(values: list[float]) -> Any:
        return lambda t: np.repeat(values, len(t) // 3)

    schedule = Schedule(in_thirds(DRIVES), in_thirds(PITCHES))
    start = equilibrium(ships[i], DRIVES[0], PITCHES[0]).state
    last = simulate(ships[i], schedule, 30.0, initial=start, sea=seas[i])[-1]
    batch = Batch([ships[i]], [seas[i]])
    batch.run(60)
    for name in ("shaft_speed", "ship_speed", "position", "ventilation"):
        assert batch.states[0][name] == last[name], name
    assert batch.memories[0]["speed_log"] == last["measured_ship_speed"]
