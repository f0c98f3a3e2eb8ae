"""A batch of environments as arrays, and how each begins: what single and vector environment share."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED
from ..baselines.governor import tune
from ..baselines.steering import OBSERVED_STEERED
from ..core.sizes import check_size
from ..observers import get_observer
from ..plant import Ship
from ..plant.helm import refuse_to_steer
from ..plant.terms import Term
from .divergence import refuse_divergence
from .kernel import control_interval, first_observation
from .options import Begin
from .ranges import observed_ranges
from .records import COMMON, ENVIRONMENT, EPISODE, MAX_ORDERS
from .settings import Settings, check_randomise, noise_of, seas_of
from .starts import draw_episodes, start_episodes, steady_states, steady_tables
from .tasks import get_task

_BYTES_EACH = 1e5  # an environment with its sea, measured
_FIELDS: Any = ENVIRONMENT.fields


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


def _within(uniform: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Return numbers uniform in [0, 1) as NumPy's ``uniform(low, high)`` scales them."""
    return low + (high - low) * uniform


def _given(option: Any, drawn: Any) -> Any:
    """Return what an option of the reset sets, or what was drawn."""
    return drawn if option is None else option


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
        self.table = steady_states(self.ship)
        self._tables = steady_tables(self.ship)
        self.n = n
        observer = get_observer(settings.observer, settings.tuning).discretise(self.ship, self.dt)
        self.environments = np.zeros(n, ENVIRONMENT)
        self.environments["plant"] = (pushed(self.ship) if steered else self.ship).record()
        self.environments["observer"] = observer
        self.scale: Any = None
        if settings.normalised:
            top = float(self.table["ship_speed"].max())
            self.scale = observed_ranges(self.ship, top, self.observed)
        self.common = np.zeros(1, COMMON)[0]
        self.common["noise"] = noise_of(self.ship, settings.sensor_noise)
        self.common["worst_cost"] = self.task.worst_cost
        self.common["intervals"] = settings.intervals
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

    def reset(
        self, which: NDArray[np.int64], rngs: Sequence[np.random.Generator], begin: Begin
    ) -> None:
        """Begin a new episode of some environments.

        Args:
            which: indices of the environments, shape (k,).
            rngs: one an environment, from which everything of its episode is drawn.
            begin: from :meth:`begin`.
        """
        task, arrays = self.task, self.arrays
        varied = len(self._varied)
        draws, uniform = draw_episodes(rngs, self.seas_to_draw, begin, varied, self.steered)
        for factor, (number, width) in zip(uniform.T, self._varied, strict=False):
            place = (which, *number.place)
            arrays.plants[number.field][place] = number.value * _within(
                factor, 1 - width, 1 + width
            )
        episode = np.zeros(len(which), EPISODE)
        columns = uniform[:, varied:]
        orders, columns = columns[:, :MAX_ORDERS], columns[:, MAX_ORDERS:]
        episode["random"] = draws["random"]
        episode["orders"] = _given(begin.orders, _within(orders, *task.speed_order_m_s))
        episode["order_interval"] = begin.order_interval_s
        rise = _given(begin.resistance_rise, _within(columns[:, 0], *task.resistance_rise))
        episode["resistance_mean"] = 1.0 + rise
        episode["resistance_swing"] = task.resistance_swing
        episode["resistance_frequency"] = 2.0 * math.pi / _within(columns[:, 1], 60.0, 180.0)
        episode["resistance_phase"] = _within(columns[:, 2], 0.0, 2.0 * math.pi)
        if self.steered:
            self._set_course(which, episode, columns[:, 3:], begin)
        environments = self.environments
        for name in ("state", "sea", "estimate", "ended"):
            environments[name][which] = np.zeros(1, ENVIRONMENT[name])
        environments["episode"][which] = episode
        speeds = _given(begin.initial_speed_m_s, episode["orders"][:, 0])
        start_episodes(
            environments, which, draws, np.broadcast_to(speeds, len(which)).copy(), self._tables,
            self.ship.propeller.depth_m, self.dt,
        )  # fmt: skip

    def _set_course(
        self, which: NDArray[np.int64], episode: Any, uniform: NDArray[np.float64], begin: Begin
    ) -> None:
        """Set headings, lines, current and side force of episodes."""
        task = self.task
        headings, lines = uniform[:, :MAX_ORDERS], uniform[:, MAX_ORDERS : 2 * MAX_ORDERS]
        current = _within(uniform[:, -2], *task.cross_current_m_s)
        force = 1e3 * _within(uniform[:, -1], *task.drift_force_kN)
        angles = np.radians(_within(headings, *task.heading_order_deg))
        episode["heading_orders"] = _given(begin.heading_orders, angles)
        episode["track_orders"] = _given(begin.track_orders, _within(lines, *task.track_order_m))
        self.arrays.plants["cross_current"][which] = _given(begin.cross_current_m_s, current)
        episode["drift_force"] = _given(begin.drift_force_N, force)

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
