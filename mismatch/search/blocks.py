"""Build the blocks of formulas: products of simple functions of signals, and their units.

A formula is the sum of one or two blocks, each with a coefficient: ``(a + b * abs(beta)) * beta`` has
the blocks ``beta`` and ``abs(beta) * beta``. Units are written as in the ship file: ``N s2/m2``,
``rad/s``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Powers = Counter[str]
"""Exponent of each unit by name."""


def unit_powers(unit: str) -> Powers:
    """Return the exponents of a unit such as ``N m s/rad``; ``-`` and unreadable factors have none.

    Example:
        >>> dict(unit_powers("N s2/m2"))
        {'N': 1, 's': 2, 'm': -2}

    Args:
        unit: factors with exponents, separated by spaces; factors after a ``/`` divide.
    """
    found: Powers = Counter()
    for place, part in enumerate(unit.split("/")):
        for factor in part.split():
            read = re.fullmatch(r"([A-Za-z]+)(\d*)", factor)
            if read is not None:
                found[read[1]] += (-1 if place else 1) * int(read[2] or 1)
    return found


def divide_units(unit: str, by: Powers) -> str:
    """Return the quotient of two units in the notation of the ship file; ``-`` if it has no unit.

    Example:
        >>> divide_units("N", unit_powers("m2/s2"))
        'N s2/m2'

    Args:
        unit: unit of the dividend.
        by: exponents of the divisor.
    """
    left = unit_powers(unit)
    left.subtract(by)

    def side(sign: int) -> str:
        return " ".join(
            f"{name}{abs(power) if abs(power) > 1 else ''}"
            for name, power in left.items()
            if power * sign > 0
        )

    above, below = side(1), side(-1)
    if not below:
        return above or "-"
    return f"{above or '1'}/{below.replace(' ', '/')}"


Values = Mapping[str, NDArray[np.float64]]

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
    "advance_velocity", "submergence", "thrust", "propeller_torque", "brake_torque", "resistance",
    "pitch_rate",
)  # fmt: skip
"""Signals that are computed from other signals; they make a formula count as longer."""


@dataclass(frozen=True, order=True)
class Factor:
    """Simple function of one signal.

    Args:
        signal: name of the signal.
        kind: ``itself``, ``size`` (magnitude), ``sign`` (smooth sign) or ``over`` (excess over a kink).
        number: width of the sign or position of the kink, in the unit of the signal.
    """

    signal: str
    kind: str = "itself"
    number: float = 0.0

    def trace(self, values: Values) -> NDArray[np.float64]:
        """Return the values along a simulation, shape (rows,)."""
        x = values[self.signal]
        if self.kind == "size":
            return np.abs(x)
        if self.kind == "sign":
            return np.asarray(np.tanh(x / self.number))
        return np.maximum(x - self.number, 0.0) if self.kind == "over" else x

    @property
    def expression(self) -> str:
        """Expression in the syntax of a term."""
        return {
            "itself": self.signal,
            "size": f"abs({self.signal})",
            "sign": f"tanh({self.signal} / {self.number:g})",
            "over": f"max({self.signal} - {self.number:g}, 0)".replace("- -", "+ "),
        }[self.kind]

    @property
    def words(self) -> str:
        """Expression in mathematical notation."""
        name = self.signal.replace("_", " ")
        return {
            "itself": name,
            "size": f"|{name}|",
            "sign": f"tanh({name}/{self.number:g})",
            "over": f"max({name} − {self.number:g}, 0)".replace("− -", "+ "),
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

    def trace(self, values: Values) -> NDArray[np.float64]:
        """Return the values along a simulation, shape (rows,)."""
        found = np.ones(len(next(iter(values.values()))))
        for factor in self.factors:
            found = found * factor.trace(values)
        return found

    def unit(self, units: Mapping[str, str]) -> Powers:
        """Return the exponents of the unit of the block.

        Args:
            units: units of the signals, by name.
        """
        found: Powers = Counter()
        for factor in self.factors:
            if factor.kind != "sign":
                found.update(unit_powers(units[factor.signal]))
        return found


def product(parts: Sequence[str], power: str, times: str) -> str:
    """Return the product of expressions as text, equal ones as a power: ``x * y ** 2``.

    Args:
        parts: expressions.
        power: text between an expression and its exponent.
        times: text between two expressions.
    """
    counted = Counter(parts)
    return times.join(f"{p}{power}{n}" if n > 1 else p for p, n in counted.items())


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

    def texts(factors: Counter[Factor]) -> list[str]:
        return [f.words if words else f.expression for f in sorted(factors.elements())]

    counted = [Counter(block.factors) for block in blocks]
    shared = counted[0]
    for one in counted[1:]:
        shared = shared & one
    if len(blocks) == 1:
        return times.join(filter(None, (names[0], product(texts(shared), power, times))))
    own = [
        times.join(filter(None, (name, product(texts(one - shared), power, times))))
        for name, one in zip(names, counted, strict=True)
    ]
    total = " + ".join(own)
    if not shared:
        return total
    return f"({total}){times}{product(texts(shared), power, times)}"


def make_blocks(values: Values) -> list[Block]:
    """Return all distinct blocks of the signals that vary, the shortest first.

    Args:
        values: signals by name, each of shape (rows,).
    """
    moving = {
        name: x
        for name, x in values.items()
        if np.isfinite(x).all() and np.ptp(x) > STILL * float(np.abs(x).max())
    }
    every = sorted(dict.fromkeys(_all(moving)), key=lambda block: block.length)
    if not moving:
        return []
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
    yield Block(())
    for name, x in values.items():
        itself, size = Factor(name), Factor(name, "size")
        for count in (1, 2, 3, 4):
            yield Block.of(*[itself] * count)
        if x.min() < 0.0 < x.max():
            yield Block.of(size)
            yield Block.of(itself, size)
            yield Block.of(_sign(name, x))
        for place in np.quantile(x, KNEES):
            if x.min() < _round(place) < x.max():
                yield Block.of(Factor(name, "over", _round(place)))
    for name, x in values.items():
        for other in values:
            if other == name:
                continue
            yield Block.of(Factor(name), Factor(other))
            yield Block.of(Factor(name), Factor(name), Factor(other))
            yield Block.of(Factor(name), Factor(name), Factor(other), Factor(other))
            if x.min() < 0.0 < x.max():
                yield Block.of(Factor(name, "size"), Factor(other))
                yield Block.of(_sign(name, x), Factor(other))
                yield Block.of(Factor(name), Factor(name, "size"), Factor(other), Factor(other))


def _sign(name: str, x: NDArray[np.float64]) -> Factor:
    return Factor(name, "sign", _round(SIGN_SHARE * float(np.abs(x).max())))


def _round(value: float) -> float:
    return float(f"{value:.3g}")
