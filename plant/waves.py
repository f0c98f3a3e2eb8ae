"""Irregular long-crested seas: a JONSWAP spectrum as a field of space and time.

The field moves past the ship as the ship moves through it, so the frequency of encounter is right at
any speed and needs no formula. In the kernels each of the 64 components is a unit phasor that turns
with the encounter frequency at the speed of the last synchronisation; what the ship's position
departs from that reference within an interval is followed by the field's slope.
"""

from __future__ import annotations

import functools
import math
import tomllib
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from ..core.compiled import Record, compiled
from .surroundings import GRAVITY

COMPONENTS = 64
SYNC_STEPS = 10
"""Plant steps between two synchronisations of the phasors with time and position."""

_BAND_EDGES = np.geomspace(0.55, 4.5, COMPONENTS + 1)  # over the peak frequency
_LANES = (COMPONENTS,)
_AHEAD_DEG = 45.0  # to either side of the bow; waves from there add to the resistance

SEA = np.dtype(
    [
        ("present", np.int64),
        ("amplitude", np.float64, _LANES),  # of the elevation [m]
        ("velocity", np.float64, _LANES),  # of the inflow at the propeller [m/s]
        ("slope", np.float64, _LANES),  # of the inflow along the track, per sine [1/s]
        ("frequency", np.float64, _LANES),  # [rad/s], at a fixed point
        ("wavenumber", np.float64, _LANES),  # along the ship's track [rad/m]
        ("phase", np.float64, _LANES),  # [rad]
        ("head_sea", np.float64),  # significant height squared of waves from ahead [m2]
        # working memory of the kernels
        ("cosine", np.float64, _LANES),
        ("sine", np.float64, _LANES),
        ("turn_cosine", np.float64, _LANES),
        ("turn_sine", np.float64, _LANES),
        ("scratch", np.float64, (3, COMPONENTS)),
        ("inflow", np.float64),  # at the reference position
        ("inflow_slope", np.float64),
        ("elevation", np.float64),
        ("reference_position", np.float64),
        ("reference_speed", np.float64),
    ],
    align=True,
)


