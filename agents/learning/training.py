"""Training of a policy: interruptible, repeatable, with evaluations at regular intervals.

A training is divided into parts, each of which ends with an evaluation. At the start of each part the
environments start new episodes and every random generator gets a seed of that part. A training that was
interrupted and resumed therefore ends in the same policy as one without interruption. The policy after
the last part is kept.
"""

from __future__ import annotations

import hashlib
import itertools
import subprocess
import time
import warnings
from collections.abc import Callable
from contextlib import closing
from copy import deepcopy
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, make_output_format
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecFrameStack, VecMonitor

from ...baselines.controller import Predictor
from ...core.archives import read_archive
from ...core.files import write_json
from ...core.sweep import digest_of, refuse_other_plan, source_digest
from ...envs import DEFAULTS, get_task
from ...envs.batch import Batch
from ...envs.sb3 import Sb3Frigates
from ...envs.tasks import controller_for
from ...plant import load_ship
from ..evaluation.episodes import Setting, run_episodes
from ..evaluation.statistics import interquartile_mean
from ..policy.policy import INTERFACE, Network, Policy, layout
from .checkpoints import Checkpoints
from .imitation import check_plannable, demonstrate, imitate, make_plans
from .recipe import Recipe, RecipeError, tuned_controller

EVALUATION_EPISODES = 24
FIRST_EVALUATION_SEED = 500_000
"""First seed of the evaluations; training uses seeds from 0, comparisons from 900 000."""

_MODELS = {"ppo": PPO, "sac": SAC, "td3": TD3}

