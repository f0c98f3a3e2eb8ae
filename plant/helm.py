"""A ship at her helm: rudder orders in, her track through the water out, for manoeuvres."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from .columns import COLUMNS, HEADING, TIME, signal_columns
from .ship import Ship, ShipError
from .steady_state import Equilibrium
from .voyage import Voyage

STALLED = 0.02
"""Share of the approach's speed below which a ship has come to a stop."""


def refuse_to_steer(ship: Ship) -> None:
    """Refuse a ship that cannot be steered.

    Raises:
        ShipError: names the key that she lacks.
    """
    if not ship.turns or ship.rudder.area_m2 == 0.0:
        lacking = "rudder.area_m2 (unit m2; allowed: > 0 and <= 500)"
        if not ship.turns:
            lacking = "manoeuvring.length_m (unit m; allowed: > 0 and <= 500)"
        raise ShipError(f"{ship.name} cannot be steered: it has no {lacking}")


def refuse_angle(ship: Ship, rudder_rad: float, *, amidships: bool = False) -> None:
    """Refuse a rudder angle [rad] beyond the end stops, or one of 0 unless ``amidships`` is asked for.

    Raises:
        ShipError: names the angle with its allowed range.
    """
    most = ship.rudder.angle_max_rad
    if not abs(rudder_rad) <= most * (1.0 + 1e-12) or (rudder_rad == 0.0 and not amidships):
        besides = "" if amidships else " and not 0"
        raise ShipError(
            f"{ship.name}: a rudder angle of {rudder_rad:g} cannot be laid (unit rad; allowed: >= "
            f"{-most:g} and <= {most:g}{besides}, by rudder.angle_max_rad)"
        )


class Helm:
    """A ship on a manoeuvre, in calm water and with her drive's demand kept.

    Args:
        ship: that turns.
        point: straight course from which she begins.
        longest: ship lengths after which an order that does not come to its end is given up [-].

    Raises:
        ShipError: a ship that cannot be steered, that hears signals from outside, or does not sail
            ahead.
    """

    def __init__(self, ship: Ship, point: Equilibrium, longest: float) -> None:
        refuse_to_steer(ship)
        ship.refuse_unheard({})
        self.ship, self.point, self.length = ship, point, ship.manoeuvring.length_m
        self._current = (ship.hull.current_m_s, ship.manoeuvring.cross_current_m_s)
        self.approach_speed = float(point.state.ship_speed) - self._current[0]
        if not self.approach_speed > 0.0:
            raise ShipError(
                f"{ship.name}: a manoeuvre begins at {self.approach_speed:g} m/s through the water "
                "(unit m/s; allowed: > 0)"
            )
        self._longest, self._since = longest, 0.0
        self._voyage = Voyage(ship, point.state, point.inputs.drive)

    @property
    def time_s(self) -> float:
        """Since she began [s]."""
        return self._voyage.time_s

    @property
    def heading(self) -> float:
        """Change of heading so far [rad]."""
        return float(self._voyage.state.heading - self.point.state.heading)

    @property
    def yaw_rate(self) -> float:
        """Rate of turn [rad/s]."""
        return float(self._voyage.state.yaw_rate)

    @property
    def steps_to_a_length(self) -> int:
        """Time steps in which she sails her length at the approach's speed."""
        steps = self.length / self.approach_speed / float(self._voyage.dt)
        return max(1, round(steps))

    def speed(self) -> float:
        """Speed through the water [m/s]."""
        state = self._voyage.state
        cosine, sine = math.cos(state.heading), math.sin(state.heading)
        along, across = self._current
        return math.hypot(
            state.ship_speed - along * cosine - across * sine,
            state.sway_speed - across * cosine + along * sine,
        )

    def order(self) -> None:
        """Begin to count the ship lengths of a new order."""
        self._since = 0.0

    def hold(self, rudder_rad: float, steps: int, purpose: str) -> None:
        """Sail on with the rudder commanded to an angle.

        Args:
            rudder_rad: [rad].
            steps: how many time steps.
            purpose: what the order is to reach, for the message.

        Raises:
            ShipError: she stops, or does not get there within the longest way.
        """
        before = self.speed()
        command = self.point.inputs.pitch_command
        self._voyage.sail(self.point.inputs.drive, command, rudder_rad, steps)
        after = self.speed()
        self._since += 0.5 * (before + after) * steps * self._voyage.dt / self.length
        told = f"{self.ship.name}: with the rudder at {math.degrees(rudder_rad):g} deg she"
        if not after > STALLED * self.approach_speed:
            raise ShipError(
                f"{told} comes to a stop before {purpose} (speed {after:.3g} m/s; allowed: > "
                f"{STALLED * self.approach_speed:.3g} m/s, {100.0 * STALLED:g} % of the approach)"
            )
        if self._since > self._longest:
            raise ShipError(
                f"{told} has not reached {purpose} after {self._longest:g} ship lengths, where it is "
                f"given up; her heading has changed by {math.degrees(self.heading):.4g} deg"
            )

    def track(self) -> pd.DataFrame:
        """What she has sailed, by time step.

        Returns:
            Columns time_s, position_m and cross_track_m (through the water, along and to starboard of
            the first course), heading_rad (from that course), speed_m_s (through the water), drift_rad
            (-atan(v / u)), and every other canonical column that a recording of the ship has
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
