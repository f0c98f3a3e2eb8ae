"""The identification of Vrijdag & Martelli 2021: Tables 2, 4 and 5, and its methods on known truth.

What was measured and printed are five steady states (Table 4) and a response at nine frequencies
(Table 2). The first give four numbers of Table 5's column I again; the five numbers that the authors
read off the second give all of column IV. Each method is then tried on recordings without noise of a
drive train that is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from shaftline.mismatch.identification.drive_train import (
    CONSTANT,
    FRICTION,
    LOAD,
    RESISTANCE,
    SIX,
    DriveTrain,
    WorkingPoint,
    drive_train,
    from_poles,
    keys_of,
)
from shaftline.mismatch.identification.free_parameters import freed, number_of
from shaftline.mismatch.identification.frequency import (
    SPEED,
    FrequencyResponse,
    closed_form,
    fit,
    modelled,
)
from shaftline.mismatch.identification.results import Found
from shaftline.mismatch.identification.sine import sine
from shaftline.mismatch.identification.steady import CURRENT, steady
from shaftline.mismatch.identification.step import step
from shaftline.mismatch.identification.welch import welch
from shaftline.plant import Ship, load_ship

from ..side_by_side import published
from . import experiments

SETS = {"I": "tito-neri-staircase", "IV": "tito-neri-sine"}
"""Columns of Table 5, and the ship files that hold them."""

POINT_C = WorkingPoint(5.89, 215.0, 1.29)
READ_OFF = {"fast": -2500.0, "slow": -9.0, "zero": -2.0, "speed_gain": 1.24, "current_gain": 0.71}
"""Section 5.2: poles and zero [rad/s] and steady gains that the authors read off their Bode plots."""

DELAY = "sensors.speed_delay_s"
KEPT_BELOW = 900.0
"""The authors discard what lies above [rad/s]."""

SHARE, ROUNDED = 0.05, 0.003
"""Errors assumed of Table 2 where points weigh by their size: share of a response, and its rounding."""

Tick = Callable[[], None]


def parameters_of(train: DriveTrain, ship: Ship) -> dict[str, float]:
    """The six numbers by the names of Table 5, at the motor.

    Args:
        train: a drive train.
        ship: the ship whose propeller turns its load's coefficient into KQ.
    """
    return {
        "L_a": train.inductance, "K_e": train.constant, "R_a": train.resistance, "I_p": train.inertia,
        "M_f": train.friction, "KQ0_over_eta_R": keys_of(ship, train)[LOAD],
    }  # fmt: skip


def steady_points() -> pd.DataFrame:
    """Table 4 in canonical columns."""
    table = published("tito_neri_operating_points")
    ratio = load_ship(SETS["I"]).transmission.gear_ratio
    return pd.DataFrame(
        {
            "motor_voltage_V": table["motor_voltage_V"].to_numpy(),
            SPEED: table["motor_speed_rad_s"].to_numpy() / ratio,
            CURRENT: table["motor_current_A"].to_numpy(),
        }
    )


def column_one(
    points: pd.DataFrame | None = None, density_kg_m3: float | None = None
) -> dict[str, float]:
    """Four of Table 5's column I by least squares on Table 4 (eqs. 22 to 28): values by name.

    Args:
        points: other steady states.
        density_kg_m3: another density of the water.
    """
    ship = load_ship(SETS["I"])
    if density_kg_m3 is not None:
        ship = ship.with_values({"water.density_kg_m3": density_kg_m3})
    found = steady(ship, [steady_points() if points is None else points])
    on = ship.with_values(dict(zip(found.keys, found.values, strict=True)))
    every = parameters_of(drive_train(on), on)
    return {name: every[name] for name in ("K_e", "R_a", "M_f", "KQ0_over_eta_R")}


def rounding_of_column_one(draws: int = 300, seed: int = 0) -> pd.DataFrame:
    """What the rounding of Table 4 leaves open: each entry drawn within half of its last digit.

    Args:
        draws: how many.
        seed: of the draws.
    """
    rng, points = np.random.default_rng(seed), steady_points()
    ratio = load_ship(SETS["I"]).transmission.gear_ratio
    half = np.array([0.005, 0.5 / ratio, 0.005])
    rows = [column_one(points + half * rng.uniform(-1.0, 1.0, points.shape)) for _ in range(draws)]
    return pd.DataFrame(rows).agg(["std", "min", "max"])


def column_four(ship: Ship | None = None, read: Mapping[str, float] = READ_OFF) -> dict[str, float]:
    """Table 5's column IV in closed form from the printed poles, zero and steady gains.

    Args:
        ship: whose water and propeller turn a torque into KQ; that of column IV by default.
        read: other values than the printed ones.
    """
    own = load_ship(SETS["IV"]) if ship is None else ship
    return parameters_of(from_poles(**read, point=POINT_C), own)


def table_five() -> pd.DataFrame:
    """Ours beside the printed numbers, a row for each set and parameter."""
    printed = published("tito_neri_identified_parameters")
    columns = {"I": "staircase_method_1", "IV": "sine_correlation_method_4"}
    ours = {"I": column_one(), "IV": column_four()}
    rows = []
    for name, values in ours.items():
        for parameter, value in values.items():
            theirs = float(printed.loc[parameter, columns[name]])
            rows.append(
                {
                    "set": name, "parameter": parameter, "unit": printed.loc[parameter, "unit"],
                    "ours": value, "printed": theirs,
                    "difference_percent": 100.0 * (value / theirs - 1.0),
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def table_two(weighed_by_size: bool = True, kept: bool = True) -> FrequencyResponse:
    """Table 2 as a frequency response about point C.

    Args:
        weighed_by_size: errors in proportion to the response; else none known, and all weigh alike.
        kept: without the two frequencies that the authors discard.
    """
    table = published("tito_neri_frequency_response")
    table = table[table.index < KEPT_BELOW] if kept else table
    ratio = load_ship(SETS["IV"]).transmission.gear_ratio
    response, error = {}, {}
    for column, name in ((SPEED, "speed"), (CURRENT, "current")):
        turn = np.radians(table[f"{name}_phase_deg"].to_numpy())
        response[column] = table[f"{name}_gain"].to_numpy() * np.exp(1j * turn)
        sized = np.hypot(SHARE * np.abs(response[column]), ROUNDED)
        error[column] = sized if weighed_by_size else np.full(len(turn), np.nan)
    means = {SPEED: POINT_C.motor_speed / ratio, CURRENT: POINT_C.current}
    return FrequencyResponse(
        POINT_C.voltage, means, table.index.to_numpy(dtype=float), response, error, 0.0, {}
    )


def fits_of_table_two() -> tuple[pd.DataFrame, Ship]:
    """Numbers fitted to Table 2 in several ways, a row each; and the ship that does best.

    The last row is the best: points weighed by their size, and the speed allowed to be late.
    """
    ship = load_ship(SETS["IV"])
    ways: list[tuple[str, bool, bool, tuple[str, ...]]] = [
        ("all alike, as printed", False, True, SIX),
        ("all alike, discarded too", False, False, SIX),
        ("by size", True, True, SIX),
        ("by size, discarded too", True, False, SIX),
        ("by size, speed late, discarded too", True, False, (*SIX, DELAY)),
        ("by size, speed late", True, True, (*SIX, DELAY)),
    ]
    rows, best = [], ship
    for name, sized, kept, free in ways:
        chosen = freed(ship, free, SIX)
        found = fit(chosen, table_two(sized, kept), "sine")
        best = chosen.on(found.values)
        errors = dict(zip(free, np.sqrt(np.diag(found.covariance)), strict=True))
        rows.append(
            {
                "errors weigh": name, **parameters_of(drive_train(best), best),
                "L_a_error": errors[SIX[0]], "delay_ms": 1e3 * best.sensors.speed_delay_s,
                "delay_error_ms": 1e3 * errors.get(DELAY, 0.0), "misfit": found.misfit,
            }
        )  # fmt: skip
    return pd.DataFrame(rows), best


def five_numbers() -> dict[str, float]:
    """Poles, zero and steady gains that meet Table 2 best, all alike."""
    found = closed_form(load_ship(SETS["IV"]), table_two(weighed_by_size=False))
    assert found is not None
    return found[1]


def dead_time() -> pd.DataFrame:
    """Measured less modelled phase of the speed, and the delay that it amounts to, by frequency.

    Of the first set alone and of column IV; the encoder's pulses at point C are 1.95 ms apart.
    """
    measured = table_two(kept=True)
    rows: dict[str, Any] = {"frequency_rad_s": measured.frequency}
    for name, file in SETS.items():
        answer = modelled(load_ship(file), measured)[SPEED]
        late = np.angle(measured.response[SPEED] / answer)
        rows[f"{name}_deg"] = np.degrees(late)
        rows[f"{name}_ms"] = -1e3 * late / measured.frequency
    table = pd.DataFrame(rows)
    return table[table["frequency_rad_s"] >= 100.0].reset_index(drop=True)


def fitted_dead_time() -> dict[str, tuple[float, float]]:
    """Delay and its standard error [ms] that each printed set asks for, all else as it is."""
    found = {}
    for name, file in SETS.items():
        part = fit(freed(load_ship(file), (DELAY,), ()), table_two(), "sine")
        found[name] = (1e3 * float(part.values[0]), 1e3 * float(np.sqrt(part.covariance[0, 0])))
    return found


FOUR = (FRICTION, CONSTANT, RESISTANCE, LOAD)
METHODS: dict[str, tuple[Callable[..., Found], str, tuple[str, ...], float]] = {
    "steady": (steady, "staircase", FOUR, 0.5),
    "step": (step, "staircase", SIX, 1.5),
    "sine": (sine, "sines", SIX, 2.0),
    "welch": (welch, "noise", SIX, 5.0),
}
"""Each method, the test that it works on, what it finds, and the error that it is allowed [%]."""


def on_known_truth(tick: Tick = lambda: None) -> pd.DataFrame:
    """Error of each method on recordings without noise, either set found from the other.

    Args:
        tick: called after each method and set.
    """
    rows = []
    for name, file in SETS.items():
        truth = load_ship(file)
        other = load_ship(SETS["IV" if name == "I" else "I"])
        start = truth.with_values({key: number_of(other, key).value for key in SIX})
        runs: dict[str, Iterable[pd.DataFrame]] = {}
        for method, (find, test, free, allowed) in METHODS.items():
            if test not in runs:
                tests = experiments.MATRIX[test]()
                runs[test] = [experiments.recorded(truth, one) for one in tests]
            found = find(start, runs[test], free)
            errors = {
                key: 100.0 * (value / number_of(truth, key).value - 1.0)
                for key, value in zip(found.keys, found.values, strict=True)
            }
            worst = max(errors, key=lambda key: abs(errors[key]))
            rows.append(
                {
                    "set": name, "method": method, **{key: errors.get(key) for key in SIX},
                    "worst_percent": abs(errors[worst]), "allowed_percent": allowed,
                }
            )  # fmt: skip
            tick()
    return pd.DataFrame(rows)


TICKS = len(SETS) * len(METHODS)
