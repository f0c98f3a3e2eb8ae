"""What has no name: the shape of a missing torque, force or pitch over a signal that it follows.

The catalogue cannot hold everything. A piecewise linear function of one signal (or of time), scored in
the same whitened way as the named effects, tells whether something systematic is missing, in which
balance, and what it looks like.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import Ship
from ...plant.terms import Term
from ..search.fitting import Fit, Fitter
from ..search.spectra import chance
from ..search.whiteness import Colour
from ..simulate.balances import Balances

RARE = 1e-3
"""Probability that chance alone makes a shape pass: nobody would expect one."""

KNOTS = 5
TIME_KNOTS = 8
LOOSE = 10.0
"""Prior standard deviation of a shape's values, in rms of its balance's residual: next to free."""


@dataclass(frozen=True)
class Shape:
    """A missing quantity over a signal.

    Args:
        balance: that lacks it.
        unit: of the values.
        signal: that it follows: ``shaft_speed``, ``ship_speed``, ``pitch_ratio``, ``drive``, ``time``.
        signal_unit: of the knots.
        knots: values of the signal, rising, shape (k,).
        values: what is missing at each knot, shape (k,).
        gain: in 2 log L.
        threshold: that chance alone does not reach.
        trace: over the recording, shape (rows,).
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
        """Gain beyond what chance reaches."""
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
"""Where what a balance lacks is added, and with which sign; a current is what comes of the rest."""


def term_of(shape: Shape, ship: Ship) -> Term | None:
    """A shape as a term of a ship; None where it acts on nothing that a ship has.

    Args:
        shape: the shape.
        ship: the nominal ship.
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
    """Piecewise linear basis, shape (k, rows)."""
    return np.array([np.interp(signal, knots, row) for row in np.eye(len(knots))])


def signals_of(fitter: Fitter, fit: Fit) -> dict[str, tuple[NDArray[np.float64], str]]:
    """Simulated signals that a missing quantity may follow, with their units."""
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
    if len(replay.runs) == 1:  # recordings that were joined share no clock
        found["time"] = (replay.time_s, "s")
    return found


def best_shapes(fitter: Fitter, fit: Fit) -> list[Shape]:
    """The best shape of each balance on top of a model, the most convincing first."""
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
            marginal = fitter.beside(fit, columns)
            # the loose prior is no cost of the shape's
            shares = marginal.shares[: len(knots)]
            gain = marginal.score + float(shares @ shares) - fit.score
            coefficients = shares * LOOSE * rms
            limit = chance(len(knots), tried, RARE)
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
    """The shape to show: the best that is beyond chance, else that of the coloured balance."""
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
