"""Classic controllers, one file each, all with stable-baselines3's ``predict``.

:func:`make_controller` gives one by name: the combinator, the CPP optimiser, the thrust controller with
or without anti-spin, the speed pilot, the pitch law by the advance velocity. They are built with a ship,
a control interval and options, and derive from :class:`Controller`. :class:`Governor` is the inner loop
of several: it moves the rack.
"""

from .anti_spin import AntiSpin, AntiSpinTuning
from .combinator import Combinator, Curve, combinator_curve, curve_through
from .combinator_surface import CombinatorSurface, combinator_surface
from .controller import OBSERVED, Controller, Readings, readings
from .cpp_optimiser import CppOptimiser
from .governor import Governor
from .registry import ControllerError, controller_names, make_controller
from .speed_pilot import SpeedPilot
from .steady_points import SteadyPoint, steady_point
from .va_pitch import VaPitch

__all__ = [
    "OBSERVED",
    "AntiSpin",
    "AntiSpinTuning",
    "Combinator",
    "CombinatorSurface",
    "Controller",
    "ControllerError",
    "CppOptimiser",
    "Curve",
    "Governor",
    "Readings",
    "SpeedPilot",
    "SteadyPoint",
    "VaPitch",
    "combinator_curve",
    "combinator_surface",
    "controller_names",
    "curve_through",
    "make_controller",
    "readings",
    "steady_point",
]
