"""Any controller on any task, in figures that an engineer asks for: one episode a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...baselines.controller import OBSERVED, Predictor, readings
from ...core.sweep import digest_of
from ...envs import CLASSIC, DEFAULTS, FrigateVectorEnv
from ...envs.records import TRUTHS
from ...envs.settings import EPISODE_S
from ...envs.steering import kinds
from ...envs.tasks import Task, get_task
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
