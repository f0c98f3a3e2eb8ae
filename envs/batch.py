"""State of a batch of environments as arrays, shared by the single and the vector environments."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import NORMALISED_BOUND, OBSERVED, PREVIEW
from ..baselines.governor import limiter_slope, tune
from ..baselines.helmsman import STEERED
from ..core.compiled import compiled
from ..core.files import check_size
from ..observers import get_observer
from ..plant import Ship
from ..plant.helm import require_steering
from ..plant.terms import Term
from .kernel import control_interval, first_observation
from .options import ResetOptions
from .ranges import observed_ranges
from .records import (
    BASE_COMMANDS,
    COMMON,
    COURSE_ERRORS,
    DIRECT_RACK,
    ENVIRONMENT,
    LEARNER_SIGNALS,
    LIMITED_RACK,
    OBSERVATION,
    RACK_COMMAND,
    SHAFT_SPEED,
    SHAFT_SPEED_COMMAND,
)
from .residual import BaseController
from .rewards import goals_record
from .settings import Settings, check_randomise, noise_record, read_seas
from .starts import (
    DRAWS,
    DRAWS_STEERED,
    episode_ranges,
    sea_bounds,
    start_episodes,
    steady_states,
    steady_tables,
)
from .tasks import controller_for, get_task

_BYTES_EACH = 1e5  # memory of one environment with its sea, measured
_FIELDS: Any = ENVIRONMENT.fields
_SIGNALS: tuple[str, ...] = OBSERVATION.names or ()
_SECOND = {"fuel-rack": DIRECT_RACK, "limited-rack": LIMITED_RACK, "shaft-speed": SHAFT_SPEED}

LIMITER_RESPONSE_S = 0.25
"""Response time of the limiters of a rack command to a speed error, at a gain of one [s]."""


@functools.lru_cache(maxsize=16)
def _governor_gains(ship: Ship) -> NDArray[np.float64]:
    """Return the gains of the built-in governor, which acts at every plant step; shape (3, m)."""
    return np.array(tune(ship, ship.time_step_s))


DRIFT_ARM = 0.1
"""Lever arm of the slow side force of waves and wind ahead of midship, in ship lengths; assumed."""


def add_drift_force(ship: Ship) -> Ship:
    """Return a ship with an additional slow side force, as the steered environments have it.

    Args:
        ship: ship that turns.
    """
    force = Term(
        id="drift-force", acts_on="side_force", expression="drift_force",
        also={"yaw_moment": f"{DRIFT_ARM * ship.manoeuvring.length_m!r} * drift_force"},
    )  # fmt: skip
    return ship.with_signals({"drift_force": "N"}).with_values({"term": [*ship.term, force]})


@compiled
def _observe(
    signals: NDArray[np.float32], which: NDArray[np.int64], columns: NDArray[np.int64],
    middle: NDArray[np.float32], half: NDArray[np.float32], bound: float,
    rows: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill rows with the selected signals of environments, scaled and clipped."""
    for i in range(len(which)):
        for j in range(len(columns)):
            scaled = (signals[which[i], columns[j]] - middle[j]) / half[j]
            rows[i, j] = min(max(scaled, -bound), bound) if scaled == scaled else 0.0  # nan


class StartDistribution(NamedTuple):
    """Distribution from which an episode draws its start."""

    ranges: Any
    """EPISODE_RANGES of shape (1,)."""
    seas: NDArray[np.float64]
    """Sea bounds from :func:`shaftline.envs.starts.sea_bounds`."""


