"""Manoeuvres of a ship: turning circle, zig-zag and spiral, and IMO's standards for them.

Definitions as in IMO's explanatory notes to the standards for ship manoeuvrability (MSC/Circ.1053). A
manoeuvre begins on a straight course in calm water, and the drive command stays constant. All results
are measured through the water, so a current does not change them. Rudder angles are positive if they
turn the ship to starboard; ship lengths are those between perpendiculars.

:func:`trials` simulates the manoeuvres of resolution MSC.137(76), section 5.3: turning circles at 35
degrees of rudder (or the largest angle of the ship), 10/10 and 20/20 zig-zags, each to both sides, and
a spiral. The stopping ability is not tested. The limits of the yaw checking ability depend on L/V, the
time in which the ship travels its own length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .columns import ROLL
from .helm import Helm, refuse_angle, require_steering
from .ship import Ship, ShipError
from .steady_state import Equilibrium

LONGEST = 200.0
"""Number of ship lengths after which a turn, one leg of a zig-zag or a spiral angle is given up."""

STEADY_RATE, STEADY_SPEED = 5e-5, 2e-4
"""Changes over a ship length below which a turn is steady: of r', and of the speed ratio."""

_TO_ONE_SIDE = [0.25, 0.5, 0.75, *np.arange(1.0, 5.5, 0.5).tolist(), 7.5, 10.0, 15.0, 20.0, 25.0]
SPIRAL_ANGLES = tuple(map(math.radians, [*_TO_ONE_SIDE[::-1], 0.0, *(-a for a in _TO_ONE_SIDE)]))
"""Rudder angles of a spiral [rad], from starboard to port."""


class Heel(NamedTuple):
    """Roll angles in a turning circle, positive towards the side in its name."""

    inward_rad: float  # largest towards the centre of the turn, as the rudder is put over [rad]
    outward_rad: float  # largest away from the centre [rad]
    steady_rad: float  # away from the centre at the end [rad]


class TurningCircle(NamedTuple):
    """Results of a turning circle with constant rudder."""

    rudder_rad: float  # rudder command [rad]
    length_m: float  # of the ship [m]
    advance: float  # distance along the initial course at a heading change of 90 deg [lengths]
    transfer: float  # distance across the initial course at 90 deg [lengths]
    tactical_diameter: float  # distance across the initial course at 180 deg [lengths]
    steady_diameter: float  # 2 U / r at the end [lengths]
    speed_ratio: float  # speed at the end / approach speed [-]
    rate_of_turn: float  # r' = r L / U at the end, positive to starboard [-]
    drift_rad: float  # at midship at the end, -atan(v / u) [rad]
    shaft_speed_ratio: float  # shaft speed at the end / at the approach [-]
    unsteadiness: float  # relative change of r over the last 90 deg of heading [-]
    track: pd.DataFrame  # row for each time step, as in helm.Helm.track
    heel: Heel | None = None  # of a ship with roll

    @property
    def metres(self) -> dict[str, float]:
        """Distances [m] by name."""
        names = ("advance", "transfer", "tactical_diameter", "steady_diameter")
        return {name: float(getattr(self, name)) * self.length_m for name in names}


class ZigZag(NamedTuple):
    """Results of a zig-zag."""

    rudder_rad: float  # angle of the first execute [rad]
    heading_rad: float  # heading change at which the rudder is put over [rad]
    overshoots_deg: tuple[float, ...]  # of the heading, after each execute from the second on [deg]
    initial_turning: float  # way until the heading has changed by heading_rad [lengths]
    period_s: float  # between the last two executes to the same side [s]
    executes_s: tuple[float, ...]  # times of the executes [s]
    track: pd.DataFrame  # row for each time step, as in helm.Helm.track


class Spiral(NamedTuple):
    """Steady rates of turn over rudder angles, from starboard to port and back.

    A course-unstable ship has two steady rates of turn at small angles and takes the one on the side
    from which it comes: the two branches form a hysteresis loop.
    """

    # columns rudder_rad, rate_of_turn [-], speed_ratio [-], and the direction of the rudder sweep
    curve: pd.DataFrame
    width_deg: float  # width of the loop, between the angles at which r' changes its sign [deg]
    height: float  # height of the loop with the rudder amidships [-]


