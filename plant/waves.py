"""Irregular long-crested seas: a JONSWAP spectrum as a field of space and time.

The field is evaluated at the moving ship, so the frequency of encounter is correct at any speed and
heading without a formula. The kernels compute the field in advance for the next ten steps, every half
step, along the path of a ship with constant velocity. There each of the 64 components is a unit phasor
that rotates with its encounter frequency. Deviations of the ship from that path are corrected by the
slopes of inflow and elevation.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import (
    Real,
    Record,
    compiled,
    compiled_apart,
    compiled_polynomial,
    compiled_sum,
)
from ..core.numeric import sine_cosine
from .kinematics import over_ground
from .seas import Sea, spectral_density
from .state import State
from .surroundings import GRAVITY

COMPONENTS = 64
SYNC_STEPS = 10
"""Number of time steps between two synchronisations of the field with time and position."""
_POINTS = 2 * SYNC_STEPS + 2  # of the path: every half step, both ends, and one to make them even

_BAND_EDGES = np.geomspace(0.55, 4.5, COMPONENTS + 1)  # relative to the peak frequency
_LANES = (COMPONENTS,)
_AHEAD = math.cos(math.radians(45.0))  # waves within this angle of the bow add resistance

SEA = np.dtype(
    [
        ("present", np.int64),
        ("amplitude", np.float64, _LANES),  # of the elevation [m]
        ("velocity", np.float64, _LANES),  # against the wave travel, at the propeller [m/s]
        ("slope", np.float64, _LANES),  # of the velocity along the wave travel, per sine [1/s]
        ("tilt", np.float64, _LANES),  # slope of the elevation along the wave travel, per sine [-]
        ("frequency", np.float64, _LANES),  # [rad/s], at a fixed point
        ("wavenumber", np.float64, _LANES),  # along the wave travel, negative [rad/m]
        ("phase", np.float64, _LANES),  # [rad]
        ("along", np.float64),  # cosine of the angle between wave travel and heading 0
        ("across", np.float64),  # sine of that angle
        ("height_squared", np.float64),  # Hs^2 [m2]
        ("wind", np.float64),  # true wind along the wave travel [m/s]
        # At the last synchronisation: share of the velocity that is inflow, and waves from ahead.
        ("met", np.float64),
        ("head_sea", np.float64),  # significant height squared [m2]
        # Field along the path.
        ("inflow", np.float64, (_POINTS,)),  # [m/s]
        ("inflow_slope", np.float64, (_POINTS,)),  # [1/s]
        ("elevation", np.float64, (_POINTS,)),  # [m]
        ("elevation_slope", np.float64, (_POINTS,)),  # [-]
        ("passed", np.int64),  # points of the path since then
        ("reference_place", np.float64),  # first point of the path, along the wave travel [m]
        ("reference_advance", np.float64),  # distance between two points of the path [m]
        # Working memory of the kernels: phasors at this point, at the next point, and their rotation.
        ("cosine", np.float64, _LANES),
        ("sine", np.float64, _LANES),
        ("next_cosine", np.float64, _LANES),
        ("next_sine", np.float64, _LANES),
        ("turn_cosine", np.float64, _LANES),
        ("turn_sine", np.float64, _LANES),
        ("angle", np.float64, _LANES),
    ],
    align=True,
)


def calm_sea() -> Any:
    """Return a sea record without waves."""
    return np.zeros(1, SEA)[0]


def realise(sea: Sea, depth_m: float, seed: int) -> Any:
    """Return one realisation of a sea, as a record for the kernels.

    Args:
        sea: spectrum and heading.
        depth_m: depth of the propeller's centre [m]; orbital motion decays with exp(-k z).
        seed: seed of the random phases and of the components' frequencies within their bands.

    Returns:
        SEA record of 64 components between 0.55 and 4.5 times the peak frequency, one at a random
        frequency in each of 64 bands that widen with frequency (so the sea does not repeat itself),
        scaled so that their energy is exactly Hs^2 / 16.

    Raises:
        ValueError: the depth is negative or not finite.

    >>> from shaftline.plant import get_sea, realise
    >>> sea = realise(get_sea("hs=3.2,tp=9.1"), depth_m=4.0, seed=1)
    >>> round(4.0 * float(sum(sea["amplitude"] ** 2) / 2.0) ** 0.5, 3)  # 4 sqrt(m0) = Hs [m]
    3.2
    """
    if not 0.0 <= depth_m < math.inf:
        raise ValueError(f"depth_m = {depth_m} must be finite and at least 0 m below the surface")
    record = calm_sea()
    shares = np.random.default_rng(seed).random(2 * COMPONENTS)
    fill_sea(record, sea.hs_m, sea.tp_s, sea.gamma, sea.heading_deg, sea.wind_m_s, depth_m, shares)
    return record


@compiled
def fill_sea(
    sea: Record,
    hs_m: float,
    tp_s: float,
    gamma: float,
    heading_deg: float,
    wind_m_s: float,
    depth_m: float,
    shares: NDArray[np.float64],
) -> None:
    """Fill a calm sea record with one realisation of a JONSWAP sea; a height of 0 adds no waves.

    The arguments are those of :func:`realise`, with the heading relative to the initial course [deg].
    ``shares`` are random numbers uniform in [0, 1), shape (128,): the components' positions within their
    frequency bands, then their phases in turns.
    """
    if hs_m == 0.0 and wind_m_s == 0.0:
        return
    sea.wind = wind_m_s
    sea.along = math.cos(math.radians(heading_deg))
    sea.across = math.sin(math.radians(heading_deg))
    if hs_m == 0.0:
        return
    peak, energy = 2.0 * math.pi / tp_s, 0.0
    for k in range(COMPONENTS):
        low = peak * _BAND_EDGES[k]
        width = peak * _BAND_EDGES[k + 1] - low
        sea.frequency[k] = low + width * shares[k]
        variance = spectral_density(sea.frequency[k], hs_m, tp_s, gamma) * width
        energy += variance
        sea.amplitude[k] = math.sqrt(2.0 * variance)
    scale = hs_m / 4.0 / math.sqrt(energy)
    for k in range(COMPONENTS):
        wavenumber = sea.frequency[k] ** 2 / GRAVITY
        sea.amplitude[k] *= scale
        sea.velocity[k] = sea.amplitude[k] * sea.frequency[k] * math.exp(-wavenumber * depth_m)
        sea.wavenumber[k] = -wavenumber
        sea.slope[k] = sea.velocity[k] * wavenumber
        sea.tilt[k] = sea.amplitude[k] * wavenumber
        sea.phase[k] = 2.0 * math.pi * shares[COMPONENTS + k]
    sea.present = 1
    sea.height_squared = hs_m**2
    _set_heading(sea, 0.0)


class WaveMotion(NamedTuple):
    """Waves at the ship: inflow, elevation and their slopes."""

    inflow: float  # [m/s]
    inflow_slope: float  # along the wave travel [1/s]
    elevation: float  # [m]
    place: float  # position along the wave travel for inflow and elevation [m]
    head_sea: float  # significant height squared of waves from ahead [m2]
    elevation_slope: float  # along the wave travel [-]


@compiled
def _inflow_share(sea: Record, heading: float) -> float:
    """Return the share of the orbital velocity that is inflow on a heading [rad].

    Water that moves with the ship reduces the inflow, hence the minus sign.
    """
    return float(-(sea.along * math.cos(heading) + sea.across * math.sin(heading)))


@compiled
def _set_heading(sea: Record, heading: float) -> None:
    """Set the inflow share and the waves from ahead for a heading [rad]."""
    sea.met = _inflow_share(sea, heading)
    sea.head_sea = sea.height_squared if sea.met >= _AHEAD else 0.0


@compiled
def _place(sea: Record, position: Real, cross_track: Real) -> Real:
    """Return the position of a ship along the wave travel [m]."""
    return position * sea.along + cross_track * sea.across


def wave_field(
    sea: Any, time_s: float, position_m: float, cross_track_m: float = 0.0, heading_rad: float = 0.0
) -> tuple[float, float]:
    """Return inflow [m/s] and surface elevation [m] at a time and position, as a sum of cosines."""
    place = position_m * sea["along"] + cross_track_m * sea["across"]
    angle = sea["frequency"] * time_s + sea["wavenumber"] * place + sea["phase"]
    inflow = _inflow_share(sea, heading_rad) * float(sea["velocity"] @ np.cos(angle))
    return inflow, float(sea["amplitude"] @ np.cos(angle))


@compiled_polynomial
def unit_phasors(
    angle: NDArray[np.float64], cosine: NDArray[np.float64], sine: NDArray[np.float64]
) -> None:
    """Compute cosine and sine of every angle, in a loop that vectorises."""
    for k in range(len(angle)):
        sine[k], cosine[k] = sine_cosine(angle[k])


@compiled
def _set_phasors(sea: Record, time: float, place: float, speed: float, interval: float) -> None:
    """Set the phasor of each component at a position, and one interval [s] later at constant speed.

    Position [m] and speed [m/s] are those along the wave travel.
    """
    for k in range(COMPONENTS):
        sea.angle[k] = sea.frequency[k] * time + sea.wavenumber[k] * place + sea.phase[k]
    unit_phasors(sea.angle, sea.cosine, sea.sine)
    for k in range(COMPONENTS):
        sea.angle[k] = (sea.frequency[k] + sea.wavenumber[k] * speed) * interval
    unit_phasors(sea.angle, sea.turn_cosine, sea.turn_sine)
    for k in range(COMPONENTS):
        c, s, dc, ds = sea.cosine[k], sea.sine[k], sea.turn_cosine[k], sea.turn_sine[k]
        sea.next_cosine[k] = c * dc - s * ds
        sea.next_sine[k] = c * ds + s * dc


@compiled_sum
def _superpose(sea: Record) -> None:
    """Sum the components at every point of the path.

    Chebyshev's recurrence, cos (n + 1) d = 2 cos d cos n d - cos (n - 1) d and likewise for the sine,
    leads from point to point, two points at once. An error at one point grows no faster than the number
    of points after it, so after 22 points a phasor is wrong by less than 1e-12.
    """
    for i in range(0, _POINTS, 2):
        u = slope = elevation = tilt = 0.0
        next_u = next_slope = next_elevation = next_tilt = 0.0
        for k in range(COMPONENTS):
            twice, amplitude = 2.0 * sea.turn_cosine[k], sea.amplitude[k]
            c, s, next_c, next_s = sea.cosine[k], sea.sine[k], sea.next_cosine[k], sea.next_sine[k]
            u += sea.velocity[k] * c
            slope += sea.slope[k] * s
            elevation += amplitude * c
            tilt += sea.tilt[k] * s
            next_u += sea.velocity[k] * next_c
            next_slope += sea.slope[k] * next_s
            next_elevation += amplitude * next_c
            next_tilt += sea.tilt[k] * next_s
            sea.cosine[k] = c = twice * next_c - c
            sea.sine[k] = s = twice * next_s - s
            sea.next_cosine[k] = twice * c - next_c
            sea.next_sine[k] = twice * s - next_s
        sea.inflow[i], sea.inflow[i + 1] = u, next_u
        sea.inflow_slope[i], sea.inflow_slope[i + 1] = slope, next_slope
        sea.elevation[i], sea.elevation[i + 1] = elevation, next_elevation
        sea.elevation_slope[i], sea.elevation_slope[i + 1] = tilt, next_tilt


@compiled_sum
def _sum_inflow(sea: Record, found: NDArray[np.float64]) -> None:
    """Sum the inflow alone [m/s] at the points of ``found``."""
    for i in range(len(found)):
        u = 0.0
        for k in range(COMPONENTS):
            c, next_c = sea.cosine[k], sea.next_cosine[k]
            u += sea.velocity[k] * c
            sea.cosine[k] = next_c
            sea.next_cosine[k] = 2.0 * sea.turn_cosine[k] * next_c - c
        found[i] = u


@compiled
def inflow_ahead(
    sea: Record, time_s: float, state: State, interval_s: float, found: NDArray[np.float64]
) -> None:
    """Compute the future inflow [m/s] of a ship with constant speed and heading, as :func:`wave_field`.

    ``found`` is filled with the inflow at intervals [s], the present one first. The path of the record's
    last synchronisation is kept.
    """
    found[:] = 0.0
    if sea.present == 0:
        return
    north, east = over_ground(state)
    place = _place(sea, state.position, state.cross_track)
    _set_phasors(sea, time_s, place, _place(sea, north, east), interval_s)
    _sum_inflow(sea, found)
    found *= _inflow_share(sea, state.heading)


@compiled
def wave_motion(sea: Record) -> WaveMotion:
    """Return the waves at the ship; zero without a sea."""
    i = sea.passed
    if sea.present != 0:
        return WaveMotion(
            sea.met * sea.inflow[i],
            sea.met * sea.inflow_slope[i],
            sea.elevation[i],
            sea.reference_place + i * sea.reference_advance,
            sea.head_sea,
            sea.elevation_slope[i],
        )
    return WaveMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compiled
def pass_half_step(sea: Record) -> None:
    """Advance to the next point of the path."""
    sea.passed += 1


@compiled_apart
def synchronise(sea: Record, time: float, state: State, half_step: float) -> None:
    """Compute the field for the next ``SYNC_STEPS`` steps of a ship with constant velocity.

    The heading of the state is used until the next synchronisation; ``half_step`` is half of the plant's
    time step [s].
    """
    north, east = over_ground(state)
    place, speed = _place(sea, state.position, state.cross_track), _place(sea, north, east)
    _set_heading(sea, state.heading)
    sea.passed = 0
    sea.reference_place = place
    sea.reference_advance = speed * half_step
    _set_phasors(sea, time, place, speed, half_step)
    _superpose(sea)
