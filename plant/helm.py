"""The helm of a ship on a manoeuvre: rudder commands in, track through the water out."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from .columns import COLUMNS, HEADING, TIME, signal_columns
from .ship import Ship, ShipError
from .steady_state import Equilibrium
from .voyage import Voyage

STALLED = 0.02
"""Share of the approach speed below which the ship counts as stopped."""


def require_steering(ship: Ship) -> None:
    """Refuse a ship without manoeuvring data or rudder with a ShipError that names the missing key."""
    if not ship.turns or ship.rudder.area_m2 == 0.0:
        key, unit = ("rudder.area_m2", "m2") if ship.turns else ("manoeuvring.length_m", "m")
        missing = f"{key} (unit {unit}; allowed: > 0 and <= 500)"
        raise ShipError(f"{ship.name} cannot be steered: the ship file has no {missing}")


def refuse_angle(ship: Ship, rudder_rad: float, *, amidships: bool = False) -> None:
    """Refuse a rudder angle [rad] beyond the end stops, or 0 unless ``amidships``, with a ShipError."""
    most = ship.rudder.angle_max_rad
    if not abs(rudder_rad) <= most * (1.0 + 1e-12) or (rudder_rad == 0.0 and not amidships):
        nonzero = "" if amidships else " and not 0"
        raise ShipError(
            f"{ship.name}: a rudder angle of {rudder_rad:g} is not possible (unit rad; allowed: "
            f">= {-most:g} and <= {most:g}{nonzero}, by rudder.angle_max_rad)"
        )


class Helm:
    """The helm of a ship on a manoeuvre in calm water, with a constant drive command.

    Args:
        ship: ship with sway and yaw.
        point: straight course from which the manoeuvre begins.
        longest: number of ship lengths after which a rudder command is given up [-].

    Raises:
        ShipError: the ship has no rudder, uses external signals, or does not move ahead.
    """

    def __init__(self, ship: Ship, point: Equilibrium, longest: float) -> None:
        require_steering(ship)
        ship.require_external_signals({})
        self.ship, self.point, self.length = ship, point, ship.manoeuvring.length_m
        self._current = (ship.hull.current_m_s, ship.manoeuvring.cross_current_m_s)
        self.approach_speed = float(point.state.ship_speed) - self._current[0]
        if not self.approach_speed > 0.0:
            raise ShipError(
                f"{ship.name}: a manoeuvre must begin with headway, not at {self.approach_speed:g} m/s "
                "through the water (unit m/s; allowed: > 0)"
            )
        self._longest, self._since = longest, 0.0
        self._voyage = Voyage(ship, point.state, point.inputs.drive)

    @property
    def time_s(self) -> float:
        """Time since the start of the manoeuvre [s]."""
        return self._voyage.time_s

    @property
    def heading(self) -> float:
        """Change of heading since the start [rad]."""
        return float(self._voyage.state.heading - self.point.state.heading)

    @property
    def yaw_rate(self) -> float:
        """Rate of turn [rad/s]."""
        return float(self._voyage.state.yaw_rate)

    @property
    def steps_to_a_length(self) -> int:
        """Number of time steps in which the ship travels its length at the approach speed."""
        steps = self.length / self.approach_speed / float(self._voyage.dt)
        return max(1, round(steps))

    def speed(self) -> float:
        """Return the speed through the water [m/s]."""
        state = self._voyage.state
        cosine, sine = math.cos(state.heading), math.sin(state.heading)
        along, across = self._current
        return math.hypot(
            state.ship_speed - along * cosine - across * sine,
            state.sway_speed - across * cosine + along * sine,
        )

    def begin_command(self) -> None:
        """Start to count the ship lengths of a new rudder command."""
        self._since = 0.0

    def hold(self, rudder_rad: float, steps: int, purpose: str) -> None:
        """Simulate the ship with a constant rudder command [rad] for some time steps.

        A ship that stops or capsizes, or does not reach the ``purpose`` of the command within the
        longest way, raises a ShipError.
        """
        before = self.speed()
        command = self.point.inputs.pitch_command
        self._voyage.run(self.point.inputs.drive, command, rudder_rad, steps)
        after = self.speed()
        self._since += 0.5 * (before + after) * steps * self._voyage.dt / self.length
        begin = f"{self.ship.name}: with the rudder at {math.degrees(rudder_rad):g} deg the ship"
        if not after > STALLED * self.approach_speed:
            raise ShipError(
                f"{begin} stops before {purpose} (speed {after:.3g} m/s; allowed: > "
                f"{STALLED * self.approach_speed:.3g} m/s, {100.0 * STALLED:g} % of the approach speed)"
            )
        roll = float(self._voyage.state.roll_angle)
        if not abs(roll) < 0.5 * math.pi:
            raise ShipError(
                f"{begin} capsizes before {purpose} (roll angle {roll:.3g} rad; allowed: < "
                f"{0.5 * math.pi:.4g} rad). Check roll.metacentric_height_m and roll.hull_force_depth_m"
            )
        if self._since > self._longest:
            raise ShipError(
                f"{begin} has not reached {purpose} within {self._longest:g} ship lengths; "
                f"its heading has changed by {math.degrees(self.heading):.4g} deg"
            )

    def track(self) -> pd.DataFrame:
        """Return the track of the manoeuvre, one row for each time step.

        Returns:
            Columns time_s, position_m and cross_track_m (through the water, along the initial course and
            to starboard of it), heading_rad (relative to that course), speed_m_s (through the water),
            drift_rad (-atan(v / u)), and every other canonical column that a recording of the ship has
            (:func:`.columns.signal_columns`), so that the track is a recording.
        """
        s = self._voyage.samples
        along, across = self._current
        cosine, sine = np.cos(s["heading"]), np.sin(s["heading"])
        ahead = s["ship_speed"] - along * cosine - across * sine
        aside = s["sway_speed"] - across * cosine + along * sine
        start = self.point.state
        own = {
            TIME: s["time"],
            "position_m": s["position"] - start.position - along * s["time"],
            "cross_track_m": s["cross_track"] - start.cross_track - across * s["time"],
            HEADING: s["heading"] - start.heading,
            "speed_m_s": np.hypot(ahead, aside),
            "drift_rad": -np.arctan2(aside, ahead),
        }
        names = signal_columns(self.ship)
        recorded = {c: s[names[c]] for c in COLUMNS if c in names and c not in own}
        return pd.DataFrame(own | recorded)
