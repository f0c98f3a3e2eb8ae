"""Fit propellers to the pitches and speeds of the CPP optimiser paper's Tables 1 to 3.

At the printed engine and ship speeds, diameter, gear ratio, wake fraction, thrust deduction and size of
the resistance act through two numbers only: J = advance (v / v_r) / (n / n_r) and
KT = load (R / R_r) / (n / n_r)^2. Each propeller of the B-series has its own best pair. Full power at
13 kn then gives the diameter. So a search over blades, expanded area ratio, exponent of the resistance
and rise of the resistance, with two fitted numbers and the zero of the pitch, covers every ferry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from shaftline.plant import Ship
from shaftline.plant.open_water import b_series, open_water

from . import experiment
from .experiment import COMBINATOR, CORRECTED, HELD, TOP_SPEED_M_S, printed_levers

Floats = NDArray[np.float64]

REFERENCE_RPM, REFERENCE_SPEED = 1700.0, 6.0  # of the engine, and of the ship [m/s]
TOP_RPM, TOP_POWER = 2200.0, 1e5  # published: 100 kW [W] at 2200 rpm
STATES = ("before", "Table 1", "Table 2", "Table 3")
BEFORE, PLAIN, AT_HELD, AT_EQUAL = range(4)
"""Rows of the printed states: before the disturbance, and after it in Tables 1, 2 and 3."""

STATED, BY_TABLE_2 = "15 %", "by Table 2"
"""Rules of the rise of the resistance: the 15 % of the text, or what Table 2's held thrust asks for."""

_STEP = 1e-5  # of the central differences
_PITCHES = 0.2, 2.2  # range of P/D in which the inversion searches
_ITERATIONS = 40


class Prints(NamedTuple):
    """The printed states, shape (4, 5): :data:`STATES` by lever."""

    engine: Floats  # [rpm]
    ship_speed: Floats  # [m/s]
    pitch: Floats  # [deg]
    consumption: Floats  # [g/kWh]


def read_prints() -> Prints:
    """Return the printed states; before the disturbance the mean of the three tables."""
    tables = [printed_levers(control) for control in (COMBINATOR, HELD, CORRECTED)]
    found = []
    for name in ("engine_speed_rpm", "ship_speed_m_s", "pitch_deg", "sfoc_g_kwh"):
        before = [table[f"{name}_before"].to_numpy(dtype=float) for table in tables]
        after = [table[f"{name}_after"].to_numpy(dtype=float) for table in tables]
        # Tables 2 and 3 print the same states before; each state counts once.
        found.append(np.stack([0.5 * (before[0] + before[1]), *after]))
    return Prints(*found)


class Propellers(NamedTuple):
    """A batch of n propellers of the B-series."""

    blades: NDArray[np.int64]
    area_ratio: Floats
    thrust: Floats  # coefficients of KT, shape (5, 4, n, 1, 1)
    torque: Floats  # coefficients of KQ


def make_propellers(kinds: Sequence[tuple[int, float]]) -> Propellers:
    """Return the propellers of (blades, expanded area ratio)."""
    curves = [np.stack([b_series(name, a, z) for z, a in kinds], -1) for name in ("KT", "KQ")]
    blades, areas = zip(*kinds, strict=True)
    shaped = [curve[..., None, None] for curve in curves]
    return Propellers(np.array(blades), np.array(areas), shaped[0], shaped[1])


class Groups(NamedTuple):
    """The numbers of a ferry on which the printed states depend, one for each of n propellers."""

    advance: Floats  # J at the reference speeds, shape (n,)
    load: Floats  # KT there in calm water
    exponent: Floats  # of the resistance
    rise: Floats  # resistance after the disturbance over that before it, shape (n, 5)


