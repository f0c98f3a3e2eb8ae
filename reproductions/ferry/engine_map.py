"""Infer the engine map of the ferry from the CPP optimiser paper's tables, and test the optimiser on it.

The paper prints no map, but the consumption at twenty states of engine speed and ship speed (thirty
entries of its Tables 1 to 3), fifteen of which are optima. A surface of the paper's own form, C_s = sum
of c_ij N^i n^j, i up to 2 and j up to 3, is fitted to the thirty entries; with a small weight also to
the optima (no slope of the fuel along equal thrust and speed), and with a smaller one to a typical
diesel at its level. No state of the envelope may consume less than a floor, or the optimiser would leave
the printed states.

Run ``python -m reproductions ferry.engine_map --out docs/results``; about a minute.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.baselines.steady_points import steady_point
from shaftline.display import figures
from shaftline.plant import Ship, load_ship

from ..pages import label_axis, make_parser, write_page
from . import experiment
from .bounded import bounded_least_squares
from .experiment import COMBINATOR, CORRECTED, HELD, LEVERS, RAISED, RISE, printed_levers
from .levers import HALF_DIGIT, implied_rises, implied_savings, table_cells

Floats = NDArray[np.float64]

RATED_W, RATED_RPM, BASE, IDLE_RPM = 1e5, 2200.0, 300.0, 700.0
TERMS = tuple((i, j) for i in range(3) for j in range(4))  # powers of N and n of the paper's form
SLOPE_WEIGHT, PRIOR_WEIGHT = 0.03, 0.0003
"""Weights of the slope of an optimum (share of the fuel by share of the speed) and of the prior."""

FLOOR = 285.0
"""Lowest consumption of the map [g/kWh]; the tables print 291.2 to 343.5."""


class States(NamedTuple):
    """The printed states with our ferry's power."""

    table: list[str]
    lever: list[int]
    when: list[str]
    ship_speed: Floats  # [m/s]
    power: Floats  # over the rated [-]
    speed: Floats  # of the engine over the rated [-]
    consumption: Floats  # [g/kWh]
    slope: Floats  # of the power with the engine's speed at equal thrust and ship speed [-]


def _power(ship: Ship, rpm: float, ship_speed: float, factor: float) -> float:
    gear = ship.transmission.gear_ratio
    shaft = rpm * math.pi / 30.0 / gear
    pitch = experiment.pitch_for(ship, shaft, ship_speed, factor)
    return steady_point(ship, shaft, pitch, factor).brake_torque * gear * shaft / RATED_W


def states(ship: Ship, rise: tuple[float, ...] = (RISE,) * LEVERS) -> States:
    """Return the thirty entries, with the power of the ferry's hull and propeller.

    ``rise`` is the resistance after the disturbance over that before it, by lever [-].
    """
    rows: list[tuple[Any, ...]] = []
    for control in (COMBINATOR, HELD, CORRECTED):
        for (lever, row), more in zip(printed_levers(control).iterrows(), rise, strict=True):
            for when, factor in (("before", 1.0), ("after", more)):
                rpm, speed, sfoc = (
                    float(row[f"{name}_{when}"])
                    for name in ("engine_speed_rpm", "ship_speed_m_s", "sfoc_g_kwh")
                )
                power = [_power(ship, rpm + off, speed, factor) for off in (-1.0, 0.0, 1.0)]
                slope = 0.5 * (power[2] - power[0]) * RATED_RPM
                rows.append((control, lever, when, speed, power[1], rpm / RATED_RPM, sfoc, slope))
    columns: list[Any] = list(zip(*rows, strict=True))
    return States(*map(list, columns[:3]), *map(np.array, columns[3:]))  # type: ignore[arg-type]


def form_terms(power: Floats, speed: Floats, terms: tuple[tuple[int, int], ...] = TERMS) -> Floats:
    """Return the terms of the surface at states, shape (n, len(terms)).

    Power and speed are over the rated ones [-], shape (n,).
    """
    return np.column_stack([power**i * speed**j for i, j in terms])


def _prior() -> tuple[Floats, Floats, Floats]:
    """Return states all over the map and the consumption of the ``ferry`` there, over its mean."""
    engine = load_ship("ferry").prime_mover
    speeds, powers = np.linspace(0.35, 1.0, 8), np.linspace(0.1, 1.0, 8)
    power, speed = np.array([(p, s) for s in speeds for p in powers if p < 1.15 * s]).T
    share = np.zeros(len(power))
    for name in type(engine).model_fields:
        if name.startswith("fuel_p"):
            share += getattr(engine, name) * power ** int(name[6]) * speed ** int(name[9])
    return power, speed, share / power


