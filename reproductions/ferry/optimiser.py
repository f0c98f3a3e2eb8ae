"""Compute what errors cost the CPP optimiser, and its pitch at the actual thrust (paper, sections 2 to
6).

The paper's thrust and advance speed are estimates: from torque, by a KQ curve, with a relative rotative
efficiency that is not known. It names these errors and prints no numbers.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.baselines import working_point as open_water
from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface, look_up
from shaftline.baselines.cpp_optimiser import FILTER_S, CppOptimiser
from shaftline.baselines.steady_points import SteadyPoint, steady_point
from shaftline.baselines.working_point import OpenWaterFit, fit_open_water, surface
from shaftline.display import figures
from shaftline.observers.torque_curve import velocity_from_torque
from shaftline.plant import Ship, load_ship
from shaftline.plant.hull import resistance
from shaftline.plant.open_water import REVOLUTIONS_PER_RADIAN
from shaftline.plant.shaft import drive_torque

from ..cells import Cell, Kind
from ..pages import fill_template, label_axis
from ..side_by_side import Page, Study, Tick
from . import experiment
from .experiment import RISE, STEP_AT, WHOLE_ENVELOPE, lever_speeds, optimal_state

SHIPS = ("ferry-printed", "ferry")
ETA_R = "propeller.relative_rotative_efficiency"
NOISE, OBSERVER = 0.01, "immersion-invariance"
SEA = "hs=1.0,tp=5.0"
LOST, MOST = "fuel lost [%]", "most fuel lost, levers 1 to 4 [%]"
SWING = "waves: fluctuation of P/D, first half"


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

    The set-point of the ship speed is in [m/s], ``factor`` the resistance factor d_c1 [-].

    Raises:
        RuntimeError: no such state exists.
    """
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    believed = ship.with_values({ETA_R: error.believed_eta_r})
    table, fit = combinator_surface(believed, WHOLE_ENVELOPE), fit_open_water(believed)
    plant, model, diameter = actual.record(), believed.record(), believed.propeller.diameter_m
    push = float(model["propellers"] * (1.0 - model["thrust_deduction"]))
    ordered = float(resistance(model, speed_order, 1.0)) / push
    whole = float(plant["torque_limit"] * plant["gear_ratio"])
    force = believed.water.density_kg_m3 * diameter**4

    def seen(speed: float, pitch: float) -> SettledState:
        point = steady_point(actual, speed, pitch, factor)
        read = error.gain * drive_torque(plant, point.brake_torque, speed) + error.bias * whole
        velocity, _ = velocity_from_torque(model, read, speed, pitch, point.advance_velocity)
        n = speed * REVOLUTIONS_PER_RADIAN
        kt = float(surface(fit.thrust, velocity / (n * diameter), pitch))
        return SettledState(point, kt * force * n * n, velocity)

    reached = experiment.speed_at_held_thrust(ship, speed_order, factor)
    start = optimal_state(ship, table, reached, factor)
    if start is None:
        raise RuntimeError(f"{ship.name}: no setting for {speed_order:g} m/s")
    scale = np.array([start.shaft_speed, start.pitch_ratio])

    def off(x: NDArray[np.float64]) -> list[float]:
        speed, pitch = map(float, x * scale)
        state = seen(speed, pitch)
        setting = look_up(table, np.array([ordered]), np.array([state.advance_velocity]))
        return [
            state.thrust / float(setting.thrust[0]) - 1.0,
            pitch / float(setting.pitch_ratio[0]) - 1.0,
        ]

    found = scipy.optimize.root(off, np.ones(2), tol=1e-9)
    if not found.success:
        raise RuntimeError(f"{ship.name}, {error}: no steady state ({found.message})")
    return seen(*map(float, found.x * scale))


def error_row(ship: Ship, error: Error) -> dict[str, float]:
    """Return errors and lost fuel at the middle lever, and the worst of levers 1 to 4."""
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    known = combinator_surface(actual, WHOLE_ENVELOPE)
    rows = []
    for order in lever_speeds(ship)[:4]:
        state, reference = (settle(ship, one, order, RISE) for one in (error, Error()))
        point = state.point
        best = optimal_state(actual, known, point.ship_speed, RISE)
        assert best is not None
        ratios = {
            "thrust estimate [%]": state.thrust / point.thrust,
            "v_a estimate [%]": state.advance_velocity / point.advance_velocity,
            "ship speed [%]": point.ship_speed / reference.point.ship_speed,
            LOST: point.fuel_flow / best.fuel_flow,
        }
        rows.append({name: 100.0 * (ratio - 1.0) for name, ratio in ratios.items()})
    return rows[2] | {MOST: max(row[LOST] for row in rows)}


