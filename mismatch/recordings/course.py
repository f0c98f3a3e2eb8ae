"""Turns, currents and errors of the speed log, from course, rudder and the two speeds of a ship.

A speed log measures the speed through water, satellite navigation the speed over ground. Along the
heading psi they differ by the current and by the error of the log::

    v_ground = v_log / gain + north cos(psi) + east sin(psi)

The current (north, east) and the gain can be estimated on two or more courses. On one course a current
and an error of the log are indistinguishable.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ...core.rows import true_runs
from ...plant.columns import COURSE, HEADING, OVER_GROUND, RUDDER, SHIP_SPEED, YAW_RATE
from .excitation import COURSE_CHANGE

Array = NDArray[np.float64]

ANGLES = (COURSE, HEADING, "wind_angle_rad", "true_wind_angle_rad")
"""Columns whose values may jump by a full turn."""

TURN = math.radians(10.0)
"""Change of heading [rad] within :data:`WINDOW_S` from which a ship turns."""
WINDOW_S = 60.0
"""Time [s] within which the heading changes in a turn."""
HARD_RUDDER = math.radians(10.0)
"""Deviation of the rudder [rad] from its median from which a ship manoeuvres."""

_BRIEF_S = 10.0  # a rudder that deviates for a shorter time steers against waves
_SLOWEST_S = 30.0  # interval [s] of the rows up to which a change of heading shows a turn
_UNDER_WAY = 0.5  # share of the median speed from which a row has a course
_SHARED_S = 60.0  # time [s] over which the errors of the two speeds are taken as one
_LEAST = 0.05  # smallest current or difference of speeds, as a share of the speed, that is reported
_LOG_ERROR = 0.01  # smallest error of the gain of a speed log that is reported
_COLLINEAR = 0.05  # mean square of the sine to their axis below which the courses lie on one line
_ERRORS = 3.0  # standard errors from which an estimate is significant


def interpolate(at: Array, time: Array, values: Array, column: str) -> Array:
    """Return finite values at other times, angles in the shorter direction and within one turn."""
    known = np.isfinite(values)
    if column not in ANGLES or not known.any():
        return np.asarray(np.interp(at, time[known], values[known]))
    low = min(0.0, float(np.floor(values[known].min() / math.pi)) * math.pi)
    angle = np.interp(at, time[known], np.unwrap(values[known]))
    return np.asarray(low + (angle - low) % (2.0 * math.pi))


def heading_of(columns: Mapping[str, Any]) -> Array | None:
    """Return the continuous heading [rad] of each row, else the course over ground, else None."""
    found = next((c for c in (HEADING, "heading", COURSE) if c in columns), None)
    if found is None:
        return None
    return np.asarray(np.unwrap(np.asarray(columns[found], dtype=np.float64)))


MOST_TURNS = 0.7
"""Share of turning rows above which too little is left of a recording without them."""


def turning_rows(time: Array, columns: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Return the rows in which a ship turns or holds a large rudder angle.

    The ship turns where its heading, or else its course or the integral of its rate of turn, changes by
    more than :data:`TURN` within :data:`WINDOW_S`. Rows more than 30 s apart show the rudder only.

    Example:
        >>> time = np.arange(0.0, 600.0)
        >>> heading = np.clip(0.02 * (time - 300.0), 0.0, 1.0)
        >>> rows = np.flatnonzero(turning_rows(time, {"heading_rad": heading}))
        >>> int(rows[0]), int(rows[-1])
        (280, 371)

    Args:
        time: time of each row [s], (n,), rising.
        columns: finite canonical columns, each (n,).
    """
    turns = np.zeros(len(time), np.bool_)
    steps = np.diff(time)
    if not (steps > 0.0).any():
        return turns
    interval = float(np.median(steps[steps > 0.0]))
    heading = heading_of(columns)
    if heading is None and YAW_RATE in columns:
        turned = np.asarray(columns[YAW_RATE], dtype=np.float64)[1:] * steps
        heading = np.concatenate([[0.0], np.cumsum(turned)])
    if heading is not None and interval <= _SLOWEST_S:
        smooth = scipy.ndimage.uniform_filter1d(
            heading, max(1, round(_BRIEF_S / interval)), mode="nearest"
        )
        half = WINDOW_S / 2.0
        change = np.interp(time + half, time, smooth) - np.interp(time - half, time, smooth)
        turns |= np.abs(change) > TURN
    if RUDDER in columns:
        rudder = np.asarray(columns[RUDDER], dtype=np.float64)
        brief = 2 * max(0, round(_BRIEF_S / interval / 2.0)) + 1
        middle = scipy.ndimage.median_filter(rudder - np.median(rudder), brief, mode="nearest")
        hard = np.abs(middle) > HARD_RUDDER
        if interval <= _SLOWEST_S:
            hard = scipy.ndimage.binary_dilation(hard, iterations=brief)
        turns |= hard
    return turns


