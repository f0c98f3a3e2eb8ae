"""Time constants of a ship beside its time step: which one the integration cannot resolve.

A classic Runge-Kutta step of length h multiplies a lag of time constant tau by
``1 - z + z^2/2 - z^3/6 + z^4/24`` with ``z = h / tau``, where ``exp(-z)`` is exact. At h = tau the step
response is off by 0.71 % of the step at most, at h = 1.1 tau by 1.1 %, and beyond h = 2.785 tau it
diverges. So a time constant below the time step is refused. The first-order lag of the speed log is
integrated exactly and may have any length.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from .expressions import MAX_SIGNALS, MAX_STATES, Heard, Loaded, added, names_in
from .hull import Hull
from .keys import KeyInfo, Section, is_lag
from .manoeuvring import Manoeuvring, hull_forces, planar_acceleration
from .record import PLANT
from .shaft import shaft_inertia
from .terms import Term, add_term

if TYPE_CHECKING:
    from .ship import Ship

_ROUNDING = 1e-9
_CRUISE_M_S = 5.0  # at which the rate of a term's state is looked at, and twice that

SHAFT = "transmission: inertia / (viscous friction + slope of arctangent friction + back-EMF)"
"""Time constant [s] of the shaft, as messages name it."""


SWAY_AND_YAW = "manoeuvring: the faster mode of sway and yaw, at a Froude number of 0.5"
"""Time constant [s] of a ship that turns, as messages name it."""

_FASTEST_FROUDE = 0.5  # no hull that these derivatives describe is faster

_OF_THE_SHAFT = ("transmission", "prime_mover", "propeller")
"""Sections whose numbers set the shaft's inertia and what damps it."""


def time_constants(ship: Ship) -> dict[str, float]:
    """Return the time constants [s] in force on a ship that the time step has to resolve, by name.

    Args:
        ship: the ship.
    """
    found: dict[str, float] = {}
    for name in type(ship).model_fields:
        section = getattr(ship, name)
        if isinstance(section, Section) and all(getattr(ship, n) for n in section.needs.split()):
            found |= {f"{name}.{key}": value for key, value in section.time_constants.items()}
    shaft = _shaft_time_constant(ship)
    if math.isfinite(shaft):
        found[SHAFT] = shaft
    if ship.turns and ship.moves:
        turning = (ship.hull, ship.manoeuvring, ship.water.density_kg_m3)
        found[SWAY_AND_YAW] = 1.0 / _rate_of_sway_and_yaw(*turning)
    return found


@functools.lru_cache(maxsize=256)
def _rate_of_sway_and_yaw(hull: Hull, manoeuvring: Manoeuvring, density: float) -> float:
    """Return the rate [1/s] of the faster mode of sway and yaw with the rudder amidships."""
    plant = np.zeros(1, PLANT)[0]
    hull.fill(plant)
    manoeuvring.fill(plant)
    plant["density"], plant["current"], plant["cross_current"] = density, 0.0, 0.0
    length = manoeuvring.length_m
    speed = _FASTEST_FROUDE * math.sqrt(scipy.constants.g * length)
    small = 1e-6 * np.diag([speed, speed / length])

    def rates(across: float, yaw_rate: float) -> Any:
        _, side, moment = hull_forces(plant, speed, across, yaw_rate)
        return planar_acceleration(plant, speed, across, yaw_rate, 0.0, 0.0, side, moment)[1:]

    slopes = [
        np.subtract(rates(*by), rates(*-by)) / (2.0 * by.sum()) for by in small
    ]  # d(rates)/d(state), a row a state
    if not np.isfinite(slopes).all():
        return sys.float_info.max
    return max(float(np.abs(np.linalg.eigvals(slopes).real).max()), 1e-12)


def _shaft_time_constant(ship: Ship) -> float:
    """Return the shaft's inertia over what damps it [s]; infinite where nothing does."""
    slope = _damping(ship)
    return _inertia(ship) / slope if ship.turns_freely and slope > 0.0 else math.inf


def _inertia(ship: Ship) -> float:
    """Return the inertia [kg m2] of the shaft, without the curves that fill a ship's whole record."""
    plant = np.zeros(1, PLANT)[0]
    ship.transmission.fill(plant)
    plant["entrained_inertia"] = ship.propeller.entrained_inertia_kg_m2
    return float(shaft_inertia(plant))


