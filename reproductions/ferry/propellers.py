"""Search propellers, hulls and forms of the engine map for the ferry of the CPP optimiser paper.

Every propeller of a grid is fitted to the pitches and speeds of Tables 1 to 3, and every form of the map
to their consumption and optima. Each combination is judged at levers that its fits did not use.

Run ``python -m reproductions ferry.propellers --out docs/results``; about two minutes.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.plant import Ship, load_ship

from ..pages import label_axis, make_parser, print_dot, write_page
from . import map_forms, similarity
from .experiment import COMBINATOR, CORRECTED, HELD, LEVERS, RISE, printed_levers
from .levers import HALF_DIGIT
from .map_forms import FORMS, OPTIMA
from .similarity import (
    AT_EQUAL,
    AT_HELD,
    BEFORE,
    BY_TABLE_2,
    CALIBRATED_LEVER,
    PLAIN,
    STATED,
    Floats,
    Groups,
    Prints,
    Propellers,
)

SHIP = "ferry-printed"
BLADES, AREA_RATIOS = (3, 4, 5, 6), (0.45, 0.6, 0.75, 0.9)
EXPONENTS = tuple(float(k) for k in np.arange(2.0, 4.05, 0.2).round(1))
RULES = (STATED, BY_TABLE_2)
WEIGHTS, RIDGES = (0.0, 3.0, 10.0, 30.0), (1e-4, 1e-3, 1e-2)
EARLIER = "by Table 2, `ferry`"

SCALES = {"T1 speed": 0.01, "pitch": 0.1, "SFOC": 1.0, "rpm": 5.0}
"""Errors that count alike where combinations are ranked: m/s, deg, g/kWh, rpm."""


class Hull(NamedTuple):
    """Propellers with the rule of the rise, fitted with all levers and without each of them."""

    propellers: Propellers
    rule: str
    groups: list[Groups]  # of all levers, then without levers 1 to 5
    fields: list[map_forms.Field]
    pitch_off: Floats  # at the levers left out, states after the disturbance [deg], (n, 4, 5)
    speed_off: Floats  # of Table 1 there [m/s], shape (n, 5)
    held_off: Floats  # of Table 2 [m/s], shape (n, 5)


def _kept(left_out: int | None) -> Any:
    used = np.ones(LEVERS, dtype=bool)
    if left_out is not None:
        used[left_out] = False
    return used


FOLDS: tuple[int | None, ...] = (None, *range(LEVERS))


def fit_hulls(propellers: Propellers, exponent: Floats, rule: str, prints: Prints) -> Hull:
    """Fit advance and load of each propeller, with all levers and without each of them."""
    n, groups, zeros = len(exponent), [], []
    for left_out in FOLDS:
        weights = np.broadcast_to(1.0 * _kept(left_out), (n, 4, LEVERS))
        own, zero = similarity.fit_groups(propellers, exponent, rule, prints, weights)
        groups.append(own)
        zeros.append(zero)
    return _judge_hulls(propellers, rule, groups, zeros, prints)


def _judge_hulls(
    propellers: Propellers, rule: str, groups: list[Groups], zeros: list[Floats], prints: Prints
) -> Hull:
    """Return what fitted propellers give at the levers that each fit did not use."""
    n = len(groups[0].advance)
    pitch, speed = np.zeros((n, 4, LEVERS)), np.zeros((n, LEVERS))
    for lever, (own, zero) in enumerate(zip(groups[1:], zeros[1:], strict=True)):
        off = similarity.printed_angles(propellers, own, prints) - prints.pitch
        pitch[:, :, lever] = (off - zero[:, None, None])[:, :, lever]
        reached = similarity.speeds_at_held_pitch(propellers, own, prints)
        speed[:, lever] = (reached - prints.ship_speed[PLAIN])[:, lever]
    held = similarity.speeds_at_held_thrust(groups[0], prints) - prints.ship_speed[AT_HELD]
    fields = [map_forms.make_field(propellers, own, prints) for own in groups]
    return Hull(propellers, rule, groups, fields, pitch, speed, held)


def earlier_hull(prints: Prints) -> Hull:
    """Return the propeller of the ``ferry``, with the rise that Table 2 then implies."""
    ship = load_ship("ferry")
    kind = ship.propeller.blades, ship.propeller.expanded_area_ratio
    propellers = similarity.make_propellers([kind])
    exponent = np.array([ship.hull.resistance_exponent])
    groups = similarity.groups_of(ship, similarity.rises(BY_TABLE_2, exponent, prints))
    off = similarity.printed_angles(propellers, groups, prints) - prints.pitch
    zero = off.mean(axis=(1, 2))
    return _judge_hulls(propellers, EARLIER, [groups] * len(FOLDS), [zero] * len(FOLDS), prints)


def _rms(values: Floats, axis: Any = None) -> Any:
    return np.sqrt(np.mean(values**2, axis=axis))


def variation_tolerances() -> Floats:
    """Return the tolerances of the column *Variation* of the consumption, shape (3, 5).

    As on the page of the levers: half a digit, and that of both ship speeds by the printed slope.
    """
    found = []
    for control in (COMBINATOR, HELD, CORRECTED):
        table = printed_levers(control)
        slope = np.gradient(
            table["sfoc_g_kwh_before"].to_numpy(), table["ship_speed_m_s_before"].to_numpy()
        )
        found.append(HALF_DIGIT["sfoc_g_kwh"] + 2.0 * HALF_DIGIT["ship_speed_m_s"] * np.abs(slope))
    return np.array(found)


def judge_maps(hull: Hull, name: str, weight: float, ridge: float, prints: Prints) -> pd.DataFrame:
    """Fit a form with all levers and without each of them; return a row for each propeller."""
    n, form = len(hull.groups[0].advance), FORMS[name]
    out = np.zeros((n, 4, LEVERS))
    engine, saving = np.zeros((n, int(OPTIMA.sum()), LEVERS)), np.zeros((n, LEVERS))
    for left_out, field in zip(FOLDS, hull.fields, strict=True):
        fit = map_forms.fit_maps(form, field, prints, weight, ridge, _kept(left_out))
        found = map_forms.judge(fit, field, prints)
        if left_out is None:
            whole = found
        else:
            out[:, :, left_out] = found.consumption[:, :, left_out]
            engine[:, :, left_out] = found.engine[:, OPTIMA, left_out]
            saving[:, left_out] = found.saving[:, left_out]
    off, aside = whole.consumption - prints.consumption, out - prints.consumption
    printed, tolerance = map_forms.variation(prints.consumption[None]), variation_tolerances()
    implied = map_forms.implied_saving(hull.fields[0], prints)

    def met(consumption: Floats) -> Floats:
        change = map_forms.variation(consumption) - printed
        return np.asarray((np.abs(change) <= tolerance).sum(axis=(1, 2)))

    return pd.DataFrame(
        {
            "rise": hull.rule,
            "exponent": hull.groups[0].exponent,
            "blades": hull.propellers.blades,
            "EAR": hull.propellers.area_ratio,
            "form": name,
            "weight": weight,
            "ridge": ridge,
            "pitch [deg]": _rms(hull.pitch_off, (1, 2)),
            "T1 speed [m/s]": _rms(hull.speed_off, 1),
            "T2 speed [m/s]": _rms(hull.held_off, 1),
            "SFOC, all used [g/kWh]": _rms(off, (1, 2)),
            "SFOC, lever left out [g/kWh]": _rms(aside, (1, 2)),
            "levers 2 to 4 [g/kWh]": _rms(aside[:, :, 1:4], (1, 2)),
            "optimum, all used [rpm]": _rms(whole.engine[:, OPTIMA], (1, 2)),
            "optimum, lever left out [rpm]": _rms(engine, (1, 2)),
            "saving, least [%]": whole.saving.min(axis=1),
            "most [%]": whole.saving.max(axis=1),
            "lever left out, least [%]": saving.min(axis=1),
            "left out, most [%]": saving.max(axis=1),
            "implied, least [%]": implied.min(axis=1),
            "implied, most [%]": implied.max(axis=1),
            "variations met, all used": met(whole.consumption),
            "variations met, lever left out": met(out),
        }
    )


def search(prints: Prints) -> pd.DataFrame:
    """Return every combination of propeller, exponent, rule, form and weights, best first."""
    kinds = list(itertools.product(BLADES, AREA_RATIOS, EXPONENTS))
    propellers = similarity.make_propellers([(z, a) for z, a, _ in kinds])
    exponent = np.array([k for *_, k in kinds])
    hulls = [fit_hulls(propellers, exponent, rule, prints) for rule in RULES]
    frames = []
    for hull in (*hulls, earlier_hull(prints)):
        for name, weight, ridge in itertools.product(FORMS, WEIGHTS, RIDGES):
            frames.append(judge_maps(hull, name, weight, ridge, prints))
        print_dot()
    found = pd.concat(frames, ignore_index=True)
    found.insert(0, "score", score(found))
    return found.sort_values("score", kind="stable", ignore_index=True)


def score(found: pd.DataFrame) -> pd.Series:
    """Return the mean square of the errors at levers left out, each over its scale."""
    columns = {
        "T1 speed": "T1 speed [m/s]",
        "pitch": "pitch [deg]",
        "SFOC": "SFOC, lever left out [g/kWh]",
        "rpm": "optimum, lever left out [rpm]",
    }
    return sum((found[columns[name]] / scale) ** 2 for name, scale in SCALES.items()) / len(SCALES)


OBJECTIVES = {
    "T1 speed [m/s]": 3,
    "SFOC, lever left out [g/kWh]": 1,
    "optimum, lever left out [rpm]": 0,
}
"""Columns of the trade-off, with the decimals to which two combinations count as equal."""


def pareto_front(found: pd.DataFrame) -> pd.DataFrame:
    """Return the combinations that none beats in all of :data:`OBJECTIVES`, one of equal ones."""
    values = np.column_stack([found[name].round(d) for name, d in OBJECTIVES.items()])
    _, first = np.unique(values, axis=0, return_index=True)
    values, kept = values[first], []
    for row, own in zip(first, values, strict=True):
        beaten = (values <= own).all(axis=1) & (values < own).any(axis=1)
        if not beaten.any():
            kept.append(int(row))
    return found.loc[kept].sort_values(list(OBJECTIVES), ignore_index=True)


def best_of(found: pd.DataFrame, column: str | list[str]) -> pd.DataFrame:
    """Return the best combination of each value of a column, best first."""
    return found.drop_duplicates(column).reset_index(drop=True)


def calibrated_levers(prints: Prints, ship: Ship) -> pd.DataFrame:
    """Return what the ship's propeller predicts at the other levers if one lever calibrates it."""
    kind = ship.propeller.blades, ship.propeller.expanded_area_ratio
    propellers, rows = similarity.make_propellers([kind]), []
    for lever in range(1, LEVERS + 1):
        groups = similarity.calibrate(propellers, prints, lever)
        particulars = similarity.particulars(propellers, groups, ship)
        others = _kept(lever - 1)
        plain = similarity.speeds_at_held_pitch(propellers, groups, prints)[0]
        held = similarity.speeds_at_held_thrust(groups, prints)[0]
        pitch = similarity.printed_angles(propellers, groups, prints)[0] - prints.pitch
        pitch = pitch - pitch[BEFORE].mean()
        off_1 = np.abs(plain - prints.ship_speed[PLAIN])[others]
        off_2 = np.abs(held - prints.ship_speed[AT_HELD])[others]
        rows.append(
            {
                "calibrated lever": str(lever),
                "exponent": float(groups.exponent[0]),
                "diameter [m]": particulars.diameter,
                "gear ratio": particulars.gear_ratio,
                "T1 speed, worst other [m/s]": float(off_1.max()),
                "T2 speed, worst other [m/s]": float(off_2.max()),
                "T2 pitch, rms [deg]": float(_rms(pitch[AT_HELD])),
                "T3 pitch, rms [deg]": float(_rms(pitch[AT_EQUAL])),
            }
        )
    return pd.DataFrame(rows)


