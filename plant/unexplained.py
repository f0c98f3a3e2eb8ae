"""A torque, force or rate of unknown origin, as a function of one signal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled

BALANCES = ("engine", "propeller", "hull", "pitch-actuator")
"""Balances to which it may be added; ``plant.unexplained_balance`` counts them from 1, 0 is none."""

ENGINE, PROPELLER, HULL, PITCH_ACTUATOR = 1, 2, 3, 4

FOLLOWED = ("shaft_speed", "ship_speed", "pitch_ratio", "drive", "time")
"""Signals that it may follow; ``plant.unexplained_signal`` counts them from 0."""

MAX_KNOTS = 12


@compiled
def piecewise_linear(
    knots: NDArray[np.float64], values: NDArray[np.float64], count: int, x: Real
) -> Real:
    """Straight lines between the first ``count`` knots, held outside them."""
    last = count - 1
    if x.real < knots[0]:
        return values[0]
    for k in range(last):
        if x.real < knots[k + 1]:
            slope = (values[k + 1] - values[k]) / (knots[k + 1] - knots[k])
            return values[k] + slope * (x - knots[k])
    return values[last]


@compiled
def unexplained(
    plant: Record,
    shaft_speed: Real,
    ship_speed: Real,
    pitch_ratio: Real,
    drive: Real,
    time: Real,
) -> Real:
    """What the ship's balance lacks [N m | N | 1/s] at the present value of its signal.

    Args:
        plant: ship record.
        shaft_speed: omega [rad/s].
        ship_speed: v_s over ground [m/s].
        pitch_ratio: P/D of the blades [-].
        drive: fuel rack [mm], voltage [V] or torque [N m].
        time: since the start [s].
    """
    if plant.unexplained_signal == 0:
        x = shaft_speed
    elif plant.unexplained_signal == 1:
        x = ship_speed
    elif plant.unexplained_signal == 2:
        x = pitch_ratio
    elif plant.unexplained_signal == 3:
        x = drive
    else:
        x = time
    return piecewise_linear(
        plant.unexplained_knots, plant.unexplained_values, plant.unexplained_count, x
    )
