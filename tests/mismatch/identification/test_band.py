"""How far up in frequency a recording tells of a number."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.identification.free_parameters import Free
from shaftline.mismatch.identification.frequency import parameters_hertz
from shaftline.mismatch.search.spectra import INFORMATION_SHARE, LEAST_FREQUENCIES
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship
from shaftline.plant.columns import MEASURED
from shaftline.plant.replay import Replay

INERTIA = "transmission.inertia_engine_side_kg_m2"
FRICTION = "transmission.viscous_friction_engine_side_N_m_s_rad"
CORNER_HZ = 190.0 / 95.0 / (2.0 * math.pi)


def shaken(ship: Ship, every: int, column: str = "shaft_speed_rad_s") -> Balances:
    """A servo under a torque of white noise of 200 Hz, logged at every so manieth step."""
    rng = np.random.default_rng(1)
    table = pd.DataFrame(
        {
            "time_s": 0.005 * np.arange(80_001),
            "motor_torque_N_m": 20.0 * rng.standard_normal(80_001),
        }
    )
    run = Replay(ship, table.assign(shaft_speed_rad_s=0.0))
    table[column] = run.simulate(ship.record())[MEASURED[column]]
    table["motor_torque_N_m"] = table["motor_torque_N_m"].rolling(every, min_periods=1).mean()
    return Balances(JointReplay(ship, table.iloc[::every].reset_index(drop=True)))


def telling(balances: Balances, key: str, changes: dict[str, float] | None = None) -> float:
    ship = balances.replay.ship.with_values(changes or {})
    free = Free(ship, (key,))
    return parameters_hertz(balances, free, free.values, [(0, balances.replay.rows)])


def test_of_a_friction_it_is_that_of_two_poles(servo: Ship) -> None:
    """Under white torque the speed's slope by friction has the power 1 / (1 + x^2)^2, x = f / corner.

    Its integral is (x / (1 + x^2) + atan x) / 2, and comes to TELLING of its whole, pi / 4.
    """
    x = np.linspace(0.0, 20.0, 200_001)
    share = (x / (1.0 + x**2) + np.arctan(x)) * 2.0 / math.pi
    wanted = CORNER_HZ * float(x[np.searchsorted(share, INFORMATION_SHARE)])
    assert telling(shaken(servo, 2), FRICTION) == pytest.approx(wanted, rel=0.1)


def test_it_is_the_same_at_another_sampling_rate_and_of_the_angle(servo: Ship) -> None:
    fast = telling(shaken(servo, 2), FRICTION)
    assert telling(shaken(servo, 20), FRICTION) == pytest.approx(fast, rel=0.1)
    angle = shaken(servo, 2, "shaft_angle_rad")
    assert telling(angle, FRICTION) == pytest.approx(fast, rel=0.1)


def test_it_is_never_so_low_that_noise_cannot_be_told(servo: Ship) -> None:
    balances = shaken(servo, 2)
    slow = telling(balances, FRICTION, {INERTIA: 95_000.0})
    assert slow == pytest.approx(LEAST_FREQUENCIES / 400.0, rel=0.01)


def test_of_a_number_that_does_nothing_it_is_no_limit(servo: Ship) -> None:
    assert telling(shaken(servo, 20), "sensors.speed_delay_s") < math.inf
    assert telling(shaken(servo, 20), "sensors.torque_gain") == math.inf
