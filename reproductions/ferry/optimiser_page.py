"""The page of the CPP optimiser: what it believes in, where it goes, and what errors cost it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface
from shaftline.baselines.working_point import (
    OpenWaterFit,
    Working,
    fit_open_water,
    highest_j,
    surface,
    surface_slope,
    working,
)
from shaftline.display import figures
from shaftline.display.tables import markdown, write_table
from shaftline.plant import Ship, load_ship

from ..cells import Cell, Kind
from ..reproduced import Reproduced, Tick
from ..side_by_side import reasons_text, verdicts
from . import errors
from .lever_points import WHOLE_ENVELOPE

TITLE = "CPP optimiser: its surfaces, its errors, and pitch at the actual thrust"
TICKS = errors.TICKS + 1
SHIP = "ferry-printed"

BODY = """\
The CPP optimiser paper's sections 2 to 4 and 6 on its ferry: [`ferry-printed`](ferry-map.md), whose
engine map is inferred from the paper's tables, and `ferry`, whose engine is flat. [Tables 1 to
3](levers.md) stand apart.

## What errors cost

The optimiser's thrust and advance speed are estimates: from the torque, by its KQ curve, with a
relative rotative efficiency that it does not know. The paper names these errors (sections 5 and 6)
and prints no numbers. Steady states with the resistance up by 10.0 to 12.3 %, as in the paper's
[tables](levers.md), and the order of the calm lever; the middle lever, and the worst of levers 1 to 4.
*Ship speed* against the optimiser without errors; *fuel lost* per mile against one that knows all, at
the speed that is reached.

{errors}

**Fuel is hardly lost**: an error of the torque of 3 % costs at most {most:.2f} % of it, since about
an optimum a wrong pitch costs to second order only. What is lost is **what was ordered**: the
thrust is off by {thrust:.0f} %, and the ship sails {speed:.1f} % slower or faster than the lever
says. The bound is the row without an error. (The trap: a ship that sails 1.6 % slower seems to
save, unless fuel is compared at the speed that is reached.)

## Pitch at the ordered or at the actual thrust

