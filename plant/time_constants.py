"""Time constants of a ship compared with its time step, and the ranges of parameters that it resolves.

A classic Runge-Kutta step of length h multiplies a lag of time constant tau by ``1 - z + z^2/2 - z^3/6
+ z^4/24`` with ``z = h / tau``; exact is ``exp(-z)``. At h = tau the error of the step response is at
most 0.71 % of the step, at h = 1.1 tau 1.1 %, and beyond h = 2.785 tau it diverges. So a time constant
below the time step is refused. The first-order lag of the speed log is integrated exactly and may have
any length.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from .expressions import (
    MAX_SIGNALS,
    MAX_STATES,
    InputSignals,
    LoadSignals,
    names_in,
    sum_load_terms,
)
from .hull import Hull
from .keys import KeyInfo, Section, is_lag
from .manoeuvring import Manoeuvring, hull_forces, planar_acceleration
from .record import PLANT
from .roll import Roll, fastest_rate
from .shaft import shaft_inertia
from .terms import Term, add_term

if TYPE_CHECKING:
    from .ship import Ship

_ROUNDING = 1e-9
_CRUISE_M_S = 5.0  # ship speed at which the rates of terms' states are evaluated, and twice that

SHAFT = "transmission: inertia / (viscous friction + slope of arctangent friction + back-EMF)"
"""Name of the shaft's time constant in messages."""


SWAY_AND_YAW = "manoeuvring: the faster mode of sway and yaw, at a Froude number of 0.5"
"""Name of the time constant of sway and yaw in messages."""

_FASTEST_FROUDE = 0.5  # highest Froude number for which such derivatives are used

_OF_THE_SHAFT = ("transmission", "prime_mover", "propeller")
"""Sections whose parameters determine the inertia and the damping of the shaft."""


def time_constants(ship: Ship) -> dict[str, float]:
    """Return the time constants [s] of a ship that the time step has to resolve, by name."""
    found: dict[str, float] = {}
    for name in type(ship).model_fields:
        section = getattr(ship, name)
        if isinstance(section, Section) and all(getattr(ship, n) for n in section.needs.split()):
            found |= {f"{name}.{key}": value for key, value in section.time_constants.items()}
    slope = _damping(ship)
    if ship.turns_freely and slope > 0.0 and math.isfinite(shaft := _inertia(ship) / slope):
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

    # d(rates)/d(state), a row for each state
    slopes = [np.subtract(rates(*by), rates(*-by)) / (2.0 * by.sum()) for by in small]
    if not np.isfinite(slopes).all():
        return sys.float_info.max
    return max(float(np.abs(np.linalg.eigvals(slopes).real).max()), 1e-12)


def _inertia(ship: Ship) -> float:
    """Return the inertia [kg m2] of the shaft, without computing the ship's whole record."""
    plant = np.zeros(1, PLANT)[0]
    ship.transmission.fill(plant)
    plant["entrained_inertia"] = ship.propeller.entrained_inertia_kg_m2
    return float(shaft_inertia(plant))


def _resolved(spare: Callable[[float], float], value: float, bound: float) -> float:
    """Return how far a parameter may change from its value towards a bound, which may be infinite.

    ``spare`` is a function of the parameter, at least 0 if the time step resolves the time constant.
    """
    end = math.copysign(min(abs(bound), 1e12), bound)
    if spare(end) >= 0.0 or spare(value) < 0.0:
        return bound
    root = float(scipy.optimize.brentq(spare, value, end, rtol=1e-12))
    return root + 1e-9 * (value - root)


def _spare_inertia(ship: Ship, key: str) -> Callable[[float], float]:
    """Return the shaft's inertia minus time step times damping [kg m2], by the value of a parameter."""
    section, _, name = key.partition(".")
    table = getattr(ship, section)

    def spare(at: float) -> float:
        changed = ship.model_copy(update={section: table.model_copy(update={name: at})})
        try:
            return _inertia(changed) - ship.time_step_s * _damping(changed)
        except ZeroDivisionError:  # an excluded bound, such as a resistance of 0
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
    """Return the range of a manoeuvring parameter in which a step [s] resolves sway and yaw."""

    def spare(at: float) -> float:
        """Return 1 minus the time step in time constants of the faster mode."""
        changed = manoeuvring.model_copy(update={name: at})
        try:
            return 1.0 - step * _rate_of_sway_and_yaw(hull, changed, density)
        except ZeroDivisionError:  # a length of 0
            return -sys.float_info.max

    value = float(getattr(manoeuvring, name))
    return _resolved(spare, value, low), _resolved(spare, value, high)


@functools.lru_cache(maxsize=1024)
def _roll_range(roll: Roll, step: float, name: str, low: float, high: float) -> tuple[float, float]:
    """Return the range of a roll parameter in which a step [s] resolves the roll."""

    def spare(at: float) -> float:
        """Return 1 minus the time step in time constants of the faster mode."""
        return 1.0 - step * fastest_rate(roll.model_copy(update={name: at}))

    value = float(getattr(roll, name))
    return _resolved(spare, value, low), _resolved(spare, value, high)


