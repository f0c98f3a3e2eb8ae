"""What a rounded inverse of the torque curve costs: a guess at the thesis's own.

The thesis inverts KQ by a table of which it prints nothing. Its scores of the shaft acceleration
observer, which knows M_p exactly, lie below 100 in every column; a table that is read at its nearest
entry, without interpolation, loses about as much.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...observers.metrics import Floats, variance_accounted_for
from ...plant import load_ship
from ...plant.open_water import MAX_ADVANCE_RATIO, open_water
from ..side_by_side import published
from .load_cases import CASES

PITCH_STEP, ADVANCE_STEP = 0.01, 0.005
"""Steps of the table in P/D and J [-], chosen to meet the printed scores."""


def _rounded_inverse(curve: Floats, coefficient: Floats, pitch_ratio: Floats) -> Floats:
    """J [-] of the nearest entry of a table of KQ over rounded P/D and J; shape (n,)."""
    ratios = np.arange(0.0, MAX_ADVANCE_RATIO, ADVANCE_STEP)
    columns: dict[int, Floats] = {}
    found = np.empty(len(coefficient))
    for i, (kq, pitch) in enumerate(zip(coefficient, pitch_ratio, strict=True)):
        node = round(pitch / PITCH_STEP)
        if node not in columns:
            columns[node] = np.array([open_water(curve, j, node * PITCH_STEP) for j in ratios])
        found[i] = ratios[np.argmin(np.abs(columns[node] - kq))]
    return found


def rounded_scores() -> pd.DataFrame:
    """VAF [%] with exact M_p and with M_m for it, by the rounded inverse, beside the thesis's."""
    frigate = load_ship("frigate")
    plant = frigate.record()
    printed = published("advance_velocity_thesis_vaf")
    rows: dict[str, dict[str, float]] = {}
    for case in (c for c in CASES.values() if not c.noisy):
        samples = case.run(frigate)
        n = samples["shaft_speed"] / (2.0 * np.pi)
        scale = float(plant["density"] * plant["diameter"] ** 5) * n**2
        for observer, torque in (
            ("shaft-acceleration", "propeller_torque"),
            ("power-balance", "shaft_torque"),
        ):
            ratio = _rounded_inverse(plant["kq"], samples[torque] / scale, samples["pitch_ratio"])
            estimate = ratio * n * float(plant["diameter"])
            score = variance_accounted_for(samples["advance_velocity"], estimate)
            rows.setdefault(f"{observer}, rounded", {})[case.name] = score
            rows.setdefault(f"{observer}, thesis", {})[case.name] = float(
                printed.loc[observer, case.name]
            )
    return pd.DataFrame.from_dict(rows, orient="index").reset_index(names="")
