"""What the thesis sails with its two controllers (sections 5.2.3 and 5.3.3), on the surrogate's plant.

The controllers see a noisy heading (0.1 degrees rms, assumed; the thesis prints none) or a noisy
position and act at intervals. Lengths are ship lengths and times those in which 22 knots sail one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.baselines.autopilot import Autopilot
from shaftline.baselines.helmsman import Course, Helmsman, TrackKeeper
from shaftline.core.lazy import control
from shaftline.plant import (
    Equilibrium,
    Ship,
    State,
    Voyage,
    approach,
    linearise,
    load_ship,
)
from shaftline.plant.stepping import UNDISTURBED

from . import waves
from .waves import WaveForce

SHIP = "ddg-51-surrogate"
SPEED_M_S = 22.0 * 0.514444
CURRENT_M_S = 5.0 * 0.514444
INTERVAL_S = 0.5
HEADING_NOISE = math.radians(0.1)  # rms [rad]; assumed
TRACK_NOISE_M = (
    0.05  # rms; assumed. The law answers white noise 200 times: at 0.5 m the rudder saturates
)
TURN_DEG = 8.0  # of the dead-reckoned turns, a ship length: 90 degrees in about three minutes
CHANGE_LENGTHS = 38.0  # of a track change: about eight minutes
GUST_AT, LEFT_AT, BACK_AT, END_AT = 20.0, 60.0, 140.0, 220.0  # [ship lengths]
CARRIED, MET = "carried", "met"
REFLECTED, WALL, ORBITAL = "reflected", "wall", "orbital"


@functools.cache
def ship() -> Ship:
    """The surrogate."""
    return load_ship(SHIP)


@functools.cache
def straight() -> Equilibrium:
    """Her straight course at 22 knots."""
    return approach(ship(), SPEED_M_S)


def length_s() -> float:
    """Time in which she sails her length [s]."""
    return ship().manoeuvring.length_m / SPEED_M_S


def linear_plant(track: bool) -> control.StateSpace:
    """Her own linear steering in ship lengths: heading, or cross track, by rudder command."""
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
    """The same in a current across the first course, to starboard where it is positive [m/s]."""
    return vessel.with_values({"manoeuvring.cross_current_m_s": across_m_s})


def sailed(
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
    """A voyage under a helmsman.

    Args:
        helmsman: who lays the rudder.
        lengths: of the voyage [ship lengths].
        orders: heading [rad] and cross track [m] by the way at 22 knots [ship lengths].
        begin: state at first; the straight course by default.
        gusts: current across [m/s] that sets in at a way [ship lengths].
        carried: the same as the thesis has it, a speed that is added to the cross track's alone.
        acting: disturbance by time [s].
        vessel: that is sailed; the surrogate by default.
        sea: SEA record, calm by default.
        seed: of the instruments' noise.

    Returns:
        A row an interval: way, heading, cross track, position, rudder and its command, and the rest that
        figures need.
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
        seen = Course(*(np.array([value]) for value in read))
        memory = helmsman.fresh(seen) if memory is None else memory
        command = float(helmsman.rudder(seen, memory)[0])
        rows.append(
            (
                time,
                time / unit,
                *_kept(state, off),
                command,
                heading_order,
                track_order,
                memory[0, 0],
            )
        )
        state = voyage.sail(drive, pitch, command, steps, acting(time))
        off += INTERVAL_S * sum(v for at, v in (carried or {}).items() if time >= at * unit)
    names = (
        "time_s", "way", "position_m", "cross_track_m", "heading_rad", "yaw_rate_rad_s",
        "sway_speed_m_s", "ship_speed_m_s", "rudder_rad", "rudder_command_rad",
        "heading_order_rad", "track_order_m", "aim",
    )  # fmt: skip
    return pd.DataFrame(rows, columns=names)


def _kept(state: State, off: float) -> tuple[float, ...]:
    return (
        state.position, state.cross_track + off, state.heading, state.yaw_rate, state.sway_speed,
        state.ship_speed, state.rudder_angle,
    )  # fmt: skip


def blown() -> pd.DataFrame:
    """A current of 5 knots as the thesis has it for the autopilot: a sway speed at the beginning."""
    begin = straight().state._replace(sway_speed=CURRENT_M_S)
    return sailed(Autopilot(ship(), INTERVAL_S, SPEED_M_S), 30.0, lambda _: (0.0, 0.0), begin)


def into_current() -> pd.DataFrame:
    """The same current as it is: the water moves to starboard from the tenth length on."""
    return sailed(
        Autopilot(ship(), INTERVAL_S, SPEED_M_S), 40.0, lambda _: (0.0, 0.0), gusts={10.0: CURRENT_M_S}
    )  # fmt: skip


def two_turns(turn_deg: float = TURN_DEG) -> pd.DataFrame:
    """90 degrees to port, and later back.

    Args:
        turn_deg: of the dead-reckoned turn in a ship length [deg].
    """
    quarter = math.radians(90.0)

    def orders(way: float) -> tuple[float, float]:
        return (-quarter if 10.0 <= way < 50.0 else 0.0), 0.0

    pilot = Autopilot(ship(), INTERVAL_S, SPEED_M_S, turn_deg=turn_deg)
    return sailed(pilot, 90.0, orders)


def dead_reckoned(track: pd.DataFrame) -> NDArray[np.float64]:
    """Where a ship would be that kept 22 knots on the commanded heading [ship lengths], shape (n, 2)."""
    heading = track["aim"].to_numpy()
    step = INTERVAL_S / length_s()
    along = np.concatenate([[0.0], np.cumsum(np.cos(heading[:-1]))]) * step
    across = np.concatenate([[0.0], np.cumsum(np.sin(heading[:-1]))]) * step
    return np.column_stack([along, across])


def in_waves(kind: str, seed: int, heading_deg: float = waves.BEAM_DEG) -> tuple[Any, WaveForce]:
    """Return the SEA record of state 4 and the force of its waves over the track changes.

    Args:
        kind: :data:`REFLECTED` or :data:`WALL` (second order), or :data:`ORBITAL` (first order).
        seed: of the waves.
        heading_deg: 0 following, 90 on the beam [deg].
    """
    record = waves.sea_from(ship(), heading_deg, seed)
    seconds = END_AT * length_s() + 1.0
    if kind == ORBITAL:
        return record, waves.first_order(ship(), record, seconds, heading_deg, SPEED_M_S)
    return record, waves.second_order(ship(), record, seconds, kind == WALL)


def track_change(
    current: str = CARRIED, sea: tuple[Any, WaveForce] | None = None, seed: int = 1
) -> pd.DataFrame:
    """The cross-track controller in a beam current: a line two lengths to port, and back.

    Args:
        current: :data:`CARRIED`, which moves the ship aside and does nothing else, as the thesis has
            it; or :data:`MET`, which her hull meets.
        sea: from :func:`in_waves`; calm water by default.
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
        more["vessel"], more["acting"] = waves.pushed(ship(), sea[1])
    return sailed(keeper, END_AT, orders, seed=seed, **more)
