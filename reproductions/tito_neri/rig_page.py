"""Test the identification methods on the synthetic rig: Table 3 as a programme, and condition
monitoring.

Table 3 of Vrijdag & Martelli 2021 states which test serves which method, and which validates it; here
every method meets every test (eqs. 20 and 21). Condition monitoring is the purpose that the paper
states in section 6: the smallest change of a parameter that each method detects from a recording of 30
s.

Run ``python -m reproductions tito_neri.rig_page --out docs/results``; about five minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import ESTIMATE, TRUTH, new_figure, save
from shaftline.display.tables import markdown
from shaftline.mismatch import fit_percent, identify
from shaftline.mismatch.identification.drive_train import CONSTANT, FRICTION, LOAD, RESISTANCE, SIX
from shaftline.mismatch.identification.free_parameters import number_of, parse_free
from shaftline.mismatch.identification.frequency import SPEED, fit
from shaftline.mismatch.identification.sine import sine, sine_response
from shaftline.mismatch.identification.steady import CURRENT
from shaftline.mismatch.identification.step import step
from shaftline.mismatch.identification.welch import keep_coherent, noise_response, welch
from shaftline.plant import Ship, load_ship, simulate_recording

from ..pages import make_parser, write_page
from ..side_by_side import Tick
from . import experiments, rig
from .experiments import FAST_S, POINT_C_V, Experiment, staircase
from .identification import DELAY, SETS, percent_off
from .rig import FINE_S, record_test

LATE = (*SIX, DELAY)

METHODS: dict[str, tuple[Callable[..., Any], str, tuple[str, ...]]] = {
    "step": (step, "staircase", SIX),
    "sine": (sine, "sines", LATE),
    "welch": (welch, "noise", LATE),
}
"""Each method with its test (Table 3) and its free parameters."""

OUTPUT_ERROR = "output-error"  # the paper's method 3, for any test; it is not used for monitoring
THINNED = 10  # output error uses one row in this many
WATCHED = {FRICTION: 0.20, LOAD: 0.10, RESISTANCE: 0.15, CONSTANT: -0.05}
"""Monitored parameters, and a change of each: worn bearings, a fouled propeller, a warm winding,
weak magnets."""

RECORDS, TRIALS = 12, 4  # records of the unchanged rig, and of each change
ALARM, SURE = 1.96, 1.645
"""Standard deviations of an alarm in 5 % of the unchanged and in 95 % of the changed records."""


def truth() -> Ship:
    """Return the rig's drive train."""
    return load_ship(SETS["IV"])


def start() -> Ship:
    """Return the start of the searches: the other published set, in the rig's water."""
    ship = truth()
    return ship.with_values({key: number_of(load_ship(SETS["I"]), key).value for key in SIX})


class Validation(NamedTuple):
    """Table 3 as a programme."""

    numbers: pd.DataFrame  # errors of the parameters that each method found [%]
    fits: pd.DataFrame  # FitPercent and MSE of speed and current for every method and test


def validation(tick: Tick = lambda: None) -> Validation:
    """Return each method's parameters from its test, and their fit on every test."""
    records: dict[str, list[pd.DataFrame]] = {}
    for name, make in experiments.MATRIX.items():
        records[name] = [record_test(truth(), test, seed=i) for i, test in enumerate(make())]
        tick()
    ships, numbers, rows = {"the truth": truth()}, [], []
    for method, test in TESTS.items():
        values = numbers_by(method, records[test])
        ships[method] = start().with_values({**values, "integration.time_step_s": FINE_S})
        off = percent_off({key: values[key] for key in SIX}, truth())
        short = {key.split(".")[1]: value for key, value in off.items()}
        numbers.append({"method": method, **short, "delay_ms": 1e3 * values.get(DELAY, math.nan)})
        tick()
    for method, ship in ships.items():
        for test, tables in records.items():
            used = "yes" if TESTS.get(method) == test else ""
            rows.append({"method": method, "test": test, "used": used, **_scores(ship, tables)})
    return Validation(pd.DataFrame(numbers), pd.DataFrame(rows))


