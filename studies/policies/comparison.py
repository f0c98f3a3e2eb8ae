"""Learned policies against classic controllers on seas that training never draws, seed by seed.

A recipe is judged, not a policy: all its trainings that are given sail the same episodes, and intervals
are over trainings and episodes together.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...agents.evaluation.controllers import label, load_controller
from ...agents.evaluation.episodes import Setting
from ...agents.evaluation.kpis import KPIS
from ...agents.evaluation.statistics import middle_of_runs, relative_to
from ...agents.evaluation.sweeps import Episodes, episodes
from ...agents.policy.policy import Policy, PolicyError, load_policy
from ...baselines.controller import Controller
from ...envs import DEFAULTS
from ...envs.settings import EPISODE_S
from ...envs.tasks import HELD_OUT, get_task

HELD, VA_PITCH = "combinator-trimmed", "va-pitch"
BASELINES = ("combinator", HELD, "cpp-optimiser", "anti-spin", "speed-pilot", VA_PITCH)
"""What a policy is held against, beside the law that it is added to (:data:`TUNED`). The plain
combinator and the optimiser sail slower in waves than is ordered, which alone calms the shaft; the
trimmed one holds the speed as the policies do."""

POLICY, TUNED = "policy", "tuned law"
FIRST_SEED = 900_000
OBSERVER = DEFAULTS.observer
SHOWN = (
    "wave_torque_kN_m", "wave_engine_torque_kN_m", "wave_power_kW", "power_peak_kW",
    "wave_attack_deg", "attack_99_deg", "outside_bucket_s", "overload_s", "limit_s", "speed_mean_m_s",
    "speed_error_rms_m_s", "rise_s", "fuel_kg_nmi", "pitch_travel_min", "rack_travel_mm_min",
    "failed", "reward",
)  # fmt: skip
"""What is compared, by column of the KPIs."""


class Difference(NamedTuple):
    """Policy minus baseline in one quantity, in percent of the baseline, with its 95 % interval."""

    task: str
    baseline: str
    quantity: str
    percent: float
    percent_low: float
    percent_high: float


@dataclass(frozen=True)
class Comparison:
    """The episodes of one task.

    Args:
        task: name.
        policies: one a training.
        sources: their files.
        kpis: by controller, shape (r, e) a column of :data:`SHOWN`: r trainings of the policy, 1 of the
            others; equal columns met equal seas, orders and resistances.
        traces: of each controller its first episode; of the policy the first training's.
        seeds: episodes.
        episode_s: their length [s].
    """

    task: str
    policies: list[Policy]
    sources: list[Path]
    kpis: dict[str, dict[str, NDArray[np.float64]]]
    traces: dict[str, pd.DataFrame]
    seeds: int
    episode_s: float

    @functools.cached_property
    def table(self) -> pd.DataFrame:
        """One row a controller: every quantity with ``_low`` and ``_high``."""
        rows = []
        for controller, kpis in self.kpis.items():
            row: dict[str, object] = {"task": self.task, "controller": controller}
            for name in SHOWN:
                middle, low, high = middle_of_runs(kpis[name])
                least = -math.inf if name == "reward" else 0.0  # the others cannot be negative
                row[name], row[f"{name}_low"], row[f"{name}_high"] = middle, max(low, least), high
            rows.append(row)
        return pd.DataFrame(rows)

    @functools.cached_property
    def differences(self) -> list[Difference]:
        """Policy minus each baseline in every quantity."""
        own = self.kpis[POLICY]
        return [
            Difference(self.task, name, quantity, *relative_to(own[quantity], kpis[quantity][0]))
            for name, kpis in self.kpis.items()
            if name != POLICY
            for quantity in SHOWN
        ]


def compare(
    task: str,
    sources: Sequence[Path],
    folder: Path,
    *,
    seeds: int = 60,
    episode_s: float = EPISODE_S,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Comparison:
    """Sail policies of one task and their baselines through its held-out seas.

    Args:
        task: name.
        sources: policy files, one a training.
        folder: for the cells; those that stand there are not sailed again.
        seeds: episodes, the same for every controller.
        episode_s: length of an episode [s].
        jobs: see :func:`shaftline.core.sweep.sweep`.
        tick: called after each cell.

    Raises:
        PolicyError: not a policy, one of another ship, or policies on different bases.
        SweepError: cells whose controller raised.
    """
    policies = [load_policy(source) for source in sources]
    laws = sorted({policy.adapter.form.base for policy in policies})
    if len(laws) > 1:
        raise PolicyError(f"{task}: trainings of different bases: {' and '.join(laws)}")
    classic = dict(zip((*BASELINES, TUNED), (*BASELINES, laws[0]), strict=True))
    texts = {label(text): text for text in (*(f"policy:{s}" for s in sources), *classic.values())}
    apart = f"{task}:{HELD_OUT}"
    settings = [
        Setting(name, apart, "task", OBSERVER, seeds, episode_s=episode_s, first_seed=FIRST_SEED)
        for name in texts
    ]
    made = functools.partial(_made, texts, policies[0].interval_s)
    cells = episodes(settings, made, folder, jobs=jobs, tick=tick)
    found = dict(zip(texts, cells, strict=True))
    runs = cells[: len(sources)]
    rest = {name: found[text] for name, text in classic.items()}
    kpis = {POLICY: _stacked(runs)} | {name: _stacked([one]) for name, one in rest.items()}
    traces = {POLICY: runs[0].trace} | {name: one.trace for name, one in rest.items()}
    return Comparison(task, policies, list(sources), kpis, traces, seeds, episode_s)


def _made(texts: dict[str, str], interval_s: float, setting: Setting) -> Controller:
    return load_controller(texts[setting.controller], get_task(setting.task).sailed(), interval_s)


def _stacked(found: Sequence[Episodes]) -> dict[str, NDArray[np.float64]]:
    return {name: np.array([one.kpis[name] for one in found], dtype=np.float64) for name in SHOWN}


MEANINGS = {name: KPIS[name] for name in SHOWN}
"""What each quantity is, in words."""
