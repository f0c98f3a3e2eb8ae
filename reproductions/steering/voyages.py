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
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.baselines.autopilot import Autopilot
from shaftline.baselines.helmsman import Helmsman, SteeringMeasurements, TrackKeeper
from shaftline.core.lazy import control
from shaftline.plant import (
    Equilibrium,
    Ship,
    State,
    Voyage,
    approach,
    get_sea,
    linearise,
    load_ship,
    realise,
)
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
    """Return the SEA record of state 4.

    Args:
        ship: whose propeller depth the record is for.
        heading_deg: 0 following, 90 on the beam, 180 head seas [deg].
        seed: of the phases.
    """
    sea = get_sea(STATE)
    assert sea is not None
    return realise(
        sea.model_copy(update={"heading_deg": heading_deg}), ship.propeller.depth_m, seed
    )


def reflection(frequency: Floats, draught_m: float) -> Floats:
    """Return the share of the amplitude that a vertical barrier reflects (Ursell 1947) [-].

    Args:
        frequency: of the waves [rad/s].
        draught_m: depth of the barrier's lower edge [m].
    """
    kd = frequency**2 / GRAVITY * draught_m
    wall = math.pi * scipy.special.i1(kd)
    return np.asarray(wall / np.sqrt(wall**2 + scipy.special.k1(kd) ** 2))


def low_pass(values: Floats) -> Floats:
    """Return values at steps of :data:`WAVE_STEP_S` after a first-order filter of :data:`LOW_PASS_S`."""
    keep = math.exp(-WAVE_STEP_S / LOW_PASS_S)
    slow = np.empty_like(values)
    slow[0] = values.mean()
    for k in range(1, len(values)):
        slow[k] = keep * slow[k - 1] + (1.0 - keep) * values[k]
    return slow


def second_order(ship: Ship, sea: Any, seconds: float, wall: bool = False) -> WaveForce:
    """Return the slow second-order force of waves on the beam that the hull reflects.

    Args:
        ship: with length and draught.
        sea: SEA record.
        seconds: duration [s].
        wall: whether every wave is reflected completely, which no hull does.
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

    Args:
        ship: with displacement and added mass in sway.
        sea: SEA record.
        seconds: duration [s].
        heading_deg: 0 following, 90 on the beam [deg].
        speed_m_s: speed of the ship [m/s]; the encounter frequency is w - w^2 U cos(heading) / g.
    """
    hull, frequency = ship.manoeuvring, sea["frequency"]
    angle, number = math.radians(heading_deg), frequency**2 / GRAVITY
    added = -hull.Y_vdot * 0.5 * ship.water.density_kg_m3 * hull.length_m**3
    depth = np.exp(-0.5 * number * hull.draught_m)
    force = (hull.displacement_kg + added) * sea["amplitude"] * frequency**2 * depth
    force = force * math.sin(angle)
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
    vessel = ship.with_values(
        {
            "signals": {"wave_force": "N", "wave_moment": "N m"},
            "term": [
                {"id": "wave-force", "acts_on": "side_force", "expression": "wave_force"},
                {"id": "wave-moment", "acts_on": "yaw_moment", "expression": "wave_moment"},
            ],
        }
    )

    def acting(time: float) -> Any:
        signals = [float(np.interp(time, force.time_s, part)) for part in force[1:]]
        return UNDISTURBED._replace(outside=(*signals, *(0.0,) * (MAX_SIGNALS - 2)))

    return vessel, acting


SHIP = "ddg-51-surrogate"
SPEED_M_S = 22.0 * 0.514444
CURRENT_M_S = 5.0 * 0.514444
INTERVAL_S = 0.5
HEADING_NOISE = math.radians(0.1)  # rms [rad]; assumed
TRACK_NOISE_M = (
    0.05  # rms; assumed. The controller amplifies white noise 200 times: 0.5 m saturates the rudder
)
TURN_DEG = 8.0  # degrees per ship length in dead-reckoned turns: 90 degrees in about three minutes
CHANGE_LENGTHS = 38.0  # length of a track change: about eight minutes
GUST_AT, LEFT_AT, BACK_AT, END_AT = 20.0, 60.0, 140.0, 220.0  # [ship lengths]
CARRIED, MET = "carried", "met"
REFLECTED, WALL, ORBITAL = "reflected", "wall", "orbital"