TESTS = {name: test for name, (_, test, _) in METHODS.items()} | {OUTPUT_ERROR: "staircase"}
"""The test of each method."""


def numbers_by(method: str, tables: list[pd.DataFrame]) -> dict[str, float]:
    """Return the parameters that a method identifies from its test, by key."""
    if method in METHODS:
        find, _, free = METHODS[method]
        found = find(start(), tables, free)
        return dict(zip(found.keys, found.values, strict=True))
    ship = start().with_values({"integration.time_step_s": FINE_S})
    thinned = [table.iloc[::THINNED].reset_index(drop=True) for table in tables]
    return identify(ship, *thinned, free=LATE, method=method).parameters


def _scores(ship: Ship, tables: list[pd.DataFrame]) -> dict[str, float]:
    """Return FitPercent (eq. 20) and MSE (eq. 21) over all recordings of a test."""
    simulated = [simulate_recording(ship, table) for table in tables]
    found = {}
    for name, column in (("speed", SPEED), ("current", CURRENT)):
        y = np.concatenate([table[column] for table in tables])
        model = np.concatenate([table[column] for table in simulated])
        found[f"{name}_fit_percent"] = fit_percent(y, model)
        found[f"{name}_mse"] = float(np.mean((y - model) ** 2))
    return found


def record_of_30_s(method: str, seed: int) -> Experiment:
    """Return the test of a method that fits into 30 s."""
    if method == "step":
        return experiments.staircase(hold_s=6.0)
    if method == "welch":
        values = experiments.noise(30.0, seed).voltage
        return Experiment("noise", FAST_S, np.repeat(values, round(experiments.USUAL_S / FAST_S)))
    parts = []
    for frequency, seconds in zip(SINES_RAD_S, SECONDS, strict=True):
        period = 2.0 * math.pi / frequency
        rows = round(round(seconds / period) * period / FAST_S)
        swing = experiments.AMPLITUDE * np.sin(frequency * np.arange(rows) * FAST_S)
        parts.append(POINT_C_V * (1.0 + swing))
    return Experiment("sines", FAST_S, np.concatenate(parts))


SINES_RAD_S = (1.2, 3.0, 6.0, 10.0, 20.0, 60.0, 200.0, 500.0)
SECONDS = (10.5, 4.2, 3.2, 2.5, 2.4, 2.4, 2.4, 2.4)
"""Durations [s] of the sines within a record of 30 s."""


def estimates(method: str, ship: Ship, seed: int) -> dict[str, dict[str, float]]:
    """Return the monitored parameters from one record of 30 s, all free together and each alone.

    Alone, the other parameters and the delay are those of the unchanged rig.
    """
    table, known = record_test(ship, record_of_30_s(method, seed), seed=seed), truth()
    if method == "step":
        found = step(known, [table], SIX)
        together = dict(zip(found.keys, found.values, strict=True))
        alone = {key: step(known, [table], (key,)).values[0] for key in WATCHED}
    else:
        response = (
            sine_response(known, [table]) if method == "sine" else noise_response(known, [table])
        )
        if method == "welch":
            response = keep_coherent(response)

        def fitted(ship: Ship, free: tuple[str, ...]) -> dict[str, float]:
            values = fit(parse_free(ship, free, ()), response, method).values
            return dict(zip(free, map(float, values), strict=True))

        together, known = fitted(known, LATE), known.with_values({DELAY: USUAL_DELAY_S})
        alone = {key: fitted(known, (key,))[key] for key in WATCHED}
    return {"together": {key: together[key] for key in WATCHED}, "alone": alone}


USUAL_DELAY_S = 1.95e-3  # delay of the encoder at point C: the time between two flanks


