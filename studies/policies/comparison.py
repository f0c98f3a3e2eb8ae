"""Learned policies against classic controllers on seas that training never draws, seed by seed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ...agents.evaluation.controllers import version_of
from ...agents.evaluation.episodes import Setting
from ...agents.evaluation.kpis import KPIS
from ...agents.evaluation.statistics import interquartile_mean, with_interval
from ...agents.evaluation.sweeps import episodes
from ...agents.policy.policy import Policy, load_policy
from ...baselines.combinator import combinator_curve
from ...baselines.controller import Controller
from ...baselines.registry import make_controller
from ...baselines.steady_points import steady_point
from ...envs import DEFAULTS
from ...envs.tasks import HELD_OUT, get_task
from ...plant import Ship

BASELINES = {
    "transit": ("combinator", "cpp-optimiser", "speed-pilot"),
    "speed-keeping": ("combinator", "cpp-optimiser", "speed-pilot"),
    "storm": ("combinator", "anti-spin", "no-anti-spin", "cpp-optimiser", "speed-pilot"),
}
"""What a policy must beat, by task; the speed pilot is what a policy does that says nothing."""

POLICY = "policy"
FIRST_SEED = 900_000
OBSERVER = DEFAULTS.observer
ALL = "all"
"""In the place of a sea: the mean over the held-out seas, taken seed by seed."""

FUEL, EVEN_FUEL = "fuel_kg_nmi", "fuel_even_kg_nmi"
QUANTITIES = {
    FUEL: KPIS[FUEL],
    EVEN_FUEL: "the same at the ordered speed, approximately [kg]",
    **{
        name: KPIS[name]
        for name in (
            "speed_error_rms_m_s", "speed_mean_m_s", "torque_sd_kN_m", "torque_peak_kN_m",
            "rack_travel_mm_min", "overload_s", "overspeed_s", "shaft_speed_peak_rad_s",
            "cavitation_s", "ventilation_s", "thrust_mean_kN", "power_peak_kW", "failed", "reward",
        )
    },
}  # fmt: skip
"""What is compared, by column."""

RARE = ("overload_s", "overspeed_s", "failed")
"""Judged by the mean: the interquartile mean does not see what fewer than a quarter of episodes have."""


@dataclass(frozen=True)
class Comparison:
    """The episodes of one task.

    Args:
        task: name.
        policy: that is compared.
        source: its file.
        ship: as the task has it.
        seas: held out.
        kpis: by controller and sea, one row a seed, columns :data:`QUANTITIES`; equal rows met equal
            seas, orders and resistances.
        traces: the first seed's episode, alike.
        seeds: episodes a sea.
        episode_s: their length [s].
        exponent: of speed in the fuel per mile, by which it is carried to equal speed.
    """

    task: str
    policy: Policy
    source: Path
    ship: Ship
    seas: tuple[str, ...]
    kpis: dict[tuple[str, str], pd.DataFrame]
    traces: dict[tuple[str, str], pd.DataFrame]
    seeds: int
    episode_s: float
    exponent: float

    @property
    def controllers(self) -> list[str]:
        """The policy, then what it is held against."""
        return list(dict.fromkeys(controller for controller, _ in self.kpis))

    def of(self, controller: str, sea: str) -> pd.DataFrame:
        """KPIs, one row a seed; of :data:`ALL` seas their mean."""
        if sea != ALL:
            return self.kpis[controller, sea]
        tables = [self.kpis[controller, one].to_numpy(np.float64) for one in self.seas]
        return pd.DataFrame(np.mean(tables, axis=0), columns=list(QUANTITIES))


class Difference(NamedTuple):
    """Policy minus baseline in one quantity: statistic of the differences over the seeds."""

    task: str
    baseline: str
    sea: str
    quantity: str
    statistic: str
    difference: float
    low: float
    high: float
    percent: float  # of the baseline's own statistic; nan where that is zero
    percent_low: float
    percent_high: float
    excludes_zero: bool


def with_even_fuel(kpis: pd.DataFrame, exponent: float) -> pd.DataFrame:
    """The quantities compared, with the fuel per mile carried to the ordered speed by a power of it."""
    ordered = kpis["speed_mean_m_s"] + kpis["speed_short_m_s"]
    even = kpis[FUEL] * (ordered / kpis["speed_mean_m_s"].clip(lower=0.1)) ** exponent
    return kpis.assign(**{EVEN_FUEL: even})[list(QUANTITIES)]


def speed_exponent(ship: Ship, slow: float, fast: float) -> float:
    """Exponent of speed in the fuel per mile between two speeds [m/s] on the combinator's curve."""
    curve = combinator_curve(ship)
    points = [
        steady_point(ship, *(float(np.interp(v, curve.ship_speed, c))
                             for c in (curve.shaft_speed, curve.pitch_ratio)))
        for v in (slow, fast)
    ]  # fmt: skip
    per_mile = [point.fuel_flow / point.ship_speed for point in points]
    ratio = points[1].ship_speed / points[0].ship_speed
    return float(np.log(per_mile[1] / per_mile[0]) / np.log(ratio))


