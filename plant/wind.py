"""Ship above the water line: the resistance of the wind."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled
from ..core.lanes import one_by_one
from ..core.numeric import modulus, sine_cosine
from .keys import Section, quantity

AIR_DENSITY = 1.225
"""Density of air at 15 degrees Celsius and 1013 hPa [kg/m3]."""

SMOOTHED = math.radians(10.0)
"""Angle about a beam wind over which both ranges of the regression are joined (ISO 15016, Annex C)."""

POINTS = 81
"""Number of points of the ship record's table of the coefficient, from a wind ahead to one astern."""

_REGRESSION = (
    "length_overall_m",
    "beam_m",
    "lateral_area_m2",
    "deck_area_m2",
    "lateral_centre_height_m",
    "bridge_height_m",
)


class Superstructure(Section):
    """Ship above the water line, for the wind resistance.

    The coefficient is that of a wind tunnel test (``angle_deg`` and ``coefficient``), or follows from
    the regression of Fujiwara et al. (2005) on the areas and heights.
    """

    needs = "moves"
    derived = (("wind_area", np.float64), ("wind_coefficients", np.float64, (POINTS,)))

    # fmt: off
    frontal_area_m2: float = quantity(
        "transverse projected area A_XV, superstructure included; 0: the wind adds no resistance", "m2",
        default=0.0, ge=0, le=1e5)
    length_overall_m: float | None = quantity("length overall L_OA", "m", default=None, gt=0, le=500)
    beam_m: float | None = quantity("beam B", "m", default=None, gt=0, le=100)
    lateral_area_m2: float | None = quantity("lateral projected area A_YV", "m2", default=None, gt=0,
        le=1e5)
    deck_area_m2: float | None = quantity("lateral projected area of superstructures on deck, A_OD",
        "m2", default=None, ge=0, le=1e5)
    lateral_centre_m: float = quantity("centre of the lateral area forward of midships, C_MC", "m",
        default=0.0, ge=-250, le=250)
    lateral_centre_height_m: float | None = quantity(
        "height of that centre above the water line, h_C", "m", default=None, gt=0, le=100)
    bridge_height_m: float | None = quantity("height of the top of the superstructure, h_BR", "m",
        default=None, gt=0, le=200)
    angle_deg: tuple[Annotated[float, Field(ge=0, le=180)], ...] = quantity(
        "relative wind angles of a test, rising from 0 (ahead) to 180", "deg", default=(), strict=False,
        max_length=256)
    coefficient: tuple[Annotated[float, Field(ge=-5, le=5)], ...] = quantity(
        "wind resistance coefficient at these angles, positive from ahead", "-", default=(),
        strict=False, max_length=256)
    anemometer_height_m: float = quantity("height of the anemometer above the water line", "m",
        default=10.0, gt=0, le=100)
    reference_height_m: float = quantity("height at which the coefficients hold", "m", default=10.0,
        gt=0, le=100)
    # fmt: on

    @property
    def present(self) -> bool:
        """Whether the wind acts on the ship."""
        return self.frontal_area_m2 > 0.0

    @model_validator(mode="after")
    def _complete(self) -> Superstructure:
        fields = type(self).model_fields
        if all(getattr(self, key) == info.default for key, info in fields.items()):
            return self
        if not self.present:
            raise ValueError("frontal_area_m2 is missing: it must be above 0 m2")
        if len(self.angle_deg) != len(self.coefficient):
            raise ValueError(
                f"angle_deg has {len(self.angle_deg)} values and coefficient {len(self.coefficient)}"
            )
        if self.angle_deg:
            steps = np.diff(self.angle_deg)
            if self.angle_deg[0] != 0.0 or self.angle_deg[-1] != 180.0 or not np.all(steps > 0.0):
                raise ValueError("angle_deg must rise from 0 to 180")
            return self
        if lacking := [key for key in _REGRESSION if getattr(self, key) is None]:
            raise ValueError(
                f"{', '.join(lacking)} missing: the regression of the wind coefficient needs them; or "
                "give angle_deg and coefficient of a wind tunnel test"
            )
        return self

    def wind_coefficient(self, angle_rad: float) -> float:
        """Return the wind resistance coefficient C_AA at a relative wind angle; 0 is wind from ahead.

        Example:
            >>> ship = Superstructure(
            ...     frontal_area_m2=1200, length_overall_m=180, beam_m=28, lateral_area_m2=2800,
            ...     deck_area_m2=850, lateral_centre_m=5, lateral_centre_height_m=15, bridge_height_m=45,
            ... )
            >>> round(ship.wind_coefficient(0.0), 3), round(ship.wind_coefficient(math.pi), 3)
            (0.608, -0.511)

        Args:
            angle_rad: relative wind angle [rad]; the ship is symmetric.
        """
        if not self.present:
            return 0.0
        angle = abs(math.remainder(angle_rad, 2.0 * math.pi))
        if self.angle_deg:
            return float(np.interp(math.degrees(angle), self.angle_deg, self.coefficient))
        half = math.pi / 2.0
        if abs(angle - half) < SMOOTHED:
            low, high = self._regression(half - SMOOTHED), self._regression(half + SMOOTHED)
            return low + (angle - half + SMOOTHED) / (2.0 * SMOOTHED) * (high - low)
        return self._regression(angle)

    def _regression(self, angle: float) -> float:
        """Return the coefficient of Fujiwara et al. (2005), ISO 15016:2015, Annex C."""
        frontal = self.frontal_area_m2
        length, beam, lateral, deck, centre, bridge = (  # none is missing: see _complete
            getattr(self, key) or 0.0 for key in _REGRESSION
        )
        if angle < math.pi / 2.0:
            along = (
                0.922 - 0.507 * lateral / (length * beam) - 1.162 * self.lateral_centre_m / length
            )
            lift = -0.458 - 3.245 * lateral / (length * bridge) + 2.313 * frontal / (beam * bridge)
            induced = 0.585 + 0.906 * deck / lateral - 3.239 * beam / length
        else:
            along = (
                -0.018
                + 5.091 * beam / length
                - 10.367 * centre / length
                + 3.011 * deck / length**2
                + 0.341 * frontal / beam**2
            )
            lift = (
                1.901
                - 12.727 * lateral / (length * bridge)
                - 24.407 * frontal / lateral
                + 40.310 * beam / length
                + 5.481 * frontal / (beam * bridge)
            )
            induced = 0.314 + 1.117 * deck / lateral
        sine, cosine = math.sin(angle), math.cos(angle)
        return (
            along * cosine
            + lift * (sine - 0.5 * sine * cosine**2) * sine * cosine
            + induced * sine * cosine**3
        )

    def fill(self, record: Any) -> None:
        """Write the area, and the coefficients at equal steps of :func:`_beam_share`."""
        record["wind_area"] = self.frontal_area_m2
        if self.present:
            share = np.linspace(0.0, 2.0, POINTS)
            angles = np.arctan2(1.0 - np.abs(1.0 - share), 1.0 - share)
            record["wind_coefficients"] = [self.wind_coefficient(angle) for angle in angles]


