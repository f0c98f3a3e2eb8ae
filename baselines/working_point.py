"""Working points of propeller and engine for the CPP optimiser, with fitted open-water surfaces.

Section 2.1 of the CPP optimiser paper: the open-water curves of a controllable-pitch propeller are
polynomial surfaces K(J; p) = J' A p. Each coefficient of the usual polynomial in the advance ratio J is
a polynomial in the pitch ratio p = P/D. The surfaces are fitted to the curves of the plant, so the
optimiser uses one smooth function for every propeller model.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import torque_limit
from ..plant.emissions import nox_rate
from ..plant.fuel import fuel_rate
from ..plant.open_water import REVOLUTIONS_PER_RADIAN, advance_ratio
from ..plant.propeller import propeller_load
from ..plant.shaft import brake_torque_of, load_torque
from ..plant.ship import Ship, ShipError
from .combinator import TORQUE_MARGIN


class WorkingPoint(NamedTuple):
    """Working point of one propeller and its engine, from the fitted surfaces."""

    thrust: float  # [N]
    torque_share: float  # brake torque / torque limit [-]
    cost: float  # fuel [kg/s], or brake power [W] without a fuel model, of one engine
    efficiency_slope: float  # d eta_o / d J [-]
    burrill: float  # tau_c / tau_limit [-]
    advance_room: float  # J_max(p) - J [-]
    nox: float = 0.0  # NOx of one engine [g/s]; 0 without a NOx map


@compiled
def working_point(
    plant: Record,
    thrust: Floats,
    torque: Floats,
    advance_velocity: float,
    shaft_speed: float,
    pitch_ratio: float,
    torque_factor: float = 1.0,
) -> WorkingPoint:
    """Return thrust, engine load, cost and margins of one working point.

    A and B are the matrices of the fits of KT and KQ; v_a is in m/s, omega in rad/s, and
    ``torque_factor`` the propeller torque over that of the fits [-].
    """
    j = advance_ratio(advance_velocity, shaft_speed, plant.diameter)
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    kt, kq = surface(thrust, j, pitch_ratio), surface(torque, j, pitch_ratio)
    force = plant.density * plant.diameter**4 * n * n
    load = torque_factor * kq * force * plant.diameter / plant.relative_rotative_efficiency
    brake = brake_torque_of(plant, load_torque(plant, load, shaft_speed), shaft_speed)
    engine_speed = plant.gear_ratio * shaft_speed
    cost = fuel_rate(plant, engine_speed, brake)
    if plant.fuel_base <= 0.0:
        cost = brake * engine_speed
    kt_slope = surface_slope(thrust, j, pitch_ratio)
    kq_slope = surface_slope(torque, j, pitch_ratio)
    slope = REVOLUTIONS_PER_RADIAN * ((kt + j * kt_slope) * kq - j * kt * kq_slope) / (kq * kq)
    margin = burrill_ratio(
        plant, kt * force, advance_velocity, shaft_speed, pitch_ratio, plant.depth
    )
    share = brake / torque_limit(plant, engine_speed)
    room = highest_j(pitch_ratio) - j
    nox = nox_rate(plant, engine_speed, brake)
    return WorkingPoint(kt * force, share, cost, slope, margin, room, nox)


_TRIMS = 6  # Newton steps of the shaft speed at a given thrust
_LONGEST_TRIM = 0.1  # longest of them, in the logarithm of the shaft speed [-]


@compiled
def speed_of_thrust(
    plant: Record,
    matrix: Floats,
    thrust: float,
    advance_velocity: float,
    shaft_speed: float,
    pitch_ratio: float,
) -> float:
    """Return the shaft speed [rad/s] at which the fitted surface gives a thrust above 0 [N].

    The search starts at ``shaft_speed`` [rad/s] and takes Newton steps in the logarithms.
    """
    omega = shaft_speed
    force = plant.density * plant.diameter**4 * REVOLUTIONS_PER_RADIAN**2
    for _ in range(_TRIMS):
        j = advance_ratio(advance_velocity, omega, plant.diameter)
        kt = surface(matrix, j, pitch_ratio)
        step = _LONGEST_TRIM
        if kt > 0.0:
            growth = max(2.0 - j * surface_slope(matrix, j, pitch_ratio) / kt, 1.0)
            step = math.log(thrust / (force * omega * omega * kt)) / growth
        omega *= math.exp(min(max(step, -_LONGEST_TRIM), _LONGEST_TRIM))
    return omega


@compiled
def robust_point(
    plant: Record,
    thrust: Floats,
    torque: Floats,
    advance_velocity: float,
    shaft_speed: float,
    pitch_ratio: float,
    cases: Floats,
    expected: bool,
) -> WorkingPoint:
    """Return a working point whose costs and engine load are those of uncertain cases.

    A case (factor on the torque, factor on v_a, weight) is a row of ``cases``; without rows this is
    :func:`working_point`. Fuel and NOx of a case are those at the nominal thrust: with another v_a the
    shaft speed is corrected for the thrust, at the same pitch. Its engine load is that without this
    correction, because an optimiser that does not know v_a keeps the shaft speed. ``expected`` takes the
    weighted means of fuel and NOx and the nominal engine load; otherwise each of the three is the
    largest of the nominal point and the cases. Thrust and other margins are nominal.
    """
    w = working_point(plant, thrust, torque, advance_velocity, shaft_speed, pitch_ratio)
    if len(cases) == 0:
        return w
    share, cost, nox = w.torque_share, w.cost, w.nox
    mean_cost, mean_nox = 0.0, 0.0
    for k in range(len(cases)):
        factor, velocity = cases[k, 0], cases[k, 1] * advance_velocity
        c = working_point(plant, thrust, torque, velocity, shaft_speed, pitch_ratio, factor)
        share = max(share, c.torque_share)
        if w.thrust > 0.0 and velocity != advance_velocity:
            speed = speed_of_thrust(plant, thrust, w.thrust, velocity, shaft_speed, pitch_ratio)
            c = working_point(plant, thrust, torque, velocity, speed, pitch_ratio, factor)
        mean_cost += cases[k, 2] * c.cost
        mean_nox += cases[k, 2] * c.nox
        cost, nox = max(cost, c.cost), max(nox, c.nox)
    if expected:
        share, cost, nox = w.torque_share, mean_cost, mean_nox
    return WorkingPoint(w.thrust, share, cost, w.efficiency_slope, w.burrill, w.advance_room, nox)


@compiled
def slack(w: WorkingPoint, torque_share: float = TORQUE_MARGIN) -> float:
    """Return the margin to the nearest inequality constraint, negative if one is violated.

    ``torque_share`` is the highest allowed brake torque over the torque limit [-].
    """
    engine, cavitation = torque_share - w.torque_share, 1.0 - w.burrill
    return min(min(engine, cavitation), min(w.efficiency_slope, w.advance_room))


@compiled
def search(
    plant: Record,
    thrust: Floats,
    torque: Floats,
    advance_velocity: float,
    shaft_speeds: Floats,
    pitch_ratios: Floats,
    torque_share: float,
    cases: Floats,
    expected: bool,
    found: Floats,
) -> int:
    """Fill rows (omega, p, thrust, cost) with the allowed settings of a grid; return their number.

    The working points are those of :func:`robust_point`.
    """
    count = 0
    for shaft_speed in shaft_speeds:
        for pitch_ratio in pitch_ratios:
            w = robust_point(
                plant,
                thrust,
                torque,
                advance_velocity,
                shaft_speed,
                pitch_ratio,
                cases,
                expected,
            )
            if w.thrust > 0.0 and slack(w, torque_share) >= 0.0:
                found[count, 0], found[count, 1] = shaft_speed, pitch_ratio
                found[count, 2], found[count, 3] = w.thrust, w.cost
                count += 1
    return count


J_DEGREE, PITCH_DEGREE = 4, 5
LARGEST_ERROR = 0.004  # of the fit over the largest value of the curve [-], as in the paper
_GRID = (41, 25)  # advance ratios and pitch ratios


@compiled
def highest_j(pitch_ratio: float) -> float:
    """Return J_max(p), the end of the working range, slightly above J = P/D where the thrust is 0."""
    return 1.05 * pitch_ratio + 0.15


class OpenWaterFit(NamedTuple):
    """Polynomial surfaces of a propeller; entry [i, j] multiplies J^i p^j."""

    thrust: Floats  # A, shape (5, 6)
    torque: Floats  # B, shape (5, 6)
    thrust_error: float  # largest error over largest KT of the working range [-]
    torque_error: float  # largest error over largest KQ of the working range [-]


@compiled
def surface(matrix: Floats, advance_ratio: float, pitch_ratio: float) -> float:
    """Return K(J; p) [-] of one matrix, by Horner's rule in J and p."""
    value = 0.0
    for i in range(matrix.shape[0] - 1, -1, -1):
        row = 0.0
        for j in range(matrix.shape[1] - 1, -1, -1):
            row = row * pitch_ratio + matrix[i, j]
        value = value * advance_ratio + row
    return value


