"""What drives have in common whose demand goes either way."""

from __future__ import annotations

from typing import Any

from ..keys import INF


def fill_two_way(record: Any) -> None:
    """End stops alike in both directions, and no rack that travels."""
    record["drive_min"] = -record["drive_max"]
    record["rack_rate_limit"] = INF