def monitoring(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return the smallest change of each monitored parameter that each method detects in 30 s.

    One row for each method, parameter and way (all free together, or this one alone): scatter of the
    estimates, alarm that 5 % of the unchanged exceed, smallest change that exceeds it in 95 % of the
    records; and for the change that was tried, its mean estimate and the share of alarms.
    """
    rows: list[dict[str, Any]] = []
    for method in METHODS:
        usual = [estimates(method, truth(), seed) for seed in range(RECORDS)]
        tick()
        for key, change in WATCHED.items():
            value = number_of(truth(), key).value
            changed_ship = truth().with_values({key: (1.0 + change) * value})
            tried = [estimates(method, changed_ship, 100 + seed) for seed in range(TRIALS)]
            tick()
            for way in ("together", "alone"):
                before, after = (
                    np.array([one[way][key] for one in found]) / value for found in (usual, tried)
                )
                after = after - before.mean()
                scatter = float(before.std(ddof=1))
                alarm = ALARM * scatter * math.sqrt(1.0 + 1.0 / RECORDS)
                rows.append(
                    {
                        "method": method,
                        "number": key.split(".")[1],
                        "free": way,
                        "bias_percent": 100.0 * (before.mean() - 1.0),
                        "scatter_percent": 100.0 * scatter,
                        "alarm_percent": 100.0 * alarm,
                        "smallest_percent": 100.0 * (alarm + SURE * scatter),
                        "change_percent": 100.0 * change,
                        "found_percent": 100.0 * after.mean(),
                        "alarmed": float(np.mean(np.abs(after) > alarm)),
                    }
                )
    return pd.DataFrame(rows)


def draw_rig(orders: pd.DataFrame) -> Figure:
    """Draw the orders of the current (Figure 5), and three turns of the encoder (Figure 8)."""
    figure, axes = new_figure(1, 2, (10.5, 3.6))
    left, right = axes[0]
    left.plot(orders["order"], orders["current_A"], color=TRUTH, linewidth=0.8)
    left.set(xlabel="order of the motor's turn", ylabel="current [A]")
    last = record_test(truth(), staircase((5.89,), 1.5)).iloc[-900:]
    speed = truth().transmission.gear_ratio * last[SPEED]
    right.plot(last["time_s"], speed, color=ESTIMATE, drawstyle="steps-post")
    right.set(xlabel="time [s]", ylabel="motor speed [rad/s]")
    return figure


def cogs_in_current() -> tuple[float, float]:
    """Return the current of order 6 [A] at point C by cogging alone, and by all effects."""
    own = rig.Instruments(current_noise_A=0.0)
    found = []
    for some in (replace(own, ripple_6=0.0, ripple_12=0.0), own):
        table = record_test(truth(), staircase((5.89,), 4.0), some)
        orders = rig.order_spectrum(table, truth().transmission.gear_ratio).set_index("order")
        found.append(float(orders.loc[5.9:6.1, "current_A"].max()))
    return found[0], found[1]


def peaks(orders: pd.DataFrame, count: int = 2) -> list[float]:
    """Return the integer orders with the highest amplitude of the current."""
    some = orders[orders["order"] >= 1.0]
    best = some.groupby(some["order"].round())["current_A"].max().nlargest(count)
    return sorted(float(order) for order in best.index)


def main() -> None:
    """Write ``tito-neri-rig.md``, its table and its figure."""
    folder = make_parser("tito_neri.rig_page", __doc__, "out/tito-neri").parse_args().out
    orders = rig.order_spectrum(
        record_test(truth(), rig.order_ramp()), truth().transmission.gear_ratio
    )
    found, watch = validation(), monitoring()
    best = watch[watch["free"] == "together"]
    best = best.loc[best.groupby("number", sort=False)["smallest_percent"].idxmin()]
    save(draw_rig(orders), folder / "figures" / "tito-neri-rig.png")
    write_page(
        folder,
        "tito-neri-rig",
        "Identification and monitoring on a synthetic Tito Neri rig",
        "tito_neri.rig_page --out docs/results",
        watch,
        Path(__file__).with_name("rig.md"),
        own=rig.Instruments(),
        found=found,
        peaks=peaks(orders),
        currents=cogs_in_current(),
        watch=watch.drop(columns="bias_percent"),
        best=best.to_dict("records"),
        records=RECORDS,
        trials=TRIALS,
    )
    print(markdown(found.fits, 4), markdown(watch), sep="\n\n")
