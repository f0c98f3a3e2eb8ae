"""Records of the environment kernels: memory of an episode, observation, true state, parameters."""

from __future__ import annotations

import numpy as np

from ..baselines.controller import OBSERVED, PREVIEW
from ..baselines.helmsman import STEERED
from ..observers.records import ESTIMATE, OBSERVER
from ..plant.memory import MEMORY
from ..plant.record import PLANT
from ..plant.state import STATE
from ..plant.waves import SEA
from .rewards import GOALS, REWARD_TERMS

MAX_ORDERS = 64

EPISODE = np.dtype(
    [
        ("random", np.uint64),
        ("elapsed", np.int64),  # control intervals since reset
        ("orders", np.float64, (MAX_ORDERS,)),  # ordered ship speeds [m/s], one an order interval
        ("order_interval", np.float64),  # [s]
        ("sea", np.float64, (5,)),  # Hs [m], Tp [s], gamma [-], heading [deg], wind [m/s]
        ("heading_orders", np.float64, (MAX_ORDERS,)),  # ordered headings [rad]
        ("track_orders", np.float64, (MAX_ORDERS,)),  # ordered cross-track positions [m]
        ("drift_force", np.float64),  # mean of the slow side force, to starboard [N]
        ("resistance_mean", np.float64),  # factor d_c1 on the resistance [-]
        ("resistance_swing", np.float64),  # amplitude of the slow resistance fluctuation [-]
        ("resistance_frequency", np.float64),  # [rad/s]
        ("resistance_phase", np.float64),
        ("reference_fuel", np.float64, (MAX_ORDERS,)),  # of the steady state at each order [kg/s]
        ("reference_power", np.float64, (MAX_ORDERS,)),  # towing power in that steady state [W]
        ("pitch_command", np.float64),
        ("rudder_command", np.float64),  # [rad]
        ("drive", np.float64),  # present command of the fuel rack [mm]
        ("rack_command", np.float64),  # fuel rack command of the agent, before any limiter [mm]
        ("shaft_speed_command", np.float64),  # set-point of the governor [rad/s]
        ("mean_speed", np.float64),  # mean ship speed over the last MEAN_S [m/s]
        ("mean_torque", np.float64),  # mean shaft torque over the last MEAN_S [N m]
        ("mean_brake_torque", np.float64),  # mean torque of one engine over the last MEAN_S [N m]
        ("mean_attack", np.float64),  # mean angle of attack over the last MEAN_S [deg]
        ("measured_mean_torque", np.float64),  # mean measured shaft torque [N m]
        ("estimated_mean_brake_torque", np.float64),  # mean from rack and shaft speed [N m]
        ("estimated_mean_attack", np.float64),  # mean from the estimate of the observer [deg]
        ("measured_shaft_speed", np.float64),  # last measurement, for the governor [rad/s]
        ("integral", np.float64),  # integral part of the governor [mm]
    ],
    align=True,
)
"""Memory of an episode, beside the state of the plant."""

_INSTRUMENTS = (
    "shaft_speed",
    "shaft_torque",
    "pitch_ratio",
    "shaft_acceleration",
    "ship_speed",
    "heading",
    "yaw_rate",
    "rudder_angle",
    "cross_track",
    "wave_inflow",
)
NOISE = np.dtype([(name, np.float64) for name in _INSTRUMENTS])
"""Rms noise of each instrument per sample [rad/s, N m, -, rad/s2, m/s, rad, rad/s, rad, m, m/s]."""

LEARNER_SIGNALS = (
    "speed_error",
    "pitch_command",
    "shaft_torque_deviation",
    "engine_torque_deviation",
    "estimated_angle_of_attack",
    "angle_of_attack_deviation",
)
"""Signals that an observation adds to those of the classic controllers; the rewards depend on them."""

COURSE_ERRORS = ("heading_error", "track_error")  # further signals where the rudder is an action
SHAFT_SPEED_COMMAND, RACK_COMMAND = "shaft_speed_command", "fuel_rack_command"
BASE_COMMANDS = ("base_pitch_ratio", "base_fuel_rack", "base_rudder_angle")

_EVERY_SIGNAL = (
    *OBSERVED,
    *STEERED,
    *PREVIEW,
    *LEARNER_SIGNALS,
    *COURSE_ERRORS,
    SHAFT_SPEED_COMMAND,
    RACK_COMMAND,
    *BASE_COMMANDS,
)

OBSERVATION = np.dtype([(name, np.float32) for name in _EVERY_SIGNAL])
"""All signals that an observation can contain, in physical units."""

TRUTH = np.dtype(
    [
        ("advance_velocity", np.float64),  # [m/s]
        ("thrust", np.float64),  # thrust of one propeller [N]
        ("fuel_flow", np.float64),  # fuel flow of all engines [kg/s]
        ("ventilation", np.float64),  # share of ventilation at the end of the step [-]
        ("ship_speed", np.float64),  # [m/s]
        ("shaft_speed", np.float64),  # [rad/s]
        ("shaft_torque", np.float64),  # at the shaft torque meter [N m]
        ("brake_torque", np.float64),  # torque of one engine [N m]
        ("position", np.float64),  # along the track, at the end of the step [m]
        ("blade_pitch", np.float64),  # P/D [-]
        ("angle_of_attack", np.float64),  # effective angle of attack of the blades [deg]
        ("outside_bucket", np.float64),  # angle of attack beyond the cavitation bucket [deg]
        ("heading", np.float64),  # to starboard of the first course [rad]
        ("cross_track", np.float64),  # to starboard of the first course [m]
        ("rudder_angle", np.float64),  # [rad]
    ]
)
"""True state in ``info``: at the start of the last plant step of an interval, as the observation."""

TRUTHS: tuple[str, ...] = TRUTH.names or ()  # names of the quantities of the true state
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
        ("reward", np.float64),  # reward of the interval, from reward_of
        ("ended", np.int64),  # RUNNING, STALLED or TRIPPED
    ],
    align=True,
)
"""All records of one environment; a batch is an array of them."""

COMMON = np.dtype(
    [
        ("noise", NOISE),
        ("goals", GOALS),
        ("increments", np.int64),  # 1 where actions are rates of change of commands
        ("second", np.int64),  # DIRECT_RACK, LIMITED_RACK or SHAFT_SPEED
        ("preview", np.int64),  # 1 where a sensor at the bow measures the waves ahead
        ("limiter_slope", np.float64),  # slope of the rack limit over the shaft speed [mm s/rad]
    ],
    align=True,
)
"""Parameters that the environments of a batch share."""

DIRECT_RACK, LIMITED_RACK, SHAFT_SPEED = range(3)  # codes of the second command
