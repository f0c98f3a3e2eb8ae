"""State of a batch of environments as arrays, shared by the single and the vector environments."""

from __future__ import annotations

import functools
import itertools
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import NORMALISED_BOUND, OBSERVED, PREVIEW
from ..baselines.governor import limiter_slope, tune
from ..baselines.helmsman import STEERED
from ..core.compiled import compiled
from ..core.files import check_size
from ..core.lanes import LANES
from ..observers import get_observer
from ..observers.records import Floats
from ..plant import Ship
from ..plant.helm import require_steering
from ..plant.ship import refuse_wind
from ..plant.terms import Term
from ..plant.together import GROUP
from . import records, starts
from .kernel import control_interval, first_observation
from .options import ResetOptions
from .orders import profile_columns
from .ranges import observed_ranges
from .residual import BaseController
from .rewards import goals_record
from .settings import SeaRange, Settings, check_randomise, noise_record, read_seas
from .tasks import controller_for, get_task

_BYTES_EACH = 8e4  # memory of one environment with its sea, measured
_STARTS_EACH = 8  # episodes that a thread starts at least; a thread takes as long to wake up
_STEPS_EACH = 16  # environments that a thread steps at least, for the same reason
_FIELDS: Any = records.ENVIRONMENT.fields
_SIGNALS: tuple[str, ...] = records.OBSERVATION.names or ()
_DOUBLE = np.dtype(np.float64)
_SECOND = {
    "fuel-rack": records.DIRECT_RACK,
    "limited-rack": records.LIMITED_RACK,
    "shaft-speed": records.SHAFT_SPEED,
}

LIMITER_RESPONSE_S = (
    0.25  # of the limiters of a rack command to a speed error, at a gain of one [s]
)
DRIFT_ARM = 0.1  # assumed lever arm of the slow side force ahead of midship, in ship lengths


@functools.lru_cache(maxsize=16)
def _governor_gains(ship: Ship) -> Floats:
    """Return the gains of the built-in governor, which acts at every plant step; shape (3, m)."""
    return np.array(tune(ship, ship.time_step_s))


def add_drift_force(ship: Ship) -> Ship:
    """Return a ship with an additional slow side force, as the steered environments have it."""
    force = Term(
        id="drift-force",
        acts_on="side_force",
        expression="drift_force",
        also={"yaw_moment": f"{DRIFT_ARM * ship.manoeuvring.length_m!r} * drift_force"},
    )
    return ship.with_signals({"drift_force": "N"}).with_values({"term": [*ship.term, force]})


Singles = NDArray[np.float32]
Ints = NDArray[np.int64]


R = TypeVar("R")


