"""Compare anti-spin on and off in storms with Table 1 of the anti-spin paper (Pivano et al. 2008).

Storms are head seas of state 6 in which the frigate's propellers ventilate, with the ship free to slow
down or held at its speed like the paper's carriage. Intervals are percentile bootstrap intervals of 95
% over the seeds; changes are paired by seed.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.baselines.anti_spin import AntiSpin
from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load
from shaftline.plant.surroundings import GRAVITY

from ..cells import Cell, half_digit, number
from ..pages import fill_template, label_axis
from ..side_by_side import Page, Study, Tick, published, published_text
from . import experiment
from .experiment import (
    ORDER_M_S,
    RESISTANCE_FACTOR,
    Storm,
    event_counts,
    key_numbers,
    storm_frigate,
)

SEEDS = range(100, 120)  # seeds of the seas; none of them was used while tuning
FIXED = {
    "ventilation.suction_gain": 0.0,
    "ventilation.static_head_share": 0.0,
    "ventilation.surface_loss": 0.0,
    "ventilation.onset_submergence": 1.0,
}
"""Losses of thrust and torque by depth alone, the same at any shaft speed, for comparison."""

DRY = {
    "ventilation.thrust_loss": 0.0,
    "ventilation.torque_loss": 0.0,
    "ventilation.surface_loss": 0.0,
}
HELD = {"hull.mass_kg": 1e9}  # A hull too heavy to slow down: the paper's towing carriage
HELD_SPEED_M_S = 6.4  # about the speed of the free ship at a set-point of 8 m/s without anti-spin
HIGH_ORDER_M_S = 11.0  # A set-point near the highest: twice the thrust of 8 m/s


class Case(NamedTuple):
    """A storm: changes to :func:`~.experiment.storm_frigate`, and the set-point of the speed [m/s]."""

    changes: dict[str, float]
    order_m_s: float = ORDER_M_S


CASES: dict[str, Case] = {
    "storm task": Case({}),
    "high thrust": Case({}, HIGH_ORDER_M_S),
    "high thrust, speed held": Case(HELD, HIGH_ORDER_M_S),
    "high thrust, shallow, speed held": Case(HELD | {"propeller.depth_m": 2.5}, HIGH_ORDER_M_S),
    "fixed shares": Case(FIXED),
}

ON, AWARE, OFF = "anti-spin", "anti-spin, sea margin 3", "without"
OPTIONS: dict[str, dict[str, Any]] = {ON: {}, AWARE: {"sea_margin": 3.0}, OFF: {"anti_spin": False}}
VENTILATED_SPEEDS = (0.6, 0.7, 0.8)
"""Other values of omega_v,opt over the calm-water speed; the paper's 45 rad/s is 0.6 of its highest."""

PLAIN_SEAS, ORDERS_M_S = ("state-5", "state-6"), (6.0, 8.0, 10.0)
THRUST, POWER, EFFICIENCY = "mean thrust [kN]", "mean power [kW]", "energy efficiency (27) [-]"
TICKS = len(CASES) * (len(OPTIONS) + len(VENTILATED_SPEEDS)) + 3 * len(PLAIN_SEAS) * len(ORDERS_M_S)

Rows = list[tuple[str, str, str, float, float, float]]


class Results(NamedTuple):
    """Every number of the study, and the traces of one storm."""

    numbers: pd.DataFrame  # case, controller, quantity, value, low, high
    traces: dict[str, Storm]  # by controller
    suction_heads: dict[str, float]  # H/R [-] by case, the towing tank's beside them


class Bootstrap:
    """Percentile bootstrap over seeds; every statistic sees the same resampled seeds."""

    def __init__(self, seeds: int) -> None:
        self.pick = np.random.default_rng(0).integers(0, seeds, (4000, seeds))

    def ratio(self, above: Any, below: Any) -> tuple[float, float, float]:
        """Return the sum of a value over that of another, over the seeds, with its 95 % interval."""
        above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
        drawn = above[self.pick].sum(axis=1) / np.maximum(below[self.pick].sum(axis=1), 1e-9)
        low, high = np.percentile(drawn, [2.5, 97.5])
        return float(above.sum() / max(below.sum(), 1e-9)), float(low), float(high)

    def mean(self, values: NDArray[np.float64]) -> tuple[float, float, float]:
        """Return the mean over the seeds, with its 95 % interval."""
        return self.ratio(values, np.ones_like(values))