def compare(
    task: str,
    source: Path,
    folder: Path,
    *,
    seeds: int = 100,
    episode_s: float = 300.0,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Comparison:
    """Sail a policy and its baselines through the held-out seas of a task.

    Args:
        task: name.
        source: policy file.
        folder: for the cells; those that stand there are not sailed again.
        seeds: episodes a sea, the same for every controller.
        episode_s: length of an episode [s].
        jobs: see :func:`shaftline.core.sweep.sweep`.
        tick: called after each cell.

    Raises:
        PolicyError: not a policy, or one of another ship.
        SweepError: cells whose controller raised.
    """
    apart = f"{task}:{HELD_OUT}"
    model = get_task(apart)
    ship = model.sailed()
    policy = load_policy(source, ship)
    # the cells of one set of weights must not be taken for those of the next
    own = f"{POLICY} {version_of(source)}"
    names = {own: POLICY} | {name: name for name in BASELINES[task]}
    settings = [
        Setting(name, apart, sea, OBSERVER, seeds, episode_s=episode_s, first_seed=FIRST_SEED)
        for name in names
        for sea in model.presets
    ]
    make = functools.partial(_made, own, policy, ship)
    found = episodes(settings, make, folder, jobs=jobs, tick=tick)
    keys = [(names[setting.controller], setting.sea) for setting in settings]
    exponent = speed_exponent(ship, *model.speed_order_m_s)
    kpis = {key: with_even_fuel(one.kpis, exponent) for key, one in zip(keys, found, strict=True)}
    traces = {key: one.trace for key, one in zip(keys, found, strict=True)}
    return Comparison(
        task, policy, source, ship, model.presets, kpis, traces, seeds, episode_s, exponent
    )


def _made(own: str, policy: Policy, ship: Ship, setting: Setting) -> Controller:
    if setting.controller == own:
        return policy
    return make_controller(setting.controller, ship, policy.adapter.interval_s)


def middle_of(quantity: str, values: Any) -> tuple[float, float, float]:
    """Interquartile mean and 95 % interval; of ``failed`` the plain mean, being a share."""
    return with_interval(values, statistic=np.mean if quantity == "failed" else interquartile_mean)


def table_of(comparison: Comparison) -> pd.DataFrame:
    """One row a controller and sea: every quantity with ``_low`` and ``_high``."""
    rows = []
    for controller in comparison.controllers:
        for sea in dict.fromkeys((*comparison.seas, ALL)):
            row: dict[str, Any] = {"task": comparison.task, "controller": controller, "sea": sea}
            kpis = comparison.of(controller, sea)
            for name in QUANTITIES:
                middle, low, high = middle_of(name, kpis[name])
                row |= {name: middle, f"{name}_low": low, f"{name}_high": high}
            rows.append(row)
    return pd.DataFrame(rows)


def difference(
    task: str, baseline: str, sea: str, quantity: str, own: Any, other: Any
) -> Difference:
    """Paired difference of two samples whose equal entries are equal seeds, shape (n,) each."""
    by_mean = quantity in RARE
    statistic: Any = np.mean if by_mean else interquartile_mean
    found = with_interval(np.asarray(own) - np.asarray(other), statistic=statistic)
    middle, low, high = found
    base = abs(float(statistic(np.asarray(other, dtype=np.float64))))
    to_percent = 100.0 / base if base > 0.0 else float("nan")
    return Difference(
        task, baseline, sea, quantity, "mean" if by_mean else "IQM", middle, low, high,
        to_percent * middle, to_percent * low, to_percent * high, low > 0.0 or high < 0.0,
    )  # fmt: skip


def differences(comparison: Comparison) -> list[Difference]:
    """Policy minus each baseline, in each sea and over all of them."""
    return [
        difference(comparison.task, baseline, sea, name,
                   comparison.of(POLICY, sea)[name], comparison.of(baseline, sea)[name])
        for baseline in comparison.controllers
        if baseline != POLICY
        for sea in (*comparison.seas, ALL)
        for name in QUANTITIES
    ]  # fmt: skip


def frame(found: Iterable[Difference]) -> pd.DataFrame:
    """As a table, one row a difference."""
    return pd.DataFrame(list(found), columns=list(Difference._fields))
