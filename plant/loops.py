"""A feedback loop of linear models: stability margins, sensitivities, and the step response.

    L = P C,   S = 1 / (1 + L),   T = 1 - S,   y = T r,   u = C S (r - noise)

Skogestad & Postlethwaite 2005, Multivariable Feedback Control, chapter 2. For a discrete controller the
plant is sampled with the command held constant between two samples, and each measurement is taken just
before the next command. So all results include the phase lag of the hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ..core.lazy import control

_SETTLED = 0.02  # settling band, as a share of the step
_STEPS = 20_000  # largest number of points of a step response
_LEAST_GAIN, _GAINS = 1e-4, 81  # least gain that may make a loop stable; number of gains tried
_SLOWEST = 12.0  # duration of a step response, in time constants of the slowest pole


class Margins(NamedTuple):
    """Stability margins of a loop; times and frequencies are in the models' unit of time."""

    gain_margin_dB: float  # allowed increase of the gain; infinite without a phase of -180 deg
    gain_margin_down_dB: float  # allowed decrease, if the loop is stable only above a gain
    phase_margin_deg: float  # allowed change of the phase, the least over all crossovers
    delay_margin: float  # dead time that makes the loop unstable
    crossover: float  # frequency at which |L| = 1
    phase_crossover: float  # frequency of the gain margin
    peak_sensitivity: float  # largest |S|; its inverse is the least distance of L from -1
    peak_complementary: float  # largest |T|


class LackingMargins(NamedTuple):
    """Negative stability margins of an unstable loop; nan where it has none."""

    gain_margin_dB: float  # change of the gain that makes the loop stable, below 0
    phase_margin_deg: float  # least phase margin at a crossover, below 0


class StepMeasures(NamedTuple):
    """Measures of the response of the controlled output to a unit step of the set-point."""

    overshoot_percent: float  # overshoot over the final value
    settling: float  # time after which the output stays within 2 % of the final value
    rise: float  # time from 10 to 90 % of the final value
    peak: float  # time of the highest value
    last_value: float  # final value