def groups_of(ship: Ship, rise: Floats) -> Groups:
    """Return the groups of a ship; ``rise`` is the resistance after the disturbance, shape (1, 5)."""
    hull, diameter = ship.hull, ship.propeller.diameter_m
    turns = REFERENCE_RPM / 60.0 / ship.transmission.gear_ratio
    drag = hull.resistance_coefficient_N_s2_m2 * REFERENCE_SPEED**2
    exponent = hull.resistance_exponent
    drag *= (REFERENCE_SPEED / hull.resistance_reference_speed_m_s) ** (exponent - 2.0)
    thrust = drag / (1.0 - hull.thrust_deduction)
    advance = (1.0 - hull.wake_fraction) * REFERENCE_SPEED / (turns * diameter)
    load = thrust / (ship.water.density_kg_m3 * turns**2 * diameter**4)
    return Groups(np.array([advance]), np.array([load]), np.array([exponent]), rise)


def _wide(values: Floats) -> Floats:
    return np.asarray(values, dtype=float)[:, None, None]


def _resistance(groups: Groups, speed: Floats, raised: Floats) -> Floats:
    """Return the resistance over that at the reference speed; ``raised`` is 0 in calm water, else 1."""
    size = (speed / REFERENCE_SPEED) ** _wide(groups.exponent)
    return np.asarray(size * groups.rise[:, None, :] ** raised)


_RAISED = np.array([0.0, 1.0, 1.0, 1.0])[:, None]


def coefficients(
    groups: Groups, engine: Floats, speed: Floats, raised: Floats = _RAISED
) -> tuple[Floats, Floats]:
    """Return J and KT at engine speeds [rpm] and ship speeds [m/s], shape (n, states, 5)."""
    turns = engine / REFERENCE_RPM
    advance = _wide(groups.advance) * speed / REFERENCE_SPEED / turns
    return advance, _wide(groups.load) * _resistance(groups, speed, raised) / turns**2


def pitch_ratios(propellers: Propellers, advance: Floats, thrust: Floats) -> Floats:
    """Return the P/D at which the propellers have a KT at a J, by Newton steps."""
    pitch = np.full(np.broadcast(advance, thrust).shape, 0.8)
    for _ in range(_ITERATIONS):
        ends = [open_water(propellers.thrust, advance, pitch + s) for s in (_STEP, -_STEP)]
        slope = (ends[0] - ends[1]) / (2.0 * _STEP)
        excess = 0.5 * (ends[0] + ends[1]) - thrust
        step = np.clip(excess / np.maximum(slope, 1e-3), -0.2, 0.2)
        pitch = np.clip(pitch - step, *_PITCHES)
        if float(np.abs(step).max()) < 1e-10:
            break
    return pitch


def angles(pitch: Floats) -> Floats:
    """Return the angles of the blade section at 0.7 R [deg]."""
    return np.degrees(np.arctan(pitch / (0.7 * math.pi)))


def printed_angles(propellers: Propellers, groups: Groups, prints: Prints) -> Floats:
    """Return the angles [deg] at the printed engine and ship speeds, shape (n, 4, 5)."""
    at = coefficients(groups, prints.engine, prints.ship_speed)
    return angles(pitch_ratios(propellers, *at))


def rises(rule: str, exponent: Floats, prints: Prints) -> Floats:
    """Return the rise of the resistance by a rule, shape (n, 5)."""
    lost = prints.ship_speed[BEFORE] / prints.ship_speed[AT_HELD]
    by_table = lost ** np.asarray(exponent, dtype=float)[:, None]
    return by_table if rule == BY_TABLE_2 else np.full_like(by_table, experiment.RISE)


