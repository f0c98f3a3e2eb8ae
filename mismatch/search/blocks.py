"""Units of products and quotients, in the way that a ship's file writes them: ``N s2/m2``, ``rad/s``.

The grammar of formulas: blocks, which are products of simple functions of signals.

A formula is one or two blocks, each with a coefficient of its own: ``(a + b * abs(beta)) * beta`` is
made of the blocks ``beta`` and ``abs(beta) * beta``.
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
"""Exponent of each unit, by its name."""


def powers(unit: str) -> Powers:
    """Exponents of a unit such as ``N m s/rad``; none of ``-``, and none of what cannot be read.

    Args:
        unit: factors apart by spaces, each with its exponent; those behind a ``/`` divide.
    """
    found: Powers = Counter()
    for place, part in enumerate(unit.split("/")):
        for factor in part.split():
            read = re.fullmatch(r"([A-Za-z]+)(\d*)", factor)
            if read is not None:
                found[read[1]] += (-1 if place else 1) * int(read[2] or 1)
    return found


def quotient(unit: str, by: Powers) -> str:
    """A unit divided by others, as a ship's file writes it; ``-`` where nothing is left.

    Args:
        unit: of the dividend.
        by: exponents of the divisor.
    """
    left = powers(unit)
    left.subtract(by)

    def joined(sign: int) -> str:
        return " ".join(
            f"{name}{abs(power) if abs(power) > 1 else ''}"
            for name, power in left.items()
            if power * sign > 0
        )

    above, below = joined(1), joined(-1)
    if not below:
        return above or "-"
    return f"{above or '1'}/{below.replace(' ', '/')}"


Values = Mapping[str, NDArray[np.float64]]

ALIKE = 1.0 - 2e-6
"""Cosine of two blocks' traces from which on they are the same."""

STILL = 0.02
"""Spread of a signal, as a share of its size, below which nothing can be seen to follow it."""

KNEES = (0.25, 0.5, 0.75)
"""Quantiles of a signal at which a bend is tried."""

SIGN_SHARE = 0.05
"""Width of a smooth sign, as a share of the signal's largest size."""

ROWS = 2000
"""Rows at most over which blocks are compared."""

DERIVED = (
    "advance_velocity", "submergence", "thrust", "propeller_torque", "brake_torque", "resistance",
    "pitch_rate",
)  # fmt: skip
"""Signals that follow from others; of two formulas that do as well, the one without them is shorter."""


@dataclass(frozen=True, order=True)
class Factor:
    """A simple function of one signal.

    Args:
        signal: its name.
        kind: ``itself``, ``size``, ``sign`` or ``over``.
        number: width of the sign, or place of the bend, in the signal's unit.
    """

    signal: str
    kind: str = "itself"
    number: float = 0.0

    def trace(self, values: Values) -> NDArray[np.float64]:
        """Along a simulation, shape (rows,)."""
        x = values[self.signal]
        if self.kind == "size":
            return np.abs(x)
        if self.kind == "sign":
            return np.asarray(np.tanh(x / self.number))
        return np.maximum(x - self.number, 0.0) if self.kind == "over" else x

    @property
    def expression(self) -> str:
        """As a term has it."""
        return {
            "itself": self.signal,
            "size": f"abs({self.signal})",
            "sign": f"tanh({self.signal} / {self.number:g})",
            "over": f"max({self.signal} - {self.number:g}, 0)".replace("- -", "+ "),
        }[self.kind]

    @property
    def words(self) -> str:
        """As an engineer reads it."""
        name = self.signal.replace("_", " ")
        return {
            "itself": name,
            "size": f"|{name}|",
            "sign": f"tanh({name}/{self.number:g})",
            "over": f"max({name} − {self.number:g}, 0)".replace("− -", "+ "),
        }[self.kind]


@dataclass(frozen=True)
class Block:
    """A product of factors; of none, it is 1."""

    factors: tuple[Factor, ...]

    @classmethod
    def of(cls, *factors: Factor) -> Block:
        """The product, its factors in the order of their names."""
        return cls(tuple(sorted(factors)))

    @property
    def signals(self) -> tuple[str, ...]:
        """That it follows."""
        return tuple(dict.fromkeys(factor.signal for factor in self.factors))

    @property
    def length(self) -> int:
        """What it costs to say it: factors, numbers in them, and signals beyond the first."""
        own = [1 + (f.kind in ("sign", "over")) + 2 * (f.signal in DERIVED) for f in self.factors]
        return sum(own) + max(len(self.signals) - 1, 0)

    def trace(self, values: Values) -> NDArray[np.float64]:
        """Along a simulation, shape (rows,)."""
        found = np.ones(len(next(iter(values.values()))))
        for factor in self.factors:
            found = found * factor.trace(values)
        return found

    def unit(self, units: Mapping[str, str]) -> Powers:
        """Exponents of its unit.

        Args:
            units: of the signals, by name.
        """
        found: Powers = Counter()
        for factor in self.factors:
            if factor.kind != "sign":
                found.update(powers(units[factor.signal]))
        return found


def product(parts: Sequence[str], power: str, times: str) -> str:
    """Parts multiplied, equal ones as a power: ``x * y ** 2``.

    Args:
        parts: expressions.
        power: between a part and its exponent.
        times: between two parts.
    """
    counted = Counter(parts)
    return times.join(f"{p}{power}{n}" if n > 1 else p for p, n in counted.items())


def joined(blocks: Sequence[Block], names: Sequence[str], *, words: bool = False) -> str:
    """Blocks with their coefficients as one expression, what they share taken out of the sum.

    Args:
        blocks: at least one.
        names: of the coefficients.
        words: as an engineer reads it, not as a term has it.
    """
    power, times = ("^", " ") if words else (" ** ", " * ")

    def said(factors: Counter[Factor]) -> list[str]:
        return [f.words if words else f.expression for f in sorted(factors.elements())]

    counted = [Counter(block.factors) for block in blocks]
    shared = counted[0]
    for one in counted[1:]:
        shared = shared & one
    if len(blocks) == 1:
        return times.join(filter(None, (names[0], product(said(shared), power, times))))
    own = [
        times.join(filter(None, (name, product(said(one - shared), power, times))))
        for name, one in zip(names, counted, strict=True)
    ]
    total = " + ".join(own)
    if not shared:
        return total
    return f"({total}){times}{product(said(shared), power, times)}"


def blocks_of(values: Values) -> list[Block]:
    """Every block of some signals that moves, the shortest first; of those that are alike, the shortest.

    Args:
        values: of the signals by name, each of shape (rows,).
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
