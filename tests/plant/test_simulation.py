from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shaftline.observers.base import ESTIMATE, OBSERVER
from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    get_sea,
    load_ship,
    realise,
    simulate,
)
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.signals import SAMPLE, SIGNALS
from shaftline.plant.simulation import trajectory
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, prepare
from shaftline.plant.waves import SEA, SYNC_STEPS, calm
from shaftline.studies.sailing import sail

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
                self.plants[i], self.states[i], self.memories[i], self.seas[i],
                DRIVES[0], UNDISTURBED, 0.05,
            )  # fmt: skip

    def run(self, blocks: int) -> bytes:
        """The ships' states and memories after some blocks of half a second."""
        n = len(self.plants)
        for k in range(blocks):
            drive, pitch = DRIVES[k * 3 // blocks], PITCHES[k * 3 // blocks]
            sail(
                self.plants, self.states, self.memories, self.seas,
                np.zeros(0, OBSERVER), np.zeros(0, ESTIMATE),
                np.full(n, drive), np.full(n, pitch), SYNC_STEPS, 0.05,
            )  # fmt: skip
        return self.states.tobytes() + self.memories.tobytes()


@pytest.fixture(scope="module")
def ships(frigate: Ship) -> list[Ship]:
    return [frigate.with_values(values) for values in VARIANTS]


@pytest.fixture(scope="module")
def seas() -> list[Any]:
    models = [get_sea(name) for name in SEAS]
    return [calm() if sea is None else realise(sea, 4.0, 11) for sea in models]


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


def test_same_seed_gives_the_same_voyage(frigate: Ship, design_point: Equilibrium) -> None:
    sea = get_sea("thesis")
    assert sea is not None
    runs = [
        simulate(
            frigate, Schedule(22.0, 1.4), 30.0, initial=design_point.state, sea=realise(sea, 4.0, s)
        ).tobytes()
        for s in (1, 1, 2)
    ]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_simulation_leaves_its_sea_untouched(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    before = thesis_sea.tobytes()
    simulate(frigate, Schedule(22.0, 1.4), 5.0, initial=design_point.state, sea=thesis_sea)
    assert thesis_sea.tobytes() == before


@pytest.mark.parametrize(("duration", "samples"), [(1.0, 21), (1.01, 22), (0.0, 2)])
def test_one_sample_at_every_step_and_one_at_the_end(
    frigate: Ship, design_point: Equilibrium, duration: float, samples: int
) -> None:
    found = simulate(frigate, Schedule(22.0, 1.4), duration, initial=design_point.state)
    np.testing.assert_allclose(found["time"], 0.05 * np.arange(samples), atol=1e-12)


def test_elevation_is_added_to_the_seas(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    risen = Schedule(22.0, 1.4, elevation=lambda t: 0.1 * t)
    plain, found = (
        simulate(frigate, s, 20.0, initial=design_point.state, sea=thesis_sea)
        for s in (Schedule(22.0, 1.4), risen)
    )
    np.testing.assert_allclose(
        found["submergence"], plain["submergence"] + 0.1 * plain["time"], rtol=1e-12
    )
    np.testing.assert_array_equal(found["shaft_speed"], plain["shaft_speed"])


def test_elevation_lets_a_propeller_ventilate(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values(VARIANTS[2])
    trough = Schedule(22.0, 1.4, elevation=lambda t: np.where(t > 5.0, -2.0, 0.0))
    found = simulate(ship, trough, 10.0, initial=equilibrium(ship, 22.0, 1.4).state)
    assert np.all(found["ventilation"][found["time"] < 5.0] == 0.0)
    assert found["ventilation"][-1] > 0.9


def test_trajectory_of_records_is_the_simulation_of_ships(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    keys = {"propeller.inflow_lag_s": 0.8, "hull.fouling_fraction": 0.2}
    steps, dt = 200, frigate.time_step_s
    half = np.arange(2 * steps + 1) * 0.5 * dt
    expected = simulate(
        frigate.with_values(keys), Schedule(24.0, 1.3, np.sin, 1.1, np.cos), steps * dt,
        initial=design_point.state, sea=thesis_sea,
    )  # fmt: skip
    plant, memory = frigate.record(), np.zeros(1, MEMORY)[0]
    for key, value in keys.items():
        frigate.number(key).write(plant, value)
    samples, state = np.zeros(steps + 1, SAMPLE), np.zeros(1, STATE)
    for _ in range(2):  # a memory may be used again
        state[0] = tuple(design_point.state)
        trajectory(
            plant, state[0], memory, thesis_sea.copy(), np.full(steps, 24.0), np.full(steps, 1.3),
            np.sin(half), np.cos(half), np.full(half.shape, 1.1), dt, samples,
        )  # fmt: skip
        assert samples.tobytes() == expected.tobytes()


def test_equilibrium_stays(frigate: Ship, design_point: Equilibrium) -> None:
    samples = simulate(frigate, Schedule(22.0, 1.4), 100.0, initial=design_point.state)
    for name in ("shaft_speed", "ship_speed", "shaft_torque"):
        np.testing.assert_allclose(samples[name], samples[name][0], rtol=1e-8)


def test_tug_spins_up_to_its_steady_state() -> None:
    ship = load_ship("tito-neri-staircase")
    start, end = (equilibrium(ship, voltage, 1.0) for voltage in (3.91, 5.89))
    samples = simulate(ship, Schedule(5.89, 1.0), 4.0, initial=start.state)
    assert samples["shaft_speed"][-1] == pytest.approx(end.state.shaft_speed, rel=1e-6)
    assert samples["motor_current"][-1] == pytest.approx(end.state.motor_current, rel=1e-6)


@pytest.mark.parametrize(
    "name", ["drive", "pitch_command", "inflow", "elevation", "resistance_factor"]
)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_input_that_is_no_number_is_named(
    frigate: Ship, design_point: Equilibrium, name: str, value: float
) -> None:
    inputs = {"drive": 22.0, "pitch_command": 1.4, name: lambda t: np.where(t > 0.5, value, 1.0)}
    with pytest.raises(ValueError, match=f"{name} holds a value that is not finite"):
        simulate(frigate, Schedule(**inputs), 1.0, initial=design_point.state)


def test_delay_that_does_not_fit_the_time_step_is_refused(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values({"sensors.torque_delay_s": 1.0})
    with pytest.raises(ShipError, match=r"sensors\.torque_delay_s = 1\.0 s is more than 0\.63 s"):
        simulate(ship, Schedule(22.0, 1.4), 2.0, initial=design_point.state, dt=0.005)


@pytest.fixture(scope="module", params=[{}, BUSY], ids=["nominal", "busy"])
def rough_voyage(request: Any, frigate: Ship, thesis_sea: Any) -> NDArray[Any]:
    ship = frigate.with_values(request.param)
    start = equilibrium(ship, 22.0, 1.4)
    schedule = Schedule(lambda t: np.where(t < 30.0, 22.0, 28.0), 1.2)
    return simulate(ship, schedule, 60.0, initial=start.state, sea=thesis_sea)


def test_power_is_balanced(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage
    stored = (53697.0 + 14411.0) * s["shaft_speed"] * s["shaft_acceleration"]
    drive = s["brake_torque"] * 7.38 * 0.95 * s["shaft_speed"]
    taken = s["propeller_torque"] * s["shaft_speed"]
    np.testing.assert_allclose(stored, drive - taken, atol=1e-12 * drive.max())


def test_gauge_is_the_cut_seen_from_either_side(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage
    engine = s["brake_torque"] * 7.38 * 0.95 - 53697.0 * s["shaft_acceleration"]
    propeller = s["propeller_torque"] + 14411.0 * s["shaft_acceleration"]
    np.testing.assert_allclose(s["shaft_torque"], engine, rtol=1e-11)
    np.testing.assert_allclose(s["shaft_torque"], propeller, rtol=1e-11)


def test_samples_stay_within_the_registrys_bounds(rough_voyage: NDArray[Any]) -> None:
    for signal in SIGNALS:
        values = rough_voyage[signal.name]
        assert np.all((signal.low <= values) & (values <= signal.high)), signal.name


def test_acceleration_is_the_slope_of_the_speed(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage[100:500]  # no step of a command in here
    slope = (s["shaft_speed"][2:] - s["shaft_speed"][:-2]) / 0.1
    np.testing.assert_allclose(slope, s["shaft_acceleration"][1:-1], atol=0.01)


@settings(max_examples=15)
@given(
    rack=st.floats(10.0, 34.0),
    pitch=st.floats(0.6, 1.4),
    shaft=st.floats(0.85, 1.1),
    hull=st.floats(0.8, 1.1),
)
def test_constant_commands_lead_to_the_equilibrium(
    frigate: Ship, rack: float, pitch: float, shaft: float, hull: float
) -> None:
    rest = equilibrium(frigate, rack, pitch)
    assume(350.0 < 7.38 * rest.state.shaft_speed * 30.0 / math.pi < 1000.0)
    initial = rest.state._replace(
        shaft_speed=shaft * rest.state.shaft_speed, ship_speed=hull * rest.state.ship_speed
    )
    end = simulate(frigate, Schedule(rack, pitch), 1500.0, initial=initial)[-1]
    assert end["shaft_speed"] == pytest.approx(rest.state.shaft_speed, rel=1e-4)
    assert end["ship_speed"] == pytest.approx(rest.state.ship_speed, rel=1e-4)