class Loop:
    """A feedback loop with one input and one output, opened at its command.

    Args:
        open_loop: L, with the sign of negative feedback: L > 0 if the controller acts against an error.
        closed: transfer function from the set-point to the controlled output; by default T.

    Raises:
        ValueError: more than one input or output.

    >>> import control
    >>> from shaftline.plant import Loop
    >>> loop = Loop.from_plant(control.tf([1.0], [1.0, 1.0, 0.0]), control.tf([1.0], [1.0]))
    >>> round(loop.margins().phase_margin_deg, 1), round(loop.margins().crossover, 3)
    (51.8, 0.786)
    >>> round(loop.step_measures().overshoot_percent)  # [%]
    16
    """

    def __init__(self, open_loop: control.LTI, closed: control.LTI | None = None) -> None:
        for one in (open_loop, closed):
            if one is not None and (one.ninputs, one.noutputs) != (1, 1):
                raise ValueError(
                    f"a loop has one input and one output, not {one.ninputs} and {one.noutputs}"
                )
        self.open_loop = control.ss(open_loop)
        closed = control.feedback(self.open_loop, 1) if closed is None else closed
        self.closed_loop = control.ss(closed)

    @classmethod
    def from_plant(cls, plant: control.LTI, controller: control.LTI) -> Loop:
        """Return the loop of a plant and a controller with negative feedback.

        If the controller is discrete, the plant is sampled at its interval.

        Args:
            plant: transfer function from the command to the controlled output.
            controller: transfer function from the error to the command.

        Raises:
            ValueError: more than one input or output.
        """
        if controller.dt and not plant.dt:
            plant = sample_plant(drop_unconnected_states(control.ss(plant)), controller.dt)
        return cls(control.ss(plant) * control.ss(controller))

    @property
    def interval(self) -> float:
        """Interval between two commands; 0 for a continuous controller."""
        return float(self.open_loop.dt or 0.0)

    @property
    def stable(self) -> bool:
        """Whether the closed loop is stable."""
        poles = control.feedback(self.open_loop, 1).poles()
        return bool(np.all(np.abs(poles) < 1.0) if self.interval else np.all(poles.real < 0.0))

    @property
    def fastest_pole(self) -> complex:
        """Closed-loop pole of the fastest growth or slowest decay, in radians per unit of time."""
        poles = control.feedback(self.open_loop, 1).poles().astype(complex)
        if self.interval:
            poles = np.log(poles) / self.interval
        return complex(poles[np.argmax(poles.real)])

    def lacking_margins(self) -> LackingMargins:
        """Return how far an unstable loop is from stability.

        Raises:
            ValueError: the closed loop is stable.
        """
        if self.stable:
            raise ValueError("the closed loop is stable: use margins()")

        def stable_at(gain: float) -> bool:
            return Loop(gain * self.open_loop).stable

        tried = np.geomspace(1.0, _LEAST_GAIN, _GAINS)
        fits = next((k for k in range(1, _GAINS) if stable_at(float(tried[k]))), 0)
        low, high = float(tried[fits]), float(tried[max(fits - 1, 0)])
        for _ in range(40 if fits else 0):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if stable_at(middle) else (low, middle)
        grid = self.frequencies()
        gains = self._crossings(grid, np.abs(self.response(grid)) - 1.0, lambda one: abs(one) - 1.0)
        lead = np.degrees(np.angle(-self.response(gains))) if len(gains) else np.zeros(0)
        lacking = lead[lead < 0.0]
        return LackingMargins(
            20.0 * math.log10(low) if fits else math.nan,
            float(lacking.min()) if len(lacking) else math.nan,
        )

    def _require_stable(self, otherwise: str) -> None:
        if not self.stable:
            raise ValueError(
                f"the closed loop is unstable, so {otherwise}; change the gain or the controller"
            )

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return L at frequencies [rad per unit of time], shape (n,)."""
        points = np.exp(1j * frequency * self.interval) if self.interval else 1j * frequency
        return np.asarray(self.open_loop(points)).reshape(-1)

    def frequencies(self, points: int = 4000) -> NDArray[np.float64]:
        """Return a grid of frequencies that covers all poles and zeros of the loop, shape (points,)."""
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
        """Return the stability margins.

        Raises:
            ValueError: the closed loop is unstable.
        """
        self._require_stable("it has no margins")
        grid = self.frequencies()
        response = self.response(grid)
        gains = self._crossings(grid, np.abs(response) - 1.0, lambda one: abs(one) - 1.0)
        turned = self._crossings(grid, response.imag, lambda one: one.imag)
        real = np.array([self.response(np.array([at]))[0].real for at in turned])
        turned, real = turned[real < 0.0], real[real < 0.0]
        if self.interval:  # The curve of a discrete loop ends on the real axis.
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
        self, grid: NDArray[np.float64], values: NDArray[np.float64], of: Callable[[complex], float]
    ) -> NDArray[np.float64]:
        """Return the frequencies at which a function of L changes its sign."""

        def at(frequency: float) -> float:
            return float(of(self.response(np.array([frequency]))[0]))

        turns = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
        bounds = [(grid[k], grid[k + 1]) for k in turns]
        return np.array([scipy.optimize.brentq(at, *b, xtol=1e-14, rtol=1e-14) for b in bounds])

    def step(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return time and controlled output after a unit step of the set-point, each of shape (n,).

        Raises:
            ValueError: the closed loop is unstable.
        """
        self._require_stable("its step response has no final value")
        poles = self.closed_loop.poles()
        if self.interval:
            poles = np.log(poles[np.abs(poles) > 1e-12].astype(complex)) / self.interval
        slowest = np.abs(poles.real).min() if len(poles) else 1.0
        horizon = _SLOWEST / slowest
        steps = _STEPS
        if self.interval:
            steps = min(_STEPS, max(10, int(np.ceil(horizon / self.interval))))
            horizon = steps * self.interval
        time = np.linspace(0.0, horizon, steps + 1)
        return time, np.asarray(control.step_response(self.closed_loop, time).outputs).reshape(-1)

    def step_measures(self) -> StepMeasures:
        """Return the measures of the step response.

        Raises:
            ValueError: as in :meth:`step`.
        """
        time, output = self.step()
        last = float(np.real(self.closed_loop.dcgain()))
        info = control.step_info(output, T=time, SettlingTimeThreshold=_SETTLED, yfinal=last)
        measured = ("Overshoot", "SettlingTime", "RiseTime", "PeakTime")
        overshoot, settling, rise, peak = (float(info[name]) for name in measured)
        return StepMeasures(overshoot, settling, rise, peak, last)


