"""What a coarse inverse of the torque curve costs: a guess at the thesis's own.

The thesis inverts KQ by a table of which it prints nothing. Its scores of the shaft acceleration
observer, which knows M_p exactly, lie below 100 in every column. Here the inverse is a table in P/D
and J: the column of the pitch node at or below the measured pitch, and in this column the entry nearest
to KQ, without interpolation. The steps are round numbers, chosen by the printed scores of
:data:`CHOSEN_BY`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.observers import follow, get_observer, readings_of
from shaftline.observers.following import Floats, variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES
from shaftline.plant.open_water import MAX_ADVANCE_RATIO, open_water

from ..cells import Reason
from ..side_by_side import published

PITCH_STEP, ADVANCE_STEP = 0.01, 0.005
"""Steps of the table in P/D and J [-]."""
CHOSEN_BY = ("shaft-acceleration", "power-balance")
"""Rows of Table 4-1 by which the steps and the rule were chosen."""
ROWS = (
    "luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman", "power-balance",
    "shaft-acceleration", "shaft-acceleration-derived",
)  # fmt: skip
"""The observers that invert the torque curve."""
PITCH_POINTS, OTHER_POINTS = 4.5, 0.02
"""Distance from the printed score [points] that still counts, in the pitch step and elsewhere."""

_EPSILON = 1e-9


def node_below(pitch_ratio: float, step: float) -> float:
    """Return the pitch node at or below a pitch ratio."""
    return float(np.floor(pitch_ratio / step + _EPSILON) * step)


def node_nearest(pitch_ratio: float, step: float) -> float:
    """Return the pitch node nearest to a pitch ratio."""
    return float(np.round(pitch_ratio / step) * step)


def table_inverse(
    curve: Floats,
    coefficient: Floats,
    pitch_ratio: Floats,
    pitch_step: float = PITCH_STEP,
    advance_step: float = ADVANCE_STEP,
    node: Callable[[float, float], float] = node_below,
) -> Floats:
    """Return J [-] by the table, shape (n,).

    Args:
        curve: coefficients of KQ.
        coefficient: KQ [-], shape (n,).
        pitch_ratio: P/D [-], shape (n,).
        pitch_step: step of the table in P/D.
        advance_step: step in J.
        node: :func:`node_below` or :func:`node_nearest`.
    """
    ratios = np.arange(0.0, MAX_ADVANCE_RATIO, advance_step)
    nodes = np.array([node(pitch, pitch_step) for pitch in pitch_ratio])
    found = np.empty(len(coefficient))
    for one in np.unique(nodes):
        column = np.array([open_water(curve, j, one) for j in ratios])
        for i in np.flatnonzero(nodes == one):
            found[i] = ratios[np.argmin(np.abs(column - coefficient[i]))]
    return found


def _score(ship: Ship, samples: NDArray[Any], estimate: Floats, **table: Any) -> float:
    """VAF [%] of an observer's estimate once its exact inverse is replaced by the table."""
    record = ship.record()
    turns = samples["shaft_speed"] / (2.0 * np.pi) * float(record["diameter"])
    kq = np.array([
        open_water(record["kq"], j, pitch)
        for j, pitch in zip(estimate / turns, samples["pitch_ratio"], strict=True)
    ])  # fmt: skip
    ratio = table_inverse(record["kq"], kq, samples["pitch_ratio"], **table)
    return variance_accounted_for(samples["advance_velocity"], ratio * turns)


