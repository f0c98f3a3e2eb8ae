"""The engine map that the CPP optimiser paper's tables imply, and what the optimiser makes of it.

The paper prints no map, but the consumption at twenty states of engine speed and ship speed (thirty
entries of its Tables 1 to 3), and that fifteen of them are optima. With the power that our ferry takes
there, a surface of the paper's own form, C_s = sum of c_ij N^i n^j, i up to 2 and j up to 3, is fitted
to them; weakly also to the optima (no slope of the fuel along equal thrust and speed), and more weakly,
so that it stays a map where no state lies, to the surface of a typical diesel at its level.

Run ``python -m shaftline.studies.ferry.engine_map --out docs/results``; about a minute.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...baselines.combinator_surface import combinator_surface
from ...baselines.steady_points import SteadyPoint, steady_point
from ...display import figures
from ...display.tables import markdown, write_table
from ...plant import Ship, load_ship
from ..side_by_side import published
from .lever_points import (
    COMBINATOR,
    CORRECTED,
    HELD,
    PAPERS,
    WHOLE_ENVELOPE,
    compared,
    optimal,
    pitch_for,
)
from .lever_tables import beside_print

Floats = NDArray[np.float64]

SHIP = "ferry-printed"
RATED_W, RATED_RPM, BASE = 1e5, 2200.0, 300.0
RISE = 1.15
"""Of the resistance, in all three tables."""

TERMS = tuple((i, j) for i in range(3) for j in range(4))
"""Powers of N and n of the paper's form."""

TRADED = (0.01, 0.02, 0.03, 0.06, 0.12)
"""Weights of the slopes that are tried."""

SLOPE_WEIGHT, PRIOR_WEIGHT = 0.06, 0.01
"""Of an optimum's slope, as a share of the fuel by a share of the speed, and of a point of the prior."""


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
    point = steady_point(ship, shaft, pitch_for(ship, shaft, ship_speed, factor), factor)
    return point.brake_torque * gear * shaft / RATED_W


def states(ship: Ship) -> States:
    """The thirty entries.

    Args:
        ship: the ferry, whose hull and propeller tell the power; its own map does not enter.
    """
    tables = published(PAPERS)
    rows = []
    for control in (COMBINATOR, HELD, CORRECTED):
        for lever, row in tables.loc[control].set_index("condition").iterrows():
            for when, factor in (("before", 1.0), ("after", RISE)):
                rpm = float(row[f"engine_speed_rpm_{when}"])
                knots = float(row[f"ship_speed_m_s_{when}"])
                power = [_power(ship, rpm + off, knots, factor) for off in (-1.0, 0.0, 1.0)]
                rows.append(
                    (control, int(str(lever)), when, knots, power[1], rpm / RATED_RPM,
                     float(row[f"sfoc_g_kwh_{when}"]), 0.5 * (power[2] - power[0]) * RATED_RPM)
                )  # fmt: skip
    columns = list(zip(*rows, strict=True))
    return States(*(list(c) for c in columns[:3]), *(np.array(c) for c in columns[3:]))  # type: ignore[arg-type]


def form(power: Floats, speed: Floats, terms: tuple[tuple[int, int], ...] = TERMS) -> Floats:
    """The surface's terms at states, shape (n, len(terms)).

    Args:
        power: over the rated, shape (n,).
        speed: likewise.
        terms: powers of both.
    """
    return np.column_stack([power**i * speed**j for i, j in terms])


def _prior() -> tuple[Floats, Floats, Floats]:
    """States all over the map and the consumption of the ``ferry``'s surface there, over its mean."""
    engine = load_ship("ferry").prime_mover
    grid = np.array(
        [
            (p, s)
            for s in np.linspace(0.35, 1.0, 8)
            for p in np.linspace(0.1, 1.0, 8)
            if p < 1.15 * s
        ]
    )
    power, speed = grid.T
    share = np.zeros(len(grid))
    for name in type(engine).model_fields:
        if name.startswith("fuel_p"):
            i, j = int(name[6]), int(name[9])
            share += getattr(engine, name) * power**i * speed**j
    return power, speed, share / power


def fitted(
    known: States, slope_weight: float = SLOPE_WEIGHT, prior_weight: float = PRIOR_WEIGHT
) -> Floats:
    """Coefficients of the map [g/kWh], in the order of :data:`TERMS`.

    Args:
        known: from :func:`states`.
        slope_weight: of the optima's slopes.
        prior_weight: of the prior.
    """
    p, s, c = known.power, known.speed, known.consumption
    best = np.array([table != COMBINATOR for table in known.table])
    slopes = (
        np.column_stack(
            [
                (i + 1) * p**i * s**j * known.slope + p ** (i + 1) * j * s ** max(j - 1, 0)
                for i, j in TERMS
            ]
        )
        / (p * c)[:, None]
    )
    power, speed, shape = _prior()
    level = c.mean() / np.mean(shape)
    rows = [form(p, s), slope_weight * BASE * slopes[best], prior_weight * form(power, speed)]
    aims = [c, np.zeros(int(best.sum())), prior_weight * level * shape]
    return np.asarray(np.linalg.lstsq(np.vstack(rows), np.concatenate(aims), rcond=None)[0])


