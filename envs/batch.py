"""A batch of environments as arrays, and how each begins: what single and vector environment share."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED
from ..baselines.governor import tune
from ..baselines.steering import OBSERVED_STEERED
from ..core.sizes import check_size
from ..observers import get_observer
from ..observers.records import ESTIMATE
from ..plant import Ship, equilibrium, realise
from ..plant.dynamics import settled
from ..plant.helm import refuse_to_steer
from ..plant.hull import resistance, water_speed, wave_resistance
from ..plant.state import Inputs, State
from ..plant.stepping import Disturbance, prepare
from ..plant.terms import Term
from ..plant.waves import calm
from .divergence import refuse_divergence
from .kernel import control_interval, first_observation
from .ranges import observed_ranges
from .records import COMMON, ENVIRONMENT, EPISODE, MAX_ORDERS
from .settings import Begin, Settings, check_randomise, drawn, noise_of, seas_of
from .tasks import get_task

_BYTES_EACH = 1e5  # an environment with its sea, measured
_FIELDS: Any = ENVIRONMENT.fields


_LOADS = (0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
"""Resistance over that of calm water at which steady states are worked out."""


@functools.lru_cache(maxsize=16 * len(_LOADS))
def _steady_table(ship: Ship, load: float = 1.0) -> NDArray[Any]:
    """Steady states under a load by rising ship speed: ship speed, shaft speed and pitch (units of
    STATE), and the commands that hold them.
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
    names = ("ship_speed", "shaft_speed", "pitch_ratio", "drive", "pitch_command")
    return np.array(sorted(rows), dtype=[(name, np.float64) for name in names])


@functools.lru_cache(maxsize=16)
def _loaded(ship: Ship) -> tuple[NDArray[np.float64], list[NDArray[Any]]]:
    """The loads that the ship can sail under, and their steady states."""
    loads, tables = [], []
    for load in _LOADS:
        try:
            tables.append(_steady_table(ship, load))
        except ValueError:
            continue  # more, or less, than her engine can work against
        loads.append(load)
    return np.array(loads), tables


@functools.lru_cache(maxsize=16)
def _governor_gains(ship: Ship) -> NDArray[np.float64]:
    """Gains of the built-in governor, which acts at every plant step; shape (3, m)."""
    return np.array(tune(ship, ship.time_step_s))


DRIFT_ARM = 0.1
"""Where the slow side force of waves and wind acts: before midship, in ship lengths; assumed."""


def pushed(ship: Ship) -> Ship:
    """The same ship as a steered environment has it: she hears a slow side force.

    Args:
        ship: that turns.
    """
    force = Term(
        id="drift-force", acts_on="side_force", expression="drift_force",
        also={"yaw_moment": f"{DRIFT_ARM * ship.manoeuvring.length_m!r} * drift_force"},
    )  # fmt: skip
    return ship.with_signals({"drift_force": "N"}).with_values({"term": [*ship.term, force]})


class Arrays(NamedTuple):
    """A batch by kind of record, each an array of shape (n,) that shares its memory with the batch."""

    plants: Any
    states: Any
    memories: Any
    seas: Any
    observers: Any
    estimates: Any
    episodes: Any
    observations: Any
    terms: Any
    truths: Any
    rewards: Any
    ended: Any


