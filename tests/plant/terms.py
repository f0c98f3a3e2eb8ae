"""Terms on a ship, for tests."""

from __future__ import annotations

from typing import Any

from shaftline.plant import Ship
from shaftline.plant.expressions import NO_SIGNALS, InputSignals, LoadSignals, sum_load_terms

HEARD = InputSignals(11.0, 8.0, 1.2, 1.3, 22.0, 6.5, 4.0, 30.0, 0.4, 0.01, 0.2, -0.1, 0.7)
LOADED = LoadSignals(2e5, 6e4, 6.5e4, 1.8e5, 0.02)
NO_STATES = (0.0, 0.0, 0.0)


def with_term(ship: Ship, expression: str, acts_on: str = "load_torque", **numbers: float) -> Ship:
    term = {"id": "one", "acts_on": acts_on, "expression": expression, "parameters": numbers}
    return ship.with_values({"term": [term]})


def value(ship: Ship, expression: str, heard: InputSignals = HEARD, **numbers: float) -> Any:
    record = with_term(ship, expression, "drive_torque", **numbers).record()
    return sum_load_terms(record, heard, LOADED, NO_STATES, NO_SIGNALS).drive_torque
