"""Fit each effect of the catalogue to the five published steady states of the Tito Neri drive train.

Only a table of ten numbers was published, without time, noise and transients, so this is no diagnosis.
Each effect of the catalogue that acts on a motor in steady running ahead is fitted to the points, and
tested on each point that it was not fitted to.

Run ``python -m reproductions tito_neri.effects --out docs/results``.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.cli.tour_command import MODELS
from shaftline.plant import Ship, equilibrium, load_ship

from ..pages import make_parser, write_page
from ..side_by_side import published

EFFECTS = {
    "command-dead-zone": ("prime_mover.command_dead_zone_V", 0.0, 1.0),
    "coulomb-friction": ("transmission.coulomb_friction_engine_side_N_m", 0.0, 0.1),
    "viscous-friction": ("transmission.viscous_friction_engine_side_N_m_s_rad", 0.0, 1e-3),
    "quadratic-drag": ("transmission.quadratic_drag_N_m_s2_rad2", 0.0, 1e-5),
    "supply-limit": ("prime_mover.supply_limit_V", 3.0, 9.0),
}
"""Key of the ship file, and the range of the search."""


def errors(ship: Ship) -> NDArray[np.float64]:
    """Return simulated minus measured speed and current [%], shape (points, 2)."""
    ratio, pitch = ship.transmission.gear_ratio, ship.propeller.pitch_ratio_max
    found = []
    for point in published("tito_neri_operating_points").itertuples():
        state = equilibrium(ship, float(point.motor_voltage_V), pitch).state
        speed, current = float(point.motor_speed_rad_s), float(point.motor_current_A)
        found.append(
            [
                100.0 * (state.shaft_speed * ratio / speed - 1.0),
                100.0 * (state.motor_current / current - 1.0),
            ]
        )
    return np.array(found)


def rms(values: Any) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def fit_effect(ship: Ship, effect: str, points: Any) -> float:
    """Return the value of an effect with the smallest error at some points."""
    key, low, high = EFFECTS[effect]

    def loss(value: float) -> float:
        return rms(errors(ship.with_values({key: float(value)}))[points])

    best = scipy.optimize.minimize_scalar(
        loss,
        bounds=(low, high),
        method="bounded",
        options={"maxiter": 25, "xatol": 1e-4 * (high - low)},
    )
    return float(best.x)


def table() -> pd.DataFrame:
    """Return the value of every effect on either set, and errors before, after and unseen."""
    rows = []
    for name, (effect, (key, _, _)) in itertools.product(MODELS, EFFECTS.items()):
        ship = load_ship(name)
        before = errors(ship)
        every = np.arange(len(before))
        value = fit_effect(ship, effect, every)
        unseen = [
            errors(ship.with_values({key: fit_effect(ship, effect, every != left)}))[left]
            for left in every
        ]
        rows.append(
            {
                "model": name,
                "effect": effect,
                "value": value,
                "key": key.split(".")[1],
                "before_percent": rms(before),
                "after_percent": rms(errors(ship.with_values({key: value}))),
                "unseen_percent": rms(unseen),
            }
        )
    return pd.DataFrame(rows)


def findings(found: pd.DataFrame) -> str:
    """Return the result of the table, one list item for each model."""
    lines = []
    for name, group in found.groupby("model", sort=False):
        best, second = (row for _, row in group.nsmallest(2, "unseen_percent").iterrows())
        before, unseen = float(best["before_percent"]), float(best["unseen_percent"])
        said = (
            f"**{best['effect']}** ({best['key']} = {best['value']:.3g}) fits best: {before:.2f} % "
            f"falls to {best['after_percent']:.2f} %, unseen {unseen:.2f} %"
        )
        if unseen > 0.9 * before:
            said = f"five points do not show that anything is missing; {said}"
        if second["unseen_percent"] - unseen < 0.1 * before:
            said += "; another effect fits as well, so the effect is not decided"
        lines.append(f"- {name}: {said}.")
    return "\n".join(lines)


def main() -> None:
    """Fit the effects, and write ``tito-neri.md`` and its table."""
    folder = make_parser("tito_neri.effects", __doc__, "out/tito-neri").parse_args().out
    found = table()
    shown = found.assign(value=found["value"].map("{:.3g}".format))
    title, template = (
        "Tito Neri: effects that explain five steady states",
        Path(__file__).with_suffix(".md"),
    )
    command = "tito_neri.effects --out docs/results"
    write_page(
        folder, "tito-neri", title, command, found, template, shown=shown, findings=findings(found)
    )
    print(findings(found))