class Batch:
    """Environments 0 to n - 1 with one task.

    Args:
        n: how many.
        settings: of all of them.
        steered: whether the rudder is an action.

    Raises:
        ValueError: something that does not exist or is out of range, or a task or ship that is not
            steered so.
    """

    def __init__(self, n: int, settings: Settings, steered: bool = False) -> None:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
            raise ValueError(f"{n!r} environments: a whole number from 1 is needed")
        check_size(n, _BYTES_EACH, "environments at once")
        self.settings, self.steered = settings, steered
        self.task = get_task(settings.task)
        self.ship = self.task.sailed(settings.ship)
        if steered:
            refuse_to_steer(self.ship)
        elif self.task.steered:
            raise ValueError(f"task {settings.task!r} steers: make shaftline/Steering-v0")
        if not (self.ship.has_diesel and self.ship.moves and self.ship.has_propeller):
            raise ValueError(
                f"{self.ship.name}: the environment needs a diesel ship that moves by a propeller"
            )
        self.ship.refuse_unheard(())
        self.dt = self.ship.time_step_s
        self.steps = settings.steps(self.dt)
        self.interval_s = self.steps * self.dt
        self.seas_to_draw = seas_of(settings.sea, self.task)
        check_randomise(self.ship, settings.randomise or {})
        self._varied = [
            (self.ship.number(key), width) for key, width in (settings.randomise or {}).items()
        ]
        self.gains = np.zeros((3, 0))
        if settings.action_mode == "shaft-speed":
            self.gains = _governor_gains(self.ship)
        self.table = _steady_table(self.ship)
        self._loads, self._tables = _loaded(self.ship)
        self._plant = (pushed(self.ship) if steered else self.ship).record()
        self.n = n
        observer = get_observer(settings.observer, settings.tuning).discretise(self.ship, self.dt)
        self.environments = np.zeros(n, ENVIRONMENT)
        self.environments["plant"] = self._plant
        self.environments["observer"] = observer
        self.scale: Any = None
        if settings.normalised:
            top = float(_steady_table(self.ship)["ship_speed"].max())
            self.scale = observed_ranges(self.ship, top, self.observed)
        self.common = np.zeros(1, COMMON)[0]
        self.common["noise"] = noise_of(self.ship, settings.sensor_noise)
        for term, weight in self.task.weights.model_dump().items():
            self.common["weights"][term] = weight

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As it was, in another process."""
        self.__dict__.update(state)
        # where an observer that is not ours stands elsewhere
        observer = get_observer(self.settings.observer, self.settings.tuning)
        self.environments["observer"]["address"] = observer.address

    @property
    def arrays(self) -> Arrays:
        """The batch by kind of record."""
        return Arrays(*(self.environments[name] for name in ENVIRONMENT.names or ()))

    @property
    def observed(self) -> tuple[str, ...]:
        """Signals of an observation, in order."""
        return OBSERVED_STEERED if self.steered else OBSERVED

    @property
    def actions(self) -> int:
        """How many numbers an action has."""
        return 3 if self.steered else 2

    @property
    def observation(self) -> NDArray[np.float32]:
        """The observations as plain rows, shape (n, 8), or (n, 14) where the ship is steered."""
        # a record's field is no contiguous array, so its rows are laid over the records' memory
        offset = _FIELDS["observation"][1]
        return np.ndarray(
            (self.n, len(self.observed)), np.float32, self.environments.view(np.uint8), offset,
            (ENVIRONMENT.itemsize, 4),
        )  # fmt: skip

    def told(self, which: Any = slice(None)) -> NDArray[np.float32]:
        """A copy of the observations as an agent gets them, shape (n, 8) or (n, 14).

        Args:
            which: of the environments; all by default.
        """
        rows = np.array(self.observation[which])
        if self.scale is not None:
            rows = (rows - self.scale[0]) / self.scale[1]
        return rows.astype(np.float32, copy=False)

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """Control intervals since the last reset, shape (n,)."""
        return np.asarray(self.environments["episode"]["elapsed"])

    def begin(self, options: Mapping[str, Any] | None) -> Begin:
        """How episodes begin under the options of a reset.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        known = self.table["ship_speed"]
        speeds = (float(known[0]), float(known[-1]))
        return Begin.of(options, self.task, speeds, self.steered)

    def reset(self, i: int, rng: np.random.Generator, begin: Begin) -> None:
        """Begin a new episode of environment ``i``.

        Args:
            i: which.
            rng: everything that is drawn comes from it.
            begin: from :meth:`begin`.
        """
        task, arrays = self.task, self.arrays
        episode, plant = arrays.episodes[i], arrays.plants[i]
        arrays.plants[i] = self._plant
        for number, width in self._varied:
            number.write(plant, number.value * rng.uniform(1.0 - width, 1.0 + width))
        arrays.seas[i] = self._sea(rng, begin)
        arrays.episodes[i] = np.zeros(1, EPISODE)[0]
        episode["random"] = rng.integers(2**63, dtype=np.uint64)
        orders = rng.uniform(*task.speed_order_m_s, MAX_ORDERS)
        episode["orders"] = orders if begin.orders is None else begin.orders
        episode["order_interval"] = begin.order_interval_s
        rise = rng.uniform(*task.resistance_rise)
        if begin.resistance_rise is not None:
            rise = begin.resistance_rise
        episode["resistance_mean"] = 1.0 + rise
        episode["resistance_swing"] = task.resistance_swing
        episode["resistance_frequency"] = 2.0 * math.pi / rng.uniform(60.0, 180.0)
        episode["resistance_phase"] = rng.uniform(0.0, 2.0 * math.pi)
        if self.steered:
            self._set_course(i, rng, begin)
        speed = begin.initial_speed_m_s
        self._start(i, float(episode["orders"][0]) if speed is None else speed)

    def _set_course(self, i: int, rng: np.random.Generator, begin: Begin) -> None:
        """Headings, lines, current and side force of an episode."""
        task, episode = self.task, self.arrays.episodes[i]
        headings = np.radians(rng.uniform(*task.heading_order_deg, MAX_ORDERS))
        lines = rng.uniform(*task.track_order_m, MAX_ORDERS)
        current = rng.uniform(*task.cross_current_m_s)
        force = 1e3 * rng.uniform(*task.drift_force_kN)
        episode["heading_orders"] = (
            headings if begin.heading_orders is None else begin.heading_orders
        )
        episode["track_orders"] = lines if begin.track_orders is None else begin.track_orders
        asked = begin.cross_current_m_s
        self.arrays.plants[i]["cross_current"] = current if asked is None else asked
        episode["drift_force"] = force if begin.drift_force_N is None else begin.drift_force_N

    def _sea(self, rng: np.random.Generator, begin: Begin) -> Any:
        """SEA record of an episode."""
        which = int(rng.integers(len(self.seas_to_draw)))
        wave_seed = int(rng.integers(2**31))
        sea = drawn(self.seas_to_draw[which], rng)
        if begin.seas is not None:  # from a stream of its own: all else is as it would be without
            (own,) = rng.spawn(1)
            sea = drawn(begin.seas[int(own.integers(len(begin.seas)))], own)
        return realise(sea, self.ship.propeller.depth_m, wave_seed) if sea else calm()

    def _start(self, i: int, speed: float) -> None:
        """Put environment ``i`` where the ship would be that has long sailed at a speed [m/s].

        As far as its mean goes: the slow swing and single waves have moved nothing yet.
        """
        arrays = self.arrays
        episode, plant = arrays.episodes[i], arrays.plants[i]
        known = self.table["ship_speed"]
        factor = float(episode["resistance_mean"])
        plain = resistance(plant, water_speed(plant, max(speed, known[0])), 1.0)
        load = factor + wave_resistance(plant, arrays.seas[i]["head_sea"]) / plain
        lower = int(np.searchsorted(self._loads[1:-1], load))
        pair = slice(lower, lower + 2)  # the loads to either side

        def at(name: str) -> float:
            tables = self._tables[pair]
            values = [float(np.interp(speed, t["ship_speed"], t[name])) for t in tables]
            return float(np.interp(load, self._loads[pair], values))

        rack = at("drive")
        episode["pitch_command"], episode["drive"] = at("pitch_command"), rack
        episode["integral"] = rack  # the governor takes over without a bump
        bare = State(
            at("pitch_ratio"), at("shaft_speed"), float(np.clip(speed, known[0], known[-1]))
        )
        if self.steered:  # carried by the water
            bare = bare._replace(sway_speed=float(plant["cross_current"]))
        inputs = Inputs(rack, float(episode["pitch_command"]), resistance_factor=load)
        arrays.states[i] = tuple(settled(plant, bare, inputs))
        arrays.estimates[i] = np.zeros(1, ESTIMATE)[0]
        prepare(
            arrays.plants[i], arrays.states[i], arrays.memories[i], arrays.seas[i], rack,
            Disturbance(0.0, 0.0, factor), self.dt,
        )  # fmt: skip

    def observe(self, which: NDArray[np.int64]) -> None:
        """Fill the observations of environments that were just reset."""
        first_observation(self.environments, self.common, self.dt, which)

    def step(
        self, action: NDArray[np.float32], pool: ThreadPoolExecutor | None = None, shares: int = 1
    ) -> None:
        """Carry every environment over one control interval; results stand in the arrays.

        Args:
            action: shape (n, 2), or (n, 3) where the ship is steered.
            pool: threads that do it; this one by default.
            shares: parts into which the batch is cut for them.
        """
        if pool is None:
            self._step(action, 0, self.n)
            return
        bounds = np.linspace(0, self.n, min(shares, self.n) + 1).astype(int)
        list(pool.map(self._step, [action] * (len(bounds) - 1), bounds[:-1], bounds[1:]))

    def _step(self, action: NDArray[np.float32], first: int, last: int) -> None:
        control_interval(
            self.environments, self.common, self.gains, action, self.steps, self.dt, first, last,
        )  # fmt: skip
        refuse_divergence(self.ship, self.environments, first, last)
