"""The records of the environments' kernels: what an episode remembers, what is seen, what is true."""

from __future__ import annotations

import numpy as np

from ..baselines.steering import OBSERVED_STEERED
from ..observers.records import ESTIMATE, OBSERVER
from ..plant.memory import MEMORY
from ..plant.record import PLANT
from ..plant.state import STATE
from ..plant.waves import SEA
from .rewards import REWARD_TERMS

MAX_ORDERS = 64

EPISODE = np.dtype(
    [
        ("random", np.uint64),
        ("elapsed", np.int64),  # control intervals since reset
        ("orders", np.float64, (MAX_ORDERS,)),  # ordered ship speeds [m/s], one an order interval
        ("order_interval", np.float64),  # [s]
        ("heading_orders", np.float64, (MAX_ORDERS,)),  # [rad], likewise
        ("track_orders", np.float64, (MAX_ORDERS,)),  # cross track [m], likewise
        ("drift_force", np.float64),  # mean of the slow side force, to starboard [N]
        ("resistance_mean", np.float64),  # d_c1 [-]
        ("resistance_swing", np.float64),
        ("resistance_frequency", np.float64),  # [rad/s]
        ("resistance_phase", np.float64),
        ("pitch_command", np.float64),
        ("rudder_command", np.float64),  # [rad]
        ("drive", np.float64),
        ("gauge_torque", np.float64),  # last sample [N m]
        ("mean_torque", np.float64),  # over the last MEAN_S [N m]
        ("mean_brake_torque", np.float64),  # likewise of one engine [N m]
        ("mean_attack", np.float64),  # likewise of the blades' angle of attack [deg]
        ("measured_shaft_speed", np.float64),  # last reading, for the governor [rad/s]
        ("integral", np.float64),  # of the governor [mm]
    ],
    align=True,
)
"""What an environment remembers besides the plant."""

NOISE = np.dtype(
    [("shaft_speed", np.float64), ("shaft_torque", np.float64), ("pitch_ratio", np.float64),
     ("shaft_acceleration", np.float64), ("ship_speed", np.float64), ("heading", np.float64),
     ("yaw_rate", np.float64), ("rudder_angle", np.float64), ("cross_track", np.float64)]
)  # fmt: skip
"""Rms noise of each instrument per sample [rad/s, N m, -, rad/s2, m/s, rad, rad/s, rad, m]."""

OBSERVATION = np.dtype([(name, np.float32) for name in OBSERVED_STEERED])
"""An observation by name; seen as a plain row it is what an agent gets, of a ship that is not steered as
far as :data:`OBSERVED` goes.
"""

TRUTH = np.dtype(
    [
        ("advance_velocity", np.float64),  # [m/s]
        ("thrust", np.float64),  # of one propeller [N]
        ("fuel_flow", np.float64),  # of all engines [kg/s]
        ("ventilation", np.float64),  # at the step's end [-]
        ("ship_speed", np.float64),  # [m/s]
        ("shaft_speed", np.float64),  # [rad/s]
        ("shaft_torque", np.float64),  # at the gauge [N m]
        ("brake_torque", np.float64),  # of one engine [N m]
        ("position", np.float64),  # along the track, at the step's end [m]
        ("blade_pitch", np.float64),  # P/D [-]
        ("angle_of_attack", np.float64),  # effective, of the blades [deg]
        ("outside_bucket", np.float64),  # how far it lies outside the cavitation bucket [deg]
        ("heading", np.float64),  # to starboard of the first course [rad]
        ("cross_track", np.float64),  # to starboard of the first course [m]
        ("rudder_angle", np.float64),  # [rad]
    ]
)
"""What ``info`` tells of the truth: at the beginning of an interval's last step, as the observation."""

TRUTHS: tuple[str, ...] = TRUTH.names or ()
"""Its names."""

ENVIRONMENT = np.dtype(
    [
        ("plant", PLANT),
        ("state", STATE),
        ("memory", MEMORY),
        ("sea", SEA),
        ("observer", OBSERVER),
        ("estimate", ESTIMATE),
        ("episode", EPISODE),
        ("observation", OBSERVATION),
        ("terms", REWARD_TERMS),  # means over the interval in physical units
        ("truth", TRUTH),
        ("reward", np.float64),  # of the interval, of reward_of
        ("ended", np.int64),  # RUNNING, STALLED or TRIPPED
    ],
    align=True,
)
"""Everything of one environment; a batch is an array of them."""

COMMON = np.dtype(
    [
        ("noise", NOISE),
        ("weights", REWARD_TERMS),
        ("worst_cost", np.float64),  # bound of an interval's cost
        ("intervals", np.int64),  # of a whole episode
    ],
    align=True,
)
"""What the environments of a batch share: instruments' noise, and what the reward is made of."""
