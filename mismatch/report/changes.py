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
    old, new = (_numbers_of(ship) for ship in (diagnosis.ship, diagnosis.corrected))
    return [
        (
            breakable(key),
            _value(old.get(key), key, diagnosis.corrected),
            _value(value, key, diagnosis.corrected),
        )
        for key, value in new.items()
        if value != old.get(key)
    ]


def _numbers_of(ship: Ship) -> dict[str, Any]:
    """What stands in a ship's file, by dotted key; of a term also what it adds, in a line."""
    tree = ship.model_dump()
    found = _flat({key: value for key, value in tree.items() if key != "term"})
    for term in ship.term:
        found[f"term.{term.id}"] = "; ".join(f"{where}: {what}" for where, what in term.expressions)
        for name, parameter in term.parameters.items():
            found[f"term.{term.id}.{name}"] = parameter.value
    return found


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
