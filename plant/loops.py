"""A feedback loop by its linear models: margins, sensitivities, what a step of the order does.

    L = P C,   S = 1 / (1 + L),   T = 1 - S,   y = T r,   u = C S (r - noise)

Skogestad & Postlethwaite 2005, Multivariable Feedback Control, chapter 2. A controller that acts at
intervals is seen as it is: the plant is sampled with the command held in between, and what it reads is
what the plant showed just before, so what the holding costs in phase is in every number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ..core.lazy import control

_SETTLED = 0.02  # of the step
_STEPS = 20_000  # of a step response at most
_SLOWEST = 12.0  # time constants of the slowest pole over which a step is followed


class Margins(NamedTuple):
    """How far a loop stands from instability; times and frequencies in the models' unit of time.

    Args:
        gain_margin_dB: by which the gain may rise; infinite where the phase never reaches -180 deg.
        gain_margin_down_dB: by which it may fall, of a loop that needs its gain to be stable; else
            infinite.
        phase_margin_deg: by which the phase may change, to the nearer side; the least of all crossovers.
        delay_margin: dead time that takes it away.
        crossover: frequency at which |L| = 1.
        phase_crossover: at which the gain margin is met.
        peak_sensitivity: largest |S|; the loop's curve keeps 1 over it away from -1.
        peak_complementary: largest |T|.
    """

    gain_margin_dB: float
    gain_margin_down_dB: float
    phase_margin_deg: float
    delay_margin: float
    crossover: float
    phase_crossover: float
    peak_sensitivity: float
    peak_complementary: float


class StepMeasures(NamedTuple):
    """What the controlled output does where its order steps from 0 to 1.

    Args:
        overshoot_percent: beyond its last value.
        settling: time until it stays within 2 % of that.
        rise: time from 10 to 90 %.
        peak: time of the highest value.
        last_value: where it comes to rest.
    """

    overshoot_percent: float
    settling: float
    rise: float
    peak: float
    last_value: float


class Loop:
    """One loop, opened at its command.

    Args:
        open_loop: L, with the sign of negative feedback: L > 0 where the controller works against an
            error.
        closed: from the order to the controlled output; T where it is not given.

    Raises:
        ValueError: more than one input or output.
    """

    def __init__(self, open_loop: control.LTI, closed: control.LTI | None = None) -> None:
        for one in (open_loop, closed):
            if one is not None and (one.ninputs, one.noutputs) != (1, 1):
                raise ValueError(
                    f"a loop has one input and one output, not {one.ninputs} and {one.noutputs}"
                )
        self.open_loop = control.ss(open_loop)
        self.closed = control.feedback(self.open_loop, 1) if closed is None else control.ss(closed)

    @classmethod
    def of(cls, plant: control.LTI, controller: control.LTI) -> Loop:
        """Of a plant and a controller with one input and output each; negative feedback.

        Where the controller is discrete, the plant is sampled for it.

        Args:
            plant: from command to what is controlled.
            controller: from the error to the command.

        Raises:
            ValueError: more than one input or output.
        """
        if controller.dt and not plant.dt:
            plant = sampled(reached(control.ss(plant)), controller.dt)
        return cls(control.ss(plant) * control.ss(controller))

    @property
    def interval(self) -> float:
        """Between two commands; 0 where the controller acts all the time."""
        return float(self.open_loop.dt or 0.0)

    @property
    def stable(self) -> bool:
        """Whether the closed loop is."""
        poles = control.feedback(self.open_loop, 1).poles()
        return bool(np.all(np.abs(poles) < 1.0) if self.interval else np.all(poles.real < 0.0))

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """L at frequencies [rad per unit of time], shape (n,)."""
        points = np.exp(1j * frequency * self.interval) if self.interval else 1j * frequency
        return np.asarray(self.open_loop(points)).reshape(-1)

    def frequencies(self, points: int = 4000) -> NDArray[np.float64]:
        """Frequencies over which the loop is worth looking at, shape (points,)."""
        poles = self.open_loop.poles()
        zeros = self.open_loop.zeros()
        corners = np.concatenate([poles, zeros])
        if self.interval:
            corners = np.log(corners[np.abs(corners) > 0.0].astype(complex)) / self.interval
        sizes = np.abs(corners[np.isfinite(corners)])
        sizes = sizes[sizes > 1e-9 * sizes.max(initial=1.0)]
        low, high = (sizes.min(), sizes.max()) if len(sizes) else (1.0, 1.0)
        top = np.pi / self.interval if self.interval else 30.0 * high
        return np.geomspace(min(low / 30.0, top / 1e3), top, points)

    def margins(self) -> Margins:
        """The loop's margins.

        Raises:
            ValueError: the closed loop is unstable, so it has none.
        """
        if not self.stable:
            raise ValueError("the closed loop is unstable: there are no margins to speak of")
        grid = self.frequencies()
        response = self.response(grid)
        gains = self._crossings(grid, np.abs(response) - 1.0, lambda one: abs(one) - 1.0)
        turned = self._crossings(grid, response.imag, lambda one: one.imag)
        real = np.array([self.response(np.array([at]))[0].real for at in turned])
        turned, real = turned[real < 0.0], real[real < 0.0]
        if self.interval:  # there the curve ends on the real axis
            last = self.response(np.array([np.pi / self.interval]))[0].real
            if last < 0.0:
                turned, real = np.append(turned, np.pi / self.interval), np.append(real, last)
        lead = np.degrees(np.angle(-self.response(gains))) if len(gains) else np.zeros(0)
        lags = np.radians(np.where(lead < 0.0, lead + 360.0, lead)) / gains
        up, down = -1.0 / real[real > -1.0], -1.0 / real[real < -1.0]
        least = int(np.argmin(np.abs(lead))) if len(gains) else 0
        sensitivity = 1.0 / (1.0 + response)
        return Margins(
            20.0 * float(np.log10(up.min())) if len(up) else np.inf,
            -20.0 * float(np.log10(down.max())) if len(down) else np.inf,
            float(abs(lead[least])) if len(gains) else np.inf,
            float(min(lags, default=np.inf)),
            float(gains[least]) if len(gains) else np.nan,
            float(turned[real > -1.0][np.argmin(up)]) if len(up) else np.nan,
            float(np.abs(sensitivity).max()),
            float(np.abs(response * sensitivity).max()),
        )

    def _crossings(
        self,
        grid: NDArray[np.float64],
        values: NDArray[np.float64],
        of: Callable[[complex], float],
    ) -> NDArray[np.float64]:
        """Frequencies at which something of L passes through 0."""

        def at(frequency: float) -> float:
            return float(of(self.response(np.array([frequency]))[0]))

        places = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
        return np.array(
            [
                scipy.optimize.brentq(at, grid[k], grid[k + 1], xtol=1e-14, rtol=1e-14)
                for k in places
            ]
        )

    def step(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time and controlled output after a step of the order by 1, each of shape (n,).

        Raises:
            ValueError: the closed loop is unstable.
        """
        if not self.stable:
            raise ValueError("the closed loop is unstable: a step of the order has no end")
        poles = self.closed.poles()
        if self.interval:
            poles = np.log(poles[np.abs(poles) > 1e-12].astype(complex)) / self.interval
        slowest = np.abs(poles.real).min() if len(poles) else 1.0
        horizon = _SLOWEST / slowest
        steps = _STEPS
        if self.interval:
            steps = min(_STEPS, max(10, int(np.ceil(horizon / self.interval))))
            horizon = steps * self.interval
        time = np.linspace(0.0, horizon, steps + 1)
        return time, np.asarray(control.step_response(self.closed, time).outputs).reshape(-1)

    def step_measures(self) -> StepMeasures:
        """What a step of the order does.

        Raises:
            ValueError: as of :meth:`step`.
        """
        time, output = self.step()
        last = float(np.real(self.closed.dcgain()))
        found = control.step_info(output, T=time, SettlingTimeThreshold=_SETTLED, yfinal=last)
        return StepMeasures(
            float(found["Overshoot"]), float(found["SettlingTime"]), float(found["RiseTime"]),
            float(found["PeakTime"]), last,
        )  # fmt: skip