@functools.cache
def ship() -> Ship:
    """Return the surrogate."""
    return load_ship(SHIP)


@functools.cache
def straight() -> Equilibrium:
    """Return the straight course at 22 knots."""
    return approach(ship(), SPEED_M_S)


def length_s() -> float:
    """Return the time for one ship length at 22 knots [s]."""
    return ship().manoeuvring.length_m / SPEED_M_S


def linear_plant(track: bool) -> control.StateSpace:
    """Return the linear model in ship lengths of heading, or of cross track, by rudder command."""
    whole = linearise(ship(), straight(), outputs=("heading", "sway_speed"))
    kept = [
        whole.state_labels.index(n) for n in ("sway_speed", "yaw_rate", "heading", "rudder_angle")
    ]
    helm = whole.input_labels.index("rudder_command")
    unit = length_s()
    a, b = unit * whole.A[np.ix_(kept, kept)], unit * whole.B[kept][:, [helm]]
    if not track:
        return control.ss(a, b, whole.C[[0]][:, kept], [[0.0]])
    # y' = psi + v / U, in ship lengths
    drifts = whole.C[[0]][:, kept] + whole.C[[1]][:, kept] / SPEED_M_S
    a = np.block([[a, np.zeros((4, 1))], [drifts, np.zeros((1, 1))]])
    return control.ss(a, np.vstack([b, [[0.0]]]), [[0.0, 0.0, 0.0, 0.0, 1.0]], [[0.0]])


def in_current(vessel: Ship, across_m_s: float) -> Ship:
    """Return the ship in a current across the first course, positive to starboard [m/s]."""
    return vessel.with_values({"manoeuvring.cross_current_m_s": across_m_s})


