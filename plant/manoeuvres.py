"""Manoeuvres of a ship that turns: turning circle, zig-zag and spiral, sailed with a helmsman's orders.

Definitions as in IMO's explanatory notes to the standards for ship manoeuvrability (MSC/Circ.1053). The
ship sails in calm water from a straight course, and her drive keeps its demand. Everything is measured
through the water, so a current changes no figure. Rudder angles are positive where they turn her to
starboard; ship lengths are those between perpendiculars.

IMO's standards for ship manoeuvrability, and the set of manoeuvres that they ask for.

Resolution MSC.137(76), section 5.3, with its turning circles at 35 degrees of rudder (or what the ship
has), its 10/10 and 20/20 zig-zags, each to both sides, and a spiral. The stopping ability is left out.
The limits of yaw checking go with L/V, the time in which the ship sails her own length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .helm import Helm, refuse_angle, refuse_to_steer
from .ship import Ship, ShipError
from .steady_state import Equilibrium

LONGEST = 200.0
"""Ship lengths after which a turn, a leg of a zig-zag or an angle of a spiral is given up."""

STEADY_RATE, STEADY_SPEED = 5e-5, 2e-4
"""Change over a ship length below which a turn is steady: of r', and of the speed's share."""

_TO_ONE_SIDE = (
    *(0.25 * k for k in range(1, 4)), *(0.5 * k for k in range(2, 11)), 7.5, 10.0, 15.0, 20.0, 25.0,
)  # fmt: skip
SPIRAL_ANGLES = tuple(
    math.radians(angle) for angle in (*_TO_ONE_SIDE[::-1], 0.0, *(-a for a in _TO_ONE_SIDE))
)
"""Rudder angles of a spiral [rad], from starboard to port."""


class TurningCircle(NamedTuple):
    """What a turn with the rudder held measures."""

    rudder_rad: float  # angle that was ordered [rad]
    length_m: float  # of the ship [m]
    advance: float  # along the first course until the heading has changed by 90 deg [lengths]
    transfer: float  # across it until then [lengths]
    tactical_diameter: float  # across it until the heading has changed by 180 deg [lengths]
    steady_diameter: float  # 2 U / r at the end [lengths]
    speed_ratio: float  # speed at the end over that of the approach [-]
    rate_of_turn: float  # r' = r L / U at the end, positive to starboard [-]
    drift_rad: float  # at midship at the end, -atan(v / u) [rad]
    shaft_speed_ratio: float  # at the end over that of the approach [-]
    unsteadiness: float  # change of r over the last 90 deg of heading, as a share [-]
    track: pd.DataFrame  # by time step, as of helm.Helm.track

    @property
    def metres(self) -> dict[str, float]:
        """Its distances [m] by name."""
        names = ("advance", "transfer", "tactical_diameter", "steady_diameter")
        return {name: float(getattr(self, name)) * self.length_m for name in names}


class ZigZag(NamedTuple):
    """What a zig-zag measures."""

    rudder_rad: float  # angle of the first execute [rad]
    heading_rad: float  # change of heading at which the rudder is put over [rad]
    overshoots_deg: tuple[float, ...]  # of the heading after each execute from the second on [deg]
    initial_turning: float  # way until the heading has changed by heading_rad [lengths]
    period_s: float  # between the last two executes to the same side [s]
    executes_s: tuple[float, ...]  # their times [s]
    track: pd.DataFrame  # by time step, as of helm.Helm.track


class Spiral(NamedTuple):
    """Steady rates of turn over rudder angles, from starboard to port and back.

    A ship that is unstable on her course turns either way at small angles, by where she comes from: the
    two branches leave a loop.
    """

    curve: (
        pd.DataFrame
    )  # rudder_rad, rate_of_turn [-], speed_ratio [-], leg (to port, to starboard)
    width_deg: float  # of the loop between the angles at which r' changes its sign [deg]
    height: float  # of the loop with the rudder amidships [-]


def turning_circle(
    ship: Ship, point: Equilibrium, rudder_rad: float, heading_rad: float = 3.0 * math.pi
) -> TurningCircle:
    """Turn with the rudder held.

    Args:
        ship: that turns.
        point: straight course from which she begins, as of :func:`shaftline.plant.approach`.
        rudder_rad: ordered angle [rad], positive turns to starboard.
        heading_rad: change of heading at which the turn ends [rad], at least pi.

    Returns:
        Distances as ship lengths, between time steps by straight lines.

    Raises:
        ShipError: an angle out of range; a ship that cannot be steered, comes to a stop, turns the
            other way or has not turned so far after :data:`LONGEST` ship lengths.
    """
    if not math.pi <= heading_rad <= 20.0 * math.pi:
        raise ShipError(
            f"heading_rad = {heading_rad:g} ends no turning circle (unit rad; allowed: >= "
            f"{math.pi:g} and <= {20.0 * math.pi:g})"
        )
    refuse_to_steer(ship)
    refuse_angle(ship, rudder_rad)
    helm, side = Helm(ship, point, LONGEST), math.copysign(1.0, rudder_rad)
    purpose = f"a change of heading of {side * math.degrees(heading_rad):g} deg"
    chunk = max(1, helm.steps_to_a_length // 10)
    while side * helm.heading < heading_rad:
        helm.hold(rudder_rad, chunk, purpose)
    helm.hold(rudder_rad, 1, purpose)  # so that the track holds the end
    track = helm.track()
    turned = side * track["heading_rad"].to_numpy()
    over = side * track["cross_track_m"].to_numpy()

    def at(heading: float, values: Any) -> float:
        last = int(np.argmax(turned >= heading))
        before, after = turned[last - 1], turned[last]
        share = (heading - before) / (after - before)
        return float(values[last - 1] + share * (values[last] - values[last - 1]))

    rate = track["yaw_rate_rad_s"].to_numpy()
    speed = at(heading_rad, track["speed_m_s"].to_numpy())
    turning = at(heading_rad, rate)
    quarter_before = at(heading_rad - 0.5 * math.pi, rate)
    shaft = at(heading_rad, track["shaft_speed_rad_s"].to_numpy())
    return TurningCircle(
        rudder_rad=rudder_rad,
        length_m=helm.length,
        advance=at(0.5 * math.pi, track["position_m"].to_numpy()) / helm.length,
        transfer=at(0.5 * math.pi, over) / helm.length,
        tactical_diameter=at(math.pi, over) / helm.length,
        steady_diameter=2.0 * speed / abs(turning) / helm.length,
        speed_ratio=speed / helm.approach_speed,
        rate_of_turn=turning * helm.length / speed,
        drift_rad=at(heading_rad, track["drift_rad"].to_numpy()),
        shaft_speed_ratio=shaft / point.state.shaft_speed,
        unsteadiness=abs(turning / quarter_before - 1.0),
        track=track,
    )


def zig_zag(
    ship: Ship, point: Equilibrium, rudder_rad: float, heading_rad: float, executes: int = 5
) -> ZigZag:
    """Put the rudder over whenever the heading has changed by an angle, to either side in turn.

    The rudder is put over at the time step that begins nearest to the crossing, so an overshoot is
    known to half of what the ship turns in a time step.

    Args:
        ship: that turns.
        point: straight course from which she begins, as of :func:`shaftline.plant.approach`.
        rudder_rad: angle of the first execute [rad], positive turns to starboard.
        heading_rad: change of heading at which the rudder is put over [rad], positive.
        executes: how often it is laid, the first one included, 4 to 50.

    Raises:
        ShipError: an angle or number out of range; a ship that cannot be steered, comes to a stop, or
            does not reach the heading or check her swing within :data:`LONGEST` ship lengths.
    """
    if not 0.0 < heading_rad <= 0.5 * math.pi:
        raise ShipError(
            f"heading_rad = {heading_rad:g} is no angle of a zig-zag (unit rad; allowed: > 0 and <= "
            f"{0.5 * math.pi:g})"
        )
    if not 4 <= executes <= 50:
        raise ShipError(f"executes = {executes} (unit -; allowed: >= 4 and <= 50)")
    refuse_to_steer(ship)
    refuse_angle(ship, rudder_rad)
    helm, side = Helm(ship, point, LONGEST), math.copysign(1.0, rudder_rad)
    half_step = 0.5 * ship.time_step_s
    times, overshoots = [], []
    for execute in range(executes):
        sign = side * (-1.0) ** execute  # to which she is to turn
        times.append(helm.time_s)
        helm.order()
        if execute > 0:  # swings on before she obeys
            furthest = -sign * _end_of_swing(helm, sign * abs(rudder_rad))
            overshoots.append(math.degrees(furthest - heading_rad))
        last = execute == executes - 1
        reached = 0.0 if last else heading_rad
        purpose = f"a change of heading of {sign * math.degrees(reached):g} deg"
        while sign * (helm.heading + half_step * helm.yaw_rate) < reached:
            helm.hold(sign * abs(rudder_rad), 1, purpose)
    track = helm.track()
    first = int(np.argmax(side * track["heading_rad"].to_numpy() >= heading_rad))
    return ZigZag(
        rudder_rad, heading_rad, tuple(overshoots), _way(track, side, heading_rad, first) / helm.length,
        times[-1] - times[-3], tuple(times), track,
    )  # fmt: skip


def _end_of_swing(helm: Helm, rudder: float) -> float:
    """Heading [rad] at which the rudder [rad] has checked a swing to the other side."""
    furthest = helm.heading
    while rudder * helm.yaw_rate < 0.0:
        helm.hold(rudder, 1, "the end of her swing")
        furthest = min(furthest, helm.heading) if rudder > 0.0 else max(furthest, helm.heading)
    return furthest


def _way(track: pd.DataFrame, side: float, heading: float, first: int) -> float:
    """Way [m] sailed until a heading [rad], which lies in the time step before a row."""
    steps = np.hypot(np.diff(track["position_m"]), np.diff(track["cross_track_m"]))
    turned = side * track["heading_rad"].to_numpy()
    share = (heading - turned[first - 1]) / (turned[first] - turned[first - 1])
    return float(np.sum(steps[: first - 1]) + share * steps[first - 1])


def spiral(ship: Ship, point: Equilibrium, angles: Sequence[float] = SPIRAL_ANGLES) -> Spiral:
    """Dieudonne's spiral: steady turns at one rudder angle after another, to port and back.

    Each angle is held until r' and the speed change by less than :data:`STEADY_RATE` and
    :data:`STEADY_SPEED` over a ship length, three times running. The loop's width is as fine as the
    steps between the angles at which she turns over.

    Args:
        ship: that turns.
        point: straight course from which she begins, as of :func:`shaftline.plant.approach`.
        angles: of the rudder [rad], from starboard to port, at least one to either side.

    Raises:
        ShipError: angles out of range or order; a ship that cannot be steered, comes to a stop, or turns
            at no steady rate within :data:`LONGEST` ship lengths.
    """
    refuse_to_steer(ship)
    for angle in angles:
        refuse_angle(ship, angle, amidships=True)
    falls = all(after < before for before, after in pairwise(angles))
    if len(angles) < 2 or not falls or not angles[0] > 0.0 > angles[-1]:
        raise ShipError(
            f"{ship.name}: angles = {list(angles)}: a spiral needs angles that fall from starboard to "
            "port (unit rad; allowed: first > 0, last < 0)"
        )
    helm, rows = Helm(ship, point, LONGEST), []
    for leg, order in (("to port", list(angles)), ("to starboard", list(angles)[::-1])):
        for angle in order:
            rows.append((angle, *_steady_turn(helm, angle), leg))
    curve = pd.DataFrame(rows, columns=["rudder_rad", "rate_of_turn", "speed_ratio", "leg"])
    branches = [part.sort_values("rudder_rad") for _, part in curve.groupby("leg", sort=False)]
    if not all(b["rate_of_turn"].iloc[0] < 0.0 < b["rate_of_turn"].iloc[-1] for b in branches):
        raise ShipError(f"{ship.name}: within the spiral's angles she turns to one side alone")
    there, back = ((b["rudder_rad"].to_numpy(), b["rate_of_turn"].to_numpy()) for b in branches)
    return Spiral(
        curve,
        math.degrees(_crossing(*back) - _crossing(*there)),
        float(np.interp(0.0, *there) - np.interp(0.0, *back)),
    )


def _crossing(angles: NDArray[np.float64], rates: NDArray[np.float64]) -> float:
    """Rudder angle at which the rate of turn changes its sign, between two angles in a straight line."""
    k = int(np.argmax(rates >= 0.0))
    share = -rates[k - 1] / (rates[k] - rates[k - 1])
    return float(angles[k - 1] + share * (angles[k] - angles[k - 1]))


def _steady_turn(helm: Helm, angle: float) -> tuple[float, float]:
    """Rate r' and share of the approach's speed [-] of the steady turn at a rudder angle [rad]."""
    helm.order()
    rate, speed, calm = math.inf, math.inf, 0
    while calm < 3:
        helm.hold(angle, helm.steps_to_a_length, "a steady turn")
        rate_before, speed_before = rate, speed
        rate = helm.yaw_rate * helm.length / helm.speed()
        speed = helm.speed() / helm.approach_speed
        steady = abs(rate - rate_before) < STEADY_RATE and abs(speed - speed_before) < STEADY_SPEED
        calm = calm + 1 if steady else 0
    return rate, speed


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
