"""Describe a residual of unknown cause as a shape: a piecewise linear function of one signal or of time.

The catalogue cannot contain all physics. The likelihood of a shape under the same whitened noise as that
of the effects shows whether a torque, force or pitch is missing systematically, and in which balance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import Ship
from ...plant.terms import Term
from ..search.fitting import Colour, Fit, Fitter
from ..search.spectra import chance_gain
from ..simulate.balances import Balances

RARE = 1e-3
"""Probability that a shape exceeds its threshold by chance."""

KNOTS = 5
TIME_KNOTS = 8
LOOSE = 10.0
"""Prior standard deviation of a shape's values, in rms of its balance's residual: nearly free."""


@dataclass(frozen=True)
class Shape:
    """Missing quantity of a balance as a piecewise linear function of a signal.

    Args:
        balance: name of the balance.
        unit: unit of the values.
        signal: signal that the quantity depends on: ``shaft_speed``, ``ship_speed``, ``pitch_ratio``,
            ``drive``, ``time``.
        signal_unit: unit of the knots.
        knots: rising values of the signal, shape (k,).
        values: missing quantity at each knot, shape (k,).
        gain: gain in 2 log L.
        threshold: gain that chance does not exceed.
        trace: missing quantity over the recording, shape (rows,).
    """

    balance: str
    unit: str
    signal: str
    signal_unit: str
    knots: NDArray[np.float64]
    values: NDArray[np.float64]
    gain: float
    threshold: float
    trace: NDArray[np.float64]

    @property
    def excess(self) -> float:
        """Gain beyond the threshold."""
        return self.gain - self.threshold


_ADDED_TO = {
    "engine": ("drive_torque", 1.0),
    "motor": ("drive_torque", 1.0),
    "propeller": ("load_torque", -1.0),
    "load": ("load_torque", -1.0),
    "hull": ("resistance", -1.0),
    "sway": ("side_force", 1.0),
    "yaw": ("yaw_moment", 1.0),
    "thrust": ("thrust", 1.0),
    "pitch-actuator": ("pitch_rate", 1.0),
}
"""Location in the model at which a balance's missing quantity is added, and its sign; the motor current
has none, because it follows from the other states."""


def term_from_shape(shape: Shape, ship: Ship) -> Term | None:
    """Return a shape as a term of the ship file; None where the model has no location for it.

    Args:
        shape: the shape.
        ship: nominal ship.
    """
    if shape.balance not in _ADDED_TO:
        return None
    place, factor = _ADDED_TO[shape.balance]
    if place == "pitch_rate":
        factor /= ship.pitch_actuator.time_constant_s
    points = ", ".join(
        f"{x:.6g}, {factor * y:.6g}" for x, y in zip(shape.knots, shape.values, strict=True)
    )
    return Term.model_validate(
        {
            "id": f"unnamed-{shape.balance}",
            "acts_on": place,
            "expression": f"table({shape.signal}, {points})",
        }
    )


def _hats(signal: NDArray[np.float64], knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the piecewise linear basis functions, shape (k, rows)."""
    return np.array([np.interp(signal, knots, row) for row in np.eye(len(knots))])


def signals_of(fitter: Fitter, fit: Fit) -> dict[str, tuple[NDArray[np.float64], str]]:
    """Return the simulated signals that a missing quantity may depend on, with their units."""
    replay = fitter.balances.replay
    samples = replay.simulate(fitter.trial_ship.record(fit.effects))
    found = {
        "shaft_speed": (np.ascontiguousarray(samples["shaft_speed"]), "rad/s"),
        "ship_speed": (np.ascontiguousarray(samples["ship_speed"]), "m/s"),
        "pitch_ratio": (np.ascontiguousarray(samples["pitch_ratio"]), ""),
        "drive": (np.ascontiguousarray(samples["drive"]), replay.ship.prime_mover.demand.unit),
    }
    if replay.ship.turns:
        for name, unit in (("sway_speed", "m/s"), ("yaw_rate", "rad/s"), ("rudder_angle", "rad")):
            found[name] = (np.ascontiguousarray(samples[name]), unit)
    if len(replay.runs) == 1:  # several recordings have no common time
        found["time"] = (replay.time_s, "s")
    return found


def best_shapes(fitter: Fitter, fit: Fit) -> list[Shape]:
    """Return the best shape of each balance beside a model, the largest excess first."""
    bands, balances = fitter.bands, fitter.balances
    signals = signals_of(fitter, fit)
    tried = len(signals) * len(balances.names)
    found = []
    for row, (name, unit) in enumerate(zip(balances.names, balances.units, strict=True)):
        rms = float(np.sqrt(np.mean(np.abs(fit.difference[row]) ** 2)))
        best: Shape | None = None
        for signal, (values, signal_unit) in signals.items():
            knots = _knots(values, signal)
            if knots is None:
                continue
            hats = _hats(values, knots)
            columns = np.zeros((len(knots), *fit.difference.shape), np.complex128)
            columns[:, row] = bands.transform(hats) * (LOOSE * rms)
            marginal = fitter.project_residual(fit, columns)
            # The cost of the loose prior does not count.
            shares = marginal.shares[: len(knots)]
            gain = marginal.score + float(shares @ shares) - fit.score
            coefficients = shares * LOOSE * rms
            limit = chance_gain(len(knots), tried, RARE)
            shape = Shape(
                name, unit, signal, signal_unit, knots, coefficients, gain, limit,
                coefficients @ hats,
            )  # fmt: skip
            if best is None or shape.excess > best.excess:
                best = shape
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda shape: -shape.excess)


def shape_to_show(shapes: list[Shape], balances: Balances, colour: Colour | None) -> Shape | None:
    """Return the shape to report: the best beyond its threshold, else that of the coloured balance."""
    if not shapes or shapes[0].excess > 0.0 or colour is None:
        return shapes[0] if shapes else None
    return next((s for s in shapes if s.balance == balances.names[colour.balance]), shapes[0])


def _knots(values: Any, signal: str) -> NDArray[np.float64] | None:
    if signal == "time":
        return np.linspace(float(values[0]), float(values[-1]), TIME_KNOTS)
    if np.ptp(values) < 0.02 * (np.abs(values).max() + 1e-12):
        return None
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, KNOTS)))
    spread = np.diff(knots)
    if len(knots) < 3 or spread.min() < 0.02 * np.ptp(values):
        knots = np.linspace(float(values.min()), float(values.max()), KNOTS)
    return np.asarray(knots)