def equal_ferries(prints: Prints, ship: Ship) -> pd.DataFrame:
    """Return diameters and gears with which other wakes and propellers give the same speeds."""
    rows = []
    for wake, (blades, area) in itertools.product(
        (0.0, 0.08, 0.2), ((3, 0.6), (4, 0.75), (5, 0.9))
    ):
        propellers = similarity.make_propellers([(blades, area)])
        groups = similarity.calibrate(propellers, prints)
        other = ship.with_values({"hull.wake_fraction": wake})
        found = similarity.particulars(propellers, groups, other)
        plain = similarity.speeds_at_held_pitch(propellers, groups, prints)[0]
        rows.append(
            {
                "wake fraction": wake,
                "blades": blades,
                "EAR": area,
                "diameter [m]": found.diameter,
                "gear ratio": found.gear_ratio,
                "efficiency at 13 kn": found.efficiency,
                "T1 speed, worst [m/s]": float(np.abs(plain - prints.ship_speed[PLAIN]).max()),
            }
        )
    return pd.DataFrame(rows)


def draw_trade_off(found: pd.DataFrame, front: pd.DataFrame) -> Figure:
    """Draw the speeds of Table 1 over the exponent, and consumption against engine speed by form."""
    figure, axes = figures.new_figure(1, 2, (13.0, 5.0))
    left, right = axes[0]
    for k, rule in enumerate(RULES):
        own = found[found["rise"] == rule].groupby("exponent")
        for column, style in (("T1 speed [m/s]", "-"), ("T2 speed [m/s]", "--")):
            best = own[column].min()
            label = f"rise {rule}, {column[:2].replace('T', 'Table ')}"
            left.plot(best.index, best, style, color=figures.PALETTE[k], label=label)
    earlier = found.loc[found["rise"] == EARLIER, "T1 speed [m/s]"].iloc[0]
    left.plot([2.0], [earlier], "kx", label="ferry, Table 1")
    title = "Error of the ship speeds after the disturbance, rms [m/s]"
    label_axis(left, "exponent of the resistance [-]", "", title, 9, None, 8)
    some = found[found["rise"] != EARLIER]
    for k, name in enumerate(FORMS):
        own = some[some["form"] == name]
        right.plot(
            own["optimum, lever left out [rpm]"],
            own["SFOC, lever left out [g/kWh]"],
            ".",
            markersize=2,
            alpha=0.4,
            color=figures.PALETTE[k % len(figures.PALETTE)],
            label=name,
        )
    right.plot(
        front["optimum, lever left out [rpm]"],
        front["SFOC, lever left out [g/kWh]"],
        "ko",
        markersize=4,
        label="front",
    )
    right.set_xscale("log")
    right.set_yscale("log")
    title = "Consumption [g/kWh] over optimum engine speed [rpm], lever left out, rms"
    label_axis(right, "error of the optimum engine speed [rpm]", "", title, 9, None, 7)
    return figure


