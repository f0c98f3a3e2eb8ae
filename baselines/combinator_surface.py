"""Optimal combinator surface: pitch and shaft speed of least fuel over thrust and advance speed.

Section 3 of the CPP optimiser paper. At a given thrust and advance speed the product of propeller and
engine efficiency, eta_o eta_e = T v_a eta_trm / (fuel flow x heating value), is largest where the fuel
flow is least; without a fuel model, where the brake power is least. SciPy's SLSQP solves the problem in
shaft speed and pitch with the constraints of the paper:

    thrust:       KT(J; p) rho n^2 D^4 = T
    propeller:    0 <= J <= J_max(p),   p_min <= p <= p_max
    engine:       n_min <= n <= n_max,   M_b <= share M_max(n)
    gradient:     d eta_o / d J >= 0     (beyond its maximum the efficiency falls steeply)
    cavitation:   tau_c <= tau_limit     (Burrill, 5 % back cavitation)

With a cavitation weight w_c and a NOx weight w_n the cost is

    fuel + w_c tau_c / tau_limit + w_n NOx

with fuel and NOx relative to those of a setting of little fuel: the propeller is quieter, or the engine
emits less NOx, and burns more. A weight of CO2 would change nothing, because CO2 is proportional to
fuel.

A robust surface minimises the fuel in the worst of the cases of :mod:`.uncertainty`, with the engine
within its limit in all of them, or the expected fuel, with the nominal limit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..observers.records import Floats
from ..plant.ship import Ship, ShipError
from .combinator import TORQUE_MARGIN, full_pitch, full_speed
from .steady_points import require_diesel, steady_point
from .uncertainty import CERTAIN, Uncertainty, uncertain_cases
from .working_point import OpenWaterFit, WorkingPoint, fit_open_water, robust_point, search, slack

ADVANCE_SPEEDS, THRUSTS = 15, 13  # numbers of nodes of the surface
_TRIALS = (161, 81)  # shaft speeds and pitches of the grid search for the start of SLSQP
_NO_REACH = 0.7  # thrust over the least thrust at which the weight of the surface is 0
_STEP = 1.5e-8  # step of the forward differences [-]
_LEAST_NOX, _NO_NOX = 1e-3, 1e-9  # lowest NOx scale over the mean [-], and its absolute value [g/s]
_LEAST_J = 0.02  # lowest J: at J = 0 the efficiency is 0 at every setting


class CombinatorSurface(NamedTuple):
    """Optimal settings over advance speed and share of the thrust range; arrays of shape (m, k)."""

    advance_velocity: Floats  # [m/s], shape (m,)
    least_thrust: Floats  # of one propeller [N], shape (m,)
    most_thrust: Floats  # [N], shape (m,)
    share: Floats  # of the range between them, shape (k,)
    shaft_speed: Floats  # [rad/s]
    pitch_ratio: Floats  # [-]
    refined: float  # share of nodes at which SLSQP converged; the others hold the best of the grid


class _Optimum:
    """Optimisation problem at one advance speed, with x = (omega / omega_max, p)."""

    def __init__(
        self,
        ship: Ship,
        fit: OpenWaterFit,
        advance_velocity: float,
        torque_share: float,
        weights: tuple[float, float],
        uncertainty: Uncertainty,
    ) -> None:
        self.torque_share = torque_share
        self.cavitation_weight, self.nox_weight = weights
        self.cases = uncertain_cases(ship, uncertainty), uncertainty.expected
        self.plant, self.fit, self.velocity = ship.record(), fit, advance_velocity
        low, self.top = ship.shaft_speeds
        pitches = (max(ship.propeller.pitch_ratio_min, 0.1), ship.propeller.pitch_ratio_max)
        self.bounds = [(low / self.top, 1.0), pitches]
        self._cache: dict[bytes, WorkingPoint] = {}
        speeds = np.linspace(low, self.top, _TRIALS[0])
        settings = speeds, np.linspace(*pitches, _TRIALS[1])
        allowed = np.zeros((_TRIALS[0] * _TRIALS[1], 4))  # omega, p, thrust, cost
        grid = (advance_velocity, *settings, torque_share)
        count = search(self.plant, fit.thrust, fit.torque, *grid, *self.cases, allowed)
        self.trials = allowed[:count]

    def at(self, x: Any) -> WorkingPoint:
        """Return the working point at x from a cache: cost and constraints ask for the same places."""
        key, fit = np.asarray(x).tobytes(), self.fit
        if key not in self._cache:
            place = (self.velocity, float(x[0]) * self.top, float(x[1]))
            found = robust_point(self.plant, fit.thrust, fit.torque, *place, *self.cases)
            self._cache[key] = found
        return self._cache[key]

    def _trial(self, trial: Floats) -> WorkingPoint:
        return self.at(trial[:2] / (self.top, 1.0))

    def constraints(self, x: Any) -> list[float]:
        """Return the inequality constraints at x, each satisfied if it is not negative."""
        w = self.at(x)
        engine = self.torque_share - w.torque_share
        return [engine, w.efficiency_slope, 1.0 - w.burrill, w.advance_room]

    def slopes(self, x: Any, function: Callable[[Any], Any]) -> Floats:
        """Return the forward differences of a function at x, inside the bounds; x in the last axis."""
        here, found = np.asarray(function(x)), []
        for i, (_, high) in enumerate(self.bounds):
            moved = np.array(x)
            moved[i] += _STEP if x[i] + _STEP <= high else -_STEP
            found.append((np.asarray(function(moved)) - here) / (moved[i] - x[i]))
        return np.array(found).T

    def best(self, thrust: float) -> tuple[Floats, bool]:
        """Return the optimal x at a thrust [N] and whether SLSQP converged."""
        near = self.trials[np.argsort(np.abs(self.trials[:, 2] / thrust - 1.0))[:60]]
        to_thrust = (thrust / near[:, 2]) ** 1.5  # power is proportional to T^1.5
        costs = near[:, 3] * to_thrust
        weight, scale = self.cavitation_weight, float(costs.min())
        clean, nox_scale = self.nox_weight, 1.0
        least = int(np.argmin(costs))
        if weight > 0.0:
            costs = costs + weight * scale * np.array([self._trial(row).burrill for row in near])
        if clean > 0.0:
            nox = to_thrust * np.array([self._trial(row).nox for row in near])
            nox_scale = max(float(nox[least]), float(nox.mean()) * _LEAST_NOX, _NO_NOX)
            costs = costs + clean * scale * nox / nox_scale
        start = near[int(np.argmin(costs)), :2] / (self.top, 1.0)
        if weight == clean == 0.0:
            scale = float(self.at(start).cost)

        def cost(x: Any) -> float:
            here = self.at(x)
            value = float(here.cost) / scale + weight * float(here.burrill)
            return value + clean * float(here.nox) / nox_scale if clean > 0.0 else value

        def shortfall(x: Any) -> float:
            return float(self.at(x).thrust) / thrust - 1.0

        solve: Any = scipy.optimize.minimize  # The type stubs lack constraints that return a list.

        def by(function: Callable[[Any], Any]) -> Any:  # needs half the evaluations of SciPy
            return functools.partial(self.slopes, function=function)

        conditions = [
            {"type": kind, "fun": function, "jac": by(function)}
            for kind, function in (("eq", shortfall), ("ineq", self.constraints))
        ]
        found = solve(
            cost,
            start,
            method="SLSQP",
            jac=by(cost),
            bounds=self.bounds,
            constraints=conditions,
            options={"maxiter": 100, "ftol": 1e-9},
        )
        reached = self.at(found.x)
        met = abs(reached.thrust / thrust - 1.0) < 1e-4
        met = met and slack(reached, self.torque_share) > -1e-3
        return (found.x, True) if found.success and met else (start, False)


@functools.lru_cache(maxsize=64)
def combinator_surface(
    ship: Ship,
    torque_share: float = TORQUE_MARGIN,
    cavitation_weight: float = 0.0,
    kq_margin: float = 0.0,
    nox_weight: float = 0.0,
    uncertainty: Uncertainty = CERTAIN,
) -> CombinatorSurface:
    """Return the optimal settings over the advance speeds and thrusts of a ship.

    Args:
        ship: ship with a diesel and a controllable-pitch propeller.
        torque_share: highest engine torque over its limit [-]. The paper allows 1; the default leaves a
            margin for the governor in waves.
        cavitation_weight: weight of Burrill's ratio against the relative fuel flow [-].
        kq_margin: share by which KQ may be higher than the fit [-]. Fuel and engine torque are those of
            this worst case, to which an error of eta_R or of the engine's torque is equivalent.
        nox_weight: weight of the relative NOx flow against the relative fuel flow [-].
        uncertainty: bounds of the errors of KQ, eta_R and wake, for a robust surface.

    Raises:
        ShipError: the ship is of another kind, the polynomials do not fit its open-water curves, or a
            NOx weight is given and the ship file has no NOx map.
        ValueError: at fewer than two advance speeds there is a setting that satisfies all constraints.
    """
    require_diesel(ship)
    if nox_weight > 0.0 and ship.emissions.nox_base_g_kWh <= 0.0:
        raise ShipError(
            f"{ship.name}: nox_weight = {nox_weight:g} needs a NOx map; add the section [emissions] "
            "with nox_base_g_kWh (unit g/kWh, such as 9.0) to the ship file"
        )
    fit = fit_open_water(ship)
    fit = fit._replace(torque=(1.0 + kq_margin) * fit.torque)
    low = ship.shaft_speeds[0]
    slowest = _LEAST_J * low / (2.0 * math.pi) * ship.propeller.diameter_m
    fastest = 1.05 * steady_point(ship, full_speed(ship), full_pitch(ship)).advance_velocity
    share = np.linspace(0.0, 1.0, THRUSTS)
    rows = []
    converged = 0
    for velocity in np.linspace(slowest, fastest, ADVANCE_SPEEDS):
        weights = cavitation_weight, nox_weight
        problem = _Optimum(ship, fit, float(velocity), torque_share, weights, uncertainty)
        thrusts = problem.trials[:, 2]
        if len(thrusts) == 0:
            break  # No setting is allowed at this speed or above.
        least, most = float(thrusts.min()), float(thrusts.max())
        optima = [problem.best(least + part * (most - least)) for part in share]
        converged += sum(well for _, well in optima)
        x = np.array([optimum for optimum, _ in optima])
        rows.append((velocity, least, most, x[:, 0] * problem.top, x[:, 1]))
    if len(rows) < 2:
        raise ValueError(
            f"{ship.name}: no setting satisfies all constraints at v_a = {velocity:.2f} m/s"
        )
    velocities, lowest, highest, speeds, pitches = (np.array(x) for x in zip(*rows, strict=True))
    refined = converged / (len(rows) * THRUSTS)
    return CombinatorSurface(velocities, lowest, highest, share, speeds, pitches, refined)


class OptimalSetting(NamedTuple):
    """Optimal settings from the surface; arrays of shape (n,)."""

    shaft_speed: Floats  # [rad/s]
    pitch_ratio: Floats  # [-]
    thrust: Floats  # ordered thrust, at most the highest of the surface [N]
    reach: Floats  # weight: 1 on the surface, 0 at thrusts far below it [-]


def look_up(table: CombinatorSurface, thrust: Any, advance_velocity: Any) -> OptimalSetting:
    """Return the optimal setting by bilinear interpolation.

    The ordered thrust of one propeller is in N, the advance velocity in m/s, each of shape (n,). Below
    the least thrust of the surface the gradient constraint allows no setting; the setting at the least
    thrust is returned, with a smaller ``reach``. The velocity is limited to the range of the table.
    """
    nodes = table.advance_velocity
    velocity = np.clip(np.asarray(advance_velocity, dtype=np.float64), nodes[0], nodes[-1])
    row = np.clip(np.searchsorted(nodes, velocity) - 1, 0, len(nodes) - 2)
    across = (velocity - nodes[row]) / (nodes[row + 1] - nodes[row])
    least = np.interp(velocity, nodes, table.least_thrust)
    most = np.interp(velocity, nodes, table.most_thrust)
    held = np.clip(np.asarray(thrust, dtype=np.float64), least, most)
    place = (held - least) / (most - least) * (len(table.share) - 1)
    column = np.clip(place.astype(np.int64), 0, len(table.share) - 2)
    along = place - column

    def blend(z: Floats) -> Floats:
        near = z[row, column] * (1.0 - along) + z[row, column + 1] * along
        far = z[row + 1, column] * (1.0 - along) + z[row + 1, column + 1] * along
        return np.asarray(near * (1.0 - across) + far * across)

    reach = np.clip((np.asarray(thrust) / least - _NO_REACH) / (1.0 - _NO_REACH), 0.0, 1.0)
    limited = np.minimum(thrust, most)
    return OptimalSetting(blend(table.shaft_speed), blend(table.pitch_ratio), limited, reach)
