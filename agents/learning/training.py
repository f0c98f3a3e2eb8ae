"""Training a policy: interruptible, repeatable, judged on the way.

A training is cut into legs. At the start of each the environments begin anew and every generator takes a
seed of that leg, so a training that was interrupted and goes on ends in the same policy as one that was
not. After each leg the policy is judged on seas of its own, and the best of the legs is kept.
"""

from __future__ import annotations

import hashlib
import subprocess
import time
import warnings
from collections.abc import Callable
from contextlib import closing
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, make_output_format
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecNormalize

from ...core.archives import read_archive
from ...core.files import write_json
from ...core.sweep import digest_of, refuse_another, source_digest
from ...envs import CLASSIC, DEFAULTS, get_task
from ...envs.sb3 import Sb3Frigates
from ...plant import load_ship
from ..evaluation.episodes import Setting, run_episodes
from ..evaluation.statistics import interquartile_mean
from ..policy.policy import Network, Policy, layout
from ..policy.residual import ANSWERS
from .checkpoints import Checkpoints
from .policy_env import PolicyEnv
from .privileged_critic import PrivilegedCriticPolicy
from .recipe import Recipe, RecipeError

JUDGED_SEEDS = 24
FIRST_JUDGED_SEED = 500_000
"""Seeds of the seas on which the legs are judged; training's run from 0, comparisons' from 900 000."""

