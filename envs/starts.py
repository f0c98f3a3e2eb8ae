"""How the ships of a batch begin their episodes: drawn numbers in, ships in steady state out.

NumPy's generators draw the numbers ship by ship, since each ship has a stream of its own. All that
follows from them (sea, steady state under the load, lags) is worked out for every ship in one compiled
call.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from ..core.numeric import clip, piecewise_linear
from ..core.random_stream import fill_uniform
from ..plant import Sea, Ship, equilibrium
from ..plant.dynamics import settled
from ..plant.hull import resistance, water_speed, wave_resistance
from ..plant.state import Inputs, get_state, set_state
from ..plant.stepping import Disturbance, prepare
from ..plant.term_kernel import NO_SIGNALS
from ..plant.waves import COMPONENTS, fill_sea
from .options import Begin
from .records import MAX_ORDERS
from .settings import SeaRange

LOADS = (0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
"""Resistance over that of calm water at which steady states are worked out."""

_COLUMNS = ("ship_speed", "shaft_speed", "pitch_ratio", "drive", "pitch_command")


@functools.lru_cache(maxsize=16 * len(LOADS))
def steady_states(ship: Ship, load: float = 1.0) -> NDArray[Any]:
    """Return the steady states under a load, by rising ship speed, and the commands that hold them.

    Args:
        ship: with a diesel and a propeller.
        load: resistance over that of calm water [-].

    Returns:
        Structured array with ship speed, shaft speed and pitch (units of STATE), fuel rack and pitch
        command.

    Raises:
        ValueError: the engine's speed range holds fewer than two steady states.
    """
    plant = ship.record()
    pitch = float(
        plant["pitch_ratio_min"] + 0.75 * (plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
    )
    rows = []
    for rack in np.linspace(0.05, 0.95, 19) * float(plant["drive_max"]):
        try:
            found = equilibrium(ship, float(rack), pitch, resistance_factor=load).state
        except ValueError:
            continue  # too little fuel to turn the shaft
        engine_speed = found.shaft_speed * plant["gear_ratio"]
        if plant["engine_speed_min"] <= engine_speed <= plant["engine_speed_max"]:
            rows.append((found.ship_speed, found.shaft_speed, found.pitch_ratio, rack, pitch))
    if len(rows) < 2:
        raise ValueError(f"{ship.name}: no steady states inside the engine's speed range")
    return np.array(sorted(rows), dtype=[(name, np.float64) for name in _COLUMNS])


class SteadyTables(NamedTuple):
    """Steady states under every load that the engine can work against."""

    loads: NDArray[np.float64]
    """Shape (k,), rising."""
    ends: NDArray[np.int64]
    """First column of each load's states and, last, their number; shape (k + 1,)."""
    columns: NDArray[np.float64]
    """Fields of :func:`steady_states`, all loads one behind the other, shape (5, m)."""
    slowest: float
    """Lowest ship speed in calm water [m/s]."""
    fastest: float
    """Highest ship speed in calm water [m/s]."""


@functools.lru_cache(maxsize=16)
def steady_tables(ship: Ship) -> SteadyTables:
    """Return the steady states of a ship under each of :data:`LOADS` that her engine can bear."""
    loads, tables = [], []
    for load in LOADS:
        try:
            tables.append(steady_states(ship, load))
        except ValueError:
            continue  # more, or less, than her engine can work against
        loads.append(load)
    rows = np.concatenate(tables)
    columns = np.array([rows[name] for name in _COLUMNS])
    calm = steady_states(ship)["ship_speed"]
    ends = np.cumsum([0, *map(len, tables)])
    return SteadyTables(np.array(loads), ends, columns, float(calm[0]), float(calm[-1]))


_PARAMETERS = len(Sea.model_fields)

DRAW = np.dtype(
    [
        ("sea", np.float64, (_PARAMETERS,)),  # hs_m, tp_s, gamma, heading_deg; zeros are calm water
        ("wave_seed", np.int64),  # of the sea's realisation
        ("random", np.uint64),  # seed of the instruments' noise
    ]
)
"""What is drawn for an episode besides its :data:`uniform` numbers."""


