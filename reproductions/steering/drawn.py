"""Figures of the two steering controllers: voyages beside what was ordered."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.display.manoeuvres import outline

from . import results, voyages


def autopilot_figure(sailed: dict[str, pd.DataFrame]) -> Figure:
    """Draw heading and rudder in the current, and the two turns (Figures 5-7 to 5-13).

    Args:
        sailed: from :func:`.results.autopilot_voyages`.
    """
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(2, 2, (12.0, 7.2))
    figure.suptitle("Autopilot on the nonlinear plant at 22 knots", fontsize=12)
    for name, label, colour in (
        ("blown", "a sway of 5 kn at first, as printed", PALETTE[1]),
        ("met", "a current of 5 kn, met at 10 L", PALETTE[0]),
    ):
        part = sailed[name]
        heading, rudder = (np.degrees(part[c]) for c in ("heading_rad", "rudder_rad"))
        axes[0, 0].plot(part["way"], heading, color=colour, label=label)
        axes[1, 0].plot(part["way"], rudder, color=colour, linewidth=0.9)
    axes[0, 0].set_ylabel("heading [deg]")
    axes[0, 0].legend(fontsize=8, frameon=False)
    axes[1, 0].set_ylabel("rudder [deg]")
    axes[1, 0].set_xlabel("way at 22 knots [L]")
    turns = sailed["turns"]
    reckoned = voyages.dead_reckoned(turns)
    map_ = axes[0, 1]
    map_.plot(reckoned[:, 1], reckoned[:, 0], color=THESIS, linestyle="--", label="dead reckoned")
    map_.plot(
        turns["cross_track_m"] / length, turns["position_m"] / length, color=TRUTH, label="sailed"
    )
    for row in range(0, len(turns), round(5.0 * voyages.length_s() / voyages.INTERVAL_S)):
        at = turns.iloc[row]
        corners = outline(
            at["position_m"] / length, at["cross_track_m"] / length, at["heading_rad"]
        )
        map_.fill(*corners.T, color=PALETTE[1], alpha=0.7, linewidth=0.0)
    map_.set_aspect("equal", adjustable="datalim")
    map_.set_xlabel("to starboard [L]")
    map_.set_ylabel("along the first course [L]")
    map_.legend(fontsize=8, frameon=False)
    lower = axes[1, 1]
    lower.plot(turns["way"], np.degrees(turns["aim"]), color=THESIS, linestyle="--")
    lower.plot(turns["way"], np.degrees(turns["heading_rad"]), color=TRUTH)
    lower.set_ylabel("heading [deg]")
    lower.set_xlabel("way at 22 knots [L]")
    beside = lower.twinx()
    beside.plot(turns["way"], np.degrees(turns["rudder_rad"]), color=PALETTE[0], linewidth=0.8)
    beside.set_ylabel("rudder [deg]", color=PALETTE[0])
    beside.set_ylim(-10.0, 40.0)
    return figure


def track_figure(sailed: dict[str, pd.DataFrame]) -> Figure:
    """Draw the track changes (Figures 5-18 to 5-23).

    Args:
        sailed: from :func:`.results.track_voyages`.
    """
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(3, 1, (11.0, 8.0))
    figure.suptitle(
        "Track changes in a beam current of 5 knots, cross-track controller at 22 knots",
        fontsize=12,
    )
    names = [results.CALM, "current met", "current carried, waves on a wall"]
    for name, colour in zip(names, (PALETTE[1], PALETTE[0], PALETTE[2]), strict=True):
        part = sailed[name]
        axes[0, 0].plot(
            part["way"], part["cross_track_m"] / length, color=colour, label=name, lw=1.2
        )
        axes[1, 0].plot(part["way"], np.degrees(part["heading_rad"]), color=colour, lw=1.0)
        axes[2, 0].plot(part["way"], np.degrees(part["rudder_rad"]), color=colour, lw=0.8)
    axes[0, 0].plot(
        sailed[names[0]]["way"], sailed[names[0]]["aim"] / length, color=TRUTH, linestyle="--", lw=1.0,
        label="line led to",
    )  # fmt: skip
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis, label in zip(
        axes[:, 0], ("cross track [L]", "heading [deg]", "rudder [deg]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[2, 0].set_xlabel("way at 22 knots [L]")
    return figure
