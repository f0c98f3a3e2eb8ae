"""Training a policy: interruptible, repeatable, judged on the way.

A training is cut into legs. At the start of each the environments begin anew and every generator takes a
seed of that leg, so a training that was interrupted and goes on ends in the same policy as one that was
not. After each leg the policy is judged on seas of its own, and the best of the legs is kept.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import time
from collections.abc import Callable
from contextlib import closing
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, make_output_format
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnvWrapper, VecNormalize

from ..envs.sb3 import Sb3Frigates
from ..plant.files import write_atomically, write_json
from ..plant.sweep import source_digest
from .asymmetric import TOLD, AsymmetricPolicy, told
from .bridge import ANSWERS, FEATURES, Bridge, Reach
from .evaluation import Setting, interquartile_mean, run
from .policy import Network, Policy, layout
from .recipe import Recipe, RecipeError

JUDGED_SEEDS = 24
FIRST_JUDGED_SEED = 500_000
"""Seeds of the seas on which the legs are judged; training's run from 0, comparisons' from 900 000."""

_SHOWN = ("reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "failed")

Tick = Callable[[int, int, str], None]


class Bridged(VecEnvWrapper):
    """Environments as a policy sees and commands them: features in, rates out."""

    def __init__(self, venv: Sb3Frigates, reach: Reach, telling: bool) -> None:
        self.fleet = fleet = venv.vector.fleet
        self.bridge = Bridge(fleet.ship, fleet.steps * fleet.dt, reach)
        self._telling = telling
        width = len(FEATURES) + telling * len(TOLD)
        unbounded = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        super().__init__(venv, unbounded, spaces.Box(-1.0, 1.0, (len(ANSWERS),), np.float32))
        self.memory: Any = None
        self._told: Any = np.zeros((venv.num_envs, 0), np.float32)
        self.acting_s = 0.0  # spent in the environments

    def reset(self) -> Any:
        """Begin everywhere, each at another time of its episode.

        Episodes that run in step would show an update only their beginnings, and the next their ends.
        """
        features, self.memory = self.bridge.see(self.venv.reset())
        vector = self.venv.vector  # type: ignore[attr-defined]
        share = np.arange(self.num_envs) / self.num_envs
        self.fleet.episodes["elapsed"] = (share * vector.intervals).astype(np.int64)
        self._features = features
        return self._with_told(features)

    def step_async(self, actions: Any) -> None:
        """Take the answers in."""
        begin = time.perf_counter()
        self.venv.step_async(self.bridge.command(actions, self.memory, self._features))
        self.acting_s += time.perf_counter() - begin

    def step_wait(self) -> Any:
        """Hold the commands over one control interval."""
        begin = time.perf_counter()
        observation, reward, done, infos = self.venv.step_wait()
        ended = np.flatnonzero(done)
        if len(ended):
            last = np.stack([infos[i]["terminal_observation"] for i in ended])
            seen, _ = self.bridge.see(last, self.memory[ended])
            for i, row in zip(ended, self._with_told(seen, self._told[ended]), strict=True):
                infos[i]["terminal_observation"] = row
        features, self.memory = self.bridge.see(observation, self.memory, done)
        self._features = features
        told_too = self._with_told(features)
        self.acting_s += time.perf_counter() - begin
        return told_too, reward, done, infos

    def _with_told(self, features: Any, columns: Any = None) -> Any:
        """Features, and what the critic is told: of now, or columns of an episode that has ended."""
        if not self._telling:
            return features
        if columns is None:
            columns = self._told = told(self.fleet)
        return np.hstack([features, columns])


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
        if recipe.algorithm == "sac":
            return SAC(recipe.policy, venv, seed=seed, device=device, **chosen), falling
        return PPO(AsymmetricPolicy, venv, seed=seed, device=device, **chosen), falling
    except (AssertionError, TypeError, ValueError) as error:
        raise RecipeError(f"{recipe.algorithm.upper()} refuses the recipe: {error}") from None


def network_of(model: Any, normaliser: VecNormalize) -> Network:
    """The deterministic part of a model of stable-baselines3."""
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
    return Network(
        np.array(rms.mean[: len(FEATURES)]),
        np.sqrt(rms.var[: len(FEATURES)] + normaliser.epsilon), float(normaliser.clip_obs),
        tuple(layer.weight.detach().cpu().numpy().copy() for layer in layers),
        tuple(layer.bias.detach().cpu().numpy().copy() for layer in layers),
        "tanh" if smooth else "relu", squashed, noise,
    )  # fmt: skip


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
    folder: Path,
    *,
    ship: str = "frigate",
    device: str = "auto",
    threads: int | None = None,
    tick: Tick = lambda done, total, said: None,
) -> Path:
    """Train a policy, or go on where an earlier call stopped.

    Args:
        recipe: what and how.
        seed: decides everything else; on a CPU the same seed gives the same policy.
        folder: for ``policy.npz``, the training curve, checkpoints and TensorBoard's events.
        ship: preset or path.
        device: of torch; ``auto`` takes a GPU where there is one.
        threads: of torch and of the environments; the machine's by default. The environments' change no
            result.
        tick: told the steps done, all steps, and the last judgement in words.

    Returns:
        The policy file.

    Raises:
        ValueError: the folder holds a training of another recipe or seed.
    """
    plan = {"recipe": recipe.model_dump(), "seed": seed, "ship": ship, "source": source_digest(
        "plant", "observers", "envs", "agents/bridge.py", "agents/training.py")}  # fmt: skip
    note = folder / "training.json"
    _same(note, plan)
    progress = _Progress(folder)
    legs, leg_steps = _legs(recipe)
    if len(progress.legs) >= legs:
        return progress.finish()
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cpu":
        torch.set_num_threads(1)  # small networks: more threads cost time and repeatability
    frigates = Sb3Frigates(
        recipe.n_envs, task=recipe.rewarded(), ship=ship, threads=threads, **recipe.env_kwargs
    )
    bridged = Bridged(frigates, recipe.reach, telling=recipe.algorithm == "ppo")
    before = progress.legs[-1] if progress.legs else {"seconds": 0.0, "environment_share": 0.0}
    begin = time.perf_counter() - before["seconds"]
    bridged.acting_s = before["seconds"] * before["environment_share"]
    venv: Any = VecNormalize(bridged, norm_obs=recipe.normalize, norm_reward=recipe.normalize,
                             gamma=float(recipe.hyperparameters.get("gamma", 0.99)))  # fmt: skip
    set_random_seed(seed)
    model, falling = _built(recipe, venv, seed, device)
    write_json(note, plan)  # only now is it known that it can begin
    if progress.legs:
        venv = VecNormalize.load(str(progress.normaliser), bridged)
        kept = type(model).load(progress.model, env=venv, device=device)
        model.set_parameters(kept.get_parameters(), device=device)
        model.set_env(venv)
        model.num_timesteps, model._n_updates = kept.num_timesteps, kept._n_updates
        if isinstance(model, SAC):
            model.load_replay_buffer(progress.buffer)
            if model.log_ent_coef is not None:  # not among the parameters, though it is learned
                model.log_ent_coef.data.copy_(kept.log_ent_coef.data)
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
            for fall in falling:
                fall.remaining = max(1.0 - model.num_timesteps / recipe.n_timesteps, 0.0)
            model.learn(leg_steps, callback=watch, reset_num_timesteps=False)
            policy = Policy(network_of(model, venv), _about(recipe, seed, ship, frigates))
            judged = _judged(policy, recipe, ship, threads)
            spent = time.perf_counter() - begin
            progress.add(
                {"steps": model.num_timesteps, **judged, "seconds": spent,
                 "environment_share": bridged.acting_s / spent}
            )  # fmt: skip
            said[0] = f"reward {judged['reward']:.1f}"
            progress.keep(model, venv, policy)
            for name, value in judged.items():
                model.logger.record(f"judged/{name}", value)
    tick(recipe.n_timesteps, recipe.n_timesteps, said[0])
    return progress.finish()


def _legs(recipe: Recipe) -> tuple[int, int]:
    """Legs and steps of each: whole rollouts, so that every leg ends where one does."""
    rollout = recipe.n_envs
    if recipe.algorithm == "ppo":
        rollout *= int(recipe.hyperparameters.get("n_steps", 2048))
    legs = max(min(recipe.legs, recipe.n_timesteps // rollout), 1)
    return legs, max(round(recipe.n_timesteps / legs / rollout), 1) * rollout


def _same(note: Path, plan: dict[str, Any]) -> None:
    """Refuse to mix trainings in one folder."""
    text = json.loads(json.dumps(plan))
    if note.is_file():
        kept = json.loads(note.read_text(encoding="utf-8"))
        for key, value in text.items():
            if kept.get(key) != value:
                raise ValueError(
                    f"{note.parent}: holds a training of another {key}; remove the folder or give "
                    "another"
                )


def _about(recipe: Recipe, seed: int, ship: str, frigates: Sb3Frigates) -> dict[str, Any]:
    fleet = frigates.vector.fleet
    return {
        "layout": layout(fleet.ship),
        "ship_source": ship,
        "control_interval_s": fleet.steps * fleet.dt,
        "recipe": recipe.model_dump(),
        "seed": seed,
        "commit": commit(),
        "torch": torch.__version__.split("+")[0],
    }


def _judged(policy: Policy, recipe: Recipe, ship: str, threads: int | None) -> dict[str, float]:
    """Interquartile means on seas of its own, by the task's own reward."""
    setting = Setting(
        "policy", recipe.task, "task", recipe.env_kwargs.get("observer", "random-walk-kalman"),
        JUDGED_SEEDS, ship, recipe.env_kwargs.get("episode_s", 300.0),
        recipe.env_kwargs.get("sensor_noise", 1.0), task_model=recipe.rewarded(),
    )  # fmt: skip
    kpis, _ = run(setting, policy, first_seed=FIRST_JUDGED_SEED, threads=threads)
    return {name: float(interquartile_mean(kpis[name])) for name in _SHOWN if name != "failed"} | {
        "failed": float(kpis["failed"].mean())
    }


