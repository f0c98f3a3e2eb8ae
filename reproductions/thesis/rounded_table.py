"""Rebuild the open-water table of the thesis, which does not print it, and linearise the frigate on it.

The poles, zeros and gains at A imply dKQ/dJ = -0.0400, dKT/dJ = -0.400, dKQ/d(P/D) = 0.060 and
dKT/d(P/D) = 0.500; those at C imply -0.112, -0.52, 0.134 and 0.600 (:func:`fit_coefficients`). These are
round numbers, and not the slopes of B5-90. A table of KT with two decimals and of KQ with three, at
steps of 0.05 in J and 0.1 in P/D, has these slopes: differences from the entry below, interpolated
linearly. At A, J = 0.5635 lies between KT = 0.04 (J 0.55) and 0.02 (J 0.60): the slope is
-0.02 / 0.05 = -0.4, and KT is 0.04 - 0.4 x 0.0135 = 0.0346, as in the printed steady state. B5-90 has
0.0334 and -0.485.

The entries are those of B5-90, where KQ is 1.0075 KQ + 0.00006 before it is rounded. This raises five of
the entries that the printed numbers determine by one unit: those at J 1.0, 1.15 and 1.3 for P/D 1.4, at
J 1.0 for P/D 1.2, and at J 0.85 for P/D 0.6. A factor alone (1.008 to 1.0105) leaves out the last of
them, an offset alone (0.000202 to 0.000209) the first. About 180 tables with these entries remain;
the row of the shaft acceleration observer in Table 4-1 chose among them (:mod:`.table_plant`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from shaftline.core.lazy import control
from shaftline.plant import Ship
from shaftline.plant.open_water import open_water

from ..side_by_side import published
from .poles import INPUTS, MID_RANGE_TABLES, SOURCES, TABLES, poles_zeros_gain, printed_line

Floats = NDArray[np.float64]
Row = tuple[list[float], list[float]]
"""Row of M_m in C and in D (eq. 2-31)."""

ADVANCE_STEP, PITCH_STEP = 0.05, 0.1
THRUST_DECIMALS, TORQUE_DECIMALS = 2, 3
TORQUE_CHANGE = (1.0075, 6e-5)
"""Factor on KQ of B5-90 and what is added to it, before it is rounded."""
LOWEST_PITCH, HIGHEST_PITCH, HIGHEST_ADVANCE_RATIO = 0.6, 1.4, 1.6
MID_RANGE_PITCH = 1.2
"""P/D of the mid-range point: the ratio of its gains from the rack to v_s and omega is v_s / omega."""
OBSERVER_ADVANCE_RATIO = 0.87375
"""J of KQ and dKQ/dJ in the observers of Tables 3-9 to 3-13, by the zeros of Table 3-13 at A and D."""


class Coefficient(NamedTuple):
    """KT or KQ at one point, with its slopes."""

    value: float
    by_advance_ratio: float
    by_pitch_ratio: float


class Steady(NamedTuple):
    """A steady state."""

    pitch_ratio: float
    shaft_speed: float  # [rad/s]
    ship_speed: float  # [m/s]
    advance_ratio: float
    brake_torque: float = math.nan  # [N m]


class Table(NamedTuple):
    """KT and KQ at nodes of J (first index, from 0) and P/D (second index, from 0.6)."""

    thrust: Floats
    torque: Floats
    advance_step: float = ADVANCE_STEP
    pitch_step: float = PITCH_STEP

    def interpolate(self, nodes: Floats, j: float, pitch_ratio: float) -> float:
        """Return a number between the nodes by bilinear interpolation."""
        along, across = j / self.advance_step, (pitch_ratio - LOWEST_PITCH) / self.pitch_step
        i = min(max(math.floor(along + 1e-9), 0), nodes.shape[0] - 2)
        k = min(max(math.floor(across + 1e-9), 0), nodes.shape[1] - 2)
        f, g = along - i, across - k
        low, high = ((1.0 - f) * nodes[i, m] + f * nodes[i + 1, m] for m in (k, k + 1))
        return float((1.0 - g) * low + g * high)

    def coefficient(self, nodes: Floats, j: float, pitch_ratio: float) -> Coefficient:
        """Return KT or KQ with differences from the node below, all interpolated linearly."""
        over_j = _differences_below(nodes, 0, self.advance_step)
        over_p = _differences_below(nodes, 1, self.pitch_step)
        return Coefficient(
            *(self.interpolate(one, j, pitch_ratio) for one in (nodes, over_j, over_p))
        )

    def coefficients(self, at: Steady) -> tuple[Coefficient, Coefficient]:
        """Return KQ and KT of a steady state."""
        where = at.advance_ratio, at.pitch_ratio
        return self.coefficient(self.torque, *where), self.coefficient(self.thrust, *where)


def _differences_below(nodes: Floats, axis: int, step: float) -> Floats:
    """Return the slope from the node below at each node; the first node has that of the second."""
    slopes = np.diff(nodes, axis=axis) / step
    return np.concatenate([np.take(slopes, [0], axis), slopes], axis)


def rounded_table(
    ship: Ship,
    decimals: tuple[int, int] = (THRUST_DECIMALS, TORQUE_DECIMALS),
    steps: tuple[float, float] = (ADVANCE_STEP, PITCH_STEP),
    change: tuple[float, float] = TORQUE_CHANGE,
) -> Table:
    """Return the rounded table of a B-series propeller.

    ``decimals`` are those of KT and KQ, ``steps`` those in J and P/D; ``change`` is the factor on KQ
    and what is added.
    """
    j = steps[0] * np.arange(round(HIGHEST_ADVANCE_RATIO / steps[0]) + 1)
    p = LOWEST_PITCH + steps[1] * np.arange(round((HIGHEST_PITCH - LOWEST_PITCH) / steps[1]) + 1)
    record = ship.record()
    found: list[Floats] = []
    for name, digits, (factor, more) in (
        ("kt", decimals[0], (1.0, 0.0)),
        ("kq", decimals[1], change),
    ):
        exact = [[factor * open_water(record[name], a, b) + more for b in p] for a in j]
        found.append(np.asarray(np.round(exact, digits), np.float64))
    return Table(found[0], found[1], *steps)


class Parameters(NamedTuple):
    """Parameters of a ship, as factors of eqs. 2-20 and 2-35."""

    inflow: float  # 1 - w
    torque: float  # rho D^5 / (4 pi^2)
    thrust: float  # k_p (1 - t) rho D^4 / (4 pi^2)
    resistance: float
    mass: float
    behind: float  # I_R
    ahead: float  # I_L
    by_speed: float  # of the engine's torque at the propeller shaft
    by_rack: float
    constant: float
    per_brake_torque: float
    diameter: float


def parameters(ship: Ship) -> Parameters:
    """Return the parameters of a ship that stand in eqs. 2-20 and 2-35."""
    record = ship.record()
    gear, diameter = float(record["gear_ratio"]), float(record["diameter"])
    geared = gear * float(record["transmission_efficiency"])
    factor = float(record["density"]) * diameter**4 / (4.0 * math.pi**2)
    pushing = float(record["propellers"]) * (1.0 - float(record["thrust_deduction"]))
    return Parameters(
        1.0 - float(record["wake_fraction"]),
        factor * diameter,
        factor * pushing,
        float(record["resistance_coefficient"]),
        float(record["mass"]),
        float(record["inertia_propeller_side"]),
        float(record["inertia_engine_side"]),
        geared * gear * float(record["torque_per_speed"]),
        geared * float(record["torque_per_rack"]),
        geared * float(record["torque_offset"]),
        geared,
        diameter,
    )


def steady_state(ship: Ship, table: Table, rack: float, pitch_ratio: float) -> Steady:
    """Return the steady state at a fuel rack [mm] and a pitch; J depends on the pitch alone."""
    own = parameters(ship)
    turn = 2.0 * math.pi * own.inflow / own.diameter  # J omega / v_s

    def surplus(j: float) -> float:
        pushing = own.thrust * table.interpolate(table.thrust, j, pitch_ratio)
        return pushing - own.resistance * (j / turn) ** 2

    j = scipy.optimize.brentq(surplus, 0.05, 1.55)
    absorbed = own.torque * table.interpolate(table.torque, j, pitch_ratio)
    driving = own.by_rack * rack + own.constant
    omega = own.by_speed + math.sqrt(own.by_speed**2 + 4.0 * absorbed * driving)
    omega /= 2.0 * absorbed
    brake = absorbed * omega**2 / own.per_brake_torque
    return Steady(pitch_ratio, omega, j * omega / turn, j, brake)


def linear_model(
    ship: Ship, at: Steady, torque: Coefficient, thrust: Coefficient, meter: Row | None = None
) -> control.StateSpace:
    """Return the linear model of eq. 2-35 about a steady state, for given KQ and KT.

    ``meter`` is the row of M_m, by default :func:`meter_row` of the state itself.
    """
    own, lag = parameters(ship), 1.0 / float(ship.record()["pitch_time_constant"])
    inertia, drag = own.ahead + own.behind, own.resistance * at.ship_speed / own.mass
    q = _over_states(own.torque / inertia, own, at, torque)
    t = _over_states(own.thrust / own.mass, own, at, thrust)
    a = [
        [-lag, 0.0, 0.0],
        [-q[0], own.by_speed / inertia - q[1], -q[2]],
        [t[0], t[1], t[2] - 2.0 * drag],
    ]
    b = [
        [lag, 0.0, 0.0, 0.0],
        [0.0, own.by_rack / inertia, 0.0, -q[2] / own.inflow],
        [0.0, 0.0, -drag * at.ship_speed, t[2] / own.inflow],
    ]
    row = meter or meter_row(ship, at, torque)
    c, d = np.vstack([np.eye(3), row[0]]), np.vstack([np.zeros((3, 4)), row[1]])
    outputs = ["pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"]
    return control.ss(a, b, c, d, inputs=list(INPUTS), outputs=outputs)


def meter_row(ship: Ship, at: Steady, torque: Coefficient) -> Row:
    """Return the row of M_m (eq. 2-31) at a steady state."""
    own = parameters(ship)
    inertia = own.ahead + own.behind
    states = _over_states(own.torque * own.ahead / inertia, own, at, torque)
    inflow = states[2] / own.inflow
    states[1] += own.behind / inertia * own.by_speed
    return states, [0.0, own.behind / inertia * own.by_rack, 0.0, inflow]


def _over_states(factor: float, own: Parameters, at: Steady, k: Coefficient) -> list[float]:
    """Return the slopes of factor x omega^2 x K over P/D, omega and v_s."""
    by_speed = 2.0 * k.value - at.advance_ratio * k.by_advance_ratio
    by_velocity = k.by_advance_ratio * 2.0 * math.pi * own.inflow / own.diameter
    slopes = (at.shaft_speed * k.by_pitch_ratio, by_speed, by_velocity)
    return [factor * at.shaft_speed * slope for slope in slopes]


def printed_point(ship: Ship, point: str) -> Steady:
    """Return a working point by the printed P/D, omega and v_a, the rounded numbers of Table 2-1."""
    at, own = published("advance_velocity_thesis_working_points").loc[point], parameters(ship)
    omega, velocity = float(at["shaft_speed_rad_s"]), float(at["advance_velocity_m_s"])
    j = 2.0 * math.pi * velocity / (omega * own.diameter)
    return Steady(float(at["pitch_ratio"]), omega, velocity / own.inflow, j)


def steady_point(ship: Ship, table: Table, point: str) -> Steady:
    """Return the steady state of the table at the printed rack and pitch of A to D."""
    at = published("advance_velocity_thesis_working_points").loc[point]
    return steady_state(ship, table, float(at["fuel_rack_mm"]), float(at["pitch_ratio"]))


def model_at(ship: Ship, table: Table, point: str, *, steady: bool = False) -> control.StateSpace:
    """Return the linear model of the table at A to D, with the row of M_m of A at all four.

    The model is linearised at :func:`printed_point` or, with ``steady``, at :func:`steady_point`.
    """
    first, at = (
        steady_point(ship, table, one) if steady else printed_point(ship, one)
        for one in ("A", point)
    )
    row = meter_row(ship, first, table.coefficients(first)[0])
    return linear_model(ship, at, *table.coefficients(at), row)


def mid_range_state(ship: Ship, table: Table) -> Steady:
    """Return the steady state at P/D 1.2 whose gain from the rack to omega is that of Table 2-18."""
    wanted = printed_line("2-18", SOURCES[0]).gain

    def difference(rack: float) -> float:
        at = steady_state(ship, table, rack, MID_RANGE_PITCH)
        model = linear_model(ship, at, *table.coefficients(at))
        return float(np.real(model["shaft_speed", "drive"].dcgain())) - wanted

    return steady_state(ship, table, scipy.optimize.brentq(difference, 10.0, 30.0), MID_RANGE_PITCH)


def observer_slopes(ship: Ship, table: Table, point: str) -> tuple[float, float]:
    """Return a11 of Table 3-13 and the zero of Table 3-9 [rad/s] at A to D by the table.

    KQ and dKQ/dJ are those at :data:`OBSERVER_ADVANCE_RATIO`, J in -J dKQ/dJ is that of the point.
    """
    own, at = parameters(ship), printed_point(ship, point)
    k = table.coefficient(table.torque, OBSERVER_ADVANCE_RATIO, at.pitch_ratio)
    by_speed = _over_states(own.torque, own, at, k)[1]
    return (own.by_speed - by_speed) / (own.ahead + own.behind), -by_speed / own.behind


def smooth_coefficient(ship: Ship, curve: str, at: Steady) -> Coefficient:
    """Return ``kq`` or ``kt`` of the ship's own curve with its slopes, by central differences."""
    nodes, step = ship.record()[curve], 1e-4
    j, p = at.advance_ratio, at.pitch_ratio
    over_j, over_p = (
        (open_water(nodes, j + a, p + b) - open_water(nodes, j - a, p - b)) / (2.0 * step)
        for a, b in ((step, 0.0), (0.0, step))
    )
    return Coefficient(float(open_water(nodes, j, p)), float(over_j), float(over_p))


