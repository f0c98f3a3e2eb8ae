"""``shaftline/Frigate-v0`` and its vector form; ``steering.py`` derives ``shaftline/Steering-v0``."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .batch import Batch, Ints, Singles
from .kernel import ENDINGS, RUNNING
from .options import check_options
from .records import TRUTHS
from .rewards import TERMS
from .settings import Settings
from .spaces import action_space, batch_observation_space, check_action

if TYPE_CHECKING:
    from .dashboard import Dashboard

Bools = NDArray[np.bool_]


def _count_workers(threads: int | None, ships: int) -> int:
    """Return the number of threads that step the ships."""
    if threads is None:
        return min(os.cpu_count() or 1, ships)
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise ValueError(f"threads = {threads!r}: must be a whole number of at least 1, or None")
    return min(int(threads), ships)


def _dashboards(batch: Batch, mode: str | None) -> list[Dashboard]:
    """Return a dashboard for each environment of a batch, or none without a render mode."""
    if mode not in (None, "rgb_array"):
        raise ValueError(f"unknown render_mode {mode!r}; known: rgb_array")
    if mode is None:
        return []
    from .dashboard import Dashboard  # not above, because matplotlib takes half a second to import

    return [Dashboard(batch, i) for i in range(batch.n)]


class FrigateEnv(gymnasium.Env[Singles, Singles]):
    """Propulsion plant of a ship in waves, controlled by blade pitch and shaft speed or fuel rack.

    ## Description

    A ship with a diesel engine and a controllable-pitch propeller moves straight ahead in waves. The
    agent commands the blade pitch and the shaft speed (or the fuel rack) every 0.5 s and keeps the
    ordered ship speed within the other goals of the task. Between two actions the plant is simulated
    with its own time step (0.05 s), the noisy instruments are sampled, and the observer updates its
    estimate of the advance velocity. The numbers on this page hold for the default arguments; the
    default ship is ``frigate``.

    ## Action Space

    The action is an array of shape ``(2,)`` in the space ``Box(-1, 1)``. Values outside are clipped; a
    value that is not finite is refused. ``command`` selects the second quantity.

    | index | command | action | range on the ship | meaning |
    |---|---|---|---|---|
    | 0 | any | -1 to 1 | 0.6 to 1.4 | command of the pitch ratio P/D [-] |
    | 1 | `shaft-speed` | -1 to 1 | 4.966 to 14.19 | set-point of the shaft speed governor [rad/s] |
    | 1 | `limited-rack` | -1 to 1 | 0 to 40 | fuel rack within speed and torque limits [mm] |
    | 1 | `fuel-rack` | -1 to 1 | 0 to 40 | fuel rack without any engine protection [mm] |

    ``action_mode`` selects how an action sets a command:

    - ``increment``: the action is a rate of change. At 1 a command crosses its range in 20 s; at 0 it
      holds.
    - ``absolute``: -1 and 1 are the ends of the range of the command.
    - ``residual`` or ``residual:CONTROLLER``: the action is added to the command of a classic
      controller. An action of 1 adds 25 % of the range.

    ## Observation Space

    The observation is an array of shape ``(15,)`` in the space ``Box(-3, 3)``. Each signal is scaled so
    that the range in the table becomes -1 to 1, and clipped. ``normalised=False`` gives physical units
    without clipping. The signals are those of the last plant step before the action.

    | index | signal | unit | range | meaning |
    |---|---|---|---|---|
    | 0 | `speed_order` | m/s | 0 to 10.08 | ordered ship speed |
    | 1 | `shaft_speed` | rad/s | 0 to 14.19 | measured shaft speed |
    | 2 | `measured_shaft_torque` | N m | 0 to 280400 | measured shaft torque |
    | 3 | `measured_pitch_ratio` | - | 0.6 to 1.4 | measured pitch ratio P/D |
    | 4 | `fuel_rack` | mm | 0 to 40 | position of the fuel rack |
    | 5 | `measured_ship_speed` | m/s | 0 to 10.08 | ship speed measured by the log |
    | 6 | `estimated_advance_velocity` | m/s | 0 to 10.08 | advance velocity, from the observer |
    | 7 | `estimate_valid` | - | 0 to 1 | 1 where the observer reports a valid estimate |
    | 8 | `speed_error` | m/s | -2 to 2 | ordered less measured ship speed |
    | 9 | `pitch_command` | - | 0.6 to 1.4 | present command of the pitch ratio |
    | 10 | `shaft_torque_deviation` | N m | -56090 to 56090 | shaft torque less its mean over 20 s |
    | 11 | `engine_torque_deviation` | N m | -7600 to 7600 | engine torque less its mean over 20 s |
    | 12 | `estimated_angle_of_attack` | deg | 0 to 10 | angle of attack of the blades |
    | 13 | `angle_of_attack_deviation` | deg | -4 to 4 | angle of attack less its mean over 20 s |
    | 14 | `shaft_speed_command` | rad/s | 4.966 to 14.19 | present set-point of the shaft speed |

    With ``limited-rack`` and ``fuel-rack`` the last signal is `fuel_rack_command` (0 to 40 mm). A
    residual adds the pitch and the rack command of its base controller (`base_pitch_ratio`,
    `base_fuel_rack`). The task ``wave-preview`` adds the wave inflow 0 to 6 s ahead. The angle of attack
    and the engine torque are computed from measured and estimated signals.

    ## Rewards

    The reward of a control interval is in [0, 1]. A goal has the value 1 up to its tolerance ``within``
    and falls beyond it, to 0.1 one ``margin`` further. The reward is the product of the goals that are
    factors, times 1 less the weighted shortfalls of the other goals (:mod:`shaftline.envs.rewards`). The
    goals of the default task ``speed-keeping`` are:

    | reward term | within | margin | weight |
    |---|---|---|---|
    | `speed_error_m_s` | 0.1 | 2 | factor |
    | `fuel_excess` | 0 | 0.5 | 0.1 |
    | `overload` | 0 | 0.1 | factor |
    | `overspeed` | 0 | 0.15 | factor |
    | `torque_fluctuation` | 0.01 | 0.1 | 0.1 |
    | `cavitation` | 0 | 0.5 | 0.1 |

    ``info["reward_terms"]`` holds all terms in physical units, ``info`` itself the true state. An
    interval in which the engine stalls or trips has the reward 0.

    ## Starting State

    The ship starts in the steady state at an initial speed under the mean resistance of the episode.
    Each episode draws, uniformly within the ranges of the task: one of its seas and the phases of the
    waves; the ordered speeds (5 to 9.5 m/s, a new one every 100 s) and, from the same range, the initial
    speed; the mean rise of the resistance (-0.1 to 0.3); and the period of its slow fluctuation (60 to
    180 s, amplitude 0.1). A ship that does not reach the highest order in calm water gets orders in
    proportion to its highest speed.

    ``reset(options=...)`` accepts ``sea``, ``speed_order_m_s`` (one order, or a list with one for each
    order interval), ``order_interval_s``, ``initial_speed_m_s`` and ``resistance_rise`` in place of
    drawn values.

    ## Episode End

    1. Termination: the engine stalls (speed at most 30 % of its lowest) or trips on overspeed (above
       115 % of its highest). ``info["ended"]`` names the reason. All later rewards are lost.
    2. Truncation: 600 control intervals (300 s) have passed. ``gymnasium.make`` truncates with its
       ``TimeLimit``.

    ``step`` raises ``ResetNeeded`` after the end.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `ship` | None | preset, path of a ship file, or Ship; None: the ship of the task |
    | `task` | 'speed-keeping' | name of a task, a Task, or a dictionary of its fields |
    | `observer` | 'random-walk-kalman' | observer of the advance velocity; `oracle`: true value |
    | `tuning` | None | tuning of the observer |
    | `sea` | None | preset, parameters or a list of them; None: the seas of the task |
    | `sensor_noise` | 1.0 | factor on the usual noise, or rms values by instrument |
    | `control_interval_s` | 0.5 | time between two actions [s] |
    | `max_episode_steps` | 600 | control intervals of an episode, or None |
    | `randomise` | None | half width of a uniform factor by key of the ship file |
    | `normalised` | True | whether observations are scaled and clipped |
    | `action_mode` | 'increment' | how an action sets a command, see Action Space |
    | `command` | None | second command; None: `shaft-speed`, or `limited-rack` for a residual |
    | `order_profile` | None | pairs of time [s] and ordered speed [m/s], in place of drawn orders |
    | `render_mode` | None | None, or `rgb_array` for a dashboard |

    :class:`shaftline.envs.Settings` explains the arguments in full.

    ## Version History

    * v0: initial version.

    Args:
        render_mode: None or ``rgb_array``.
        settings: the other keywords of the table above.

    Raises:
        ValueError: a name does not exist or a value is out of range; the message names it.

    Examples:
        >>> env = FrigateEnv(task="transit", sea="calm")
        >>> observation, info = env.reset(seed=1)
        >>> observation.shape
        (15,)
        >>> observation, reward, terminated, truncated, info = env.step([0.0, 0.0])
        >>> 0.0 <= reward <= 1.0, terminated
        (True, False)
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's convention)
    steered: ClassVar[bool] = False
    defaults: ClassVar[dict[str, Any]] = {}

    def __init__(self, *, render_mode: str | None = None, **settings: Any) -> None:
        self.batch = Batch(1, Settings.of(self.defaults | settings), self.steered)
        self.observation_space: Any = batch_observation_space(self.batch)
        self.action_space: Any = action_space(self.batch.actions)
        self._shape = (self.batch.actions,)
        self.render_mode, self._dashboards = render_mode, _dashboards(self.batch, render_mode)
        self._needs_reset = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seed of everything that the episode draws.
            options: values that replace those that the task draws; see the class.

        Returns:
            The first observation, and ``info`` with the true state and the reward terms, which are zero
            here.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        begin = self.batch.begin(options)
        super().reset(seed=seed)
        self.batch.reset(np.array([0]), [self.np_random], begin)
        self.batch.observe(np.array([0]))
        self._needs_reset = False
        for dashboard in self._dashboards:
            dashboard.clear()
        return self.batch.observation()[0], self._info()

    def step(self, action: Any) -> tuple[Singles, float, bool, bool, dict[str, Any]]:
        """Hold an action in [-1, 1], shape (2,), or (3,) with the rudder as an action, over an interval.

        Returns:
            Observation, reward in [0, 1], whether the engine stalled or tripped, whether the time limit
            is reached, and ``info`` with the true state and the reward terms.

        Raises:
            ResetNeeded: no episode is running.
            ValueError: an action of another shape, or one that is not finite.
        """
        if self._needs_reset:
            raise ResetNeeded("no episode is running, or it has ended: call reset() before step()")
        batch = self.batch
        batch.step(check_action(action, self._shape)[None])
        ended = batch.ended.item(0)
        terminated = ended != RUNNING
        limit = batch.settings.max_episode_steps
        if self.spec is not None:  # The environment of gymnasium.make has a time limit of its own.
            limit = None
        truncated = limit is not None and batch.elapsed.item(0) >= limit
        info = self._info()
        if terminated:
            info["ended"] = ENDINGS[ended]
        for dashboard in self._dashboards:
            dashboard.record()
        self._needs_reset = terminated or truncated
        return batch.observation()[0], batch.rewards.item(0), terminated, truncated, info

    def _info(self) -> dict[str, Any]:
        """Return the true state and the reward terms; after a reset the terms are zero."""
        (truth,), (terms,) = self.batch.truths.tolist(), self.batch.terms.tolist()
        info: dict[str, Any] = dict(zip(TRUTHS, truth, strict=True))
        info["reward_terms"] = dict(zip(TERMS, terms, strict=True))
        return info

    def render(self) -> Any:
        """Return the dashboard as an RGB array (height, width, 3); None without a render mode."""
        return self._dashboards[0].draw() if self._dashboards else None


