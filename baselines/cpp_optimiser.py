"""CPP optimiser: pitch and shaft speed of least fuel for the thrust that the lever orders.

The control scheme of the CPP optimiser paper, its sections 2.3 and 4. The observer's advance speed and
the measured shaft speed and pitch give the working point J; the fitted thrust surface gives the thrust
there. The lever's order is a thrust. A combinator surface, optimised beforehand, gives pitch and shaft
speed for ordered thrust and actual advance speed; a thrust controller trims the shaft speed until the
estimated thrust is the ordered one; the governor underneath moves the rack. Where the observer does not
vouch for its estimate, or the ordered thrust lies below the surface, the plain combinator takes over,
smoothly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from ..plant.hull import resistance
from ..plant.open_water import MIN_REVOLUTIONS, REVOLUTIONS_PER_RADIAN
from ..plant.ship import Ship
from .combinator import Combinator
from .combinator_surface import OptimalSetting, combinator_surface, look_up
from .controller import Controller, Readings
from .governor import RESPONSE_S
from .working_point import fit_open_water, surface

FILTER_S = 8.0
"""Time constant of the filters on estimated advance speed and thrust [s]: longer than a wave."""

THRUST_INTEGRAL_S = 20.0
"""Time in which the thrust controller removes a thrust error [s]: slower than the filters."""

TRUST_S = 5.0
"""Time constant with which combinator and optimiser hand over to each other [s]."""

TRIM_SHARE = 0.2
"""Largest trim of the thrust controller, as a share of the highest shaft speed."""

INTEGRAL, ADVANCE, THRUST, TRIM, TRUST = range(5)
"""Columns of the state: governor's integral [mm], filtered advance speed [m/s] and thrust [N], trim
of the shaft speed [rad/s], trust in the estimate [0 to 1]."""


@compiled
def _thrusts(
    matrix: NDArray[np.float64],
    advance_velocity: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    pitch_ratio: NDArray[np.float64],
    diameter: float,
    density: float,
    thrust: NDArray[np.float64],
) -> None:
    """Thrust of one propeller [N] by the fitted surface; J is held at 0 and at P/D."""
    for i in range(len(thrust)):
        n = max(shaft_speed[i] * REVOLUTIONS_PER_RADIAN, MIN_REVOLUTIONS)
        j = min(max(advance_velocity[i] / (n * diameter), 0.0), max(pitch_ratio[i], 0.0))
        thrust[i] = surface(matrix, j, pitch_ratio[i]) * density * diameter**4 * n * n


def _valid(seen: Readings) -> NDArray[np.bool_]:
    """Whether the observer vouches for its estimate."""
    return (seen.estimate_valid > 0.5) & np.isfinite(seen.advance_velocity)


class CppOptimiser(Controller):
    """The optimal control of a controllable-pitch propeller.

    Args:
        ship: a ship with a diesel and a propeller of controllable pitch, or its name. The combinator
            surface takes some seconds to work out and is kept for the next instance.
        interval_s: control interval of the environment [s].
        response_s: time constant of the governed shaft [s].
        filter_s: time constant of the filters on estimated advance speed and thrust [s].
        pitch_at: thrust at which the surface is asked for the pitch: ``ordered``, or ``actual``, the
            estimated one, as in the paper. Both are the same once the order is reached.

    State: shape (n, 5), columns :data:`INTEGRAL` to :data:`TRUST`.

    Raises:
        ValueError: another ``pitch_at``, or a ``filter_s`` that is not above 0.
    """

    name = "cpp-optimiser"
    source = "CPP optimiser paper"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "cpp-optimiser-at-actual": {"pitch_at": "actual"}
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        response_s: float = RESPONSE_S,
        *,
        filter_s: float = FILTER_S,
        pitch_at: str = "ordered",
    ) -> None:
        super().__init__(ship, interval_s)
        if pitch_at not in ("ordered", "actual"):
            raise ValueError(f"pitch_at = {pitch_at!r}: must be 'ordered' or 'actual'")
        if not (math.isfinite(filter_s) and filter_s > 0.0):
            raise ValueError(f"filter_s = {filter_s!r} s: must be a number above 0")
        self.pitch_at, self.filter_s = pitch_at, filter_s
        self.fit = fit_open_water(self.ship)
        self.surface = combinator_surface(self.ship)
        self.combinator = Combinator(self.ship, interval_s, response_s=response_s)
        self._top = self.ship.shaft_speeds[1]

    def ordered_thrust(self, speed_order: Any) -> NDArray[np.float64]:
        """Thrust of one propeller [N] that holds an ordered speed [m/s] in calm water, shape (n,).

        Orders beyond the ship's highest speed ask for more thrust than calm water takes: what a higher
        resistance needs. The surface's own end limits them.
        """
        push = float(self.plant["propellers"] * (1.0 - self.plant["thrust_deduction"]))
        orders = np.atleast_1d(np.asarray(speed_order, dtype=np.float64))
        return np.array([resistance(self.plant, max(v, 0.0), 1.0) / push for v in orders])

    def thrust(self, seen: Readings) -> NDArray[np.float64]:
        """Thrust of one propeller [N] at the working point that the estimate tells, shape (n,)."""
        found = np.zeros(len(seen.shaft_speed))
        screw = self.ship.propeller
        _thrusts(
            self.fit.thrust,
            np.ascontiguousarray(seen.advance_velocity),
            np.ascontiguousarray(seen.shaft_speed),
            np.clip(seen.pitch_ratio, screw.pitch_ratio_min, screw.pitch_ratio_max),
            screw.diameter_m,
            self.ship.water.density_kg_m3,
            found,
        )
        return found

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """Filters that have heard nothing, a governor that is not settled yet."""
        memory = np.zeros((len(seen.shaft_speed), 5))
        memory[:, INTEGRAL] = np.nan  # until the shaft speed to be held is known
        memory[:, TRUST] = _valid(seen)
        return memory

    def act(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch of the surface and the governor's rack, or the combinator's."""
        valid = _valid(seen)
        estimate = self.thrust(seen)
        plain_pitch, plain_speed = self.combinator.set_points(seen.speed_order)
        # a filter that has heard nothing yet starts at what it hears first
        hears_first = valid & (memory[:, ADVANCE] == 0.0) & (memory[:, THRUST] == 0.0)
        memory[hears_first, ADVANCE] = seen.advance_velocity[hears_first]
        memory[hears_first, THRUST] = estimate[hears_first]

        keep = math.exp(-self.interval_s / self.filter_s)
        for column, heard in ((ADVANCE, seen.advance_velocity), (THRUST, estimate)):
            filtered = keep * memory[:, column] + (1.0 - keep) * heard
            memory[:, column] = np.where(valid, filtered, memory[:, column])
        gives = math.exp(-self.interval_s / TRUST_S)
        memory[:, TRUST] = gives * memory[:, TRUST] + (1.0 - gives) * valid

        setting = look_up(self.surface, self.ordered_thrust(seen.speed_order), memory[:, ADVANCE])
        memory[:, TRIM] = self._trimmed(memory, setting, valid)
        best_pitch = setting.pitch_ratio
        if self.pitch_at == "actual":
            best_pitch = look_up(self.surface, memory[:, THRUST], memory[:, ADVANCE]).pitch_ratio
        share = memory[:, TRUST] * setting.reach
        speed = share * (setting.shaft_speed + memory[:, TRIM]) + (1.0 - share) * plain_speed
        pitch = share * best_pitch + (1.0 - share) * plain_pitch
        governor = self.combinator.governor
        settled = governor.settle(seen.shaft_speed, seen.fuel_rack, speed)
        integral = np.where(np.isnan(memory[:, INTEGRAL]), settled, memory[:, INTEGRAL])
        rack, memory[:, INTEGRAL] = governor.command(speed, seen.shaft_speed, integral)
        return pitch, rack

    def _trimmed(
        self, memory: NDArray[np.float64], setting: OptimalSetting, valid: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Integral thrust controller: as T goes with omega^2, d omega / d T = omega / (2 T).

        It rests where the optimiser does not act.
        """
        error = (setting.thrust - memory[:, THRUST]) / np.maximum(setting.thrust, 1.0)
        rate = 0.5 * setting.shaft_speed * np.clip(error, -1.0, 1.0) / THRUST_INTEGRAL_S
        acting = np.where(valid, setting.reach, 0.0)
        trim = memory[:, TRIM] + acting * rate * self.interval_s
        return np.asarray(np.clip(trim, -TRIM_SHARE * self._top, TRIM_SHARE * self._top))