def _damping(ship: Ship) -> float:
    """Return the slope [N m s/rad] of the torques that damp the shaft at any speed."""
    line, mover = ship.transmission, ship.prime_mover
    slope = line.viscous_friction_engine_side_N_m_s_rad
    slope *= 1.0 + abs(line.viscous_asymmetry_fraction)
    slope += line.viscous_friction_propeller_side_N_m_s_rad
    slope += line.arctangent_friction_engine_side_N_m * line.arctangent_friction_slope_s_rad
    return slope + mover.damping * line.gear_ratio**2 * line.efficiency


def check_time_constants(ship: Ship) -> None:
    """Refuse a time constant or a term's state that is faster than the time step, with a ValueError."""
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
    """Return a ship's external signals, and the conditions at which terms' rates are evaluated.

    The conditions are at rest, at half and at full speed.
    """
    plant = np.zeros(1, PLANT)[0]
    ship.prime_mover.fill(plant)
    top = ship.prime_mover.idle_speed_rad_s / ship.transmission.gear_ratio
    if ship.has_diesel:
        top = ship.shaft_speeds[1]
    pitch, speed = ship.propeller.pitch_ratio_max, _CRUISE_M_S if ship.moves else 0.0
    rest = InputSignals(*(0.0 for _ in InputSignals._fields))
    rest = rest._replace(submergence=ship.propeller.depth_m)
    moving = (
        rest._replace(
            shaft_speed=share * top,
            ship_speed=2.0 * share * speed,
            pitch_ratio=pitch,
            pitch_command=pitch,
            drive=share * float(plant["drive_max"]),
            advance_velocity=2.0 * share * speed * (1.0 - ship.hull.wake_fraction),
        )
        for share in (0.5, 1.0)
    )
    return tuple(sorted(ship.signals)), (rest, *moving)


@functools.lru_cache(maxsize=256)
def _fastest_rate(
    term: Term, signals: tuple[str, ...], conditions: tuple[tuple[float, ...], ...]
) -> float:
    """Return the largest |d rate / d state| [1/s] of a term, at state 0 and at zero rate."""
    plant = np.zeros(1, PLANT)[0]
    add_term(plant, term, signals)

    def rate(at: Any, state: float) -> float:
        states = (state, *(0.0,) * (MAX_STATES - 1))
        nothing = LoadSignals(0.0, 0.0, 0.0, 0.0, 0.0)
        sums = sum_load_terms(plant, InputSignals(*at), nothing, states, (0.0,) * MAX_SIGNALS)
        return float(sums.rate_1)

    fastest = 0.0
    for at in conditions:
        for state in {0.0, _rest(functools.partial(rate, at))}:
            step = 1e-6 * max(1.0, abs(state))
            slope = abs(rate(at, state + step) - rate(at, state - step)) / (2.0 * step)
            fastest = max(fastest, slope if math.isfinite(slope) else 0.0)
    return fastest


def _rest(rate: Any) -> float:
    """Return the state at which a rate vanishes, by doubled steps from 0; 0 if there is none."""
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


def resolved_term_range(ship: Ship, term: Term, name: str, info: KeyInfo) -> KeyInfo:
    """Return the range of a term's parameter in which the ship's time step resolves the term's state."""
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
    """Return how far a term's parameter may change towards a bound while a step resolves its state."""
    value = term.parameters[name].value

    def spare(at: float) -> float:
        """Return the state's shortest time constant minus the step [s]."""
        given = term.parameters[name].model_copy(update={"value": at})
        other = term.model_copy(update={"parameters": {**term.parameters, name: given}})
        fastest = _fastest_rate(other, signals, conditions)
        return min(1.0 / fastest, 1e12) - step if fastest > 0.0 else 1e12

    return _resolved(spare, value, bound)


def resolved_range(ship: Ship, key: str, value: float, info: KeyInfo) -> KeyInfo:
    """Return the range of a parameter in which the ship's time step resolves its time constants."""
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
    if section == "roll" and ship.rolls:
        low, high = _roll_range(table, step, name, info.low, info.high)
        # Without a metacentric height the ship does not roll, so no search may reach 0.
        above = info.above or name == "metacentric_height_m"
        info = info._replace(low=low, high=high, above=above)
    limits = ship.prime_mover.resolved_ranges(step) if section == "prime_mover" else {}
    if name in limits:
        low, high, gap = limits[name]
        low = min(low, value) if value > 0.0 else low
        return info._replace(low=max(info.low, low), high=min(info.high, high), gap=gap)
    if not is_lag(type(table).model_fields[name]):
        return info
    if value > 0.0:
        return info._replace(low=max(info.low, min(step, value)))
    return info._replace(gap=step)
