"""Tables 3-11 to 3-14: poles, zeros and gains of the random-walk Kalman filter, from one number a point.

They are those of a discrete predictor x+ = (A - K C) x + B u + K y, in z and not in s: the thesis takes
the linear model's A = ((a11, a12), (0, 1)) for a transition between samples, and Q = diag(1e4, 1e11)
with R = 1 makes K dead-beat, K = (1 + a11, 1 / a12). Both poles are then 0; what is printed of them is
rounding. "Steady" gains are printed at z = 0, divided by the product of the two, and so mean nothing:

    omega^/omega   zero 1 - 1 / (1 + a11)   gain -a11 / (p1 p2)
    omega^/M_m     zero 1                   gain -1 / (I_R p1 p2)
    v_a^/omega     zero a11                 gain -k2 a11 / (p1 p2)
    v_a^/M_m       no zero                  gain -k2 / (I_R p1 p2)
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.core.lazy import control
from shaftline.observers.torque_curve import torque_slopes
from shaftline.plant import Ship, equilibrium

from ..side_by_side import published

NOISES = (1e4, 1e11)
"""Q of omega and v_a, where R is 1."""

_TABLES = ("3-11", "3-12", "3-13", "3-14")

WHY = """\
They are those of a discrete filter, printed as if of a continuous one: the linear
model's A is taken for a step from one sample to the next, Q is so large that the gain is dead-beat,
and both poles are 0, printed as 1e-10 to 1e-7. The zero of v_a^/omega is a11 itself; from it follow
the zeros of omega^/omega (at C with the other sign: a misprint) and, with the product of the two
printed poles, the gains, which are printed at z = 0 and mean nothing. k2 is read from the gain of
v_a^/M_m, so that one follows by itself. `ours` is the same filter on our plant, whose slopes of KQ
are exact."""


class Filter(NamedTuple):
    """The dead-beat predictor at one point."""

    poles: tuple[complex, complex]  # in z
    by_speed: float  # zero of omega^/omega
    velocity_by_speed: float  # zero of v_a^/omega
    gain: tuple[float, float]  # K


def predictor(a11: float, a12: float) -> Filter:
    """The thesis's filter of one point.

    Args:
        a11: slope of omega' to omega [1/s], taken for a transition.
        a12: of omega' to v_a [rad/(s m)].
    """
    a, c = np.array([[a11, a12], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    p = scipy.linalg.solve_discrete_are(a.T, c.T, np.diag(NOISES), np.eye(1))
    k = a @ p @ c.T / (c @ p @ c.T + 1.0)
    zeros = [
        control.ss(a - k @ c, k, np.eye(2)[[row]], [[0.0]], True).zeros().real[0]
        for row in range(2)
    ]
    first, second = np.linalg.eigvals(a - k @ c)
    return Filter(
        (complex(first), complex(second)), float(zeros[0]), float(zeros[1]),
        (float(k[0, 0]), float(k[1, 0])),
    )  # fmt: skip


def response(a11: float, a12: float, inertia: float) -> control.StateSpace:
    """The filter of one point, in z, from measured omega and M_m to estimated omega and v_a.

    Args:
        a11: as of :func:`predictor`.
        a12: the same.
        inertia: I_R [kg m2].
    """
    a, c = np.array([[a11, a12], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    k = np.array(predictor(a11, a12).gain)[:, None]
    inputs = np.hstack([k, [[1.0 / inertia], [0.0]]])
    return control.ss(a - k @ c, inputs, np.eye(2), np.zeros((2, 2)), True)


def behind(ship: Ship) -> float:
    """I_R [kg m2]."""
    return float(ship.record()["inertia_propeller_side"])


def slopes(ship: Ship, point: str) -> tuple[float, float]:
    """a11 and a12 of our plant at A to D."""
    inputs, record = published("advance_velocity_thesis_working_points").loc[point], ship.record()
    found = equilibrium(ship, float(inputs["fuel_rack_mm"]), float(inputs["pitch_ratio"]))
    by_speed, by_velocity = torque_slopes(
        record, found.outputs.advance_velocity, found.state.shaft_speed, found.outputs.pitch_ratio
    )
    engine = record["torque_per_speed"] * record["gear_ratio"] ** 2
    engine *= record["transmission_efficiency"]
    behind = float(record["inertia_propeller_side"])
    whole = behind + float(record["inertia_engine_side"])
    return float((engine - by_speed) / whole), float(-by_velocity / behind)


def number(text: object) -> float:
    r"""A printed number, such as ``-7.06 \\cdot 10^-2``."""
    return float(re.sub(r"\s*\\cdot\s*10\^", "e", str(text)))


def compared(ship: Ship) -> pd.DataFrame:
    """A row a point and table: zeros and gains as they follow, beside the printed.

    Args:
        ship: the thesis's frigate.
    """
    printed = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    printed = printed[printed["table"].isin(_TABLES)]
    printed = printed.set_index(["table", "working_point_or_source"])
    behind = float(ship.record()["inertia_propeller_side"])
    rows = []
    for point in "ABCD":
        told = {table: printed.loc[(table, point)] for table in _TABLES}
        product = float(np.prod([number(p) for p in told["3-11"]["poles_rad_s"].split(",")]))
        a11 = number(told["3-13"]["zeros_rad_s"])
        k2 = -number(told["3-14"]["dc_gain"]) * behind * product
        ours = predictor(*slopes(ship, point))
        follows = predictor(a11, 1.0 / k2)
        for table, transfer, zero, gain, own in (
            ("3-11", "omega^/omega", follows.by_speed, -a11 / product, ours.by_speed),
            ("3-12", "omega^/M_m", 1.0, -1.0 / behind / product, 1.0),
            ("3-13", "v_a^/omega", follows.velocity_by_speed, -k2 * a11 / product,
             ours.velocity_by_speed),
            ("3-14", "v_a^/M_m", np.nan, -k2 / behind / product, np.nan),
        ):  # fmt: skip
            cell = told[table]["zeros_rad_s"]
            rows.append(
                {"table": table, "transfer": transfer, "point": point, "zero follows": zero,
                 "zero printed": np.nan if pd.isna(cell) else number(cell), "zero ours": own,
                 "gain follows": gain, "gain printed": number(told[table]["dc_gain"])}
            )  # fmt: skip
    return pd.DataFrame(rows).sort_values("table", kind="stable", ignore_index=True)