class Fitted(NamedTuple):
    """KQ and KT that fit all printed poles, zeros and gains of one point."""

    at: Steady
    torque: Coefficient
    thrust: Coefficient
    worst: float  # largest deviation from a printed number, in halves of its last digit


def fit_coefficients(ship: Ship, point: str) -> Fitted:
    """Return the coefficients and slopes that fit every printed number of a point, M_m left out.

    Eight numbers are free: KQ, KT, their slopes over J and P/D, and omega and v_s within half a digit of
    the print. ``point`` is A to D or ``mid-range``, whose omega and v_s are free.
    """
    middle = point == "mid-range"
    tables = MID_RANGE_TABLES if middle else TABLES
    if middle:
        start, half = Steady(MID_RANGE_PITCH, 9.66, 7.09, 1.04), (0.1, 0.1)
    else:
        start = printed_point(ship, point)
        half = (0.005, 0.005) if start.shaft_speed < 10.0 else (0.05, 0.05)
    kept = {name: pair for name, pair in tables.items() if pair[0] in {"shaft_speed", "ship_speed"}}
    lines = {name: printed_line(name, SOURCES[0] if middle else point) for name in kept}
    guess = _GUESSES[start.pitch_ratio]
    turn = start.advance_ratio * start.shaft_speed / start.ship_speed

    def unpack(x: Floats) -> tuple[Steady, Coefficient, Coefficient]:
        omega, speed = start.shaft_speed + half[0] * x[0], start.ship_speed + half[1] * x[1]
        at = Steady(start.pitch_ratio, float(omega), float(speed), float(turn * speed / omega))
        k = np.array(guess) * (1.0 + x[2:])
        return at, Coefficient(*k[:3].tolist()), Coefficient(*k[3:].tolist())

    def deviations(x: Floats) -> Floats:
        model, found = linear_model(ship, *unpack(x)), []
        for name, pair in kept.items():
            poles, zeros, gain = poles_zeros_gain(model[pair])
            ours = {f"pole {i}": one for i, one in enumerate(poles, 1)}
            ours |= {f"zero {i}": one for i, one in enumerate(zeros, 1)} | {"gain": gain}
            numbers = lines[name].numbers.items()
            found += [(ours[key] - value) / digit for key, (value, digit) in numbers]
        return np.array(found)

    def with_point(x: Floats) -> Floats:
        return np.append(deviations(x), [] if middle else x[:2])

    best = scipy.optimize.least_squares(with_point, np.zeros(8), x_scale=[1, 1, *[1e-2] * 6]).x
    return Fitted(*unpack(best), float(np.abs(deviations(best)).max()))


_GUESSES = {
    0.6: (0.0085, -0.04, 0.06, 0.035, -0.4, 0.5),
    1.2: (0.027, -0.095, 0.11, 0.117, -0.55, 0.6),
    1.4: (0.038, -0.11, 0.13, 0.15, -0.52, 0.6),
}
"""Start of the fit by P/D: value and slopes over J and P/D, of KQ and of KT."""