_SHOWN = ("reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "failed")

_SOURCES = (
    "core",
    "plant",
    "observers",
    "baselines",
    "envs",
    "agents/learning",
    "agents/policy",
    "agents/evaluation/clairvoyant.py",
)
"""Source code that determines the result of a training."""

Tick = Callable[[int, int, str], None]


class LinearDecay:
    """Value that falls linearly to zero over the whole training."""

    def __init__(self, value: float) -> None:
        self.value, self.remaining = value, 1.0

    def __call__(self, _: float) -> float:
        """Return the value at the remaining share of the training."""
        return self.value * self.remaining


class _Watch(BaseCallback):
    """Report the progress of a training and update the falling values."""

    def __init__(
        self, recipe: Recipe, falling: list[LinearDecay], tick: Tick, said: list[str]
    ) -> None:
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


def _build(recipe: Recipe, venv: Any, seed: int, device: str) -> tuple[Any, list[LinearDecay]]:
    falling: list[LinearDecay] = []

    def value(given: Any) -> Any:
        if isinstance(given, str) and given.startswith("lin_"):
            falling.append(LinearDecay(float(given.removeprefix("lin_"))))
            return falling[-1]
        return float(given) if isinstance(given, str) and given[:1].isdigit() else given

    try:
        own = deepcopy(recipe.hyperparameters)  # The algorithms change their arguments.
        chosen = {key: value(given) for key, given in own.items()}
        # A recipe that is refused shall print its error only, without warnings.
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            model = _model(recipe, venv, {"seed": seed, "device": device} | chosen)
    except (AssertionError, AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise RecipeError(f"{recipe.algorithm.upper()} refuses the recipe: {error}") from None
    for warning in caught:
        warnings.warn(warning.message, stacklevel=2)
    return model, falling


def _model(recipe: Recipe, venv: Any, chosen: dict[str, Any]) -> Any:
    if recipe.algorithm == "ppo":
        rollout = recipe.n_envs * int(chosen.get("n_steps", 2048))
        chosen["batch_size"] = min(int(chosen.get("batch_size", 64)), rollout)
    model = _MODELS[recipe.algorithm](recipe.policy, venv, **chosen)
    if isinstance(model, SAC) and not isinstance(model.actor.mu, torch.nn.Linear):
        raise ValueError(
            "use_sde needs policy_kwargs: {clip_mean: 0.0}, because a policy file cannot store "
            "clipped means"
        )
    return model


class _StaggeredFrigates(Sb3Frigates):
    """Batch of ships whose first episodes end at different times.

    With episodes in step, one update would contain only starts of episodes and the next only ends.
    """

    def reset(self) -> Any:
        """Start an episode in every environment, each at another elapsed time."""
        observation = super().reset()
        batch = self.vector.batch
        share = np.arange(self.num_envs) / self.num_envs
        batch.elapsed[:] = (share * (batch.settings.max_episode_steps or 0)).astype(np.int64)
        return observation


def build_model(
    recipe: Recipe, seed: int, ship: str, device: str, threads: int | None = None
) -> tuple[Any, Any, list[LinearDecay]]:
    """Return an untrained model, its environments, and the values that fall during the training.

    ``ship`` is a preset or path; ``seed`` is that of the weights.
    """
    venv: Any = VecMonitor(
        _StaggeredFrigates(
            recipe.n_envs,
            steered=get_task(recipe.task).steered,
            task=recipe.task,
            ship=ship,
            threads=threads,
            **recipe.env_kwargs,
        )
    )
    if recipe.frame_stack > 1:
        venv = VecFrameStack(venv, recipe.frame_stack)
    set_random_seed(seed)
    model, falling = _build(recipe, venv, seed, device)
    return model, venv, falling


def extract_network(model: Any) -> Network:
    """Return the deterministic part of the policy of a model of stable-baselines3."""
    policy = model.policy
    if isinstance(model, PPO):
        parts, squashed = [*policy.mlp_extractor.policy_net, policy.action_net], False
    elif isinstance(model, SAC):
        parts, squashed = [*policy.actor.latent_pi, policy.actor.mu], True
    else:
        parts, squashed = list(policy.actor.mu), True
    layers = [layer for layer in parts if isinstance(layer, torch.nn.Linear)]
    hidden = parts[:-1] if isinstance(model, TD3) else parts  # The last tanh is the squashing.
    smooth = any(isinstance(layer, torch.nn.Tanh) for layer in hidden)
    return Network(
        tuple(layer.weight.detach().cpu().numpy().copy() for layer in layers),
        tuple(layer.bias.detach().cpu().numpy().copy() for layer in layers),
        "tanh" if smooth else "relu",
        squashed,
    )


def sources() -> str:
    """Return a digest of the source code that determines the result of a training."""
    return source_digest(*_SOURCES)


def git_commit() -> str | None:
    """Return the hash of the checkout that contains this module; None without a checkout."""
    command, here = ["git", "rev-parse", "HEAD"], Path(__file__).parent
    try:
        return subprocess.check_output(
            command, cwd=here, stderr=subprocess.DEVNULL, text=True
        ).strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def train(
    recipe: Recipe,
    seed: int,
    folder: str | Path,
    *,
    ship: str | None = None,
    device: str = "auto",
    threads: int | None = None,
    plan_folder: str | Path | None = None,
    tick: Tick = lambda done, total, said: None,
    after_evaluation: Callable[[list[float]], None] | None = None,
) -> Path:
    """Train a policy, or resume an interrupted training.

    Args:
        recipe: recipe of the training.
        seed: seed of the training; on a CPU the same seed gives the same policy.
        folder: folder for ``policy.npz``, the training curve, checkpoints and events of TensorBoard.
        ship: preset or path; by default the ship of the task.
        device: device of torch; ``auto`` selects a GPU where there is one.
        threads: number of threads of torch and of the environments; one for each core by default. Those
            of the environments do not change the result.
        plan_folder: folder of the plans that the recipe imitates, which several trainings can share; the
            subfolder ``plans`` of ``folder`` by default.
        tick: function called with the finished steps, all steps, and the last evaluation as text.
        after_evaluation: function called with the rewards of the evaluations so far (without that of the
            imitation) when the last is saved; an exception in it ends the training.

    Returns:
        Path of the policy file.

    Raises:
        RecipeError: the recipe has plans, and the pitch of the ship is fixed.
        ValueError: the folder contains a training of another recipe or seed, or a damaged plan.
    """
    folder = Path(folder)
    ship = ship or get_task(recipe.task).vessel
    vessel = load_ship(ship)
    content = digest_of(repr(vessel))
    plan = {
        "recipe": recipe.model_dump(),
        "seed": seed,
        "ship": {"source": ship, "content": content},
        "source": sources(),
    }
    note = folder / "training.json"
    refuse_other_plan(folder, note, plan, "training")
    progress = Checkpoints(folder)
    parts, steps = evaluation_schedule(recipe)
    imitated = 1 if recipe.plans else 0  # The first evaluation is that of the imitation.
    if len(progress.evaluations) >= parts + imitated:
        return progress.finish()
    check_plannable(recipe, vessel)
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cpu":
        torch.set_num_threads(1)  # More threads are slower for small networks, and not repeatable.
    model, venv, falling = build_model(recipe, seed, ship, device, threads)
    seconds = progress.evaluations[-1]["seconds"] if progress.evaluations else 0.0
    begin = time.perf_counter() - seconds
    write_json(note, plan)  # The recipe has been accepted.
    if progress.evaluations:
        progress.resume(model)
    formats = ["csv", "tensorboard"] if find_spec("tensorboard") else ["csv"]
    log = str(folder / "log")
    suffix = f"-{len(progress.evaluations):02d}"  # A resumed training keeps earlier logs.
    model.set_logger(Logger(log, [make_output_format(kind, log, suffix) for kind in formats]))
    said = ["not evaluated yet"]
    watch = _Watch(recipe, falling, tick, said)

    def evaluate() -> None:
        about = about_training(recipe, seed, ship, venv.get_attr("vector", [0])[0].batch)
        policy = Policy(extract_network(model), about)
        found = evaluate_policy(policy, recipe, ship, threads)
        seconds = time.perf_counter() - begin
        progress.evaluations.append({"steps": model.num_timesteps, **found, "seconds": seconds})
        said[0] = f"reward {found['reward']:.1f}"
        progress.keep(model, policy)
        for name, value in found.items():
            model.logger.record(f"evaluation/{name}", value)

    with closing(venv), closing(model.logger):
        if recipe.plans and not progress.evaluations:
            plans = Path(plan_folder or folder / "plans")
            _imitate_plans(model, recipe, ship, plans, threads, tick)
            evaluate()
        for part in range(len(progress.evaluations) - imitated, parts):
            part_seed = int(np.random.SeedSequence([seed, part]).generate_state(1)[0] % 2**31)
            # The seed of the model is also that of the action space, from which SAC draws.
            model.set_random_seed(part_seed)
            venv.seed(part_seed % 400_000)
            model._last_obs = None  # All environments start new episodes.
            model.learn(steps, callback=watch, reset_num_timesteps=False)
            evaluate()
            if after_evaluation is not None:
                after_evaluation([row["reward"] for row in progress.evaluations[imitated:]])
    tick(recipe.n_timesteps, recipe.n_timesteps, said[0])
    return progress.finish()


def _imitate_plans(
    model: Any, recipe: Recipe, ship: str, folder: Path, jobs: int | None, tick: Tick
) -> None:
    """Compute the plans of a recipe and fit the networks of a model to them."""
    made = itertools.count(1)

    def count() -> None:
        tick(0, recipe.n_timesteps, f"{next(made)} of {recipe.plans} plans")

    planned = make_plans(recipe, ship, folder, jobs, count)
    tick(0, recipe.n_timesteps, "imitating the plans")
    error = imitate(model, demonstrate(recipe, ship, planned))
    model.logger.record("imitation/mean_squared_error", error)


def evaluation_schedule(recipe: Recipe) -> tuple[int, int]:
    """Return the number of parts of a training, and the steps of each part: whole rollouts."""
    rollout = recipe.n_envs
    if recipe.algorithm == "ppo":
        rollout *= int(recipe.hyperparameters.get("n_steps", 2048))
    parts = max(min(recipe.evaluations, recipe.n_timesteps // rollout), 1)
    return parts, max(round(recipe.n_timesteps / parts / rollout), 1) * rollout


def about_training(recipe: Recipe, seed: int, ship: str, batch: Batch) -> dict[str, Any]:
    """Return the description of a policy for its file; ``batch`` is that of the training."""
    return {
        "layout": layout(batch),
        "ship_source": ship,
        "control_interval_s": batch.interval_s,
        "recipe": recipe.model_dump(),
        "seed": seed,
        "commit": git_commit(),
        "torch": torch.__version__.split("+")[0],
    }


def reference(recipe: Recipe, ship: str, threads: int | None = None) -> tuple[str, float]:
    """Return the name and the reward of the controller with which a policy of a recipe is compared.

    It is the base controller of a residual, and otherwise the tuned controller of the task, in the
    episodes of the evaluations.
    """
    task, interval = get_task(recipe.task), DEFAULTS.control_interval_s
    base = recipe.settings.base_controller
    name = base or tuned_controller(recipe.task)
    if task.steered and "+" not in name:
        name = f"{task.helmsman}+{name}"
    controller = controller_for(task, name, task.load_ship(ship), interval, task.steered)
    words = f"the base controller {name}" if base else f"the tuned classic controller {name}"
    if ship != task.vessel and not base:
        words += f" (tuned on {task.vessel})"
    return words, evaluate_policy(controller, recipe, ship, threads)["reward"]


def evaluate_policy(
    policy: Predictor,
    recipe: Recipe,
    ship: str,
    threads: int | None,
    first_sea: int = FIRST_EVALUATION_SEED,
) -> dict[str, float]:
    """Return interquartile means of KPIs over episodes of the task that training does not draw.

    ``first_sea`` is the seed of the first episode.
    """
    environment = {"sea": "task", "observer": DEFAULTS.observer} | {
        key: value for key, value in recipe.env_kwargs.items() if key not in INTERFACE
    }
    steps = environment.pop("max_episode_steps", None) or DEFAULTS.max_episode_steps or 1
    setting = Setting(
        "policy",
        recipe.task,
        seeds=EVALUATION_EPISODES,
        ship=ship,
        episode_s=steps * DEFAULTS.control_interval_s,
        **environment,
    )
    kpis, _ = run_episodes(setting, policy, first_seed=first_sea, threads=threads)
    return {name: float(interquartile_mean(kpis[name])) for name in _SHOWN if name != "failed"} | {
        "failed": float(kpis["failed"].mean())
    }


def weights_digest(path: Path) -> str:
    """Return the hash of the weights of a policy file, which does not depend on the time of training."""
    found = hashlib.sha256()
    for name, array in sorted(read_archive(path).items()):
        if name != "about":
            found.update(array.tobytes())
    return found.hexdigest()