class Sea(BaseModel):
    """A JONSWAP sea.

    ``heading_deg`` is the angle between the ship's course and the direction in which the waves
    travel: 180 is head seas, 0 following seas, 90 beam seas.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    hs_m: float = Field(ge=0.0, le=25.0, description="significant wave height [m]")
    tp_s: float = Field(gt=1.0, le=30.0, description="peak period [s]")
    gamma: float = Field(default=3.3, ge=1.0, le=10.0, description="peak enhancement [-]")
    heading_deg: float = Field(
        default=180.0, ge=-360.0, le=360.0, description="heading to the waves [deg]"
    )


def jonswap(frequency: NDArray[np.float64], sea: Sea) -> NDArray[np.float64]:
    """JONSWAP spectral density S(omega) [m2 s/rad] with the given Hs (DNV-RP-C205, section 3.5.5).

    Args:
        frequency: omega [rad/s], positive, any shape.
        sea: Hs, Tp and gamma.
    """
    peak = 2.0 * math.pi / sea.tp_s
    ratio = frequency / peak
    pierson_moskowitz = 5.0 / 16.0 * sea.hs_m**2 / peak * ratio**-5.0 * np.exp(-1.25 * ratio**-4.0)
    width = np.where(ratio <= 1.0, 0.07, 0.09)
    enhancement = sea.gamma ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    normalisation = 1.0 - 0.287 * math.log(sea.gamma)
    return np.asarray(normalisation * pierson_moskowitz * enhancement)


def calm() -> Any:
    """Sea record without waves."""
    return np.zeros(1, SEA)[0]


def realise(sea: Sea, depth_m: float, seed: int) -> Any:
    """Draw one realisation of a sea, as the record that the kernels take.

    Args:
        sea: spectrum and heading.
        depth_m: depth of the propeller's centre [m]; orbital motion decays with exp(-k z).
        seed: of the random phases and of the components' places within their frequency bands.

    Returns:
        SEA record of 64 components between 0.55 and 4.5 times the peak frequency, one at a random
        place in each of 64 bands that widen with frequency (so the sea does not repeat itself),
        scaled so that their energy is exactly Hs^2 / 16.
    """
    record = np.zeros(1, SEA)[0]
    if sea.hs_m == 0.0:
        return record
    rng = np.random.default_rng(seed)
    peak = 2.0 * math.pi / sea.tp_s
    edges = peak * _BAND_EDGES
    width = np.diff(edges)
    frequency = edges[:-1] + width * rng.random(COMPONENTS)
    amplitude = np.sqrt(2.0 * jonswap(frequency, sea) * width)
    amplitude *= sea.hs_m / 4.0 / math.sqrt(0.5 * float(np.sum(amplitude**2)))
    wavenumber = frequency**2 / GRAVITY
    along = math.cos(math.radians(sea.heading_deg))
    record["present"] = 1
    if along <= -math.cos(math.radians(_AHEAD_DEG)):
        record["head_sea"] = sea.hs_m**2
    record["amplitude"] = amplitude
    # water that moves with the ship takes inflow away, hence the minus
    record["velocity"] = -along * amplitude * frequency * np.exp(-wavenumber * depth_m)
    record["frequency"] = frequency
    record["wavenumber"] = -along * wavenumber
    record["slope"] = -record["velocity"] * record["wavenumber"]
    record["phase"] = rng.uniform(0.0, 2.0 * math.pi, COMPONENTS)
    return record


@functools.cache
def presets() -> dict[str, Sea]:
    """Sea presets by name (``plant/seas.toml``)."""
    text = resources.files("shaftline.plant").joinpath("seas.toml").read_text(encoding="utf-8")
    return {name: Sea(**values) for name, values in tomllib.loads(text).items()}


def get_sea(name: str) -> Sea | None:
    """Sea preset by name; None for ``calm``.

    Raises:
        ValueError: unknown name; the message lists the known ones.
    """
    if name == "calm":
        return None
    if name not in presets():
        known = ", ".join(["calm", *presets()])
        raise ValueError(f"unknown sea {name!r}; known seas: {known}")
    return presets()[name]


class WaveMotion(NamedTuple):
    """The field at the ship: inflow [m/s], its slope along the track [1/s], elevation [m]."""

    inflow: float
    inflow_slope: float
    elevation: float
    position: float
    head_sea: float  # significant height squared of waves from ahead [m2]


def field(sea: Any, time_s: float, position_m: float) -> tuple[float, float]:
    """Inflow [m/s] and surface elevation [m] at a time and place, by the plain sum of cosines."""
    angle = sea["frequency"] * time_s + sea["wavenumber"] * position_m + sea["phase"]
    return float(sea["velocity"] @ np.cos(angle)), float(sea["amplitude"] @ np.cos(angle))


_HALF_PI_HIGH = 1.5707963267341256  # pi/2 in two parts (Cody & Waite)
_HALF_PI_LOW = 6.077100506506192e-11


@compiled
def unit_phasors(
    angle: NDArray[np.float64], cosine: NDArray[np.float64], sine: NDArray[np.float64]
) -> None:
    """Cosine and sine of every angle, without branches so that the loop vectorises.

    Taylor series after reduction to +-pi/4; error below 2.1e-14 for |angle| < 1e5 rad.
    """
    for k in range(len(angle)):
        quadrant = np.floor(angle[k] * (2.0 / math.pi) + 0.5)
        r = (angle[k] - quadrant * _HALF_PI_HIGH) - quadrant * _HALF_PI_LOW
        r2 = r * r
        s = r * (
            1.0
            + r2
            * (
                -1.0 / 6.0
                + r2
                * (
                    1.0 / 120.0
                    + r2
                    * (
                        -1.0 / 5040.0
                        + r2
                        * (1.0 / 362880.0 + r2 * (-1.0 / 39916800.0 + r2 * (1.0 / 6227020800.0)))
                    )
                )
            )
        )
        c = 1.0 + r2 * (
            -0.5
            + r2
            * (
                1.0 / 24.0
                + r2
                * (
                    -1.0 / 720.0
                    + r2
                    * (
                        1.0 / 40320.0
                        + r2
                        * (-1.0 / 3628800.0 + r2 * (1.0 / 479001600.0 - r2 * (1.0 / 87178291200.0)))
                    )
                )
            )
        )
        # quadrant modulo 4 as floats: 0 -> (c, s), 1 -> (-s, c), 2 -> (-c, -s), 3 -> (s, -c)
        quarter = quadrant - 4.0 * np.floor(quadrant * 0.25)
        odd = quarter - 2.0 * np.floor(quarter * 0.5)
        half = 1.0 - 2.0 * np.floor(quarter * 0.5)
        cosine[k] = half * ((1.0 - odd) * c - odd * s)
        sine[k] = half * ((1.0 - odd) * s + odd * c)


@compiled
def _sum(lanes: NDArray[np.float64]) -> float:
    """Sum of 32 numbers by halving: vectorises with strict arithmetic, whatever the caller."""
    for k in range(16):
        lanes[k] += lanes[k + 16]
    for k in range(8):
        lanes[k] += lanes[k + 8]
    for k in range(4):
        lanes[k] += lanes[k + 4]
    return float((lanes[0] + lanes[2]) + (lanes[1] + lanes[3]))


@compiled
def inflow_ahead(
    sea: Record,
    time_s: float,
    position_m: float,
    speed: float,
    interval_s: float,
    found: NDArray[np.float64],
) -> None:
    """Inflow [m/s] where a ship will be that keeps her speed, as of :func:`field`.

    Args:
        sea: SEA record; its phasors stay untouched.
        time_s: now.
        position_m: of the ship, now.
        speed: of the ship [m/s].
        interval_s: between two entries of what is found.
        found: filled, the first with the present inflow.
    """
    found[:] = 0.0
    if sea.present == 0:
        return
    angle = sea.scratch[0]
    c, s, dc, ds = np.empty((4, COMPONENTS))
    for k in range(COMPONENTS):
        angle[k] = sea.frequency[k] * time_s + sea.wavenumber[k] * position_m + sea.phase[k]
    unit_phasors(angle, c, s)
    for k in range(COMPONENTS):
        angle[k] = (sea.frequency[k] + sea.wavenumber[k] * speed) * interval_s
    unit_phasors(angle, dc, ds)
    half = COMPONENTS // 2
    for i in range(len(found)):
        for k in range(half):
            angle[k] = sea.velocity[k] * c[k] + sea.velocity[k + half] * c[k + half]
        found[i] = _sum(angle)
        for k in range(COMPONENTS):
            turned = c[k] * dc[k] - s[k] * ds[k]
            s[k] = c[k] * ds[k] + s[k] * dc[k]
            c[k] = turned


@compiled
def _measure(sea: Record) -> None:
    """Sum the components at the reference position."""
    half = COMPONENTS // 2
    u, slope, elevation = sea.scratch[0], sea.scratch[1], sea.scratch[2]
    for k in range(half):
        u[k] = sea.velocity[k] * sea.cosine[k] + sea.velocity[k + half] * sea.cosine[k + half]
        slope[k] = sea.slope[k] * sea.sine[k] + sea.slope[k + half] * sea.sine[k + half]
        elevation[k] = (
            sea.amplitude[k] * sea.cosine[k] + sea.amplitude[k + half] * sea.cosine[k + half]
        )
    sea.inflow = _sum(u)
    sea.inflow_slope = _sum(slope)
    sea.elevation = _sum(elevation)


@compiled
def motion(sea: Record, position: float) -> WaveMotion:
    """The field at the ship; zero where there is no sea."""
    if sea.present != 0:
        return WaveMotion(
            sea.inflow, sea.inflow_slope, sea.elevation, sea.reference_position, sea.head_sea
        )
    return WaveMotion(0.0, 0.0, 0.0, position, 0.0)


@compiled
def turn(sea: Record, half_step: float) -> None:
    """Move the phasors and the reference position on by half a step."""
    for k in range(COMPONENTS):
        c = sea.cosine[k] * sea.turn_cosine[k] - sea.sine[k] * sea.turn_sine[k]
        s = sea.cosine[k] * sea.turn_sine[k] + sea.sine[k] * sea.turn_cosine[k]
        sea.cosine[k] = c
        sea.sine[k] = s
    sea.reference_position += sea.reference_speed * half_step
    _measure(sea)


@compiled
def synchronise(sea: Record, time: float, position: float, speed: float, half_step: float) -> None:
    """Set the phasors from time and position, and how far each turns in half a step at ``speed``.

    Args:
        sea: SEA record, changed in place.
        time: [s].
        position: of the ship along its track [m].
        speed: of the ship [m/s].
        half_step: half of the plant's time step [s].
    """
    sea.reference_position = position
    sea.reference_speed = speed
    angle = sea.scratch[0]
    for k in range(COMPONENTS):
        angle[k] = sea.frequency[k] * time + sea.wavenumber[k] * position + sea.phase[k]
    unit_phasors(angle, sea.cosine, sea.sine)
    for k in range(COMPONENTS):
        angle[k] = (sea.frequency[k] + sea.wavenumber[k] * speed) * half_step
    unit_phasors(angle, sea.turn_cosine, sea.turn_sine)
    _measure(sea)
