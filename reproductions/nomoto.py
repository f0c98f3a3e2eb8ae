"""Fit Nomoto's first-order steering model to recordings, and compare manoeuvring models with it.

    T' (L / U) dr/dt + r = K' (U / L) (delta - delta_0)

(Nomoto et al. 1957, in ship lengths) at the measured speed U, and the sway of a ship that turns about a
fixed pivot point, v = -x_0 r.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.plant.columns import HEADING, RUDDER, SWAY_SPEED, TIME, YAW_RATE

from .writing import Panel, against_measured, rms

SPEED = "ship_speed_m_s"
CHANNELS = (YAW_RATE, HEADING, SWAY_SPEED, SPEED)  # compared channels, in the order of the tables
TITLES = {
    YAW_RATE: "rate of turn, deg/s",
    HEADING: "heading, deg",
    SWAY_SPEED: "sway, m/s",
    SPEED: "speed ahead, m/s",
}
"""Titles of the channels in tables."""

LEAST_SPEED = 0.05  # lower limit of U over the highest speed of a recording
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

    rates, sway = (np.concatenate([t[c] for t in known]) for c in (YAW_RATE, SWAY_SPEED))

    def residuals(point: Floats) -> Floats:
        numbers = np.array([point[0], np.exp(point[1]), point[2]])
        return np.asarray(np.concatenate([_rates(t, length_m, numbers) for t in known]) - rates)

    best = scipy.optimize.least_squares(residuals, [1.0, 0.0, 0.0], x_scale=[0.3, 0.3, 0.03])
    gain, time, neutral = float(best.x[0]), float(np.exp(best.x[1])), float(best.x[2])
    return Response(gain, time, neutral, -float(rates @ sway / (rates @ rates)) / length_m)


def simulate_response(response: Response, table: pd.DataFrame, length_m: float) -> pd.DataFrame:
    """Return rate of turn, heading and sway by the rudder, speed and first row of a recording."""
    rate = _rates(table, length_m, np.array(response[:3]))
    step = float(table[TIME].diff().mean())
    turned = scipy.integrate.cumulative_trapezoid(rate, dx=step, initial=0)
    return pd.DataFrame(
        {
            TIME: table[TIME].to_numpy(),
            YAW_RATE: rate,
            HEADING: float(table[HEADING].iloc[0]) + turned,
            SWAY_SPEED: -response.pivot * length_m * rate,
        }
    )


def run_errors(
    simulate: Callable[[pd.DataFrame], pd.DataFrame], tables: Mapping[str, pd.DataFrame]
) -> pd.DataFrame:
    """Return the rms error of each channel of free-running simulations, a row for each run."""
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


def mean_errors(errors: pd.DataFrame, names: Sequence[str]) -> pd.Series:
    """Return the root mean square over runs, equally weighted."""
    return np.sqrt((errors.loc[list(names)] ** 2).mean())


def format_error(channel: str, value: float, heading_digits: int) -> str:
    """Return an error as text; angles in degrees."""
    if channel in (YAW_RATE, HEADING):
        return f"{np.degrees(value):.{2 if channel == YAW_RATE else heading_digits}f}"
    return f"{value:.4f}"


def errors_table(
    errors: Mapping[str, pd.DataFrame],
    groups: Mapping[str, Sequence[str]],
    titles: Mapping[str, str],
    heading_digits: int,
) -> pd.DataFrame:
    """Return the errors as text, a row for each model and group of runs, a column for each title."""
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


def channel_panel(
    table: pd.DataFrame,
    simulated: Mapping[str, pd.DataFrame],
    channel: str,
    title: str,
    legend: int = 0,
) -> Panel:
    """Return the panel of a channel, measured and simulated; Nomoto's model is dotted."""
    factor = np.degrees(1.0) if channel == YAW_RATE else 1.0
    values = {what: factor * own[channel] for what, own in simulated.items()}
    lines = [
        line._replace(style=":") if line.label == "Nomoto" else line
        for line in against_measured(table[TIME], factor * table[channel], values)
    ]
    return Panel(lines, {"title": title, "ylabel": TITLES[channel]}, legend)