The paper asks the surface for the pitch at the *actual*, estimated thrust; ours at the *ordered*
one (`pitch_at`; the paper's is `cpp-optimiser-at-actual`). Both end in the same state. A step of
the order from lever 1 to 4, and head seas ({sea}), perfect estimates, the estimates' filter as it
is and eight times faster:

{pitch}

Both are stable: no swing grows. At the actual thrust the pitch follows every wave that the filter
lets through, {more:.0f} times as far and more, and a step of the order takes longer to settle, for
the same fuel and the same swing of the thrust. That is why `ordered` is the default; no instability
is.

## What it believes in

![Open water](figures/optimiser-open-water.png)

Thrust, torque and efficiency as polynomial surfaces of J and P/D (the paper's section 2.1 and
Figure 1).

![Crossed-out zone](figures/optimiser-zone.png)

The zone crossed out by d eta_o / dJ >= 0, over all pitches and at one (its Figures 3 and 4).

## Where it goes

![Optimal surfaces](figures/optimiser-surfaces.png)

Optimal shaft speed and pitch over thrust and advance speed, and which constraint holds there: what
its section 3 asks for. The whole torque envelope is allowed, as in the paper.
"""


def drawn_open_water(ship: Ship, fit: OpenWaterFit) -> Figure:
    """KT, KQ and efficiency over J for pitches over the ship's range."""
    figure, axes = figures.new_figure(1, 3, (13.0, 4.0))
    screw = ship.propeller
    for i, pitch in enumerate(np.linspace(screw.pitch_ratio_min, screw.pitch_ratio_max, 5)):
        j = np.linspace(0.0, 0.98 * float(pitch), 80)
        kt, kq = (np.array([surface(m, x, float(pitch)) for x in j]) for m in fit[:2])
        curves = (kt, 10.0 * kq, np.clip(j * kt / (2.0 * np.pi * kq), 0.0, None))
        for axis, curve in zip(axes[0], curves, strict=True):
            axis.plot(j, curve, color=figures.PALETTE[i], label=f"P/D {pitch:.1f}")
    for axis, name in zip(axes[0], ("KT", "10 KQ", "open-water efficiency"), strict=True):
        axis.set_xlabel("J", fontsize=9)
        axis.set_title(name, fontsize=10)
    axes[0, 0].legend(fontsize=8, frameon=False)
    return figure


def _slope(fit: OpenWaterFit, j: float, pitch: float) -> tuple[float, float]:
    """Efficiency and the sign of its slope."""
    kt, kq = surface(fit.thrust, j, pitch), surface(fit.torque, j, pitch)
    rise = (kt + j * surface_slope(fit.thrust, j, pitch)) * kq
    rise -= j * kt * surface_slope(fit.torque, j, pitch)
    return j * kt / (2.0 * np.pi * kq), rise


def drawn_zone(ship: Ship, fit: OpenWaterFit) -> Figure:
    """Where the efficiency falls with J, over all pitches and at one."""
    figure, axes = figures.new_figure(1, 2, (11.0, 4.2))
    screw = ship.propeller
    pitches = np.linspace(screw.pitch_ratio_min, screw.pitch_ratio_max, 60)
    advances = np.linspace(0.01, 0.95 * highest_j(screw.pitch_ratio_max), 120)
    value = np.full((60, 120), np.nan)
    falls = np.zeros((60, 120))
    for a, pitch in enumerate(pitches):
        for b, j in enumerate(advances):
            if surface(fit.thrust, float(j), float(pitch)) > 0.0:
                value[a, b], rise = _slope(fit, float(j), float(pitch))
                falls[a, b] = rise < 0.0
    left, right = axes[0]
    lines = left.contour(advances, pitches, value, levels=np.arange(0.1, 0.8, 0.1),
                         colors=figures.THESIS, linewidths=0.8)  # fmt: skip
    left.clabel(lines, fontsize=7)
    left.contourf(advances, pitches, falls, levels=[0.5, 1.5], colors=[figures.ESTIMATE], alpha=0.3)
    left.set_xlabel("J", fontsize=9)
    left.set_ylabel("P/D", fontsize=9)
    left.set_title("efficiency; crossed out (red) where it falls with J", fontsize=10)
    pitch = float(pitches[30])
    keep = np.isfinite(value[30])
    right.plot(advances[keep], value[30][keep], color=figures.TRUTH)
    right.fill_between(advances[keep], 0.0, value[30][keep], where=falls[30][keep] > 0.5,
                       color=figures.ESTIMATE, alpha=0.3)  # fmt: skip
    right.set_xlabel("J", fontsize=9)
    right.set_title(f"at P/D {pitch:.2f}", fontsize=10)
    return figure


NAMES = ("none", "torque", "engine speed", "highest pitch", "efficiency's slope", "cavitation")


def active(ship: Ship, fit: OpenWaterFit, table: CombinatorSurface) -> NDArray[np.int64]:
    """Which constraint holds at each node of a surface, as an index into :data:`NAMES`."""
    plant, (slowest, top) = ship.record(), ship.shaft_speeds
    found = np.zeros(table.shaft_speed.shape, dtype=np.int64)
    for i, velocity in enumerate(table.advance_velocity):
        for k in range(len(table.share)):
            speed, pitch = float(table.shaft_speed[i, k]), float(table.pitch_ratio[i, k])
            at: Working = working(plant, fit.thrust, fit.torque, float(velocity), speed, pitch)
            held = (
                at.torque_share > 0.995, not 1.005 * slowest < speed < 0.995 * top,
                pitch > ship.propeller.pitch_ratio_max - 0.005, at.efficiency_slope < 0.005,
                at.burrill > 0.995,
            )  # fmt: skip
            found[i, k] = next((n + 1 for n, holds in enumerate(held) if holds), 0)
    return found


def drawn_surfaces(ship: Ship, fit: OpenWaterFit, table: CombinatorSurface) -> Figure:
    """Optimal shaft speed and pitch, with the constraint that holds."""
    figure, axes = figures.new_figure(1, 2, (12.5, 5.0))
    velocity = np.repeat(table.advance_velocity[:, None], len(table.share), axis=1)
    span = (table.most_thrust - table.least_thrust)[:, None]
    thrust = 1e-3 * (table.least_thrust[:, None] + span * table.share)
    rpm = table.shaft_speed * 30.0 / np.pi
    held = active(ship, fit, table)
    shown = ((axes[0, 0], rpm, "shaft speed [rpm]"), (axes[0, 1], table.pitch_ratio, "P/D"))
    for axis, values, title in shown:
        _contours(axis, velocity, thrust, values)
        for n in sorted(set(held.ravel().tolist())):
            spots = held == n
            axis.plot(velocity[spots], thrust[spots], "o", markersize=3,
                      color=figures.PALETTE[n], label=NAMES[n])  # fmt: skip
        axis.set_xlabel("advance speed [m/s]", fontsize=9)
        axis.set_ylabel("thrust of one propeller [kN]", fontsize=9)
        axis.set_title(f"optimal {title}", fontsize=10)
    axes[0, 1].legend(fontsize=8, frameon=False, title="constraint that holds", title_fontsize=8)
    return figure


def _contours(axis: Axes, x: Any, y: Any, values: Any) -> None:
    lines = axis.contour(x, y, values, levels=12, colors=figures.THESIS, linewidths=0.9)
    axis.clabel(lines, fontsize=7)


def reproduce(folder: Path, tick: Tick) -> Reproduced:
    """Write the page, its table and its figures.

    Args:
        folder: of the page.
        tick: called :data:`TICKS` times.
    """
    ship = load_ship(SHIP)
    fit, table = fit_open_water(ship), combinator_surface(ship, WHOLE_ENVELOPE)
    pictures = {
        "optimiser-open-water": drawn_open_water(ship, fit),
        "optimiser-zone": drawn_zone(ship, fit),
        "optimiser-surfaces": drawn_surfaces(ship, fit, table),
    }
    for name, picture in pictures.items():
        figures.save(picture, folder / "figures" / f"{name}.png")
    tick()
    wrong = errors.error_table(tick)
    pitch = errors.pitch_table(tick)
    rounded = wrong.round(2)
    rounded[wrong.columns[2:]] += 0.0  # takes the sign off a rounded nothing
    cells = cells_of(fit)
    body = BODY.format(errors=markdown(rounded, 2), pitch=markdown(pitch, 4), **_told(wrong, pitch))
    body = f"{body}\n{verdicts('optimiser', cells)}"
    write_table(folder, "optimiser", TITLE, "shaftline reproduce optimiser", wrong, body)
    numbers = {
        f"{row['ship']}, {row['wrong']}": row.drop(["ship", "wrong"]).dropna().to_dict()
        for _, row in wrong.iterrows()
    }
    shown = wrong.round(2).astype(dict.fromkeys(wrong.columns, object))
    return Reproduced(TITLE, shown.astype(str), reasons_text(cells), numbers, cells)


def cells_of(fit: OpenWaterFit) -> list[Cell]:
    """Return the paper's one number on the open-water fit with ours.

    Sections 2 to 4 and 6 print no other number.

    Args:
        fit: of the ferry's propeller.
    """
    return [
        Cell("section 2.1", f"largest error of the fitted {name} [% of its largest]", "",
             100.0 * error, 0.0, 0.4, "the limit that the words name", Kind.CALIBRATED,
             words="none greater than 0.4 %")
        for name, error in (("KT", fit.thrust_error), ("KQ", fit.torque_error))
    ]  # fmt: skip


def _told(wrong: pd.DataFrame, pitch: pd.DataFrame) -> dict[str, Any]:
    """Numbers of the page's sentences."""
    swing = pitch.set_index(["ship", "pitch at", "filter [s]"])["waves: swing of P/D, first half"]
    ratios = [
        swing[name, "actual", f] / swing[name, "ordered", f]
        for name in errors.SHIPS
        for f in swing.index.levels[2]
    ]
    return {
        "most": wrong["most fuel lost, levers 1 to 4 [%]"].max(),
        "thrust": wrong["thrust estimate [%]"].abs().max(),
        "speed": wrong["ship speed [%]"].abs().max(),
        "sea": errors.SEA.replace(",", ", "),
        "more": np.floor(min(ratios)),
    }