def table_scores() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the VAF [%] by observer and load case, with the exact inverse and with the table.

    The sea is that of seed 0 in both.
    """
    frigate = load_ship("frigate")
    exact: dict[str, dict[str, float]] = {row: {} for row in ROWS}
    rounded: dict[str, dict[str, float]] = {row: {} for row in ROWS}
    for case in (c for c in CASES.values() if not c.noisy):
        samples = case.run(frigate)
        for row in ROWS:
            estimate, _ = follow(
                get_observer(row), frigate, readings_of(samples), frigate.time_step_s
            )
            exact[row][case.name] = variance_accounted_for(samples["advance_velocity"], estimate)
            rounded[row][case.name] = _score(frigate, samples, estimate)
    return (
        pd.DataFrame.from_dict(exact, orient="index"),
        pd.DataFrame.from_dict(rounded, orient="index"),
    )


def other_tables() -> pd.DataFrame:
    """Return the pitch step's VAF [%] of two observers for other tables, one line a table."""
    frigate = load_ship("frigate")
    samples, lines = CASES["pitch_step"].run(frigate), []
    estimates = {
        row: follow(get_observer(row), frigate, readings_of(samples), frigate.time_step_s)[0]
        for row in CHOSEN_BY
    }
    for node, name in ((node_below, "at or below"), (node_nearest, "nearest")):
        for steps in (0.02, 0.0125, 0.01, 0.005):
            for advance in (0.001, 0.005, 0.01):
                scores = {
                    row: _score(frigate, samples, one, pitch_step=steps, advance_step=advance,
                                node=node)
                    for row, one in estimates.items()
                }  # fmt: skip
                lines.append(
                    {"pitch node": name, "step in P/D": steps, "step in J": advance, **scores}
                )
    printed = published("advance_velocity_thesis_vaf")["pitch_step"]
    lines.append({"pitch node": "the thesis", **{row: float(printed[row]) for row in CHOSEN_BY}})
    return pd.DataFrame(lines)


def wrong_curve_changes() -> pd.DataFrame:
    """Return the change of VAF [points] of the shaft acceleration observer when its KQ is wrong."""
    frigate = load_ship("frigate")
    samples, record = CASES["inflow_sine_high"].run(frigate), frigate.record()
    turns = samples["shaft_speed"] / (2.0 * np.pi) * float(record["diameter"])
    pitch, truth = samples["pitch_ratio"], samples["advance_velocity"]
    kq = np.array([
        open_water(record["kq"], j, one) for j, one in zip(truth / turns, pitch, strict=True)
    ])  # fmt: skip

    def score(factor: float, step: float) -> float:
        ratio = table_inverse(factor * record["kq"], kq, pitch, advance_step=step)
        return variance_accounted_for(truth, ratio * turns)

    printed = published("advance_velocity_thesis_sensitivity").loc["shaft-acceleration"]
    rows = []
    for factor, column in ((0.9, "open_water_minus_10pct"), (1.1, "open_water_plus_10pct")):
        fine, coarse = (score(factor, step) - score(1.0, step) for step in (1e-4, ADVANCE_STEP))
        rows.append(
            {"KQ believed / right": factor, "step in J 0.0001": fine,
             f"step in J {ADVANCE_STEP:g}": coarse, "printed": float(printed[column])}
        )  # fmt: skip
    return pd.DataFrame(rows)


def reasons(exact: pd.DataFrame, rounded: pd.DataFrame) -> dict[tuple[str, str], Reason]:
    """Return what the table adds to each score, as reasons of Table 4-1.

    The rows by which the table was chosen have none: it explains what it was not fitted to.

    Args:
        exact: scores with the exact inverse, from :func:`table_scores`.
        rounded: scores with the table.
    """
    found = {}
    for row in set(ROWS) - set(CHOSEN_BY):
        for case in exact.columns:
            shift = float(rounded.loc[row, case] - exact.loc[row, case])
            within = PITCH_POINTS if case == "pitch_step" else OTHER_POINTS
            if abs(shift) >= 2.0 * within:
                text = (
                    f"a table of KQ with steps of {PITCH_STEP:g} in P/D (node at or below) and "
                    f"{ADVANCE_STEP:g} in J (nearest entry), read without interpolation, brings our "
                    f"score to within {within:g} points of the print; steps and rule are chosen by "
                    "the "
                    "printed scores of two rows"
                )
                found[row, case] = Reason(text, shift, within)
    return found
