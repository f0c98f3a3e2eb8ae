"""Build the blocks of formulas: products of simple functions of signals, and their units.

A formula is the sum of one or two blocks, each with a coefficient: ``(a + b * abs(beta)) * beta`` has
the blocks ``beta`` and ``abs(beta) * beta``. Units are written as in the ship file: ``N s2/m2``,
``rad/s``.
"""

from __future__ import annotations

import functools
import itertools
import operator
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..simulate.joint_replay import Floats

Powers = Counter[str]
"""Exponent of each unit by name."""

Values = Mapping[str, Floats]

ALIKE = 1.0 - 2e-6
"""Cosine of the traces of two blocks from which they count as equal."""

STILL = 0.02
"""Range of a signal, as a share of its size, below which no dependence on it is identifiable."""

KNEES = (0.25, 0.5, 0.75)
"""Quantiles of a signal at which a kink is tried."""

SIGN_SHARE = 0.05
"""Width of a smooth sign function, as a share of the largest magnitude of the signal."""

ROWS = 2000
"""Largest number of rows over which blocks are compared."""

DERIVED = (
    "advance_velocity",
    "submergence",
    "thrust",
    "propeller_torque",
    "brake_torque",
    "resistance",
    "pitch_rate",
)
"""Signals that are computed from other signals; they make a formula count as longer."""


@dataclass(frozen=True, order=True)
class Factor:
    """Simple function of one signal."""

    signal: str  # name of the signal
    kind: str = "itself"  # ``itself``, ``size`` (magnitude), ``sign`` (smooth) or ``over`` (a kink)
    number: float = 0.0  # width of the sign or position of the kink, in the unit of the signal

    def trace(self, values: Values) -> Floats:
        """Return the values along a simulation, shape (rows,)."""
        x = values[self.signal]
        if self.kind == "size":
            return np.abs(x)
        if self.kind == "sign":
            return np.asarray(np.tanh(x / self.number))
        return np.maximum(x - self.number, 0.0) if self.kind == "over" else x

    def text(self, words: bool) -> str:
        """Return the expression in mathematical notation, or else in the syntax of a term."""
        name = self.signal.replace("_", " ") if words else self.signal
        size, over, minus = ("|{}|", "/", "−") if words else ("abs({})", " / ", "-")
        return {
            "itself": name,
            "size": size.format(name),
            "sign": f"tanh({name}{over}{self.number:g})",
            "over": f"max({name} {minus} {self.number:g}, 0)".replace(f"{minus} -", "+ "),
        }[self.kind]


