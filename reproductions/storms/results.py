"""Anti-spin on against off in storms, beside Table 1 of the anti-spin paper (Pivano et al. 2008).

Storms are sea state 6 in which the frigate's propellers ventilate, with the ship
free to slow down or held at its speed as the paper's carriage is. Intervals are percentile bootstrap
intervals of 95 % over the seeds, changes being paired by seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.baselines.anti_spin import AntiSpin
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load
from shaftline.plant.surroundings import GRAVITY

from ..side_by_side import published
from .experiment import (
    INTERVAL_STEPS,
    ORDER_M_S,
    RESISTANCE_FACTOR,
    Storm,
    event_counts,
    key_numbers,
    sail,
    sample_scores,
    storm_frigate,
    truth_and_detection,
)

SEEDS = range(100, 120)
"""None of these seas was sailed while tuning."""

FIXED = {"ventilation.suction_gain": 0.0, "ventilation.static_head_share": 0.0,
         "ventilation.surface_loss": 0.0, "ventilation.onset_submergence": 1.0}  # fmt: skip
"""The same shares of thrust and torque lost at any shaft speed, by depth alone: for comparison."""

DRY = {"ventilation.thrust_loss": 0.0, "ventilation.torque_loss": 0.0,
       "ventilation.surface_loss": 0.0}  # fmt: skip
HELD = {"hull.mass_kg": 1e9}
"""A hull too heavy to slow down: the paper's towing carriage."""

HELD_SPEED_M_S = 6.4
"""About what the free ship keeps at an order of 8 m/s without anti-spin."""

HIGH_ORDER_M_S = 11.0
"""An order near the highest: twice the thrust of 8 m/s."""


class Case(NamedTuple):
    """A storm: changes to :func:`~.experiment.storm_frigate`, and the ordered speed [m/s]."""

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
    """What the study found: every number, and one storm's traces to draw."""

    numbers: pd.DataFrame  # case, controller, quantity, value, low, high
    traces: dict[str, Storm]  # by controller
    suction_heads: dict[str, float]  # H/R [-] by case, the towing tank's beside them


class Bootstrap:
    """Percentile bootstrap over seeds; every statistic sees the same resampled seeds."""

    def __init__(self, seeds: int, draws: int = 4000) -> None:
        self.pick = np.random.default_rng(0).integers(0, seeds, (draws, seeds))

    def ratio(self, above: Any, below: Any) -> tuple[float, float, float]:
        """Sum of one value a seed over the sum of another, with its 95 % interval."""
        above, below = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
        drawn = above[self.pick].sum(axis=1) / np.maximum(below[self.pick].sum(axis=1), 1e-9)
        low, high = np.percentile(drawn, [2.5, 97.5])
        return float(above.sum() / max(below.sum(), 1e-9)), float(low), float(high)

    def mean(self, values: NDArray[np.float64]) -> tuple[float, float, float]:
        """Mean over the seeds, with its 95 % interval."""
        return self.ratio(values, np.ones_like(values))


def stormy(case: str, seeds: range, options: dict[str, Any]) -> Storm:
    """One of :data:`CASES` under :class:`~.AntiSpin` with some options, a ship a seed."""
    changes, order = CASES[case]
    ship = storm_frigate(**changes)
    start = HELD_SPEED_M_S if "hull.mass_kg" in changes else None
    return sail(ship, AntiSpin(ship, **options), order_m_s=order, start_m_s=start, sea="state-6",
                seeds=seeds, resistance_factor=RESISTANCE_FACTOR)  # fmt: skip


def suction_of(ship: Ship, thrust: float) -> float:
    """Return the suction head H/R [-] of a thrust [N] of one propeller: a column of water over R."""
    radius = 0.5 * ship.propeller.diameter_m
    return thrust / (ship.water.density_kg_m3 * GRAVITY * math.pi * radius**3)


def _suction(ship: Ship, storm: Storm) -> float:
    """Return the mean suction head of a run's samples with less than a tenth of air."""
    return suction_of(ship, float(storm.thrust[storm.ventilation < 0.1].mean()))


def _effects(case: str, runs: dict[str, Storm], over_seeds: Bootstrap) -> Rows:
    """Key numbers of every controller and their changes against anti-spin off."""
    off = key_numbers(runs[OFF])
    rows: Rows = []
    for name, storm in runs.items():
        for quantity, values in key_numbers(storm).items():
            rows.append((case, name, quantity, *over_seeds.mean(values)))
            ratio = over_seeds.ratio(values, off[quantity])
            rows.append((case, f"{name} / {OFF}", quantity, *ratio))
    return rows