class _Progress:
    """What a training has on disk."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._note = folder / "curve.json"
        self.legs: list[dict[str, float]] = []
        if self._note.is_file():
            self.legs = json.loads(self._note.read_text(encoding="utf-8"))

    def _at(self, kind: str) -> Path:
        return self.folder / "checkpoints" / f"{kind}-{len(self.legs):02d}"

    @property
    def model(self) -> Path:
        return self._at("model").with_suffix(".zip")

    @property
    def normaliser(self) -> Path:
        return self._at("normaliser").with_suffix(".pkl")

    @property
    def buffer(self) -> Path:
        return self._at("buffer").with_suffix(".pkl")

    def add(self, row: dict[str, float]) -> None:
        """A leg more; it counts once it is kept."""
        self.legs.append(row)

    def keep(self, model: Any, venv: VecNormalize, policy: Policy) -> None:
        """Write the checkpoint, then the curve that says that it is there."""
        write_atomically(self.model, lambda file: model.save(file))
        write_atomically(self.normaliser, lambda file: venv.save(str(file)))
        if isinstance(model, SAC):
            write_atomically(self.buffer, lambda file: model.save_replay_buffer(file))
        policy.curve = {key: [leg[key] for leg in self.legs] for key in self.legs[0]}
        policy.save(self._at("policy").with_suffix(".npz"))
        write_json(self._note, self.legs)
        for old in set(self.buffer.parent.glob("buffer-*.pkl")) - {self.buffer}:
            old.unlink()  # hundreds of megabytes each, and only the last is gone on from

    def finish(self) -> Path:
        """The best leg's policy as the training's; with the whole curve in it."""
        from .policy import load

        failed_last = [(leg["failed"] == 0.0, leg["reward"]) for leg in self.legs]
        best = max(range(len(self.legs)), key=lambda i: failed_last[i])
        policy = load(self.folder / "checkpoints" / f"policy-{best + 1:02d}.npz")
        policy.curve = {key: [leg[key] for leg in self.legs] for key in self.legs[0]}
        policy.about["leg"] = best + 1
        path = self.folder / "policy.npz"
        policy.save(path)
        return path


def digest(path: Path) -> str:
    """Hash of the weights of a policy file, which no clock enters."""
    found = hashlib.sha256()
    with np.load(path) as archive:
        for name in sorted(archive.files):
            if name != "about":
                found.update(archive[name].tobytes())
    return found.hexdigest()
