"""Augmented Kalman filter on the falling body and the frigate: results, tables and page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, TRUTH, new_figure

from ..cells import Cell
from ..pages import fill_template
from . import falling_body, frigate
from .falling_body import LIMITS

TITLE = "Augmented Kalman filter: parameters of a falling body and of a fouling frigate"
BETAS = (3000.0, 2000.0)  # lb/ft2
FALLS = {
    "exact measurements": (0.05, 0.0, 1),
    "noise of 10 ft, ten a second": (0.1, 10.0, 40),
    "noise of 10 ft, a hundred a second": (0.01, 10.0, 4),
}
"""Interval of the measurements [s], their noise [ft] and number of seeds, by name."""

COMPARED = "noise of 10 ft, ten a second"
"""Measurements that are compared with the thesis, in which the position is measured with noise."""

WORDS = dict(
    zip(
        LIMITS,
        (
            "very accurately",
            "does not change much initially",
            "converges as the object enters the dense atmosphere",
            "converges to the true value and remains there",
        ),
        strict=True,
    )
)
"""Words of the thesis on figure A-2, by quantity of :data:`.falling_body.LIMITS`."""

TICKS = len(BETAS) * len(FALLS) + len(frigate.SEAS) * (len(frigate.SEEDS) + 1)


class Results(NamedTuple):
    """Results of the falling body and the frigate."""

    falls: (
        pd.DataFrame
    )  # a row for each truth and kind of measurement: median over the seeds, and worst
    fall: dict[float, pd.DataFrame]  # one fall of each truth, for the figure
    identified: pd.DataFrame  # parameters of the frigate from recordings
    growth: dict[str, pd.DataFrame]  # growing fouling by sea
    velocity: dict[str, dict[str, float]]  # rms errors [m/s] by sea and observer
    friction: dict[str, tuple[float, float]]  # on line, by sea


def compute_results(tick: Callable[[], None]) -> Results:
    """Return all results; takes about two minutes."""
    rows = []
    for beta in BETAS:
        for name, (update_s, noise, seeds) in FALLS.items():
            falls = [falling_body.simulate_fall(beta, k, update_s, noise) for k in range(seeds)]
            errors = np.array([falling_body.largest_errors(fall, beta) for fall in falls])
            for quantity, values in zip(LIMITS, errors.T, strict=True):
                rows.append(
                    {"beta": beta, "readings": name, "quantity": quantity, "seeds": seeds,
                     "median": np.median(values), "worst": values.max()}
                )  # fmt: skip
            tick()
    fall = {beta: falling_body.simulate_fall(beta, 0) for beta in BETAS}
    identified = frigate.estimate_from_recordings(tick)
    growth, velocity, friction = {}, {}, {}
    for sea in frigate.SEAS:
        growth[sea], velocity[sea] = frigate.follow_growth(sea, 1)
        friction[sea] = frigate.estimate_friction_online(sea, 1)
        tick()
    return Results(pd.DataFrame(rows), fall, identified, growth, velocity, friction)


def cells_of(results: Results) -> list[Cell]:
    """Return the sentences on figure A-2 with ours, the median of the seeds."""
    falls = results.falls[results.falls["readings"] == COMPARED]
    return [
        Cell(f"Figure A-2, {line.quantity}", f"true beta {line.beta:g}", "", float(line.median), 0.0,
             LIMITS[line.quantity], "our limit for the words, which name no number",
             words=WORDS[line.quantity])
        for line in falls.itertuples()
    ]  # fmt: skip


def fall_table(results: Results) -> pd.DataFrame:
    """Return the limits of the falling body, and medians with the worst seed in parentheses."""
    limits = {"true beta": "", "measurements": "limit", "seeds": ""}
    limits |= {q: f"{100 * x:g} %" if q.endswith("within") else f"{x:g}" for q, x in LIMITS.items()}
    rows = []
    for (beta, readings), own in results.falls.groupby(["beta", "readings"], sort=False):
        seeds = own["seeds"].iloc[0]
        row = {"true beta": f"{beta:g}", "measurements": readings, "seeds": str(seeds)}
        for found in own.itertuples():
            scale, unit = (100.0, " %") if found.quantity.endswith("within") else (1.0, "")
            text = f"{scale * found.median:.2g}{unit}"
            row[found.quantity] = text + (f" ({scale * found.worst:.2g})" if seeds > 1 else "")
        rows.append(row)
    return pd.DataFrame([limits, *rows])


def identified_table(results: Results) -> pd.DataFrame:
    """Return the rms errors of the frigate's parameters over the seeds, and their standard errors."""
    rows = []
    for (sea, key), own in results.identified.groupby(["sea", "key"], sort=False):
        error = own["found"] - own["truth"]
        rows.append(
            {
                "sea": sea,
                "key": key,
                "truth": f"{own['truth'].iloc[0]:g}",
                "mean estimate": f"{own['found'].mean():.5g}",
                "rms error": f"{np.sqrt(np.mean(error**2)):.2g}",
                "standard error of the filter": f"{own['own error'].mean():.2g}",
                "reported, with tolerances": f"{own['standard error'].mean():.2g}",
            }
        )
    return pd.DataFrame(rows)


