"""What a correction changes in the ship's file, for the page."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from ...plant.ship import Ship
from ...plant.ship_errors import ShipError
from ..outcome import Outcome
from .wording import breakable, number, superscript

_ABSENT = "absent"


def changed_keys(diagnosis: Outcome) -> list[tuple[Markup, str, str]]:
    """Keys of the ship's file that differ: key, nominal and corrected value."""
    old, new = (_flat(s.model_dump()) for s in (diagnosis.ship, diagnosis.corrected))
    return [
        (
            breakable(key),
            _value(old.get(key), key, diagnosis.ship),
            _value(value, key, diagnosis.ship),
        )
        for key, value in new.items()
        if value != old.get(key)
    ]


def _flat(tree: dict[str, Any], above: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        found |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {above + key: value}
    return found


def _value(value: Any, key: str, ship: Ship) -> str:
    if value is None:
        return _ABSENT
    if isinstance(value, list | tuple):
        return ", ".join(_value(item, "", ship) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    try:
        unit = ship.number(key).info.unit if key else "-"
    except (ShipError, KeyError, ValueError):
        unit = "-"
    return f"{number(float(value), 5)} {superscript(unit)}".strip()