SHOWN = [
    "form",
    "rise",
    "exponent",
    "blades",
    "EAR",
    "pitch [deg]",
    "T1 speed [m/s]",
    "T2 speed [m/s]",
    "SFOC, lever left out [g/kWh]",
    "levers 2 to 4 [g/kWh]",
    "optimum, lever left out [rpm]",
    "saving [%]",
    "implied [%]",
]


def _range(found: pd.DataFrame, low: str, high: str, digits: int = 1) -> list[str]:
    pairs = zip(found[low], found[high], strict=True)
    return [f"{a:.{digits}f} to {b:.{digits}f}" for a, b in pairs]


def table_of(found: pd.DataFrame, columns: list[str] | None = None) -> pd.DataFrame:
    """Return combinations with the ranges of their savings as text."""
    shown = found.assign(
        **{
            "saving [%]": _range(found, "saving, least [%]", "most [%]"),
            "saving, lever left out [%]": _range(
                found, "lever left out, least [%]", "left out, most [%]"
            ),
            "implied [%]": _range(found, "implied, least [%]", "implied, most [%]"),
            "exponent": [f"{value:.1f}" for value in found["exponent"]],
            "EAR": [f"{value:g}" for value in found["EAR"]],
            "pitch [deg]": [f"{value:.3f}" for value in found["pitch [deg]"]],
            "T1 speed [m/s]": [f"{value:.4f}" for value in found["T1 speed [m/s]"]],
            "T2 speed [m/s]": [f"{value:.4f}" for value in found["T2 speed [m/s]"]],
        }
    )
    return shown[columns or SHOWN]


