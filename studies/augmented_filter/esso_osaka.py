"""The tanker Esso Osaka in a zig-zag, filter and truth sharing a linear model: Taylor 2000, section 2.3.

Without dimensions: lengths by L, speeds by U, time by L / U, forces by rho L^2 U^2 / 2. The thesis
prints the four coefficients that are sought (Table 2.3), main dimensions and the rudder (Table 2.2); its
draught, 92.8 ft, is the ship's depth (the block coefficient would be 0.64), so 71.3 ft stands here. What
it does not print is assumed: added masses after Clarke, Gedling & Hine (1983), a rudder half a length
behind midship, 7 kn, a rudder that follows at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...observers import AugmentedFilter

LENGTH, BEAM, DRAUGHT = 325.0, 173.9 * 0.3048, 71.3 * 0.3048  # m
DENSITY, KNOT = 1025.0, 0.5144
MASS = 314_410.0 * 1016.047  # kg
CENTRE = -25.0 * 0.3048 / LENGTH  # of gravity, from midship, in lengths; printed: aft
SPEED = 7.0 * KNOT  # m/s; assumed
RUDDER_AREA, ASPECT = 119.8 / LENGTH**2, 1.538
RUDDER_PLACE = -0.5  # assumed
RUDDER_DRAG = 0.0085
LIFT_SLOPE = 1.0 / (
    1.0 / (1.8 * math.pi) + 1.0 / (math.pi * ASPECT) + 1.0 / (2.0 * math.pi * ASPECT**2)
)
"""Per rad (eq. 3.28, with 1.8 for the misprinted 0.18)."""

COEFFICIENTS = {"-Yv": 0.0244, "m-Yr": 0.0138, "-Nv": 1.4578e-3, "m xg-Nr": 8.093e-4}
"""Table 2.3; all positive: Y = -(-Yv) v - (m - Yr) r, where eq. 4.1 has another sign."""

TRUE = np.array([*COEFFICIENTS.values()])

SECONDS_PER_LENGTH = LENGTH / SPEED
UPDATE_S = 1.0
ZIG_ZAG = math.radians(10.0)


def _inertia() -> NDArray[np.float64]:
    """Matrix of the accelerations of sway and yaw."""
    mass = MASS / (0.5 * DENSITY * LENGTH**3)
    block = MASS / (DENSITY * LENGTH * BEAM * DRAUGHT)
    length, draught, factor = BEAM / LENGTH, BEAM / DRAUGHT, math.pi * (DRAUGHT / LENGTH) ** 2
    sway = factor * (1.0 + 0.16 * block * draught - 5.1 * length**2)
    sway_yaw = factor * (0.67 * length - 0.0033 * draught**2)
    yaw_sway = factor * (1.1 * length - 0.041 * draught)
    yaw = factor * (1.0 / 12.0 + 0.017 * block * draught - 0.33 * length)
    turning = mass * (0.25**2 + CENTRE**2)
    return np.array(
        [[mass + sway, mass * CENTRE + sway_yaw], [mass * CENTRE + yaw_sway, turning + yaw]]
    )


INVERSE = np.linalg.inv(_inertia())


def rudder_force(u: Any, v: Any, r: Any, angle: float) -> Any:
    """Side force of the rudder (eqs. 3.25 to 3.33); positive angles turn to starboard.

    Args:
        u: speed ahead.
        v: to starboard.
        r: rate of turn to starboard.
        angle: of the rudder [rad].
    """
    across = v + RUDDER_PLACE * r
    drift = np.arctan(across / u)
    dynamic = 0.5 * 2.0 * RUDDER_AREA * (u * u + across * across)
    lift, drag = dynamic * LIFT_SLOPE * (angle + drift), dynamic * RUDDER_DRAG
    return -(lift * np.cos(drift) + drag * np.sin(drift))


def rate(x: Any, theta: Any, angle: float) -> Any:
    """Rates of (u, v, r, n) per length sailed; speed ahead and revolutions are held."""
    u, v, r, _ = x
    side = rudder_force(u, v, r, angle)
    force = -theta[0] * v - theta[1] * r + side
    moment = -theta[2] * v - theta[3] * r + RUDDER_PLACE * side
    dv, dr = INVERSE @ np.array([force, moment])
    return np.array([0.0 * u, dv, dr, 0.0 * u])


def measured(x: Any, theta: Any, angle: float) -> Any:
    """All four are."""
    return x


def sailed(
    theta: Any, seconds: float, rudder: Callable[[float, float], float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A voyage from straight sailing.

    Args:
        theta: the four coefficients.
        seconds: of the full-scale ship.
        rudder: next angle [rad] from the heading [rad] and the last angle.

    Returns:
        States (u, v, r, n) at every update, shape (k + 1, 4), and rudder angles over each interval,
        shape (k,).
    """
    ship = AugmentedFilter(
        rate, measured, [1.0, 0.0, 0.0, 1.0], theta, covariance=np.zeros(8), noise=np.ones(4)
    )
    step, heading, angle = UPDATE_S / SECONDS_PER_LENGTH, 0.0, 0.0
    states, angles = [ship.state], []
    for _ in range(round(seconds / UPDATE_S)):
        angle = rudder(heading, angle)
        before = ship.state[2]
        ship.predict(angle, step)
        heading += 0.5 * step * (before + ship.state[2])
        states.append(ship.state)
        angles.append(angle)
    return np.array(states), np.array(angles)


def zig_zag(heading: float, angle: float) -> float:
    """10/10: the rudder is laid over where the heading has followed it by 10 degrees."""
    if angle == 0.0 or (angle > 0.0 and heading > ZIG_ZAG):
        return ZIG_ZAG if angle == 0.0 else -ZIG_ZAG
    return ZIG_ZAG if angle < 0.0 and heading < -ZIG_ZAG else angle


def identified(variance: float, noise: float, seconds: float, seed: int) -> pd.DataFrame:
    """The four coefficients as the filter finds them along the zig-zag.

    It begins at half the truth, as unsure as that is large; no process noise.

    Args:
        variance: R of all four measurements, as the filter has it.
        noise: rms of what is in fact added to them.
        seconds: of the voyage.
        seed: of that noise.

    Returns:
        A row an update: ``time_s`` and each coefficient over the truth.
    """
    states, angles = sailed(TRUE, seconds, zig_zag)
    rng = np.random.default_rng(seed)
    own = AugmentedFilter(
        rate, measured, [1.0, 0.0, 0.0, 1.0], 0.5 * TRUE,
        covariance=[*([1e-6] * 4), *TRUE**2], noise=[variance] * 4,
    )  # fmt: skip
    rows = []
    for k, angle in enumerate(angles):
        own.predict(angle, UPDATE_S / SECONDS_PER_LENGTH)
        own.update(states[k + 1] + noise * rng.standard_normal(4), angle)
        rows.append([UPDATE_S * (k + 1), *own.numbers / TRUE])
    return pd.DataFrame(rows, columns=["time_s", *COEFFICIENTS])


def steady_turn(theta: Any, angle_deg: float = 10.0) -> tuple[float, float, float]:
    """Sway speed, rate of turn and diameter in lengths of a steady turn.

    Args:
        theta: the four coefficients.
        angle_deg: of the rudder.
    """
    states, _ = sailed(theta, 60.0 * SECONDS_PER_LENGTH, lambda *_: math.radians(angle_deg))
    _, v, r, _ = states[-1]
    return float(v), float(r), float(2.0 * math.hypot(1.0, v) / r)
