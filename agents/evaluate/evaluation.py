"""Any controller on any task, on paired seas, in figures that an engineer asks for."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ...baselines.controller import Controller, readings
from ...core.sweep import source_digest, sweep
from ...envs import DEFAULTS, FrigateVectorEnv
from ...envs.records import TRUTHS
from ...envs.tasks import Task
from ...plant import load_ship
from .episode_sums import EpisodeSums

KPIS = {
    "fuel_kg_nmi": "fuel per nautical mile [kg]",
    "speed_error_rms_m_s": "rms of ship speed minus order [m/s]",
    "speed_mean_m_s": "distance over time [m/s]",
    "speed_short_m_s": "mean of order minus ship speed [m/s]",
    "torque_sd_kN_m": "standard deviation of the shaft torque [kN m]",
    "torque_peak_kN_m": "highest shaft torque [kN m]",
    "rack_travel_mm_min": "travel of the rack command [mm/min]",
    "overload_s": "time beyond the engine's envelope [s]",
    "shaft_speed_peak_rad_s": "highest shaft speed [rad/s]",
    "overspeed_s": "time beyond the engine's highest speed [s]",
    "cavitation_s": "time beyond Burrill's limit [s]",
    "ventilation_s": "time ventilating [s]",
    "thrust_mean_kN": "mean thrust of one propeller [kN]",
    "power_mean_kW": "mean brake power of one engine [kW]",
    "power_peak_kW": "highest brake power of one engine [kW]",
    "failed": "episodes that stalled or tripped [share]",
    "reward": "sum of rewards",
}
"""Key performance indicators of an episode, by column."""


@dataclass(frozen=True)
class Setting:
    """One cell of an evaluation.

    Args:
        task_model: the task itself, where it is not the one that ``task`` names.
        first_seed: seeds run from here.
    """

    controller: str
    task: str
    sea: str
    observer: str
    seeds: int
    ship: str = DEFAULTS.ship
    episode_s: float = DEFAULTS.episode_s
    sensor_noise: Any = DEFAULTS.sensor_noise
    task_model: Task | None = None
    first_seed: int = 0

    @property
    def name(self) -> str:
        """File name of the cell; differs where any field differs."""
        fields = asdict(self)
        del fields["task_model"]  # of a single run; no cell has one
        text = "_".join(map(str, fields.values()))
        return "".join(c if c.isalnum() or c in "-._" else "-" for c in text)


def run(
    setting: Setting,
    controller: Controller,
    first_seed: int | None = None,
    threads: int | None = None,
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Sail one episode a seed.

    Args:
        setting: task, sea, observer and so on; ``sea`` ``task`` leaves the choice to the task.
        controller: with ``predict``.
        first_seed: in place of the setting's; equal seeds meet equal seas whatever the controller.
        threads: that step the episodes; the machine's cores by default. They change no figure.

    Returns:
        KPIs, one row a seed; and the first seed's episode, shape (intervals, 4 + 9 + 2): time [s],
        order [m/s], pitch ratio, rack [mm], the environment's ``TRUTHS``, estimate and its validity.
    """
    env = FrigateVectorEnv(
        setting.seeds,
        threads=threads,
        ship=setting.ship,
        task=setting.task_model or setting.task,
        sea=None if setting.sea == "task" else setting.sea,
        observer=setting.observer,
        sensor_noise=setting.sensor_noise,
        episode_s=setting.episode_s,
    )
    interval = env.batch.interval_s
    gear = env.batch.ship.transmission.gear_ratio
    observation, _ = env.reset(seed=setting.first_seed if first_seed is None else first_seed)
    sums = EpisodeSums(setting.seeds)
    alive = np.ones(setting.seeds, dtype=bool)
    starting = alive.copy()
    state: Any = None
    trace: list[list[float]] = []
    order = readings(observation).speed_order
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        sums.add(alive, info, reward, order, interval, gear)
        if alive[0]:
            last = info["final_obs"][0] if terminated[0] or truncated[0] else observation[0]
            seen = readings(last)
            truth = [float(info[name][0]) for name in TRUTHS]
            trace.append(
                [len(trace) * interval, order[0], seen.pitch_ratio[0], seen.fuel_rack[0], *truth,
                 seen.advance_velocity[0], seen.estimate_valid[0]]
            )  # fmt: skip
        sums.failed |= alive & terminated
        starting = terminated | truncated
        alive &= ~starting
        order = readings(observation).speed_order
    env.close()
    return sums.kpis(interval), np.array(trace, dtype=np.float64)


TRACE = ("time", "speed_order", "pitch_ratio", "fuel_rack", *TRUTHS, "estimate", "valid")
"""Columns of an episode's trace."""