def fit_groups(
    propellers: Propellers, exponent: Floats, rule: str, prints: Prints, weights: Floats
) -> tuple[Groups, Floats]:
    """Fit advance and load of each propeller to the printed pitches, by damped Gauss-Newton steps.

    ``weights`` has the weight of each state, shape (n, 4, 5); 0 leaves it out. The zero of the pitch is
    the weighted mean of the differences.

    Returns:
        The groups, and the zeros of the pitch [deg], shape (n,).
    """
    rise = rises(rule, exponent, prints)
    share = weights / weights.sum(axis=(1, 2), keepdims=True)

    def difference(logs: Floats) -> tuple[Floats, Floats]:
        groups = Groups(np.exp(logs[0]), np.exp(logs[1]), exponent, rise)
        off = printed_angles(propellers, groups, prints) - prints.pitch
        zero = (share * off).sum(axis=(1, 2))
        return (off - zero[:, None, None]) * np.sqrt(share), zero

    # The best J and KT rise with the exponent (first search on a coarse grid).
    logs = np.stack([-0.62 + 0.3 * (exponent - 2.5), -1.77 + 0.05 * (exponent - 2.5)])
    for _ in range(30):
        here, zero = difference(logs)
        slopes = []
        for k in range(2):
            nudged = logs.copy()
            nudged[k] += _STEP
            slopes.append((difference(nudged)[0] - here) / _STEP)
        normal = np.array([[(a * b).sum(axis=(1, 2)) for a in slopes] for b in slopes])
        normal[0, 0] *= 1.0 + 1e-6
        normal[1, 1] *= 1.0 + 1e-6
        aim = np.array([(a * here).sum(axis=(1, 2)) for a in slopes])
        step = np.linalg.solve(np.moveaxis(normal, -1, 0), aim.T[..., None])[..., 0].T
        step = np.clip(step, -0.1, 0.1)
        logs = logs - step
        if float(np.abs(step).max()) < 1e-7:
            break
    _, zero = difference(logs)
    return Groups(np.exp(logs[0]), np.exp(logs[1]), exponent, rise), zero


def speeds_at_held_pitch(propellers: Propellers, groups: Groups, prints: Prints) -> Floats:
    """Return the ship speeds after the disturbance of Table 1 [m/s], shape (n, 5).

    Engine speed and pitch are held; the pitch is that at the printed speed before the disturbance.
    """
    one, calm = np.ones((1, 1)), np.zeros((1, 1))
    engine, speed = prints.engine[[BEFORE]], prints.ship_speed[[BEFORE]]
    pitch = pitch_ratios(propellers, *coefficients(groups, engine, speed, calm))

    def missing(at: Floats) -> Floats:
        advance, asked = coefficients(groups, engine, at, one)
        return np.asarray(open_water(propellers.thrust, advance, pitch) - asked)

    found = np.broadcast_to(speed, pitch.shape).copy()
    for _ in range(_ITERATIONS):
        slope = (missing(found + _STEP) - missing(found - _STEP)) / (2.0 * _STEP)
        step = np.clip(missing(found) / slope, -0.2, 0.2)
        found = found - step
        if float(np.abs(step).max()) < 1e-10:
            break
    return found[:, 0, :]


def speeds_at_held_thrust(groups: Groups, prints: Prints) -> Floats:
    """Return the ship speeds after the disturbance of Table 2 [m/s], shape (n, 5)."""
    return np.asarray(prints.ship_speed[BEFORE] * groups.rise ** (-1.0 / groups.exponent[:, None]))


def powers(
    propellers: Propellers, groups: Groups, engine: Floats, speed: Floats, raised: Floats = _RAISED
) -> Floats:
    """Return the brake powers over the rated one, by which 100 kW drive the ship at 13 kn."""

    def relative(at_engine: Floats, at_speed: Floats, after: Floats) -> Floats:
        advance, thrust = coefficients(groups, at_engine, at_speed, after)
        pitch = pitch_ratios(propellers, advance, thrust)
        torque = np.asarray(open_water(propellers.torque, advance, pitch))
        return torque * (at_engine / REFERENCE_RPM) ** 3

    top = relative(np.array([[TOP_RPM]]), np.array([[TOP_SPEED_M_S]]), np.zeros((1, 1)))
    return relative(engine, speed, raised) / top[:, :, :1]


