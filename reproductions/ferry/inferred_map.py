"""A map of the ferry's engine from the consumption that the CPP optimiser paper's tables print.

A surface of the paper's own form, C_s = sum of c_ij N^i n^j, i up to 2 and j up to 3, is fitted to the
thirty printed entries; weakly also to the optima (no slope of the fuel along equal thrust and speed),
and more weakly, so that it stays a map where no state lies, to a typical diesel at its level.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.baselines.steady_points import steady_point
from shaftline.plant import Ship, load_ship

from ..side_by_side import published
from .lever_points import COMBINATOR, CORRECTED, HELD, PAPERS, pitch_for, rises

Floats = NDArray[np.float64]

RATED_W, RATED_RPM, BASE = 1e5, 2200.0, 300.0
TERMS = tuple((i, j) for i in range(3) for j in range(4))
"""Powers of N and n of the paper's form."""

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


def states(ship: Ship, rise: tuple[float, ...] | None = None) -> States:
    """The thirty entries.

    Args:
        ship: the ferry, whose hull and propeller tell the power; its own map does not enter.
        rise: resistance after the disturbance over that before it, by lever [-]; those of
            :func:`.lever_points.rises` by default.
    """
    tables, rise = published(PAPERS), rise or rises()
    rows = []
    for control in (COMBINATOR, HELD, CORRECTED):
        for lever, row in tables.loc[control].set_index("condition").iterrows():
            for when, factor in (("before", 1.0), ("after", rise[int(str(lever)) - 1])):
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
        rows.append((name, rms(off), float(np.abs(off).max()), rms(np.array(out))))
    off = form(p, s) @ fitted(known) - c
    rows.append(("the ship's: with optima and prior", rms(off), float(np.abs(off).max()), math.nan))
    return pd.DataFrame(
        rows, columns=["form", "rms [g/kWh]", "worst [g/kWh]", "a state left out, rms [g/kWh]"]
    )


def rms(values: Floats) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(values**2)))