@one_by_one
@compiled
def wind_resistance(
    plant: Record,
    wind: Real,
    wave_along: float,
    wave_across: float,
    ship_speed: Real,
    sway_speed: Real,
    heading: Real,
) -> Real:
    """Return the resistance increase [N] by a true wind (ISO 15016:2015, Annex C).

    The wind [m/s] travels with the waves, whose direction has the cosine ``wave_along`` and the sine
    ``wave_across`` to heading 0. The air resistance of the ship's own speed belongs to calm water and is
    subtracted. Velocities are over ground [m/s], the heading is in rad.
    """
    sine, cosine = sine_cosine(heading)
    along = wind * (wave_along * cosine + wave_across * sine)
    across = wind * (wave_across * cosine - wave_along * sine)
    still = _air_resistance(plant, ship_speed, sway_speed)
    return _air_resistance(plant, ship_speed - along, sway_speed - across) - still


@compiled
def _air_resistance(plant: Record, ahead: Real, across: Real) -> Real:
    """Return the resistance [N] of a ship that moves ahead and across through the air [m/s]."""
    squared = ahead * ahead + across * across
    if squared.real == 0.0:
        return 0.0 * squared
    place = 0.5 * (POINTS - 1) * _beam_share(ahead, across)
    k = min(max(int(place.real), 0), POINTS - 2)
    low, high = plant.wind_coefficients[k], plant.wind_coefficients[k + 1]
    coefficient = low + (place - k) * (high - low)
    return 0.5 * AIR_DENSITY * plant.wind_area * coefficient * squared


@compiled
def _beam_share(ahead: Real, across: Real) -> Real:
    """Return |v| / (|u| + |v|) for a wind from ahead and 2 less that for one from astern, 0 to 2.

    It rises with the angle of the wind and needs no inverse function, which complex steps do not have.
    """
    side = modulus(across)
    share = side / (modulus(ahead) + side)
    return share if ahead.real >= 0.0 else 2.0 - share