def envelope_states(speeds: int = 18, powers: int = 25) -> tuple[Floats, Floats]:
    """Return powers and engine speeds over the rated ones on a grid over the engine's envelope."""
    speed, power = np.linspace(IDLE_RPM / RATED_RPM, 1.0, speeds), np.linspace(0.02, 1.0, powers)
    found = np.array([(p, s) for s in speed for p in power if p < 1.15 * s]).T
    return found[0], found[1]


def fit_map(
    known: States,
    slope_weight: float = SLOPE_WEIGHT,
    prior_weight: float = PRIOR_WEIGHT,
    floor: float = FLOOR,
) -> Floats:
    """Return the coefficients of the map [g/kWh], in the order of :data:`TERMS`.

    ``floor`` is the lowest consumption in the envelope [g/kWh], -inf for none.
    """
    p, s, c = known.power, known.speed, known.consumption
    best = np.array([table != COMBINATOR for table in known.table])
    along = [
        (i + 1) * p**i * s**j * known.slope + p ** (i + 1) * j * s ** max(j - 1, 0)
        for i, j in TERMS
    ]
    slopes = np.column_stack(along) / (p * c)[:, None]
    power, speed, shape = _prior()
    level = c.mean() / np.mean(shape)
    prior = prior_weight * form_terms(power, speed)
    rows = np.vstack([form_terms(p, s), slope_weight * BASE * slopes[best], prior])
    aims = np.concatenate([c, np.zeros(int(best.sum())), prior_weight * level * shape])
    if math.isinf(floor):
        return np.asarray(np.linalg.lstsq(rows, aims, rcond=None)[0])
    limits = form_terms(*envelope_states())
    return bounded_least_squares(rows, aims, limits, np.full(len(limits), floor))


def ship_keys(coefficients: Floats) -> dict[str, float]:
    """Return the map of :func:`fit_map` as keys of a ship file."""
    own = {
        f"prime_mover.fuel_p{i + 1}_s{j}": float(c) / BASE
        for (i, j), c in zip(TERMS, coefficients, strict=True)
    }
    return {"prime_mover.fuel_p0_s1": 0.0, "prime_mover.fuel_p0_s2": 0.0} | own


def compare_forms(known: States) -> pd.DataFrame:
    """Return the errors of surfaces of several forms at the thirty entries, and at a state left out."""
    full = tuple((i, j) for i in range(3) for j in range(3) if i + j <= 2)
    p, s, c = known.power, known.speed, known.consumption
    places = np.array([f"{a:.6f} {b:.6f}" for a, b in zip(known.ship_speed, s, strict=True)])
    rows = []
    for name, terms in (("full quadratic, 6 coefficients", full), ("the paper's form, 12", TERMS)):
        whole, out = form_terms(p, s, terms), []
        for place in np.unique(places):
            kept = places != place
            told = np.linalg.lstsq(whole[kept], c[kept], rcond=None)[0]
            out.append(float(np.mean(whole[~kept] @ told - c[~kept])))
        off = whole @ np.linalg.lstsq(whole, c, rcond=None)[0] - c
        rows.append((name, rms(off), float(np.abs(off).max()), rms(np.array(out))))
    off = form_terms(p, s) @ fit_map(known) - c
    rows.append(("the ship's: with optima and prior", rms(off), float(np.abs(off).max()), math.nan))
    columns = ["form", "rms [g/kWh]", "worst [g/kWh]", "a state left out, rms [g/kWh]"]
    return pd.DataFrame(rows, columns=columns)


def rms(values: Floats) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(values**2)))


SHIP = "ferry-printed"
TRADED = ((0.03, 0.0003), (0.03, 0.001), (0.03, 0.003), (0.03, 0.01), (0.01, 0.001), (0.12, 0.001))
"""Weights of the slopes and of the prior that are tried."""


def optimiser_states(ship: Ship) -> pd.DataFrame:
    """Return the optimiser's states at the printed ship speeds, beside the printed states."""
    surface, rows = combinator_surface(ship, experiment.WHOLE_ENVELOPE), []
    for lever, row in printed_levers(CORRECTED).iterrows():
        for when, factor in (("before", 1.0), ("after", RISE)):
            speed = float(row[f"ship_speed_m_s_{when}"])
            point = experiment.optimal_state(ship, surface, speed, factor)
            assert point is not None
            own = experiment.in_units_of_paper(ship, point)
            rows.append(
                {
                    "lever": str(lever),
                    "when": when,
                    "engine [rpm]": own["engine_speed_rpm"],
                    "printed [rpm]": float(row[f"engine_speed_rpm_{when}"]),
                    "SFOC [g/kWh]": own["sfoc_g_kwh"],
                    "printed [g/kWh]": float(row[f"sfoc_g_kwh_{when}"]),
                }
            )
    return pd.DataFrame(rows)


