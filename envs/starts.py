"""Start of episodes: draw random numbers, and set ships to a steady state.

The NumPy generator of an environment draws all random numbers of its episode in one call. One compiled
call for all environments computes orders, sea, resistance, steady state and lag states from them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip, piecewise_linear
from ..core.random_stream import fill_uniform
from ..observers.records import Floats
from ..plant import Sea, Ship, equilibrium
from ..plant.drives.diesel import rack_torque, torque_limit
from ..plant.dynamics import settle_lags
from ..plant.expressions import NO_SIGNALS
from ..plant.hull import resistance, water_speed, wave_resistance
from ..plant.state import get_state, inputs_without_sea, set_state
from ..plant.stepping import Disturbance, prepare
from ..plant.waves import COMPONENTS, fill_sea
from ..plant.wind import wind_resistance
from .options import ResetOptions
from .records import ENVIRONMENT, MAX_ORDERS
from .rewards import total_fuel_flow
from .sensing import order_index
from .settings import SeaRange
from .tasks import Task

LOADS = (0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
"""Tabulated loads: resistance relative to that in calm water [-]."""

_ROUNDING = 1e-6  # share of a control interval by which an order may come early
_COLUMNS = ("ship_speed", "shaft_speed", "pitch_ratio", "drive", "pitch_command", "fuel")


@functools.lru_cache(maxsize=16 * len(LOADS))
def steady_states(ship: Ship, load: float = 1.0) -> NDArray[Any]:
    """Return the steady states under a load, by rising ship speed, with the commands that hold them.

    The load is the resistance relative to that in calm water [-]. The structured array has ship speed,
    shaft speed, pitch (units of STATE), fuel rack, pitch command, and fuel flow of all engines [kg/s].

    Raises:
        ValueError: there are fewer than two steady states within the speed range of the engine.
    """
    plant = ship.record()
    low, high = plant["pitch_ratio_min"], plant["pitch_ratio_max"]
    pitch = float(low + 0.75 * (high - low))
    rows = []
    for rack in np.linspace(0.05, 0.95, 19) * float(plant["drive_max"]):
        try:
            found = equilibrium(ship, float(rack), pitch, resistance_factor=load).state
        except ValueError:
            continue  # This rack gives too little torque to turn the shaft.
        engine_speed = found.shaft_speed * plant["gear_ratio"]
        if plant["engine_speed_min"] <= engine_speed <= plant["engine_speed_max"]:
            torque = min(rack_torque(plant, engine_speed, rack), torque_limit(plant, engine_speed))
            fuel = total_fuel_flow(plant, found.shaft_speed, torque)
            rows.append((found.ship_speed, found.shaft_speed, found.pitch_ratio, rack, pitch, fuel))
    if len(rows) < 2:
        raise ValueError(
            f"{ship.name}: fewer than two steady states within the speed range of the engine; check "
            "resistance, propeller and engine of the ship file"
        )
    return np.array(sorted(rows), dtype=[(name, np.float64) for name in _COLUMNS])


class SteadyTables(NamedTuple):
    """Steady states under every load at which the engine can run."""

    loads: Floats  # loads, shape (k,), rising
    ends: NDArray[np.int64]  # first column of each load, and the number of columns, shape (k + 1,)
    columns: Floats  # fields of :func:`steady_states` as rows, load by load, shape (6, m)
    slowest: float  # lowest ship speed in calm water [m/s]
    fastest: float  # highest ship speed in calm water [m/s]


@functools.lru_cache(maxsize=16)
def steady_tables(ship: Ship) -> SteadyTables:
    """Return the steady states of a ship under each of :data:`LOADS` at which the engine can run."""
    loads, tables = [], []
    for load in LOADS:
        try:
            tables.append(steady_states(ship, load))
        except ValueError:
            continue  # The engine has no steady states under this load.
        loads.append(load)
    rows = np.concatenate(tables)
    columns = np.array([rows[name] for name in _COLUMNS])
    calm = steady_states(ship)["ship_speed"]
    ends = np.cumsum([0, *map(len, tables)])
    return SteadyTables(np.array(loads), ends, columns, float(calm[0]), float(calm[-1]))


_PARAMETERS = len(Sea.model_fields)
_WIND = _PARAMETERS - 1  # the last one is drawn with the phases of the waves

EPISODE_RANGES = np.dtype(
    [
        ("order", np.float64, (2, MAX_ORDERS)),  # lowest and highest ordered ship speeds [m/s]
        ("order_interval", np.float64),  # [s]
        ("begins_at_order", np.int64),  # 1 where the ship begins at its first order
        ("initial_speed", np.float64, (2,)),  # lowest and highest [m/s]
        ("resistance_rise", np.float64, (2,)),  # [-]
        ("resistance_swing", np.float64),  # [-]
        ("heading", np.float64, (2, MAX_ORDERS)),  # ordered headings [rad]
        ("track", np.float64, (2, MAX_ORDERS)),  # ordered cross tracks [m]
        ("cross_current", np.float64, (2,)),  # [m/s]
        ("drift_force", np.float64, (2,)),  # [N]
    ],
    align=True,
)
"""Ranges from which an episode draws; both ends are equal where a value is given."""

_SEA_CHOICE, _WAVE_SEED, _NOISE_SEED, _SEA = range(4)
_RISE, _FREQUENCY, _PHASE, _INITIAL, _ORDERS = range(_SEA + _WIND, _SEA + _WIND + 5)
_HEADINGS = _ORDERS + MAX_ORDERS
_TRACKS = _HEADINGS + MAX_ORDERS
_CURRENT, _DRIFT = _TRACKS + MAX_ORDERS, _TRACKS + MAX_ORDERS + 1
DRAWS, DRAWS_STEERED = _HEADINGS, _DRIFT + 1  # random numbers of an episode, in a fixed order
_FIELDS: Any = ENVIRONMENT.fields
_ZERO = [_FIELDS[name] for name in ("state", "sea", "estimate", "episode", "ended")]
_CLEARED = np.array([(start, start + kind.itemsize) for kind, start in _ZERO])
"""First and last byte of the fields that are zero at the start of an episode."""


def sea_bounds(seas: Sequence[SeaRange | None]) -> Floats:
    """Return lowest and highest Hs, Tp, gamma, heading and wind of seas, (m, 2, 5); zeros if calm."""
    calm = [[0.0] * _PARAMETERS] * 2
    drawn = [sea and [list(end.model_dump().values()) for end in sea] for sea in seas]
    return np.array([ends or calm for ends in drawn])


def episode_ranges(begin: ResetOptions, task: Task) -> Any:
    """Return the ranges of a task with the options of a reset, an EPISODE_RANGES array of shape (1,)."""
    ranges = np.zeros(1, EPISODE_RANGES)
    row = ranges[0]
    row["resistance_swing"], row["order_interval"] = task.resistance_swing, begin.order_interval_s
    row["begins_at_order"] = begin.orders is not None and begin.initial_speed_m_s is None
    speeds = np.array(task.speed_order_m_s)
    for name, given, drawn in (
        ("order", begin.orders, speeds[:, None]),
        ("heading", begin.heading_orders, np.radians(task.heading_order_deg)[:, None]),
        ("track", begin.track_orders, np.array(task.track_order_m)[:, None]),
        ("initial_speed", begin.initial_speed_m_s, speeds),
        ("resistance_rise", begin.resistance_rise, task.resistance_rise),
        ("cross_current", begin.cross_current_m_s, task.cross_current_m_s),
        ("drift_force", begin.drift_force_N, 1e3 * np.array(task.drift_force_kN)),
    ):
        row[name] = drawn if given is None else given
    return ranges


@compiled
def _between(ends: Any, share: float) -> float:
    """Return the value at a share of the way from the lower to the upper end of a range."""
    return float(ends[0] + (ends[1] - ends[0]) * share)


@compiled
def _steady_value(tables: SteadyTables, row: int, lower: int, load: float, speed: float) -> float:
    """Interpolate a row of the steady states by ship speed [m/s] and load [-]."""
    loads, ends, known, values = tables.loads, tables.ends, tables.columns[0], tables.columns[row]
    first, last = ends[lower], ends[lower + 1]
    light = piecewise_linear(known[first:last], values[first:last], last - first, speed)
    if len(loads) == 1 or load <= loads[lower]:
        return float(light)
    first, last = last, ends[lower + 2]
    heavy = piecewise_linear(known[first:last], values[first:last], last - first, speed)
    if load >= loads[lower + 1]:
        return float(heavy)
    slope = (heavy - light) / (loads[lower + 1] - loads[lower])
    return float(light + slope * (load - loads[lower]))


@compiled
def _load(
    plant: Record, sea: Record, tables: SteadyTables, speed: float, factor: float
) -> tuple[float, int]:
    """Return the load [-] at a speed [m/s], and the index of the tabulated load below it.

    ``factor`` is the mean resistance of the episode without waves, relative to that in calm water [-].
    """
    ahead = water_speed(plant, max(speed, tables.slowest))
    added = wave_resistance(plant, sea.head_sea, ahead)
    if plant.wind_area > 0.0:
        added += wind_resistance(plant, sea.wind, sea.along, sea.across, ahead, 0.0, 0.0)
    load = factor + added / resistance(plant, ahead, 1.0)
    lower = 0
    while lower < len(tables.loads) - 2 and load > tables.loads[lower + 1]:
        lower += 1
    return load, lower


@compiled
def _draw(env: Record, sea: Floats, ranges: Record, u: Floats) -> None:
    """Set the episode of an environment from :data:`DRAWS` or :data:`DRAWS_STEERED` numbers in [0, 1).

    ``sea`` has the lowest and highest Hs, Tp, gamma, heading and wind as its two rows, shape (2, 5). On
    return its first row has the drawn values, except the wind.
    """
    episode = env.episode
    for j in range(_WIND):
        sea[0, j] = _between(sea[:, j], u[_SEA + j])
    episode.random = np.uint64(u[_NOISE_SEED] * 9007199254740992.0)
    episode.order_interval = ranges.order_interval
    episode.resistance_mean = 1.0 + _between(ranges.resistance_rise, u[_RISE])
    episode.resistance_swing = ranges.resistance_swing
    episode.resistance_frequency = 2.0 * math.pi / _between((60.0, 180.0), u[_FREQUENCY])
    episode.resistance_phase = 2.0 * math.pi * u[_PHASE]
    steered = len(u) > DRAWS
    for j in range(MAX_ORDERS):
        episode.orders[j] = _between(ranges.order[:, j], u[_ORDERS + j])
        if steered:
            episode.heading_orders[j] = _between(ranges.heading[:, j], u[_HEADINGS + j])
            episode.track_orders[j] = _between(ranges.track[:, j], u[_TRACKS + j])
    if steered:
        env.plant.cross_current = _between(ranges.cross_current, u[_CURRENT])
        episode.drift_force = _between(ranges.drift_force, u[_DRIFT])


@compiled
def _set_reference(env: Record, tables: SteadyTables, j: int) -> None:
    """Set fuel and towing power of the steady state at order ``j`` of an episode."""
    plant, episode = env.plant, env.episode
    order = episode.orders[j]
    load, lower = _load(plant, env.sea, tables, order, episode.resistance_mean)
    episode.reference_fuel[j] = _steady_value(tables, 5, lower, load, order)
    ahead = water_speed(plant, max(order, tables.slowest))
    episode.reference_power[j] = load * resistance(plant, ahead, 1.0) * order


@compiled
def follow_profile(
    environments: Any, times: Floats, speeds: Floats, interval_s: float, tables: SteadyTables
) -> None:
    """Set the orders of the next control interval of every environment from an order profile.

    Args:
        environments: ENVIRONMENT array of shape (n,).
        times: times of the orders [s], rising, shape (m,).
        speeds: ordered ship speeds [m/s], shape (m,).
        interval_s: control interval [s].
        tables: from :func:`steady_tables`.
    """
    for i in range(len(environments)):
        env = environments[i]
        episode = env.episode
        begin = episode.elapsed * interval_s
        row = max(np.searchsorted(times, begin + _ROUNDING * interval_s, side="right") - 1, 0)
        # The order may change its index within the interval, and headings and tracks with it.
        first, last = order_index(episode, begin), order_index(episode, begin + interval_s)
        for j in range(first, last + 1):
            if episode.orders[j] != speeds[row]:
                episode.orders[j] = speeds[row]
                _set_reference(env, tables, j)


@compiled
def start_episodes(
    environments: Any,
    raw: NDArray[np.uint8],
    which: NDArray[np.int64],
    uniform: Floats,
    ranges: Any,
    seas: Floats,
    tables: SteadyTables,
    depth: float,
    dt: float,
) -> None:
    """Start episodes in a steady state at the initial speeds; the environments change in place.

    The steady state is that under the mean resistance. Slow fluctuation and waves act afterwards.

    Args:
        environments: ENVIRONMENT array of shape (n,), with the plants of the new episodes.
        raw: bytes of that array, shape (n, itemsize).
        which: indices of the environments that start an episode, shape (k,).
        uniform: random numbers in [0, 1), shape (k, :data:`DRAWS`) or (k, :data:`DRAWS_STEERED`).
        ranges: ranges from :func:`episode_ranges`.
        seas: bounds from :func:`sea_bounds`; each episode draws one sea.
        tables: from :func:`steady_tables`.
        depth: depth of the propeller centre [m], at which the waves act.
        dt: plant step [s].
    """
    shares = np.empty(2 * COMPONENTS + 1)
    drawn = np.empty((2, _PARAMETERS))
    for k in range(len(which)):
        u = uniform[k]
        for j in range(len(_CLEARED)):
            raw[which[k], _CLEARED[j, 0] : _CLEARED[j, 1]] = 0
        env = environments[which[k]]
        plant, state, episode, sea = env.plant, env.state, env.episode, env.sea
        chosen = min(int(u[_SEA_CHOICE] * len(seas)), len(seas) - 1)
        drawn[:] = seas[chosen]
        _draw(env, drawn, ranges[0], u)
        if drawn[0, 0] > 0.0 or drawn[1, _WIND] > 0.0:
            fill_uniform(int(u[_WAVE_SEED] * 2147483648.0), shares)
            drawn[0, _WIND] = _between(drawn[:, _WIND], shares[2 * COMPONENTS])
            hs, tp, gamma, heading = drawn[0, 0], drawn[0, 1], drawn[0, 2], drawn[0, 3]
            fill_sea(sea, hs, tp, gamma, heading, drawn[0, _WIND], depth, shares)
        episode.sea[:] = drawn[0]
        speed = _between(ranges[0].initial_speed, u[_INITIAL])
        if ranges[0].begins_at_order != 0:
            speed = episode.orders[0]
        factor = episode.resistance_mean
        load, lower = _load(plant, sea, tables, speed, factor)
        for j in range(MAX_ORDERS):
            order = episode.orders[j]
            if j > 0 and order == episode.orders[j - 1]:
                episode.reference_fuel[j] = episode.reference_fuel[j - 1]
                episode.reference_power[j] = episode.reference_power[j - 1]
                continue
            _set_reference(env, tables, j)
        state.ship_speed = clip(speed, tables.slowest, tables.fastest)
        state.shaft_speed = _steady_value(tables, 1, lower, load, speed)
        state.pitch_ratio = _steady_value(tables, 2, lower, load, speed)
        rack = _steady_value(tables, 3, lower, load, speed)
        episode.pitch_command = _steady_value(tables, 4, lower, load, speed)
        episode.drive = episode.integral = rack  # bumpless transfer to the governor
        episode.rack_command, episode.shaft_speed_command = rack, state.shaft_speed
        if plant.turns != 0:  # The ship drifts with the water.
            state.sway_speed = plant.cross_current
        inputs = inputs_without_sea(
            rack, episode.pitch_command, 0.0, 0.0, load, 0.0, 0.0, 0.0, NO_SIGNALS
        )
        set_state(state, settle_lags(plant, get_state(state), inputs))
        prepare(plant, state, env.memory, sea, rack, Disturbance(0.0, 0.0, factor, NO_SIGNALS), dt)