def _detections(case: str, runs: dict[str, Storm], over_seeds: Bootstrap) -> Rows:
    """Events and samples called against the truth, and the error of the estimated torque."""
    rows: Rows = []
    for name, storm in runs.items():
        truth, called = truth_and_detection(storm)
        right, calls, found, events = event_counts(truth, called).T
        torque = storm.propeller_torque
        error = storm.torque_estimate[:, 1:] - torque[:, :-1]
        precision, recall = sample_scores(truth, called, late=2)
        rows += [
            (case, name, "ventilated [-]", *over_seeds.mean(truth.mean(axis=1))),
            (case, name, "events: precision", *over_seeds.ratio(right, calls)),
            (case, name, "events: recall", *over_seeds.ratio(found, events)),
            (case, name, "samples 1 s late: precision", precision, np.nan, np.nan),
            (case, name, "samples 1 s late: recall", recall, np.nan, np.nan),
            (
                case,
                name,
                "rms error of Q_p / mean Q_p",
                error.std() / torque.mean(),
                np.nan,
                np.nan,
            ),
        ]
    return rows


def _alarms(ship: Ship, sea: str, order: float, seeds: range, over_seeds: Bootstrap,
            tick: Callable[[], None]) -> Rows:  # fmt: skip
    """False alarms where no propeller ventilates, and the ship speed that they cost."""
    runs = {}
    for name, options in OPTIONS.items():
        runs[name] = sail(ship, AntiSpin(ship, **options), order_m_s=order, sea=sea, seeds=seeds)
        tick()
    case = f"{sea}, {order:g} m/s, no ventilation"
    hours = runs[ON].detected.shape[1] * INTERVAL_STEPS * ship.time_step_s / 3600.0
    rows: Rows = []
    for name, storm in runs.items():
        alarms = event_counts(storm.ventilation > 0.5, storm.detected)[:, 1]
        rows.append((case, name, "false alarms [1/h]", *over_seeds.mean(alarms / hours)))
        speed, plain = (s.ship_speed.mean(axis=1) for s in (storm, runs[OFF]))
        rows.append((case, f"{name} / {OFF}", "ship speed [m/s]", *over_seeds.ratio(speed, plain)))
    return rows


def measured(tick: Callable[[], None] = lambda: None, seeds: range = SEEDS) -> Results:
    """Sail all storms and plain seas.

    Args:
        tick: called after each voyage, :data:`TICKS` times.
        seeds: of the seas.
    """
    over_seeds = Bootstrap(len(seeds))
    rows: Rows = []
    traces: dict[str, Storm] = {}
    heads = {"towing tank, 45 rad/s": _tank_suction(45.0)}
    for case, (changes, _) in CASES.items():
        runs = {}
        for name, options in OPTIONS.items():
            runs[name] = stormy(case, seeds, options)
            tick()
        traces = traces or {name: runs[name] for name in (ON, OFF)}
        rows += _effects(case, runs, over_seeds) + _detections(case, runs, over_seeds)
        heads[case] = _suction(storm_frigate(**changes), runs[OFF])
        off = key_numbers(runs[OFF])[EFFICIENCY]
        for share in VENTILATED_SPEEDS:
            slower = key_numbers(stormy(case, seeds, {"ventilated_speed": share}))[EFFICIENCY]
            name = f"anti-spin at {share:g} / {OFF}"
            rows.append((case, name, EFFICIENCY, *over_seeds.ratio(slower, off)))
            tick()
    dry = storm_frigate(**DRY)
    for sea in PLAIN_SEAS:
        for order in ORDERS_M_S:
            rows += _alarms(dry, sea, order, seeds, over_seeds, tick)
    columns = ["case", "controller", "quantity", "value", "low", "high"]
    return Results(pd.DataFrame(rows, columns=columns), traces, heads)


def _tank_suction(shaft_speed: float) -> float:
    rig = load_ship("towing-tank")
    return suction_of(rig, propeller_load(rig.record(), 0.0, shaft_speed, 1.0, 1.0, 0.0).thrust)


def beside_table_1(numbers: pd.DataFrame) -> pd.DataFrame:
    """Thrust, power and energy efficiency with anti-spin over without, the paper's row first."""
    tank = published("anti_spin_towing_tank")
    printed = tank.loc["anti-spin"] / tank.loc["no-anti-spin"]
    rows: list[tuple[str, Any, Any, Any]] = [("paper, Table 1", *printed)]
    ratios = numbers[numbers["controller"] == f"{ON} / {OFF}"].set_index(["case", "quantity"])
    for case in CASES:
        rows.append((case, *(ratios.loc[(case, q), "value"] for q in (THRUST, POWER, EFFICIENCY))))
    return pd.DataFrame(rows, columns=["storm", "thrust", "power", "energy efficiency"])
