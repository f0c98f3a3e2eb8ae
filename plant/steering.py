"""Steering in numbers: the linear equations of sway and yaw, and Nomoto's first order of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.lazy import control
from .helm import refuse_to_steer
from .linear import linearise
from .ship import Ship, ShipError
from .steady_state import Equilibrium


class Nomoto(NamedTuple):
    """T dr/dt + r = K delta of a ship (Nomoto et al. 1957), in ship lengths at her speed.

    Args:
        gain: K, rate of turn [rad per ship length] by rudder angle [rad].
        time: T = T1 + T2 - T3 [ship lengths].
        poles: of sway and yaw [per ship length]; the ship holds her course where both lie to the left.
        zero: of rate of turn by rudder angle [per ship length].
    """

    gain: float
    time: float
    poles: tuple[complex, complex]
    zero: float


def steered(ship: Ship, point: Equilibrium) -> control.StateSpace:
    """Sway speed and rate of turn by the rudder's angle, linear about straight sailing.

    Args:
        ship: that turns.
        point: where, from :func:`shaftline.plant.equilibrium`.

    Returns:
        States and outputs sway speed [m/s] and yaw rate [rad/s]; the input is the angle [rad] itself.

    Raises:
        ShipError: a ship that does not turn, or has no rudder.
    """
    refuse_to_steer(ship)
    prompt = ship.with_values({"rudder.time_constant_s": 0.0, "rudder.rate_limit_rad_s": np.inf})
    whole = linearise(prompt, point, outputs=("sway_speed", "yaw_rate"))
    kept = [whole.state_labels.index(name) for name in ("sway_speed", "yaw_rate")]
    helm = whole.input_labels.index("rudder_command")
    return control.ss(
        whole.A[np.ix_(kept, kept)], whole.B[kept][:, [helm]], np.eye(2), np.zeros((2, 1)),
        states=["sway_speed", "yaw_rate"], inputs=["rudder_angle"],
        outputs=["sway_speed", "yaw_rate"], name=ship.name,
    )  # fmt: skip


def nomoto(ship: Ship, point: Equilibrium) -> Nomoto:
    """Nomoto's first order of a ship, by the time constants of the second.

    Args:
        ship: that turns.
        point: from :func:`shaftline.plant.equilibrium`, sailing straight on.

    Raises:
        ShipError: as of :func:`steered`, or a ship at rest.
    """
    speed = point.state.ship_speed
    if not speed > 0.0:
        raise ShipError(f"{ship.name}: steering asks for a speed ahead, not {speed:g} m/s")
    lengths = ship.manoeuvring.length_m / speed  # seconds to a ship length
    turn = steered(ship, point)[1, 0]
    poles, (zero,) = turn.poles() * lengths, turn.zeros().real * lengths
    slow, fast = sorted(map(complex, poles), key=lambda pole: (-pole.real, pole.imag))
    time = -(1.0 / slow + 1.0 / fast).real + 1.0 / zero
    gain = float(np.real(turn.dcgain())) * lengths
    return Nomoto(gain, float(time), (slow, fast), float(zero))
