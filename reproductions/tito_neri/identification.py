"""Repeat the identification of Vrijdag & Martelli 2021: Tables 2, 4 and 5, and its methods on known
truth.

Measured and printed are five steady states (Table 4) and a response at nine frequencies (Table 2). The
first give four parameters of Table 5's column I; the five numbers that the authors read off the second
give all of column IV. Each method is then tried on recordings without noise of a known drive train. The
last part of the module compares the printed numbers as cells, with the uncertainty that their digits
leave.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.mismatch.identification import drive_train, frequency
from shaftline.mismatch.identification.drive_train import CONSTANT, FRICTION, LOAD, RESISTANCE, SIX
from shaftline.mismatch.identification.free_parameters import number_of, parse_free
from shaftline.mismatch.identification.frequency import SPEED, FrequencyResponse
from shaftline.mismatch.identification.parameters import MethodResult
from shaftline.mismatch.identification.sine import sine
from shaftline.mismatch.identification.steady import CURRENT, steady
from shaftline.mismatch.identification.step import step
from shaftline.mismatch.identification.welch import welch
from shaftline.plant import Ship, load_ship

from ..cells import HALF_DIGIT, Cell, Kind, Reason, number, printed_number
from ..side_by_side import Tick, published, published_text
from . import experiments

SETS = {"I": "tito-neri-staircase", "IV": "tito-neri-sine"}
"""Columns of Table 5, and the ship files that hold them."""

COLUMNS = {"I": "staircase_method_1", "IV": "sine_correlation_method_4"}

POINT_C = drive_train.WorkingPoint(5.89, 215.0, 1.29)
READ_OFF = {"fast": -2500.0, "slow": -9.0, "zero": -2.0, "speed_gain": 1.24, "current_gain": 0.71}
"""Section 5.2: poles and zero [rad/s] and steady gains that the authors read off their Bode plots."""

Floats = NDArray[np.float64]

DELAY = "sensors.speed_delay_s"
KEPT_BELOW = 900.0  # the authors discard higher frequencies [rad/s]
SHARE, ROUNDED = 0.05, 0.003
"""Assumed errors of Table 2 with weights by size: share of a response, and its rounding."""


def parameters_of(train: drive_train.DriveTrain, ship: Ship) -> dict[str, float]:
    """Return the six parameters by the names of Table 5, at the motor."""
    return {
        "L_a": train.inductance,
        "K_e": train.constant,
        "R_a": train.resistance,
        "I_p": train.inertia,
        "M_f": train.friction,
        "KQ0_over_eta_R": drive_train.keys_of(ship, train)[LOAD],
    }


def _points() -> tuple[Floats, Floats, Floats]:
    """Return voltage [V], motor speed [rad/s] and current [A] of Table 4, shape (5,) each."""
    table = published("tito_neri_operating_points")
    names = ("motor_voltage_V", "motor_speed_rad_s", "motor_current_A")
    voltage, speed, current = (table[name].to_numpy(dtype=np.float64) for name in names)
    return voltage, speed, current


def steady_points() -> pd.DataFrame:
    """Return Table 4 in canonical columns."""
    voltage, speed, current = _points()
    ratio = load_ship(SETS["I"]).transmission.gear_ratio
    return pd.DataFrame({"motor_voltage_V": voltage, SPEED: speed / ratio, CURRENT: current})


def column_one(
    points: pd.DataFrame | None = None, density_kg_m3: float | None = None
) -> dict[str, float]:
    """Return four parameters of Table 5's column I by least squares on Table 4 (eqs. 22 to 28)."""
    ship = load_ship(SETS["I"])
    if density_kg_m3 is not None:
        ship = ship.with_values({"water.density_kg_m3": density_kg_m3})
    found = steady(ship, [steady_points() if points is None else points])
    on = ship.with_values(dict(zip(found.keys, found.values, strict=True)))
    every = parameters_of(drive_train.drive_train(on), on)
    return {name: every[name] for name in ("K_e", "R_a", "M_f", "KQ0_over_eta_R")}


