"""IMO's standards for ship manoeuvrability, and the set of manoeuvres that they ask for.

Resolution MSC.137(76), section 5.3, with its turning circles at 35 degrees of rudder (or what the ship
has), its 10/10 and 20/20 zig-zags, each to both sides, and a spiral. The stopping ability is left out.
The limits of yaw checking go with L/V, the time in which the ship sails her own length.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .helm import Helm
from .manoeuvres import (
    SPIRAL_ANGLES,
    Spiral,
    TurningCircle,
    ZigZag,
    spiral,
    turning_circle,
    zig_zag,
)
from .ship import Ship
from .ship_errors import ShipError
from .steady_state import Equilibrium

SIDES = {"starboard": 1.0, "port": -1.0}
ZIG_ZAGS = (10, 20)  # [deg]
HARD_OVER = math.radians(35.0)
MANOEUVRES = 2 + 2 * len(ZIG_ZAGS) + 1
"""How many manoeuvres :func:`trials` sails."""


class Trials(NamedTuple):
    """The standard set of manoeuvres of a ship; one that she cannot sail is missing, with the reason."""

    ship: Ship
    speed_m_s: float  # of the approach, through the water [m/s]
    turns: dict[str, TurningCircle]  # by side
    zig_zags: dict[tuple[int, str], ZigZag]  # by angle [deg] and side
    spiral: Spiral | None
    not_sailed: dict[str, str]  # why, by name

    def tracks(self) -> dict[str, pd.DataFrame]:
        """Every track by a name that may be a file's, and the spiral's curve."""
        found = {f"turning-circle-{side}": turn.track for side, turn in self.turns.items()}
        for (angle, side), one in self.zig_zags.items():
            found[f"zig-zag-{angle}-{angle}-{side}"] = one.track
        return found | ({} if self.spiral is None else {"spiral": self.spiral.curve})

    def numbers(self) -> dict[str, Any]:
        """What every manoeuvre measures, as plain numbers and names."""
        return {
            "ship": self.ship.name,
            "length_m": self.ship.manoeuvring.length_m,
            "speed_m_s": self.speed_m_s,
            "turning_circles": {
                side: _plain(turn) | {f"{name}_m": value for name, value in turn.metres.items()}
                for side, turn in self.turns.items()
            },
            "zig_zags": {
                f"{angle}/{angle} {side}": _plain(one)
                for (angle, side), one in self.zig_zags.items()
            },
            "spiral": None
            if self.spiral is None
            else _plain(self.spiral) | {"curve": self.spiral.curve.to_dict("records")},
            "not_sailed": self.not_sailed,
        }


def _plain(measured: TurningCircle | ZigZag | Spiral) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    for name, value in measured._asdict().items():
        if isinstance(value, tuple):
            plain[name] = [float(one) for one in value]
        elif not isinstance(value, pd.DataFrame):
            plain[name] = float(value)
    return plain


def trials(ship: Ship, point: Equilibrium, tick: Callable[[], None] = lambda: None) -> Trials:
    """Sail the standard set.

    Args:
        ship: that turns.
        point: straight course from which each begins, as of :func:`shaftline.plant.approach`.
        tick: called after each of the :data:`MANOEUVRES`.

    Raises:
        ShipError: a ship that cannot be steered at all, or does not sail ahead.
    """
    speed = Helm(ship, point, 0.0).approach_speed
    turns: dict[str, TurningCircle] = {}
    zig_zags: dict[tuple[int, str], ZigZag] = {}
    spirals: list[Spiral] = []
    not_sailed: dict[str, str] = {}
    most = ship.rudder.angle_max_rad

    def sail(name: str, manoeuvre: Callable[[], None]) -> None:
        try:
            manoeuvre()
        except ShipError as error:
            not_sailed[name] = str(error)
        tick()

    for side, sign in SIDES.items():
        hard_over = sign * min(HARD_OVER, most)

        def turn(side: str = side, rudder: float = hard_over) -> None:
            turns[side] = turning_circle(ship, point, rudder)

        sail(f"turning circle to {side}", turn)
        for angle in ZIG_ZAGS:

            def zigzag(side: str = side, sign: float = sign, angle: int = angle) -> None:
                rudder = math.radians(angle)
                zig_zags[angle, side] = zig_zag(ship, point, sign * rudder, rudder)

            sail(f"{angle}/{angle} zig-zag to {side}", zigzag)
    sail(
        "spiral",
        lambda: spirals.append(spiral(ship, point, [a for a in SPIRAL_ANGLES if abs(a) <= most])),
    )
    return Trials(ship, speed, turns, zig_zags, spirals[0] if spirals else None, not_sailed)


def limits(length_over_speed_s: float) -> dict[str, float]:
    """Limits of MSC.137(76), 5.3.1 to 5.3.3, by criterion [ship lengths, deg].

    Args:
        length_over_speed_s: L/V of the ship at full scale [s].
    """
    time = float(np.clip(length_over_speed_s, 10.0, 30.0))  # between these the limits rise
    return {
        "advance": 4.5,
        "tactical diameter": 5.0,
        "initial turning, 10/10": 2.5,
        "first overshoot, 10/10": 5.0 + 0.5 * time,
        "second overshoot, 10/10": 17.5 + 0.75 * time,
        "first overshoot, 20/20": 25.0,
    }


def criteria(sailed: Trials, scale: float = 1.0) -> pd.DataFrame:
    """What was measured beside IMO's limits.

    Args:
        sailed: from :func:`trials`.
        scale: length of the ship over that of the one sailed, for a model [-]; L/V goes with its root
            (Froude).

    Returns:
        Columns criterion, unit, starboard, port, limit, met: ``yes``, ``no``, or ``not sailed``.

    Raises:
        ShipError: a scale that is not above 0.
    """
    if not 0.0 < scale < math.inf:
        raise ShipError(f"scale = {scale:g} (unit -; allowed: > 0)")
    length_over_speed = sailed.ship.manoeuvring.length_m / sailed.speed_m_s * math.sqrt(scale)
    rows = []
    for criterion, limit in limits(length_over_speed).items():
        pair = [_measured(sailed, criterion, side) for side in SIDES]
        met = "yes" if all(value <= limit for value in pair) else "no"
        if any(math.isnan(value) for value in pair):
            met = "not sailed"
        unit = "deg" if "overshoot" in criterion else "L"
        rows.append((criterion, unit, *pair, limit, met))
    return pd.DataFrame(rows, columns=["criterion", "unit", *SIDES, "limit", "met"])


def _measured(sailed: Trials, criterion: str, side: str) -> float:
    """One criterion to one side; not a number where the manoeuvre was not sailed."""
    what, _, angles = criterion.partition(", ")
    if not angles:
        turn = sailed.turns.get(side)
        return math.nan if turn is None else float(getattr(turn, what.replace(" ", "_")))
    one = sailed.zig_zags.get((int(angles.split("/")[0]), side))
    if one is None:
        return math.nan
    if what == "initial turning":
        return one.initial_turning
    return one.overshoots_deg[0 if what.startswith("first") else 1]
