"""Seas by their spectra: JONSWAP, the presets of ``seas.toml``, and seas given by their parameters."""

from __future__ import annotations

import functools
import math
import tomllib
from importlib import resources

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..core.compiled import compiled
from .surroundings import GRAVITY

STEEPEST = 0.142
"""Height / length at which a wave in deep water breaks (Michell 1893; DNV-RP-C205, section 3.4.6)."""


class Sea(BaseModel):
    """A JONSWAP sea.

    ``heading_deg`` is the angle between the ship's initial course and the direction of wave travel: 180
    is head seas, 0 following seas, 90 beam seas that travel to starboard. The wind travels in the same
    direction and acts on ships with a ``[superstructure]``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    hs_m: float = Field(ge=0.0, le=25.0, description="significant wave height [m]")
    tp_s: float = Field(gt=1.0, le=30.0, description="peak period [s]")
    gamma: float = Field(default=3.3, ge=1.0, le=10.0, description="peak enhancement [-]")
    heading_deg: float = Field(
        default=180.0, ge=-360.0, le=360.0, description="direction of wave travel [deg]"
    )
    wind_m_s: float = Field(
        default=0.0, ge=0.0, le=60.0, description="true wind, which travels with the waves [m/s]"
    )

    @model_validator(mode="after")
    def _not_breaking(self) -> Sea:
        highest = STEEPEST * GRAVITY * self.tp_s**2 / (2.0 * math.pi)
        if self.hs_m > highest:
            raise ValueError(
                f"hs_m = {self.hs_m:g} m at tp_s = {self.tp_s:g} s: such waves break. At this period "
                f"the significant wave height is at most {math.floor(100.0 * highest) / 100.0:g} m, "
                f"{STEEPEST:g} of the wavelength"
            )
        return self


@compiled
def spectral_density(frequency: float, hs_m: float, tp_s: float, gamma: float) -> float:
    """Return the JONSWAP density [m2 s/rad] at omega > 0 [rad/s] (DNV-RP-C205, section 3.5.5)."""
    peak = 2.0 * math.pi / tp_s
    ratio = frequency / peak
    fourth = (ratio * ratio) * (ratio * ratio)
    pierson_moskowitz = 5.0 / 16.0 * hs_m**2 / peak / (fourth * ratio) * math.exp(-1.25 / fourth)
    width = 0.07 if ratio <= 1.0 else 0.09
    share = math.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    enhancement = math.exp(share * math.log(gamma))
    return (1.0 - 0.287 * math.log(gamma)) * pierson_moskowitz * enhancement


def jonswap(frequency: NDArray[np.float64], sea: Sea) -> NDArray[np.float64]:
    """Return the :func:`spectral_density` [m2 s/rad] at frequencies > 0 [rad/s] of any shape."""
    density = [spectral_density(w, sea.hs_m, sea.tp_s, sea.gamma) for w in np.ravel(frequency)]
    return np.reshape(density, np.shape(frequency))


@functools.cache
def presets() -> dict[str, Sea]:
    """Return the sea presets by name (``plant/seas.toml``)."""
    text = resources.files("shaftline.plant").joinpath("seas.toml").read_text(encoding="utf-8")
    return {name: Sea(**values) for name, values in tomllib.loads(text).items()}


_TEXT_KEYS = {
    "hs": "hs_m",
    "tp": "tp_s",
    "gamma": "gamma",
    "heading": "heading_deg",
    "wind": "wind_m_s",
}


def get_sea(text: str) -> Sea | None:
    """Return a sea by preset name or by its parameters, ``hs=3.2,tp=9.1``; None for ``calm``.

    Args:
        text: name, or ``hs`` [m] and ``tp`` [s], optionally with ``gamma`` [-], ``heading`` [deg] and
            ``wind`` [m/s].

    Raises:
        ValueError: unknown name (the message lists the known ones), or a parameter that is missing,
            repeated, not a number or out of range.

    >>> from shaftline.plant import get_sea
    >>> get_sea("hs=3.2,tp=9.1")
    Sea(hs_m=3.2, tp_s=9.1, gamma=3.3, heading_deg=180.0, wind_m_s=0.0)
    >>> get_sea("calm") is None
    True
    """
    if text == "calm":
        return None
    if "=" in text:
        return _sea_from_parameters(text)
    if text not in presets():
        known = ", ".join(["calm", *presets()])
        raise ValueError(
            f"unknown sea {text!r}; known seas: {known}; or give parameters such as hs=3.2,tp=9.1"
        )
    return presets()[text]


def _sea_from_parameters(text: str) -> Sea:
    values: dict[str, float] = {}
    for part in text.split(","):
        key, _, number = (word.strip() for word in part.partition("="))
        if key not in _TEXT_KEYS or _TEXT_KEYS[key] in values:
            known = ", ".join(_TEXT_KEYS)
            raise ValueError(f"sea {text!r}: {part.strip()!r} must be one of {known}, each once")
        try:
            values[_TEXT_KEYS[key]] = float(number)
        except ValueError:
            raise ValueError(f"sea {text!r}: {key} = {number!r} is not a number") from None
    try:
        return Sea(**values)
    except ValidationError as error:
        first = error.errors()[0]
        if not first["loc"]:  # The error concerns two parameters together.
            raise ValueError(f"sea {text!r}: {first['ctx']['error']}") from None
        about = Sea.model_fields[str(first["loc"][0])].description
        raise ValueError(f"sea {text!r}: {about}: {first['msg'].lower()}") from None
