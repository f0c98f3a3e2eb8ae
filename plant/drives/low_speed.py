"""Diesel engine below its idle speed: friction, ignition of the fuel, stall and starting air.

The brake torque is the sum of two parts that both vanish at standstill:

    M_b = M_0(|omega_e|) d(omega_e) + (M - M_0) h(omega_e)

- Friction. M_0 is the map without fuel, a constant and a part linear in speed: the form of measured
  friction mean effective pressures (Chen & Flynn 1965; Heywood 2018, chapter 13). It opposes the
  rotation in either direction: d is the odd cubic (3 r - r^3) / 2 of r = omega_e / (0.1 idle speed),
  and 1 from r = 1 on. If friction of this slope would stop the shaft within a time step, the range of
  speeds is widened, as for Coulomb friction (:func:`sticking_speed`).
- Fuel. M is the torque of map, limits and lag, and M - M_0 the part of the fuel. At low speed the
  compression does not ignite the fuel: h is the cubic r^2 (3 - 2 r), which rises from 0 at the firing
  speed, 0.4 idle speed, to 1 at 0.8 idle speed. Above it the map is unchanged. An engine that turns
  astern burns nothing.

Value and slope are continuous at the ends of each cubic. The cubics and the shares of the idle speed are
assumed: no ship of the package has measurements below idle speed.

An engine whose load pulls it below the firing speed stalls: only friction remains, at any rack. It fires
again if the propeller in the flow or starting air turns it above that speed. The torque of starting air
acts if the rack is open and fades as the fuel ignites, by 1 - h(|omega_e|).
"""

from __future__ import annotations

from ...core.compiled import Real, Record, compiled
from ...core.lanes import everywhere, where
from ...core.numeric import clip, modulus
from ..shaft import shaft_inertia

STICKING_SHARE = 0.1
"""Share of the idle speed within which friction falls to zero towards standstill."""

FIRING_SHARE = 0.4
"""Share of the idle speed below which no fuel ignites."""

FULL_FIRING_SHARE = 0.8
"""Share of the idle speed above which all fuel ignites."""


@compiled
def sticking_speed(plant: Record, at_rest: Real) -> Real:
    """Return the engine speed [rad/s] within which friction falls to zero towards standstill.

    The slope of the cubic at standstill is 1.5 |M_0| over this speed, with the torque M_0 [N m] of the
    engine without fuel at rest, not above 0. If friction of this slope would stop the shaft within a
    time step, the integration would chatter about standstill; the speed is then raised to 1.5 |M_0| i^2
    eta dt / I.
    """
    speed = STICKING_SHARE * plant.engine_speed_min
    if plant.speed_held != 0:
        return speed
    slope = 1.5 * at_rest * plant.gear_ratio * plant.gear_ratio * plant.transmission_efficiency
    least = -slope * plant.time_step / shaft_inertia(plant)
    return where(least.real > speed.real, least, speed)


@compiled
def friction_torque(plant: Record, engine_speed: Real, no_fuel: Real) -> Real:
    """Return the torque [N m] of an engine without fuel below idle speed; it opposes the rotation.

    ``engine_speed`` [rad/s] has either sign; ``no_fuel`` is M_0 [N m] at the same speed ahead, not above
    0.
    """
    r = modulus(engine_speed) / sticking_speed(plant, no_fuel)
    no_fuel = where(r.real < 1.0, no_fuel * (0.5 * r * (3.0 - r * r)), no_fuel)
    return where(engine_speed.real >= 0.0, no_fuel, -no_fuel)


@compiled
def firing_share(plant: Record, engine_speed: Real) -> Real:
    """Return the share [-] of the fuel that ignites: 0 below the firing speed, 1 near idle speed."""
    share = engine_speed / plant.engine_speed_min
    r = clip((share - FIRING_SHARE) / (FULL_FIRING_SHARE - FIRING_SHARE), 0.0, 1.0)
    return r * r * (3.0 - 2.0 * r)


@compiled
def low_speed_torque(
    plant: Record, engine_speed: Real, fuel_rack: Real, torque: Real, no_fuel: Real
) -> Real:
    """Return the brake torque M_b [N m] of an engine that may turn below its idle speed [rad/s].

    Above 0.8 idle speed it is ``torque`` itself, to the last bit. ``torque`` M [N m] follows from map,
    limits and lag if all fuel ignites. ``no_fuel`` is M_0 [N m] of the rack map at the same speed ahead;
    a positive value (a rack with another zero) means no friction. Starting air acts at a rack [mm] above
    0.
    """
    runs = engine_speed.real >= FULL_FIRING_SHARE * plant.engine_speed_min.real
    if everywhere(runs):
        return torque
    no_fuel = where(no_fuel.real > 0.0, 0.0 * no_fuel, no_fuel)
    firing = firing_share(plant, engine_speed)
    found = friction_torque(plant, engine_speed, no_fuel) + (torque - no_fuel) * firing
    unfired = 1.0 - firing_share(plant, modulus(engine_speed))
    found = found + where(fuel_rack.real > 0.0, plant.starting_air_torque * unfired, 0.0)
    return where(runs, torque, found)
