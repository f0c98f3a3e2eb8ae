"""Compute what errors cost the CPP optimiser, and its pitch at the actual thrust (paper, sections 2 to
6).

The paper's thrust and advance speed are estimates: from torque, by a KQ curve, with a relative rotative
efficiency that is not known. It names these errors and prints no numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface, look_up
from shaftline.baselines.cpp_optimiser import FILTER_S, CppOptimiser
from shaftline.baselines.steady_points import SteadyPoint, steady_point
from shaftline.baselines.working_point import (
    OpenWaterFit,
    WorkingPoint,
    fit_open_water,
    highest_j,
    surface,
    surface_slope,
    working_point,
)
from shaftline.display import figures
from shaftline.observers.torque_curve import velocity_from_torque
from shaftline.plant import Ship, load_ship
from shaftline.plant.hull import resistance
from shaftline.plant.open_water import REVOLUTIONS_PER_RADIAN
from shaftline.plant.shaft import drive_torque

from ..cells import Cell, Kind
from ..pages import fill_template
from ..side_by_side import Page, Study, Tick
from .experiment import (
    STEP_AT,
    WHOLE_ENVELOPE,
    lever_speeds,
    optimal_state,
    resistance_rises,
    simulate_voyage,
)

SHIPS = ("ferry-printed", "ferry")
ETA_R = "propeller.relative_rotative_efficiency"
NOISE, OBSERVER = 0.01, "immersion-invariance"
SEA = "hs=1.0,tp=5.0"


class Error(NamedTuple):
    """Errors of the instruments and of the optimiser's model."""

    ship_eta_r: float = 1.0  # of the ship
    believed_eta_r: float = 1.0  # of the optimiser's ship; KQ goes with its inverse
    gain: float = 1.0  # torque read / torque
    bias: float = 0.0  # torque read at no torque / the engine's limit


ERRORS = {
    "none": Error(),
    "eta_R 0.97, believed 1": Error(ship_eta_r=0.97),
    "eta_R 1.03, believed 1": Error(ship_eta_r=1.03),
    "torque read 2 % high": Error(gain=1.02),
    "torque read 2 % low": Error(gain=0.98),
    "torque bias +1 % of the limit": Error(bias=0.01),
    "torque bias -1 % of the limit": Error(bias=-0.01),
    "KQ believed 3 % high": Error(believed_eta_r=1.0 / 1.03),
    "KQ believed 3 % low": Error(believed_eta_r=1.0 / 0.97),
}


class SettledState(NamedTuple):
    """A steady state under an error."""

    point: SteadyPoint
    thrust: float  # estimated [N]
    advance_velocity: float  # estimated [m/s]


def settle(ship: Ship, error: Error, speed_order: float, factor: float) -> SettledState:
    """Return the state at which the optimiser's estimated thrust equals the ordered one.

    Args:
        ship: without the error.
        error: of instruments and model.
        speed_order: set-point of the ship speed [m/s].
        factor: resistance factor d_c1 [-].

    Raises:
        RuntimeError: no such state exists.
    """
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    believed = ship.with_values({ETA_R: error.believed_eta_r})
    table, fit = combinator_surface(believed, WHOLE_ENVELOPE), fit_open_water(believed)
    plant, model = actual.record(), believed.record()
    push = float(model["propellers"] * (1.0 - model["thrust_deduction"]))
    ordered = float(resistance(model, speed_order, 1.0)) / push
    whole = float(plant["torque_limit"] * plant["gear_ratio"])
    force = believed.water.density_kg_m3 * believed.propeller.diameter_m**4

    def seen(speed: float, pitch: float) -> SettledState:
        point = steady_point(actual, speed, pitch, factor)
        torque = drive_torque(plant, point.brake_torque, speed)
        read = error.gain * torque + error.bias * whole
        velocity, _ = velocity_from_torque(model, read, speed, pitch, point.advance_velocity)
        n = speed * REVOLUTIONS_PER_RADIAN
        j = velocity / (n * believed.propeller.diameter_m)
        return SettledState(point, float(surface(fit.thrust, j, pitch)) * force * n * n, velocity)

    start = optimal_state(
        ship, table, speed_order * factor ** (-1.0 / ship.hull.resistance_exponent), factor
    )
    if start is None:
        raise RuntimeError(f"{ship.name}: no setting for {speed_order:g} m/s")
    scale = np.array([start.shaft_speed, start.pitch_ratio])

    def off(x: NDArray[np.float64]) -> list[float]:
        state = seen(float(x[0] * scale[0]), float(x[1] * scale[1]))
        setting = look_up(table, np.array([ordered]), np.array([state.advance_velocity]))
        return [
            state.thrust / float(setting.thrust[0]) - 1.0,
            float(x[1] * scale[1] / setting.pitch_ratio[0]) - 1.0,
        ]

    found = scipy.optimize.root(off, np.ones(2), tol=1e-9)
    if not found.success:
        raise RuntimeError(f"{ship.name}, {error}: no steady state ({found.message})")
    return seen(*(float(v) for v in found.x * scale))


