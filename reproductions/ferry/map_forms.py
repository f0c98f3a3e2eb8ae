"""Fit engine maps of several forms to the printed consumption, for a batch of propellers.

A map gives the specific consumption C over brake power N and engine speed n, both over the rated ones.
Each form is linear in its coefficients, some for C, some for ln C. Besides the twenty consumptions the
optima count: along equal thrust and ship speed, the fuel N C must not change with the engine speed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .similarity import (
    BEFORE,
    PLAIN,
    TOP_RPM,
    Groups,
    Prints,
    Propellers,
    powers,
)

Floats = NDArray[np.float64]

_NUDGE = 1e-3  # relative change of the engine speed for the slopes
OPTIMA = np.array([True, False, True, True])  # of the states; Table 1 is the combinator's
OFFSETS = np.linspace(-0.08, 0.08, 65)
"""Changes of the engine speed in which the optimum is searched, as shares."""


def _products(powers_: tuple[tuple[int, int], ...]) -> Callable[[Floats, Floats], Floats]:
    return lambda p, s: np.stack([p**i * s**j for i, j in powers_], -1)


def _willans(
    friction: tuple[int, ...], slope: tuple[int, ...]
) -> Callable[[Floats, Floats], Floats]:
    return lambda p, s: np.stack([*(s**j / p for j in friction), *(s**j for j in slope)], -1)


_QUADRATIC = tuple((i, j) for i in range(3) for j in range(3) if i + j <= 2)
_CUBIC = tuple((i, j) for i in range(4) for j in range(4) if i + j <= 3)
_PAPER = tuple((i, j) for i in range(3) for j in range(4))


class Form(NamedTuple):
    """A form of the map."""

    terms: Callable[[Floats, Floats], Floats]  # of power and speed, or of their logarithms
    coefficients: int
    logarithmic: bool = False  # gives ln C over ln N and ln n

    def evaluate(self, power: Floats, speed: Floats) -> Floats:
        """Return the terms at powers and speeds, shape (..., coefficients)."""
        if self.logarithmic:
            power, speed = np.log(power), np.log(speed)
        return self.terms(power, speed)


FORMS = {
    "Willans line, 4": Form(_willans((1, 2), (0, 1)), 4),
    "Willans line, 6": Form(_willans((1, 2, 3), (0, 1, 2)), 6),
    "full quadratic, 6": Form(_products(_QUADRATIC), 6),
    "quadratic of logarithms, 6": Form(_products(_QUADRATIC), 6, True),
    "cubic, 10": Form(_products(_CUBIC), 10),
    "cubic of logarithms, 10": Form(_products(_CUBIC), 10, True),
    "the paper's, 12": Form(_products(_PAPER), 12),
}
"""Forms with their number of coefficients.