def turning_circle(
    ship: Ship, point: Equilibrium, rudder_rad: float, heading_rad: float = 3.0 * math.pi
) -> TurningCircle:
    """Simulate a turning circle with constant rudder.

    Args:
        ship: ship with sway and yaw.
        point: straight course from which the turn begins, as of :func:`shaftline.plant.approach`.
        rudder_rad: rudder command [rad]; a positive angle turns to starboard.
        heading_rad: heading change at which the turn ends [rad], at least pi.

    Returns:
        Distances in ship lengths, interpolated linearly between time steps.

    Raises:
        ShipError: an angle is out of range, or the ship cannot be steered, stops, turns to the other
            side or does not complete the turn within :data:`LONGEST` ship lengths.

    >>> import math
    >>> from shaftline.plant import approach, load_ship, turning_circle
    >>> ship = load_ship("kvlcc2")
    >>> turn = turning_circle(ship, approach(ship, 1.179), math.radians(35.0), math.pi)
    >>> round(turn.advance, 2), round(turn.tactical_diameter, 2)  # [ship lengths]
    (3.05, 3.09)
    """
    if not math.pi <= heading_rad <= 20.0 * math.pi:
        raise ShipError(
            f"heading_rad = {heading_rad:g} is too small or too large for a turning circle (unit rad; "
            f"allowed: >= {math.pi:g} and <= {20.0 * math.pi:g})"
        )
    require_steering(ship)
    refuse_angle(ship, rudder_rad)
    helm, side = Helm(ship, point, LONGEST), math.copysign(1.0, rudder_rad)
    purpose = f"a change of heading of {side * math.degrees(heading_rad):g} deg"
    chunk = max(1, helm.steps_to_a_length // 10)
    while side * helm.heading < heading_rad:
        helm.hold(rudder_rad, chunk, purpose)
    helm.hold(rudder_rad, 1, purpose)  # The track must contain the end of the turn.
    track = helm.track()
    turned = side * track["heading_rad"].to_numpy()

    def at(heading: float, column: str) -> float:
        values = track[column].to_numpy()
        last = int(np.argmax(turned >= heading))
        before, after = turned[last - 1], turned[last]
        share = (heading - before) / (after - before)
        return float(values[last - 1] + share * (values[last] - values[last - 1]))

    speed, turning = at(heading_rad, "speed_m_s"), at(heading_rad, "yaw_rate_rad_s")
    quarter_before = at(heading_rad - 0.5 * math.pi, "yaw_rate_rad_s")
    shaft = at(heading_rad, "shaft_speed_rad_s")
    return TurningCircle(
        rudder_rad=rudder_rad,
        length_m=helm.length,
        advance=at(0.5 * math.pi, "position_m") / helm.length,
        transfer=side * at(0.5 * math.pi, "cross_track_m") / helm.length,
        tactical_diameter=side * at(math.pi, "cross_track_m") / helm.length,
        steady_diameter=2.0 * speed / abs(turning) / helm.length,
        speed_ratio=speed / helm.approach_speed,
        rate_of_turn=turning * helm.length / speed,
        drift_rad=at(heading_rad, "drift_rad"),
        shaft_speed_ratio=shaft / point.state.shaft_speed,
        unsteadiness=abs(turning / quarter_before - 1.0),
        track=track,
        heel=_heel(side * track[ROLL], side * at(heading_rad, ROLL)) if ship.rolls else None,
    )


def _heel(inward: pd.Series, last: float) -> Heel:
    """Return the heel from the roll angles towards the centre of the turn, and that at its end [rad]."""
    return Heel(max(float(inward.max()), 0.0), max(float(-inward.min()), 0.0), -last)


def zig_zag(
    ship: Ship, point: Equilibrium, rudder_rad: float, heading_rad: float, executes: int = 5
) -> ZigZag:
    """Simulate a zig-zag: put the rudder over whenever the heading has changed by an angle.

    The rudder is put over at the time step that begins nearest to the crossing. An overshoot is
    therefore exact to half of the heading change in one time step.

    Args:
        ship: ship with sway and yaw.
        point: straight course from which the zig-zag begins, as of :func:`shaftline.plant.approach`.
        rudder_rad: rudder angle of the first execute [rad]; a positive angle turns to starboard.
        heading_rad: heading change at which the rudder is put over [rad], positive.
        executes: number of executes, the first one included, 4 to 50.

    Raises:
        ShipError: an angle or number is out of range, or the ship cannot be steered, stops, does not
            reach the heading or does not stop turning within :data:`LONGEST` ship lengths.

    >>> import math
    >>> from shaftline.plant import approach, load_ship, zig_zag
    >>> ship, ten = load_ship("kvlcc2"), math.radians(10.0)
    >>> found = zig_zag(ship, approach(ship, 1.179), ten, ten, executes=4)
    >>> [round(overshoot, 1) for overshoot in found.overshoots_deg]  # [deg]
    [5.0, 13.8, 9.4]
    """
    if not 0.0 < heading_rad <= 0.5 * math.pi:
        raise ShipError(
            f"heading_rad = {heading_rad:g} is not allowed in a zig-zag (unit rad; allowed: > 0 and <= "
            f"{0.5 * math.pi:g})"
        )
    if not 4 <= executes <= 50:
        raise ShipError(f"executes = {executes} is out of range (unit -; allowed: >= 4 and <= 50)")
    require_steering(ship)
    refuse_angle(ship, rudder_rad)
    helm, side = Helm(ship, point, LONGEST), math.copysign(1.0, rudder_rad)
    half_step = 0.5 * ship.time_step_s
    times, overshoots = [], []
    for execute in range(executes):
        sign = side * (-1.0) ** execute  # side to which the ship shall turn
        times.append(helm.time_s)
        helm.begin_command()
        if execute > 0:  # The ship turns on to the other side before it obeys the rudder.
            furthest = -sign * _furthest_heading(helm, sign * abs(rudder_rad))
            overshoots.append(math.degrees(furthest - heading_rad))
        last = execute == executes - 1
        reached = 0.0 if last else heading_rad
        purpose = f"a change of heading of {sign * math.degrees(reached):g} deg"
        while sign * (helm.heading + half_step * helm.yaw_rate) < reached:
            helm.hold(sign * abs(rudder_rad), 1, purpose)
    track = helm.track()
    first = int(np.argmax(side * track["heading_rad"].to_numpy() >= heading_rad))
    return ZigZag(
        rudder_rad,
        heading_rad,
        tuple(overshoots),
        _way(track, side, heading_rad, first) / helm.length,
        times[-1] - times[-3],
        tuple(times),
        track,
    )


def _furthest_heading(helm: Helm, rudder: float) -> float:
    """Return the heading [rad] at which the rudder [rad] has stopped a turn to the other side."""
    furthest = helm.heading
    while rudder * helm.yaw_rate < 0.0:
        helm.hold(rudder, 1, "the end of its turn")
        furthest = min(furthest, helm.heading) if rudder > 0.0 else max(furthest, helm.heading)
    return furthest


def _way(track: pd.DataFrame, side: float, heading: float, first: int) -> float:
    """Return the way [m] until a heading [rad] that is reached in the time step before a row."""
    steps = np.hypot(np.diff(track["position_m"]), np.diff(track["cross_track_m"]))
    turned = side * track["heading_rad"].to_numpy()
    share = (heading - turned[first - 1]) / (turned[first] - turned[first - 1])
    return float(np.sum(steps[: first - 1]) + share * steps[first - 1])


def spiral(ship: Ship, point: Equilibrium, angles: Sequence[float] = SPIRAL_ANGLES) -> Spiral:
    """Simulate Dieudonne's spiral: steady turns at a sequence of rudder angles, to port and back.

    Each angle is held until r' and the speed change by less than :data:`STEADY_RATE` and
    :data:`STEADY_SPEED` over a ship length, three times in succession. The resolution of the loop's
    width is the step between the angles.

    Args:
        ship: ship with sway and yaw.
        point: straight course from which the spiral begins, as of :func:`shaftline.plant.approach`.
        angles: rudder angles [rad], from starboard to port, at least one to either side.

    Raises:
        ShipError: angles out of range or order, or the ship cannot be steered, stops, or reaches no
            steady turn within :data:`LONGEST` ship lengths.
    """
    require_steering(ship)
    for angle in angles:
        refuse_angle(ship, angle, amidships=True)
    falls = all(after < before for before, after in pairwise(angles))
    if len(angles) < 2 or not falls or not angles[0] > 0.0 > angles[-1]:
        raise ShipError(
            f"{ship.name}: angles = {list(angles)}: the angles of a spiral must fall from starboard to "
            "port (unit rad; allowed: first > 0, last < 0)"
        )
    helm, rows = Helm(ship, point, LONGEST), []
    for leg, order in (("to port", list(angles)), ("to starboard", list(angles)[::-1])):
        rows += [(angle, *_steady_turn(helm, angle), leg) for angle in order]
    curve = pd.DataFrame(rows, columns=["rudder_rad", "rate_of_turn", "speed_ratio", "leg"])
    branches = [part.sort_values("rudder_rad") for _, part in curve.groupby("leg", sort=False)]
    if not all(b["rate_of_turn"].iloc[0] < 0.0 < b["rate_of_turn"].iloc[-1] for b in branches):
        raise ShipError(
            f"{ship.name}: the ship turns to one side only at these rudder angles; give larger ones"
        )
    there, back = ((b["rudder_rad"].to_numpy(), b["rate_of_turn"].to_numpy()) for b in branches)
    width = math.degrees(_crossing(*back) - _crossing(*there))
    return Spiral(curve, width, float(np.interp(0.0, *there) - np.interp(0.0, *back)))


def _crossing(angles: NDArray[np.float64], rates: NDArray[np.float64]) -> float:
    """Return the rudder angle at which the rate of turn changes its sign, by linear interpolation."""
    k = int(np.argmax(rates >= 0.0))
    share = -rates[k - 1] / (rates[k] - rates[k - 1])
    return float(angles[k - 1] + share * (angles[k] - angles[k - 1]))


def _steady_turn(helm: Helm, angle: float) -> tuple[float, float]:
    """Return r' and the speed ratio [-] of the steady turn at a rudder angle [rad]."""
    helm.begin_command()
    rate, speed, steady_lengths = math.inf, math.inf, 0
    while steady_lengths < 3:
        helm.hold(angle, helm.steps_to_a_length, "a steady turn")
        rate_before, speed_before = rate, speed
        rate = helm.yaw_rate * helm.length / helm.speed()
        speed = helm.speed() / helm.approach_speed
        steady = abs(rate - rate_before) < STEADY_RATE and abs(speed - speed_before) < STEADY_SPEED
        steady_lengths = steady_lengths + 1 if steady else 0
    return rate, speed


SIDES = {"starboard": 1.0, "port": -1.0}
ZIG_ZAGS = (10, 20)  # [deg]
HARD_OVER = math.radians(35.0)
MANOEUVRES = 2 + 2 * len(ZIG_ZAGS) + 1
"""Number of manoeuvres of :func:`trials`."""


class Trials(NamedTuple):
    """Results of the standard set of manoeuvres; a manoeuvre that failed is absent, with the reason."""

    ship: Ship
    speed_m_s: float  # approach speed through the water [m/s]
    turns: dict[str, TurningCircle]  # by side
    zig_zags: dict[tuple[int, str], ZigZag]  # by angle [deg] and side
    spiral: Spiral | None
    not_completed: dict[str, str]  # reason, by name of the manoeuvre

    def tracks(self) -> dict[str, pd.DataFrame]:
        """Return all tracks by a name that suits a file, and the curve of the spiral."""
        found = {f"turning-circle-{side}": turn.track for side, turn in self.turns.items()}
        for (angle, side), one in self.zig_zags.items():
            found[f"zig-zag-{angle}-{angle}-{side}"] = one.track
        return found | ({} if self.spiral is None else {"spiral": self.spiral.curve})

    def results(self) -> dict[str, Any]:
        """Return the results of all manoeuvres as plain numbers and names."""
        return {
            "ship": self.ship.name,
            "length_m": self.ship.manoeuvring.length_m,
            "speed_m_s": self.speed_m_s,
            "turning_circles": {
                side: _plain(turn) | {f"{name}_m": value for name, value in turn.metres.items()}
                for side, turn in self.turns.items()
            },
            "zig_zags": {
                f"{a}/{a} {side}": _plain(one) for (a, side), one in self.zig_zags.items()
            },
            "spiral": self.spiral
            and _plain(self.spiral) | {"curve": self.spiral.curve.to_dict("records")},
            "not_sailed": self.not_completed,
        }


def _plain(measured: TurningCircle | ZigZag | Spiral) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in measured._asdict().items():
        if isinstance(value, Heel):
            found[name] = value._asdict()
        elif value is not None and not isinstance(value, pd.DataFrame):
            found[name] = [*map(float, value)] if isinstance(value, tuple) else float(value)
    return found


def trials(ship: Ship, point: Equilibrium, tick: Callable[[], None] = lambda: None) -> Trials:
    """Simulate the standard set of manoeuvres.

    Args:
        ship: ship with sway and yaw; a ShipError says why it cannot be steered or does not move ahead.
        point: straight course from which each begins, as of :func:`shaftline.plant.approach`.
        tick: called after each of the :data:`MANOEUVRES`.
    """
    speed = Helm(ship, point, 0.0).approach_speed
    found = Trials(ship, speed, {}, {}, None, {})
    most = ship.rudder.angle_max_rad

    @contextmanager
    def attempt(name: str) -> Iterator[None]:
        try:
            yield
        except ShipError as error:
            found.not_completed[name] = str(error)
        tick()

    for side, sign in SIDES.items():
        with attempt(f"turning circle to {side}"):
            found.turns[side] = turning_circle(ship, point, sign * min(HARD_OVER, most))
        for angle in ZIG_ZAGS:
            rudder = math.radians(angle)
            with attempt(f"{angle}/{angle} zig-zag to {side}"):
                found.zig_zags[angle, side] = zig_zag(ship, point, sign * rudder, rudder)
    with attempt("spiral"):
        angles = [angle for angle in SPIRAL_ANGLES if abs(angle) <= most]
        found = found._replace(spiral=spiral(ship, point, angles))
    return found


def limits(length_over_speed_s: float) -> dict[str, float]:
    """Return the limits of MSC.137(76), 5.3.1 to 5.3.3, [ship lengths, deg] for L/V [s]."""
    time = float(np.clip(length_over_speed_s, 10.0, 30.0))  # The limits vary between these values.
    return {
        "advance": 4.5,
        "tactical diameter": 5.0,
        "initial turning, 10/10": 2.5,
        "first overshoot, 10/10": 5.0 + 0.5 * time,
        "second overshoot, 10/10": 17.5 + 0.75 * time,
        "first overshoot, 20/20": 25.0,
    }


def criteria(results: Trials, scale: float = 1.0) -> pd.DataFrame:
    """Compare the results of :func:`trials` with IMO's limits.

    ``scale`` is the length of the full-scale ship over that of the simulated model [-], above 0; L/V is
    proportional to its square root (Froude).

    Returns:
        Columns criterion, unit, starboard, port, limit, met: ``yes``, ``no``, or ``not completed``. A
        ship with roll has three more rows with the heel of the turning circles, for which IMO sets no
        limit: their ``limit`` is NaN and their ``met`` is ``no limit``.
    """
    if not 0.0 < scale < math.inf:
        raise ShipError(f"scale = {scale:g} is out of range (unit -; allowed: > 0)")
    length_over_speed = results.ship.manoeuvring.length_m / results.speed_m_s * math.sqrt(scale)
    rows = []
    for criterion, limit in limits(length_over_speed).items():
        pair = [_measured(results, criterion, side) for side in SIDES]
        met = "yes" if all(value <= limit for value in pair) else "no"
        if any(math.isnan(value) for value in pair):
            met = "not completed"
        unit = "deg" if "overshoot" in criterion else "L"
        rows.append((criterion, unit, *pair, limit, met))
    if results.ship.rolls:
        for k, quantity in enumerate(
            ("largest heel inward", "largest heel outward", "steady heel")
        ):
            heels = [getattr(results.turns.get(side), "heel", None) for side in SIDES]
            pair = [math.nan if heel is None else math.degrees(heel[k]) for heel in heels]
            met = "not completed" if None in heels else "no limit"
            rows.append((f"{quantity}, turn", "deg", *pair, math.nan, met))
    return pd.DataFrame(rows, columns=["criterion", "unit", *SIDES, "limit", "met"])


def _measured(results: Trials, criterion: str, side: str) -> float:
    """Return the value of one criterion to one side; NaN if the manoeuvre was not completed."""
    what, _, angles = criterion.partition(", ")
    if not angles:
        turn = results.turns.get(side)
        return math.nan if turn is None else float(getattr(turn, what.replace(" ", "_")))
    one = results.zig_zags.get((int(angles.split("/")[0]), side))
    if one is None:
        return math.nan
    if what == "initial turning":
        return one.initial_turning
    return one.overshoots_deg[0 if what.startswith("first") else 1]