@dataclass(frozen=True)
class Block:
    """Product of factors; a product of no factors is 1."""

    factors: tuple[Factor, ...]

    @classmethod
    def of(cls, *factors: Factor) -> Block:
        """Return the product of factors in the order of their names."""
        return cls(tuple(sorted(factors)))

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals on which the block depends."""
        return tuple(dict.fromkeys(factor.signal for factor in self.factors))

    @property
    def length(self) -> int:
        """Description length: factors, numbers in them, and signals beyond the first."""
        own = [1 + (f.kind in ("sign", "over")) + 2 * (f.signal in DERIVED) for f in self.factors]
        return sum(own) + max(len(self.signals) - 1, 0)

    def trace(self, values: Values) -> Floats:
        """Return the values along a simulation, shape (rows,)."""
        product = np.ones(len(next(iter(values.values()))))
        for factor in self.factors:
            product = product * factor.trace(values)
        return product

    def unit(self, units: Mapping[str, str]) -> Powers:
        """Return the exponents of the unit of the block from the units of the signals by name."""
        powers: Powers = Counter()
        for factor in self.factors:
            if factor.kind != "sign":
                powers.update(unit_powers(units[factor.signal]))
        return powers


def make_blocks(values: Values) -> list[Block]:
    """Return all distinct blocks of the signals (rows,) that vary, the shortest first."""
    finite = {name: x for name, x in values.items() if np.isfinite(x).all()}
    moving = {n: x for n, x in finite.items() if np.ptp(x) > STILL * float(np.abs(x).max())}
    if not moving:
        return []
    every = sorted(dict.fromkeys(_all(moving)), key=lambda block: block.length)
    skipped = {name: x[:: max(1, len(x) // ROWS)] for name, x in moving.items()}
    traces: Any = np.array([block.trace(skipped) for block in every])
    sizes = np.linalg.norm(traces, axis=1)
    usable = np.isfinite(sizes) & (sizes > 0.0)
    traces = traces / np.where(usable, sizes, 1.0)[:, None]
    alike = np.abs(traces @ traces.T) > ALIKE
    kept: list[int] = []
    for i in np.flatnonzero(usable):
        if not alike[i, kept].any():
            kept.append(int(i))
    return [every[i] for i in kept]


def _all(values: Values) -> Iterator[Block]:
    """Yield all blocks of one signal, and then of two."""
    yield Block(())
    for name, x in values.items():
        itself, size, sign = _factors(name, x)
        for count in (1, 2, 3, 4):
            yield Block.of(*[itself] * count)
        if x.min() < 0.0 < x.max():
            yield from (Block.of(size), Block.of(itself, size), Block.of(sign))
        for place in np.quantile(x, KNEES):
            if x.min() < _round(place) < x.max():
                yield Block.of(Factor(name, "over", _round(place)))
    for name, partner in itertools.permutations(values, 2):
        x, other = values[name], Factor(partner)
        itself, size, sign = _factors(name, x)
        yield Block.of(itself, other)
        yield Block.of(itself, itself, other)
        yield Block.of(itself, itself, other, other)
        if x.min() < 0.0 < x.max():
            yield Block.of(size, other)
            yield Block.of(sign, other)
            yield Block.of(itself, size, other, other)


def _factors(name: str, x: Floats) -> tuple[Factor, Factor, Factor]:
    """Return a signal, its magnitude and its smooth sign."""
    width = _round(SIGN_SHARE * float(np.abs(x).max()))
    return Factor(name), Factor(name, "size"), Factor(name, "sign", width)


def _round(value: float) -> float:
    return float(f"{value:.3g}")


def join_blocks(blocks: Sequence[Block], names: Sequence[str], *, words: bool = False) -> str:
    """Return the sum of blocks with coefficients as one expression, common factors outside the sum.

    Example:
        >>> beta, size = Factor("beta"), Factor("beta", "size")
        >>> join_blocks([Block.of(beta), Block.of(beta, size)], ["a", "b"])
        '(a + b * abs(beta)) * beta'

    Args:
        blocks: at least one block.
        names: names of the coefficients.
        words: whether mathematical notation is used; else the syntax of a term.
    """
    power, times = ("^", " ") if words else (" ** ", " * ")

    def product(head: str, factors: Counter[Factor]) -> str:
        """Return a product as text, equal factors as a power: ``x * y ** 2``."""
        counts = sorted(factors.items())
        parts = [f.text(words) + (f"{power}{n}" if n > 1 else "") for f, n in counts]
        return times.join([head, *parts])

    counted = [Counter(block.factors) for block in blocks]
    if len(blocks) == 1:
        return product(names[0], counted[0])
    shared = functools.reduce(operator.and_, counted)
    pairs = zip(names, counted, strict=True)
    total = " + ".join(product(name, one - shared) for name, one in pairs)
    return product(f"({total})", shared) if shared else total


def divide_units(unit: str, by: Powers) -> str:
    """Return the quotient of a unit and the exponents of another unit; ``-`` if it has no unit.

    Example:
        >>> divide_units("N", unit_powers("m2/s2"))
        'N s2/m2'
    """
    powers = unit_powers(unit)
    powers.subtract(by)
    above, below = (
        [name + (str(abs(p)) if abs(p) > 1 else "") for name, p in powers.items() if p * sign > 0]
        for sign in (1, -1)
    )
    if not below:
        return " ".join(above) or "-"
    return f"{' '.join(above) or '1'}/{'/'.join(below)}"


def unit_powers(unit: str) -> Powers:
    """Return the exponents of a unit; ``-`` and unreadable factors have none.

    Example:
        >>> dict(unit_powers("N s2/m2"))
        {'N': 1, 's': 2, 'm': -2}

    Args:
        unit: factors with exponents, separated by spaces; factors after a ``/`` divide.
    """
    powers: Powers = Counter()
    for k, part in enumerate(unit.split("/")):
        for factor in part.split():
            if match := re.fullmatch(r"([A-Za-z]+)(\d*)", factor):
                powers[match[1]] += (-1 if k else 1) * int(match[2] or 1)
    return powers