def _resolved(spare: Callable[[float], float], value: float, bound: float) -> float:
    """Return how far a number may go from its value towards a bound, which may be infinite.

    Args:
        spare: at least 0 where the time step resolves what the number sets.
        value: of the number.
        bound: of its range.
    """
    end = math.copysign(min(abs(bound), 1e12), bound)
    if spare(end) >= 0.0 or spare(value) < 0.0:
        return bound
    root = float(scipy.optimize.brentq(spare, value, end, rtol=1e-12))
    return root + 1e-9 * (value - root)


def _spare_inertia(ship: Ship, key: str) -> Callable[[float], float]:
    """Return what the time step leaves of the shaft's inertia [kg m2] over a number.

    It is linear in frictions and inertias.
    """
    section, _, name = key.partition(".")
    table = getattr(ship, section)

    def spare(at: float) -> float:
        changed = ship.model_copy(update={section: table.model_copy(update={name: at})})
        try:
            return _inertia(changed) - ship.time_step_s * _damping(changed)
        except ZeroDivisionError:  # at an excluded bound, such as a resistance of 0
            return -sys.float_info.max

    return spare


@functools.lru_cache(maxsize=1024)
def _turning_range(
    hull: Hull,
    manoeuvring: Manoeuvring,
    density: float,
    step: float,
    name: str,
    low: float,
    high: float,
) -> tuple[float, float]:
    """Return how far a number of a turning hull may go down and up while a step [s] resolves it."""

    def spare(at: float) -> float:
        """Return how much less than 1 the time step is, in time constants of the faster mode."""
        changed = manoeuvring.model_copy(update={name: at})
        try:
            return 1.0 - step * _rate_of_sway_and_yaw(hull, changed, density)
        except ZeroDivisionError:  # a length of 0
            return -sys.float_info.max

    value = float(getattr(manoeuvring, name))
    return _resolved(spare, value, low), _resolved(spare, value, high)


def _damping(ship: Ship) -> float:
    """Return the slope [N m s/rad] of the torques that damp a shaft whatever its speed."""
    line, mover = ship.transmission, ship.prime_mover
    slope = line.viscous_friction_engine_side_N_m_s_rad
    slope *= 1.0 + abs(line.viscous_asymmetry_fraction)
    slope += line.viscous_friction_propeller_side_N_m_s_rad
    slope += line.arctangent_friction_engine_side_N_m * line.arctangent_friction_slope_s_rad
    return slope + mover.damping * line.gear_ratio**2 * line.efficiency


def check_time_constants(ship: Ship) -> None:
    """Refuse a time constant, or a term's state, that is faster than the ship's time step.

    Raises:
        ValueError: names the key, its value and the limit.
    """
    step = ship.time_step_s
    for name, value in time_constants(ship).items():
        if value < step * (1.0 - _ROUNDING):
            raise ValueError(
                f"{name} = {value:.4g} s is shorter than integration.time_step_s = {step:g} s, "
                "which cannot resolve it. Give a longer time constant or a shorter time step"
            )
    for term in ship.term:
        if term.state is None:
            continue
        fastest = _fastest_rate(term, *_surroundings(ship))
        if fastest * step > 1.0 + 1e-6:
            raise ValueError(
                f"term {term.id!r}: its state {term.state} has a time constant of "
                f"{1.0 / fastest:.4g} s, shorter than integration.time_step_s = {step:g} s, which "
                "cannot resolve it. Give parameters of a slower rate or a shorter time step"
            )


def _surroundings(ship: Ship) -> tuple[tuple[str, ...], tuple[tuple[float, ...], ...]]:
    """Return the signals that a ship's terms hear from outside, and where their rates are looked at."""
    return tuple(sorted(ship.signals)), tuple(_conditions(ship))


def _conditions(ship: Ship) -> Iterator[tuple[float, ...]]:
    """Yield signals at which the rates of terms' states are looked at: at rest, ahead, and fast."""
    depth = ship.propeller.depth_m
    yield tuple(Heard(*np.zeros(len(Heard._fields)).tolist())._replace(submergence=depth))
    top = ship.prime_mover.idle_speed_rad_s / ship.transmission.gear_ratio
    if ship.has_diesel:
        top = ship.shaft_speeds[1]
    pitch = ship.propeller.pitch_ratio_max
    speed = _CRUISE_M_S if ship.moves else 0.0
    for share in (0.5, 1.0):
        yield Heard(
            shaft_speed=share * top, ship_speed=2.0 * share * speed, pitch_ratio=pitch,
            pitch_command=pitch, drive=share * _top_demand(ship),
            advance_velocity=2.0 * share * speed * (1.0 - ship.hull.wake_fraction),
            submergence=depth, time=0.0, sway_speed=0.0, yaw_rate=0.0, heading=0.0,
            rudder_angle=0.0, shaft_angle=0.0,
        )  # fmt: skip