def sampled(plant: control.StateSpace, interval: float) -> control.StateSpace:
    """A plant as a controller meets it that acts at intervals.

    Its commands are held; each reading is what the plant showed just before the next command, so one
    that follows a command at once shows the last: y[k] = C x[k] + D u[k-1].

    Args:
        plant: continuous.
        interval: between two commands, in the plant's unit of time.

    Returns:
        Discrete, with the plant's names of inputs and outputs and no direct feedthrough.
    """
    held = control.sample_system(plant, interval, method="zoh")
    states, inputs = held.nstates, held.ninputs
    prompt = np.any(plant.D != 0.0, axis=0)  # commands that are seen at once
    kept = np.flatnonzero(prompt)
    a = np.block(
        [[held.A, np.zeros((states, len(kept)))], [np.zeros((len(kept), states + len(kept)))]]
    )
    b = np.vstack([held.B, np.eye(inputs)[kept]])
    c = np.hstack([held.C, plant.D[:, kept]])
    return control.ss(
        a, b, c, np.zeros((held.noutputs, inputs)), interval,
        inputs=plant.input_labels, outputs=plant.output_labels,
    )  # fmt: skip


def reached(system: control.StateSpace) -> control.StateSpace:
    """The system without states that no input moves, or that no output shows.

    By which numbers are 0 alone: a heading that nothing reads is no pole of a loop of the shaft's speed.
    """
    linked = system.A != 0.0
    moved = np.any(system.B != 0.0, axis=1)
    shown = np.any(system.C != 0.0, axis=0)
    for _ in range(system.nstates):
        moved = moved | (linked @ moved)
        shown = shown | (linked.T @ shown)
    kept = np.flatnonzero(moved & shown)
    labels = [system.state_labels[k] for k in kept]
    return control.ss(
        system.A[np.ix_(kept, kept)], system.B[kept], system.C[:, kept], system.D, system.dt,
        states=labels or None, inputs=system.input_labels, outputs=system.output_labels,
    )  # fmt: skip


