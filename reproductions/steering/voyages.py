"""Simulate Taylor's manoeuvres with his two controllers (2000, sections 5.2.3 and 5.3.3) on a surrogate.

The controllers see a noisy heading (0.1 degrees rms, assumed; the thesis prints none) or a noisy
position and act at intervals. Lengths are ship lengths; distances are those at 22 knots.

The thesis prints neither the wave force nor the direction of its sea. Two published forces are tried,
low-passed as in section 5.3.3.2:

- the second-order force of reflected waves, rho g a^2 / 2 for each metre and each reflected amplitude a
  (Maruo 1960), with the reflection of a vertical barrier of the ship's draught (Ursell 1947);
- the first-order force of the orbital accelerations on displaced water and added mass (Froude-Krylov
  and diffraction of long waves), integrated along the length, at the encounter frequency.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline import plant
from shaftline.baselines.autopilot import Autopilot
from shaftline.baselines.helmsman import Helmsman, SteeringMeasurements, TrackKeeper
from shaftline.core.lazy import control
from shaftline.plant import Equilibrium, Ship, Voyage
from shaftline.plant.expressions import MAX_SIGNALS
from shaftline.plant.stepping import UNDISTURBED
from shaftline.plant.surroundings import GRAVITY

Floats = NDArray[np.float64]

STATE, BEAM_DEG = "state-4", 90.0
DRIFT_ARM = 0.1  # of the second-order force, before midship [ship lengths]; assumed
LOW_PASS_S = 20.0  # time constant of the filter; the thesis names a filter and prints none
WAVE_STEP_S = 0.5


class WaveForce(NamedTuple):
    """Wave force over time, each of shape (n,)."""

    time_s: Floats
    side_N: Floats  # to starboard
    yaw_N_m: Floats


def sea_from(ship: Ship, heading_deg: float, seed: int) -> Any:
    """Return the SEA record of state 4 from 0 (following), 90 (beam) or 180 (head seas) degrees."""
    sea = plant.get_sea(STATE)
    assert sea is not None
    sea = sea.model_copy(update={"heading_deg": heading_deg})
    return plant.realise(sea, ship.propeller.depth_m, seed)


def reflection(frequency: Floats, draught_m: float) -> Floats:
    """Return the share of the amplitude that a vertical barrier reflects (Ursell 1947) [-].

    By the frequency [rad/s] and the depth of its lower edge [m].
    """
    kd = frequency**2 / GRAVITY * draught_m
    wall = math.pi * scipy.special.i1(kd)
    return np.asarray(wall / np.sqrt(wall**2 + scipy.special.k1(kd) ** 2))


def low_pass(values: Floats) -> Floats:
    """Return values at steps of :data:`WAVE_STEP_S` after a first-order filter of :data:`LOW_PASS_S`."""
    keep = math.exp(-WAVE_STEP_S / LOW_PASS_S)
    start = [values.mean() - (1.0 - keep) * values[0]]
    return np.asarray(scipy.signal.lfilter([1.0 - keep], [1.0, -keep], values, zi=start)[0])


def second_order(ship: Ship, sea: Any, seconds: float, wall: bool = False) -> WaveForce:
    """Return the slow second-order force of waves on the beam that the hull reflects.

    On a wall every wave is reflected completely, which no hull does.
    """
    frequency, hull = sea["frequency"], ship.manoeuvring
    share = np.ones_like(frequency) if wall else reflection(frequency, hull.draught_m)
    time = np.arange(0.0, seconds, WAVE_STEP_S)
    phases = np.exp(1j * (np.outer(time, frequency) + sea["phase"]))
    envelope = np.abs((sea["amplitude"] * share * phases).sum(axis=1))
    water = ship.water.density_kg_m3 * GRAVITY * hull.length_m
    side = 0.5 * water * low_pass(envelope**2)
    return WaveForce(time, side, DRIFT_ARM * hull.length_m * side)


def first_order(
    ship: Ship, sea: Any, seconds: float, heading_deg: float, speed_m_s: float
) -> WaveForce:
    """Return the slow part of the first-order force on a hull of one section over its length.

    The encounter frequency is w - w^2 U cos(heading) / g.
    """
    hull, frequency = ship.manoeuvring, sea["frequency"]
    angle, number = math.radians(heading_deg), frequency**2 / GRAVITY
    added = -hull.Y_vdot * 0.5 * ship.water.density_kg_m3 * hull.length_m**3
    depth = np.exp(-0.5 * number * hull.draught_m)
    force = (
        math.sin(angle) * (hull.displacement_kg + added) * sea["amplitude"] * frequency**2 * depth
    )
    half = 0.5 * number * hull.length_m * math.cos(angle) + 1e-9  # phase from midship to the bow
    time = np.arange(0.0, seconds, WAVE_STEP_S)
    met = frequency - number * speed_m_s * math.cos(angle)
    phases = np.outer(time, met) + sea["phase"]
    side = (force * np.sin(half) / half * np.sin(phases)).sum(axis=1)
    lever = 0.5 * hull.length_m * (np.sin(half) - half * np.cos(half)) / half**2
    yaw = (force * lever * np.cos(phases)).sum(axis=1)
    return WaveForce(time, low_pass(side), low_pass(yaw))


def with_wave_force(ship: Ship, force: WaveForce) -> tuple[Ship, Callable[[float], Any]]:
    """Return the ship with the terms of a wave force, and its signals as a function of time [s]."""
    terms = [
        {"id": "wave-force", "acts_on": "side_force", "expression": "wave_force"},
        {"id": "wave-moment", "acts_on": "yaw_moment", "expression": "wave_moment"},
    ]
    signals = {"wave_force": "N", "wave_moment": "N m"}
    vessel = ship.with_values({"signals": signals, "term": terms})

    def acting(time: float) -> Any:
        now = [float(np.interp(time, force.time_s, part)) for part in force[1:]]
        return UNDISTURBED._replace(outside=(*now, *(0.0,) * (MAX_SIGNALS - 2)))

    return vessel, acting


SHIP = "ddg-51-surrogate"
SPEED_M_S = 22.0 * 0.514444
CURRENT_M_S = 5.0 * 0.514444
INTERVAL_S = 0.5
HEADING_NOISE = math.radians(0.1)  # rms [rad]; assumed
TRACK_NOISE_M = 0.05
"""Rms noise of the position; assumed. The controller amplifies it 200 times."""
TURN_DEG = 8.0  # degrees per ship length in dead-reckoned turns: 90 degrees in about three minutes
CHANGE_LENGTHS = 38.0  # length of a track change: about eight minutes
GUST_AT, LEFT_AT, BACK_AT, END_AT = 20.0, 60.0, 140.0, 220.0  # [ship lengths]
REFLECTED, WALL, ORBITAL = "reflected", "wall", "orbital"

Orders = Callable[[float], tuple[float, float]]
"""Heading [rad] and cross track [m] by the distance [ship lengths]."""


@functools.cache
def ship() -> Ship:
    """Return the surrogate."""
    return plant.load_ship(SHIP)


@functools.cache
def straight() -> Equilibrium:
    """Return the straight course at 22 knots."""
    return plant.approach(ship(), SPEED_M_S)


def length_s() -> float:
    """Return the time for one ship length at 22 knots [s]."""
    return ship().manoeuvring.length_m / SPEED_M_S


def linear_plant(track: bool) -> control.StateSpace:
    """Return the linear model in ship lengths of heading, or of cross track, by rudder command."""
    whole = plant.linearise(ship(), straight(), outputs=("heading", "sway_speed"))
    names = ("sway_speed", "yaw_rate", "heading", "rudder_angle")
    kept = [whole.state_labels.index(name) for name in names]
    helm = whole.input_labels.index("rudder_command")
    unit = length_s()
    a, b = unit * whole.A[np.ix_(kept, kept)], unit * whole.B[kept][:, [helm]]
    heading, sway = whole.C[:, kept]
    if not track:
        return control.ss(a, b, [heading], [[0.0]])
    a = np.block([[a, np.zeros((4, 1))], [heading + sway / SPEED_M_S, 0.0]])  # y' = psi + v / U
    return control.ss(a, np.vstack([b, [[0.0]]]), [[0.0, 0.0, 0.0, 0.0, 1.0]], [[0.0]])


def simulate_voyage(
    helmsman: Helmsman,
    lengths: float,
    orders: Orders,
    sway_m_s: float = 0.0,
    current_at: float = math.inf,
    carried: bool = False,
    acting: Callable[[float], Any] = lambda _: UNDISTURBED,
    vessel: Ship | None = None,
    sea: Any = None,
    seed: int = 1,
) -> pd.DataFrame:
    """Simulate a voyage with a helmsman, from the straight course.

    Args:
        helmsman: controller of the rudder.
        lengths: distance [ship lengths].
        orders: set-points.
        sway_m_s: initial sway speed [m/s].
        current_at: distance at which the current to starboard begins [ship lengths].
        carried: whether the current is added to the cross track alone, as in the thesis.
        acting: disturbance by time [s].
        vessel: ship; the surrogate by default.
        sea: SEA record; calm by default.
        seed: of the measurement noise.

    Returns:
        A row for each interval: distance ``way``, position, cross track, heading, speeds, rudder and its
        command, set-points.
    """
    plain, point, unit = vessel or ship(), straight(), length_s()
    rng = np.random.default_rng(seed)
    state = point.state._replace(sway_speed=sway_m_s)
    drive, pitch = point.inputs.drive, point.inputs.pitch_command
    voyage, memory, rows, off, met = Voyage(plain, state, drive, sea), None, [], 0.0, False
    steps = round(INTERVAL_S / plain.time_step_s)
    for k in range(round(lengths * unit / INTERVAL_S)):
        time = k * INTERVAL_S
        flows = time >= current_at * unit
        if flows and not carried and not met:
            met, current = True, {"manoeuvring.cross_current_m_s": CURRENT_M_S}
            voyage = Voyage(plain.with_values(current), state, drive, sea)
        heading_order, track_order = orders(time / unit)
        read = (
            heading_order,
            state.heading + HEADING_NOISE * rng.standard_normal(),
            state.yaw_rate,
            state.rudder_angle,
            track_order,
            state.cross_track + off + TRACK_NOISE_M * rng.standard_normal(),
            state.ship_speed,
        )
        seen = SteeringMeasurements(*(np.array([value]) for value in read))
        memory = helmsman.initial_state(seen) if memory is None else memory
        command = float(helmsman.rudder(seen, memory)[0])
        rows.append(
            {
                "time_s": time,
                "way": time / unit,
                "position_m": state.position,
                "cross_track_m": state.cross_track + off,
                "heading_rad": state.heading,
                "yaw_rate_rad_s": state.yaw_rate,
                "sway_speed_m_s": state.sway_speed,
                "ship_speed_m_s": state.ship_speed,
                "rudder_rad": state.rudder_angle,
                "rudder_command_rad": command,
                "heading_order_rad": heading_order,
                "track_order_m": track_order,
                "aim": memory[0, 0],
            }
        )
        state = voyage.run(drive, pitch, command, steps, acting(time))
        off += INTERVAL_S * CURRENT_M_S * (flows and carried)
    return pd.DataFrame(rows)


def keep_heading(lengths: float, **given: Any) -> pd.DataFrame:
    """Simulate the autopilot on a straight course, with keywords of :func:`simulate_voyage`."""
    pilot = Autopilot(ship(), INTERVAL_S, SPEED_M_S)
    return simulate_voyage(pilot, lengths, lambda _: (0.0, 0.0), **given)


def two_turns(turn_deg: float = TURN_DEG) -> pd.DataFrame:
    """Simulate a turn to port of 90 degrees with a rate [deg per ship length], and later back."""
    pilot = Autopilot(ship(), INTERVAL_S, SPEED_M_S, turn_deg=turn_deg)
    return simulate_voyage(
        pilot, 90.0, lambda way: ((-math.radians(90.0) if 10.0 <= way < 50.0 else 0.0), 0.0)
    )


def dead_reckoning(track: pd.DataFrame) -> Floats:
    """Return positions at 22 knots on the commanded heading [ship lengths], shape (n, 2)."""
    heading = track["aim"].to_numpy()[:-1]
    steps = np.column_stack([np.cos(heading), np.sin(heading)])
    places = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.asarray(places * (INTERVAL_S / length_s()))


def wave_case(kind: str, seed: int, heading_deg: float = BEAM_DEG) -> tuple[Any, WaveForce]:
    """Return the SEA record of state 4 and its wave force over the track changes.

    The kind is REFLECTED or WALL (second order), or ORBITAL (first order).
    """
    record = sea_from(ship(), heading_deg, seed)
    seconds = END_AT * length_s() + 1.0
    if kind == ORBITAL:
        return record, first_order(ship(), record, seconds, heading_deg, SPEED_M_S)
    return record, second_order(ship(), record, seconds, kind == WALL)


def track_change(
    carried: bool = True, sea: tuple[Any, WaveForce] | None = None, seed: int = 1
) -> pd.DataFrame:
    """Simulate a track change two lengths to port, and back, in a beam current.

    The current is carried, that is added to the cross track alone, or acts on the hull.
    """
    two = -2.0 * ship().manoeuvring.length_m
    keeper = TrackKeeper(ship(), INTERVAL_S, SPEED_M_S, change_lengths=CHANGE_LENGTHS)
    more: dict[str, Any] = {}
    if sea is not None:
        more["sea"] = sea[0]
        more["vessel"], more["acting"] = with_wave_force(ship(), sea[1])
    return simulate_voyage(
        keeper,
        END_AT,
        lambda way: (0.0, (two if LEFT_AT <= way < BACK_AT else 0.0)),
        current_at=GUST_AT,
        carried=carried,
        seed=seed,
        **more,
    )
