"""``shaftline/Frigate-v0`` and ``shaftline/Steering-v0``: single environments and their vector forms."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .batch import Batch
from .kernel import ENDINGS, RUNNING
from .options import options_of
from .records import TRUTHS
from .rewards import TERMS
from .settings import Settings
from .spaces import action_space, check_action, space_of

if TYPE_CHECKING:
    from .dashboard import Dashboard


def _count_workers(threads: int | None, ships: int) -> int:
    """Return the number of threads that step the ships.

    Raises:
        ValueError: ``threads`` is not a whole number of at least 1.
    """
    if threads is None:
        return min(os.cpu_count() or 1, ships)
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise ValueError(f"threads = {threads!r}: must be a whole number from 1, or None")
    return min(int(threads), ships)


def _check_render_mode(mode: str | None) -> None:
    if mode not in (None, "rgb_array"):
        raise ValueError(f"unknown render_mode {mode!r}; known: rgb_array")


def _dashboard(batch: Batch, ship: int = 0) -> Dashboard:
    from .dashboard import Dashboard  # matplotlib takes half a second, and most never look

    return Dashboard(batch, ship)


class FrigateEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A ship's propulsion plant in waves, commanded by blade pitch and shaft speed or fuel rack.

    ## Observation
    ``Box(15,)`` in [-3, 3]: each signal scaled so that the ship's own range of it is -1 to 1, and
    clipped. ``normalised=False`` gives physical units.

    | index | signal | unit | range that is scaled to -1 to 1 |
    |---|---|---|---|
    | 0 | ordered ship speed | m/s | 0 to the highest speed in calm water |
    | 1 | measured shaft speed | rad/s | 0 to the highest |
    | 2 | measured shaft torque | N m | 0 to the highest |
    | 3 | measured pitch ratio | - | lowest to highest |
    | 4 | fuel rack position | mm | lowest to highest |
    | 5 | measured ship speed | m/s | 0 to the highest speed in calm water |
    | 6 | advance velocity, estimated by the observer | m/s | 0 to the highest speed in calm water |
    | 7 | whether the estimate is valid | 0 or 1 | 0 to 1 |
    | 8 | ordered less measured ship speed | m/s | -2 to 2 |
    | 9 | pitch command that runs | - | lowest to highest |
    | 10 | shaft torque less its mean over 20 s | N m | 20 % of the highest to both sides |
    | 11 | engine torque, by its rack map, less its mean over 20 s | N m | likewise |
    | 12 | estimated angle of attack of the blades | deg | 0 to 10 |
    | 13 | angle of attack less its mean over 20 s | deg | -4 to 4 |
    | 14 | shaft speed set-point or fuel rack command that runs | rad/s or mm | lowest to highest |

    A residual adds the commands of its base controller (P/D and fuel rack). The signals are those of the
    last plant step before the action.

    ## Action
    ``Box(2,)`` in [-1, 1]; values outside are clipped, a value that is not finite is refused. The first
    is for the blade pitch, the second for the drive: ``command`` chooses the set-point of a shaft speed
    governor or the fuel rack. ``action_mode`` chooses what an action means: an ``increment`` of the
    running command (at 1 a command crosses its range in 20 s), the ``absolute`` command over the ship's
    range, or a ``residual`` that is added to the command of a classic controller (at 1 a quarter of the
    range).

    ## Reward
    In [0, 1] for each control interval: the goals of the task, each with a tolerance in its physical
    unit (:mod:`shaftline.envs.rewards`). ``info["reward_terms"]`` holds the terms in physical units. The
    interval in which the engine stalls or trips has the reward 0.

    ## Episode end
    Terminated where the engine stalls or trips on overspeed, so that all later rewards are lost.
    Truncated after ``max_episode_steps`` control intervals (300 s by default); ``gymnasium.make`` does
    that with its ``TimeLimit``. ``step`` raises ``ResetNeeded`` after the end.

    ## Options of a reset
    ``sea``, ``speed_order_m_s`` (one order, or one for each interval), ``order_interval_s``,
    ``initial_speed_m_s``, ``resistance_rise``: in place of what the task draws.

    Args:
        render_mode: None or ``rgb_array``.
        settings: keywords, as of :class:`shaftline.envs.Settings`.

    Raises:
        ValueError: something that does not exist or is out of range; the message names it.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's way)
    steered: ClassVar[bool] = False
    defaults: ClassVar[dict[str, Any]] = {}

    def __init__(self, *, render_mode: str | None = None, **settings: Any) -> None:
        self.batch = Batch(1, Settings.of(self.defaults | settings), self.steered)
        self.observation_space: Any = space_of(self.batch)
        self.action_space: Any = action_space(self.batch.actions)
        _check_render_mode(render_mode)
        self.render_mode = render_mode
        self._needs_reset = True
        self._dashboard = _dashboard(self.batch) if render_mode else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of everything that is drawn.
            options: see the class.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        begin = self.batch.begin(options)
        super().reset(seed=seed)
        self.batch.reset(np.array([0]), [self.np_random], begin)
        self.batch.observe(np.array([0]))
        self._needs_reset = False
        if self._dashboard is not None:
            self._dashboard.clear()
        return self.batch.observation()[0], self._info()

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold an action over one control interval.

        Raises:
            ResetNeeded: no episode has begun, or the last one has ended.
            ValueError: an action of another shape, or not finite.
        """
        if self._needs_reset:
            raise ResetNeeded("no episode is running, or it has ended: call reset() before step()")
        batch = self.batch
        batch.step(check_action(action, (batch.actions,))[None])
        env = self.batch.environments[0]
        ended = int(env["ended"])
        terminated = ended != RUNNING
        truncated = self._is_at_limit()
        info = self._info()
        if terminated:
            info["ended"] = ENDINGS[ended]
        if self._dashboard is not None:
            self._dashboard.record()
        self._needs_reset = terminated or truncated
        return batch.observation()[0], float(env["reward"]), terminated, truncated, info

    def _is_at_limit(self) -> bool:
        """Return whether the episode is truncated here; ``gymnasium.make`` has a limit of its own."""
        limit = self.batch.settings.max_episode_steps
        if limit is None or self.spec is not None:
            return False
        return bool(self.batch.elapsed[0] >= limit)

    def _info(self) -> dict[str, Any]:
        """Return truth and reward terms; after a reset the terms are zeros."""
        env = self.batch.environments[0]
        info: dict[str, Any] = dict(zip(TRUTHS, env["truth"].tolist(), strict=True))
        info["reward_terms"] = dict(zip(TERMS, env["terms"].tolist(), strict=True))
        return info

    def render(self) -> Any:
        """The dashboard as an RGB array of shape (height, width, 3); None without a render mode."""
        return None if self._dashboard is None else self._dashboard.draw()


class FrigateVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many of :class:`FrigateEnv` stepped in one compiled call, on the cores of the machine.

    Sub-environment i with seed s + i is the single environment with that seed, step for step.

    Args:
        num_envs: how many.
        threads: that step them; the machine's cores by default.
        autoreset_mode: what happens where an episode ends, an ``AutoresetMode`` of Gymnasium or its
            value. ``SameStep`` begins the next one in the same step (``final_obs`` and ``final_info``
            hold what was); ``NextStep`` in the next, which ignores the action, as wrappers that keep
            statistics of observations ask for; ``Disabled`` waits for a reset with a ``reset_mask``.
        render_mode: None or ``rgb_array``: then :meth:`render` draws each of them.
        settings: keywords, as of :class:`shaftline.envs.Settings`.

    Raises:
        ValueError: something that does not exist or is out of range; the message names it.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's way)
    steered: ClassVar[bool] = False
    defaults: ClassVar[dict[str, Any]] = {}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        known = [mode.value for mode in AutoresetMode]
        if autoreset_mode not in [*AutoresetMode, *known]:
            raise ValueError(
                f"unknown autoreset_mode {autoreset_mode!r}; known: {', '.join(known)}"
            )
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = FrigateVectorEnv.metadata | {"autoreset_mode": self.autoreset_mode}
        if settings.get("max_episode_steps") == -1:  # Gymnasium's word for no limit
            settings["max_episode_steps"] = None
        self.batch = Batch(num_envs, Settings.of(self.defaults | settings), self.steered)
        self.num_envs = num_envs
        self.single_observation_space = space_of(self.batch)
        self.single_action_space = action_space(self.batch.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        _check_render_mode(render_mode)
        self.render_mode = render_mode
        drawn = range(num_envs) if render_mode else ()
        self._dashboards = [_dashboard(self.batch, i) for i in drawn]
        self._workers = _count_workers(threads, num_envs)
        # more shares than threads, so that no thread waits long for another on a busy machine
        self._shares = 2 * self._workers
        self._pool: ThreadPoolExecutor | None = None
        self._pool_process = 0
        self._rngs: list[np.random.Generator] = []
        self._begin = self.batch.begin(None)
        self._ended = np.zeros(num_envs, dtype=bool)  # and not begun anew yet

    def _threads(self) -> ThreadPoolExecutor | None:
        """Return the threads of this process; those of a process that was forked do not exist here."""
        if self._workers > 1 and (self._pool is None or self._pool_process != os.getpid()):
            self._pool, self._pool_process = ThreadPoolExecutor(self._workers), os.getpid()
        return self._pool

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but the threads, which another process makes for itself."""
        return self.__dict__ | {"_pool": None}

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in every sub-environment.

        Args:
            seed: of the first, the others counting on from it; or one for each.
            options: see :class:`FrigateEnv`; ``reset_mask``, of shape (n,), leaves others as they are.

        Raises:
            ValueError: an unknown option, a value out of range, too few or many seeds, or a mask that
                leaves a sub-environment without its first episode.
        """
        options = options_of(options)
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            raise ValueError(f"reset_mask: must be {self.num_envs} booleans, one of them true")
        if not self._rngs and not mask.all():
            raise ValueError(
                f"reset_mask: sub-environments {np.flatnonzero(~mask).tolist()} have no episode yet; "
                "the first reset must begin all of them"
            )
        begin = self.batch.begin(options)
        if seed is not None or not self._rngs:
            seeds: Sequence[int | None] = (
                seed
                if isinstance(seed, list)
                else [None if seed is None else seed + i for i in range(self.num_envs)]
            )
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds are given for {self.num_envs} environments")
            fresh = [gymnasium.utils.seeding.np_random(s)[0] for s in seeds]
            old = self._rngs or fresh
            self._rngs = [new if m else kept for m, new, kept in zip(mask, fresh, old, strict=True)]
        self._begin = begin
        self._start(np.flatnonzero(mask))
        return self.batch.observation(), self._info(np.zeros(self.num_envs, dtype=bool), mask)

    def _start(self, which: NDArray[np.int64]) -> None:
        """Begin episodes in some sub-environments."""
        self.batch.reset(which, [self._rngs[i] for i in which], self._begin)
        for i in which if self._dashboards else ():
            self._dashboards[i].clear()
        self.batch.observe(which)
        self._ended[which] = False

    def step(
        self, actions: Any
    ) -> tuple[
        NDArray[np.float32], NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """Hold an action in each sub-environment over one control interval.

        Raises:
            ResetNeeded: no episode has begun, or one that ended was not begun anew.
            ValueError: actions of another shape, or not finite.
        """
        if not self._rngs:
            raise ResetNeeded("call reset() before step()")
        waiting = np.flatnonzero(self._ended)
        if len(waiting) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise ResetNeeded(f"sub-environments {waiting.tolist()} have ended: reset them first")
        batch, arrays = self.batch, self.batch.arrays
        # one that waits for its next episode steps on too, which the episode's beginning then undoes
        batch.step(
            check_action(actions, (self.num_envs, batch.actions)), self._threads(), self._shares
        )
        terminated = arrays.ended != RUNNING
        limit = batch.settings.max_episode_steps
        truncated = batch.elapsed >= (np.inf if limit is None else limit)
        reward = arrays.rewards.copy()
        if len(waiting):
            self._start(waiting)
            terminated[waiting] = truncated[waiting] = False
            reward[waiting] = 0.0
        for dashboard in self._dashboards:
            dashboard.record()
        done = terminated | truncated
        self._ended |= done
        everywhere = np.ones(self.num_envs, dtype=bool)
        if self.autoreset_mode is not AutoresetMode.SAME_STEP or not done.any():
            info = self._info(terminated, everywhere)
        else:
            final_info, last = self._info(terminated, done), np.full(self.num_envs, None, object)
            which = np.flatnonzero(done)
            for i, row in zip(which.tolist(), batch.observation(which), strict=True):
                last[i] = row
            self._start(which)
            info = self._info(np.zeros_like(done), everywhere) | {
                "final_info": final_info, "_final_info": done, "final_obs": last, "_final_obs": done
            }  # fmt: skip
        return batch.observation(), reward, terminated, truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """The dashboards as RGB arrays of shape (height, width, 3); None without a render mode."""
        return tuple(board.draw() for board in self._dashboards) if self._dashboards else None

    def _info(self, terminated: NDArray[np.bool_], present: NDArray[np.bool_]) -> dict[str, Any]:
        """Return truth, reward terms and, where something ended, why: columns of shape (n,) with masks.

        Args:
            terminated: where the engine stalled or tripped in this step.
            present: mask of the sub-environments that the columns are of.
        """
        arrays = self.batch.arrays
        info: dict[str, Any] = {}
        for name in TRUTHS:
            info[name], info["_" + name] = arrays.truths[name].copy(), present
        terms: dict[str, Any] = {}
        for name in TERMS:
            terms[name], terms["_" + name] = arrays.terms[name].copy(), present
        info["reward_terms"], info["_reward_terms"] = terms, present
        if terminated.any():
            info["ended"] = np.array(ENDINGS, dtype=object)[arrays.ended]
            info["_ended"] = terminated
        return info

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        if self._pool is not None and self._pool_process == os.getpid():
            self._pool.shutdown()