def sample_plant(plant: control.StateSpace, interval: float) -> control.StateSpace:
    """Return a continuous plant sampled at the interval of a discrete controller, in its unit of time.

    Commands are held constant over an interval. Each measurement is taken just before the next command,
    so direct feedthrough acts with the previous command: y[k] = C x[k] + D u[k-1]. The result keeps the
    names of inputs and outputs and has no direct feedthrough.
    """
    held = control.sample_system(plant, interval, method="zoh")
    states, inputs = held.nstates, held.ninputs
    prompt = np.any(plant.D != 0.0, axis=0)  # commands with direct feedthrough
    kept = np.flatnonzero(prompt)
    a = np.block(
        [[held.A, np.zeros((states, len(kept)))], [np.zeros((len(kept), states + len(kept)))]]
    )
    b = np.vstack([held.B, np.eye(inputs)[kept]])
    c = np.hstack([held.C, plant.D[:, kept]])
    return control.ss(
        a,
        b,
        c,
        np.zeros((held.noutputs, inputs)),
        interval,
        inputs=plant.input_labels,
        outputs=plant.output_labels,
    )


def drop_unconnected_states(system: control.StateSpace) -> control.StateSpace:
    """Return a system without the states that no input affects or that affect no output.

    Only structural zeros count: for example, the heading is dropped from a loop of the shaft speed.
    """
    linked = system.A != 0.0
    affected = np.any(system.B != 0.0, axis=1)
    observed = np.any(system.C != 0.0, axis=0)
    for _ in range(system.nstates):
        affected = affected | (linked @ affected)
        observed = observed | (linked.T @ observed)
    kept = np.flatnonzero(affected & observed)
    labels = [system.state_labels[k] for k in kept]
    return control.ss(
        system.A[np.ix_(kept, kept)],
        system.B[kept],
        system.C[:, kept],
        system.D,
        system.dt,
        states=labels or None,
        inputs=system.input_labels,
        outputs=system.output_labels,
    )


def loop_at_command(
    plant: control.StateSpace,
    controller: control.StateSpace,
    command: str,
    order: str,
    controlled: str,
) -> Loop:
    """Return the loop of a controller with several measurements and commands, opened at one command.

    The other commands stay connected, and so do the controller's inner loops.

    Args:
        plant: system with commands as inputs and measurements as outputs, by name.
        controller: system with measurements and set-points as inputs, and commands as outputs; its signs
            are those of its commands.
        command: command at which the loop is opened.
        order: input of the controller that receives the step.
        controlled: measurement that should follow it.

    Raises:
        ValueError: a name that plant or controller lacks.
    """
    _check_names(command, "command", plant.input_labels, controller.output_labels)
    _check_names(order, "set-point", controller.input_labels)
    _check_names(controlled, "measurement", plant.output_labels)
    if controller.dt and not plant.dt:
        plant = sample_plant(plant, controller.dt)
    ship = control.ss(plant, name="ship")
    law = control.ss(controller, name="law")
    measured = [name for name in law.input_labels if name in ship.output_labels]
    commands = [name for name in law.output_labels if name in ship.input_labels]

    def connected(names: Sequence[str], source: str, target: str) -> control.StateSpace:
        wires = [[f"law.{name}", f"ship.{name}"] for name in measured]
        wires += [[f"ship.{name}", f"law.{name}"] for name in names]
        system = control.interconnect(
            [ship, law], wires, inplist=[source], outlist=[target], check_unused=False
        )
        return drop_unconnected_states(control.ss(system))

    closed = [name for name in commands if name != command]
    opened = connected(closed, f"ship.{command}", f"law.{command}")
    return Loop(-1.0 * opened, connected(commands, f"law.{order}", f"ship.{controlled}"))


def _check_names(name: str, kind: str, *signals: Sequence[str]) -> None:
    for known in signals:
        if name not in known:
            raise ValueError(f"unknown {kind} {name!r}; known: {', '.join(known)}")
