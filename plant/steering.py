"""Steering: linear equations of sway and yaw, and Nomoto's first-order model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.lazy import control
from .helm import require_steering
from .linear import linearise
from .ship import Ship, ShipError
from .steady_state import Equilibrium


class Nomoto(NamedTuple):
    """Nomoto's model T dr/dt + r = K delta (Nomoto et al. 1957), in ship lengths at the present speed.

    The ship is course-stable if both poles are negative.
    """

    gain: float  # K, rate of turn [rad per ship length] / rudder angle [rad]
    time: float  # T = T1 + T2 - T3 [ship lengths]
    poles: tuple[complex, complex]  # of sway and yaw [per ship length]
    zero: float  # of the rate of turn over the rudder angle [per ship length]


def sway_yaw_model(ship: Ship, point: Equilibrium) -> control.StateSpace:
    """Return the linear model of sway speed [m/s] and rate of turn [rad/s] by the rudder angle [rad].

    The point is a steady straight course, from :func:`shaftline.plant.equilibrium`. A ship without sway
    and yaw, or without a rudder, raises a ShipError.
    """
    require_steering(ship)
    prompt = ship.with_values({"rudder.time_constant_s": 0.0, "rudder.rate_limit_rad_s": np.inf})
    whole = linearise(prompt, point, outputs=("sway_speed", "yaw_rate"))
    kept = [whole.state_labels.index(name) for name in ("sway_speed", "yaw_rate")]
    helm = whole.input_labels.index("rudder_command")
    return control.ss(
        whole.A[np.ix_(kept, kept)],
        whole.B[kept][:, [helm]],
        np.eye(2),
        np.zeros((2, 1)),
        states=["sway_speed", "yaw_rate"],
        inputs=["rudder_angle"],
        outputs=["sway_speed", "yaw_rate"],
        name=ship.name,
    )


def nomoto(ship: Ship, point: Equilibrium) -> Nomoto:
    """Return Nomoto's first-order model, from the time constants of the second-order one.

    Args:
        ship: ship with sway and yaw.
        point: steady straight course, from :func:`shaftline.plant.equilibrium`.

    Raises:
        ShipError: as in :func:`sway_yaw_model`, or the ship has no headway.

    >>> from shaftline.plant import approach, load_ship, nomoto
    >>> ship = load_ship("esso-osaka")
    >>> model = nomoto(ship, approach(ship, 4.0))
    >>> round(model.gain, 2), round(model.time, 2)  # K [1/length], T [lengths]
    (0.95, 1.33)
    """
    speed = point.state.ship_speed
    if not speed > 0.0:
        raise ShipError(
            f"{ship.name}: Nomoto's model needs a ship speed above 0 m/s, not {speed:g} m/s"
        )
    lengths = ship.manoeuvring.length_m / speed  # seconds per ship length
    turn = sway_yaw_model(ship, point)[1, 0]
    poles, (zero,) = turn.poles() * lengths, turn.zeros().real * lengths
    slow, fast = sorted(map(complex, poles), key=lambda pole: (-pole.real, pole.imag))
    time = -(1.0 / slow + 1.0 / fast).real + 1.0 / zero
    gain = float(np.real(turn.dcgain())) * lengths
    return Nomoto(gain, float(time), (slow, fast), float(zero))