@functools.lru_cache(maxsize=128)
def _parts(count: int, parts: int) -> list[tuple[int, int]]:
    """Return first items and ends of some parts, which have whole groups of ships.

    >>> _parts(11, 2)
    [(0, 4), (4, 11)]
    """
    groups = -(-count // LANES)
    bounds = [min(LANES * (groups * k // parts), count) for k in range(parts + 1)]
    return list(itertools.pairwise(bounds))


def _divide(
    work: Callable[[int, int], R], count: int, pool: ThreadPoolExecutor | None, parts: int
) -> list[R]:
    """Return the results of ``work(first, last)`` for all of ``count`` items, in several parts.

    This thread and those of a pool share the parts. All parts have ended when an error is raised, so no
    thread goes on with the items.
    """
    if pool is None or parts < 2:
        return [work(0, count)]
    own, *others = _parts(count, parts)
    found: dict[tuple[int, int], R] = {}
    futures = {part: pool.submit(work, *part) for part in others}
    try:
        found[own] = work(*own)
        for part in reversed(others):
            if futures[part].cancel():  # no thread has begun with it
                found[part] = work(*part)
    finally:
        wait([future for future in futures.values() if not future.cancelled()])
    return [found[part] if part in found else futures[part].result() for part in (own, *others)]


@compiled
def _observe(
    signals: Singles, which: Ints, columns: Ints, middle: Singles, half: Singles, bound: float
) -> Singles:
    """Return rows with the selected signals of environments, scaled and clipped."""
    rows = np.empty((len(which), len(columns)), np.float32)
    for i in range(len(which)):
        for j in range(len(columns)):
            scaled = (signals[which[i], columns[j]] - middle[j]) / half[j]
            rows[i, j] = min(max(scaled, -bound), bound) if scaled == scaled else 0.0  # nan
    return rows


class StartDistribution(NamedTuple):
    """Distribution from which an episode draws its start."""

    ranges: Any  # EPISODE_RANGES of shape (1,)
    seas: Floats  # sea bounds from :func:`shaftline.envs.starts.sea_bounds`


Arrays = namedtuple(
    "Arrays",
    "plants states memories seas observers estimates episodes observations terms truths rewards ended",
)
"""Records of a batch by kind, each an array of shape (n,) that shares its memory with the batch."""


class Batch:
    """Environments 0 to n - 1 with one task; with ``steered`` the rudder is an action.

    Views of the results share the memory of the batch, with a row for each environment: ``signals`` (all
    signals of :data:`OBSERVATION` in physical units), ``terms``, ``truths``, ``rewards``, ``ended``, and
    ``elapsed``, the number of control intervals since the last reset.

    Raises:
        ValueError: a name does not exist, a value is out of range, or task or ship do not match
            ``steered``.
    """

    def __init__(self, n: int, settings: Settings, steered: bool = False) -> None:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
            raise ValueError(f"num_envs = {n!r}: must be a whole number of at least 1")
        check_size(n, _BYTES_EACH, "environments at once")
        self.settings, self.steered = settings, steered
        self.task = get_task(settings.task)
        self.ship = self.task.load_ship(settings.ship)
        if steered:
            require_steering(self.ship)
        elif self.task.steered:
            raise ValueError(
                f"task {settings.task!r} has the rudder as an action: use shaftline/Steering-v0"
            )
        if not (self.ship.has_diesel and self.ship.moves and self.ship.has_propeller):
            raise ValueError(
                f"{self.ship.name}: the environment needs a ship with a diesel engine, a propeller and "
                "a moving hull"
            )
        self.ship.require_external_signals(())
        self.task = self.task.scale_orders(self.ship)
        self.dt = self.ship.time_step_s
        self.steps = settings.steps(self.dt)
        self.interval_s = self.steps * self.dt
        self.seas_to_draw = self._felt(read_seas(settings.sea, self.task))
        randomise = self.task.randomise if settings.randomise is None else settings.randomise
        check_randomise(self.ship, randomise)
        self._varied = [(self.ship.parameter(key), width) for key, width in randomise.items()]
        self.command = settings.drive_command
        governed = self.command == "shaft-speed"
        self.gains = _governor_gains(self.ship) if governed else np.zeros((3, 1))
        self.table = starts.steady_states(self.ship)
        self._tables = starts.steady_tables(self.ship)
        self.n = n
        self._everyone = np.arange(n)
        observer = get_observer(settings.observer, settings.tuning).discretise(self.ship, self.dt)
        # At least two records: a field of a single one counts as contiguous, a type of its own for
        # which the kernels would be compiled once more.
        self._memory = np.zeros(max(n, 2), records.ENVIRONMENT)
        self._memory["plant"] = (add_drift_force(self.ship) if steered else self.ship).record()
        self._memory["observer"] = observer
        self.base: BaseController | None = None
        if settings.base_controller is not None:
            name, interval_s = settings.base_controller, self.interval_s
            controller = controller_for(self.task, name, self.ship, interval_s, steered)
            self.base = BaseController(controller, self.ship, n, steered, self.task.preview)
        self._columns = np.array([_SIGNALS.index(name) for name in self.observed])
        top = float(self.table["ship_speed"].max())
        middle, half = observed_ranges(self.ship, top, self.observed)
        if not settings.normalised:
            middle, half = np.zeros_like(middle), np.ones_like(half)
        self._scale = (middle, half)
        self.profile: tuple[Floats, Floats] | None = None
        if settings.order_profile is not None:
            self.profile = profile_columns(settings.order_profile)
        self._usual = self._beginning(ResetOptions.of(None, self.task, (0.0, 0.0), steered))
        self.commons = np.zeros(1, records.COMMON)
        self.common["noise"] = noise_record(self.ship, settings.sensor_noise)
        self.common["goals"] = goals_record(self.task.goals)
        self.common["increments"] = settings.action_mode == "increment"
        self.common["preview"] = self.task.preview
        self.common["second"] = _SECOND[self.command]
        self.common["limiter_slope"] = limiter_slope(self.ship.record(), LIMITER_RESPONSE_S)

        self._lay_views()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a batch in another process."""
        self.__dict__.update(state)
        self._lay_views()  # A copied view does not share the memory of the batch.
        # The address of a user's observer differs between processes.
        observer = get_observer(self.settings.observer, self.settings.tuning)
        self.environments["observer"]["address"] = observer.address

    def _lay_views(self) -> None:
        """Create the views of the records, which take longer to create than to read."""
        self.environments = self._memory[: self.n]
        self.signals = self._matrix("observation", np.dtype(np.float32))
        self.terms = self._matrix("terms")
        self.truths = self._matrix("truth")
        self.rewards = self._matrix("reward")[:, 0]
        self.ended = self._matrix("ended", np.dtype(np.int64))[:, 0]
        self.elapsed = self.environments["episode"]["elapsed"]
        self._plants, self._states = self._memory["plant"], self._memory["state"]

    def _matrix(self, name: str, kind: np.dtype[Any] = _DOUBLE) -> NDArray[Any]:
        """Return a record of each environment, with values of one kind, as a row: shape (n, k)."""
        # A field of a record array is not contiguous, so this array is a strided view of the memory.
        form, offset, *_ = _FIELDS[name]
        return np.ndarray(
            (self.n, form.itemsize // kind.itemsize),
            kind,
            self.environments.view(np.uint8),
            offset,
            (records.ENVIRONMENT.itemsize, kind.itemsize),
        )

    @property
    def common(self) -> Any:
        """Parameters that all environments of the batch share, a records.COMMON record."""
        return self.commons[0]

    @property
    def arrays(self) -> Arrays:
        """Arrays of the batch by kind of record."""
        return Arrays(*(self.environments[name] for name in records.ENVIRONMENT.names or ()))

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the signals of an observation, in order."""
        second = (
            records.SHAFT_SPEED_COMMAND if self.command == "shaft-speed" else records.RACK_COMMAND
        )
        base = () if self.base is None else records.BASE_COMMANDS[: self.actions]
        if self.steered:
            return (
                *OBSERVED,
                *STEERED,
                *records.LEARNER_SIGNALS,
                *records.COURSE_ERRORS,
                second,
                *base,
            )
        ahead = PREVIEW if self.task.preview else ()
        return (*OBSERVED, *ahead, *records.LEARNER_SIGNALS, second, *base)

    @property
    def observed_scale(self) -> Singles:
        """Middle and half width of the range of each observed signal, shape (2, o)."""
        return np.array(self._scale, np.float32)

    @property
    def actions(self) -> int:
        """Number of values of an action."""
        return 3 if self.steered else 2

    def observation(self, which: Ints | None = None) -> Singles:
        """Return observations, shape (k, o), in the form of the settings; all of them by default."""
        which = self._everyone if which is None else which
        bound = NORMALISED_BOUND if self.settings.normalised else np.inf
        return _observe(self.signals, which, self._columns, *self._scale, bound)

    def begin(self, options: Mapping[str, Any] | None) -> StartDistribution:
        """Return the distribution from which episodes start under the options of a reset, if any."""
        if not options:
            return self._usual
        if self.profile is not None and "speed_order_m_s" in options:
            raise ValueError(
                "options: speed_order_m_s: the orders are those of order_profile; give one of the two"
            )
        known = self.table["ship_speed"]
        speeds = (float(known[0]), float(known[-1]))
        return self._beginning(ResetOptions.of(options, self.task, speeds, self.steered))

    def _felt(self, seas: list[SeaRange | None]) -> list[SeaRange | None]:
        """Return seas, and refuse a wind that does not act on the ship."""
        for sea in seas:
            refuse_wind(self.ship, sea[1].wind_m_s if sea else 0.0)
        return seas

    def _beginning(self, begin: ResetOptions) -> StartDistribution:
        if self.profile is not None:
            begin = replace(begin, orders=np.full(records.MAX_ORDERS, self.profile[1][0]))
        seas = self.seas_to_draw if begin.seas is None else self._felt(begin.seas)
        return StartDistribution(starts.episode_ranges(begin, self.task), starts.sea_bounds(seas))

    def reset(
        self,
        which: Ints,
        rngs: Sequence[np.random.Generator],
        beginning: StartDistribution,
        pool: ThreadPoolExecutor | None = None,
        shares: int = 1,
    ) -> None:
        """Start new episodes in k environments; each generator draws everything of one episode.

        The threads of a pool share the work.
        """
        varied = len(self._varied)
        draws = starts.DRAWS_STEERED if self.steered else starts.DRAWS
        uniform = np.empty((len(which), draws + varied))
        for row, rng in zip(uniform, rngs, strict=True):
            rng.random(out=row)
        for factor, (number, width) in zip(uniform[:, draws:].T, self._varied, strict=True):
            place = (which, *number.place)
            factors = 1.0 - width + 2.0 * width * factor
            self.arrays.plants[number.field][place] = number.value * factors
        raw = self.environments.view(np.uint8).reshape(self.n, records.ENVIRONMENT.itemsize)
        drawn = np.ascontiguousarray(uniform[:, :draws])

        def start(first: int, last: int) -> None:
            starts.start_episodes(
                self.environments,
                raw,
                which[first:last],
                drawn[first:last],
                beginning.ranges,
                beginning.seas,
                self._tables,
                self.ship.propeller.depth_m,
                self.dt,
            )

        _divide(start, len(which), pool, min(shares, len(which) // _STARTS_EACH))

    def observe(self, which: Ints) -> None:
        """Fill the observations of environments that were just reset."""
        first_observation(self.environments, self.commons, self.interval_s, self.dt, which)
        if self.base is not None:
            self.base.begin(self.signals, which)

    def step(
        self, action: Singles, pool: ThreadPoolExecutor | None = None, shares: int = 1
    ) -> None:
        """Simulate all environments over one control interval; the results are in :attr:`arrays`.

        Actions in [-1, 1] have the shape (n, 2), or (n, 3) where the rudder is an action. The
        threads of a pool share the work.
        """
        if self.base is not None:
            action = self.base.add(action)
        if self.profile is not None:
            follow = self.environments, *self.profile, self.interval_s, self._tables
            starts.follow_profile(*follow)
        step = functools.partial(self._step, action)
        found = _divide(step, self.n, pool, min(shares, self.n // _STEPS_EACH))
        if max(found) >= 0:
            diverged = min(i for i in found if i >= 0)
            raise ValueError(
                f"{self.ship.name}: the simulation of environment {diverged} diverges: its state is "
                "not finite. A parameter or a term of the ship is too fast for the time step of "
                f"{self.dt:g} s. Use a smaller integration.time_step_s or a slower parameter"
            )
        if self.base is not None:
            self.base.follow(self.signals)

    def _step(self, action: Singles, first: int, last: int) -> int:
        """Simulate some environments, and return the index of one that diverges, or -1."""
        diverged: int = control_interval(
            self.environments,
            self._plants,
            self._states,
            self.commons,
            np.zeros(1, GROUP)[0],
            self.gains,
            action,
            self.steps,
            self.dt,
            first,
            last,
        )
        return diverged