_SHOWN = ("reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "failed")

_SOURCES = (
    "core", "plant", "observers", "baselines", "envs", "agents/learning", "agents/policy",
)  # fmt: skip
"""What decides a training's result."""

Tick = Callable[[int, int, str], None]


class Falling:
    """A value that falls linearly to zero along the whole training, whatever its legs."""

    def __init__(self, value: float) -> None:
        self.value = value
        self.remaining = 1.0

    def __call__(self, _: float) -> float:
        """Value at what remains of the training."""
        return self.value * self.remaining


class _Watch(BaseCallback):
    """Tells how far a training is and lets falling values fall."""

    def __init__(self, recipe: Recipe, falling: list[Falling], tick: Tick, said: list[str]) -> None:
        super().__init__()
        self._recipe, self._falling, self._tick, self._said = recipe, falling, tick, said
        self._every = max(recipe.n_timesteps // 200, 1)
        self._next = 0

    def _on_step(self) -> bool:
        total = self._recipe.n_timesteps
        for value in self._falling:
            value.remaining = max(1.0 - self.num_timesteps / total, 0.0)
        if self.num_timesteps >= self._next:
            self._tick(self.num_timesteps, total, self._said[0])
            self._next = self.num_timesteps + self._every
        return True


def _built(recipe: Recipe, venv: Any, seed: int, device: str) -> tuple[Any, list[Falling]]:
    falling: list[Falling] = []

    def value(given: Any) -> Any:
        if isinstance(given, str) and given.startswith("lin_"):
            falling.append(Falling(float(given.removeprefix("lin_"))))
            return falling[-1]
        return float(given) if isinstance(given, str) and given[:1].isdigit() else given

    try:
        own = deepcopy(recipe.hyperparameters)  # the algorithms write into what they are given
        chosen = {key: value(given) for key, given in own.items()}
        with warnings.catch_warnings(
            record=True
        ) as heard:  # of a recipe that is refused: the error alone
            warnings.simplefilter("always")
            model = _model(recipe, venv, {"seed": seed, "device": device} | chosen)
    except (AssertionError, AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise RecipeError(f"{recipe.algorithm.upper()} refuses the recipe: {error}") from None
    for warning in heard:
        warnings.warn(warning.message, stacklevel=2)
    return model, falling


def _model(recipe: Recipe, venv: Any, chosen: dict[str, Any]) -> Any:
    if recipe.algorithm == "sac":
        model = SAC(recipe.policy, venv, **chosen)
        if not isinstance(model.actor.mu, torch.nn.Linear):
            raise ValueError(
                "with use_sde it needs policy_kwargs: {clip_mean: 0.0}, for a policy file knows no "
                "clipped means"
            )
        return model
    rollout = recipe.n_envs * int(chosen.get("n_steps", 2048))
    chosen["batch_size"] = min(int(chosen.get("batch_size", 64)), rollout)
    policy = dict(chosen.pop("policy_kwargs", None) or {}) | {"seen": len(recipe.form.features)}
    return PPO(PrivilegedCriticPolicy, venv, policy_kwargs=policy, **chosen)


def built(
    recipe: Recipe, seed: int, ship: str, device: str, threads: int | None = None
) -> tuple[Any, Any, list[Falling]]:
    """A model that has learned nothing, its normalised environments, and the values that fall.

    Args:
        recipe: what and how.
        seed: of the weights.
        ship: preset or path.
        device: of torch.
        threads: of the environments.
    """
    frigates = Sb3Frigates(
        recipe.n_envs, task=recipe.task, ship=ship, threads=threads,
        **recipe.env_kwargs, **CLASSIC,
    )  # fmt: skip
    piloted = PolicyEnv(frigates, recipe.form, telling=recipe.algorithm == "ppo")
    venv = VecNormalize(piloted, norm_obs=recipe.normalize, norm_reward=recipe.normalize,
                        gamma=float(recipe.hyperparameters.get("gamma", 0.99)))  # fmt: skip
    set_random_seed(seed)
    model, falling = _built(recipe, venv, seed, device)
    return model, venv, falling


def network_of(model: Any, normaliser: VecNormalize, seen: int) -> Network:
    """The deterministic part of a model of stable-baselines3, whose policy sees so many features."""
    policy = model.policy
    if isinstance(model, PPO):
        hidden, last = policy.mlp_extractor.policy_net, policy.action_net
        noise, squashed = policy.log_std.detach().cpu().numpy(), False
        if model.use_sde:  # one column an answer, a row a unit of the last hidden layer
            noise = np.log(np.sqrt(np.mean(np.exp(2.0 * noise), axis=0)))
    else:
        hidden, last = policy.actor.latent_pi, policy.actor.mu
        noise, squashed = np.full(len(ANSWERS), -3.0, np.float32), True
    layers = [layer for layer in hidden if isinstance(layer, torch.nn.Linear)] + [last]
    smooth = any(isinstance(layer, torch.nn.Tanh) for layer in hidden)
    rms: Any = normaliser.obs_rms
    variance = rms.var[:seen]
    # what never varied, as the estimate of an observer that gives none, taught nothing: it is not heard
    heard = np.where(variance > normaliser.epsilon, np.sqrt(variance + normaliser.epsilon), np.inf)
    return Network(
        np.array(rms.mean[: seen]), heard, float(normaliser.clip_obs),
        tuple(layer.weight.detach().cpu().numpy().copy() for layer in layers),
        tuple(layer.bias.detach().cpu().numpy().copy() for layer in layers),
        "tanh" if smooth else "relu", squashed, noise,
    )  # fmt: skip


def sources() -> str:
    """Digest of all that decides a training's result."""
    return source_digest(*_SOURCES)


def commit() -> str | None:
    """Hash of the checkout that this is run from, if it is one."""
    here = Path(__file__).parent
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=here, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return None
    return found.stdout.strip()


def train(
    recipe: Recipe,
    seed: int,
    folder: str | Path,
    *,
    ship: str | None = None,
    device: str = "auto",
    threads: int | None = None,
    tick: Tick = lambda done, total, said: None,
    after_leg: Callable[[list[float]], None] | None = None,
) -> Path:
    """Train a policy, or go on where an earlier call stopped.

    Args:
        recipe: what and how.
        seed: decides everything else; on a CPU the same seed gives the same policy.
        folder: for ``policy.npz``, the training curve, checkpoints and TensorBoard's events.
        ship: preset or path; the one that the task is made for by default.
        device: of torch; ``auto`` takes a GPU where there is one.
        threads: of torch and of the environments; the machine's by default. The environments' change no
            result.
        tick: told the steps done, all steps, and the last judgement in words.
        after_leg: told the reward after each leg so far, once the last of them is kept; what it raises
            ends the training there.

    Returns:
        The policy file.

    Raises:
        ValueError: the folder holds a training of another recipe or seed.
    """
    folder = Path(folder)
    ship = ship or get_task(recipe.task).vessel
    content = digest_of(repr(load_ship(ship)))
    plan = {
        "recipe": recipe.model_dump(), "seed": seed, "ship": {"source": ship, "content": content},
        "source": sources(),
    }  # fmt: skip
    note = folder / "training.json"
    refuse_another(folder, note, plan, "training")
    progress = Checkpoints(folder)
    legs, leg_steps = legs_of(recipe)
    if len(progress.legs) >= legs:
        return progress.finish()
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cpu":
        torch.set_num_threads(1)  # small networks: more threads cost time and repeatability
    model, venv, falling = built(recipe, seed, ship, device, threads)
    piloted = venv.venv
    before = progress.legs[-1] if progress.legs else {"seconds": 0.0, "environment_share": 0.0}
    begin = time.perf_counter() - before["seconds"]
    piloted.acting_s = before["seconds"] * before["environment_share"]
    write_json(note, plan)  # only now is it known that it can begin
    if progress.legs:
        progress.go_on(model, venv)
    formats = ["csv"]
    try:
        import tensorboard  # noqa: F401

        formats.append("tensorboard")
    except ImportError:
        pass
    log = str(folder / "log")
    suffix = f"-{len(progress.legs):02d}"  # a training that goes on keeps what is there
    model.set_logger(Logger(log, [make_output_format(kind, log, suffix) for kind in formats]))
    said = ["not judged yet"]
    watch = _Watch(recipe, falling, tick, said)
    with closing(venv), closing(model.logger):
        for leg in range(len(progress.legs), legs):
            leg_seed = int(np.random.SeedSequence([seed, leg]).generate_state(1)[0] % 2**31)
            model.set_random_seed(leg_seed)  # with the action space's, from which SAC first draws
            venv.seed(leg_seed % 400_000)
            model._last_obs = None  # begin anew everywhere
            venv.returns = np.zeros(recipe.n_envs)
            model.learn(leg_steps, callback=watch, reset_num_timesteps=False)
            policy = Policy(
                network_of(model, venv, len(recipe.form.features)),
                _about(recipe, seed, ship, piloted.venv),
            )
            found = judged(policy, recipe, ship, threads)
            spent = time.perf_counter() - begin
            progress.add(
                {"steps": model.num_timesteps, **found, "seconds": spent,
                 "environment_share": piloted.acting_s / spent}
            )  # fmt: skip
            said[0] = f"reward {found['reward']:.1f}"
            progress.keep(model, venv, policy)
            for name, value in found.items():
                model.logger.record(f"judged/{name}", value)
            if after_leg is not None:
                after_leg([row["reward"] for row in progress.legs])
    tick(recipe.n_timesteps, recipe.n_timesteps, said[0])
    return progress.finish()


def legs_of(recipe: Recipe) -> tuple[int, int]:
    """Legs and steps of each: whole rollouts, so that every leg ends where one does.

    Args:
        recipe: of the training.
    """
    rollout = recipe.n_envs
    if recipe.algorithm == "ppo":
        rollout *= int(recipe.hyperparameters.get("n_steps", 2048))
    legs = max(min(recipe.legs, recipe.n_timesteps // rollout), 1)
    return legs, max(round(recipe.n_timesteps / legs / rollout), 1) * rollout


def _about(recipe: Recipe, seed: int, ship: str, frigates: Sb3Frigates) -> dict[str, Any]:
    batch = frigates.vector.batch
    return {
        "layout": layout(batch.ship, recipe.form),
        "ship_source": ship,
        "control_interval_s": batch.interval_s,
        "recipe": recipe.model_dump(),
        "seed": seed,
        "commit": commit(),
        "torch": torch.__version__.split("+")[0],
    }


def judged(
    policy: Policy,
    recipe: Recipe,
    ship: str,
    threads: int | None,
    first_sea: int = FIRST_JUDGED_SEED,
) -> dict[str, float]:
    """Interquartile means on seas of its own, by the reward that it was trained by.

    Args:
        policy: to be sailed.
        recipe: that it was trained by.
        ship: preset or path.
        threads: of the environments.
        first_sea: seed of the first of the seas.
    """
    environment = {"sea": "task", "observer": DEFAULTS.observer} | recipe.env_kwargs
    steps = environment.pop("max_episode_steps", DEFAULTS.max_episode_steps)
    setting = Setting(
        "policy", recipe.task, seeds=JUDGED_SEEDS, ship=ship,
        episode_s=steps * DEFAULTS.control_interval_s, **environment,
    )  # fmt: skip
    kpis, _ = run_episodes(setting, policy, first_seed=first_sea, threads=threads)
    return {name: float(interquartile_mean(kpis[name])) for name in _SHOWN if name != "failed"} | {
        "failed": float(kpis["failed"].mean())
    }


def digest(path: Path) -> str:
    """Hash of the weights of a policy file, which no clock enters."""
    found = hashlib.sha256()
    for name, array in sorted(read_archive(path).items()):
        if name != "about":
            found.update(array.tobytes())
    return found.hexdigest()
