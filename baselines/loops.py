"""The loops of the controllers of this folder: each as a linear law at a speed, on its linearised ship.

A controller is differentiated as it stands, by differences of what it answers and of what it remembers,
so nothing is written down twice: x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k] about a steady state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.lazy import control
from ..plant.approach import approach
from ..plant.linear import linearise
from ..plant.loops import Loop, broken_at
from ..plant.ship import Ship, ShipError
from ..plant.steady_state import Equilibrium, equilibrium
from ..plant.voyage import Voyage
from .autopilot import Autopilot
from .controller import OBSERVED, Controller, Readings
from .helmsman import ShapedHelmsman

COMMANDS = ("pitch_command", "drive")
"""Of a controller, in the order of its answer."""

_READ = {
    "shaft_speed": "shaft_speed",
    "shaft_torque": "shaft_torque",
    "pitch_ratio": "pitch_ratio",
    "fuel_rack": "fuel_rack",
    "ship_speed": "ship_speed",
    "advance_velocity": "advance_velocity",
}
_SHARE = 1e-5  # of a signal's size, by which it is moved
_LONGEST_S, _LOOK_S = 7200.0, 60.0  # that a controller may take to come to rest; between two looks
_STILL = 1e-9  # share by which its commands may still have changed between them


def readable(ship: Ship, point: Equilibrium) -> control.StateSpace:
    """A ship about a working point, with all that controllers read as outputs, by name.

    Beside states and outputs of :func:`shaftline.plant.linearise`: ``fuel_rack``, which is the demand of
    the drive, and of a ship that turns ``cross_track`` [m].

    Args:
        ship: the ship.
        point: the working point.
    """
    steered = ("heading", "yaw_rate", "rudder_angle", "sway_speed") if ship.turns else ()
    plain = [name for name in _READ.values() if name != "fuel_rack"]
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


class Settled(NamedTuple):
    """A controller at rest on its ship."""

    point: Equilibrium
    seen: NDArray[np.float64]  # an observation, shape (8,)
    memory: NDArray[np.float64]  # shape (k,)


def settled(controller: Controller, speed_m_s: float) -> Settled:
    """Where a controller comes to rest that is ordered a speed in calm water: it sails there.

    Args:
        controller: whose memory is numbers.
        speed_m_s: ordered ship speed [m/s].

    Raises:
        ShipError: a speed that no demand sails.
        ValueError: a controller that remembers more than numbers, or does not come to rest.
    """
    ship, interval = controller.ship, controller.interval_s
    point = approach(ship, speed_m_s)
    steps = round(interval / ship.time_step_s)
    voyage = Voyage(ship, point.state, point.inputs.drive)
    seen = _observation(point, speed_m_s)
    memory = _numbers(controller, seen)
    before = np.full(2, np.inf)
    for _ in range(round(_LONGEST_S / _LOOK_S)):
        for _ in range(round(_LOOK_S / interval)):
            pitch, drive = controller.act(Readings(*seen[:, None]), memory)
            voyage.sail(float(drive[0]), float(pitch[0]), 0.0, steps)
            seen = read(voyage, speed_m_s)
        now = np.array([pitch[0], drive[0]])
        if np.all(np.abs(now - before) <= _STILL * np.abs(now)):
            point = equilibrium(ship, float(drive[0]), float(pitch[0]))
            return Settled(point, _observation(point, speed_m_s), memory[0])
        before = now
    raise ValueError(
        f"{controller.name}: has come to no rest {_LONGEST_S:g} s after an order of {speed_m_s:g} m/s"
    )


def read(voyage: Voyage, order: float) -> NDArray[np.float64]:
    """What a controller sees of a voyage without noise, as of its last step; shape (8,).

    Args:
        voyage: under way.
        order: ship speed [m/s].
    """
    last = voyage.samples[-1]
    values = {
        "speed_order": order, "fuel_rack": last["drive"], "estimate_valid": 1.0,
        "estimated_advance_velocity": last["advance_velocity"], "shaft_speed": last["shaft_speed"],
    }  # fmt: skip
    return np.array([float(values[n] if n in values else last[n]) for n in OBSERVED])


def _observation(point: Equilibrium, order: float) -> NDArray[np.float64]:
    state, outputs = point.state, point.outputs
    values = {
        "speed_order": order, "shaft_speed": state.shaft_speed,
        "measured_shaft_torque": outputs.shaft_torque, "measured_pitch_ratio": outputs.pitch_ratio,
        "fuel_rack": point.inputs.drive, "measured_ship_speed": state.ship_speed,
        "estimated_advance_velocity": outputs.advance_velocity, "estimate_valid": 1.0,
    }  # fmt: skip
    return np.array([float(values[name]) for name in OBSERVED])


def _numbers(controller: Controller, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    memory = controller.fresh(Readings(*seen[:, None]))
    if memory.dtype != np.float64 or memory.ndim != 2:
        raise ValueError(
            f"{controller.name}: its memory holds more than numbers, so it has no linear law"
        )
    return memory


def linear_law(controller: Controller, rest: Settled) -> control.StateSpace:
    """A controller as a discrete linear system about where it rests.

    Args:
        controller: the controller.
        rest: from :func:`settled`.

    Returns:
        Inputs are the order and the readings, named as in :class:`~.controller.Readings`, outputs the
        commands of :data:`COMMANDS`.
    """
    inputs = ("speed_order", *_READ)
    held = len(rest.memory)
    columns = [Readings._fields.index(name) for name in inputs]
    here = np.concatenate([rest.memory, rest.seen[columns]])
    sizes = np.maximum(np.abs(here), 1e-2) * _SHARE
    moved = here + np.vstack([np.diag(sizes), -np.diag(sizes)])
    seen = np.tile(rest.seen, (len(moved), 1))
    seen[:, columns] = moved[:, held:]
    memory = moved[:, :held].copy()
    pitch, drive = controller.act(Readings(*seen.T.copy()), memory)
    found = np.column_stack([memory, pitch, drive])
    slopes = (found[: len(sizes)] - found[len(sizes) :]).T / (2.0 * sizes)
    return control.ss(
        slopes[:held, :held], slopes[:held, held:], slopes[held:, :held], slopes[held:, held:],
        controller.interval_s, inputs=list(inputs), outputs=list(COMMANDS), name="law",
    )  # fmt: skip


def controller_loop(controller: Controller, speed_m_s: float, command: str = "drive") -> Loop:
    """The loop of a controller on its ship, opened at one of its commands; time in seconds.

    What it reads of the advance velocity is the truth, as of an observer without a lag.

    Args:
        controller: built for the ship and the interval.
        speed_m_s: ordered ship speed [m/s].
        command: ``drive`` or ``pitch_command``.

    Raises:
        ShipError: a speed that no demand sails.
        ValueError: as of :func:`settled`, or a command that does not exist.
    """
    rest = settled(controller, speed_m_s)
    law = linear_law(controller, rest)
    return broken_at(
        readable(controller.ship, rest.point), law, command, "speed_order", "ship_speed"
    )


def helmsman_loop(helmsman: ShapedHelmsman) -> Loop:
    """The loop of a helmsman on his ship at the speed for which he is shaped; time in seconds.

    Args:
        helmsman: who holds a heading or a track.

    Raises:
        ShipError: a ship that does not sail ahead.
    """
    point = helmsman.point
    speed = point.state.ship_speed
    if not speed > 0.0:
        raise ShipError(f"{helmsman.ship.name}: steering asks for a speed ahead, not {speed:g} m/s")
    way = speed * helmsman.interval_s / helmsman.length
    law = helmsman.law.sampled(way)
    heading = isinstance(helmsman, Autopilot)
    scale = 1.0 if heading else 1.0 / helmsman.length
    law = control.ss(law.A, law.B, scale * law.C, scale * law.D, helmsman.interval_s)
    whole = readable(helmsman.ship, point)
    return Loop.of(whole["heading" if heading else "cross_track", "rudder_command"], law)