def simulate_voyage(
    helmsman: Helmsman,
    lengths: float,
    orders: Callable[[float], tuple[float, float]],
    begin: State | None = None,
    gusts: Mapping[float, float] | None = None,
    carried: Mapping[float, float] | None = None,
    acting: Callable[[float], Any] = lambda _: UNDISTURBED,
    vessel: Ship | None = None,
    sea: Any = None,
    seed: int = 1,
) -> pd.DataFrame:
    """Simulate a voyage with a helmsman.

    Args:
        helmsman: controller of the rudder.
        lengths: distance [ship lengths].
        orders: heading [rad] and cross track [m] by the distance [ship lengths].
        begin: initial state; the straight course by default.
        gusts: cross current [m/s] by the distance [ship lengths] at which it begins.
        carried: the same as modelled in the thesis: a speed that is added to the cross track alone.
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
    state = point.state if begin is None else begin
    drive, pitch = point.inputs.drive, point.inputs.pitch_command
    voyage, memory, rows, off = Voyage(plain, state, drive, sea), None, [], 0.0
    waiting = sorted((gusts or {}).items())
    steps = round(INTERVAL_S / plain.time_step_s)
    for k in range(round(lengths * unit / INTERVAL_S)):
        time = k * INTERVAL_S
        if waiting and time >= waiting[0][0] * unit:
            _, across = waiting.pop(0)
            voyage = Voyage(in_current(plain, across), state, drive, sea)
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
            (time, time / unit, state.position, state.cross_track + off, state.heading,
             state.yaw_rate, state.sway_speed, state.ship_speed, state.rudder_angle, command,
             heading_order, track_order, memory[0, 0])
        )  # fmt: skip
        state = voyage.run(drive, pitch, command, steps, acting(time))
        off += INTERVAL_S * sum(v for at, v in (carried or {}).items() if time >= at * unit)
    names = (
        "time_s", "way", "position_m", "cross_track_m", "heading_rad", "yaw_rate_rad_s",
        "sway_speed_m_s", "ship_speed_m_s", "rudder_rad", "rudder_command_rad",
        "heading_order_rad", "track_order_m", "aim",
    )  # fmt: skip
    return pd.DataFrame(rows, columns=names)


def with_initial_sway() -> pd.DataFrame:
    """Simulate the current of 5 knots as the thesis does for the autopilot: an initial sway speed."""
    begin = straight().state._replace(sway_speed=CURRENT_M_S)
    return simulate_voyage(
        Autopilot(ship(), INTERVAL_S, SPEED_M_S), 30.0, lambda _: (0.0, 0.0), begin
    )


def into_current() -> pd.DataFrame:
    """Simulate a real current of 5 knots: the water moves to starboard from the tenth length on."""
    return simulate_voyage(
        Autopilot(ship(), INTERVAL_S, SPEED_M_S), 40.0, lambda _: (0.0, 0.0), gusts={10.0: CURRENT_M_S}
    )  # fmt: skip


def two_turns(turn_deg: float = TURN_DEG) -> pd.DataFrame:
    """Simulate a turn of 90 degrees to port, and later back.

    Args:
        turn_deg: rate of the dead-reckoned turn [deg per ship length].
    """
    quarter = math.radians(90.0)

    def orders(way: float) -> tuple[float, float]:
        return (-quarter if 10.0 <= way < 50.0 else 0.0), 0.0

    pilot = Autopilot(ship(), INTERVAL_S, SPEED_M_S, turn_deg=turn_deg)
    return simulate_voyage(pilot, 90.0, orders)


def dead_reckoning(track: pd.DataFrame) -> NDArray[np.float64]:
    """Return positions at 22 knots on the commanded heading [ship lengths], shape (n, 2)."""
    heading = track["aim"].to_numpy()
    step = INTERVAL_S / length_s()
    along = np.concatenate([[0.0], np.cumsum(np.cos(heading[:-1]))]) * step
    across = np.concatenate([[0.0], np.cumsum(np.sin(heading[:-1]))]) * step
    return np.column_stack([along, across])


def wave_case(kind: str, seed: int, heading_deg: float = BEAM_DEG) -> tuple[Any, WaveForce]:
    """Return the SEA record of state 4 and its wave force over the track changes.

    Args:
        kind: :data:`REFLECTED` or :data:`WALL` (second order), or :data:`ORBITAL` (first order).
        seed: of the
        heading_deg: 0 following, 90 on the beam [deg].
    """
    record = sea_from(ship(), heading_deg, seed)
    seconds = END_AT * length_s() + 1.0
    if kind == ORBITAL:
        return record, first_order(ship(), record, seconds, heading_deg, SPEED_M_S)
    return record, second_order(ship(), record, seconds, kind == WALL)


def track_change(
    current: str = CARRIED, sea: tuple[Any, WaveForce] | None = None, seed: int = 1
) -> pd.DataFrame:
    """Simulate a track change two lengths to port, and back, in a beam current.

    Args:
        current: :data:`CARRIED`, added to the cross track alone as in the thesis; or :data:`MET`, which
            acts on the hull.
        sea: from :func:`wave_case`; calm water by default.
        seed: of the noise.
    """
    two = -2.0 * ship().manoeuvring.length_m

    def orders(way: float) -> tuple[float, float]:
        return 0.0, (two if LEFT_AT <= way < BACK_AT else 0.0)

    keeper = TrackKeeper(ship(), INTERVAL_S, SPEED_M_S, change_lengths=CHANGE_LENGTHS)
    kind = "carried" if current == CARRIED else "gusts"
    more: dict[str, Any] = {kind: {GUST_AT: CURRENT_M_S}}
    if sea is not None:
        more["sea"] = sea[0]
        more["vessel"], more["acting"] = with_wave_force(ship(), sea[1])
    return simulate_voyage(keeper, END_AT, orders, seed=seed, **more)