def error_row(ship: Ship, error: Error) -> dict[str, float]:
    """Return errors and lost fuel at the middle lever, and the worst of levers 1 to 4."""
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    known = combinator_surface(actual, WHOLE_ENVELOPE)
    rows = []
    for order, rise in list(zip(lever_speeds(ship), resistance_rises(), strict=True))[:4]:
        state = settle(ship, error, order, rise)
        point = state.point
        best = optimal_state(actual, known, point.ship_speed, rise)
        reference = settle(ship, Error(), order, rise).point.ship_speed
        assert best is not None
        rows.append(
            (
                100.0 * (state.thrust / point.thrust - 1.0),
                100.0 * (state.advance_velocity / point.advance_velocity - 1.0),
                100.0 * (point.ship_speed / reference - 1.0),
                100.0 * (point.fuel_flow / best.fuel_flow - 1.0),
            )
        )
    table = np.array(rows)
    return {
        "thrust estimate [%]": table[2, 0], "v_a estimate [%]": table[2, 1],
        "ship speed [%]": table[2, 2], "fuel lost [%]": table[2, 3],
        "most fuel lost, levers 1 to 4 [%]": float(table[:, 3].max()),
    }  # fmt: skip


def noise_row(ship: Ship) -> dict[str, float]:
    """Return the row for white noise of the torque, the middle lever simulated in closed loop."""
    order = lever_speeds(ship)[2]
    whole = float(ship.record()["torque_limit"] * ship.record()["gear_ratio"])
    means = []
    for noise in ({}, {"shaft_torque": NOISE * whole}):
        log = simulate_voyage(
            ship, CppOptimiser(ship), order, order, observer=OBSERVER, noise=noise
        )
        means.append(log[log["time_s"] > STEP_AT + 150.0].mean())
    clean, noisy = means
    speed = noisy["ship_speed_m_s"] / clean["ship_speed_m_s"]
    # fuel at equal speed: it goes about with the speed's power of the resistance and one more
    fuel = noisy["fuel_kg_s"] / clean["fuel_kg_s"] / speed ** (1.0 + ship.hull.resistance_exponent)
    return {
        "thrust estimate [%]": math.nan, "v_a estimate [%]": math.nan,
        "ship speed [%]": 100.0 * (speed - 1.0), "fuel lost [%]": 100.0 * (fuel - 1.0),
        "most fuel lost, levers 1 to 4 [%]": math.nan,
    }  # fmt: skip


def error_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Return the effect of every error on every ferry."""
    rows = []
    for name in SHIPS:
        ship = load_ship(name)
        for what, error in ERRORS.items():
            rows.append({"ship": name, "wrong": what, **error_row(ship, error)})
            tick()
        noise = f"torque noise {100.0 * NOISE:g} % of the limit, {OBSERVER}"
        rows.append({"ship": name, "wrong": noise, **noise_row(ship)})
        tick()
    return pd.DataFrame(rows)


def pitch_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Compare pitch at the ordered and at the actual thrust, in a step of the set-point and in waves.

    Each has the default filter of the estimates, and one that is eight times faster.
    """
    rows = []
    for name in SHIPS:
        ship = load_ship(name)
        slow, fast = (lever_speeds(ship)[i] for i in (0, 3))
        for at in ("ordered", "actual"):
            for filter_s in (FILTER_S, FILTER_S / 8.0):
                pilot = CppOptimiser(ship, pitch_at=at, filter_s=filter_s)
                step = simulate_voyage(ship, pilot, slow, fast, rise=1.0)
                after = step[step["time_s"] > STEP_AT]
                end = after["ship_speed_m_s"].iloc[-1]
                gone = np.abs(after["ship_speed_m_s"] - end) > 0.02 * (fast - slow)
                waves = simulate_voyage(ship, pilot, fast, fast, sea=SEA, rise=1.0)
                swing = [
                    float(waves["pitch_ratio"][waves["time_s"].between(*span)].std())
                    for span in ((100.0, 350.0), (350.0, 600.0))
                ]
                kept = waves[waves["time_s"] > 100.0]
                rows.append(
                    {
                        "ship": name, "pitch at": at, "filter [s]": filter_s,
                        "step: settled after [s]": float(after["time_s"][gone].max() - STEP_AT),
                        "step: pitch overshoot [-]": _beyond(after["pitch_ratio"].to_numpy()),
                        "waves: fluctuation of P/D, first half": swing[0],
                        "second half": swing[1],
                        "fluctuation of thrust [%]": 100.0
                        * float(kept["thrust_N"].std() / kept["thrust_N"].mean()),
                        "fuel [kg/nmi]": 1852.0
                        * float(kept["fuel_kg_s"].mean() / kept["ship_speed_m_s"].mean()),
                    }
                )  # fmt: skip
            tick()
    return pd.DataFrame(rows)


