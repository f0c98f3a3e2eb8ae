"""Classic controllers, one file each, all with stable-baselines3's ``predict``.

:func:`make_controller` gives one by name: the combinator, the CPP optimiser, the thrust controller with
or without anti-spin, the speed pilot, the pitch law by the advance velocity, the model-predictive
controller. They are built with a ship, a control interval and options, and derive from
:class:`Controller`. :class:`Governor` is the inner loop of several: it moves the rack.
:class:`ThrustControl` is told a thrust instead of a speed and drives an electric motor.
"""

from .anti_spin import AntiSpin, AntiSpinTuning
from .autopilot import Autopilot
from .combinator import Combinator, Curve, combinator_curve, curve_through
from .combinator_surface import CombinatorSurface, combinator_surface
from .controller import OBSERVED, Controller, Readings, readings
from .cpp_optimiser import CppOptimiser
from .governor import Governor
from .helmsman import Course, Helmsman, TrackKeeper
from .loops import controller_loop, helmsman_loop
from .mpc import ModelPredictive
from .registry import (
    ControllerError,
    controller_names,
    helmsman_names,
    make_controller,
    make_helmsman,
    make_steering,
)
from .speed_pilot import SpeedPilot
from .steady_points import SteadyPoint, steady_point
from .steering import SteeringController
from .thrust_control import ThrustControl, ThrustControlTuning
from .va_pitch import VaPitch

__all__ = [
    "OBSERVED",
    "AntiSpin",
    "AntiSpinTuning",
    "Autopilot",
    "Combinator",
    "CombinatorSurface",
    "Controller",
    "ControllerError",
    "Course",
    "CppOptimiser",
    "Curve",
    "Governor",
    "Helmsman",
    "ModelPredictive",
    "Readings",
    "SpeedPilot",
    "SteadyPoint",
    "SteeringController",
    "ThrustControl",
    "ThrustControlTuning",
    "TrackKeeper",
    "VaPitch",
    "combinator_curve",
    "combinator_surface",
    "controller_loop",
    "controller_names",
    "curve_through",
    "helmsman_loop",
    "helmsman_names",
    "make_controller",
    "make_helmsman",
    "make_steering",
    "readings",
    "steady_point",
]
