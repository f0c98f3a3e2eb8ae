"""Physics of the plant: propeller, engine, shaft, hull, actuators and waves, and their simulation."""

from .approach import approach
from .emissions import fit_nox_map, nox_limit
from .linear import linearise, linearise_along
from .loops import Loop
from .manoeuvres import spiral, turning_circle, zig_zag
from .recording import RecordingError, read_recording
from .replay import simulate_recording
from .seas import Sea, get_sea
from .ship import Ship, ShipError
from .ship_files import load_ship, ship_names, write_ship
from .simulation import Schedule, simulate
from .state import State
from .steady_state import Equilibrium, equilibrium
from .steering import Nomoto, nomoto
from .validity import ValidityWarning, departures
from .voyage import Voyage
from .waves import realise

__all__ = [
    "Equilibrium", "Loop", "Nomoto", "RecordingError", "Schedule", "Sea", "Ship", "ShipError",
    "State", "ValidityWarning", "Voyage", "approach", "departures", "equilibrium", "fit_nox_map",
    "get_sea", "linearise", "linearise_along", "load_ship", "nomoto", "nox_limit", "read_recording",
    "realise",
    "ship_names", "simulate", "simulate_recording", "spiral", "turning_circle", "write_ship",
    "zig_zag",
]  # fmt: skip
