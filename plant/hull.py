"""Hull: resistance in calm water and in waves, wake, and the effect of a current."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled
from ..core.lanes import everywhere, where
from ..core.numeric import clip
from .keys import INF, Section, effect, parameter, quantity, require
from .surroundings import GRAVITY


class Hull(Section):
    """Hull: surge dynamics, resistance and wake."""

    derived = (
        ("propellers", np.float64),
        ("hull_fixed", np.int64),
        ("wave_drag_length", np.float64),
    )

    # fmt: off
    fixed: bool = Field(default=False,
        description="held in place, as in a bollard-pull test or on a test bench")
    mass_kg: float = parameter("mass including added mass", "kg", record="mass", needs="moves",
        required="unless hull.fixed", ge=0.01, le=1e9, default=1.0)
    resistance_coefficient_N_s2_m2: float = parameter("c1 in R = c1 v^2 (see resistance_exponent)",
        "N s2/m2", record="resistance_coefficient", needs="moves", required="unless hull.fixed", ge=0,
        le=1e7, default=0.0)
    resistance_exponent: float = effect(2.0, "k in R = c1 v^2 (v / v_r)^(k - 2)",
        record="resistance_exponent", needs="moves", ge=1, le=6)
    resistance_reference_speed_m_s: float = parameter("v_r, speed at which R is c1 v^2", "m/s",
        record="resistance_reference_speed", needs="moves", gt=0, le=40, default=1.0)
    thrust_deduction: float = parameter("thrust deduction t", record="thrust_deduction",
        needs="moves has_propeller", ge=-0.2, lt=0.6, default=0.0)
    wake_fraction: float = parameter("wake fraction w", record="wake_fraction", needs="has_propeller",
        ge=-0.2, lt=0.6, default=0.0)
    beam_m: float = quantity("beam at the water line; 0: waves add no resistance", "m", default=0.0,
        ge=0, le=100)
    bow_length_m: float = quantity("length of the water line from the bow to 95 % of the beam", "m",
        default=0.0, ge=0, le=500)
    propellers: int = Field(default=1, ge=1, le=8, description="number k_p of equal propellers")
    fouling_fraction: float = effect(0.0, "added resistance as a share of the resistance",
        record="hull_fouling", needs="moves", ge=-0.5, le=3)
    current_m_s: float = effect(0.0, "current along the initial course, positive from astern", "m/s",
        record="current", needs="meets_water", ge=-5, le=5)
    wake_slope_s_m: float = effect(0.0, "change of wake fraction with speed", "s/m", record="wake_slope",
        needs="has_propeller", ge=-0.2, le=0.2)
    wake_reference_speed_m_s: float = parameter("speed at which the wake fraction is w", "m/s",
        record="wake_reference_speed", needs="has_propeller", ge=0, le=40, default=0.0)
    episode_resistance_fraction: float = effect(0.0, "added share of the resistance during the episode",
        record="episode_resistance", needs="moves", ge=-0.9, le=10)
    episode_start_s: float = parameter("start of the episode, from the start of the simulation", "s",
        record="episode_start", needs="moves", ge=0, default=0.0)
    episode_end_s: float = parameter("end of the episode", "s", record="episode_end", needs="moves",
        ge=0, default=INF)
    # fmt: on

    @model_validator(mode="after")
    def _complete(self) -> Hull:
        if self.episode_end_s < self.episode_start_s:
            raise ValueError(
                f"episode_end_s = {self.episode_end_s:g} s must not be before episode_start_s = "
                f"{self.episode_start_s:g} s"
            )
        if self.beam_m > 0.0:
            require(self, ("bow_length_m",), "with a beam_m")
            if self.bow_length_m == 0.0:
                raise ValueError("bow_length_m must be above 0 m if beam_m is given")
        if not self.fixed:
            keys = ("mass_kg", "resistance_coefficient_N_s2_m2")
            require(self, keys, "unless hull.fixed is true")
        return self

    def resistance_slope(self, speed_m_s: float) -> float:
        """Return the slope dR/dv [N s/m] of the resistance in calm water at a speed ahead [m/s]."""
        k, of_reference = self.resistance_exponent, speed_m_s / self.resistance_reference_speed_m_s
        drag = self.resistance_coefficient_N_s2_m2 * speed_m_s
        return float(k * drag * of_reference ** (k - 2.0))

    def fill(self, record: Any) -> None:
        """Write the parameters, the flag of a fixed hull and the length for the resistance in waves."""
        super().fill(record)
        if self.beam_m > 0.0:
            slender = math.sqrt(self.beam_m / self.bow_length_m)
            record["wave_drag_length"] = self.beam_m * slender / 16.0
        record["propellers"] = self.propellers
        record["hull_fixed"] = self.fixed


@compiled
def water_speed(plant: Record, ship_speed: Real) -> Real:
    """Return the speed through the water [m/s]; ``current`` is positive if it carries the ship ahead."""
    return ship_speed - plant.current


@compiled
def resistance(plant: Record, speed_through_water: Real, resistance_factor: Real) -> Real:
    """Return the resistance R [N] (thesis eq. 2-10), opposing the motion, with the share of fouling.

    The speed through the water is in m/s; ``resistance_factor`` is the disturbance d_c1, 1 in calm
    water.
    """
    sign = where(speed_through_water.real >= 0.0, 1.0, -1.0)
    factor = resistance_factor * (1.0 + plant.hull_fouling)
    if plant.resistance_exponent != 2.0:
        size = sign * speed_through_water / plant.resistance_reference_speed
        if size.real == 0.0:
            return 0.0 * size
        factor = factor * size ** (plant.resistance_exponent - 2.0)
    return sign * factor * plant.resistance_coefficient * speed_through_water * speed_through_water


WAVE_HEADWAY = 2.0
"""Speed ahead [m/s] from which waves add their full resistance."""


@compiled
def wave_resistance(plant: Record, head_sea: Real, speed_through_water: Real) -> Real:
    """Return the mean added resistance [N] of waves from ahead (STAWAVE-1, ISO 15016:2015, Annex D).

    R = rho g Hs^2 B sqrt(B / L_BWL) / 16, for waves that the bow reflects; ``head_sea`` is Hs^2 [m2] of
    waves within 45 degrees of the bow, 0 for other waves. It is valid for seas in which the ship hardly
    heaves and pitches; the resistance from larger ship motions is not modelled. The formula is made for
    speed trials, of a ship under way. Below 2 m/s ahead it fades by the cubic r^2 (3 - 2 r), and a ship
    without headway has none (assumed). So waves stop no ship and drive none astern; the drift of a ship
    without headway is not modelled.
    """
    force = plant.density * GRAVITY * plant.wave_drag_length * head_sea
    if everywhere(speed_through_water.real >= WAVE_HEADWAY):
        return force
    r = clip(speed_through_water / WAVE_HEADWAY, 0.0, 1.0)
    return force * r * r * (3.0 - 2.0 * r)


@compiled
def episode_factor(plant: Record, time: float, dt: float) -> float:
    """Return the factor [-] on the resistance over the step from ``time`` to ``time + dt`` [s].

    It is 1 + ``episode_resistance`` inside the window and 1 outside it. A step that contains an edge has
    the mean of both, so that a simulation depends continuously on the edges.
    """
    if plant.episode_resistance == 0.0:
        return 1.0
    inside = min(time + dt, plant.episode_end) - max(time, plant.episode_start)
    return float(1.0 + plant.episode_resistance * max(inside, 0.0) / dt)


@compiled
def wake_inflow(plant: Record, speed_through_water: Real) -> Real:
    """Return the advance velocity (1 - w) v [m/s] without disturbances (thesis eq. 2-8).

    ``wake_slope`` makes the wake fraction depend on speed, relative to ``wake_reference_speed``.
    """
    beyond = speed_through_water - plant.wake_reference_speed
    wake = plant.wake_fraction + plant.wake_slope * beyond
    return (1.0 - wake) * speed_through_water