def rounding_shift(row: pd.Series, prints: Prints) -> float:
    """Return the largest change of consumption [g/kWh] by half a digit of the ship speed on a map."""
    propellers = similarity.make_propellers([(int(row["blades"]), float(row["EAR"]))])
    hull = fit_hulls(propellers, np.array([row["exponent"]]), str(row["rise"]), prints)
    form, field = FORMS[str(row["form"])], hull.fields[0]
    weights = float(row["weight"]), float(row["ridge"])
    fit = map_forms.fit_maps(form, field, prints, *weights, _kept(None))
    moved = prints.ship_speed + HALF_DIGIT["ship_speed_m_s"]
    power = similarity.powers(propellers, hull.groups[0], prints.engine, moved)
    change = fit.consumption(power, field.speed) - fit.consumption(field.power, field.speed)
    return float(np.abs(change).max())


def exponents_of_rise(rise: float, prints: Prints) -> Floats:
    """Return the exponents at which a rise of the resistance slows the ship as Table 2 prints."""
    lost = prints.ship_speed[BEFORE] / prints.ship_speed[AT_HELD]
    return np.asarray(math.log(rise) / np.log(lost))


WAVE_SHARE = 0.6
"""A share of the wave resistance at the ferry's Froude numbers of 0.36 to 0.42 (assumed)."""

