"""Linear control loops of the controllers and helmsmen of this folder on their linearised ships.

A controller is linearised numerically, by finite differences of its commands and its state about a
steady state: x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from ..core.lazy import control
from ..observers.records import Floats
from ..plant.approach import approach
from ..plant.linear import linearise
from ..plant.loops import Loop, loop_at_command
from ..plant.ship import Ship, ShipError
from ..plant.steady_state import Equilibrium, equilibrium
from ..plant.voyage import Voyage
from .autopilot import Autopilot
from .controller import OBSERVED, Controller, Measurements
from .helmsman import ShapedHelmsman

COMMANDS = ("pitch_command", "drive")  # in the order in which ``act`` returns them
_MEASURED = (
    "shaft_speed",
    "shaft_torque",
    "pitch_ratio",
    "fuel_rack",
    "ship_speed",
    "advance_velocity",
)
_SHARE = 1e-5  # step of the finite differences over the size of a signal
_LONGEST_S, _CHECK_S = 7200.0, 60.0  # longest time to a steady state; time over which it is judged
_STEADY = 1e-9  # largest relative change of the commands in a steady state
_STARTS = 81  # number of drive commands from which the search of a steady state may begin
_FIXED = 1e-9  # width of the bounds of a fixed pitch [-]
_AT_REST = 1e-7  # largest share by which commands and controller state change in a steady state


def linear_plant(ship: Ship, point: Equilibrium) -> control.StateSpace:
    """Return a ship linearised about a working point, with all measurements of controllers as outputs.

    It has the states and outputs of :func:`shaftline.plant.linearise`, the output ``fuel_rack``, which
    is the drive command, and for a ship that turns ``cross_track`` [m].
    """
    steered = ("heading", "yaw_rate", "rudder_angle", "sway_speed") if ship.turns else ()
    plain = [name for name in _MEASURED if name != "fuel_rack"]
    model = linearise(ship, point, outputs=(*plain, *steered))
    a, b, c, d = (np.asarray(part) for part in (model.A, model.B, model.C, model.D))
    outputs = [*model.output_labels, "fuel_rack"]
    c = np.vstack([c, np.zeros((1, a.shape[0]))])
    d = np.vstack([d, [[float(name == "drive") for name in model.input_labels]]])
    if ship.turns:
        # y' = U psi + v
        way = point.state.ship_speed * c[outputs.index("heading")] + c[outputs.index("sway_speed")]
        a = np.block([[a, np.zeros((len(a), 1))], [way[None], np.zeros((1, 1))]])
        b = np.vstack([b, np.zeros((1, b.shape[1]))])
        c = np.block([[c, np.zeros((len(c), 1))], [np.zeros((1, c.shape[1])), np.ones((1, 1))]])
        d = np.vstack([d, np.zeros((1, d.shape[1]))])
        outputs.append("cross_track")
    return control.ss(a, b, c, d, inputs=model.input_labels, outputs=outputs)


class RestPoint(NamedTuple):
    """Steady state of a controller on its ship."""

    point: Equilibrium
    observation: Floats  # shape (8,)
    memory: Floats  # shape (k,)


def settle_controller(controller: Controller, speed_m_s: float) -> RestPoint:
    """Return the steady state of a controller at a speed order [m/s] in calm water.

    It is that in which a simulation ends. An unstable loop does not come to rest; its steady state is
    the solution of the equations of ship and controller.

    Raises:
        ShipError: the ship does not reach the speed.
        ValueError: the controller state is no array of numbers, or no steady state is reached.
    """
    ship, interval = controller.ship, controller.interval_s
    point = approach(ship, speed_m_s)
    steps = round(interval / ship.time_step_s)
    voyage = Voyage(ship, point.state, point.inputs.drive)
    signals = _observation(point, speed_m_s)
    memory = controller.initial_state(Measurements(*signals[:, None]))
    if memory.dtype != np.float64 or memory.ndim != 2:
        raise ValueError(
            f"{controller.name}: the controller cannot be linearised, its state is no array of numbers"
        )
    for _ in range(round(_LONGEST_S / _CHECK_S)):
        commands = []
        for _ in range(round(_CHECK_S / interval)):
            pitch, drive = controller.act(Measurements(*signals[:, None]), memory)
            commands.append((float(pitch[0]), float(drive[0])))
            voyage.run(commands[-1][1], commands[-1][0], 0.0, steps)
            signals = observe(voyage, speed_m_s)
        # All commands must be equal: those at two instants are also equal in an oscillation.
        if np.all(np.ptp(commands, axis=0) <= _STEADY * np.abs(commands[-1])):
            point = equilibrium(ship, commands[-1][1], commands[-1][0])
            return RestPoint(point, _observation(point, speed_m_s), memory[0])
    if (rest := _solve_rest(controller, speed_m_s)) is not None:
        return rest
    raise ValueError(
        f"{controller.name}: no steady state within {_LONGEST_S:g} s at an order of {speed_m_s:g} m/s"
    )


def _solve_rest(controller: Controller, speed_m_s: float) -> RestPoint | None:
    """Return the state in which ship and controller state do not change; None if none is found."""
    ship = controller.ship
    record, screw = ship.record(), ship.propeller
    low = np.array([screw.pitch_ratio_min, float(record["drive_min"])])
    high = np.array([screw.pitch_ratio_max + _FIXED, float(record["drive_max"])])

    def observed(pitch: float, drive: float) -> Floats | None:
        try:
            return _observation(equilibrium(ship, drive, pitch), speed_m_s)
        except ValueError:  # The torque does not turn the shaft.
            return None

    def change(unknown: Floats) -> Floats:
        seen = observed(float(unknown[0]), float(unknown[1]))
        if seen is None:
            return np.full(len(unknown), 1e3)
        held = unknown[None, 2:].copy()
        pitch, drive = controller.act(Measurements(*seen[:, None]), held)
        scale = np.maximum(np.abs(unknown), 1.0)
        return (np.array([pitch[0], drive[0], *held[0]]) - unknown) / scale

    # Limits hide the solution from a search that begins far from it.
    pitch = float(high[0])
    starts = []
    for drive in np.linspace(low[1], high[1], _STARTS):
        if (seen := observed(pitch, float(drive))) is None:
            continue
        signals = Measurements(*seen[:, None])
        memory = controller.initial_state(signals)[0]
        set_pitch = controller.act(signals, memory[None].copy())[0]
        pitch = float(np.clip(set_pitch[0], low[0], high[0]))
        if np.isfinite(memory).all():
            starts.append(np.array([pitch, drive, *memory]))
    if not starts:
        return None
    best = min(starts, key=lambda start: float(np.abs(change(start)).max()))
    # A controller state that nothing moves, as a trim that is switched off, keeps its initial value.
    steps = np.diag(_SHARE * np.maximum(np.abs(best), 1.0))
    slopes = np.array([change(best + step) - change(best - step) for step in steps])
    moves = np.ones(len(best), np.bool_)
    moves[2:] = slopes[:, 2:].any(axis=0)
    ends = np.full(int(moves.sum()) - 2, np.inf)

    def whole(part: Floats) -> Floats:
        full = best.copy()
        full[moves] = part
        return full

    def change_of(part: Floats) -> Floats:
        return change(whole(part))[moves]

    found = scipy.optimize.least_squares(
        change_of,
        best[moves],
        x_scale="jac",
        bounds=(np.append(low, -ends), np.append(high, ends)),
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    if not np.abs(found.fun).max() < _AT_REST:
        return None
    pitch, drive, *memory = whole(found.x).tolist()
    point = equilibrium(ship, drive, pitch)
    return RestPoint(point, _observation(point, speed_m_s), np.array(memory))


def observe(voyage: Voyage, order: float) -> Floats:
    """Return the observation without noise at the last step of a voyage, at a speed order [m/s]."""
    last = voyage.samples[-1]
    values = {
        "speed_order": order,
        "fuel_rack": last["drive"],
        "estimate_valid": 1.0,
        "estimated_advance_velocity": last["advance_velocity"],
        "shaft_speed": last["shaft_speed"],
    }
    return np.array([float(values[n] if n in values else last[n]) for n in OBSERVED])


def _observation(point: Equilibrium, order: float) -> Floats:
    state, outputs = point.state, point.outputs
    values = {
        "speed_order": order,
        "shaft_speed": state.shaft_speed,
        "measured_shaft_torque": outputs.shaft_torque,
        "measured_pitch_ratio": outputs.pitch_ratio,
        "fuel_rack": point.inputs.drive,
        "measured_ship_speed": state.ship_speed,
        "estimated_advance_velocity": outputs.advance_velocity,
        "estimate_valid": 1.0,
    }
    return np.array([float(values[name]) for name in OBSERVED])


def linearise_controller(controller: Controller, rest: RestPoint) -> control.StateSpace:
    """Return a controller as a discrete linear system about its steady state.

    Returns:
        System with the speed order and the measurements as inputs, named as in
        :class:`~.controller.Measurements`, and the commands :data:`COMMANDS` as outputs.
    """
    inputs = ("speed_order", *_MEASURED)
    held = len(rest.memory)
    columns = [Measurements._fields.index(name) for name in inputs]
    here = np.concatenate([rest.memory, rest.observation[columns]])
    sizes = np.maximum(np.abs(here), 1e-2) * _SHARE
    moved = here + np.vstack([np.diag(sizes), -np.diag(sizes)])
    signals = np.tile(rest.observation, (len(moved), 1))
    signals[:, columns] = moved[:, held:]
    memory = moved[:, :held].copy()
    pitch, drive = controller.act(Measurements(*signals.T.copy()), memory)
    found = np.column_stack([memory, pitch, drive])
    slopes = (found[: len(sizes)] - found[len(sizes) :]).T / (2.0 * sizes)
    return control.ss(
        slopes[:held, :held],
        slopes[:held, held:],
        slopes[held:, :held],
        slopes[held:, held:],
        controller.interval_s,
        inputs=list(inputs),
        outputs=list(COMMANDS),
        name="law",
    )


def controller_loop(controller: Controller, speed_m_s: float, command: str = "drive") -> Loop:
    """Return the loop of a controller on its ship, opened at one of its commands, with time in seconds.

    The controller receives the true advance velocity, as from an observer without lag.

    Args:
        controller: controller that is built for the ship and the interval.
        speed_m_s: ordered ship speed [m/s].
        command: ``drive`` or ``pitch_command``.

    Raises:
        ShipError: the ship does not reach the speed.
        ValueError: as of :func:`settle_controller`, or an unknown command.
    """
    return loop_at_rest(controller, settle_controller(controller, speed_m_s), command)


def loop_at_rest(controller: Controller, rest: RestPoint, command: str = "drive") -> Loop:
    """Return the loop of :func:`controller_loop` at a steady state of the controller."""
    law = linearise_controller(controller, rest)
    plant = linear_plant(controller.ship, rest.point)
    return loop_at_command(plant, law, command, "speed_order", "ship_speed")


def helmsman_loop(helmsman: ShapedHelmsman) -> Loop:
    """Return the loop of a helmsman on its ship at its design speed, with time in seconds.

    Raises:
        ShipError: the design speed is not ahead.
    """
    point = helmsman.point
    speed = point.state.ship_speed
    if not speed > 0.0:
        raise ShipError(f"{helmsman.ship.name}: steering needs a speed ahead, not {speed:g} m/s")
    way = speed * helmsman.interval_s / helmsman.length
    law = helmsman.law.sampled(way)
    heading = isinstance(helmsman, Autopilot)
    scale = 1.0 if heading else 1.0 / helmsman.length
    law = control.ss(law.A, law.B, scale * law.C, scale * law.D, helmsman.interval_s)
    whole = linear_plant(helmsman.ship, point)
    return Loop.from_plant(whole["heading" if heading else "cross_track", "rudder_command"], law)
