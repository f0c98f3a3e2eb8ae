"""A torque, force or rate of unknown origin, as a function of one signal."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled
from ..core.numeric import piecewise_linear
from .keys import Section

BALANCES = ("engine", "propeller", "hull", "pitch-actuator")
"""Balances to which it may be added; ``plant.unexplained_balance`` counts them from 1, 0 is none."""

ENGINE, PROPELLER, HULL, PITCH_ACTUATOR = 1, 2, 3, 4

FOLLOWED = ("shaft_speed", "ship_speed", "pitch_ratio", "drive", "time")
"""Signals that it may follow; ``plant.unexplained_signal`` counts them from 0."""

MAX_KNOTS = 12


_Knot = Annotated[float, Field(ge=-1e9, le=1e9)]


def _knots(description: str) -> Any:
    return Field(description=description, min_length=2, max_length=MAX_KNOTS, strict=False)


class Unexplained(Section):
    """A torque, force or rate of unknown origin, as a function of one signal."""

    derived = (
        ("unexplained_balance", np.int64),
        ("unexplained_signal", np.int64),
        ("unexplained_count", np.int64),
        ("unexplained_knots", np.float64, (MAX_KNOTS,)),
        ("unexplained_values", np.float64, (MAX_KNOTS,)),
    )

    balance: Literal["engine", "propeller", "hull", "pitch-actuator"] = Field(
        description="where it is added: drive torque (of a motor too), propeller torque, force on "
        "the ship, rate of P/D; positive drives ahead or raises"
    )
    signal: Literal["shaft_speed", "ship_speed", "pitch_ratio", "drive", "time"] = Field(
        description="what it follows; drive is what reaches the prime mover"
    )
    knots: tuple[_Knot, ...] = _knots(
        "rising values of the signal [SI; fuel rack in mm], 2 to 12 of them"
    )
    values: tuple[_Knot, ...] = _knots(
        "one for each knot [N m | N | 1/s]; linear between, held outside"
    )

    @model_validator(mode="after")
    def _matched(self) -> Unexplained:
        if len(self.knots) != len(self.values):
            raise ValueError(
                f"knots and values must be as many; they are {len(self.knots)} and "
                f"{len(self.values)}"
            )
        if any(b <= a for a, b in zip(self.knots, self.knots[1:], strict=False)):
            raise ValueError("knots must rise")
        return self

    def fill(self, record: Any) -> None:
        """Where it acts, what it follows, and its knots."""
        record["unexplained_balance"] = 1 + BALANCES.index(self.balance)
        record["unexplained_signal"] = FOLLOWED.index(self.signal)
        record["unexplained_count"] = len(self.knots)
        record["unexplained_knots"][: len(self.knots)] = self.knots
        record["unexplained_values"][: len(self.values)] = self.values


@compiled
def unexplained(
    plant: Record,
    shaft_speed: Real,
    ship_speed: Real,
    pitch_ratio: Real,
    drive: Real,
    time: Real,
) -> Real:
    """What the ship's balance lacks [N m | N | 1/s] at the present value of its signal.

    Args:
        plant: ship record.
        shaft_speed: omega [rad/s].
        ship_speed: v_s over ground [m/s].
        pitch_ratio: P/D of the blades [-].
        drive: fuel rack [mm], voltage [V] or torque [N m].
        time: since the start [s].
    """
    if plant.unexplained_signal == 0:
        x = shaft_speed
    elif plant.unexplained_signal == 1:
        x = ship_speed
    elif plant.unexplained_signal == 2:
        x = pitch_ratio
    elif plant.unexplained_signal == 3:
        x = drive
    else:
        x = time
    return piecewise_linear(
        plant.unexplained_knots, plant.unexplained_values, plant.unexplained_count, x
    )