def draw_episodes(
    rngs: Sequence[np.random.Generator], seas: Sequence[SeaRange | None], begin: Begin,
    varied: int, steered: bool,
) -> tuple[NDArray[Any], NDArray[np.float64]]:  # fmt: skip
    """Draw the random numbers of one episode a generator.

    The order of the draws decides which episode a seed is, so published results depend on it: factors of
    the ship's keys, choice and seed of the sea, the sea's parameters, the noise's seed, and then orders,
    resistance and, steered, headings, tracks, current and side force.

    Args:
        rngs: one a ship.
        seas: that the environment may draw.
        begin: options of the reset.
        varied: how many keys of the ship are randomised.
        steered: whether the rudder is an action.

    Returns:
        DRAW records, shape (n,); and numbers uniform in [0, 1), shape (n, varied + 67) or, steered,
        (n, varied + 197).
    """
    draws = np.zeros(len(rngs), DRAW)
    count = MAX_ORDERS + 3 + (2 * MAX_ORDERS + 2) * steered
    uniform = np.empty((len(rngs), varied + count))
    known = [*seas, *(begin.seas or ())]
    choice = np.zeros(len(rngs), np.int64)
    wave_seeds, noise = draws["wave_seed"], draws["random"]
    places = np.zeros((len(rngs), _PARAMETERS))  # of a sea's parameters within their ranges
    for i, rng in enumerate(rngs):
        if varied:
            rng.random(out=uniform[i, :varied])
        which = int(rng.integers(len(seas))) if len(seas) > 1 else 0
        wave_seeds[i] = rng.integers(2**31)
        if known[which] is not None:
            rng.random(out=places[i])
        if (
            begin.seas is not None
        ):  # from a stream of its own: all else stays as it would be without
            (own,) = rng.spawn(1)
            which = len(seas) + int(own.integers(len(begin.seas)))
            if known[which] is not None:
                own.random(out=places[i])
        choice[i] = which
        noise[i] = rng.integers(2**63, dtype=np.uint64)
        rng.random(out=uniform[i, varied:])
    low, high = np.array([_ends_of(sea) for sea in known])[choice].swapaxes(0, 1)
    draws["sea"] = low + (high - low) * places
    return draws, uniform


def _ends_of(sea: SeaRange | None) -> list[list[float]]:
    """Return lowest and highest Hs, Tp, gamma and heading of a range; calm water is zeros."""
    if sea is None:
        return [[0.0] * _PARAMETERS] * 2
    return [list(end.model_dump().values()) for end in sea]


@compiled
def _steady_value(tables: SteadyTables, row: int, lower: int, load: float, speed: float) -> float:
    """Interpolate a row of the steady states by ship speed [m/s] and, between two loads, by load [-]."""
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
def start_episodes(
    environments: Any, which: NDArray[np.int64], draws: Any, speeds: NDArray[np.float64],
    tables: SteadyTables, depth: float, dt: float,
) -> None:  # fmt: skip
    """Put ships where they would be after a long voyage at one speed; all changes in place.

    The steady state is that under the mean resistance; slow swing and single waves have moved nothing.
    Plant, episode and a calm sea must stand in the environments already.

    Args:
        environments: ENVIRONMENT array of shape (n,).
        which: environments that begin an episode, shape (k,).
        draws: DRAW records, shape (k,).
        speeds: ship speed of each [m/s], shape (k,), held within the steady states.
        tables: of :func:`steady_tables`.
        depth: of the propeller's centre [m], at which the waves act.
        dt: plant step [s].
    """
    shares = np.empty(2 * COMPONENTS)
    for k in range(len(which)):
        env, draw = environments[which[k]], draws[k]
        plant, state, episode, sea = env.plant, env.state, env.episode, env.sea
        if draw.sea[0] > 0.0:
            fill_uniform(draw.wave_seed, shares)
            fill_sea(sea, draw.sea[0], draw.sea[1], draw.sea[2], draw.sea[3], depth, shares)
        speed, factor = speeds[k], episode.resistance_mean
        ahead = water_speed(plant, max(speed, tables.slowest))
        added = wave_resistance(plant, sea.head_sea, ahead)
        load = factor + added / resistance(plant, ahead, 1.0)
        lower = 0
        while lower < len(tables.loads) - 2 and load > tables.loads[lower + 1]:
            lower += 1
        state.ship_speed = clip(speed, tables.slowest, tables.fastest)
        state.shaft_speed = _steady_value(tables, 1, lower, load, speed)
        state.pitch_ratio = _steady_value(tables, 2, lower, load, speed)
        rack = _steady_value(tables, 3, lower, load, speed)
        episode.pitch_command = _steady_value(tables, 4, lower, load, speed)
        episode.drive = episode.integral = rack  # the governor takes over without a bump
        if plant.turns != 0:  # carried by the water
            state.sway_speed = plant.cross_current
        inputs = Inputs(
            rack, episode.pitch_command, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, load, 0.0, 0.0, 0.0, 0.0,
            0.0, NO_SIGNALS,
        )  # fmt: skip
        set_state(state, settled(plant, get_state(state), inputs))
        prepare(plant, state, env.memory, sea, rack, Disturbance(0.0, 0.0, factor, NO_SIGNALS), dt)
