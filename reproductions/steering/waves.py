"""Forces of waves on the surrogate, low-passed as in Taylor 2000, section 5.3.3.2.

The thesis prints neither the force nor the direction of its sea. Two published forces are tried:

- the second-order force of waves that the hull reflects, rho g a^2 / 2 for each metre and each
  reflected amplitude a (Maruo 1960), with the reflection of a vertical barrier of the ship's draught
  (Ursell 1947);
- the first-order force of the orbital accelerations on displaced water and added mass (Froude-Krylov
  and diffraction of long waves), integrated along the length, at the encounter frequency.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from shaftline.plant import Ship, get_sea, realise
from shaftline.plant.expressions import MAX_SIGNALS
from shaftline.plant.stepping import UNDISTURBED
from shaftline.plant.surroundings import GRAVITY

Floats = NDArray[np.float64]

STATE, BEAM_DEG = "state-4", 90.0
DRIFT_ARM = 0.1  # of the second-order force, before midship [ship lengths]; assumed
LOW_PASS_S = 20.0  # time constant of the filter; the thesis names a filter and prints none
STEP_S = 0.5


class WaveForce(NamedTuple):
    """A force of waves over time, each of shape (n,)."""

    time_s: Floats
    side_N: Floats  # to starboard
    yaw_N_m: Floats


def sea_from(ship: Ship, heading_deg: float, seed: int) -> Any:
    """Return the SEA record of state 4.

    Args:
        ship: whose propeller depth the record is for.
        heading_deg: 0 following, 90 on the beam, 180 head seas [deg].
        seed: of the phases.
    """
    sea = get_sea(STATE)
    assert sea is not None
    return realise(
        sea.model_copy(update={"heading_deg": heading_deg}), ship.propeller.depth_m, seed
    )


def reflected(frequency: Floats, draught_m: float) -> Floats:
    """Return the share of the amplitude that a vertical barrier reflects (Ursell 1947) [-].

    Args:
        frequency: of the waves [rad/s].
        draught_m: depth of the barrier's lower edge [m].
    """
    kd = frequency**2 / GRAVITY * draught_m
    wall = math.pi * scipy.special.i1(kd)
    return np.asarray(wall / np.sqrt(wall**2 + scipy.special.k1(kd) ** 2))


def low_passed(values: Floats) -> Floats:
    """Return values of every :data:`STEP_S` behind a first-order filter of :data:`LOW_PASS_S`."""
    keep = math.exp(-STEP_S / LOW_PASS_S)
    slow = np.empty_like(values)
    slow[0] = values.mean()
    for k in range(1, len(values)):
        slow[k] = keep * slow[k - 1] + (1.0 - keep) * values[k]
    return slow


def second_order(ship: Ship, sea: Any, seconds: float, wall: bool = False) -> WaveForce:
    """Return the slow force of the waves that the hull reflects on its beam.

    Args:
        ship: with length and draught.
        sea: SEA record.
        seconds: how long.
        wall: reflect every wave whole, as no hull does.
    """
    frequency, hull = sea["frequency"], ship.manoeuvring
    share = np.ones_like(frequency) if wall else reflected(frequency, hull.draught_m)
    time = np.arange(0.0, seconds, STEP_S)
    phases = np.exp(1j * (np.outer(time, frequency) + sea["phase"]))
    envelope = np.abs((sea["amplitude"] * share * phases).sum(axis=1))
    water = ship.water.density_kg_m3 * GRAVITY * hull.length_m
    side = 0.5 * water * low_passed(envelope**2)
    return WaveForce(time, side, DRIFT_ARM * hull.length_m * side)


def first_order(
    ship: Ship, sea: Any, seconds: float, heading_deg: float, speed_m_s: float
) -> WaveForce:
    """Return the slow part of the first-order force on a hull of one section over its length.

    Args:
        ship: with displacement and added mass in sway.
        sea: SEA record.
        seconds: how long.
        heading_deg: 0 following, 90 on the beam [deg].
        speed_m_s: of the ship, which meets the waves at w - w^2 U cos(heading) / g [m/s].
    """
    hull, frequency = ship.manoeuvring, sea["frequency"]
    angle, number = math.radians(heading_deg), frequency**2 / GRAVITY
    added = -hull.Y_vdot * 0.5 * ship.water.density_kg_m3 * hull.length_m**3
    depth = np.exp(-0.5 * number * hull.draught_m)
    force = (hull.displacement_kg + added) * sea["amplitude"] * frequency**2 * depth
    force = force * math.sin(angle)
    half = 0.5 * number * hull.length_m * math.cos(angle) + 1e-9  # phase from midship to the bow
    time = np.arange(0.0, seconds, STEP_S)
    met = frequency - number * speed_m_s * math.cos(angle)
    phases = np.outer(time, met) + sea["phase"]
    side = (force * np.sin(half) / half * np.sin(phases)).sum(axis=1)
    lever = 0.5 * hull.length_m * (np.sin(half) - half * np.cos(half)) / half**2
    yaw = (force * lever * np.cos(phases)).sum(axis=1)
    return WaveForce(time, low_passed(side), low_passed(yaw))


def pushed(ship: Ship, force: WaveForce) -> tuple[Ship, Callable[[float], Any]]:
    """Return the ship that a force acts on, and the disturbance by time [s]."""
    vessel = ship.with_values(
        {
            "signals": {"wave_force": "N", "wave_moment": "N m"},
            "term": [
                {"id": "wave-force", "acts_on": "side_force", "expression": "wave_force"},
                {"id": "wave-moment", "acts_on": "yaw_moment", "expression": "wave_moment"},
            ],
        }
    )

    def acting(time: float) -> Any:
        heard = [float(np.interp(time, force.time_s, part)) for part in force[1:]]
        return UNDISTURBED._replace(outside=(*heard, *(0.0,) * (MAX_SIGNALS - 2)))

    return vessel, acting
