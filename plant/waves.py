"""Irregular long-crested seas: a JONSWAP spectrum as a field of space and time.

The field moves past the ship as the ship moves through it, so the frequency of encounter is right at
any speed and on any heading, and needs no formula. In the kernels the field is worked out ahead for the
next ten steps, every half step, along the path of a ship that keeps her velocity: there each of the 64
components is a unit phasor that turns with its encounter frequency. What the ship's position departs
from that path is followed by the slopes of inflow and elevation.
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
"""Plant steps between two synchronisations of the field with time and position."""
_POINTS = 2 * SYNC_STEPS + 2  # of the path: every half step, both ends, one to make them even

_BAND_EDGES = np.geomspace(0.55, 4.5, COMPONENTS + 1)  # over the peak frequency
_LANES = (COMPONENTS,)
_AHEAD = math.cos(math.radians(45.0))  # to either side of the bow; waves from there add resistance

SEA = np.dtype(
    [
        ("present", np.int64),
        ("amplitude", np.float64, _LANES),  # of the elevation [m]
        ("velocity", np.float64, _LANES),  # against the waves' travel, at the propeller [m/s]
        ("slope", np.float64, _LANES),  # of the velocity along their travel, per sine [1/s]
        ("tilt", np.float64, _LANES),  # slope of the elevation along their travel, per sine [-]
        ("frequency", np.float64, _LANES),  # [rad/s], at a fixed point
        ("wavenumber", np.float64, _LANES),  # along their travel, negative [rad/m]
        ("phase", np.float64, _LANES),  # [rad]
        ("along", np.float64),  # cosine of their travel's angle to a heading of 0
        ("across", np.float64),  # its sine
        ("height_squared", np.float64),  # Hs^2 [m2]
        # as last synchronised: how much of the velocity meets the ship, what comes from ahead
        ("met", np.float64),
        ("head_sea", np.float64),  # significant height squared [m2]
        # and along the path
        ("inflow", np.float64, (_POINTS,)),  # [m/s]
        ("inflow_slope", np.float64, (_POINTS,)),  # [1/s]
        ("elevation", np.float64, (_POINTS,)),  # [m]
        ("elevation_slope", np.float64, (_POINTS,)),  # [-]
        ("passed", np.int64),  # points since then
        ("reference_place", np.float64),  # of the path's first point, along the waves' travel [m]
        ("reference_advance", np.float64),  # between two of its points [m]
        # working memory of the kernels: components here, one point on, and how far they turn
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

    Raises:
        ValueError: a depth that is none.
    """
    if not 0.0 <= depth_m < math.inf:
        raise ValueError(f"depth_m = {depth_m}: must be 0 or more [m], below the surface")
    record = calm()
    shares = np.random.default_rng(seed).random(2 * COMPONENTS)
    fill_sea(record, sea.hs_m, sea.tp_s, sea.gamma, sea.heading_deg, depth_m, shares)
    return record


@compiled
def fill_sea(
    sea: Record, hs_m: float, tp_s: float, gamma: float, heading_deg: float, depth_m: float,
    shares: NDArray[np.float64],
) -> None:  # fmt: skip
    """Fill a calm sea record with one realisation of a JONSWAP sea; a height of 0 leaves it calm.

    Args:
        sea: SEA record of :func:`calm`, changed in place.
        hs_m: significant wave height [m].
        tp_s: peak period [s].
        gamma: peak enhancement [-].
        heading_deg: direction of the waves' travel to the ship's first course [deg].
        depth_m: depth of the propeller's centre [m].
        shares: random numbers uniform in [0, 1), shape (128,): the components' places within their
            frequency bands, then their phases in turns.
    """
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
    sea.along = math.cos(math.radians(heading_deg))
    sea.across = math.sin(math.radians(heading_deg))
    sea.height_squared = hs_m**2
    _face(sea, 0.0)


class WaveMotion(NamedTuple):
    """The field at the ship."""

    inflow: float  # [m/s]
    inflow_slope: float  # along the waves' travel [1/s]
    elevation: float  # [m]
    place: float  # along their travel, where inflow and elevation hold [m]
    head_sea: float  # significant height squared of waves from ahead [m2]
    elevation_slope: float  # along the waves' travel [-]


