"""Units by their names, with the spellings of ships' logs."""

from __future__ import annotations

import functools
from typing import Any


def unit_of(name: str) -> Any:
    """A unit by its name.

    Raises:
        ValueError: it is not understood.
    """
    try:
        return registry().parse_units(name)
    except Exception as error:  # pint raises many kinds for text that is no unit
        raise ValueError(
            f"unit {name!r} is not understood ({error}); examples: rpm, kN m, knot, deg"
        ) from None


@functools.cache
def registry() -> Any:
    """The unit registry, with the spellings of ships' logs; made when a map first needs it."""
    import pint

    units: Any = pint.UnitRegistry(cache_folder=None)
    for spelling in ("newton_metre = newton * metre = Nm", "newton_millimetre = 1e-3 newton_metre = Nmm",
                     "@alias knot = kn", "@alias revolutions_per_minute = RPM"):  # fmt: skip
        units.define(spelling)
    return units