def simulate_case(case: str, seeds: range, options: dict[str, Any]) -> Storm:
    """Simulate one of :data:`CASES` under :class:`~.AntiSpin`, one ship for each seed."""
    changes, order = CASES[case]
    ship, start = storm_frigate(**changes), HELD_SPEED_M_S if "hull.mass_kg" in changes else None
    return experiment.simulate_storm(
        ship,
        AntiSpin(ship, **options),
        order_m_s=order,
        start_m_s=start,
        sea="state-6",
        seeds=seeds,
        resistance_factor=RESISTANCE_FACTOR,
    )


def suction_of(ship: Ship, thrust: float) -> float:
    """Return the suction head H/R [-] of a thrust [N] of one propeller: a column of water over R."""
    radius = 0.5 * ship.propeller.diameter_m
    return thrust / (ship.water.density_kg_m3 * GRAVITY * math.pi * radius**3)


def _effects(case: str, runs: dict[str, Storm], over_seeds: Bootstrap) -> Rows:
    """Return key numbers of every controller and their changes against anti-spin off."""
    off = key_numbers(runs[OFF])
    rows: Rows = []
    for name, storm in runs.items():
        for quantity, values in key_numbers(storm).items():
            rows.append((case, name, quantity, *over_seeds.mean(values)))
            ratio = over_seeds.ratio(values, off[quantity])
            rows.append((case, f"{name} / {OFF}", quantity, *ratio))
    return rows


def _detections(case: str, runs: dict[str, Storm], over_seeds: Bootstrap) -> Rows:
    """Return scores of the detection, and the error of the estimated torque."""
    rows: Rows = []
    for name, storm in runs.items():
        truth, called = experiment.truth_and_detection(storm)
        right, calls, found, events = event_counts(truth, called).T
        precision, recall = experiment.sample_scores(truth, called, late=2)
        torque = storm.propeller_torque
        error = (storm.torque_estimate[:, 1:] - torque[:, :-1]).std() / torque.mean()
        values = {
            "ventilated [-]": over_seeds.mean(truth.mean(axis=1)),
            "events: precision": over_seeds.ratio(right, calls),
            "events: recall": over_seeds.ratio(found, events),
            "samples 1 s late: precision": (precision, np.nan, np.nan),
            "samples 1 s late: recall": (recall, np.nan, np.nan),
            "rms error of Q_p / mean Q_p": (error, np.nan, np.nan),
        }
        rows += [(case, name, quantity, *value) for quantity, value in values.items()]
    return rows


def _alarms(
    ship: Ship, sea: str, order: float, seeds: range, over_seeds: Bootstrap, tick: Tick
) -> Rows:
    """Return false alarms where no propeller ventilates, and the ship speed that they cost."""
    runs = {}
    for name, options in OPTIONS.items():
        control = AntiSpin(ship, **options)
        runs[name] = experiment.simulate_storm(ship, control, order_m_s=order, sea=sea, seeds=seeds)
        tick()
    case = f"{sea}, {order:g} m/s, no ventilation"
    interval = experiment.INTERVAL_STEPS * ship.time_step_s
    hours = runs[ON].detected.shape[1] * interval / 3600.0
    rows: Rows = []
    for name, storm in runs.items():
        alarms = event_counts(storm.ventilation > 0.5, storm.detected)[:, 1]
        rows.append((case, name, "false alarms [1/h]", *over_seeds.mean(alarms / hours)))
        speed, plain = (s.ship_speed.mean(axis=1) for s in (storm, runs[OFF]))
        rows.append((case, f"{name} / {OFF}", "ship speed [m/s]", *over_seeds.ratio(speed, plain)))
    return rows