def turn_remark(time: Array, columns: Mapping[str, Any]) -> str:
    """Return a remark on the turns of a recording of a ship that is simulated straight ahead, or ""."""
    rows = turning_rows(time, columns)
    if not rows.any():
        return ""
    first, end = true_runs(rows)[0]
    advice = "Set leave_out_turns = true under [rows] in the column map"
    if rows.mean() > MOST_TURNS:
        advice = "Use a ship file with [manoeuvring] and [rudder], or record a straight course"
    return (
        f"the ship turns or holds a large rudder angle in {rows.mean():.1%} of the rows "
        f"(first in rows {first + 1} to {end}), and the ship model runs straight ahead: the speed lost "
        f"in a turn looks like resistance. {advice}"
    )


class Current(NamedTuple):
    """Current and gain of a speed log, estimated on several courses.

    Attributes:
        north: current to the north [m/s].
        east: current to the east [m/s].
        gain: measured over true speed through water.
        error: standard error of each component of the current [m/s].
        gain_error: standard error of the gain.
        along: whether the courses lie on one line, so that only the current along it is known.
    """

    north: float
    east: float
    gain: float
    error: float
    gain_error: float
    along: bool


def course_span(heading: Array) -> float:
    """Return the largest angle [rad] between two of the headings of a ship, 0 to pi."""
    apart = np.angle(np.exp(1j * (heading - heading[0])))
    return float(min(np.ptp(apart), math.pi))


def estimate_current(time: Array, columns: Mapping[str, Any]) -> Current | None:
    """Estimate current and log error; None without two speeds and two courses 30 degrees apart.

    Example:
        >>> heading = np.repeat([0.5, 0.5 + np.pi], 300)
        >>> through = np.full(600, 8.0)
        >>> ground = through + 0.7 * np.cos(heading - 1.0)
        >>> columns = {"speed_over_ground_m_s": ground, "ship_speed_m_s": 1.03 * through,
        ...            "heading_rad": heading, "course_over_ground_rad": heading}
        >>> found = estimate_current(np.arange(600.0), columns)
        >>> round(found.gain, 3)
        1.03

    Args:
        time: time of each row [s], (n,).
        columns: finite canonical columns, each (n,): both speeds, heading or course.
    """
    heading = heading_of(columns)
    if heading is None or not {OVER_GROUND, SHIP_SPEED} <= set(columns):
        return None
    ground, log = (np.asarray(columns[c], dtype=np.float64) for c in (OVER_GROUND, SHIP_SPEED))
    drift = np.zeros(len(time))
    if HEADING in columns and COURSE in columns:
        drift = np.asarray(columns[COURSE], dtype=np.float64) - heading
    used = (ground > _UNDER_WAY * np.median(ground)) & (log > _UNDER_WAY * np.median(log))
    used &= ~turning_rows(time, columns)
    if used.sum() < 4 or course_span(heading[used]) < COURSE_CHANGE:
        return None
    along = (ground * np.cos(drift))[used]
    size, rows = float(np.median(log[used])), int(used.sum())
    ahead = np.column_stack([np.cos(heading[used]), np.sin(heading[used])])
    shares, axes = np.linalg.eigh(ahead.T @ ahead / rows)
    axes = axes if shares[0] > _COLLINEAR else axes[:, 1:]
    design = np.column_stack([log[used] / size, ahead @ axes])
    found = np.linalg.lstsq(design, along)[0]
    step, mean = float(np.median(np.diff(time))), float(np.mean((along - design @ found) ** 2))
    independent = max(rows * min(1.0, step / _SHARED_S), 3.0)
    spread = np.sqrt(np.diag(np.linalg.pinv(design.T @ design)) * rows / independent * mean)
    gain, (north, east) = size / float(found[0]), axes @ found[1:]
    error = float(spread[0]) * gain**2 / size
    if HEADING not in columns:  # The course differs from the heading by the drift of the current.
        error += 0.5 * (math.hypot(north, east) / size) ** 2
    return Current(
        float(north), float(east), gain, float(max(spread[1:])), error, axes.shape[1] == 1
    )


