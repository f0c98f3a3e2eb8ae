"""Units of products and quotients, in the way that a ship's file writes them: ``N s2/m2``, ``rad/s``."""

from __future__ import annotations

import re
from collections import Counter

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
