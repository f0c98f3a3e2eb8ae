"""Nomoto's first order of a ship's steering, fitted to recordings: the yardstick of fuller models.

    T' (L / U) dr/dt + r = K' (U / L) (delta - delta_0)

(Nomoto et al. 1957, in ship lengths), at the measured speed U, for the model has none of its own; and
the sway of a ship that turns about one point of her length, v = -x_0 r.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.plant.columns import HEADING, RUDDER, SWAY_SPEED, TIME, YAW_RATE

SPEED = "ship_speed_m_s"

LEAST_SPEED = 0.05
"""Share of a recording's highest speed that U is taken to have at least: at rest no rudder steers."""

Floats = NDArray[np.float64]


class Response(NamedTuple):
    """The numbers of the model."""

    gain: float  # K' [-]
    time: float  # T' [-]
    neutral: float  # delta_0, the rudder angle that holds a course [rad]
    pivot: float  # x_0 / L, forward of midship [-]


@compiled
def _turned(speed: Floats, rudder: Floats, step: float, first: float, k: Floats) -> Floats:
    """Rates of turn [rad per ship length's time]; ``k`` is gain, time and neutral angle.

    Each step is exact for the speed and the rudder that it begins with.
    """
    found = np.empty(len(speed))
    found[0] = first
    for i in range(len(speed) - 1):
        led = k[0] * speed[i] * (rudder[i] - k[2])
        found[i + 1] = led + (found[i] - led) * np.exp(-step * speed[i] / k[1])
    return found


def _rates(table: pd.DataFrame, length_m: float, numbers: Floats) -> Floats:
    """Rate of turn at each row [rad/s], free-running from the first."""
    measured = table[SPEED].to_numpy(dtype=np.float64)
    speed = np.maximum(measured, LEAST_SPEED * measured.max()) / length_m  # lengths a second
    step = float(table[TIME].diff().mean())
    rudder = table[RUDDER].to_numpy(dtype=np.float64)
    return np.asarray(_turned(speed, rudder, step, float(table[YAW_RATE].iloc[0]), numbers))


def fitted(tables: Iterable[pd.DataFrame], length_m: float) -> Response:
    """The response that comes nearest to the rates of turn, and then to the sway, of some recordings.

    Args:
        tables: canonical columns, the rudder's angle positive where it turns to starboard.
        length_m: of the ship.
    """
    known = list(tables)

    def missing(point: Floats) -> Floats:
        numbers = np.array([point[0], np.exp(point[1]), point[2]])
        parts = [_rates(t, length_m, numbers) - t[YAW_RATE].to_numpy() for t in known]
        return np.concatenate(parts)

    best = scipy.optimize.least_squares(
        missing, [1.0, 0.0, 0.0], x_scale=[0.3, 0.3, 0.03], loss="linear"
    )
    gain, time, neutral = float(best.x[0]), float(np.exp(best.x[1])), float(best.x[2])
    rates = np.concatenate([t[YAW_RATE] for t in known])
    sway = np.concatenate([t[SWAY_SPEED] for t in known])
    return Response(gain, time, neutral, -float(rates @ sway / (rates @ rates)) / length_m)


def sailed(response: Response, table: pd.DataFrame, length_m: float) -> pd.DataFrame:
    """Rate of turn, heading and sway of a recording, from its rudder, its speed and its first row."""
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
