"""What a speed order means in calm water: shaft speed, pitch and thrust of the ship's steady states.

The usual combinator line: up to the highest pitch at idle speed, then up the shaft speed.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ..plant.ship import Ship
from ..plant.ship_sections import Diesel
from ..plant.steady_state import Equilibrium, equilibrium


class Setpoints(NamedTuple):
    """Set-points of ordered speeds, each of shape (n,)."""

    shaft_speed: NDArray[np.float64]  # [rad/s]
    pitch_ratio: NDArray[np.float64]  # [-]
    thrust: NDArray[np.float64]  # of one propeller [N]


class CalmWaterTable(NamedTuple):
    """Steady states in order of ship speed, each column of shape (m,)."""

    ship_speed: NDArray[np.float64]  # [m/s]
    setpoints: Setpoints

    def at(self, speed_order: NDArray[np.float64]) -> Setpoints:
        """Set-points for orders [m/s] of shape (n,); beyond the table its ends are held."""
        columns = (np.interp(speed_order, self.ship_speed, column) for column in self.setpoints)
        return Setpoints(*columns)


@functools.lru_cache(maxsize=64)
def calm_water_table(ship: Ship, points: int = 21) -> CalmWaterTable:
    """Steady states of a diesel ship from the lowest pitch at idle to its highest shaft speed.

    Args:
        ship: a moving ship with a diesel engine.
        points: how many on each branch of the line; 21 hold the thrust between them within 1 %.

    Raises:
        ValueError: the ship's hull is fixed or it has no diesel, or it cannot run at idle speed.
    """
    engine = ship.prime_mover
    if not isinstance(engine, Diesel) or ship.hull.fixed:
        raise ValueError(f"{ship.name}: a calm-water table needs a diesel engine and a moving hull")
    plant = ship.record()
    gear = float(plant["gear_ratio"])
    idle = float(plant["engine_speed_min"]) / gear
    top = float(plant["engine_speed_max"]) / gear
    rack_max = engine.rack_max_mm

    def at_idle(pitch_ratio: float) -> Equilibrium:
        def excess(rack: float) -> float:
            try:
                return float(equilibrium(ship, rack, pitch_ratio).state.shaft_speed) - idle
            except ValueError:
                return -idle  # too little fuel to turn the shaft at all

        # the rack that gives no torque at idle speed gives too little for the propeller
        motored = engine.torque_offset_N_m + engine.torque_per_speed_N_m_s_rad * idle * gear
        rack = brentq(excess, -motored / engine.torque_per_rack_N_m_mm, rack_max, xtol=1e-6)
        return equilibrium(ship, float(rack), pitch_ratio)

    pitches = np.linspace(ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max, points)
    states = [at_idle(float(pitch)) for pitch in pitches]
    first = states[-1].inputs.drive
    for rack in np.linspace(first, rack_max, points)[1:]:
        state = equilibrium(ship, float(rack), float(pitches[-1]))
        if state.state.shaft_speed > top:
            break
        states.append(state)
    rows = np.array(
        [
            (e.state.ship_speed, e.state.shaft_speed, e.state.pitch_ratio, e.outputs.thrust)
            for e in states
        ]
    )
    # where the torque limit holds the ship, more rack changes nothing
    rows = rows[np.concatenate([[True], np.diff(rows[:, 0]) > 1e-6])]
    speed, *columns = np.ascontiguousarray(rows.T)
    return CalmWaterTable(speed, Setpoints(*columns))
