"""Autopilot: holds a heading by the rudder, its loop shaped around the ship.

    rudder = C (psi_aim - psi),   C = L / P,   L = 60 / (s (s^2 + 2 2 sqrt(60) s + 60))

Taylor 2000, section 5.2: crossover at 0.91, phase margin 64 deg, gain margin 30 dB, whatever the ship. A
new heading is led to at a constant rate of turn, as the ship is dead-reckoned (section 5.2.3.2), by the
shorter way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .helmsman import Course, ShapedHelmsman
from .loop_shaping import COURSE_LOOP, ShapedLaw, heading_plant, shaped, steered_at


class Autopilot(ShapedHelmsman):
    """Holds the ordered heading; see the module.

    Args:
        ship: that turns and holds her course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: at which the loop is shaped [m/s].
        turn_deg: rate at which he leads to a new heading [deg per ship length].
        gain: factor on C [-].
        reset_lengths: see :class:`~.loop_shaping.ShapedLaw`; [ship lengths]; by default
            infinite, as printed, for no integral.

    Raises:
        ShipError: a ship that cannot be steered, or does not hold her course.
        ValueError: an option out of range.
    """

    name = "autopilot"
    source = "Taylor 2000, section 5.2"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0), "reset_lengths": (2.0, 100.0), "turn_deg": (2.0, 60.0),
    }  # fmt: skip
    aims = 1

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float = 0.5,
        speed_m_s: float | None = None,
        turn_deg: float = 6.5,
        gain: float = 1.0,
        reset_lengths: float = math.inf,
    ) -> None:
        super().__init__(ship, interval_s, speed_m_s)
        for name, value in (("turn_deg", turn_deg), ("gain", gain)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.turn = math.radians(turn_deg)
        own = steered_at(self.ship, self.point)
        self.law = ShapedLaw(gain * shaped(COURSE_LOOP, heading_plant(*own)), reset_lengths)

    def begin_aim(self, seen: Course) -> NDArray[np.float64]:
        """The heading that the ship has."""
        return np.array(np.where(np.isfinite(seen.heading), seen.heading, 0.0))[:, None]

    def move_aim(self, seen: Course, way: NDArray[np.float64], aim: NDArray[np.float64]) -> None:
        """Towards the order, at most at the rate of turn."""
        missing = np.remainder(seen.heading_order - aim[:, 0] + np.pi, 2.0 * np.pi) - np.pi
        aim[:, 0] += np.clip(missing, -self.turn * way, self.turn * way)

    def error(self, seen: Course, aim: NDArray[np.float64]) -> NDArray[np.float64]:
        """Aim less heading [rad]."""
        return np.asarray(np.remainder(aim[:, 0] - seen.heading + np.pi, 2.0 * np.pi) - np.pi)
