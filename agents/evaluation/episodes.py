"""Any controller on any task, in figures that an engineer asks for: one episode a seed.

Controllers by name: the classic ones, and policies from their files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...baselines import ControllerError, controller_names, make_controller
from ...baselines.controller import OBSERVED, Predictor, readings
from ...baselines.registry import CONTROLLERS, joined_names, read_options
from ...core.discovery import version_of_others
from ...core.sweep import digest_of, source_digest
from ...envs import CLASSIC, DEFAULTS, FrigateVectorEnv
from ...envs.records import TRUTHS
from ...envs.settings import EPISODE_S
from ...envs.steering import kinds
from ...envs.tasks import Task, controller_for, get_task
from ...plant import Ship
from ..policy.policy import PolicyError, load_policy, trained
from .kpis import EpisodeSums

_LONGEST = 160


@dataclass(frozen=True)
class Setting:
    """One cell of an evaluation.

    Args:
        controller: as it is called in tables.
        task: name; ``NAME:held-out`` for the seas that its training never draws.
        sea: ``task`` for those of the task, or anything that the environment's ``sea`` takes.
        observer: name.
        seeds: episodes, one a seed.
        ship: preset or path; the one that the task is made for by default.
        episode_s: length of an episode [s].
        sensor_noise: factor on the usual instruments', or rms by instrument [its unit].
        task_model: the task itself, where it is not the one that ``task`` names.
        first_seed: seeds run from here.
        randomise: half width of a uniform factor by dotted key of the ship's file: the sailed ship
            has it, observer and controller do not know.
        tuning: of the observer, its default where None.
    """

    controller: str
    task: str
    sea: Any
    observer: str
    seeds: int
    ship: str | None = None
    episode_s: float = EPISODE_S
    sensor_noise: Any = DEFAULTS.sensor_noise
    task_model: Task | None = None
    first_seed: int = 0
    randomise: Mapping[str, float] | None = None
    tuning: str | None = None

    @property
    def vessel(self) -> str:
        """The ship that sails: preset or path."""
        return self.ship or (self.task_model or get_task(self.task)).vessel

    @property
    def columns(self) -> dict[str, Any]:
        """Its fields as a table has them: with the ship that sails, and no task of a single run."""
        fields = asdict(self) | {"ship": self.vessel}
        del fields["task_model"]
        for name in ("randomise", "tuning"):
            if fields[name] is None:
                del fields[name]
        return fields

    @property
    def name(self) -> str:
        """File name of the cell; differs where any field differs.

        A long one is cut, with a digest of all behind it: file systems take 255 letters.
        """
        text = "_".join(map(str, self.columns.values()))
        if len(text) > _LONGEST:
            text = f"{text[:_LONGEST]}_{digest_of(text)}"
        return "".join(c if c.isalnum() or c in "-._" else "-" for c in text)


def run_episodes(
    setting: Setting,
    controller: Predictor,
    first_seed: int | None = None,
    threads: int | None = None,
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Sail one episode a seed.

    Args:
        setting: task, sea, observer and so on; ``sea`` ``task`` leaves the choice to the task.
        controller: with ``predict``; its ``interface`` holds the keywords of its environment,
            :data:`shaftline.envs.CLASSIC` where it has none.
        first_seed: in place of the setting's; equal seeds meet equal seas whatever the controller.
        threads: that step the episodes; the machine's cores by default. They change no figure.

    Returns:
        KPIs, one row a seed; and the first seed's episode, shape (intervals, 4 + 9 + 2): time [s],
        order [m/s], pitch ratio, rack [mm], the environment's ``TRUTHS``, estimate and its validity.
    """
    task = setting.task_model or get_task(setting.task)
    env = kinds(task.steered).vector(
        setting.seeds,
        threads=threads,
        ship=setting.vessel,
        task=task,
        sea=None if setting.sea == "task" else setting.sea,
        observer=setting.observer,
        sensor_noise=setting.sensor_noise,
        max_episode_steps=max(round(setting.episode_s / DEFAULTS.control_interval_s), 1),
        randomise=setting.randomise,
        tuning=setting.tuning,
        autoreset_mode="NextStep",  # the info of the last step is that of the episode that ended
        **getattr(controller, "interface", CLASSIC),
    )
    interval = env.batch.interval_s
    observation, _ = env.reset(seed=setting.first_seed if first_seed is None else first_seed)
    sums = EpisodeSums(setting.seeds, interval, env.batch.ship.transmission.gear_ratio)
    alive = np.ones(setting.seeds, dtype=bool)
    starting = alive.copy()
    state: Any = None
    trace: list[list[float]] = []
    order = _measured(env)[:, _ORDER]
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        sums.add(alive, info, reward, order)
        if alive[0]:
            seen = readings(_measured(env)[0])
            truth = [float(info[name][0]) for name in TRUTHS]
            trace.append(
                [len(trace) * interval, order[0], seen.pitch_ratio[0], seen.fuel_rack[0], *truth,
                 seen.advance_velocity[0], seen.estimate_valid[0]]
            )  # fmt: skip
        starting = terminated | truncated
        alive &= ~starting
        order = _measured(env)[:, _ORDER]
    env.close()
    return sums.kpis(), np.array(trace, dtype=np.float64)


