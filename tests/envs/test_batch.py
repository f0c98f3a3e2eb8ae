"""How an episode begins: what is drawn, and the steady state in which the ship begins."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.controller import encode
from shaftline.baselines.governor import tune
from shaftline.envs import CLASSIC, FrigateEnv, FrigateVectorEnv, Settings
from shaftline.envs.batch import Batch, _governor_gains
from shaftline.envs.starts import steady_states
from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.hull import resistance, wave_resistance

from .by_hand import STILL

LAGS = {
    "prime_mover.lag_s": 5.0,
    "propeller.inflow_lag_s": 5.0,
    "pitch_actuator.offset": 0.03,
}
BELATED = LAGS | {
    "prime_mover.dead_time_s": 1.0,
    "prime_mover.rack_rate_limit_mm_s": 1.0,
    "sensors.torque_delay_s": 1.0,
    "sensors.speed_log_lag_s": 5.0,
}
SHIPS = [{}, *({key: value} for key, value in LAGS.items()), LAGS, BELATED]
NAMES = ["none", "engine", "inflow", "pitch", "all", "belated"]


def held(env: FrigateEnv | FrigateVectorEnv) -> Any:
    """The action of the commands with which an episode began."""
    episode, plant = env.batch.arrays.episodes[0], env.batch.ship.record()
    return np.array(
        [
            encode(episode["pitch_command"], plant["pitch_ratio_min"], plant["pitch_ratio_max"]),
            encode(episode["drive"], plant["drive_min"], plant["drive_max"]),
        ],
        np.float32,
    )


@pytest.mark.parametrize("values", SHIPS, ids=NAMES)
def test_a_ship_whose_commands_are_held_stays_in_its_steady_state(values: dict[str, float]) -> None:
    ship = load_ship("frigate").with_values(values)
    settings: dict[str, Any] = {
        "ship": ship,
        "task": STILL,
        "sensor_noise": 0.0,
        "observer": "oracle",
        **CLASSIC,
    }
    single, vector = FrigateEnv(**settings), FrigateVectorEnv(3, **settings)
    speed = float(single.batch.table["ship_speed"][4])
    options = {"initial_speed_m_s": speed, "speed_order_m_s": speed}
    steady = equilibrium(ship, float(single.batch.table["drive"][4]), 1.2)
    first, _ = single.reset(seed=0, options=options)
    many, _ = vector.reset(seed=0, options=options)
    expected = [
        speed,
        steady.state.shaft_speed,
        steady.outputs.shaft_torque,
        steady.state.pitch_ratio,
        steady.inputs.drive,
        speed,
        steady.outputs.advance_velocity,
        1.0,
    ]
    assert first[:8] == pytest.approx(np.asarray(expected, np.float32), rel=1e-5)
    for _ in range(40):
        assert first[:8] == pytest.approx(np.asarray(expected, np.float32), rel=1e-4)
        assert np.array_equal(many, np.tile(first, (3, 1)))
        first, *_ = single.step(held(single))
        many, *_ = vector.step(np.tile(held(vector), (3, 1)))


@pytest.mark.parametrize("values", SHIPS, ids=NAMES)
@pytest.mark.parametrize("sea", ["calm", "state-5"])
def test_between_the_tabulated_steady_states_a_ship_hardly_moves(
    values: dict[str, float], sea: str
) -> None:
    ship = load_ship("frigate").with_values(values)
    env = FrigateEnv(ship=ship, task=STILL, sensor_noise=0.0, observer="none", **CLASSIC)
    first, _ = env.reset(seed=0, options={"initial_speed_m_s": 7.4, "speed_order_m_s": 7.4})
    waves = 1.0 if sea == "state-5" else 0.0
    env.reset(seed=0, options={"initial_speed_m_s": 7.4, "speed_order_m_s": 7.4, "sea": sea})
    for _ in range(10):
        seen, *_ = env.step(held(env))
        assert seen[1] == pytest.approx(first[1], abs=0.01 + waves)
        assert seen[2] == pytest.approx(first[2], rel=0.01 + 0.7 * waves)
        assert seen[3] == pytest.approx(first[3], abs=1e-4)


def test_steady_states_are_those_of_calm_water_at_three_quarters_of_the_pitch() -> None:
    ship = load_ship("frigate")
    table = steady_states(ship)
    assert np.allclose(table["drive"], np.arange(10.0, 27.0, 2.0))  # of 5 to 95 % of 40 mm
    for row in table:
        steady = equilibrium(ship, float(row["drive"]), 1.2).state
        assert (row["ship_speed"], row["shaft_speed"], row["pitch_ratio"]) == pytest.approx(
            (steady.ship_speed, steady.shaft_speed, 1.2)
        )
        assert row["pitch_command"] == pytest.approx(1.2)
        assert 350.0 <= row["shaft_speed"] * 7.38 * 30.0 / math.pi <= 1000.0
    for rack in (8.0, 28.0):  # the next ones are out of the engine's range
        rpm = equilibrium(ship, rack, 1.2).state.shaft_speed * 7.38 * 30.0 / math.pi
        assert not 350.0 <= rpm <= 1000.0
    assert (np.diff(table["ship_speed"]) > 0.0).all()


def test_a_ship_without_steady_states_in_its_engines_range_is_refused() -> None:
    stiff = load_ship("frigate").with_values({"prime_mover.torque_offset_N_m": -50e3})
    with pytest.raises(
        ValueError, match="frigate: fewer than two steady states within the speed range"
    ):
        FrigateEnv(ship=stiff)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (Settings(randomise={"colour": 0.1}), "randomise"),
        (Settings(sea="state-9"), "unknown sea"),
        (Settings(sensor_noise=-1.0), "sensor_noise"),
        (Settings(task="dancing"), "unknown task"),
        (Settings(observer="eyes"), "unknown observer"),
        (Settings(tuning="wild", observer="luenberger"), "wild"),
        (Settings(control_interval_s=0.12), "control_interval_s"),
    ],
)
def test_settings_that_do_not_exist_are_refused_at_once(settings: Settings, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Batch(1, settings)


def test_an_episode_may_begin_at_either_end_of_the_steady_speeds() -> None:
    batch = Batch(1, Settings())
    known = batch.table["ship_speed"]
    for speed in (known[0], known[-1]):
        begun = batch.begin({"initial_speed_m_s": speed}).ranges[0]
        assert begun["initial_speed"].tolist() == [speed, speed]
    for speed in (known[0] - 1e-6, known[-1] + 1e-6):
        with pytest.raises(ValueError, match="initial_speed_m_s"):
            batch.begin({"initial_speed_m_s": speed})


@pytest.mark.parametrize("ship", ["tito-neri-sine", "rov-thruster"])
def test_a_ship_without_diesel_or_that_does_not_move_is_refused(ship: str) -> None:
    with pytest.raises(ValueError, match=f"{ship}: the environment needs a ship with a diesel"):
        FrigateEnv(ship=ship)
    moored = load_ship("frigate").with_values({"hull.fixed": True})
    with pytest.raises(ValueError, match="needs a ship with a diesel engine"):
        FrigateEnv(ship=moored)
    towed = load_ship("frigate").model_dump(exclude_unset=True) | {"propeller": {"model": "none"}}
    with pytest.raises(ValueError, match="a diesel engine, a propeller and a moving hull"):
        FrigateEnv(ship=Ship.model_validate(towed))


def test_the_governor_is_tuned_at_the_plants_step() -> None:
    ship = load_ship("frigate")
    assert np.array_equal(_governor_gains(ship), np.array(tune(ship, 0.05)))
    assert not Batch(1, Settings(command="fuel-rack")).gains.any()
    by_speed = Batch(1, Settings(command="shaft-speed"))
    assert np.array_equal(by_speed.gains, _governor_gains(ship))


def test_the_interval_is_whole_steps_of_the_ships() -> None:
    batch = Batch(3, Settings(control_interval_s=0.25))
    assert (batch.n, batch.steps, batch.dt, batch.interval_s) == (3, 5, 0.05, 0.25)
    assert batch.observation().shape == (3, 15)
    assert batch.observation(np.array([2])).shape == (1, 15)
    assert batch.observation().dtype == np.float32
    slow = load_ship("frigate").with_values({"integration.time_step_s": 0.1})
    assert Batch(1, Settings(ship=slow)).steps == 5


def test_a_ship_begins_in_the_steady_state_of_its_speed_with_commands_to_match() -> None:
    env = FrigateEnv(task="speed-keeping", sea="calm")
    env.reset(seed=2, options={"resistance_rise": 0.0, "initial_speed_m_s": 7.3})
    episode, state = env.batch.arrays.episodes[0], env.batch.arrays.states[0]
    table = env.batch.table
    assert state["ship_speed"] == 7.3
    for field, name in (("shaft_speed", "shaft_speed"), ("pitch_ratio", "pitch_ratio")):
        assert state[field] == np.interp(7.3, table["ship_speed"], table[name])
    assert episode["drive"] == np.interp(7.3, table["ship_speed"], table["drive"])
    assert episode["integral"] == env.batch.arrays.memories[0]["rack"] == episode["drive"]
    assert episode["rack_command"] == episode["drive"]
    assert episode["shaft_speed_command"] == state["shaft_speed"]
    assert episode["pitch_command"] == pytest.approx(1.2)
    assert state["position"] == 0.0


@pytest.mark.parametrize("load", [1.25, 1.37])
def test_a_ship_begins_with_the_rack_that_its_load_needs(load: float) -> None:
    """Loads between those of the tables too; waves from ahead act as a higher resistance does."""
    ship = load_ship("frigate-at-sea").with_values({"ventilation.thrust_loss": 0.0})
    settings: dict[str, Any] = {"ship": ship, "task": STILL, "sensor_noise": 0.0, **CLASSIC}
    env = FrigateEnv(**settings)
    options = {"speed_order_m_s": 7.0, "resistance_rise": load - 1.0}
    env.reset(seed=0, options=options)
    drive = float(env.batch.arrays.episodes[0]["drive"])
    assert drive > 1.1 * float(
        np.interp(7.0, env.batch.table["ship_speed"], env.batch.table["drive"])
    )
    for _ in range(120):
        seen, *_ = env.step(held(env))
    assert seen[5] == pytest.approx(7.0, abs=0.01)
    height = 2.5
    env.reset(seed=0, options=options | {"sea": {"hs_m": height, "tp_s": 10.0}})
    plant, episode = env.batch.arrays.plants[0], env.batch.arrays.episodes[0]
    waves = wave_resistance(plant, height**2, 7.0) / resistance(plant, 7.0, 1.0)
    env.reset(seed=0, options=options | {"resistance_rise": load + waves - 1.0})
    assert waves > 0.05
    heavier = float(env.batch.arrays.episodes[0]["drive"])
    env.reset(seed=0, options=options | {"sea": {"hs_m": height, "tp_s": 10.0}})
    assert float(episode["drive"]) == pytest.approx(heavier)


@pytest.mark.parametrize(("order", "row"), [(1.0, 0), (30.0, -1)])
def test_with_an_order_beyond_the_steady_speeds_a_ship_begins_at_their_end(
    order: float, row: int
) -> None:
    env = FrigateEnv(task=STILL)
    env.reset(seed=0, options={"speed_order_m_s": order})
    end = env.batch.table[row]
    state = env.batch.arrays.states[0]
    assert (state["ship_speed"], state["shaft_speed"]) == (end["ship_speed"], end["shaft_speed"])


def test_factors_lie_in_their_range_and_reach_the_kernel() -> None:
    widths = {"hull.resistance_coefficient_N_s2_m2": 0.1, "prime_mover.torque_offset_N_m": 0.3}
    env = FrigateVectorEnv(60, task=STILL, randomise=widths, sensor_noise=0.0, **CLASSIC)
    env.reset(seed=0, options={"initial_speed_m_s": 8.0})
    nominal, drawn = load_ship("frigate").record(), env.batch.arrays.plants
    for field, width in (("resistance_coefficient", 0.1), ("torque_offset", 0.3)):
        factors = drawn[field] / nominal[field]
        assert 1.0 - width <= factors.min() < 1.0 - 0.9 * width
        assert 1.0 + 0.9 * width < factors.max() <= 1.0 + width
    varied = {name for name in drawn.dtype.names if np.any(drawn[name] != nominal[name])}
    assert varied == {"resistance_coefficient", "torque_offset"}
    for _ in range(20):
        env.step(np.tile(held(env), (60, 1)))
    slowed = np.corrcoef(drawn["resistance_coefficient"], env.batch.arrays.states["ship_speed"])
    assert slowed[0, 1] < -0.5  # a heavier hull is slower
    before = drawn["torque_offset"].copy()
    env.reset()
    assert not np.isin(before, drawn["torque_offset"]).any()


def test_a_reset_forgets_the_last_episode() -> None:
    env = FrigateEnv(task="storm", observer="random-walk-kalman", action_mode="residual")
    runs = []
    for _ in range(2):
        seen = [env.reset(seed=8)[0]]
        seen += [env.step([0.4, math.sin(k)])[0] for k in range(20)]
        runs.append(np.stack(seen))
    assert np.array_equal(runs[0], runs[1])


def test_shares_and_threads_change_no_bit() -> None:
    runs = []
    options: dict[str, Any] = {"randomise": {"hull.mass_kg": 0.2}, "max_episode_steps": 12}
    for threads in (1, 2, 5):
        # Many episodes begin in the same step, so that threads share the starts too.
        env = FrigateVectorEnv(40, task="storm", threads=threads, **options)
        rows = [env.reset(seed=5)[0]]
        for k in itertools.islice(itertools.count(), 16):
            seen, reward, _, _, info = env.step(np.full((40, 2), 0.1 + 0.02 * k, np.float32))
            rows += [seen, reward, *info["reward_terms"].values()]
        runs.append(np.concatenate([row.ravel() for row in rows]))
        env.close()
    assert np.array_equal(runs[0], runs[1])
    assert np.array_equal(runs[0], runs[2])
