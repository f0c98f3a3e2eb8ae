"""Classic controllers and helmsmen, one file each, with the ``predict`` method of stable-baselines3.

- :func:`make_controller` returns a controller by name and options, :func:`make_helmsman` a helmsman, and
  :func:`make_steering` both together; :func:`controller_names` and :func:`helmsman_names` list the
  names.
- A controller is built with a ship, a control interval and options, and derives from
  :class:`Controller`.
- :class:`Governor` is the inner loop of several controllers; it sets the fuel rack.
- :class:`ThrustControl` drives an electric motor at a thrust set-point instead of a ship speed.

:func:`controller_loop` and :func:`helmsman_loop` return the linear control loop with its margins.
"""

from .anti_spin import AntiSpin, AntiSpinTuning
from .autopilot import Autopilot
from .combinator import Combinator, Curve, combinator_curve, curve_through
from .combinator_surface import CombinatorSurface, combinator_surface
from .controller import OBSERVED, Controller, Measurements, measurements_of
from .cpp_optimiser import CppOptimiser
from .governor import Governor
from .helmsman import Helmsman, SteeringMeasurements, TrackKeeper
from .loops import controller_loop, helmsman_loop
from .lqg_autopilot import LqgAutopilot
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
    "OBSERVED", "AntiSpin", "AntiSpinTuning", "Autopilot", "Combinator", "CombinatorSurface",
    "Controller", "ControllerError", "CppOptimiser", "Curve", "Governor", "Helmsman",
    "LqgAutopilot", "Measurements", "ModelPredictive", "SpeedPilot", "SteadyPoint", "SteeringController",
    "SteeringMeasurements", "ThrustControl", "ThrustControlTuning", "TrackKeeper", "VaPitch",
    "combinator_curve", "combinator_surface", "controller_loop", "controller_names",
    "curve_through", "helmsman_loop", "helmsman_names", "make_controller", "make_helmsman",
    "make_steering", "measurements_of", "steady_point",
]  # fmt: skip