def _measured(env: FrigateVectorEnv) -> NDArray[np.float64]:
    """Return the controllers' signals of all environments in physical units, shape (n, 8)."""
    return env.batch.signals[:, : len(OBSERVED)].astype(np.float64)


_ORDER = OBSERVED.index("speed_order")

TRACE = ("time", "speed_order", "pitch_ratio", "fuel_rack", *TRUTHS, "estimate", "valid")
"""Columns of an episode's trace."""


_POLICY = "policy"


def known() -> str:
    """What :func:`load_controller` takes, in words."""
    return f"{', '.join(controller_names())}, your own as module:Class, policy:FILE.npz" + "".join(
        f", {_POLICY}:{name}" for name in trained()
    )


def load_controller(
    text: str, ship: Ship, interval_s: float, task: Task | None = None
) -> Predictor:
    """A controller from ``NAME``, ``NAME:option=number,...`` or ``policy:FILE``.

    Args:
        text: as above; a policy's file, or the name of one that comes with the package.
        ship: the ship that it shall command.
        interval_s: control interval [s].
        task: that it is loaded for. Where that has the rudder as an action, ``HELMSMAN+NAME`` chooses
            who lays it; the task's own helmsman does otherwise.

    Raises:
        ControllerError: unknown name, or an option that the controller does not take.
        PolicyError: not a policy, or one of another version, ship, observation or interval.
    """
    kind, _, source = text.partition(":")
    if kind != _POLICY:
        steered = task is not None and task.steered
        parts = joined_names(text)
        name, _ = read_options(parts[-1])
        if (":" in name or name in controller_names()) and len(parts) <= 1 + steered:
            if task is not None:
                return controller_for(task, text, ship, interval_s, steered)
            return make_controller(text, ship, interval_s)
    if kind != _POLICY or not source:
        raise ControllerError(f"unknown controller {text!r}; known: {known()}")
    policy = load_policy(source, ship)
    own = policy.interval_s
    if abs(own - interval_s) > 1e-9:
        raise PolicyError(
            f"{source}: this policy does not fit: control_interval_s: the policy has {own:g} s, "
            f"here it is {interval_s:g} s"
        )
    return policy


def label(text: str) -> str:
    """Return a controller's name in tables and cells, for a text that :func:`load_controller` took.

    A file may hold another policy or another controller tomorrow. So a policy's name is followed by
    eight letters of its content and of the source that runs it, the name of a user's controller by eight
    letters of its source and of what that imports: results of the old one are then not used again.
    """
    kind, _, source = text.partition(":")
    if kind != _POLICY:
        propulsion = joined_names(text)[-1]
        return f"{text} {version_of_others(read_options(propulsion)[0], CONTROLLERS)}".rstrip()
    path = trained().get(source, Path(source))
    return f"{_POLICY}:{'/'.join(Path(source).parts[-2:])} {version_of(path)}"


def version_of(policy: Path) -> str:
    """Eight letters that change with a policy's file and with what turns its answers into commands."""
    code = source_digest("agents/policy")
    return hashlib.sha256(code.encode() + policy.read_bytes()).hexdigest()[:8]
