"""What is drawn for an episode, and the options of a reset that give it instead."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random

from shaftline.envs import FrigateEnv, FrigateVectorEnv, get_task
from shaftline.envs.starts import steady_states
from shaftline.plant import equilibrium, get_sea, load_ship, realise
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.waves import SEA

from .by_hand import STILL


def test_a_wind_is_drawn_beside_the_waves_and_changes_no_other_draw() -> None:
    calm = {"hs_m": (1.0, 3.0), "tp_s": 9.0, "heading_deg": (90.0, 180.0)}
    env = FrigateVectorEnv(40, ship="frigate-at-sea", sea=calm)
    windy = FrigateVectorEnv(40, ship="frigate-at-sea", sea=calm | {"wind_m_s": (5.0, 15.0)})
    env.reset(seed=3)
    windy.reset(seed=3)
    before, after = (one.batch.arrays.episodes for one in (env, windy))
    assert np.array_equal(before["sea"][:, :4], after["sea"][:, :4])
    assert np.array_equal(before["orders"], after["orders"])
    assert np.array_equal(before["random"], after["random"])
    wind = after["sea"][:, 4]
    assert 5.0 <= wind.min() < 7.0 < 13.0 < wind.max() <= 15.0
    assert np.array_equal(windy.batch.arrays.seas["wind"], wind)
    with pytest.raises(ValueError, match="frigate: a wind of 9 m/s has no effect"):
        FrigateVectorEnv(1, ship="frigate", sea="hs=2,tp=9,wind=9")


def test_a_seed_decides_every_draw() -> None:
    """The order of the random numbers decides which episode belongs to a seed: published results rest
    on it.
    """
    widths = {"hull.mass_kg": 0.2, "propeller.depth_m": 0.1}
    env = FrigateEnv(task="transit", randomise=widths)
    arrays, task, ship = env.batch.arrays, get_task("transit"), load_ship("frigate")
    env.batch.reset(np.array([0]), [np_random(11)[0]], env.batch.begin(None))
    episode, sea, plant = arrays.episodes[0], arrays.seas[0], arrays.plants[0]
    u = np_random(11)[0].random(11 + 64 + 2)
    assert plant["mass"] == pytest.approx(3.3e6 * (0.8 + 0.4 * u[75]), rel=1e-12)
    assert plant["depth"] == pytest.approx(4.0 * (0.9 + 0.2 * u[76]), rel=1e-12)
    preset = get_sea(task.presets[int(u[0] * len(task.presets))])
    assert preset is not None
    expected = realise(preset, ship.propeller.depth_m, int(u[1] * 2**31))
    for name in ("present", "amplitude", "velocity", "frequency", "wavenumber", "phase"):
        assert np.array_equal(sea[name], expected[name])
    assert episode["random"] == int(u[2] * 2**53)
    low, high = task.resistance_rise
    assert episode["resistance_mean"] == pytest.approx(1.0 + low + (high - low) * u[7])
    assert episode["resistance_swing"] == task.resistance_swing
    assert episode["resistance_frequency"] == pytest.approx(2.0 * math.pi / (60.0 + 120.0 * u[8]))
    assert episode["resistance_phase"] == pytest.approx(2.0 * math.pi * u[9])
    low, high = task.speed_order_m_s
    assert arrays.states[0]["ship_speed"] == pytest.approx(low + (high - low) * u[10])
    assert episode["orders"] == pytest.approx(low + (high - low) * u[11:75])
    assert episode["order_interval"] == task.order_interval_s
    assert episode["elapsed"] == 0
    following, _ = env.reset(seed=11)
    assert np.array_equal(following, FrigateEnv(task="transit", randomise=widths).reset(seed=11)[0])


def test_the_initial_speed_is_a_draw_of_its_own() -> None:
    env = FrigateVectorEnv(200, task="speed-keeping", threads=1)
    env.reset(seed=1)
    speeds = env.batch.arrays.states["ship_speed"].copy()
    orders = env.batch.arrays.episodes["orders"][:, 0].copy()
    low, high = get_task("speed-keeping").speed_order_m_s
    assert low <= speeds.min() < low + 0.05 * (high - low)
    assert high >= speeds.max() > high - 0.05 * (high - low)
    assert abs(np.corrcoef(speeds, orders)[0, 1]) < 0.2
    assert np.abs(speeds - orders).mean() > 1.0
    env.reset(seed=1, options={"speed_order_m_s": (6.0, 8.0)})
    assert set(env.batch.arrays.states["ship_speed"]) == {6.0}
    env.reset(seed=1, options={"speed_order_m_s": 6.0, "initial_speed_m_s": 7.0})
    assert set(env.batch.arrays.states["ship_speed"]) == {7.0}
    assert np.all(env.batch.arrays.episodes["orders"] == 6.0)


def test_the_reference_fuel_is_that_of_the_steady_state_at_each_order() -> None:
    env = FrigateEnv(task=STILL)
    ship, plant = env.batch.ship, env.batch.ship.record()
    table = steady_states(ship, 1.25)
    speeds = [float(table["ship_speed"][k]) for k in (2, 5)]
    env.reset(seed=0, options={"speed_order_m_s": speeds, "resistance_rise": 0.25})
    found = env.batch.arrays.episodes[0]["reference_fuel"]
    for k, row in ((0, 2), (1, 5), (63, 5)):
        steady = equilibrium(ship, float(table["drive"][row]), 1.2, resistance_factor=1.25)
        engine_speed = plant["gear_ratio"] * steady.state.shaft_speed
        expected = 2.0 * fuel_rate(plant, engine_speed, steady.outputs.brake_torque)
        assert found[k] == pytest.approx(expected, rel=1e-6)


def test_the_reference_power_tows_the_ship_at_each_order() -> None:
    """R v = c1 v^3 of the frigate, 2.5 % more resistance; the thrust of both propellers, less t."""
    env = FrigateEnv(task=STILL)
    env.reset(seed=0, options={"speed_order_m_s": [6.0, 7.0], "resistance_rise": 0.025})
    found = env.batch.arrays.episodes[0]["reference_power"]
    c1 = env.batch.ship.hull.resistance_coefficient_N_s2_m2
    assert found[[0, 1, 63]] == pytest.approx(1.025 * c1 * np.array([6.0, 7.0, 7.0]) ** 3)


def test_waves_and_a_higher_resistance_raise_the_reference_fuel() -> None:
    env = FrigateEnv(ship="frigate-at-sea", task=STILL)
    changes: list[dict[str, Any]] = [
        {},
        {"sea": {"hs_m": 2.5, "tp_s": 10.0}},
        {"resistance_rise": 0.1},
    ]
    fuel = []
    for change in changes:
        env.reset(seed=0, options={"speed_order_m_s": 7.0} | change)
        fuel.append(float(env.batch.arrays.episodes[0]["reference_fuel"][0]))
    assert fuel[0] * 1.03 < fuel[1]
    assert fuel[0] * 1.03 < fuel[2]


def begun(**options: Any) -> dict[str, Any]:
    """Return what an episode of one seed begins with."""
    env = FrigateVectorEnv(1, task="transit", threads=1)
    env.reset(seed=3, options=options)
    arrays = env.batch.arrays
    names = arrays.episodes.dtype.names
    return {name: arrays.episodes[0][name].tolist() for name in names} | {
        "sea": arrays.seas[0]["amplitude"].tolist(),
        "waves": arrays.seas[0]["phase"].tolist(),
        "speed": float(arrays.states[0]["ship_speed"]),
    }


LOADED = {"mean_torque", "mean_attack", "measured_mean_torque", "estimated_mean_attack"}
"""What depends on the waves."""
STARTS = {
    "drive",
    "integral",
    "measured_shaft_speed",
    "mean_brake_torque",
    "rack_command",
    "shaft_speed_command",
    "estimated_mean_brake_torque",
    "mean_speed",
    "speed",
    *LOADED,
}
"""What depends on the initial speed."""
REFERENCES = {"reference_fuel", "reference_power"}
ORDERED = {"orders", *REFERENCES, *STARTS}
"""What depends on orders that are given."""
UNMOVED = {"speed", "mean_speed"}
"""What a resistance leaves as it is."""
SEA_CHANGES = {"sea", "waves", *LOADED}
"""What depends on the sea; this ship has no added resistance in waves."""


@pytest.mark.parametrize(
    ("options", "changed"),
    [
        ({"speed_order_m_s": 7.0}, ORDERED),
        ({"speed_order_m_s": (7.0, 8.0)}, ORDERED),
        ({"order_interval_s": 20.0}, {"order_interval"}),
        ({"initial_speed_m_s": 6.0}, STARTS),
        ({"resistance_rise": 0.5}, {"resistance_mean", *REFERENCES, *STARTS} - UNMOVED),
        ({"sea": "calm"}, SEA_CHANGES),
        ({"sea": "state-7"}, SEA_CHANGES),
        ({"sea": ["state-7"]}, SEA_CHANGES),
        ({"sea": {"hs_m": (1.0, 5.0), "tp_s": 9.0}}, SEA_CHANGES),
    ],
)
def test_an_option_acts_and_leaves_all_else_as_it_was_drawn(
    options: dict[str, Any], changed: set[str]
) -> None:
    plain, other = begun(), begun(**options)
    assert {name for name in plain if plain[name] != other[name]} <= changed | {"pitch_command"}
    for name in changed - {"waves", "pitch_command"}:
        assert plain[name] != other[name], name


def test_options_mean_what_they_say() -> None:
    found = begun(
        speed_order_m_s=(7.0, 8.0),
        order_interval_s=20.0,
        initial_speed_m_s=6.0,
        resistance_rise=0.5,
        sea={"hs_m": 2.0, "tp_s": 9.0},
    )
    assert found["orders"][:3] == [7.0, 8.0, 8.0]
    assert found["order_interval"] == 20.0
    assert found["speed"] == 6.0
    assert found["resistance_mean"] == 1.5
    assert 4.0 * math.sqrt(0.5 * np.sum(np.square(found["sea"]))) == pytest.approx(2.0)


def test_a_sea_of_the_options_is_drawn_too() -> None:
    env = FrigateVectorEnv(40, task="transit", threads=1)
    sea = ["calm", {"hs_m": (1.0, 3.0), "tp_s": 9.0}]
    env.reset(seed=0, options={"sea": sea})
    heights = 4.0 * np.sqrt(0.5 * np.sum(env.batch.arrays.seas["amplitude"] ** 2, axis=1))
    assert 10 < np.sum(heights == 0.0) < 30
    assert np.ptp(heights[heights > 0.0]) > 1.0
    assert env.batch.arrays.seas.dtype == SEA
