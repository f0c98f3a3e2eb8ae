"""A first policy for the rudder: what it adds to a tuned helmsman, by proximal policy optimisation.

The policy sees what the helmsman sees and what he commands, and its answer turns his rudder by up to
:data:`REACH`. Pitch and rack stay with the speed pilot. Helmsmen are tuned by CMA-ES on the task's own
seas; held-out seas are drawn by neither.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from ...agents.learning.tuning import searched
from ...baselines.registry import make_steering
from ...baselines.steering import SteeringController, course
from ...envs import CLASSIC, SteeringVectorEnv
from ...envs.sb3 import Sb3Frigates
from ...envs.settings import DEFAULTS

TASKS = {"course-keeping": "autopilot", "track-keeping": "track-keeper"}
"""Each with the helmsman that is made for it."""

REACH = math.radians(8.0)
_TUNED_FROM, _JUDGED_FROM = 700_000, 900_000  # seeds of episodes, apart from those of training
_GAMMA = 0.985  # an answer is judged over half a minute
_STEPS = 128  # of each environment between two updates
KPIS = ("heading_error_deg", "track_error_m", "rudder_rate_deg_s", "speed_error_m_s", "fuel_kg_s")
FEATURES = (
    "heading order less heading", "rate of turn", "rudder angle", "track order less cross track",
    "ship speed", "helmsman's command", "and his last",
)  # fmt: skip


class Sailed(NamedTuple):
    """Episodes of one controller, an entry a seed."""

    reward: NDArray[np.float64]  # shape (n,)
    kpis: pd.DataFrame  # means over each episode, columns :data:`KPIS`


def sail(controller: Any, task: str, first_seed: int, episodes: int, **settings: Any) -> Sailed:
    """Sail one episode a seed.

    Args:
        controller: with ``predict``.
        task: name, with ``:held-out`` for seas that nothing was trained on.
        first_seed: seeds run from here.
        episodes: how many.
        settings: keywords of the environment.
    """
    env = SteeringVectorEnv(episodes, task=task, autoreset_mode="NextStep", **CLASSIC, **settings)
    observation, _ = env.reset(seed=first_seed)
    state, starting, alive = None, np.ones(episodes, bool), np.ones(episodes, bool)
    reward, sums, count = np.zeros(episodes), np.zeros((len(KPIS), episodes)), np.zeros(episodes)
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, earned, terminated, truncated, info = env.step(action)
        reward += alive * earned
        count += alive
        sums += alive * np.array([info["reward_terms"][name] for name in KPIS])
        starting = terminated | truncated
        alive &= ~starting
    env.close()
    return Sailed(reward, pd.DataFrame((sums / count).T, columns=list(KPIS)))


def tuned(
    task: str, rounds: int = 25, episodes: int = 24, tick: Callable[[], None] = lambda: None
) -> str:
    """The helmsman of a task with the constants that CMA-ES finds, as ``NAME:option=number,...``.

    Args:
        task: name.
        rounds: generations.
        episodes: that each candidate sails, all the same.
        tick: called after each round.
    """
    name = TASKS[task]
    ship = SteeringVectorEnv(1, task=task).batch.ship
    helmsman = make_steering(name, ship, DEFAULTS.control_interval_s).helmsman

    def reward(text: str) -> float:
        made = make_steering(text, ship, DEFAULTS.control_interval_s)
        return float(sail(made, task, _TUNED_FROM, episodes).reward.mean())

    found = searched(name, {}, helmsman.tunable, reward, rounds, 0, lambda *_: tick())
    return found.text


class RudderEnv(Sb3Frigates):
    """Steered ships as a policy sees them that corrects a helmsman: features in, one answer out.

    Args:
        vector: of the steering environment.
        base: who is corrected.
    """

    def __init__(self, vector: SteeringVectorEnv, base: SteeringController) -> None:
        self.vector, self.base = vector, base
        self._state: Any = None
        self._action: Any = None
        self._before: Any = None
        self._seed: int | None = None
        box = spaces.Box(-np.inf, np.inf, (len(FEATURES),), np.float32)
        VecEnv.__init__(self, vector.num_envs, box, spaces.Box(-1.0, 1.0, (1,), np.float32))

    def reset(self) -> Any:
        """Begin everywhere, each at another time of its episode."""
        observation, _ = self.vector.reset(seed=self._seed)
        self._seed = None
        batch = self.vector.batch
        share = np.arange(self.num_envs) / self.num_envs
        batch.elapsed[:] = (share * (batch.settings.max_episode_steps or 0)).astype(np.int64)
        self._action, self._state = self.base.predict(observation)
        self._before = self._action[:, 2].copy()
        return features(observation, self._action[:, 2], self._before, self.base)

    def step_async(self, actions: Any) -> None:
        """Add the answers to the rudder."""
        self._before = self._action[:, 2].copy()
        self._action = corrected(self._action, actions, self.base)

    def step_wait(self) -> Any:
        """Hold the commands over one control interval."""
        observation, reward, terminated, truncated, info = self.vector.step(self._action)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            which = np.flatnonzero(done)
            last = np.stack([info["final_obs"][i] for i in which])
            memory = tuple(part[which] for part in self._state)
            action, _ = self.base.predict(last, memory)
            rows = features(last, action[:, 2], self._before[which], self.base)
            for i, row in zip(which, rows, strict=True):
                infos[i]["terminal_observation"] = row
                infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        self._action, self._state = self.base.predict(observation, self._state, done)
        self._before = np.where(done, self._action[:, 2], self._before)
        rows = features(observation, self._action[:, 2], self._before, self.base)
        return rows, reward.astype(np.float32), done, infos


def features(observation: Any, command: Any, before: Any, base: SteeringController) -> Any:
    """What the policy sees, each of the order of 1, shape (n, 7).

    Args:
        observation: shape (n, 14).
        command: of the helmsman, as an action, shape (n,).
        before: his last, shape (n,).
        base: he and the propulsion.
    """
    seen = course(observation)
    missing = np.remainder(seen.heading_order - seen.heading + np.pi, 2.0 * np.pi) - np.pi
    length, most = base.helmsman.length, base.helmsman.most
    columns = (
        missing / 0.3, seen.yaw_rate / 0.02, seen.rudder_angle / most,
        np.clip((seen.track_order - seen.cross_track) / length, -3.0, 3.0), seen.ship_speed / 8.0 - 1.0,
        command, before,
    )  # fmt: skip
    return np.column_stack(columns).astype(np.float32)


def corrected(action: NDArray[np.float32], answer: Any, base: SteeringController) -> Any:
    """Actions with the policy's answers, shape (n, 1), on the rudder."""
    found = action.copy()
    turned = found[:, 2] + np.clip(answer[:, 0], -1.0, 1.0) * REACH / base.helmsman.most
    found[:, 2] = np.clip(turned, -1.0, 1.0)
    return found


