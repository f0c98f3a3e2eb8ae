"""Figures of manoeuvres: turning circles with ship outlines, zig-zags, spirals."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from ..plant.manoeuvres import Spiral, Trials, TurningCircle, ZigZag
from .figures import PALETTE, THESIS, TRUTH, new_figure, style

SIDE_COLOURS = {"starboard": PALETTE[1], "port": PALETTE[0]}  # green and red, like side lights
_BEAM = 0.16  # beam of the drawn outline, in ship lengths
_OUTLINE = np.array(  # ahead and to starboard, in ship lengths: bow, straight side, stern
    [(0.5, 0.0), (0.44, 0.24), (0.33, 0.44), (0.2, 0.5), (-0.38, 0.5), (-0.47, 0.42), (-0.5, 0.3)]
) * np.array([1.0, _BEAM])
OUTLINE = np.vstack([_OUTLINE, _OUTLINE[::-1] * np.array([1.0, -1.0])])
"""Corners of a ship's water line, ahead and to starboard [ship lengths], shape (14, 2)."""


def outline(ahead: float, aside: float, heading: float) -> NDArray[np.float64]:
    """Return the corners of a ship on a map with north up, from the position of midship.

    Positions [ship lengths] and heading [rad] are along and to starboard of the initial course; the
    result, shape (14, 2), is to starboard of the course and along it.
    """
    cosine, sine = np.cos(heading), np.sin(heading)
    east = aside + OUTLINE[:, 0] * sine + OUTLINE[:, 1] * cosine
    north = ahead + OUTLINE[:, 0] * cosine - OUTLINE[:, 1] * sine
    return np.column_stack([east, north])


def _draw_ships(axis: Axes, track: pd.DataFrame, length: float, colour: str, apart: float) -> None:
    """Draw outlines at the start and at constant intervals of the way, over the first full turn."""
    track = track[track["heading_rad"].abs() <= 2.0 * np.pi]
    x = track["position_m"].to_numpy() / length
    y = track["cross_track_m"].to_numpy() / length
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    rows = np.searchsorted(way, np.arange(0.0, way[-1], apart))
    for row in rows:
        corners = outline(x[row], y[row], float(track["heading_rad"].iloc[row]))
        axis.add_patch(
            Polygon(corners, closed=True, fc=colour, ec="white", lw=0.6, alpha=0.75, zorder=3)
        )


def turning_circles(turns: dict[str, TurningCircle], title: str) -> Figure:
    """Return a figure of tracks by side with outlines, and of speed and rate of turn over the way.

    Turns of a ship with roll have a third panel with the roll angle over the way.
    """
    figure = Figure(figsize=(12.5, 5.6), layout="constrained")
    rolls = any(turn.heel is not None for turn in turns.values())
    rows = 3 if rolls else 2
    places = figure.add_gridspec(rows, 2, width_ratios=(2.1, 1.0))
    map_, speeds, rates, *heels = (
        figure.add_subplot(place) for place in (places[:, 0], *(places[k, 1] for k in range(rows)))
    )
    figure.suptitle(title, fontsize=12)
    for side, turn in turns.items():
        colour, track, length = SIDE_COLOURS[side], turn.track, turn.length_m
        east, north = track["cross_track_m"] / length, track["position_m"] / length
        label = f"{np.degrees(turn.rudder_rad):+.0f}° rudder"
        map_.plot(east, north, color=colour, linewidth=1.0, label=label)
        _draw_ships(map_, track, length, colour, 1.25)
        _measures(map_, turn, colour)
        way = np.cumsum(track["speed_m_s"]) * float(track["time_s"].iloc[1]) / length
        speeds.plot(way, track["speed_m_s"] / track["speed_m_s"].iloc[0], color=colour)
        rates.plot(way, np.degrees(track["yaw_rate_rad_s"]) * 60.0, color=colour)
        if turn.heel is not None:
            heels[0].plot(way, np.degrees(track["roll_rad"]), color=colour)
    map_.plot([0.0, 0.0], [-1.5, 0.0], color=TRUTH, linewidth=1.0, linestyle="--")
    map_.plot(0.0, 0.0, "o", color=TRUTH, markersize=4, zorder=4)
    map_.annotate("rudder ordered", (0.0, 0.0), (8, -14), textcoords="offset points", fontsize=8)
    map_.set_aspect("equal", adjustable="datalim")
    map_.margins(0.12, 0.1)
    map_.set(
        xlabel="to starboard of the initial course [ship lengths]",
        ylabel="along the initial course [ship lengths]",
    )
    map_.legend(fontsize=8, frameon=False, loc="lower right")
    speeds.set(ylabel="speed / approach\nspeed [-]", ylim=(0.0, 1.05))
    rates.axhline(0.0, color=THESIS, linewidth=0.6)
    rates.set(ylabel="rate of turn [deg/min]")
    for heel in heels:
        heel.axhline(0.0, color=THESIS, linewidth=0.6)
        heel.set(ylabel="roll, starboard\ndown [deg]")
    (heels or [rates])[-1].set_xlabel("way [ship lengths]")
    style(map_, speeds, rates, *heels)
    return figure