def compute_results(tick: Tick = lambda: None, seeds: range = SEEDS) -> Results:
    """Simulate all storms and plain seas."""
    over_seeds = Bootstrap(len(seeds))
    rows: Rows = []
    traces: dict[str, Storm] = {}
    rig = load_ship("towing-tank")
    tank = propeller_load(rig.record(), 0.0, 45.0, 1.0, 1.0, 0.0).thrust
    heads = {"towing tank, 45 rad/s": suction_of(rig, tank)}
    for case, (changes, _) in CASES.items():
        runs = {}
        for name, options in OPTIONS.items():
            runs[name] = simulate_case(case, seeds, options)
            tick()
        traces = traces or {name: runs[name] for name in (ON, OFF)}
        rows += _effects(case, runs, over_seeds) + _detections(case, runs, over_seeds)
        without = runs[OFF]
        dry = float(without.thrust[without.ventilation < 0.1].mean())
        heads[case] = suction_of(storm_frigate(**changes), dry)
        for share in VENTILATED_SPEEDS:
            slower = key_numbers(simulate_case(case, seeds, {"ventilated_speed": share}))[
                EFFICIENCY
            ]
            ratio = over_seeds.ratio(slower, key_numbers(without)[EFFICIENCY])
            rows.append((case, f"anti-spin at {share:g} / {OFF}", EFFICIENCY, *ratio))
            tick()
    for sea in PLAIN_SEAS:
        for order in ORDERS_M_S:
            rows += _alarms(storm_frigate(**DRY), sea, order, seeds, over_seeds, tick)
    columns = ["case", "controller", "quantity", "value", "low", "high"]
    return Results(pd.DataFrame(rows, columns=columns), traces, heads)


