"""Environments whose simulation diverges."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..plant import Ship
from .records import ENVIRONMENT

_FIELDS: Any = ENVIRONMENT.fields
_KIND, _OFFSET = _FIELDS["state"][:2]


def refuse_divergence(ship: Ship, environments: Any, first: int, last: int) -> None:
    """Refuse environments whose state holds a number that is not finite.

    Args:
        ship: that is simulated, for the message.
        environments: ENVIRONMENT array of shape (n,).
        first: environment that is looked at.
        last: environment behind the last one.

    Raises:
        ValueError: names the environment.
    """
    rows: Any = np.ndarray(
        (len(environments), _KIND.itemsize // 8), np.float64, environments.view(np.uint8), _OFFSET,
        (ENVIRONMENT.itemsize, 8),
    )[first:last]  # fmt: skip
    if np.isfinite(rows.sum()):
        return
    lost = first + int(np.argmin(np.isfinite(rows).all(axis=1)))
    raise ValueError(
        f"{ship.name}: the simulation of environment {lost} diverges: its state is not finite. A "
        f"parameter or a term of the ship is too fast for the time step of {ship.time_step_s:g} s"
    )
