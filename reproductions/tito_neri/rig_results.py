"""What the methods make of the synthetic rig: Table 3 as a programme, and condition monitoring.

Table 3 of Vrijdag & Martelli 2021 says which test serves which method, and which validates it; here
every method meets every test (eqs. 20 and 21). Condition monitoring is the purpose that the paper
states in section
6: of a record of 30 s, the smallest change of a number that each method detects.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from shaftline.mismatch import fit_percent, identify
from shaftline.mismatch.identification.drive_train import CONSTANT, FRICTION, LOAD, RESISTANCE, SIX
from shaftline.mismatch.identification.free_parameters import freed, number_of
from shaftline.mismatch.identification.frequency import SPEED, fit
from shaftline.mismatch.identification.sine import sine, sine_response
from shaftline.mismatch.identification.steady import CURRENT
from shaftline.mismatch.identification.step import step
from shaftline.mismatch.identification.welch import coherent, noise_response, welch
from shaftline.plant import Ship, load_ship, simulate_recording

from . import experiments
from .experiments import FAST_S, POINT_C_V, Experiment
from .rig import FINE_S, measured

Tick = Callable[[], None]

TRUTH, START = "tito-neri-sine", "tito-neri-staircase"
"""The rig's drive train, and whose numbers the searches begin at."""

DELAY = "sensors.speed_delay_s"
LATE = (*SIX, DELAY)

METHODS: dict[str, tuple[Callable[..., Any], str, tuple[str, ...]]] = {
    "step": (step, "staircase", SIX),
    "sine": (sine, "sines", LATE),
    "welch": (welch, "noise", LATE),
}
"""Each method, the test that it works on (Table 3), and what it finds."""

OUTPUT_ERROR = "output-error"
"""The paper's method 3: any test serves it, and it is not among those that watch."""

THINNED = 10
"""One row in so many is enough for it."""

WATCHED = {FRICTION: 0.20, LOAD: 0.10, RESISTANCE: 0.15, CONSTANT: -0.05}
"""Numbers that are watched, and a change of each: worn bearings, a fouled propeller, a warm winding,
weak magnets."""

RECORDS, TRIALS = 12, 4
"""Records of the unchanged rig, and of each change."""

ALARM, SURE = 1.96, 1.645
"""Standard deviations at which 5 % of the unchanged alarm, and by which 95 % of the changed pass it."""


def truth() -> Ship:
    """The rig's drive train."""
    return load_ship(TRUTH)


def start() -> Ship:
    """Where the searches begin: the other published set, in the rig's water."""
    ship = truth()
    return ship.with_values({key: number_of(load_ship(START), key).value for key in SIX})


@dataclass(frozen=True)
class Validation:
    """Table 3 as a programme.

    Args:
        numbers: found by each method, with the error of each [%].
        fits: FitPercent and MSE of speed and current for every pair of method and test.
    """

    numbers: pd.DataFrame
    fits: pd.DataFrame


def validation(tick: Tick = lambda: None) -> Validation:
    """Every method on its test of the rig, and its numbers on every test.

    Args:
        tick: called after each test and each method.
    """
    records: dict[str, list[pd.DataFrame]] = {}
    for name, make in experiments.MATRIX.items():
        records[name] = [measured(truth(), test, seed=i) for i, test in enumerate(make())]
        tick()
    ships, numbers = {"the truth": truth()}, []
    for method, test in TESTS.items():
        values = numbers_by(method, records[test])
        ships[method] = start().with_values({**values, "integration.time_step_s": FINE_S})
        off = {
            k.split(".")[1]: 100.0 * (values[k] / number_of(truth(), k).value - 1.0) for k in SIX
        }
        numbers.append({"method": method, **off, "delay_ms": 1e3 * values.get(DELAY, math.nan)})
        tick()
    rows = []
    for method, ship in ships.items():
        for test, tables in records.items():
            scores = _scores(ship, tables)
            used = TESTS.get(method) == test
            rows.append({"method": method, "test": test, "used": "yes" if used else "", **scores})
    return Validation(pd.DataFrame(numbers), pd.DataFrame(rows))


TESTS = {name: test for name, (_, test, _) in METHODS.items()} | {OUTPUT_ERROR: "staircase"}
"""The test that each method works on."""