def noise_row(ship: Ship) -> dict[str, float]:
    """Return the row for white noise of the torque, the middle lever simulated in closed loop."""
    order, record = lever_speeds(ship)[2], ship.record()
    noises: list[dict[str, float]] = [
        {},
        {"shaft_torque": NOISE * float(record["torque_limit"] * record["gear_ratio"])},
    ]
    means = []
    for noise in noises:
        pilot = CppOptimiser(ship)
        log = experiment.simulate_voyage(ship, pilot, order, order, observer=OBSERVER, noise=noise)
        means.append(log[log["time_s"] > STEP_AT + 150.0].mean())
    ratio = means[1] / means[0]
    speed = ratio["ship_speed_m_s"]
    # fuel at equal speed: it goes about with the speed's power of the resistance and one more
    fuel = ratio["fuel_kg_s"] / speed ** (1.0 + ship.hull.resistance_exponent)
    return {"ship speed [%]": 100.0 * (speed - 1.0), LOST: 100.0 * (fuel - 1.0)}


def error_table(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return the effect of every error on every ferry."""
    noise, rows = f"torque noise {100.0 * NOISE:g} % of the limit, {OBSERVER}", []
    for name in SHIPS:
        ship = load_ship(name)
        for what in (*ERRORS, noise):
            found = error_row(ship, ERRORS[what]) if what in ERRORS else noise_row(ship)
            rows.append({"ship": name, "wrong": what, **found})
            tick()
    return pd.DataFrame(rows)


def pitch_table(tick: Tick = lambda: None) -> pd.DataFrame:
    """Compare pitch at the ordered and at the actual thrust, in a step of the set-point and in waves.

    Each has the default filter of the estimates, and one that is eight times faster.
    """
    rows = []
    for name, at in itertools.product(SHIPS, ("ordered", "actual")):
        ship = load_ship(name)
        slow, fast = (lever_speeds(ship)[i] for i in (0, 3))
        for filter_s in (FILTER_S, FILTER_S / 8.0):
            pilot = CppOptimiser(ship, pitch_at=at, filter_s=filter_s)
            step = experiment.simulate_voyage(ship, pilot, slow, fast, rise=1.0)
            after = step[step["time_s"] > STEP_AT]
            gone = np.abs(after["ship_speed_m_s"] - after["ship_speed_m_s"].iloc[-1]) > 0.02 * (
                fast - slow
            )
            waves = experiment.simulate_voyage(ship, pilot, fast, fast, sea=SEA, rise=1.0)
            swing = [
                float(waves["pitch_ratio"][waves["time_s"].between(*span)].std())
                for span in ((100.0, 350.0), (350.0, 600.0))
            ]
            kept = waves[waves["time_s"] > 100.0]
            thrust, mean = kept["thrust_N"], kept.mean()
            rows.append(
                {
                    "ship": name,
                    "pitch at": at,
                    "filter [s]": filter_s,
                    "step: settled after [s]": float(after["time_s"][gone].max() - STEP_AT),
                    "step: pitch overshoot [-]": _beyond(after["pitch_ratio"].to_numpy()),
                    SWING: swing[0],
                    "second half": swing[1],
                    "fluctuation of thrust [%]": 100.0 * float(thrust.std() / thrust.mean()),
                    "fuel [kg/nmi]": 1852.0 * float(mean["fuel_kg_s"] / mean["ship_speed_m_s"]),
                }
            )
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
    screw, names = ship.propeller, ("KT", "10 KQ", "open-water efficiency")
    for i, pitch in enumerate(
        np.linspace(screw.pitch_ratio_min, screw.pitch_ratio_max, 5).tolist()
    ):
        j = np.linspace(0.0, 0.98 * pitch, 80)
        kt, kq = (np.array([surface(m, x, pitch) for x in j]) for m in fit[:2])
        curves = (kt, 10.0 * kq, np.clip(j * kt / (2.0 * np.pi * kq), 0.0, None))
        for axis, curve, name in zip(axes[0], curves, names, strict=True):
            axis.plot(j, curve, color=figures.PALETTE[i], label=f"P/D {pitch:.1f}")
            label_axis(axis, "J", title=name, size=9, ticks=None)
    axes[0, 0].legend(fontsize=8, frameon=False)
    return figure


def draw_zone(ship: Ship, fit: OpenWaterFit) -> Figure:
    """Draw the zone where the efficiency falls with J, over all pitches and at one."""
    figure, axes = figures.new_figure(1, 2, (11.0, 4.2))
    low, high = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max
    pitches = np.linspace(low, high, 60)
    advances = np.linspace(0.01, 0.95 * open_water.highest_j(high), 120)
    value, falls = np.full((60, 120), np.nan), np.zeros((60, 120))
    for a, b in np.ndindex(value.shape):
        at = float(advances[b]), float(pitches[a])
        if surface(fit.thrust, *at) > 0.0:
            kt, kq = (surface(curve, *at) for curve in fit[:2])
            kt_slope, kq_slope = (open_water.surface_slope(curve, *at) for curve in fit[:2])
            value[a, b] = at[0] * kt / (2.0 * np.pi * kq)
            falls[a, b] = (kt + at[0] * kt_slope) * kq < at[0] * kt * kq_slope
    left, right = axes[0]
    lines = left.contour(
        advances,
        pitches,
        value,
        levels=np.arange(0.1, 0.8, 0.1),
        colors=figures.THESIS,
        linewidths=0.8,
    )
    left.clabel(lines, fontsize=7)
    left.contourf(advances, pitches, falls, levels=[0.5, 1.5], colors=[figures.ESTIMATE], alpha=0.3)
    title = "efficiency; crossed out (red) where it falls with J"
    label_axis(left, "J", "P/D", title, 9, None)
    keep = np.isfinite(value[30])
    j, efficiency, below = advances[keep], value[30][keep], falls[30][keep] > 0.5
    right.plot(j, efficiency, color=figures.TRUTH)
    right.fill_between(j, 0.0, efficiency, where=below, color=figures.ESTIMATE, alpha=0.3)
    label_axis(right, "J", title=f"at P/D {pitches[30]:.2f}", size=9, ticks=None)
    return figure


NAMES = ("none", "torque", "engine speed", "highest pitch", "efficiency's slope", "cavitation")


def active(ship: Ship, fit: OpenWaterFit, table: CombinatorSurface) -> NDArray[np.int64]:
    """Return the active constraint at each node of a surface, as an index into :data:`NAMES`."""
    plant, (slowest, top) = ship.record(), ship.shaft_speeds
    found = np.zeros(table.shaft_speed.shape, dtype=np.int64)
    for i, k in np.ndindex(found.shape):
        state = float(table.shaft_speed[i, k]), float(table.pitch_ratio[i, k])
        velocity = float(table.advance_velocity[i])
        at = open_water.working_point(plant, fit.thrust, fit.torque, velocity, *state)
        held = (
            at.torque_share > 0.995,
            not 1.005 * slowest < state[0] < 0.995 * top,
            state[1] > ship.propeller.pitch_ratio_max - 0.005,
            at.efficiency_slope < 0.005,
            at.burrill > 0.995,
        )
        found[i, k] = next((n for n, holds in enumerate(held, 1) if holds), 0)
    return found


def draw_surfaces(ship: Ship, fit: OpenWaterFit, table: CombinatorSurface) -> Figure:
    """Draw optimal shaft speed and pitch, with the active constraint."""
    figure, axes = figures.new_figure(1, 2, (12.5, 5.0))
    velocity = np.repeat(table.advance_velocity[:, None], len(table.share), axis=1)
    span = (table.most_thrust - table.least_thrust)[:, None]
    thrust = 1e-3 * (table.least_thrust[:, None] + span * table.share)
    held = active(ship, fit, table)
    shown = {"shaft speed [rpm]": table.shaft_speed * 30.0 / np.pi, "P/D": table.pitch_ratio}
    for axis, (name, values) in zip(axes[0], shown.items(), strict=True):
        lines = axis.contour(velocity, thrust, values, 12, colors=figures.THESIS, linewidths=0.9)
        axis.clabel(lines, fontsize=7)
        for n in np.unique(held).tolist():
            at = held == n
            axis.plot(velocity[at], thrust[at], "o", ms=3, color=figures.PALETTE[n], label=NAMES[n])
        y = "thrust of one propeller [kN]"
        label_axis(axis, "advance speed [m/s]", y, f"optimal {name}", 9, None)
    axes[0, 1].legend(fontsize=8, frameon=False, title="constraint that holds", title_fontsize=8)
    return figure


def cells_of(fit: OpenWaterFit) -> list[Cell]:
    """Return the paper's one number on the open-water fit with ours.

    Sections 2 to 4 and 6 print no other number.
    """
    return [
        Cell(
            "section 2.1",
            f"largest error of the fitted {name} [% of its largest]",
            "",
            100.0 * error,
            0.0,
            0.4,
            "the limit that the words name",
            Kind.CALIBRATED,
            words="none greater than 0.4 %",
        )
        for name, error in (("KT", fit.thrust_error), ("KQ", fit.torque_error))
    ]


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
    swing = pitch.set_index(["pitch at", "ship", "filter [s]"])[SWING]
    body = fill_template(
        Path(__file__).with_suffix(".md"),
        errors=rounded,
        pitch=pitch,
        least=wrong.loc[wrong["ship"] == "ferry", MOST].max(),
        most=wrong[MOST].max(),
        thrust=wrong["thrust estimate [%]"].abs().max(),
        speed=wrong["ship speed [%]"].abs().max(),
        sea=SEA.replace(",", ", "),
        more=np.floor((swing["actual"] / swing["ordered"]).min()),
    )
    numbers = {
        f"{row['ship']}, {row['wrong']}": row.drop(["ship", "wrong"]).dropna().to_dict()
        for _, row in wrong.iterrows()
    }
    shown = wrong.round(2).astype(dict.fromkeys(wrong.columns, object)).astype(str)
    return Page(cells_of(fit), body, drawn, numbers, wrong, shown)


TITLE = "CPP optimiser: fitted surfaces, cost of errors, and pitch at the actual thrust"
STUDY = Study(TITLE, page, len(SHIPS) * (len(ERRORS) + 1 + 2) + 1)