_KPI_SOURCES = ("agents/evaluate/evaluation.py", "agents/evaluate/episode_sums.py")


def interquartile_mean(values: Any, axis: int = -1) -> Any:
    """Mean of the middle half (Agarwal et al. 2021) along an axis."""
    return stats.trim_mean(np.asarray(values, dtype=np.float64), 0.25, axis=axis)


def with_interval(
    values: Any, seed: int = 0, statistic: Callable[..., Any] = interquartile_mean
) -> tuple[float, float, float]:
    """Interquartile mean, or another statistic, with its 95 % percentile bootstrap interval."""
    sample = np.asarray(values, dtype=np.float64)
    middle = float(statistic(sample))
    if len(sample) < 3 or np.ptp(sample) == 0.0:
        return middle, middle, middle
    found = stats.bootstrap(
        (sample,),
        statistic,
        n_resamples=1000,
        method="percentile",
        rng=np.random.default_rng(seed),
        vectorized=True,
    ).confidence_interval
    return middle, float(found.low), float(found.high)


def summary(kpis: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Each KPI's interquartile mean and 95 % interval; ``failed`` is a plain mean."""
    found = {name: with_interval(kpis[name]) for name in KPIS if name != "failed"}
    share = float(kpis["failed"].mean())
    return {**found, "failed": (share, share, share)}


class Evaluation(NamedTuple):
    """What :func:`evaluate` found."""

    table: pd.DataFrame
    """One row a cell: its fields, then each KPI with ``_low`` and ``_high``."""
    traces: list[pd.DataFrame]
    """Of each cell its first episode, with columns :data:`TRACE`, to six digits."""


class Episodes(NamedTuple):
    """What is kept of a cell."""

    kpis: pd.DataFrame
    """One row a seed, columns :data:`KPIS`."""
    trace: pd.DataFrame
    """The first seed's episode, columns :data:`TRACE`, to six digits."""


def evaluate(
    settings: Sequence[Setting],
    make: Callable[[Setting], Controller],
    folder: Path,
    **spread: Any,
) -> Evaluation:
    """Sail every setting and sum it up; arguments as of :func:`episodes`."""
    found = episodes(settings, make, folder, **spread)
    rows = []
    for setting, kept in zip(settings, found, strict=True):
        row: dict[str, Any] = asdict(setting)
        del row["task_model"]  # no cell of a table
        for name, (middle, low, high) in summary(kept.kpis).items():
            row |= {name: middle, f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    return Evaluation(pd.DataFrame(rows), [kept.trace for kept in found])


def episodes(
    settings: Sequence[Setting],
    make: Callable[[Setting], Controller],
    folder: Path,
    *,
    jobs: int | None = None,
    backend: str = "processes",
    scheduler: str | None = None,
    tick: Callable[[], None] = lambda: None,
) -> list[Episodes]:
    """Sail every setting; cells that already stand in the folder are not sailed again.

    Args:
        settings: cells, each once.
        make: controller of a cell; travels to the other processes and is called there.
        folder: cells are kept in ``folder/cells`` as JSON. A cell's name tells its setting, its ship
            and the version of the equations: where one of them changes, the cell is sailed anew.
        jobs: see :func:`shaftline.core.sweep.sweep`, as for the backend and the scheduler.
        backend: ``processes`` or ``dask``.
        scheduler: address of a dask scheduler.
        tick: called after each cell.

    Raises:
        SweepError: cells whose controller raised, or a backend that is not there.
    """
    alone = backend == "processes" and (jobs == 1 or len(settings) == 1)
    work = functools.partial(_sail, make, None if alone else 1)
    cells = {f"{setting.name}_{_version(setting.ship)}": setting for setting in settings}
    found = sweep(
        work, cells, folder / "cells", jobs=jobs, backend=backend, scheduler=scheduler, tick=tick
    )
    return [
        Episodes(pd.DataFrame(kept["kpis"]), pd.DataFrame(kept["trace"])) for kept in found.values()
    ]


def _sail(
    make: Callable[[Setting], Controller], threads: int | None, setting: Setting
) -> dict[str, Any]:
    """A cell as it is kept; with one thread where other processes take the other cores."""
    kpis, trace = run(setting, make(setting), threads=threads)
    return {
        "setting": asdict(setting),
        "kpis": kpis.to_dict(orient="list"),
        "trace": {
            name: [float(f"{value:.6g}") for value in column]
            for name, column in zip(TRACE, trace.T, strict=True)
        },
    }


@functools.cache
def _version(ship: str) -> str:
    """Eight letters that change with the ship and with the source that cells are made by."""
    source = source_digest("plant", "observers", "baselines", "envs", *_KPI_SOURCES)
    return hashlib.sha256(f"{source} {load_ship(ship)!r}".encode()).hexdigest()[:8]