def numbers_by(method: str, tables: list[pd.DataFrame]) -> dict[str, float]:
    """A method's numbers from its test, by key.

    Args:
        method: of :data:`TESTS`.
        tables: recordings of the rig.
    """
    if method in METHODS:
        find, _, free = METHODS[method]
        found = find(start(), tables, free)
        return dict(zip(found.keys, found.values, strict=True))
    ship = start().with_values({"integration.time_step_s": FINE_S})
    thinned = [table.iloc[::THINNED].reset_index(drop=True) for table in tables]
    return identify(ship, *thinned, free=LATE, method=method).parameters


def _scores(ship: Ship, tables: list[pd.DataFrame]) -> dict[str, float]:
    """FitPercent (eq. 20) and MSE (eq. 21) over all recordings of a test, end to end."""
    simulated = [simulate_recording(ship, table) for table in tables]
    found = {}
    for name, column in (("speed", SPEED), ("current", CURRENT)):
        y = np.concatenate([table[column] for table in tables])
        model = np.concatenate([table[column] for table in simulated])
        found[f"{name}_fit_percent"] = fit_percent(y, model)
        found[f"{name}_mse"] = float(np.mean((y - model) ** 2))
    return found


def record_of_30_s(method: str, seed: int) -> Experiment:
    """The test of a method that fits into 30 s.

    Args:
        method: of :data:`METHODS`.
        seed: of the noise.
    """
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
"""What a record of 30 s has room for."""


def estimates(method: str, ship: Ship, seed: int) -> dict[str, dict[str, float]]:
    """The watched numbers from one record of 30 s, all free together and each alone.

    Args:
        method: of :data:`METHODS`.
        ship: the rig's drive train, changed or not.
        seed: of the record.

    Returns:
        ``together`` and ``alone``: values by key. Alone, the others are the unchanged rig's, and the
        delay is what the unchanged rig's is.
    """
    table = measured(ship, record_of_30_s(method, seed), seed=seed)
    known = truth()
    if method == "step":
        found = step(known, [table], SIX)
        together = dict(zip(found.keys, found.values, strict=True))
        alone = {key: step(known, [table], (key,)).values[0] for key in WATCHED}
    else:
        response = (
            coherent(noise_response(known, [table]))
            if method == "welch"
            else sine_response(known, [table])
        )
        late = fit(freed(known, LATE, ()), response, method).values
        together = dict(zip(LATE, map(float, late), strict=True))
        known = known.with_values({DELAY: USUAL_DELAY_S})
        alone = {
            key: float(fit(freed(known, (key,), ()), response, method).values[0]) for key in WATCHED
        }
    return {"together": {key: together[key] for key in WATCHED}, "alone": alone}


USUAL_DELAY_S = 1.95e-3
"""Delay of the encoder at point C: the time between two flanks."""


def monitoring(tick: Tick = lambda: None) -> pd.DataFrame:
    """The smallest change of each watched number that each method detects in a record of 30 s.

    Args:
        tick: called after each method and each change.

    Returns:
        A row for each method, number and way (all free together, or that one alone):
        ``scatter_percent`` of the estimates from record to record, ``alarm_percent`` beyond which 5 %
        of the unchanged are, ``smallest_percent`` that passes it in 95 % of the records, and, tried:
        the change that was made, the mean one found, and the share of records that alarmed.
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
                before = np.array([one[way][key] for one in usual]) / value
                after = np.array([one[way][key] for one in tried]) / value - before.mean()
                scatter = float(before.std(ddof=1))
                alarm = ALARM * scatter * math.sqrt(1.0 + 1.0 / RECORDS)
                rows.append(
                    {
                        "method": method, "number": key.split(".")[1], "free": way,
                        "bias_percent": 100.0 * (before.mean() - 1.0),
                        "scatter_percent": 100.0 * scatter, "alarm_percent": 100.0 * alarm,
                        "smallest_percent": 100.0 * (alarm + SURE * scatter),
                        "change_percent": 100.0 * change, "found_percent": 100.0 * after.mean(),
                        "alarmed": float(np.mean(np.abs(after) > alarm)),
                    }
                )  # fmt: skip
    return pd.DataFrame(rows)
