"""One working point of propeller and engine as the CPP optimiser sees it, and a search over many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import torque_limit
from ..plant.fuel import fuel_rate
from ..plant.open_water import REVOLUTIONS_PER_RADIAN, advance_ratio
from ..plant.shaft import brake_torque_of, load_torque
from .combinator import TORQUE_MARGIN
from .open_water_fit import highest_j, surface, surface_slope


class Working(NamedTuple):
    """One propeller and its engine at an advance speed, shaft speed and pitch, by the fit."""

    thrust: float  # [N]
    torque_share: float  # brake torque / torque limit [-]
    cost: float  # fuel [kg/s], or brake power [W] without a fuel model, of one engine
    efficiency_slope: float  # d eta_o / d J [-]
    burrill: float  # tau_c / tau_limit [-]
    advance_room: float  # J_max(p) - J [-]


@compiled
def working(
    plant: Record,
    thrust: NDArray[np.float64],
    torque: NDArray[np.float64],
    advance_velocity: float,
    shaft_speed: float,
    pitch_ratio: float,
) -> Working:
    """Thrust, load, cost and margins of one working point.

    Args:
        plant: ship record.
        thrust: matrix A of the open-water fit.
        torque: matrix B.
        advance_velocity: v_a [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
    """
    j = advance_ratio(advance_velocity, shaft_speed, plant.diameter)
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    kt, kq = surface(thrust, j, pitch_ratio), surface(torque, j, pitch_ratio)
    force = plant.density * plant.diameter**4 * n * n
    load = kq * force * plant.diameter / plant.relative_rotative_efficiency
    brake = brake_torque_of(plant, load_torque(plant, load, shaft_speed), shaft_speed)
    engine_speed = plant.gear_ratio * shaft_speed
    cost = fuel_rate(plant, engine_speed, brake)
    if plant.fuel_base <= 0.0:
        cost = brake * engine_speed
    kt_slope, kq_slope = (
        surface_slope(thrust, j, pitch_ratio),
        surface_slope(torque, j, pitch_ratio),
    )
    slope = REVOLUTIONS_PER_RADIAN * ((kt + j * kt_slope) * kq - j * kt * kq_slope) / (kq * kq)
    margin = burrill_ratio(
        plant, kt * force, advance_velocity, shaft_speed, pitch_ratio, plant.depth
    )
    share = brake / torque_limit(plant, engine_speed)
    return Working(kt * force, share, cost, slope, margin, highest_j(pitch_ratio) - j)


@compiled
def slack(w: Working, torque_share: float = TORQUE_MARGIN) -> float:
    """Distance to the nearest inequality constraint; negative where one is broken.

    Args:
        w: working point.
        torque_share: highest allowed brake torque / torque limit [-].
    """
    engine, cavitation = torque_share - w.torque_share, 1.0 - w.burrill
    return min(min(engine, cavitation), min(w.efficiency_slope, w.advance_room))


@compiled
def search(
    plant: Record,
    thrust: NDArray[np.float64],
    torque: NDArray[np.float64],
    advance_velocity: float,
    shaft_speeds: NDArray[np.float64],
    pitch_ratios: NDArray[np.float64],
    torque_share: float,
    found: NDArray[np.float64],
) -> int:
    """Fill rows (omega, p, thrust, cost) of all allowed settings of a grid; gives their number."""
    count = 0
    for shaft_speed in shaft_speeds:
        for pitch_ratio in pitch_ratios:
            w = working(plant, thrust, torque, advance_velocity, shaft_speed, pitch_ratio)
            if w.thrust > 0.0 and slack(w, torque_share) >= 0.0:
                found[count, 0], found[count, 1] = shaft_speed, pitch_ratio
                found[count, 2], found[count, 3] = w.thrust, w.cost
                count += 1
    return count