def speeds_remark(time: Array, columns: Mapping[str, Any]) -> str:
    """Return a remark on the speeds over ground and through water where they differ, or ""."""
    if not {OVER_GROUND, SHIP_SPEED} <= set(columns):
        return ""
    ground, log = (np.asarray(columns[c], dtype=np.float64) for c in (OVER_GROUND, SHIP_SPEED))
    usual = float(np.median(np.abs(log)))
    found = estimate_current(time, columns)
    if found is None:
        apart = float(np.median(ground - log))
        if abs(apart) < _LEAST * usual:
            return ""
        return (
            f"{OVER_GROUND} differs from {SHIP_SPEED} by {apart:+.2f} m/s on average: a current or an "
            "error of the speed log, which one course cannot distinguish; record a run on the opposite "
            "course"
        )
    speed = math.hypot(found.north, found.east)
    direction = math.degrees(math.atan2(found.east, found.north)) % 360.0
    parts = []
    if speed > max(_LEAST * usual / 2.0, _ERRORS * found.error):
        part = " (along the courses; across them it is not known)" if found.along else ""
        parts.append(f"a current of {speed:.2f} m/s towards {direction:.0f} degrees{part}")
    if abs(found.gain - 1.0) > max(_LOG_ERROR, _ERRORS * found.gain_error):
        parts.append(
            f"a speed log that shows {found.gain:.3f} times the speed through water (standard error "
            f"{found.gain_error:.1g}); scale = {1.0 / found.gain:.4f} in the column map corrects it"
        )
    if not parts:
        return ""
    return f"{OVER_GROUND} and {SHIP_SPEED} on several courses show {' and '.join(parts)}"


def has_several_courses(recordings: Iterable[Mapping[str, Any]]) -> bool:
    """Return whether the courses of recordings, given by their columns, differ by 30 degrees or more."""
    headings = [found for one in recordings if (found := heading_of(one)) is not None]
    return bool(headings) and course_span(np.concatenate(headings)) > COURSE_CHANGE


SEVERAL_COURSES = (
    "a current acts with another sign on each of several courses, and the speed over ground has it: use "
    "the speed through water, or the rows of one course"
)
"""Warning on a speed over ground on several courses."""


def over_ground_warning(parts: Sequence[Mapping[str, Any]]) -> str:
    """Return the warning that the speed over ground stands for the speed through water.

    The parts of the recording are given by their columns.
    """
    said = f"{SHIP_SPEED} is the speed over ground: a current looks like an effect on the hull"
    return f"{said}. {SEVERAL_COURSES.capitalize()}" if has_several_courses(parts) else said


def wind_signals(columns: Mapping[str, Any]) -> dict[str, Array]:
    """Return the wind from ahead and from port [m/s] that the recorded wind gives, by signal name.

    The apparent wind is used, else the true wind with the speed over ground.
    """
    for speed, angle, own in (
        ("wind_speed_m_s", "wind_angle_rad", None),
        ("true_wind_speed_m_s", "true_wind_angle_rad", OVER_GROUND),
    ):
        if {speed, angle, own or speed} <= set(columns):
            size, from_ahead = (np.asarray(columns[c], dtype=np.float64) for c in (speed, angle))
            moving = 0.0 if own is None else np.asarray(columns[own], dtype=np.float64)
            return {
                "head_wind": size * np.cos(from_ahead) + moving,
                "side_wind": -size * np.sin(from_ahead),
            }
    return {}