@compiled
def _met(sea: Record, heading: float) -> float:
    """Share of the water's velocity against the waves' travel that is inflow on a heading [rad].

    Water that moves with the ship takes inflow away, hence the minus.
    """
    return float(-(sea.along * math.cos(heading) + sea.across * math.sin(heading)))


@compiled
def _face(sea: Record, heading: float) -> None:
    """Set what of the sea meets a ship on a heading [rad]."""
    sea.met = _met(sea, heading)
    sea.head_sea = sea.height_squared if sea.met >= _AHEAD else 0.0


@compiled
def _place(sea: Record, position: Real, cross_track: Real) -> Real:
    """How far along the waves' travel a ship is [m]."""
    return position * sea.along + cross_track * sea.across


def field(
    sea: Any, time_s: float, position_m: float, cross_track_m: float = 0.0, heading_rad: float = 0.0
) -> tuple[float, float]:
    """Inflow [m/s] and surface elevation [m] at a time and place, by the plain sum of cosines."""
    place = position_m * sea["along"] + cross_track_m * sea["across"]
    angle = sea["frequency"] * time_s + sea["wavenumber"] * place + sea["phase"]
    inflow = _met(sea, heading_rad) * float(sea["velocity"] @ np.cos(angle))
    return inflow, float(sea["amplitude"] @ np.cos(angle))


@compiled_polynomial
def unit_phasors(
    angle: NDArray[np.float64], cosine: NDArray[np.float64], sine: NDArray[np.float64]
) -> None:
    """Cosine and sine of every angle, in a loop that vectorises."""
    for k in range(len(angle)):
        sine[k], cosine[k] = sine_cosine(angle[k])


@compiled
def _set_phasors(sea: Record, time: float, place: float, speed: float, interval: float) -> None:
    """Set every component's phasor at a place and one interval [s] on, at a speed that is kept.

    Place [m] and speed [m/s] are those along the waves' travel.
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

    From point to point by Chebyshev's recurrence, cos (n + 1) d = 2 cos d cos n d - cos (n - 1) d, and
    so the sine; two points at once. An error at one point grows no faster than with the number of
    points beyond it, so after 22 of them a phasor is wrong by less than 1e-12.
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
    """The inflow alone [m/s] at as many points as are asked for."""
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
    """Inflow [m/s] where a ship will be that keeps speed and heading, as of :func:`field`.

    Args:
        sea: SEA record; the path of its last synchronisation stays.
        time_s: now.
        state: of the ship, now.
        interval_s: between two entries of what is found.
        found: filled, the first with the present inflow.
    """
    found[:] = 0.0
    if sea.present == 0:
        return
    north, east = over_ground(state)
    place = _place(sea, state.position, state.cross_track)
    _set_phasors(sea, time_s, place, _place(sea, north, east), interval_s)
    _sum_inflow(sea, found)
    found *= _met(sea, state.heading)


@compiled
def motion(sea: Record) -> WaveMotion:
    """The field at the ship; zero where there is no sea."""
    i = sea.passed
    if sea.present != 0:
        return WaveMotion(
            sea.met * sea.inflow[i], sea.met * sea.inflow_slope[i], sea.elevation[i],
            sea.reference_place + i * sea.reference_advance, sea.head_sea,
            sea.elevation_slope[i],
        )  # fmt: skip
    return WaveMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compiled
def pass_half_step(sea: Record) -> None:
    """Go on to the next point of the path."""
    sea.passed += 1


@compiled_apart
def synchronise(sea: Record, time: float, state: State, half_step: float) -> None:
    """Work the field out ahead, for the next ``SYNC_STEPS`` steps of a ship that keeps her velocity.

    Args:
        sea: SEA record, changed in place.
        time: [s].
        state: of the ship; what meets her is that of her heading until the next synchronisation.
        half_step: half of the plant's time step [s].
    """
    north, east = over_ground(state)
    place, speed = _place(sea, state.position, state.cross_track), _place(sea, north, east)
    _face(sea, state.heading)
    sea.passed = 0
    sea.reference_place = place
    sea.reference_advance = speed * half_step
    _set_phasors(sea, time, place, speed, half_step)
    _superpose(sea)