def _top_demand(ship: Ship) -> float:
    plant = np.zeros(1, PLANT)[0]
    ship.prime_mover.fill(plant)
    return float(plant["drive_max"])


@functools.lru_cache(maxsize=256)
def _fastest_rate(
    term: Term, signals: tuple[str, ...], conditions: tuple[tuple[float, ...], ...]
) -> float:
    """Return the largest |d rate / d state| [1/s] of a term's state, at 0 and where its rate vanishes.

    Args:
        term: with a state.
        signals: from outside that the ship hears, in their order.
        conditions: each the values of :class:`Heard`.
    """
    plant = np.zeros(1, PLANT)[0]
    add_term(plant, term, signals)

    def rate(at: Any, state: float) -> float:
        states = (state, *(0.0,) * (MAX_STATES - 1))
        nothing = Loaded(0.0, 0.0, 0.0, 0.0, 0.0)
        return float(added(plant, Heard(*at), nothing, states, (0.0,) * MAX_SIGNALS).rate_1)

    fastest = 0.0
    for at in conditions:
        for state in {0.0, _rest(functools.partial(rate, at))}:
            step = 1e-6 * max(1.0, abs(state))
            slope = abs(rate(at, state + step) - rate(at, state - step)) / (2.0 * step)
            fastest = max(fastest, slope if math.isfinite(slope) else 0.0)
    return fastest


def _rest(rate: Any) -> float:
    """Return the state at which a rate vanishes, by doubled steps from 0; 0 where there is none."""
    begins = rate(0.0)
    if begins == 0.0 or not math.isfinite(begins):
        return 0.0
    near, far = 0.0, math.copysign(1e-6, begins)
    for _ in range(80):
        if rate(far) * begins <= 0.0:
            break
        near, far = far, 2.0 * far
    else:
        return 0.0
    for _ in range(50):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if rate(middle) * begins > 0.0 else (near, middle)
    return 0.5 * (near + far)


def resolved_parameter(ship: Ship, term: Term, name: str, info: KeyInfo) -> KeyInfo:
    """Return the range of a term's parameter as far as the ship's time step resolves the term's state.

    Args:
        ship: that carries the term.
        term: the term.
        name: of the parameter.
        info: range that the term allows.
    """
    if term.rate is None or name not in names_in(term.rate):
        return info
    step, around = ship.time_step_s, _surroundings(ship)
    low, high = (_slowed(term, name, bound, step, *around) for bound in (info.low, info.high))
    return info._replace(low=low, high=high)


@functools.lru_cache(maxsize=256)
def _slowed(
    term: Term,
    name: str,
    bound: float,
    step: float,
    signals: tuple[str, ...],
    conditions: tuple[tuple[float, ...], ...],
) -> float:
    """Return how far a term's parameter may go towards a bound while a step [s] resolves its state."""
    value = term.parameters[name].value

    def spare(at: float) -> float:
        """Return the state's shortest time constant less the step [s]."""
        given = term.parameters[name].model_copy(update={"value": at})
        other = term.model_copy(update={"parameters": {**term.parameters, name: given}})
        fastest = _fastest_rate(other, signals, conditions)
        return min(1.0 / fastest, 1e12) - step if fastest > 0.0 else 1e12

    return _resolved(spare, value, bound)


def resolved(ship: Ship, key: str, value: float, info: KeyInfo) -> KeyInfo:
    """Return a number's range as far as the ship's time step resolves the time constants that it sets.

    Args:
        ship: the ship.
        key: dotted key of the number.
        value: of the number on the ship.
        info: range that the key allows.
    """
    section, _, name = key.partition(".")
    table, step = getattr(ship, section), ship.time_step_s
    if section in _OF_THE_SHAFT and ship.turns_freely:
        spare = _spare_inertia(ship, key)
        low, high = (_resolved(spare, value, bound) for bound in (info.low, info.high))
        info = info._replace(low=low, high=high)
    if section == "manoeuvring" and ship.turns:
        turning = (ship.hull, table, ship.water.density_kg_m3)
        low, high = _turning_range(*turning, step, name, info.low, info.high)
        info = info._replace(low=low, high=high)
    limits = ship.prime_mover.resolved(step) if section == "prime_mover" else {}
    if name in limits:
        low, high, gap = limits[name]
        low = min(low, value) if value > 0.0 else low
        return info._replace(low=max(info.low, low), high=min(info.high, high), gap=gap)
    if not is_lag(type(table).model_fields[name]):
        return info
    if value > 0.0:
        return info._replace(low=max(info.low, min(step, value)))
    return info._replace(gap=step)