def keys(coefficients: Floats) -> dict[str, float]:
    """The map, of :func:`fitted`, as keys of a ship's file."""
    own = {
        f"prime_mover.fuel_p{i + 1}_s{j}": float(c) / BASE
        for (i, j), c in zip(TERMS, coefficients, strict=True)
    }
    return {"prime_mover.fuel_p0_s1": 0.0, "prime_mover.fuel_p0_s2": 0.0} | own


def forms(known: States) -> pd.DataFrame:
    """How well surfaces of several forms hold the thirty entries, and a state that is left out.

    Args:
        known: from :func:`states`.
    """
    full = tuple((i, j) for i in range(3) for j in range(3) if i + j <= 2)
    p, s, c = known.power, known.speed, known.consumption
    places = [f"{a:.6f} {b:.6f}" for a, b in zip(known.ship_speed, s, strict=True)]
    rows = []
    for name, terms in (("full quadratic, 6 coefficients", full), ("the paper's form, 12", TERMS)):
        whole = form(p, s, terms)
        off = whole @ np.linalg.lstsq(whole, c, rcond=None)[0] - c
        out = []
        for place in sorted(set(places)):
            kept = np.array([one != place for one in places])
            told = np.linalg.lstsq(whole[kept], c[kept], rcond=None)[0]
            out.append(float(np.mean(whole[~kept] @ told - c[~kept])))
        rows.append((name, _rms(off), float(np.abs(off).max()), _rms(np.array(out))))
    off = form(p, s) @ fitted(known) - c
    rows.append(
        ("the ship's: with optima and prior", _rms(off), float(np.abs(off).max()), math.nan)
    )
    return pd.DataFrame(
        rows, columns=["form", "rms [g/kWh]", "worst [g/kWh]", "a state left out, rms [g/kWh]"]
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def chosen(ship: Ship) -> pd.DataFrame:
    """Where the optimiser, free to choose, settles at the printed ship speeds, beside the print.

    Args:
        ship: with the inferred map.
    """
    surface = combinator_surface(ship, WHOLE_ENVELOPE)
    printed = published(PAPERS).loc[CORRECTED].set_index("condition")
    rows = []
    for lever, row in printed.iterrows():
        for when, factor in (("before", 1.0), ("after", RISE)):
            point = optimal(ship, surface, float(row[f"ship_speed_m_s_{when}"]), factor)
            assert point is not None
            rpm, consumption = _told(ship, point)
            rows.append(
                {"lever": str(lever), "when": when, "engine [rpm]": rpm,
                 "printed [rpm]": float(row[f"engine_speed_rpm_{when}"]),
                 "SFOC [g/kWh]": consumption, "printed [g/kWh]": float(row[f"sfoc_g_kwh_{when}"])}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _told(ship: Ship, point: SteadyPoint) -> tuple[float, float]:
    engine = ship.transmission.gear_ratio * point.shaft_speed
    return engine * 30.0 / math.pi, 3.6e9 * point.fuel_flow / (point.brake_torque * engine)


def traded(ship: Ship) -> pd.DataFrame:
    """What maps come to that are asked for their optima more or less.

    Args:
        ship: the ferry, with any map.
    """
    known, rows = states(ship), []
    for weight in TRADED:
        found = compared(ship.with_values(keys(fitted(known, weight))))
        found = found[(found["curve"] == "printed") & (found["lever"] < 5)]
        table = beside_print(found)
        off = (table["ours"] - table["printed"]).abs()
        sfoc, rpm = (table["quantity"] == name for name in ("sfoc_g_kwh", "engine_speed_rpm"))
        saved = found.loc[found["condition"] == "resistance +15 %", "saving_percent"].dropna()
        rows.append(
            {
                "weight of the slopes": weight,
                "SFOC within 3 g/kWh, of 24": int((off[sfoc] <= 3.0).sum()),
                "worst [g/kWh]": off[sfoc].max(),
                "worst engine speed [rpm]": off[rpm].max(),
                "fuel saved, least [%]": saved.min(),
                "most [%]": saved.max(),
            }
        )
    return pd.DataFrame(rows)


def drawn(known: States, coefficients: Floats) -> Figure:
    """The map over power and speed with the printed states on it (the paper's Figure 2)."""
    figure, axes = figures.new_figure(1, 1, (7.5, 5.0))
    axis = axes[0, 0]
    speed, power = np.meshgrid(np.linspace(0.55, 1.0, 80), np.linspace(0.3, 1.0, 80))
    level = (form(power.ravel(), speed.ravel()) @ coefficients).reshape(power.shape)
    lines = axis.contour(RATED_RPM * speed, 100.0 * power, level, levels=range(260, 421, 10),
                         colors=figures.THESIS, linewidths=0.8)  # fmt: skip
    axis.clabel(lines, fontsize=7, fmt="%d")
    for k, table in enumerate((COMBINATOR, HELD, CORRECTED)):
        own = np.array([name == table for name in known.table])
        axis.plot(RATED_RPM * known.speed[own], 100.0 * known.power[own], "os^"[k], markersize=4,
                  color=figures.PALETTE[k], label=f"Table {k + 1}")  # fmt: skip
    axis.set_xlabel("engine speed [rpm]")
    axis.set_ylabel("power of our ferry there [kW]")
    axis.set_title("Specific consumption [g/kWh] inferred from the printed states", fontsize=10)
    axis.legend(fontsize=8, frameon=False)
    return figure


BODY = """\
The CPP optimiser paper prints no engine map. Its Tables 1 to 3 print the consumption at twenty states of
engine speed and ship speed; with the power that our ferry takes there (all but its length, power and
speed is assumed), a surface of the paper's own form follows from them, here that of
[`ferry-printed`](../../plant/ships/ferry-printed.toml). **It is inferred from the tables that it
reproduces.** What is not put in is where the optimiser goes on it.

## How well a surface holds the entries

With the resistance of `ferry` (the square of the speed) and of `ferry-printed` (the power 2.65 that
Table 2 asks for):

{forms}

Twelve coefficients on twenty states leave eight free: supportive, no miracle. On the strip where the
states lie consumption rises almost with the torque, unlike that of any modern engine. With the steeper
resistance the entries are held less well and a state that is left out is missed by more: the two things
that the tables say, of the hull and of the engine, do not quite go together with our propeller.

*The ship's* is asked for more: that fifteen states be optima of our ferry, and that the map be one where
no state lies. With the entries alone the form is negative at low power, and the optimiser leaves the
strip.

## Where the optimiser goes

At the printed ship speeds, on `ferry-printed`, free to choose pitch and revolutions within the whole
envelope:

{chosen}

At levers 1 to 4 its revolutions are within {rpm:.0f} rpm and its consumption is within {sfoc:.1f} g/kWh
of the print. At lever 5 the optimum lies {five_rpm:.0f} rpm below the printed one, {five:.0f} g/kWh
above: there, at the strip's end, the fit gives way.

## What is traded

The paper's savings are not there: the more the printed states are made optima, the less is lost by
sailing beside them. The same experiment as on the page of the [levers](levers.md), curve `printed`,
levers 1 to 4, for several weights of the slopes; the ship has {weight:g}:

{traded}

No weight has the printed consumption, the printed revolutions and the printed saving of 1.8 to 3.1 %
together.

![The inferred map with the printed states](figures/ferry-map.png)"""


def main() -> None:
    """Write ``ferry-map.md``, its table and its figure; print the map's keys."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/ferry-map"), help="folder")
    folder = parser.parse_args().out
    ship = load_ship(SHIP)
    known, square = states(ship), states(load_ship("ferry"))
    coefficients = fitted(known)
    for key, value in keys(coefficients).items():
        print(f"{key.split('.')[1]} = {value:.6f}")
    found = chosen(ship)
    off_rpm = found["engine [rpm]"] - found["printed [rpm]"]
    off = found["SFOC [g/kWh]"] - found["printed [g/kWh]"]
    four = found["lever"] != "5"
    both = pd.concat([forms(known).assign(ship=SHIP), forms(square).assign(ship="ferry")])
    body = BODY.format(
        traded=markdown(traded(ship), 2), weight=SLOPE_WEIGHT,
        forms=markdown(both), chosen=markdown(found, 1), rpm=off_rpm[four].abs().max(),
        sfoc=off[four].abs().max(), five=off[~four].max(), five_rpm=-off_rpm[~four].min(),
    )  # fmt: skip
    figures.save(drawn(known, coefficients), folder / "figures" / "ferry-map.png")
    command = "python -m shaftline.studies.ferry.engine_map --out docs/results"
    write_table(folder, "ferry-map", "The ferry's engine map, inferred", command, found, body)


if __name__ == "__main__":
    main()