@compiled
def surface_slope(matrix: Floats, advance_ratio: float, pitch_ratio: float) -> float:
    """Return dK / dJ [-] of one matrix."""
    value = 0.0
    for i in range(matrix.shape[0] - 1, 0, -1):
        row = 0.0
        for j in range(matrix.shape[1] - 1, -1, -1):
            row = row * pitch_ratio + matrix[i, j]
        value = value * advance_ratio + i * row
    return value


def fit_open_water(ship: Ship) -> OpenWaterFit:
    """Fit the open-water surfaces by least squares, for 0 <= J up to zero thrust and all pitches.

    Raises:
        ShipError: the pitch is fixed, or an error of the fit exceeds :data:`LARGEST_ERROR`.

    Example:
        >>> from shaftline.plant import load_ship
        >>> fit = fit_open_water(load_ship("frigate"))
        >>> fit.thrust.shape, fit.thrust_error < LARGEST_ERROR
        ((5, 6), True)
    """
    screw = ship.propeller
    if not ship.has_variable_pitch:
        raise ShipError(f"{ship.name}: the CPP optimiser needs a controllable-pitch propeller")
    plant = ship.record()
    diameter = screw.diameter_m
    force = ship.water.density_kg_m3 * diameter**4  # force of KT = 1 at one revolution per second
    rows = []
    for p in np.linspace(max(screw.pitch_ratio_min, 0.1), screw.pitch_ratio_max, _GRID[1]):
        for j in np.linspace(0.0, highest_j(float(p)), _GRID[0]):
            load = propeller_load(
                plant, float(j) * diameter, 2.0 * math.pi, float(p), screw.depth_m, 0.0
            )
            kt, kq = load.thrust / force, load.torque / (force * diameter)
            if kt >= 0.0 and kq > 0.0:
                rows.append((j, p, kt, kq))
    j, p, kt, kq = np.array(rows).T
    basis = np.polynomial.polynomial.polyvander2d(j, p, [J_DEGREE, PITCH_DEGREE])
    shape = (J_DEGREE + 1, PITCH_DEGREE + 1)
    fits = [np.linalg.lstsq(basis, curve, rcond=None)[0] for curve in (kt, kq)]
    matrices = [np.ascontiguousarray(fit.reshape(shape)) for fit in fits]
    away = zip(fits, (kt, kq), strict=True)
    errors = [float(np.max(np.abs(basis @ fit - curve)) / np.max(curve)) for fit, curve in away]
    if max(errors) > LARGEST_ERROR:
        raise ShipError(
            f"{ship.name}: the polynomial surfaces differ from the open-water curves by "
            f"{100 * max(errors):.2f} % of the largest value (allowed: {100 * LARGEST_ERROR:.1f} %)"
        )
    return OpenWaterFit(matrices[0], matrices[1], errors[0], errors[1])
