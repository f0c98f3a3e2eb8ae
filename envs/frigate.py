"""``shaftline/Frigate-v0``: the single environment and its vector form."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED
from ..plant.signals import get_signal
from .batch import Fleet, SeaChoice
from .dashboard import Dashboard
from .kernel import RUNNING, STALLED, TRUTH
from .tasks import TERMS


def observation_space() -> spaces.Box:
    """Signals of ``baselines.interface.OBSERVED`` in physical units, with the registry's bounds."""
    signals = [get_signal(name) for name in OBSERVED]
    low = np.array([signal.low for signal in signals], np.float32)
    high = np.array([signal.high for signal in signals], np.float32)
    return spaces.Box(low, high, dtype=np.float32)


def action_space() -> spaces.Box:
    """Pitch command and fuel rack command, each in [-1, 1] over the ship's range."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def _checked(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    array = np.array(action, dtype=np.float32)
    if array.shape != shape:
        raise ValueError(f"action has shape {array.shape}, {shape} is needed")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"action {array.tolist()} holds a value that is not finite")
    return np.clip(array, -1.0, 1.0)


class FrigateEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A ship's propulsion plant in waves, commanded by pitch and fuel rack.

    ## Observation
    ``Box(8,)`` in physical units: ordered ship speed [m/s], shaft speed [rad/s], torque at the gauge
    [N m], pitch ratio [-], fuel rack [mm], ship speed [m/s] (all as the noisy instruments read them),
    the observer's estimate of the advance velocity [m/s] and whether it is valid. They are of the last
    plant step before the action.

    ## Action
    ``Box(2,)`` in [-1, 1]: pitch command and fuel rack command over the ship's ranges; values outside
    are clipped, a value that is not finite is refused. With ``action_mode="shaft-speed"`` the second
    is the shaft speed over the engine's range, held by a governor.

    ## Reward
    Minus the weighted sum of the task's terms; ``info`` holds each in its physical unit.

    ## Episode end
    Terminated where the engine stalls or trips on overspeed; truncated after ``episode_s``.

    Args:
        ship: preset or path.
        task: ``speed-keeping``, ``transit``, ``storm``, or a dictionary of its fields.
        observer: name of the observer; ``oracle`` shows the truth.
        tuning: its tuning.
        sea: preset; parameters, such as ``{"hs_m": (1.0, 5.0), "tp_s": 9.0}``, where a pair is a range
            from which each episode draws; or a list of those to draw from; the task's by default.
        sensor_noise: 1 for the usual instruments, 0 for perfect ones, or rms by instrument.
        control_interval_s: time between actions [s].
        episode_s: length of an episode [s].
        randomise: half width of a uniform factor by field of the plant's record.
        action_mode: ``rack``, or ``shaft-speed`` for a second action that is the set-point of the
            built-in governor.
        render_mode: None or ``rgb_array``.

    Raises:
        ValueError: something that does not exist or is out of range; the message names it.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's way)

    def __init__(
        self,
        ship: Any = "frigate",
        task: Any = "speed-keeping",
        observer: str = "random-walk-kalman",
        tuning: str | None = None,
        sea: SeaChoice = None,
        sensor_noise: float | Mapping[str, float] = 1.0,
        control_interval_s: float = 0.5,
        episode_s: float = 300.0,
        randomise: Mapping[str, float] | None = None,
        action_mode: str = "rack",
        render_mode: str | None = None,
    ) -> None:
        self.fleet = Fleet(
            1, ship=ship, task=task, observer=observer, tuning=tuning, sea=sea,
            sensor_noise=sensor_noise, control_interval_s=control_interval_s, randomise=randomise,
            action_mode=action_mode,
        )  # fmt: skip
        self.intervals = _intervals(episode_s, control_interval_s)
        self.observation_space: Any = observation_space()
        self.action_space: Any = action_space()
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"unknown render_mode {render_mode!r}; known: rgb_array")
        self.render_mode = render_mode
        self._dashboard = Dashboard(self.fleet, control_interval_s) if render_mode else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode."""
        super().reset(seed=seed)
        self.fleet.reset(0, self.np_random)
        self.fleet.observe(np.array([0]))
        if self._dashboard is not None:
            self._dashboard.clear()
        return self.fleet.observation[0].copy(), {}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold an action over one control interval."""
        self.fleet.step(_checked(action, (2,))[None])
        ended = int(self.fleet.ended[0])
        truncated = bool(self.fleet.episodes[0]["elapsed"] >= self.intervals)
        info: dict[str, Any] = dict(zip(TRUTH, self.fleet.truth[0].tolist(), strict=True))
        info["reward_terms"] = dict(zip(TERMS, self.fleet.terms[0].tolist(), strict=True))
        if ended != RUNNING:
            info["ended"] = "stalled" if ended == STALLED else "overspeed trip"
        if self._dashboard is not None:
            self._dashboard.record()
        reward = float(self.fleet.reward[0])
        return self.fleet.observation[0].copy(), reward, ended != RUNNING, truncated, info

    def render(self) -> Any:
        """The dashboard as an RGB array of shape (height, width, 3); None without a render mode."""
        return None if self._dashboard is None else self._dashboard.draw()


def _intervals(episode_s: float, control_interval_s: float) -> int:
    intervals = round(episode_s / control_interval_s)
    if intervals < 1:
        raise ValueError(f"episode_s = {episode_s!r} s is shorter than a control interval")
    return intervals


class FrigateVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many of :class:`FrigateEnv` stepped in one compiled call, spread over the cores.

    Sub-environment i with seed s + i is :class:`FrigateEnv` with that seed, bit for bit. An ended
    episode is reset in the same step; its last observation and info stand in ``final_obs`` and
    ``final_info``.

    Args:
        num_envs: how many.
        threads: that step them; the machine's cores by default.
        episode_s: length of an episode [s].
        control_interval_s: time between actions [s].
        options: the other keywords of :class:`FrigateEnv`.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 (Gymnasium's way)

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        episode_s: float = 300.0,
        control_interval_s: float = 0.5,
        **options: Any,
    ) -> None:
        settings: dict[str, Any] = {
            "ship": "frigate", "task": "speed-keeping", "observer": "random-walk-kalman",
            "tuning": None, "sea": None, "sensor_noise": 1.0, "randomise": None,
            "action_mode": "rack",
        }  # fmt: skip
        options.pop("render_mode", None)
        unknown = set(options) - set(settings)
        if unknown:
            raise ValueError(
                f"unknown keyword {sorted(unknown)[0]!r}; known: {', '.join(settings)}"
            )
        self.fleet = Fleet(
            num_envs, **{**settings, **options}, control_interval_s=control_interval_s
        )
        self.intervals = _intervals(episode_s, control_interval_s)
        self.num_envs = num_envs
        self.single_observation_space = observation_space()
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        workers = min(threads or os.cpu_count() or 1, num_envs)
        self._pool = ThreadPoolExecutor(workers) if workers > 1 else None
        self._rngs: list[np.random.Generator] = []

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in every sub-environment."""
        if seed is not None or not self._rngs:
            seeds = seed if isinstance(seed, list) else None
            if seeds is None:
                seeds = [None if seed is None else seed + i for i in range(self.num_envs)]  # type: ignore[operator]
            self._rngs = [gymnasium.utils.seeding.np_random(s)[0] for s in seeds]
        for i, rng in enumerate(self._rngs):
            self.fleet.reset(i, rng)
        self.fleet.observe(np.arange(self.num_envs))
        return self.fleet.observation.copy(), {}

    def step(
        self, actions: Any
    ) -> tuple[
        NDArray[np.float32], NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """Hold an action in each sub-environment over one control interval."""
        fleet = self.fleet
        fleet.step(_checked(actions, (self.num_envs, 2)), self._pool)
        terminated = fleet.ended != RUNNING
        truncated = fleet.episodes["elapsed"] >= self.intervals
        reward = fleet.reward.copy()
        info: dict[str, Any] = {name: fleet.truth[:, k].copy() for k, name in enumerate(TRUTH)}
        info["reward_terms"] = {term: fleet.terms[:, k].copy() for k, term in enumerate(TERMS)}
        done = np.flatnonzero(terminated | truncated)
        if len(done):
            info["final_obs"] = np.full(self.num_envs, None, dtype=object)
            info["_final_obs"] = terminated | truncated
            info["final_info"] = {name: info[name] for name in TRUTH}
            info["_final_info"] = info["_final_obs"]
            for i in done:
                info["final_obs"][i] = fleet.observation[i].copy()
                fleet.reset(int(i), self._rngs[i])
            fleet.observe(done)
        return fleet.observation.copy(), reward, terminated, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()
