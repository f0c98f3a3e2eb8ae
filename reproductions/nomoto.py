"""Fit Nomoto's first-order steering model to recordings, and compare manoeuvring models with it.

    T' (L / U) dr/dt + r = K' (U / L) (delta - delta_0)

(Nomoto et al. 1957, in ship lengths) at the measured speed U, and the sway of a ship that turns about a
fixed pivot point, v = -x_0 r.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.plant.columns import HEADING, RUDDER, SWAY_SPEED, TIME, YAW_RATE

SPEED = "ship_speed_m_s"
CHANNELS = (YAW_RATE, HEADING, SWAY_SPEED, SPEED)
"""Compared channels, in the order of the tables."""

TITLES = {
    YAW_RATE: "rate of turn, deg/s",
    HEADING: "heading, deg",
    SWAY_SPEED: "sway, m/s",
    SPEED: "speed ahead, m/s",
}
"""Titles of the channels in tables."""

LEAST_SPEED = 0.05
"""Lower limit of U over the highest speed of a recording."""

Floats = NDArray[np.float64]


class Response(NamedTuple):
    """Parameters of Nomoto's model."""

    gain: float  # K' [-]
    time: float  # T' [-]
    neutral: float  # delta_0, the rudder angle that holds a course [rad]
    pivot: float  # x_0 / L, forward of midship [-]


@compiled
def _turn(speed: Floats, rudder: Floats, step: float, first: float, k: Floats) -> Floats:
    """Return the rates of turn [rad/s]; ``k`` is gain, time and neutral angle.

    Each step is exact for the speed and rudder at its start.
    """
    found = np.empty(len(speed))
    found[0] = first
    for i in range(len(speed) - 1):
        led = k[0] * speed[i] * (rudder[i] - k[2])
        found[i + 1] = led + (found[i] - led) * np.exp(-step * speed[i] / k[1])
    return found


def _rates(table: pd.DataFrame, length_m: float, numbers: Floats) -> Floats:
    """Return the rate of turn at each row [rad/s], free-running from the first."""
    measured = table[SPEED].to_numpy(dtype=np.float64)
    speed = np.maximum(measured, LEAST_SPEED * measured.max()) / length_m  # lengths a second
    step = float(table[TIME].diff().mean())
    rudder = table[RUDDER].to_numpy(dtype=np.float64)
    return np.asarray(_turn(speed, rudder, step, float(table[YAW_RATE].iloc[0]), numbers))


def fit_response(tables: Iterable[pd.DataFrame], length_m: float) -> Response:
    """Fit the model to the rates of turn, and the pivot point to the sway, of some recordings.

    Args:
        tables: canonical columns, rudder angle positive for a turn to starboard.
        length_m: length of the ship [m].
    """
    known = list(tables)

    def residuals(point: Floats) -> Floats:
        numbers = np.array([point[0], np.exp(point[1]), point[2]])
        parts = [_rates(t, length_m, numbers) - t[YAW_RATE].to_numpy() for t in known]
        return np.concatenate(parts)

    best = scipy.optimize.least_squares(
        residuals, [1.0, 0.0, 0.0], x_scale=[0.3, 0.3, 0.03], loss="linear"
    )
    gain, time, neutral = float(best.x[0]), float(np.exp(best.x[1])), float(best.x[2])
    rates = np.concatenate([t[YAW_RATE] for t in known])
    sway = np.concatenate([t[SWAY_SPEED] for t in known])
    return Response(gain, time, neutral, -float(rates @ sway / (rates @ rates)) / length_m)


def simulate_response(response: Response, table: pd.DataFrame, length_m: float) -> pd.DataFrame:
    """Return rate of turn, heading and sway by the rudder, speed and first row of a recording."""
    numbers = np.array(response[:3])
    rate = _rates(table, length_m, numbers)
    step = float(table[TIME].diff().mean())
    turned = np.concatenate([[0.0], np.cumsum(0.5 * step * (rate[1:] + rate[:-1]))])
    return pd.DataFrame(
        {
            TIME: table[TIME].to_numpy(),
            YAW_RATE: rate,
            HEADING: float(table[HEADING].iloc[0]) + turned,
            SWAY_SPEED: -response.pivot * length_m * rate,
        }
    )


def rms(difference: Any) -> float:
    """Return the root mean square of a difference."""
    return float(np.sqrt(np.mean(np.square(np.asarray(difference)))))


def run_errors(
    simulate: Callable[[pd.DataFrame], pd.DataFrame], tables: Mapping[str, pd.DataFrame]
) -> pd.DataFrame:
    """Return the rms error of each simulated channel, a row for each run.

    Args:
        simulate: free-running simulation of a run from its first row.
        tables: measured runs with canonical columns.
    """
    rows = {}
    for name, table in tables.items():
        simulated = simulate(table)
        rows[name] = {c: rms(simulated[c] - table[c]) for c in CHANNELS if c in simulated}
    return pd.DataFrame(rows).T


def response_errors(
    response: Response, tables: Mapping[str, pd.DataFrame], length_m: float
) -> pd.DataFrame:
    """Return the rms errors of Nomoto's model, which has no speed of its own."""
    return run_errors(lambda table: simulate_response(response, table, length_m), tables)


def mean_errors(errors: pd.DataFrame, names: tuple[str, ...]) -> pd.Series:
    """Return the root mean square over runs, equally weighted."""
    return np.sqrt((errors.loc[list(names)] ** 2).mean())


def format_error(channel: str, value: float, heading_digits: int) -> str:
    """Return an error as text; angles in degrees."""
    if channel in (YAW_RATE, HEADING):
        return f"{np.degrees(value):.{2 if channel == YAW_RATE else heading_digits}f}"
    return f"{value:.4f}"


def errors_table(
    errors: Mapping[str, pd.DataFrame],
    groups: Mapping[str, tuple[str, ...]],
    titles: Mapping[str, str],
    heading_digits: int,
) -> pd.DataFrame:
    """Return the errors as text, a row for each model and group of runs.

    Args:
        errors: rms errors by name of the model, a row for each run.
        groups: names of runs by name of the group.
        titles: titles of the channels.
        heading_digits: digits of the heading.
    """
    rows = []
    for what, own in errors.items():
        for group, names in groups.items():
            means = mean_errors(own, names)
            shown = {
                title: format_error(c, means[c], heading_digits) if c in means else ""
                for c, title in titles.items()
            }
            rows.append({"ship": what, "runs": group, **shown})
    return pd.DataFrame(rows)