def rounding_of_column_one(draws: int = 300, seed: int = 0) -> pd.DataFrame:
    """Return the spread of column I with each entry of Table 4 drawn within half of its last digit."""
    rng, points = np.random.default_rng(seed), steady_points()
    ratio = load_ship(SETS["I"]).transmission.gear_ratio
    half = np.array([0.005, 0.5 / ratio, 0.005])
    rows = [column_one(points + half * rng.uniform(-1.0, 1.0, points.shape)) for _ in range(draws)]
    return pd.DataFrame(rows).agg(["std", "min", "max"])


def column_four(ship: Ship | None = None, read: Mapping[str, float] = READ_OFF) -> dict[str, float]:
    """Return Table 5's column IV in closed form from the printed poles, zero and steady gains."""
    train = drive_train.from_poles(**read, point=POINT_C)
    return parameters_of(train, ship or load_ship(SETS["IV"]))


def table_five() -> pd.DataFrame:
    """Return our parameters beside the printed ones, a row for each set and parameter."""
    printed, rows = published("tito_neri_identified_parameters"), []
    for name, values in (("I", column_one()), ("IV", column_four())):
        for parameter, value in values.items():
            line = printed.loc[parameter]
            theirs = float(line[COLUMNS[name]])
            rows.append(
                (name, parameter, line["unit"], value, theirs, 100.0 * (value / theirs - 1.0))
            )
    columns = ["set", "parameter", "unit", "ours", "printed", "difference_percent"]
    return pd.DataFrame(rows, columns=columns)


def table_two(weighed_by_size: bool = True, kept: bool = True) -> FrequencyResponse:
    """Return Table 2 as a frequency response about point C.

    Errors are in proportion to the response where ``weighed_by_size``, else equal. ``kept`` leaves out
    the two frequencies that the authors discard.
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
    frequencies = table.index.to_numpy(dtype=float)
    return FrequencyResponse(POINT_C.voltage, means, frequencies, response, error, 0.0, {})


def fits_of_table_two() -> tuple[pd.DataFrame, Ship]:
    """Return parameters fitted to Table 2 in several ways, a row each, and the best ship.

    The last row is the best: points weighted by their size, and the delay of the speed free.
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
        chosen = parse_free(ship, free, SIX)
        found = frequency.fit(chosen, table_two(sized, kept), "sine")
        best = chosen.on(found.values)
        errors = dict(zip(free, np.sqrt(np.diag(found.covariance)), strict=True))
        rows.append(
            {
                "errors weigh": name,
                **parameters_of(drive_train.drive_train(best), best),
                "L_a_error": errors[SIX[0]],
                "delay_ms": 1e3 * best.sensors.speed_delay_s,
                "delay_error_ms": 1e3 * errors.get(DELAY, 0.0),
                "misfit": found.misfit,
            }
        )
    return pd.DataFrame(rows), best


def five_numbers() -> dict[str, float]:
    """Return poles, zero and steady gains fitted to Table 2 with equal weights."""
    found = frequency.closed_form(load_ship(SETS["IV"]), table_two(weighed_by_size=False))
    assert found is not None
    return found[1]


def dead_time() -> pd.DataFrame:
    """Return measured less modelled phase of the speed, and the equivalent delay, by frequency.

    Of the first set alone and of column IV; the encoder's pulses at point C are 1.95 ms apart.
    """
    measured = table_two(kept=True)
    rows: dict[str, Any] = {"frequency_rad_s": measured.frequency}
    for name, file in SETS.items():
        modelled = frequency.modelled_response(load_ship(file), measured)[SPEED]
        late = np.angle(measured.response[SPEED] / modelled)
        rows |= {f"{name}_deg": np.degrees(late), f"{name}_ms": -1e3 * late / measured.frequency}
    table = pd.DataFrame(rows)
    return table[table["frequency_rad_s"] >= 100.0].reset_index(drop=True)