class Particulars(NamedTuple):
    """The assumed parameters of a ferry that has given groups."""

    diameter: float  # [m]
    gear_ratio: float
    resistance_coefficient: float  # at the reference speed [N s2/m2]
    pitch_ratio: float  # at full power
    efficiency: float  # of the propeller there


def particulars(propellers: Propellers, groups: Groups, ship: Ship, index: int = 0) -> Particulars:
    """Return diameter, gear and resistance with which 100 kW drive the ship at 13 kn.

    Density, wake fraction, thrust deduction and efficiency of the transmission are the ship's.
    """
    one = Groups(*(np.asarray(value)[[index]] for value in groups))
    curves = Propellers(
        propellers.blades[[index]],
        propellers.area_ratio[[index]],
        propellers.thrust[:, :, [index]],
        propellers.torque[:, :, [index]],
    )
    engine, speed = np.array([[TOP_RPM]]), np.array([[TOP_SPEED_M_S]])
    advance, thrust = coefficients(one, engine, speed, np.zeros((1, 1)))
    pitch = pitch_ratios(curves, advance, thrust)
    torque = float(np.ravel(open_water(curves.torque, advance, pitch))[0])
    j, kt = float(advance[0, 0, 0]), float(thrust[0, 0, 0])
    inflow = (1.0 - ship.hull.wake_fraction) * TOP_SPEED_M_S
    # Q n = P, n = v_a / (J D):  P = 2 pi rho KQ (v_a / J)^3 D^2
    power = TOP_POWER * ship.transmission.efficiency
    density = ship.water.density_kg_m3
    diameter = math.sqrt(power / (2.0 * math.pi * density * torque * (inflow / j) ** 3))
    turns = inflow / (j * diameter)  # 1/s
    push = density * kt * turns**2 * diameter**4 * (1.0 - ship.hull.thrust_deduction)
    exponent = float(one.exponent[0])
    size = (TOP_SPEED_M_S / REFERENCE_SPEED) ** (exponent - 2.0)
    return Particulars(
        diameter,
        TOP_RPM / 60.0 / turns,
        push / TOP_SPEED_M_S**2 / size,
        float(pitch[0, 0, 0]),
        j * kt / (2.0 * math.pi * torque),
    )


CALIBRATED_LEVER = 3
"""The lever whose speeds after the disturbance calibrate the ship; the other four are predicted."""


def exponent_of_lever(prints: Prints, lever: int = CALIBRATED_LEVER) -> float:
    """Return the exponent at which the rise of 15 % slows the ship as Table 2 prints at a lever."""
    lost = prints.ship_speed[BEFORE] / prints.ship_speed[AT_HELD]
    return math.log(experiment.RISE) / math.log(float(lost[lever - 1]))


def calibrate(propellers: Propellers, prints: Prints, lever: int = CALIBRATED_LEVER) -> Groups:
    """Fit one propeller to the pitches before the disturbance and to the speeds of one lever after it.

    The rise of the resistance is the 15 % of the text, the exponent that of :func:`exponent_of_lever`.
    Six numbers fix three: the fall of the pitch over the levers and one speed of Table 1 advance and
    load, one speed of Table 2 the exponent. All other states after the disturbance are predicted.
    """
    exponent = np.array([exponent_of_lever(prints, lever)])
    rise = rises(STATED, exponent, prints)

    def groups(logs: Any) -> Groups:
        return Groups(np.exp(logs[[0]]), np.exp(logs[[1]]), exponent, rise)

    def difference(logs: Any) -> Floats:
        own = groups(logs)
        off = (printed_angles(propellers, own, prints) - prints.pitch)[0, BEFORE]
        speed = speeds_at_held_pitch(propellers, own, prints)[0, lever - 1]
        lost = speed - prints.ship_speed[PLAIN, lever - 1]
        return np.append((off - off.mean()) / 0.05, lost / 0.005)

    found = scipy.optimize.least_squares(difference, [-0.57, -1.77], x_scale=[0.1, 0.1])
    return groups(found.x)
