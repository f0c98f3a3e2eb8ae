"""The page and the picture of the augmented filter: :mod:`.results` in words and tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, TRUTH, new_figure
from shaftline.display.tables import markdown

from ..cells import Cell
from . import frigate
from .falling_body import BELIEVED_BETA, STORY
from .results import Results

TITLE = "Augmented Kalman filter: numbers found while a body falls and a frigate fouls"


MEASURED = "noise of 10 ft, ten a second"
"""How the position is measured where ours stands beside the print: with noise, as the thesis says."""

WORDS = {
    "velocity error from 2 s on [ft/s]": "very accurately",
    "beta unchanged above 65 000 ft, within": "does not change much initially",
    "beta at 12 s, within": "converges as the object enters the dense atmosphere",
    "beta from 14 s on, within": "converges to the true value and remains there",
}
"""What the thesis says of figure A-2, by quantity of :data:`.falling_body.STORY`."""


def cells_of(results: Results) -> list[Cell]:
    """Return the sentences on figure A-2 with ours, the median of the seeds.

    Args:
        results: of the study.
    """
    falls = results.falls[results.falls["readings"] == MEASURED]
    return [
        Cell(f"Figure A-2, {line.quantity}", f"true beta {line.beta:g}", "", float(line.median), 0.0,
             STORY[line.quantity], "our limit for the words, which name no number",
             words=WORDS[line.quantity])
        for line in falls.itertuples()
    ]  # fmt: skip


def story_table(results: Results) -> pd.DataFrame:
    """The falling body: limits, and medians with the worst seed in parentheses."""
    rows = []
    for (beta, readings), own in results.falls.groupby(["beta", "readings"], sort=False):
        seeds = own["seeds"].iloc[0]
        row = {"true beta": f"{beta:g}", "readings": readings, "seeds": str(seeds)}
        for found in own.itertuples():
            share = found.quantity.endswith("within")
            scale, unit = (100.0, " %") if share else (1.0, "")
            text = f"{scale * found.median:.2g}{unit}"
            row[found.quantity] = text + (f" ({scale * found.worst:.2g})" if seeds > 1 else "")
        rows.append(row)
    limits = {"true beta": "", "readings": "printed story", "seeds": ""}
    for quantity, limit in STORY.items():
        share = quantity.endswith("within")
        limits[quantity] = f"{100.0 * limit:g} %" if share else f"{limit:g}"
    return pd.DataFrame([limits, *rows])


def told_table(results: Results) -> pd.DataFrame:
    """The frigate's two numbers, by sea: rms error over the seeds beside what is claimed."""
    rows = []
    for (sea, key), own in results.told.groupby(["sea", "key"], sort=False):
        error = own["found"] - own["truth"]
        rows.append(
            {
                "sea": sea,
                "key": key,
                "truth": f"{own['truth'].iloc[0]:g}",
                "mean found": f"{own['found'].mean():.5g}",
                "rms error": f"{np.sqrt(np.mean(error**2)):.2g}",
                "filter's own error": f"{own['own error'].mean():.2g}",
                "with the tolerances": f"{own['standard error'].mean():.2g}",
            }
        )
    return pd.DataFrame(rows)


def followed_table(results: Results) -> pd.DataFrame:
    """Fouling as it grows: errors by who follows it."""
    rows = []
    for sea, own in results.followed.items():
        later = own[own["time_s"] > 900.0]
        growing = later[(later["time_s"] > 2400.0) & (later["time_s"] < 5400.0)]
        for name in ("observer", "observer, gauge 1 % off", "filter"):
            error = later[name] - later["truth"]
            rows.append(
                {
                    "sea": sea,
                    "followed by": name,
                    "rms error": float(np.sqrt(np.mean(error**2))),
                    "largest": float(error.abs().max()),
                    "mean while it grows": float((growing[name] - growing["truth"]).mean()),
                }
            )
    return pd.DataFrame(rows)


FILTER = """\
Unknown numbers are states that do not change, estimated with the others; derivatives by complex steps;
covariance by Phi P Phi' + Q dt, corrections in Joseph's form (Taylor 2000, chapter 2): for any model
(`shaftline.observers.AugmentedFilter`) and for a ship with her whole plant (`.ShipFilter`). Steering is
told by it in [Esso Osaka](esso-osaka.md) and [a destroyer](destroyer.md).

![Three estimates over time](figures/augmented-filter.png)"""

