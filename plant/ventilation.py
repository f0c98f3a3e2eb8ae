"""Ventilation: air drawn to a loaded propeller near the surface, and the thrust and torque lost by it.

A blade draws air where the suction of its loading exceeds the static head of the water above it. Both
are compared as heads over the radius R:

- static head: the relative submergence h/R of the propeller's centre;
- suction head: H/R with H = T0 / (rho g A0) = 4 KT n^2 D^2 / (pi g), the thrust without air over the
  disc area as a column of water. It grows with loading and with the square of the shaft speed; equal
  values at two scales are Froude's similarity.

The equations and their sources:

1. *Inception and washout.* Air reaches the propeller if h/R < onset + suction_gain H/R, and leaves it if
   h/R exceeds that limit by ``hysteresis``. Tests show that ventilation depends on h/R and on the shaft
   speed together, that it begins abruptly and that it persists beyond the limit of its inception
   (Smogeli 2006, chapter 2; Kozlowska, Steen and Koushan 2009). The linear form in H/R is an
   assumption. The degree a of ventilation changes by
       da/dt = (s - a) (s / growth_time + (1 - s) / washout_time),
       s = S(1/2 + K ((onset + suction_gain H/R + hysteresis / 2 - h/R) / G + a - 1/2)),

   where S(v) = 35 v^4 - 84 v^5 + 70 v^6 - 20 v^7 rises smoothly from 0 at v = 0 to 1 at v = 1, with
   K = 8/7 and with G such that the folds of the equation lie at the two limits. Between them two degrees
   are stable. So the hysteresis is a property of a smooth equation without a switch between steps, and a
   fourth-order integration keeps its order.
2. *Loss of a ventilated blade.* A plate whose suction side is at atmospheric pressure has the lift
   coefficient (pi/2) alpha + 2 g h / V^2 (Minsaas, Faltinsen and Persson 1983; Kozlowska et al. 2009);
   a wetted one has 2 pi alpha. The suction side, 3/4 of the lift, is therefore replaced by the static
   head on the blade area A_E = EAR A0. With the share of the suction that is lost,

       phi = max(0, 1 - EAR h / (3/4 H)),
       T = T0 (1 - a thrust_loss phi),  Q = Q0 (1 - a torque_loss phi).

   The corner of phi is rounded over 0.3. The theory's ``thrust_loss`` is 0.75, and ``torque_loss``
   follows from KQ/KQ0 = (KT/KT0)^m with m of 0.8 to 0.85 (Minsaas et al. 1983): 0.68.
   ``static_head_share`` multiplies h in phi; 0 leaves fixed shares, a form with two parameters for the
   identification from a recording.
3. *Loss of disc area and Wagner effect*, at any loading (Minsaas, Thon and Kauczynski 1987):
   beta = 1 - 0.675 (1 - 0.769 h/R)^1.258 for h/R < 1.3, else 1, and beta^0.8 for the torque. The share
   ``surface_loss`` of it is applied. Its two corners are rounded, over 0.2 of 1 - 0.769 h/R and over
   0.05 of beta.

With rising shaft speed at one depth, thrust rises, drops at inception, and rises again more slowly.

Range: advance ahead, h/R from 0 to 3.4, H/R to about 9 (the tests of open propellers at low advance).
Equation 3 is published from h/R = 0 on; its curve reaches 0 at h/R = -0.48. Equation 2 neglects the
closure of cavities between the blades and the emergence of single blades. With both losses and
``surface_loss`` at 0, their neutral value, nothing is lost.
"""

from __future__ import annotations

import math
from typing import Any

from ..core.compiled import Real, Record, compiled
from ..core.lanes import everywhere, where
from .keys import Section, effect, parameter
from .open_water import REVOLUTIONS_PER_RADIAN
from .surroundings import GRAVITY

SUCTION_SHARE = 0.75
"""Share of a wetted blade's lift that is lost with its suction side: 1 - (pi / 2) / (2 pi)."""

HEAD_ROUNDING, LOSS_ROUNDING, BETA_ROUNDING = 0.2, 0.3, 0.05
"""Half widths of rounded corners: of h/R and 1 - 0.769 h/R, of phi, of beta [-]."""

SURFACE_TORQUE_POWER = 0.8
"""Power m of KQ/KQ0 = (KT/KT0)^m where blades near the surface lose thrust [-]."""

_STEEPNESS = 8.0 / 7.0
"""K; the slope of s over a is 2.5 in the middle, so there are two stable states."""


@compiled
def _smooth_step(v: Real) -> Real:
    """Return S(v): 0 up to v = 0, 1 from v = 1 on, with three continuous derivatives."""
    rising = v * v * v * v * (35.0 + v * (-84.0 + v * (70.0 - 20.0 * v)))
    return where(v.real <= 0.0, 0.0 * v, where(v.real >= 1.0, 1.0 + 0.0 * v, rising))


def _reach() -> float:
    """Return the distance of the folds of s(a) = a, in units of G."""
    # At a fold K S'(v) = 1, with S'(v) = 140 (v (1 - v))^3.
    product = (1.0 / (140.0 * _STEEPNESS)) ** (1.0 / 3.0)
    v = 0.5 * (1.0 - math.sqrt(1.0 - 4.0 * product))
    smooth_step: Any = _smooth_step  # not compiled here, where every import would wait for it
    return float(2.0 * (0.5 - (0.5 - v) / _STEEPNESS - smooth_step.py_func(v)))


