"""Units by their names, with the spellings of ships' logs."""

from __future__ import annotations

import functools
import re
from typing import Any

LONGEST = 60
"""Letters of a unit at most."""

_RAISED = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POWER = re.compile(
    r"(?<=[^\W\d_]|[°µ])\s*(\*\*|\^)\s*([-+]?\d(\.\d)?|\([-+]?\d(\.\d)?\))(?![\d.])"
)
"""A power of a name, its exponent of one digit, perhaps with a decimal and in brackets."""


def unit_of(name: str) -> Any:
    """A unit by its name.

    Raises:
        ValueError: it is not understood.
    """
    if len(name) > LONGEST:
        raise ValueError(
            f"unit {name[:20]!r}... has {len(name)} letters; at most {LONGEST} are read"
        )
    lowered = _RAISED.sub(lambda found: f"**{found[0].translate(_LOWERED)}", name)
    plain = _POWER.sub(" ", lowered)
    if "**" in plain or "^" in plain:  # pint works numbers out, however large: 9**9**9 takes days
        raise ValueError(
            f"unit {name!r} is not understood: an exponent is one number from -9 to 9 behind a name, "
            "as in m/s**2"
        )
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