class Corrected:
    """A helmsman under a policy, with ``predict``."""

    def __init__(self, base: SteeringController, policy: Any) -> None:
        self.base, self.policy = base, policy

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """As of :class:`~shaftline.baselines.SteeringController`."""
        own, before = (None, None) if state is None else state
        action, own = self.base.predict(observation, own, episode_start)
        command = action[:, 2].copy()
        if before is None:
            before = command
        elif episode_start is not None:
            before = np.where(episode_start, command, before)
        rows = features(observation, command, before, self.base)
        answer, _ = self.policy.predict(rows, deterministic=deterministic)
        return corrected(action, answer, self.base), (own, command)


def trained(task: str, base: str, seed: int, intervals: int, environments: int = 128) -> Corrected:
    """A policy that corrects a helmsman.

    Args:
        task: name.
        base: ``HELMSMAN:option=number,...``.
        seed: of the training.
        intervals: control intervals of all environments together.
        environments: side by side.
    """
    vector = SteeringVectorEnv(environments, task=task, **CLASSIC)
    made = make_steering(base, vector.batch.ship, DEFAULTS.control_interval_s)
    venv = RudderEnv(vector, made)
    venv.seed(1000 * seed)
    # the critic learns rewards of the order of 1
    scaled = VecNormalize(VecMonitor(venv), norm_obs=False, gamma=_GAMMA)
    model = PPO(
        "MlpPolicy", scaled, seed=seed, n_steps=_STEPS,
        batch_size=min(4096, _STEPS * environments), n_epochs=8, gamma=_GAMMA,
        gae_lambda=0.95, learning_rate=1e-3, ent_coef=0.0, max_grad_norm=0.5, device="cpu",
        policy_kwargs={"net_arch": {"pi": [], "vf": [64, 64]}, "log_std_init": -1.5},
    )  # fmt: skip
    # answers begin at nothing, so that training begins as good as the helmsman is
    last: Any = model.policy.action_net
    last.weight.data.zero_()
    last.bias.data.zero_()
    model.learn(intervals)
    venv.close()
    return Corrected(made, model)


def judged(
    controllers: dict[str, Sequence[Any]], task: str, episodes: int = 64
) -> dict[str, list[Sailed]]:
    """Controllers on the same held-out episodes.

    Args:
        controllers: by name; several of one name are trainings.
        task: name.
        episodes: how many.
    """
    return {
        name: [sail(one, f"{task}:held-out", _JUDGED_FROM, episodes) for one in several]
        for name, several in controllers.items()
    }
