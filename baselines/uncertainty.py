"""Uncertainty of the CPP optimiser's model, and the cases for which its surface is robust.

KQ, the relative rotative efficiency eta_R and the wake fraction w of a ship are never known exactly:

    KQ' = (1 + e_Q) KQ,   eta_R' = (1 + e_R) eta_R,   w' = w + e_w

with independent errors, uniform within bounds. The propeller torque is KQ / eta_R, so the first two act
as one factor on the torque; the third is a factor (1 - w') / (1 - w) on the advance velocity that the
optimiser assumes.

The worst case takes the corners of these bounds, the expectation a Gauss quadrature with two nodes for
each error, exact for a cubic.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from ..observers.records import Floats
from ..plant.ship import Ship

LARGEST = 0.3  # largest bound of an error [-]


class Uncertainty(NamedTuple):
    """Bounds of the errors of a ship file, and the criterion of a robust surface."""

    kq: float = 0.0  # largest |e_Q| [-]
    eta_r: float = 0.0  # largest |e_R| [-]
    wake: float = 0.0  # largest |e_w| [-]
    expected: bool = False  # minimise the expected fuel, not the fuel of the worst case

    @property
    def present(self) -> bool:
        """Whether an error is possible."""
        return max(self[:3]) > 0.0


CERTAIN = Uncertainty()


def uncertain_cases(ship: Ship, uncertainty: Uncertainty) -> Floats:
    """Return the cases (factor on the torque, factor on v_a, weight), shape (k, 3).

    Without an error there is no case. The weights of an expectation add up to 1; those of the worst
    case are without meaning.

    Raises:
        ValueError: a bound is outside 0 to :data:`LARGEST`.

    Example:
        >>> from shaftline.plant import load_ship
        >>> uncertain_cases(load_ship("frigate"), Uncertainty(kq=0.05)).round(3).tolist()
        [[0.95, 1.0, 1.0], [1.05, 1.0, 1.0]]
    """
    for name, value in zip(("kq_error", "eta_r_error", "wake_error"), uncertainty, strict=False):
        if not 0.0 <= value <= LARGEST:
            raise ValueError(f"{name} = {value!r}: must be 0 to {LARGEST:g}")
    if not uncertainty.present:
        return np.zeros((0, 3))
    through = 1.0 - ship.hull.wake_fraction
    scale = 1.0 / math.sqrt(3.0) if uncertainty.expected else 1.0
    errors = [(-scale * e, scale * e) if e > 0.0 else (0.0,) for e in uncertainty[:3]]
    cases = np.array(
        [
            ((1.0 + q) / (1.0 + r), (through - w) / through, 1.0)
            for q, r, w in itertools.product(*errors)
        ]
    )
    if uncertainty.expected:
        cases[:, 2] /= len(cases)
    return cases
