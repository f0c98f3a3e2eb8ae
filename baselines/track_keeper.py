"""Cross-track controller: keeps the ship on a line by the rudder, its loop shaped around the ship.

    rudder = C (y_aim - y) / L_pp
    C = 20 (s + 0.5)^2 (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)^2)   on the destroyer's P / s

Taylor 2000, section 5.3, eq. 5.42; on another ship C is what gives the same loop. A new line is led
to smoothly, by a polynomial of fifth order whose ends have neither slope nor curvature: "smooth
trajectories are required" (section 5.3.3.1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .helmsman import Course, ShapedHelmsman
from .loop_shaping import TRACK_LOOP, ShapedLaw, shaped, steered_at, track_plant


def quintic(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0 to 1 with no slope and no curvature at either end.

    Args:
        share: of the way, held in 0 to 1.
    """
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


class TrackKeeper(ShapedHelmsman):
    """Keeps the ordered line; see the module.

    Args:
        ship: that turns and holds her course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: at which the loop is shaped [m/s].
        change_lengths: way over which he leads to a new line [ship lengths].
        gain: factor on C [-].
        reset_lengths: see :class:`~.loop_shaping.ShapedLaw`; [ship lengths]; by default
            infinite, as printed, for no integral.

    Raises:
        ShipError: a ship that cannot be steered, or does not hold her course.
        ValueError: an option out of range.
    """

    name = "track-keeper"
    source = "Taylor 2000, section 5.3"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0), "reset_lengths": (2.0, 100.0), "change_lengths": (1.0, 60.0),
    }  # fmt: skip
    aims = 4  # the line aimed at, where the change began, the order that it leads to, how far it is

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float = 0.5,
        speed_m_s: float | None = None,
        change_lengths: float = 38.0,
        gain: float = 1.0,
        reset_lengths: float = math.inf,
    ) -> None:
        super().__init__(ship, interval_s, speed_m_s)
        for name, value in (("change_lengths", change_lengths), ("gain", gain)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.change_lengths = change_lengths
        own = steered_at(self.ship, self.point)
        self.law = ShapedLaw(gain * shaped(TRACK_LOOP, track_plant(*own)), reset_lengths)

    def begin_aim(self, seen: Course) -> NDArray[np.float64]:
        """The line on which the ship is."""
        here = np.where(np.isfinite(seen.cross_track), seen.cross_track, 0.0)
        return np.column_stack([here, here, here, np.ones_like(here)])

    def move_aim(self, seen: Course, way: NDArray[np.float64], aim: NDArray[np.float64]) -> None:
        """Along the polynomial; a new order begins another one from where this one is."""
        fresh = seen.track_order != aim[:, 2]
        aim[:, 1] = np.where(fresh, aim[:, 0], aim[:, 1])
        aim[:, 2] = seen.track_order
        aim[:, 3] = np.where(fresh, 0.0, aim[:, 3]) + way / self.change_lengths
        aim[:, 0] = aim[:, 1] + (aim[:, 2] - aim[:, 1]) * quintic(aim[:, 3])

    def error(self, seen: Course, aim: NDArray[np.float64]) -> NDArray[np.float64]:
        """Line aimed at less cross track [ship lengths]."""
        return (aim[:, 0] - seen.cross_track) / self.length