def _beyond(values: NDArray[np.float64]) -> float:
    """Return the overshoot of values beyond the range between the first and the last."""
    low, high = sorted((float(values[0]), float(values[-1])))
    return max(float(values.max()) - high, low - float(values.min()), 0.0)


SHIP = "ferry-printed"


def draw_open_water(ship: Ship, fit: OpenWaterFit) -> Figure:
    """Draw KT, KQ and efficiency over J for pitches over the ship's range."""
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
    """Return the efficiency and a number with the sign of its slope."""
    kt, kq = surface(fit.thrust, j, pitch), surface(fit.torque, j, pitch)
    rise = (kt + j * surface_slope(fit.thrust, j, pitch)) * kq
    rise -= j * kt * surface_slope(fit.torque, j, pitch)
    return j * kt / (2.0 * np.pi * kq), rise


def draw_zone(ship: Ship, fit: OpenWaterFit) -> Figure:
    """Draw the zone where the efficiency falls with J, over all pitches and at one."""
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
    """Return the active constraint at each node of a surface, as an index into :data:`NAMES`."""
    plant, (slowest, top) = ship.record(), ship.shaft_speeds
    found = np.zeros(table.shaft_speed.shape, dtype=np.int64)
    for i, velocity in enumerate(table.advance_velocity):
        for k in range(len(table.share)):
            speed, pitch = float(table.shaft_speed[i, k]), float(table.pitch_ratio[i, k])
            at: WorkingPoint = working_point(
                plant, fit.thrust, fit.torque, float(velocity), speed, pitch
            )
            held = (
                at.torque_share > 0.995, not 1.005 * slowest < speed < 0.995 * top,
                pitch > ship.propeller.pitch_ratio_max - 0.005, at.efficiency_slope < 0.005,
                at.burrill > 0.995,
            )  # fmt: skip
            found[i, k] = next((n + 1 for n, holds in enumerate(held) if holds), 0)
    return found


def draw_surfaces(ship: Ship, fit: OpenWaterFit, table: CombinatorSurface) -> Figure:
    """Draw optimal shaft speed and pitch, with the active constraint."""
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


def cells_of(fit: OpenWaterFit) -> list[Cell]:
    """Return the paper's one number on the open-water fit with ours.

    Sections 2 to 4 and 6 print no other number.
    """
    return [
        Cell("section 2.1", f"largest error of the fitted {name} [% of its largest]", "",
             100.0 * error, 0.0, 0.4, "the limit that the words name", Kind.CALIBRATED,
             words="none greater than 0.4 %")
        for name, error in (("KT", fit.thrust_error), ("KQ", fit.torque_error))
    ]  # fmt: skip


def page(tick: Tick) -> Page:
    """Return the page of sections 2 to 4 and 6 of the paper."""
    ship = load_ship(SHIP)
    fit, table = fit_open_water(ship), combinator_surface(ship, WHOLE_ENVELOPE)
    drawn = {
        "optimiser-open-water": draw_open_water(ship, fit),
        "optimiser-zone": draw_zone(ship, fit),
        "optimiser-surfaces": draw_surfaces(ship, fit, table),
    }
    tick()
    wrong, pitch = error_table(tick), pitch_table(tick)
    rounded = wrong.round(2)
    rounded[wrong.columns[2:]] += 0.0  # removes the sign of a rounded zero
    swing = pitch.set_index(["ship", "pitch at", "filter [s]"])[
        "waves: fluctuation of P/D, first half"
    ]
    ratios = [
        swing[name, "actual", f] / swing[name, "ordered", f]
        for name in SHIPS
        for f in swing.index.levels[2]
    ]
    body = fill_template(
        Path(__file__).with_suffix(".md"), errors=rounded, pitch=pitch,
        most=wrong["most fuel lost, levers 1 to 4 [%]"].max(),
        thrust=wrong["thrust estimate [%]"].abs().max(),
        speed=wrong["ship speed [%]"].abs().max(), sea=SEA.replace(",", ", "),
        more=np.floor(min(ratios)),
    )  # fmt: skip
    numbers = {
        f"{row['ship']}, {row['wrong']}": row.drop(["ship", "wrong"]).dropna().to_dict()
        for _, row in wrong.iterrows()
    }
    shown = wrong.round(2).astype(dict.fromkeys(wrong.columns, object)).astype(str)
    return Page(cells_of(fit), body, drawn, numbers, wrong, shown)


STUDY = Study(
    "CPP optimiser: fitted surfaces, cost of errors, and pitch at the actual thrust",
    page,
    len(SHIPS) * (len(ERRORS) + 1 + 2) + 1,
)
