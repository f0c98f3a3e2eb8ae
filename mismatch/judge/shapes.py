"""Describe a residual of unknown cause as a shape: a piecewise linear function of one signal or of time.

The catalogue cannot contain all physics. The likelihood of a shape under the same whitened noise as that
of the effects shows whether a torque, force or pitch is missing systematically, and in which balance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...plant.ship import Ship
from ...plant.terms import Term
from ..search.fitting import Colour, Fit, Fitter
from ..search.spectra import chance_gain
from ..simulate.balances import Balances
from ..simulate.joint_replay import Floats

RARE = 1e-3
"""Probability that a shape exceeds its threshold by chance."""

KNOTS = 5
TIME_KNOTS = 8

LOOSE = 10.0
"""Prior standard deviation of a shape's values, in rms of its balance's residual: nearly free."""

ADDED_TO = {
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


@dataclass(frozen=True)
class Shape:
    """Missing quantity of a balance as a piecewise linear function of a signal."""

    balance: str  # name of the balance
    unit: str  # unit of the values
    signal: str  # signal that it depends on, such as ``ship_speed`` or ``time``
    signal_unit: str  # unit of the knots
    knots: Floats  # rising values of the signal, shape (k,)
    values: Floats  # missing quantity at each knot, shape (k,)
    gain: float  # gain in 2 log L
    threshold: float  # gain that chance does not exceed
    trace: Floats  # missing quantity over the recording, shape (rows,)

    @property
    def excess(self) -> float:
        """Gain beyond the threshold."""
        return self.gain - self.threshold


def best_shapes(fitter: Fitter, fit: Fit) -> list[Shape]:
    """Return the best shape of each balance beside a model, the largest excess first."""
    bands, balances = fitter.bands, fitter.balances
    signals = signals_of(fitter, fit)
    tried = len(signals) * len(balances.names)
    best: list[Shape] = []
    for row, (name, unit) in enumerate(zip(balances.names, balances.units, strict=True)):
        rms = float(np.sqrt(np.mean(np.abs(fit.difference[row]) ** 2)))
        shapes = []
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
            sizes = shares * LOOSE * rms
            limit, trace = chance_gain(len(knots), tried, RARE), sizes @ hats
            shapes.append(Shape(name, unit, signal, signal_unit, knots, sizes, gain, limit, trace))
        best += sorted(shapes, key=lambda shape: -shape.excess)[:1]
    return sorted(best, key=lambda shape: -shape.excess)


def signals_of(fitter: Fitter, fit: Fit) -> dict[str, tuple[Floats, str]]:
    """Return the simulated signals that a missing quantity may depend on, with their units."""
    replay = fitter.balances.replay
    units = {"shaft_speed": "rad/s", "ship_speed": "m/s", "pitch_ratio": ""}
    units["drive"] = replay.ship.prime_mover.demand.unit
    if replay.ship.turns:
        units |= {"sway_speed": "m/s", "yaw_rate": "rad/s", "rudder_angle": "rad"}
    samples = replay.simulate_signals(fitter.trial_ship.record(fit.effects), [*units])
    signals = {name: (samples[name], unit) for name, unit in units.items()}
    if len(replay.runs) == 1:  # several recordings have no common time
        signals["time"] = (replay.time_s, "s")
    return signals


def _knots(values: Any, signal: str) -> Floats | None:
    """Return the knots of a shape over a signal; None for a signal that hardly varies."""
    if signal == "time":
        return np.linspace(float(values[0]), float(values[-1]), TIME_KNOTS)
    if np.ptp(values) < 0.02 * (np.abs(values).max() + 1e-12):
        return None
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, KNOTS)))
    spread = np.diff(knots)
    if len(knots) < 3 or spread.min() < 0.02 * np.ptp(values):
        knots = np.linspace(float(values.min()), float(values.max()), KNOTS)
    return np.asarray(knots)


def _hats(signal: Floats, knots: Floats) -> Floats:
    """Return the piecewise linear basis functions, shape (k, rows)."""
    return np.array([np.interp(signal, knots, row) for row in np.eye(len(knots))])


def shape_to_show(shapes: list[Shape], balances: Balances, colour: Colour | None) -> Shape | None:
    """Return the shape to report: the best beyond its threshold, else that of the coloured balance."""
    if not shapes or shapes[0].excess > 0.0 or colour is None:
        return shapes[0] if shapes else None
    return next((s for s in shapes if s.balance == balances.names[colour.balance]), shapes[0])


def term_from_shape(shape: Shape, ship: Ship) -> Term | None:
    """Return a shape as a term of the ship file; None where the model has no location for it."""
    if shape.balance not in ADDED_TO:
        return None
    location, factor = ADDED_TO[shape.balance]
    if location == "pitch_rate":
        factor /= ship.pitch_actuator.time_constant_s
    points = np.column_stack([shape.knots, factor * shape.values])
    table = ", ".join(f"{x:.6g}, {y:.6g}" for x, y in points)
    tree = {"id": f"unnamed-{shape.balance}", "acts_on": location}
    return Term.model_validate(tree | {"expression": f"table({shape.signal}, {table})"})