class Arrays(NamedTuple):
    """Records of a batch by kind, each an array of shape (n,) that shares its memory with the batch."""

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
        n: number of environments.
        settings: settings of all environments.
        steered: whether the rudder is an action.

    Raises:
        ValueError: a name does not exist, a value is out of range, or the task or the ship does not
            match ``steered``.
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
        self.dt = self.ship.time_step_s
        self.steps = settings.steps(self.dt)
        self.interval_s = self.steps * self.dt
        self.seas_to_draw = read_seas(settings.sea, self.task)
        randomise = self.task.randomise if settings.randomise is None else settings.randomise
        check_randomise(self.ship, randomise)
        self._varied = [(self.ship.parameter(key), width) for key, width in randomise.items()]
        self.command = settings.drive_command
        self.gains = np.zeros((3, 1))
        if self.command == "shaft-speed":
            self.gains = _governor_gains(self.ship)
        self.table = steady_states(self.ship)
        self._tables = steady_tables(self.ship)
        self.n = n
        self._everyone = np.arange(n)
        observer = get_observer(settings.observer, settings.tuning).discretise(self.ship, self.dt)
        self.environments = np.zeros(n, ENVIRONMENT)
        self.environments["plant"] = (add_drift_force(self.ship) if steered else self.ship).record()
        self.environments["observer"] = observer
        self.base: BaseController | None = None
        if settings.base_controller is not None:
            controller = controller_for(
                self.task, settings.base_controller, self.ship, self.interval_s, steered
            )
            self.base = BaseController(controller, self.ship, n, steered, self.task.preview)
        self._columns = np.array([_SIGNALS.index(name) for name in self.observed])
        top = float(self.table["ship_speed"].max())
        middle, half = observed_ranges(self.ship, top, self.observed)
        if not settings.normalised:
            middle, half = np.zeros_like(middle), np.ones_like(half)
        self._scale = (middle, half)
        self._usual = self._beginning(ResetOptions.of(None, self.task, (0.0, 0.0), steered))
        self.commons = np.zeros(1, COMMON)
        self.common["noise"] = noise_record(self.ship, settings.sensor_noise)
        self.common["goals"] = goals_record(self.task.goals)
        self.common["increments"] = settings.action_mode == "increment"
        self.common["preview"] = self.task.preview
        self.common["second"] = _SECOND[self.command]
        self.common["limiter_slope"] = limiter_slope(self.ship.record(), LIMITER_RESPONSE_S)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a batch in another process."""
        self.__dict__.update(state)
        # The address of a user's observer differs between processes.
        observer = get_observer(self.settings.observer, self.settings.tuning)
        self.environments["observer"]["address"] = observer.address

    @property
    def common(self) -> Any:
        """Parameters that all environments of the batch share, a COMMON record."""
        return self.commons[0]

    @property
    def arrays(self) -> Arrays:
        """Arrays of the batch by kind of record."""
        return Arrays(*(self.environments[name] for name in ENVIRONMENT.names or ()))

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the signals of an observation, in order."""
        second = SHAFT_SPEED_COMMAND if self.command == "shaft-speed" else RACK_COMMAND
        base = () if self.base is None else BASE_COMMANDS[: self.actions]
        if self.steered:
            return (*OBSERVED, *STEERED, *LEARNER_SIGNALS, *COURSE_ERRORS, second, *base)
        ahead = PREVIEW if self.task.preview else ()
        return (*OBSERVED, *ahead, *LEARNER_SIGNALS, second, *base)

    @property
    def actions(self) -> int:
        """Number of values of an action."""
        return 3 if self.steered else 2

    @property
    def signals(self) -> NDArray[np.float32]:
        """All signals of :data:`OBSERVATION` in physical units, shape (n, k), without a copy."""
        # A field of a record array is not contiguous, so this array is a strided view of the memory.
        offset = _FIELDS["observation"][1]
        return np.ndarray(
            (self.n, len(_SIGNALS)), np.float32, self.environments.view(np.uint8), offset,
            (ENVIRONMENT.itemsize, 4),
        )  # fmt: skip

    def observation(self, which: NDArray[np.int64] | None = None) -> NDArray[np.float32]:
        """Return observations, normalised or in physical units as the settings ask for, shape (k, o).

        Args:
            which: indices of the environments; all by default.
        """
        signals = self.signals
        rows = np.empty((self.n if which is None else len(which), len(self._columns)), np.float32)
        if which is None:
            which = self._everyone
        bound = NORMALISED_BOUND if self.settings.normalised else np.inf
        _observe(signals, which, self._columns, *self._scale, bound, rows)
        return rows

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """Number of control intervals since the last reset, shape (n,)."""
        return np.asarray(self.environments["episode"]["elapsed"])

    def begin(self, options: Mapping[str, Any] | None) -> StartDistribution:
        """Return the distribution from which episodes start under the options of a reset.

        Args:
            options: options of the reset, or None.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        if not options:
            return self._usual
        known = self.table["ship_speed"]
        speeds = (float(known[0]), float(known[-1]))
        return self._beginning(ResetOptions.of(options, self.task, speeds, self.steered))

    def _beginning(self, begin: ResetOptions) -> StartDistribution:
        seas = self.seas_to_draw if begin.seas is None else begin.seas
        return StartDistribution(episode_ranges(begin, self.task), sea_bounds(seas))

    def reset(
        self,
        which: NDArray[np.int64],
        rngs: Sequence[np.random.Generator],
        beginning: StartDistribution,
    ) -> None:
        """Start a new episode in some environments.

        Args:
            which: indices of the environments, shape (k,).
            rngs: one random generator for each, which draws everything of its episode.
            beginning: distribution of the start, from :meth:`begin`.
        """
        varied = len(self._varied)
        draws = DRAWS_STEERED if self.steered else DRAWS
        uniform = np.empty((len(which), draws + varied))
        for row, rng in zip(uniform, rngs, strict=True):
            rng.random(out=row)
        for factor, (number, width) in zip(uniform[:, draws:].T, self._varied, strict=True):
            place = (which, *number.place)
            factors = 1.0 - width + 2.0 * width * factor
            self.arrays.plants[number.field][place] = number.value * factors
        raw = self.environments.view(np.uint8).reshape(self.n, ENVIRONMENT.itemsize)
        start_episodes(
            self.environments, raw, which, uniform[:, :draws], beginning.ranges, beginning.seas,
            self._tables, self.ship.propeller.depth_m, self.dt,
        )  # fmt: skip

    def observe(self, which: NDArray[np.int64]) -> None:
        """Fill the observations of environments that were just reset."""
        first_observation(self.environments, self.commons, self.interval_s, self.dt, which)
        if self.base is not None:
            self.base.begin(self.signals, which)

    def step(
        self, action: NDArray[np.float32], pool: ThreadPoolExecutor | None = None, shares: int = 1
    ) -> None:
        """Simulate all environments over one control interval; the results are in :attr:`arrays`.

        Args:
            action: actions in [-1, 1], shape (n, 2), or (n, 3) where the rudder is an action.
            pool: threads that share the work; the calling thread by default.
            shares: number of parts into which the batch is divided for the threads.
        """
        if self.base is not None:
            action = self.base.add(action)
        if pool is None:
            self._step(action, 0, self.n)
        else:
            bounds = np.linspace(0, self.n, min(shares, self.n) + 1).astype(int)
            list(pool.map(self._step, [action] * (len(bounds) - 1), bounds[:-1], bounds[1:]))
        if self.base is not None:
            self.base.follow(self.signals)

    def _step(self, action: NDArray[np.float32], first: int, last: int) -> None:
        diverged = control_interval(
            self.environments, self.commons, self.gains, action, self.steps, self.dt, first, last,
        )  # fmt: skip
        if diverged >= 0:
            raise ValueError(
                f"{self.ship.name}: the simulation of environment {diverged} diverges: its state is "
                "not finite. A parameter or a term of the ship is too fast for the time step of "
                f"{self.dt:g} s. Use a smaller integration.time_step_s or a slower parameter"
            )
