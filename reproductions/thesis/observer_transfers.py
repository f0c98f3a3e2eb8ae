"""Compute Tables 3-1 to 3-14: transfer functions of the observers of the thesis.

Luenberger and shaft Kalman observers (Tables 3-1 to 3-8): with a gain K = (k1, k2), k2 < 0, and
den(s) = s^2 + k1 s - k2 / I_R, eqs. 3-3 to 3-5 give

    omega^/omega = (k1 s - k2/I_R) / den      M_p^/omega = k2 s / den
    omega^/M_m   = (s/I_R) / den              M_p^/M_m   = (-k2/I_R) / den

so M_p^/omega and omega^/M_m have a zero at 0 exactly; for the first the thesis prints a rounding error.

Random-walk Kalman filter (Tables 3-11 to 3-14): the printed numbers are those of a discrete predictor
x+ = (A - K C) x + B u + K y, in z and not in s. The thesis takes the linear model's A = ((a11, a12),
(0, 1)) for a transition between samples, and Q = diag(1e4, 1e11) with R = 1 makes K dead-beat,
K = (1 + a11, 1 / a12). Both poles are then 0; the printed poles p1 and p2 are rounding errors. "Steady"
gains are printed at z = 0, divided by the product of the two, and so mean nothing:

    omega^/omega   zero 1 - 1 / (1 + a11)   gain -a11 / (p1 p2)
    omega^/M_m     zero 1                   gain -1 / (I_R p1 p2)
    v_a^/omega     zero a11                 gain -k2 a11 / (p1 p2)
    v_a^/M_m       no zero                  gain -k2 / (I_R p1 p2)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.core.lazy import control
from shaftline.observers import get_observer
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.linear import LinearObserver, shaft_model
from shaftline.observers.torque_curve import torque_slopes
from shaftline.plant import Ship

from ..side_by_side import published
from .poles import printed_line, working_point

OUTPUTS, INPUTS = ("omega", "M_p"), ("omega", "M_m")
LUENBERGER = ("luenberger-low", "luenberger-moderate", "luenberger-high")
KALMAN = "shaft-kalman"

PRINTED_GAINS = {
    "luenberger-high": (1.1e5, -1.4e13),
    "luenberger-moderate": (1.1e2, -1.4e7),
    "luenberger-low": (11.0, -1.4e5),
}
"""Gains K of section 3-1-3, to two digits."""

_ROUNDING = 1e-9
"""Zeros and gains below this, over the slowest pole and the gain to the torque, are 0."""


def _linear(name: str) -> LinearObserver:
    observer = get_observer(name)
    assert isinstance(observer, LinearObserver)
    return observer


def linear_observer(name: str, ship: Ship) -> control.StateSpace:
    """Return a linear observer, from measured omega and M_m to estimated omega and M_p."""
    observer = _linear(name)
    a, b, c = shaft_model(observer.inertia(ship))
    gain = observer.gain(ship)
    return control.ss(
        a - gain @ c,
        np.hstack([gain, b]),
        np.eye(2),
        np.zeros((2, 2)),
        inputs=[f"{name} measured" for name in INPUTS],
        outputs=[f"{name}^" for name in OUTPUTS],
    )


def gains(name: str, ship: Ship) -> tuple[float, float]:
    """Return the gain K of a linear observer, [1/s] and [N m/rad]."""
    k1, k2 = map(float, _linear(name).gain(ship)[:, 0])
    return k1, k2


def closed_form(
    k1: float, k2: float, inertia: float, output: str, source: str
) -> tuple[float, float]:
    """Return zero [rad/s], NaN where there is none, and steady gain of one of the four transfers.

    The gains act on the error of the shaft speed: k1 [1/s], and for the torque k2 [N m/rad]. ``inertia``
    is I_R [kg m2], ``output`` omega or M_p, ``source`` omega or M_m.
    """
    if output == "omega":
        return (k2 / inertia / k1, 1.0) if source == "omega" else (0.0, 0.0)
    return (0.0, 0.0) if source == "omega" else (np.nan, 1.0)


def linear_transfers(ship: Ship) -> pd.DataFrame:
    """Return Tables 3-1 to 3-8: printed, by the closed form, and of the observer itself."""
    rows = []
    for cell in published("advance_velocity_thesis_observer_transfers").reset_index().itertuples():
        inertia = _linear(cell.observer).inertia(ship)
        k1, k2 = gains(cell.observer, ship)
        system = linear_observer(cell.observer, ship)
        one = system[OUTPUTS.index(cell.output), INPUTS.index(cell.input)]
        slowest = float(np.abs(system.poles()).min())
        zero = next((z.real for z in map(complex, one.zeros()) if abs(z) < 1e6 * slowest), np.nan)
        size = abs(k1) * inertia if (cell.output, cell.input) == ("M_p", "omega") else 1.0
        gain = float(np.real(one.dcgain()))
        follows = closed_form(k1, k2, inertia, cell.output, cell.input)
        rows.append(
            {
                "table": cell.table,
                "observer": cell.observer,
                "transfer": f"{cell.output}^ / {cell.input}",
                "zero printed": cell.zero_rad_s,
                "zero follows": follows[0],
                "zero ours": 0.0 if abs(zero) < _ROUNDING * slowest else zero,
                "gain printed": cell.dc_gain,
                "gain follows": follows[1],
                "gain ours": 0.0 if abs(gain) < _ROUNDING * size else gain,
            }
        )
    return pd.DataFrame(rows)


def propeller_inertia(ship: Ship) -> float:
    """Return I_R [kg m2]."""
    return float(ship.record()["inertia_propeller_side"])


def _torque_slopes(ship: Ship, point: str) -> tuple[float, float]:
    """Return the slopes of M_p over omega and v_a at A to D."""
    found = working_point(ship, point)
    velocity, pitch = found.outputs.advance_velocity, found.outputs.pitch_ratio
    return torque_slopes(ship.record(), velocity, found.state.shaft_speed, pitch)


def immersion_invariance(
    ship: Ship, point: str, gamma: float, *, as_printed: bool
) -> control.StateSpace:
    """Return I&I linear about A to D, from measured omega and M_m to v_a^ (eq. 3-13), by gamma [m/rad].

    ``as_printed`` leaves out the dependence of M_p on the estimate, as Tables 3-9 and 3-10 do; the
    observer converges by this dependence.
    """
    by_speed, by_velocity = _torque_slopes(ship, point)
    own, rate = 0.0 if as_printed else by_velocity, gamma / propeller_inertia(ship)
    return control.ss(
        [[rate * own]],
        [[rate * (by_speed + own * gamma), -rate]],
        [[1.0]],
        [[gamma, 0.0]],
        inputs=["omega measured", "M_m measured"],
        outputs=["v_a^"],
    )


def invariance_transfers(ship: Ship) -> pd.DataFrame:
    """Return Table 3-10: pole of v_a^/M_m, printed and of the observer itself; it has no zero."""
    rows = []
    for point in "AD":
        for tuning in ("low", "high"):
            gamma = ImmersionInvariance.tunings[tuning].gain
            printed, own = (
                immersion_invariance(ship, point, gamma, as_printed=choice)[0, 1].poles().real[0]
                for choice in (True, False)
            )
            rows.append(
                {
                    "table": "3-10",
                    "point": point,
                    "gamma": gamma,
                    "pole printed": 0.0,
                    "pole as eq. 3-13 is printed": printed,
                    "pole of the observer": own,
                }
            )
    return pd.DataFrame(rows)


NOISES = (1e4, 1e11)  # Q of omega and v_a, where R is 1
_TABLES = ("3-11", "3-12", "3-13", "3-14")


class Filter(NamedTuple):
    """The dead-beat predictor at one point."""

    poles: tuple[complex, complex]  # in z
    by_speed: float  # zero of omega^/omega
    velocity_by_speed: float  # zero of v_a^/omega
    gain: tuple[float, float]  # K


def predictor(a11: float, a12: float) -> Filter:
    """Return the random-walk Kalman filter of the thesis at one point.

    ``a11`` is the slope of omega' over omega [1/s], used as an element of the transition matrix, ``a12``
    that over v_a [rad/(s m)].
    """
    a, c = np.array([[a11, a12], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    p = scipy.linalg.solve_discrete_are(a.T, c.T, np.diag(NOISES), np.eye(1))
    k = a @ p @ c.T / (c @ p @ c.T + 1.0)
    zeros = [
        float(control.ss(a - k @ c, k, np.eye(2)[[row]], [[0.0]], True).zeros().real[0])
        for row in range(2)
    ]
    first, second = map(complex, np.linalg.eigvals(a - k @ c))
    return Filter((first, second), zeros[0], zeros[1], (float(k[0, 0]), float(k[1, 0])))


def random_walk_response(a11: float, a12: float, inertia: float) -> control.StateSpace:
    """Return the filter of :func:`predictor` in z, from omega and M_m to estimated omega and v_a.

    ``inertia`` is I_R [kg m2].
    """
    a, c = np.array([[a11, a12], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    k = np.array(predictor(a11, a12).gain)[:, None]
    inputs = np.hstack([k, [[1.0 / inertia], [0.0]]])
    return control.ss(a - k @ c, inputs, np.eye(2), np.zeros((2, 2)), True)


def plant_slopes(ship: Ship, point: str) -> tuple[float, float]:
    """Return a11 and a12 of our plant at A to D."""
    record, inertia = ship.record(), propeller_inertia(ship)
    by_speed, by_velocity = _torque_slopes(ship, point)
    engine = record["torque_per_speed"] * record["gear_ratio"] ** 2
    engine *= record["transmission_efficiency"]
    whole = inertia + float(record["inertia_engine_side"])
    return float((engine - by_speed) / whole), float(-by_velocity / inertia)


def random_walk_transfers(ship: Ship) -> pd.DataFrame:
    """Return the calculated zeros and gains beside the printed ones, by point and table."""
    inertia, rows = propeller_inertia(ship), []
    for point in "ABCD":
        printed = {table: printed_line(table, point) for table in _TABLES}
        product = float(np.prod(printed["3-11"].poles))
        (a11,) = printed["3-13"].zeros
        k2 = -printed["3-14"].gain * inertia * product
        ours, follows = predictor(*plant_slopes(ship, point)), predictor(a11, 1.0 / k2)
        for table, transfer, zero, gain, own in (
            ("3-11", "omega^/omega", follows.by_speed, -a11 / product, ours.by_speed),
            ("3-12", "omega^/M_m", 1.0, -1.0 / inertia / product, 1.0),
            (
                "3-13",
                "v_a^/omega",
                follows.velocity_by_speed,
                -k2 * a11 / product,
                ours.velocity_by_speed,
            ),
            ("3-14", "v_a^/M_m", np.nan, -k2 / inertia / product, np.nan),
        ):
            line = printed[table]
            rows.append(
                {
                    "table": table,
                    "transfer": transfer,
                    "point": point,
                    "zero follows": zero,
                    "zero printed": line.zeros[0] if line.zeros else np.nan,
                    "zero ours": own,
                    "gain follows": gain,
                    "gain printed": line.gain,
                }
            )
    return pd.DataFrame(rows).sort_values("table", kind="stable", ignore_index=True)