def growth_table(results: Results) -> pd.DataFrame:
    """Return the errors of the growing fouling by sea and estimator."""
    rows = []
    for sea, own in results.growth.items():
        later = own[own["time_s"] > 900.0]
        growing = later[(later["time_s"] > 2400.0) & (later["time_s"] < 5400.0)]
        for name in ("observer", "observer, torque meter 1 % off", "filter"):
            error = later[name] - later["truth"]
            rows.append(
                {
                    "sea": sea,
                    "estimator": name,
                    "rms error": float(np.sqrt(np.mean(error**2))),
                    "largest error": float(error.abs().max()),
                    "mean error during growth": float((growing[name] - growing["truth"]).mean()),
                }
            )
    return pd.DataFrame(rows)


def body(results: Results) -> str:
    """Return the page below its title."""
    return fill_template(
        Path(__file__).with_name("page.md"), falls=fall_table(results), results=results,
        assumed=falling_body.ASSUMED_BETA, identified=identified_table(results),
        growth=growth_table(results), friction=frigate.CONCEALED[frigate.FRICTION],
        seconds=frigate.SECONDS, seeds=len(frigate.SEEDS), fouling=frigate.CONCEALED[frigate.FOULING],
    )  # fmt: skip


def figure(results: Results) -> Figure:
    """Draw beta, and the fouling in calm water and at sea."""
    drawn, axes = new_figure(1, 3, (13.0, 4.0))
    axis = axes[0, 0]
    for colour, (beta, fall) in zip(PALETTE, results.fall.items(), strict=False):
        axis.plot(fall["time_s"], fall["beta"], color=colour, label=f"estimate, truth {beta:g}")
        axis.fill_between(
            fall["time_s"], fall["beta"] - 2.0 * fall["beta_sd"],
            fall["beta"] + 2.0 * fall["beta_sd"], color=colour, alpha=0.15,
        )  # fmt: skip
        axis.axhline(beta, color=TRUTH, linewidth=0.8, linestyle=":")
    axis.set(title="Falling body: beta [lb/ft2], 2 sd", xlabel="time [s]", ylim=(1200.0, 3800.0))
    axis.legend(fontsize=8)
    for axis, (sea, own) in zip(axes[0, 1:], results.growth.items(), strict=True):
        hours = own["time_s"] / 3600.0
        for colour, name in zip(PALETTE, ("observer", "filter"), strict=False):
            axis.plot(hours, own[name], color=colour, label=f"{name}, 2 sd")
            low, high = (own[name] + side * own[f"{name} sd"] for side in (-2.0, 2.0))
            axis.fill_between(hours, low, high, color=colour, alpha=0.15)
        name = "observer, torque meter 1 % off"
        axis.plot(hours, own[name], color=PALETTE[2], linewidth=1.0, label=name)
        axis.plot(hours, own["truth"], color=TRUTH, linestyle="--", label="truth")
        axis.set(title=f"Frigate: fouling, sea {sea}", xlabel="time [h]", ylim=(-0.1, 0.3))
        axis.legend(fontsize=8)
    return drawn