BODY = f"""\
## A falling body (appendix A; Gelb 1974, example 6.1-2)

The thesis prints a picture, no numbers; those of the example are as it is commonly recomputed. Beta is
believed to be {BELIEVED_BETA:g} lb/ft2. The story: the velocity is known at once, beta only in dense
air. Largest errors; medians, in parentheses the worst seed."""

AFTER_BODY = """\
With exact readings all of it holds. With the noise that the filter believes in, the median of the seeds
keeps the limits of the velocity and of beta at 12 s. It misses two limits a little: beta moves above
65 000 ft, more so with more frequent measurements, and ends 5.3 to 5.6 % off with ten measurements a
second. Single seeds leave all limits."""

RECORDED = f"""\
## The frigate: two numbers from one recording

Concealed: fouling {frigate.CONCEALED[frigate.FOULING]:g} and {frigate.CONCEALED[frigate.FRICTION]:g} N
m of Coulomb friction before the gauge, both 0 in the file. {frigate.SECONDS:g} s of steps of rack and
pitch, noisy instruments, {len(frigate.SEEDS)} seeds; found by `shaftline identify --method ekf`."""

AFTER_RECORDED = """\
What is reported contains the tolerances of the ship's other numbers, which are exact here; so the
errors lie far inside. At sea the filter's own error is larger than need be: it takes the waves for
noise that has no period."""

GROWN = """\
## The frigate: fouling followed as it grows

0.2 within an hour, some thousand times faster than in life. `observer` is `augmented-kalman` on line:
shaft speed, torque and pitch alone, at 20 Hz, no ship speed. `filter` is the filter of the whole plant
over the recording at 10 Hz, with the speed log and the engine's map. Errors after the first quarter of
an hour."""

AFTER_GROWN = """\
The observer lags behind what grows this fast, by the drift that it allows. An error of the gauge is
taken for fouling, which no standard deviation of its own can tell."""


def body(results: Results) -> str:
    """The page below its title, in Markdown."""
    velocity = "; ".join(
        f"{sea}: {own['augmented-kalman']:.3f} and {own['random-walk-kalman']:.3f} m/s"
        for sea, own in results.velocity.items()
    )
    friction = "; ".join(
        f"{sea}: {number:.0f} N m, standard deviation {deviation:.0f}"
        for sea, (number, deviation) in results.friction.items()
    )
    concealed = frigate.CONCEALED[frigate.FRICTION]
    parts = [
        FILTER, BODY, markdown(story_table(results)), AFTER_BODY, RECORDED,
        markdown(told_table(results)), AFTER_RECORDED, GROWN, markdown(followed_table(results), 4),
        AFTER_GROWN,
        "Its advance velocity beside the random-walk filter's on the same voyages, rms error: "
        f"{velocity}.",
        f"Friction of {concealed:g} N m in the stern tube, after an hour by "
        f"`augmented-kalman-friction`: {friction}.",
    ]  # fmt: skip
    return "\n\n".join(parts)


def figure(results: Results) -> Figure:
    """Beta, and fouling calm and at sea."""
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
    for axis, (sea, own) in zip(axes[0, 1:], results.followed.items(), strict=True):
        hours = own["time_s"] / 3600.0
        for colour, name in zip(PALETTE, ("observer", "filter"), strict=False):
            axis.plot(hours, own[name], color=colour, label=f"{name}, 2 sd")
            low, high = (own[name] + side * own[f"{name} sd"] for side in (-2.0, 2.0))
            axis.fill_between(hours, low, high, color=colour, alpha=0.15)
        name = "observer, gauge 1 % off"
        axis.plot(hours, own[name], color=PALETTE[2], linewidth=1.0, label=name)
        axis.plot(hours, own["truth"], color=TRUTH, linestyle="--", label="truth")
        axis.set(title=f"Frigate: fouling, sea {sea}", xlabel="time [h]", ylim=(-0.1, 0.3))
        axis.legend(fontsize=8)
    return drawn