def _measures(axis: Axes, turn: TurningCircle, colour: str) -> None:
    """Mark heading changes of 90 and 180 degrees, with advance and tactical diameter."""
    side = np.sign(turn.rudder_rad)
    for degrees, name, value, away in (
        (90.0, "advance", turn.advance, (0.0, 22.0)),
        (180.0, "tactical\ndiameter", turn.tactical_diameter, (-42.0 * side, -12.0)),
    ):
        row = int(np.argmax(side * turn.track["heading_rad"].to_numpy() >= np.radians(degrees)))
        place = tuple(turn.track[["cross_track_m", "position_m"]].iloc[row] / turn.length_m)
        axis.plot(*place, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4)
        axis.annotate(
            f"{name} {value:.2f} L",
            place,
            away,
            textcoords="offset points",
            fontsize=9,
            color=colour,
            ha="center" if degrees < 180.0 else "right" if side > 0.0 else "left",
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6},
        )


def zig_zags(results: dict[tuple[int, str], ZigZag], title: str) -> Figure:
    """Return a figure of heading and rudder over time with overshoots, a panel for each zig-zag."""
    angles = sorted({angle for angle, _ in results})
    sides = sorted({side for _, side in results}, reverse=True)  # starboard first
    figure, axes = new_figure(len(angles), len(sides), (6.0 * len(sides), 2.9 * len(angles) + 0.5))
    figure.suptitle(title, fontsize=12)
    for i, angle in enumerate(angles):
        for j, side in enumerate(sides):
            axis = axes[i, j]
            if (angle, side) not in results:
                axis.set_visible(False)
                continue
            _zig_zag(axis, results[angle, side], SIDE_COLOURS[side])
            axis.set_title(f"{angle}/{angle}, first to {side}", fontsize=9)
            axis.set_ylabel("[deg]", fontsize=9)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=9)
    axes[0, 0].legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    return figure


def _zig_zag(axis: Axes, found: ZigZag, colour: str) -> None:
    time = found.track["time_s"].to_numpy()
    heading = np.degrees(found.track["heading_rad"].to_numpy())
    axis.plot(time, heading, color=colour, linewidth=1.6, label="heading")
    rudder = np.degrees(found.track["rudder_rad"])
    axis.plot(time, rudder, color=TRUTH, linewidth=0.9, label="rudder")
    reach = np.degrees(found.heading_rad)
    for level in (-reach, reach):
        axis.axhline(level, color=THESIS, linewidth=0.7, linestyle="--")
    axis.axhline(0.0, color=THESIS, linewidth=0.6)
    ends = (*found.executes_s[2:], time[-1])
    for begin, end, overshoot in zip(found.executes_s[1:], ends, found.overshoots_deg, strict=True):
        part = (time >= begin) & (time <= end)
        row = int(np.flatnonzero(part)[np.argmax(np.abs(heading[part]))])
        above = np.sign(heading[row])
        axis.fill_between(
            time,
            heading,
            above * reach,
            where=part & (above * heading > reach),
            color=colour,
            alpha=0.2,
            linewidth=0.0,
        )
        axis.annotate(
            f"{overshoot:.1f}°",
            (time[row], heading[row]),
            (0, 4.0 * above),
            textcoords="offset points",
            fontsize=8,
            color=colour,
            ha="center",
            va="bottom" if above > 0 else "top",
        )
    axis.margins(y=0.16)
    axis.tick_params(labelsize=8)


def spirals(result: Spiral, title: str) -> Figure:
    """Return a figure of the steady rate of turn over the rudder angle, and of its middle enlarged."""
    figure, axes = new_figure(1, 2, (11.0, 4.6))
    figure.suptitle(title, fontsize=12)
    for axis, reach in zip(axes[0], (np.inf, 4.0), strict=True):
        for leg, part in result.curve.groupby("leg", sort=False):
            degrees = np.degrees(part["rudder_rad"].to_numpy())
            near = np.abs(degrees) <= reach
            to_port = leg == "to port"
            axis.plot(
                degrees[near],
                part["rate_of_turn"].to_numpy()[near],
                color=SIDE_COLOURS["port" if to_port else "starboard"],
                marker="<" if to_port else ">",
                markersize=4,
                linewidth=1.0,
                label=f"rudder moving {leg}",
            )
        axis.axhline(0.0, color=THESIS, linewidth=0.6)
        axis.axvline(0.0, color=THESIS, linewidth=0.6)
        axis.set_xlabel("rudder angle [deg], positive turns to starboard")
    axes[0, 0].set_ylabel("rate of turn r' = r L / U [-]")
    axes[0, 0].legend(fontsize=8, frameon=False)
    size = f"{abs(result.width_deg):.2f}° wide, {abs(result.height):.3f} high amidships"
    axes[0, 1].set_title(f"loop: {size}", fontsize=9)
    return figure


def trial_figures(trials: Trials) -> dict[str, Figure]:
    """Return all figures of the standard set by file name; manoeuvres that failed are left out."""
    about = f"{trials.ship.name} at {trials.speed_m_s:.3g} m/s"
    figures = {}
    if trials.turns:
        figures["turning-circles"] = turning_circles(trials.turns, f"Turning circles of {about}")
    if trials.zig_zags:
        figures["zig-zags"] = zig_zags(trials.zig_zags, f"Zig-zags of {about}")
    if trials.spiral is not None:
        figures["spiral"] = spirals(trials.spiral, f"Spiral of {about}")
    return figures
