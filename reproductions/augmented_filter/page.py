"""Augmented Kalman filter on the falling body and the frigate: results, tables and page."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, TRUTH

from ..cells import Cell
from ..pages import fill_template
from ..side_by_side import Tick
from ..writing import Line, Panel, claim, draw, rms
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

WORDS = (
    "very accurately",
    "does not change much initially",
    "converges as the object enters the dense atmosphere",
    "converges to the true value and remains there",
)
"""Words of the thesis on figure A-2, by quantity of :data:`.falling_body.LIMITS`."""

TICKS = len(BETAS) * len(FALLS) + len(frigate.SEAS) * (len(frigate.SEEDS) + 1)
BIASED = "observer, torque meter 1 % off"


class Results(NamedTuple):
    """Results of the falling body and the frigate."""

    falls: pd.DataFrame  # for each truth and kind of measurement: median over the seeds, and worst
    fall: dict[float, pd.DataFrame]  # one fall of each truth, for the figure
    identified: pd.DataFrame  # parameters of the frigate from recordings
    growth: dict[str, pd.DataFrame]  # growing fouling by sea
    velocity: dict[str, dict[str, float]]  # rms errors [m/s] by sea and observer
    friction: dict[str, tuple[float, float]]  # on line, by sea


def compute_results(tick: Tick) -> Results:
    """Return all results; takes about two minutes."""
    rows = []
    for beta in BETAS:
        for name, (update_s, noise, seeds) in FALLS.items():
            falls = [falling_body.simulate_fall(beta, k, update_s, noise) for k in range(seeds)]
            errors = np.array([falling_body.largest_errors(fall, beta) for fall in falls])
            rows += [
                {
                    "beta": beta,
                    "readings": name,
                    "quantity": quantity,
                    "seeds": seeds,
                    "median": np.median(values),
                    "worst": values.max(),
                }
                for quantity, values in zip(LIMITS, errors.T, strict=True)
            ]
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
    words, falls = dict(zip(LIMITS, WORDS, strict=True)), results.falls
    return [
        claim(
            f"Figure A-2, {line.quantity}",
            f"true beta {line.beta:g}",
            float(line.median),
            words[line.quantity],
            0.0,
            LIMITS[line.quantity],
            "our limit for the words, which name no number",
        )
        for line in falls[falls["readings"] == COMPARED].itertuples()
    ]


def fall_table(results: Results) -> pd.DataFrame:
    """Return the limits of the falling body, and medians with the worst seed in parentheses."""
    limits = {"true beta": "", "measurements": "limit", "seeds": ""}
    limits |= {q: f"{100 * x:g} %" if q.endswith("within") else f"{x:g}" for q, x in LIMITS.items()}
    rows = []
    for (beta, readings, seeds), own in results.falls.groupby(
        ["beta", "readings", "seeds"], sort=False
    ):
        row = {"true beta": f"{beta:g}", "measurements": readings, "seeds": str(seeds)}
        for found in own.itertuples():
            scale, unit = (100.0, " %") if found.quantity.endswith("within") else (1.0, "")
            text = f"{scale * found.median:.2g}{unit}"
            row[found.quantity] = text + (f" ({scale * found.worst:.2g})" if seeds > 1 else "")
        rows.append(row)
    return pd.DataFrame([limits, *rows])


def _identified_table(results: Results) -> pd.DataFrame:
    """Return the rms errors of the frigate's parameters over the seeds, and their standard errors."""
    groups = results.identified.groupby(["sea", "key"], sort=False)
    return pd.DataFrame(
        {
            "sea": sea,
            "key": key,
            "truth": f"{own['truth'].iloc[0]:g}",
            "mean estimate": f"{own['found'].mean():.5g}",
            "rms error": f"{rms(own['found'] - own['truth']):.2g}",
            "standard error of the filter": f"{own['own error'].mean():.2g}",
            "reported, with tolerances": f"{own['standard error'].mean():.2g}",
        }
        for (sea, key), own in groups
    )


def _growth_table(results: Results) -> pd.DataFrame:
    """Return the errors of the growing fouling by sea and estimator."""
    rows = []
    for sea, own in results.growth.items():
        later = own[own["time_s"] > 900.0]
        grows = later["time_s"].between(2400.0, 5400.0, inclusive="neither")
        for name in ("observer", BIASED, "filter"):
            error = later[name] - later["truth"]
            rows.append(
                {
                    "sea": sea,
                    "estimator": name,
                    "rms error": rms(error),
                    "largest error": float(error.abs().max()),
                    "mean error during growth": float(error[grows].mean()),
                }
            )
    return pd.DataFrame(rows)


def body(results: Results) -> str:
    """Return the page below its title."""
    return fill_template(
        Path(__file__).with_name("page.md"),
        falls=fall_table(results),
        results=results,
        assumed=falling_body.ASSUMED_BETA,
        identified=_identified_table(results),
        growth=_growth_table(results),
        friction=frigate.CONCEALED[frigate.FRICTION],
        seconds=frigate.SECONDS,
        seeds=len(frigate.SEEDS),
        fouling=frigate.CONCEALED[frigate.FOULING],
    )


def figure(results: Results) -> Figure:
    """Draw beta, and the fouling in calm water and at sea."""
    title = "Falling body: beta [lb/ft2], 2 sd"
    settings = {"title": title, "xlabel": "time [s]", "ylim": (1200.0, 3800.0)}
    lines, bands = [], []
    for colour, (beta, fall) in zip(PALETTE, results.fall.items(), strict=False):
        time = fall["time_s"]
        lines.append(Line(time, fall["beta"], f"estimate, truth {beta:g}", colour))
        lines.append(Line(time, np.full(len(time), beta), color=TRUTH, style=":", width=0.8))
        bands.append((0, time, fall["beta"], fall["beta_sd"], colour))
    panels = [Panel(lines, settings, 1)]
    for sea, own in results.growth.items():
        hours = own["time_s"] / 3600.0
        lines = [Line(hours, own[BIASED], BIASED, PALETTE[2])]
        lines.append(Line(hours, own["truth"], "truth", TRUTH, "--"))
        for colour, name in zip(PALETTE, ("observer", "filter"), strict=False):
            lines.append(Line(hours, own[name], f"{name}, 2 sd", colour))
            bands.append((len(panels), hours, own[name], own[f"{name} sd"], colour))
        title = f"Frigate: fouling, sea {sea}"
        settings = {"title": title, "xlabel": "time [h]", "ylim": (-0.1, 0.3)}
        panels.append(Panel(lines, settings, 1))
    drawn = draw(panels, (13.0, 4.0), len(panels))
    for k, x, middle, sd, colour in bands:
        low, high = middle - 2.0 * sd, middle + 2.0 * sd
        drawn.axes[k].fill_between(x, low, high, color=colour, alpha=0.15)
    return drawn