VARIATIONS = [
    "form",
    "rise",
    "exponent",
    "SFOC, all used [g/kWh]",
    "variations met, all used",
    "variations met, lever left out",
    "optimum, all used [rpm]",
    "saving, lever left out [%]",
]


def main() -> None:
    """Write ``ferry-propellers.md``, its table and its figure."""
    folder = make_parser("ferry.propellers", __doc__, "out/ferry-propellers").parse_args().out
    prints, ship = read_prints(), load_ship(SHIP)
    found = search(prints)
    free = found[found["rise"] != EARLIER]
    front, forms = pareto_front(free), best_of(free, "form")
    figures.save(draw_trade_off(found, front), folder / "figures" / "ferry-propellers.png")
    earlier = found[found["rise"] == EARLIER].head(1)
    wave = exponents_of_rise(1.0 + (RISE - 1.0) * WAVE_SHARE, prints)
    rules = best_of(found, ["rise", "exponent"]).sort_values(["rise", "exponent"])
    write_page(
        folder,
        "ferry-propellers",
        "Propellers and engine maps for the ferry of the CPP optimiser paper",
        "ferry.propellers --out docs/results",
        pd.concat(
            [
                front.assign(list="front"),
                forms.assign(list="best of each form"),
                rules.assign(list="best of each rise and exponent"),
            ]
        ),
        Path(__file__).with_suffix(".md"),
        count=len(found),
        propellers=len(BLADES) * len(AREA_RATIOS),
        blades=", ".join(map(str, BLADES)),
        areas=", ".join(map(str, AREA_RATIOS)),
        exponents=EXPONENTS,
        forms_count=len(FORMS),
        tolerance=variation_tolerances(),
        rounding=rounding_shift(forms.iloc[0], prints),
        wave_low=wave.min(),
        wave_high=wave.max(),
        best=forms.iloc[0],
        earlier=earlier.iloc[0],
        front=table_of(front),
        forms=table_of(pd.concat([forms, earlier])),
        variations=table_of(forms, VARIATIONS),
        rules=table_of(rules),
        levers=calibrated_levers(prints, ship),
        ferries=equal_ferries(prints, ship),
        lever=CALIBRATED_LEVER,
        ship=ship,
    )


def read_prints() -> Prints:
    """Return the printed states."""
    return similarity.read_prints()