def fitted_dead_time() -> dict[str, tuple[float, float]]:
    """Return delay and standard error [ms] fitted to each printed set, all else fixed."""
    found = {}
    for name, file in SETS.items():
        part = frequency.fit(parse_free(load_ship(file), (DELAY,), ()), table_two(), "sine")
        found[name] = (1e3 * float(part.values[0]), 1e3 * float(np.sqrt(part.covariance[0, 0])))
    return found


FOUR = (FRICTION, CONSTANT, RESISTANCE, LOAD)
METHODS: dict[str, tuple[Callable[..., MethodResult], str, tuple[str, ...], float]] = {
    "steady": (steady, "staircase", FOUR, 0.5),
    "step": (step, "staircase", SIX, 1.5),
    "sine": (sine, "sines", SIX, 2.0),
    "welch": (welch, "noise", SIX, 5.0),
}
"""Each method with its test, its free parameters, and its error limit [%]."""


def percent_off(found: Mapping[str, float], truth: Ship) -> dict[str, float]:
    """Return the errors of identified parameters [%], by key."""
    return {key: 100.0 * (v / number_of(truth, key).value - 1.0) for key, v in found.items()}


def on_known_truth(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return the errors of each method on recordings without noise, starting from the other set."""
    rows = []
    for name, file in SETS.items():
        truth, other = load_ship(file), load_ship(SETS["IV" if name == "I" else "I"])
        start = truth.with_values({key: number_of(other, key).value for key in SIX})
        runs: dict[str, Iterable[pd.DataFrame]] = {}
        for method, (find, test, free, allowed) in METHODS.items():
            if test not in runs:
                tests = experiments.MATRIX[test]()
                runs[test] = [experiments.simulate_test(truth, one) for one in tests]
            found = find(start, runs[test], free)
            off = percent_off(dict(zip(found.keys, found.values, strict=True)), truth)
            rows.append(
                {
                    "set": name,
                    "method": method,
                    **{key: off.get(key) for key in SIX},
                    "worst_percent": max(map(abs, off.values())),
                    "allowed_percent": allowed,
                }
            )
            tick()
    return pd.DataFrame(rows)


TICKS = len(SETS) * len(METHODS)


def _solved(columns: Floats, target: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0])


def _pairs() -> Iterator[tuple[str, float, float]]:
    """Yield a name, K_e [V s/rad] and R_a [ohm] of each way to solve U = K_e w + R_a i."""
    voltage, speed, current = _points()
    both, letters = np.column_stack([speed, current]), np.array(list("ABCDE"))
    for count in range(2, 6):
        for kept in map(list, itertools.combinations(range(5), count)):
            constant, ohm = _solved(both[kept], voltage[kept])
            yield f"points {''.join(letters[kept])}", constant, ohm
    weights = {"1/U": 1 / voltage, "1/i": 1 / current, "1/w": 1 / speed, "U": voltage}
    for name, weight in weights.items():
        constant, ohm = _solved(both * weight[:, None], voltage * weight)
        yield f"weights {name}", constant, ohm
    a, b = _solved(np.column_stack([voltage, current]), speed)
    yield "speed as the dependent variable", 1.0 / a, -b / a
    a, b = _solved(np.column_stack([voltage, speed]), current)
    yield "current as the dependent variable", -b / a, 1.0 / a
    last = np.linalg.svd(np.column_stack([speed, current, voltage]))[2][-1]
    yield "total least squares", -last[0] / last[2], -last[1] / last[2]
    constant, ohm, _ = _solved(np.column_stack([speed, current, np.ones(5)]), voltage)
    yield "with a constant drop of the brushes", constant, ohm


def least_squares_variants() -> pd.DataFrame:
    """Return every pair, the nearest to the printed one first.

    Returns:
        Columns way, K_e, R_a and off [%], the larger of the two differences from the printed pair.
    """
    printed = published("tito_neri_identified_parameters")[COLUMNS["I"]]
    table = pd.DataFrame(_pairs(), columns=["way", "K_e", "R_a"])
    off = [(table[name] / printed[name] - 1.0).abs() for name in ("K_e", "R_a")]
    return table.assign(**{"off [%]": 100.0 * np.maximum(*off)}).sort_values(
        "off [%]", ignore_index=True
    )


_GAIN_HALF_DIGIT = 0.005


def given_cells() -> list[Cell]:
    """Return the cells of what the methods were given: Tables 2 and 4 and the values of section 5.2."""
    cells = [
        printed_number(f"Table {name}", str(row), column, float(text), text, Kind.INPUT)
        for name, table in (("2", "frequency_response"), ("4", "operating_points"))
        for row, line in published_text(f"tito_neri_{table}").iterrows()
        for column, text in line.items()
    ]
    for name, value in READ_OFF.items():
        cells.append(number("section 5.2", name, "", value, value, 0.0, "as printed", Kind.INPUT))
    return cells


def left_open(rounding: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return the change of Table 5 by the printed digits of its sources, by set and parameter."""
    found = {
        ("I", name): float((rounding.loc[["min", "max"], name] - value).abs().max())
        for name, value in column_one().items()
    }
    gains = ("speed_gain", "current_gain")
    corners = [
        column_four(read={k: v + _GAIN_HALF_DIGIT * signs.get(k, 0.0) for k, v in READ_OFF.items()})
        for signs in (
            dict(zip(gains, ends, strict=True)) for ends in itertools.product((-1, 1), repeat=2)
        )
    ]
    for name, value in column_four().items():
        found["IV", name] = max(abs(corner[name] - value) for corner in corners)
    return found


def table_five_cells(rounding: pd.DataFrame) -> list[Cell]:
    """Return Table 5 with ours."""
    printed, slack = published_text("tito_neri_identified_parameters"), left_open(rounding)
    ours = {"I": column_one(), "IV": column_four()}
    bases = {
        "I": f"{HALF_DIGIT}, and the rounding of Table 4 (300 draws)",
        "IV": f"{HALF_DIGIT}, and half a digit of the gains 1.24 and 0.71",
    }
    constant, cells = float(printed.loc["K_e", COLUMNS["I"]]), []
    for (name, column), parameter in itertools.product(COLUMNS.items(), printed.index):
        value, reason = ours[name].get(parameter, math.nan), None
        if name == "I" and parameter in ("M_f", "KQ0_over_eta_R"):
            ratio = value / ours["I"]["K_e"]
            reason = Reason(
                f"eq. 22 fixes the ratio to K_e alone: ours is {ratio:.4g}; with the printed K_e of "
                f"{constant:g} it gives {ratio * constant:.4g}",
                value * constant / ours["I"]["K_e"] - value,
            )
        text, more = printed.loc[parameter, column], slack.get((name, parameter), 0.0)
        cells.append(
            printed_number(
                "Table 5",
                parameter,
                f"set {name}",
                value,
                text,
                Kind.FREE,
                more,
                bases[name],
                reason,
            )
        )
    return cells


def text_cells(stairs: pd.DataFrame) -> list[Cell]:
    """Return the sentences of section 5.1 with ours."""
    by = stairs.set_index("set")
    away = abs(by.loc["IV", "A [rpm]"]) / abs(by.loc["IV", "C [rpm]"])
    return [
        Cell("Figure 10", "set I: largest error of the steady speed [%]", "",
             float(by.loc["I", "largest [%]"]), 0.0, 3.0, "the limit that the words name",
             words="within 3 %"),
        Cell("Figure 10", "set IV: error of the speed at A over that at C [-]", "", float(away), 1.0,
             np.inf, "more than at C", words="increases away from C"),
        Cell("Figure 13", "bias of the speed on the mix [rpm]", "", math.nan, 45.0, 55.0,
             "'around 50', a number rounded to 10", Kind.FREE, 50.0),
    ]  # fmt: skip