def beside_table_1(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return thrust, power and energy efficiency with anti-spin over without, the paper's row first."""
    tank = published("anti_spin_towing_tank")
    rows: list[tuple[Any, ...]] = [
        ("paper, Table 1", *(tank.loc["anti-spin"] / tank.loc["no-anti-spin"]))
    ]
    ratios = numbers[numbers["controller"] == f"{ON} / {OFF}"].set_index(["case", "quantity"])[
        "value"
    ]
    rows += [(case, *(ratios[case, q] for q in (THRUST, POWER, EFFICIENCY))) for case in CASES]
    return pd.DataFrame(rows, columns=["storm", "thrust", "power", "energy efficiency"])


_SHOWN_S = 90.0
NEAREST = "high thrust, speed held"
"""The storm that is nearest to the paper's test: a carriage that keeps its speed."""


def cells(beside: pd.DataFrame) -> list[Cell]:
    """Return the paper's ratios beside those of the storm nearest to its test."""
    digits, ours = published_text("anti_spin_towing_tank"), beside.set_index("storm").loc[NEAREST]
    basis, found = "half a unit of the last digit of both printed numbers", []
    for name, a, b in zip(
        ours.index, digits.loc["anti-spin"], digits.loc["no-anti-spin"], strict=True
    ):
        ratio, share = float(a) / float(b), half_digit(a) / float(a) + half_digit(b) / float(b)
        row = f"{name}, anti-spin over without"
        found.append(number("Table 1", row, "", ours[name], ratio, ratio * share, basis))
    return found


def _tables(results: Results, beside: pd.DataFrame) -> dict[str, Any]:
    """Return the tables of the page."""
    table: Any = results.numbers.set_index(["case", "controller", "quantity"])

    def cell(case: str, controller: str, quantity: str, style: str) -> str:
        value, low, high = table.loc[case, controller, quantity]
        around = "" if np.isnan(low) else f" ({low:{style}} to {high:{style}})"
        return f"{value:{style}}{around}"

    def change(case: str, controller: str, quantity: str) -> str:
        _, low, high = 100.0 * (table.loc[case, f"{controller} / {OFF}", quantity] - 1.0)
        return f"{low:+.1f} to {high:+.1f} %"

    ratio, alarms, speed = f"{ON} / {OFF}", "false alarms [1/h]", "ship speed [m/s]"
    first = [["paper, Table 1", *(f"{value:.2f}" for value in beside.iloc[0, 1:])]]
    first += [[c, *(cell(c, ratio, q, ".2f") for q in (THRUST, POWER, EFFICIENCY))] for c in CASES]
    shares = {f"{share:g}": f"anti-spin at {share:g} / {OFF}" for share in VENTILATED_SPEEDS}
    shares["0.92 (kept)"] = ratio
    sweep = [[c, *(cell(c, name, EFFICIENCY, ".2f") for name in shares.values())] for c in CASES]
    named = results.numbers["quantity"].unique()
    quantities = [q for q in named if "[" in q and "alarms" not in q and "vent" not in q]
    effects = {
        case: pd.DataFrame(
            [
                [
                    q,
                    *(f"{table.loc[case, name, q]['value']:.4g}" for name in (ON, OFF)),
                    change(case, ON, q),
                    change(case, AWARE, q),
                ]
                for q in quantities
            ],
            columns=["quantity", ON, OFF, "change, 95 %", "change with sea margin 3, 95 %"],
        )
        for case in (next(iter(CASES)), NEAREST)
    }
    scores = [q for q in named if q.startswith(("ventilated", "events", "samples", "rms"))]
    detected = [
        [c, n, *(cell(c, n, s, ".2f") for s in scores)] for c in CASES for n in (ON, AWARE, OFF)
    ]
    plain = [
        [
            c.split(", no")[0],
            cell(c, ON, alarms, ".1f"),
            cell(c, AWARE, alarms, ".1f"),
            change(c, ON, speed),
            change(c, AWARE, speed),
        ]
        for c in results.numbers["case"].unique()
        if c not in CASES
    ]
    of_plain = [
        "sea, order",
        "paper's rule [1/h]",
        "sea margin 3 [1/h]",
        "change of ship speed",
        "change with sea margin 3",
    ]
    return {
        "first": pd.DataFrame(
            first, columns=["storm", "thrust", "power", "energy efficiency (27)"]
        ),
        "sweep": pd.DataFrame(sweep, columns=["storm", *shares]),
        "effects": effects,
        "detected": pd.DataFrame(detected, columns=["storm", "controller", *scores]),
        "plain": pd.DataFrame(plain, columns=of_plain),
    }


def body(results: Results, beside: pd.DataFrame) -> str:
    """Return the text of the page."""
    table = results.numbers.set_index(["controller", "case", "quantity"])["value"]
    change = 100.0 * (table.loc[f"{ON} / {OFF}"] - 1.0)
    return fill_template(
        Path(__file__).with_suffix(".md"),
        **_tables(results, beside),
        resistance=RESISTANCE_FACTOR,
        seeds=len(SEEDS),
        order=ORDER_M_S,
        high_order=HIGH_ORDER_M_S,
        held_speed=HELD_SPEED_M_S,
        change=change,
        heads=results.suction_heads,
        gains=[change[c, EFFICIENCY] for c in CASES],
        nearest=NEAREST,
        thrust=THRUST,
        power=POWER,
        efficiency=EFFICIENCY,
    )


def figure(traces: dict[str, Storm], dt: float) -> Figure:
    """Draw the first ship over time: shaft speed, torque, thrust and detected ventilation.

    The storms, by controller, have the same seeds; ``dt`` is the plant's time step [s].
    """
    drawn, axes = new_figure(4, 1, (9.5, 8.5))
    *upper, lowest = axes[:, 0]
    interval = experiment.INTERVAL_STEPS * dt
    kept = slice(0, round(_SHOWN_S / interval))
    for row, (name, storm) in enumerate(traces.items()):
        time, color = interval * np.arange(storm.thrust.shape[1])[kept], PALETTE[1 - row % 2]
        panels = (
            (storm.shaft_speed, "shaft speed [rad/s]"),
            (storm.propeller_torque * 1e-3, "propeller torque [kN m]"),
            (storm.thrust * 1e-3, "thrust [kN]"),
        )
        for axis, (values, label) in zip(upper, panels, strict=True):
            axis.plot(time, values[0, kept], color=color, linewidth=1.1, label=name)
            axis.set_ylabel(label, fontsize=9)
        called = storm.detected[0, kept]
        lowest.fill_between(time, row, row + 0.4 * called, step="post", color=color, linewidth=0)
        lowest.plot(time, row + 0.8 * storm.ventilation[0, kept], color=TRUTH, linewidth=0.9)
    upper[0].legend(fontsize=8, frameon=False, loc="upper right")
    title = "detected (filled) and true degree of ventilation (line)"
    label_axis(lowest, "time [s]", title=title, size=9, ticks=None)
    lowest.set_yticks([0.2, 1.2], list(traces), fontsize=8)
    lowest.axhline(1.0, color=THESIS, linewidth=0.6)
    return drawn


def page(tick: Tick) -> Page:
    """Return the page of Table 1 of the anti-spin paper beside storms at sea."""
    results = compute_results(tick)
    beside = beside_table_1(results.numbers)
    numbers = beside.set_index("storm").to_dict("index")
    drawn = {"storms": figure(results.traces, load_ship("frigate").time_step_s)}
    return Page(cells(beside), body(results, beside), drawn, numbers, results.numbers, beside)


STUDY = Study("Anti-spin in storms at sea, with and without", page, TICKS)
