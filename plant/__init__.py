"""The physics: propeller, engine, shaft, hull, actuators, waves, and their integration in time."""

from .linear import linearise
from .ship import Ship
from .ship_errors import ShipError
from .ship_files import load_ship, ship_names, write_ship
from .simulation import Schedule, simulate
from .steady_state import Equilibrium, equilibrium
from .waves import Sea, get_sea, realise

__all__ = [
    "Equilibrium",
    "Schedule",
    "Sea",
    "Ship",
    "ShipError",
    "equilibrium",
    "get_sea",
    "linearise",
    "load_ship",
    "realise",
    "ship_names",
    "simulate",
    "write_ship",
]