def broken_at(
    plant: control.StateSpace,
    controller: control.StateSpace,
    command: str,
    order: str,
    controlled: str,
) -> Loop:
    """The loop of a controller with several readings and commands, opened at one of them.

    The others stay closed; so do inner loops that the controller holds.

    Args:
        plant: with commands as inputs and readings as outputs, by name.
        controller: with readings and the order as inputs, and commands as outputs; its signs are those
            of what it commands.
        command: at which the loop is opened.
        order: the controller's input that a step is given to.
        controlled: the reading that is to follow it.

    Raises:
        ValueError: a name that one of them lacks.
    """
    _named(command, "command", plant.input_labels, controller.output_labels)
    _named(order, "order", controller.input_labels)
    _named(controlled, "reading", plant.output_labels)
    if controller.dt and not plant.dt:
        plant = sampled(plant, controller.dt)
    ship = control.ss(plant, name="ship")
    law = control.ss(controller, name="law")
    readings = [name for name in law.input_labels if name in ship.output_labels]
    commands = [name for name in law.output_labels if name in ship.input_labels]
    hears = [[f"law.{name}", f"ship.{name}"] for name in readings]
    obeys = {name: [f"ship.{name}", f"law.{name}"] for name in commands}
    others = [wire for name, wire in obeys.items() if name != command]
    around = control.interconnect(
        [ship, law], [*hears, *others], inplist=[f"ship.{command}"], outlist=[f"law.{command}"],
        check_unused=False,
    )  # fmt: skip
    followed = control.interconnect(
        [ship, law], [*hears, *obeys.values()], inplist=[f"law.{order}"],
        outlist=[f"ship.{controlled}"], check_unused=False,
    )  # fmt: skip
    return Loop(-1.0 * reached(control.ss(around)), reached(control.ss(followed)))


def _named(name: str, kind: str, *signals: Sequence[str]) -> None:
    for known in signals:
        if name not in known:
            raise ValueError(f"unknown {kind} {name!r}; known: {', '.join(known)}")