_REACH = _reach()


class Ventilation(Section):
    """Ventilation of the propeller; absent if all losses are 0."""

    needs = "has_propeller in_liquid"

    # fmt: off
    thrust_loss: float = effect(0.0, "share of thrust lost by ventilation",
        record="ventilation_thrust_loss", ge=0, le=0.95)
    torque_loss: float = effect(0.0, "share of torque lost by ventilation",
        record="ventilation_torque_loss", ge=0, le=0.95)
    surface_loss: float = effect(0.0, "share of the loss of disc area near the surface that is applied",
        record="ventilation_surface_loss", ge=0, le=1)
    static_head_share: float = parameter(
        "share of the static head that loads ventilated blades; with 0 the losses are constant shares",
        record="ventilation_static_head", ge=0, le=1, default=1.0)
    onset_submergence: float = parameter("h/R at inception without load",
        record="ventilation_onset_submergence", ge=-1, le=5, default=0.0)
    suction_gain: float = parameter("increase of h/R at inception per suction head H/R",
        record="ventilation_suction_gain", ge=0, le=5, default=0.5)
    hysteresis: float = parameter("h/R at washout minus h/R at inception",
        record="ventilation_hysteresis", ge=0.05, le=3, default=0.3)
    growth_time_s: float = parameter("time constant of growth", "s", record="ventilation_growth_time",
        ge=0.05, le=20, default=0.5, lag=True)
    washout_time_s: float = parameter("time constant of washout", "s", record="ventilation_washout_time",
        ge=0.05, le=60, default=1.5, lag=True)
    # fmt: on


@compiled
def can_ventilate(plant: Record) -> bool:
    """Return whether the ship's record has ventilation switched on."""
    thrust, torque = plant.ventilation_thrust_loss, plant.ventilation_torque_loss
    return bool(thrust.real > 0.0 or torque.real > 0.0)


@compiled
def _rounded(x: Real, width: float) -> Real:
    """Return max(x, 0) with its corner rounded between -width and width.

    It is the integral of the smooth step: four continuous derivatives, and exact outside the corner.
    """
    t = 0.5 * (x / width + 1.0)
    t2 = t * t
    corner = width * (t2 * t2 * t * (14.0 + t * (-28.0 + t * (20.0 - 5.0 * t))))
    return where(x.real >= width, x, where(x.real <= -width, 0.0 * x, corner))


@compiled
def relative_submergence(plant: Record, submergence: Real) -> Real:
    """Return h/R [-] from the depth h [m] of the propeller's centre."""
    return 2.0 * submergence / plant.diameter


@compiled
def suction_head(plant: Record, thrust_coefficient: Real, shaft_speed: Real) -> Real:
    """Return the suction head H/R [-] of the loaded disc at omega [rad/s].

    KT [-] without ventilation is positive if the thrust points in the direction of rotation: a propeller
    that is driven by the flow draws no air.
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    return 8.0 / (math.pi * GRAVITY) * plant.diameter * thrust_coefficient * n * n


@compiled
def lost_suction(plant: Record, relative: Real, suction: Real) -> Real:
    """Return phi, the share [0, 1] of the suction H/R that the static head h/R cannot replace."""
    if plant.ventilation_static_head == 0.0:
        return 1.0 + 0.0 * relative
    area = plant.ventilation_static_head * plant.expanded_area_ratio
    head = area * _rounded(relative, HEAD_ROUNDING)
    wanted = SUCTION_SHARE * suction
    covered = wanted.real * (1.0 + LOSS_ROUNDING) <= head.real
    if everywhere(covered):
        return 0.0 * relative
    return where(covered, 0.0 * relative, _rounded(1.0 - head / wanted, LOSS_ROUNDING))


@compiled
def surface_factor(relative: Real) -> Real:
    """Return beta [-] at h/R: thrust near the surface / thrust in deep water, without ventilation."""
    near = _rounded(1.0 - 0.769 * relative, HEAD_ROUNDING)
    deep = near.real <= 0.0
    if everywhere(deep):
        return 1.0 + 0.0 * relative
    left = _rounded(1.0 - 0.675 * near**1.258, BETA_ROUNDING)
    return where(deep, 1.0 + 0.0 * relative, left)


@compiled
def ventilation_rate(plant: Record, degree: Real, relative: Real, suction: Real) -> Real:
    """Return the rate [1/s] of the degree of ventilation at h/R and H/R, equation 1 of this module."""
    middle = plant.ventilation_onset_submergence + plant.ventilation_suction_gain * suction
    middle = middle + 0.5 * plant.ventilation_hysteresis
    shift = plant.ventilation_hysteresis * (1.0 / _REACH)
    apart = (middle - relative) / shift + degree - 0.5
    share = _smooth_step(0.5 + _STEEPNESS * apart)
    pace = share / plant.ventilation_growth_time + (1.0 - share) / plant.ventilation_washout_time
    return (share - degree) * pace