def try_weights(ship: Ship) -> pd.DataFrame:
    """Return errors and savings of maps with several weights of the optima and of the prior."""
    known, rows = states(ship), []
    for weight, prior in TRADED:
        coefficients = fit_map(known, weight, prior)
        other = ship.with_values(ship_keys(coefficients))
        found = experiment.compare_controls(other)
        found = found[found["curve"] == "printed"]
        off: dict[str, list[float]] = {name: [] for name in HALF_DIGIT}
        for cell in table_cells(found, other):
            if not re.search("lever 5|variation", cell.row):
                off[cell.column].append(abs(cell.ours - cell.printed))
        saved = found.loc[(found["condition"] == RAISED) & (found["lever"] < 5), "saving_percent"]
        rows.append(
            {
                "weight of the slopes": f"{weight:g}",
                "of the prior": f"{prior:g}",
                "SFOC, rms [g/kWh]": rms(np.array(off["sfoc_g_kwh"])),
                "worst [g/kWh]": max(off["sfoc_g_kwh"]),
                "worst engine speed [rpm]": max(off["engine_speed_rpm"]),
                "fuel saved, least [%]": saved.min(),
                "most [%]": saved.max(),
                "largest of the map [g/kWh]": (form_terms(*envelope_states()) @ coefficients).max(),
            }
        )
    return pd.DataFrame(rows)


def draw_map(known: States, coefficients: Floats) -> Figure:
    """Draw the map over power and speed with the printed states (the paper's Figure 2)."""
    figure, axes = figures.new_figure(1, 1, (7.5, 5.0))
    axis = axes[0, 0]
    speed, power = np.meshgrid(np.linspace(0.55, 1.0, 80), np.linspace(0.3, 1.0, 80))
    level = (form_terms(power.ravel(), speed.ravel()) @ coefficients).reshape(power.shape)
    lines = axis.contour(
        RATED_RPM * speed,
        100.0 * power,
        level,
        levels=range(260, 421, 10),
        colors=figures.THESIS,
        linewidths=0.8,
    )
    axis.clabel(lines, fontsize=7, fmt="%d")
    for k, table in enumerate((COMBINATOR, HELD, CORRECTED)):
        own = np.array([name == table for name in known.table])
        axis.plot(
            RATED_RPM * known.speed[own],
            100.0 * known.power[own],
            "os^"[k],
            markersize=4,
            color=figures.PALETTE[k],
            label=f"Table {k + 1}",
        )
    title = "Specific consumption [g/kWh] inferred from the printed states"
    label_axis(axis, "engine speed [rpm]", "power of our ferry there [kW]", title, 10, None, 8)
    return figure


def main() -> None:
    """Write ``ferry-map.md``, its table and its figure; print the keys of the map."""
    folder = make_parser("ferry.engine_map", __doc__, "out/ferry-map").parse_args().out
    ship = load_ship(SHIP)
    known = states(ship)
    coefficients = fit_map(known)
    for key, value in ship_keys(coefficients).items():
        print(f"{key.split('.')[1]} = {value:.6f}")
    found = optimiser_states(ship)
    by_table = {
        name: tuple(1.0 + 0.01 * implied_rises(ship)[f"rise {name} [%]"])
        for name in ("by Table 1", "by Table 2")
    }
    tried = {"15 %": (RISE,) * LEVERS, **by_table}
    figures.save(draw_map(known, coefficients), folder / "figures" / "ferry-map.png")
    write_page(
        folder,
        "ferry-map",
        "Engine map of the ferry, inferred from printed tables",
        "ferry.engine_map --out docs/results",
        found,
        Path(__file__).with_name("engine_map.md"),
        states=found,
        weight=SLOPE_WEIGHT,
        prior=PRIOR_WEIGHT,
        floor=FLOOR,
        weights=try_weights(ship),
        four=found["lever"] != "5",
        five=found["lever"] == "5",
        off_rpm=(found["engine [rpm]"] - found["printed [rpm]"]).abs(),
        off=(found["SFOC [g/kWh]"] - found["printed [g/kWh]"]).abs(),
        forms=pd.concat([compare_forms(states(ship, r)).assign(rise=n) for n, r in tried.items()]),
        saved=-implied_savings(ship)["fuel per mile change [%]"].iloc[:4],
    )