class FrigateVectorEnv(VectorEnv[Singles, Singles, NDArray[Any]]):
    """Many :class:`FrigateEnv` environments, stepped in one compiled call on all cores of the machine.

    Sub-environment i with seed s + i equals the single environment with that seed, step for step.

    Args:
        num_envs: number of sub-environments.
        threads: largest number of threads that step them, at least 16 each; one for each core by
            default.
        autoreset_mode: when the next episode starts after one has ended: an ``AutoresetMode`` of
            Gymnasium or its value. ``SameStep``: in the same step; ``final_obs`` and ``final_info`` hold
            the end of the last episode. ``NextStep``: in the next step, which ignores its action;
            wrappers that keep statistics of observations need this mode. ``Disabled``: at a reset with a
            ``reset_mask``.
        render_mode: None, or ``rgb_array`` for :meth:`render`.
        settings: keywords of :class:`shaftline.envs.Settings`.

    Raises:
        ValueError: a name does not exist or a value is out of range; the message names it.

    Examples:
        >>> env = FrigateVectorEnv(3, task="transit")
        >>> observation, info = env.reset(seed=1)
        >>> observation.shape
        (3, 15)
        >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        >>> reward.shape
        (3,)
        >>> env.close()
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's convention)
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
        if settings.get("max_episode_steps") == -1:  # the value of Gymnasium for no limit
            settings["max_episode_steps"] = None
        self.batch = Batch(num_envs, Settings.of(self.defaults | settings), self.steered)
        self.num_envs = num_envs
        self.single_observation_space = batch_observation_space(self.batch)
        self.single_action_space = action_space(self.batch.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode, self._dashboards = render_mode, _dashboards(self.batch, render_mode)
        self._workers = _count_workers(threads, num_envs)
        # There are more parts than threads, so that a slow thread does not delay the step.
        self._shares = 2 * self._workers
        self._pool: ThreadPoolExecutor | None = None
        self._pool_process = 0
        self._rngs: list[np.random.Generator] = []
        self._begin = self.batch.begin(None)
        self._ended = np.zeros(num_envs, dtype=bool)  # ended and not yet reset

    def _threads(self) -> ThreadPoolExecutor | None:
        """Return the threads that help this one; a forked process needs new ones."""
        if self._workers > 1 and (self._pool is None or self._pool_process != os.getpid()):
            self._pool, self._pool_process = ThreadPoolExecutor(self._workers - 1), os.getpid()
        return self._pool

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the threads, which each process creates itself."""
        return self.__dict__ | {"_pool": None}

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Start an episode in every sub-environment.

        Args:
            seed: seed of the first sub-environment, from which the seeds of the next ones count on; or a
                list with one seed for each.
            options: options of :class:`FrigateEnv`, and ``reset_mask`` of shape (n,): where it is false,
                the running episode continues.

        Raises:
            ValueError: an unknown option, a value out of range, a number of seeds other than
                ``num_envs``, or a mask that leaves a sub-environment without its first episode.
        """
        options = check_options(options)
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            raise ValueError(
                f"reset_mask: must be {self.num_envs} booleans, at least one of them true"
            )
        if not self._rngs and not mask.all():
            raise ValueError(
                f"reset_mask: sub-environments {np.flatnonzero(~mask).tolist()} have no episode yet; "
                "the first reset must begin all of them"
            )
        begin = self.batch.begin(options)
        if seed is not None or not self._rngs:
            if not isinstance(seed, list | int | np.integer | None):
                raise TypeError(
                    f"seed = {seed!r}: must be a whole number, or a list with one or None for each "
                    "environment"
                )
            if not isinstance(seed, list):
                seed = [None if seed is None else seed + i for i in range(self.num_envs)]
            if len(seed) != self.num_envs:
                raise ValueError(
                    f"seed has {len(seed)} entries for {self.num_envs} environments; give one for each"
                )
            fresh = [gymnasium.utils.seeding.np_random(s)[0] for s in seed]
            old = self._rngs or fresh
            self._rngs = [new if m else kept for m, new, kept in zip(mask, fresh, old, strict=True)]
        self._begin = begin
        self._start(np.flatnonzero(mask))
        return self.batch.observation(), self._info(np.zeros(self.num_envs, dtype=bool), mask)

    def _start(self, which: Ints) -> None:
        """Start episodes in some sub-environments."""
        rngs = [self._rngs[i] for i in which.tolist()]
        self.batch.reset(which, rngs, self._begin, self._threads(), self._shares)
        for dashboard in self._dashboards:
            if dashboard.which in which:
                dashboard.clear()
        self.batch.observe(which)
        self._ended[which] = False

    def step(self, actions: Any) -> tuple[Singles, NDArray[Any], Bools, Bools, dict[str, Any]]:
        """Hold one action in each sub-environment, shape (n, 2) or (n, 3), over one control interval.

        Raises:
            ResetNeeded: no episode is running, or one has ended and was not reset.
            ClosedEnvironmentError: the environments are closed.
            ValueError: actions of another shape, or not finite.
        """
        if self.closed:
            raise ClosedEnvironmentError("the environments are closed: create new ones")
        if not self._rngs:
            raise ResetNeeded("no episode is running: call reset() before step()")
        waiting = np.flatnonzero(self._ended)
        if len(waiting) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"the episodes of sub-environments {waiting.tolist()} have ended: reset them first"
            )
        batch = self.batch
        # Waiting environments are stepped too; the start of their episode overwrites it.
        actions = check_action(actions, (self.num_envs, batch.actions))
        batch.step(actions, self._threads(), self._shares)
        terminated = batch.ended != RUNNING
        limit = batch.settings.max_episode_steps
        truncated = batch.elapsed >= (np.inf if limit is None else limit)
        reward = batch.rewards.copy()
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
                "final_info": final_info,
                "_final_info": done,
                "final_obs": last,
                "_final_obs": done,
            }
        return batch.observation(), reward, terminated, truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return the dashboards as RGB arrays (height, width, 3); None without a render mode."""
        return tuple(board.draw() for board in self._dashboards) if self._dashboards else None

    def _info(self, terminated: Bools, present: Bools) -> dict[str, Any]:
        """Return true state, reward terms and reasons of endings as columns of shape (n,) with masks.

        ``terminated`` masks the engines that stalled or tripped in this step, ``present`` the
        sub-environments to which the columns apply.
        """
        batch = self.batch

        def columns(rows: NDArray[np.float64], names: tuple[str, ...]) -> dict[str, Any]:
            # One copy of all columns is much faster than a copy of each.
            masks = {"_" + name: present for name in names}
            return dict(zip(names, rows.T.copy(), strict=True)) | masks

        info = columns(batch.truths, TRUTHS)
        info |= {"reward_terms": columns(batch.terms, TERMS), "_reward_terms": present}
        if terminated.any():
            info["ended"] = np.array(ENDINGS, dtype=object)[batch.ended]
            info["_ended"] = terminated
        return info

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads."""
        if self._pool is not None and self._pool_process == os.getpid():
            self._pool.shutdown()