A Willans line has fuel = friction(n) + power / efficiency(n). A quadratic has the ellipses around a
minimum.
"""


class Field(NamedTuple):
    """Power and engine speed of the printed states and of the changed engine speeds around them."""

    power: Floats  # shape (n, 4, 5)
    nudged: Floats  # at the engine speed times 1 - and 1 + the nudge, shape (2, n, 4, 5)
    around: Floats  # at each of :data:`OFFSETS`, shape (offsets, n, 4, 5)
    speed: Floats  # shape (4, 5)


def make_field(propellers: Propellers, groups: Groups, prints: Prints) -> Field:
    """Return the powers of each propeller at the printed states and around them."""

    def at(share: float) -> Floats:
        return powers(propellers, groups, prints.engine * share, prints.ship_speed)

    return Field(
        at(1.0),
        np.stack([at(1.0 - _NUDGE), at(1.0 + _NUDGE)]),
        np.stack([at(1.0 + float(offset)) for offset in OFFSETS]),
        prints.engine / TOP_RPM,
    )


class Fit(NamedTuple):
    """Maps of one form, one for each of n propellers."""

    form: Form
    coefficients: Floats  # of the scaled terms, shape (n, m)
    mean: Floats  # of the terms over the states that were used, shape (n, 1, m)
    scale: Floats

    def consumption(self, power: Floats, speed: Floats) -> Floats:
        """Return the consumption [g/kWh] at powers of shape (n, ...)."""
        shape = power.shape
        flat = power.reshape(shape[0], -1)
        terms = self.form.evaluate(flat, np.broadcast_to(speed, shape).reshape(shape[0], -1))
        value = np.einsum("nsm,nm->ns", self._scaled(terms), self.coefficients)
        if self.form.logarithmic:
            value = np.exp(np.clip(value, 0.0, 12.0))
        return np.asarray(value.reshape(shape))

    def _scaled(self, terms: Floats) -> Floats:
        scaled = (terms - self.mean) / self.scale
        return np.concatenate([np.ones((*scaled.shape[:-1], 1)), scaled], -1)


def fit_maps(
    form: Form,
    field: Field,
    prints: Prints,
    slope_weight: float,
    ridge: float,
    used: NDArray[np.bool_],
) -> Fit:
    """Fit a map for each propeller by regularised linear least squares.

    Args:
        form: form of the map.
        field: powers and speeds of the printed states.
        prints: the printed states.
        slope_weight: consumption [g/kWh] that counts as much as a slope of 1 % of the fuel by 1 % of the
            engine speed at a printed optimum, times 100.
        ridge: weight of the coefficients of the terms, each over its scatter [-].
        used: levers that are used, shape (5,).
    """
    n = len(field.power)
    terms = form.evaluate(field.power, np.broadcast_to(field.speed, field.power.shape))
    # The mean and the scatter of the terms, so that the ridge does not depend on units.
    kept = terms[:, :, used].reshape(n, -1, terms.shape[-1])
    varies = kept.std(axis=(0, 1)) > 1e-12
    pick = Form(lambda p, s: form.terms(p, s)[..., varies], form.coefficients, form.logarithmic)
    kept = kept[..., varies]
    mean = kept.mean(axis=1, keepdims=True)
    fit = Fit(pick, np.zeros((n, 1)), mean, kept.std(axis=1, keepdims=True))
    consumption = np.broadcast_to(prints.consumption[:, used].ravel(), (n, kept.shape[1]))
    value = fit._scaled(kept)
    sides = [
        fit._scaled(
            pick.evaluate(side, np.broadcast_to(field.speed * share, side.shape))[:, OPTIMA][
                :, :, used
            ].reshape(n, -1, int(varies.sum()))
        )
        for side, share in zip(field.nudged, (1.0 - _NUDGE, 1.0 + _NUDGE), strict=True)
    ]
    change = (sides[1] - sides[0]) / (2.0 * _NUDGE)
    rise = np.log(field.nudged[1] / field.nudged[0])[:, OPTIMA][:, :, used] / (2.0 * _NUDGE)
    best = np.broadcast_to(prints.consumption[OPTIMA][:, used].ravel(), change.shape[:2])
    if form.logarithmic:
        rows, aims = value * consumption[..., None], np.log(consumption) * consumption
    else:
        rows, aims, change = value, consumption, change / best[..., None]
    quiet = np.zeros((n, rows.shape[-1] - 1, rows.shape[-1]))
    # in a logarithmic form the coefficients are shares of the consumption
    level = float(prints.consumption.mean()) if form.logarithmic else 1.0
    quiet[:, :, 1:] = ridge * level * np.eye(rows.shape[-1] - 1)
    matrix = np.concatenate([rows, slope_weight * change, quiet], 1)
    target = np.concatenate(
        [aims, -slope_weight * rise.reshape(n, -1), np.zeros(quiet.shape[:2])], 1
    )
    found = np.linalg.pinv(matrix, rcond=1e-13) @ target[..., None]
    return fit._replace(coefficients=found[..., 0])


class Judgement(NamedTuple):
    """What maps give at the printed states, for each of n propellers."""

    consumption: Floats  # [g/kWh], shape (n, 4, 5)
    engine: Floats  # optimum engine speed less the printed one [rpm], shape (n, 4, 5)
    saving: Floats  # of the fuel by the optimum at the states of Table 1 after the rise [%], (n, 5)


def judge(fit: Fit, field: Field, prints: Prints) -> Judgement:
    """Return the consumption at the printed states, the optima around them, and the saving."""
    fuel = []
    for offset, power in zip(OFFSETS, field.around, strict=True):
        fuel.append(power * fit.consumption(power, field.speed * (1.0 + offset)))
    along = np.stack(fuel)  # shape (offsets, n, 4, 5)
    best = OFFSETS[np.argmin(along, axis=0)]
    here = along[len(OFFSETS) // 2]
    saving = 100.0 * (1.0 - along.min(axis=0)[:, PLAIN] / here[:, PLAIN])
    return Judgement(fit.consumption(field.power, field.speed), best * prints.engine, saving)


def implied_saving(field: Field, prints: Prints) -> Floats:
    """Return the saving [%] of fuel that the printed consumption of Tables 1 and 3 means, (n, 5)."""
    plain, equal = PLAIN, len(prints.engine) - 1
    fuel = field.power * prints.consumption
    return np.asarray(100.0 * (1.0 - fuel[:, equal] / fuel[:, plain]))


def variation(consumption: Floats) -> Floats:
    """Return the consumption after the disturbance less that before it, shape (n, 3, 5)."""
    return consumption[:, BEFORE + 1 :] - consumption[:, [BEFORE]]
