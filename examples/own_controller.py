"""A controller of one's own beside the package's, without a line of the package changed.

    shaftline evaluate --task acceleration --controller combinator \
        --controller examples.own_controller:Steady --out out/own

Where a controller stands in an installed package, an entry point in the group `shaftline.controllers`
gives it a name.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftline.baselines import Combinator, Controller, Readings


class Steady(Controller):
    """The combinator's set-points through a filter: the pitch answers no order faster than it must.

    Args:
        ship: a ship with a diesel, or its name.
        interval_s: control interval [s].
        lag_s: time constant of the order's filter [s].
    """

    name = "steady"
    source = "an example"

    def __init__(self, ship: Any = "frigate", interval_s: float = 0.5, lag_s: float = 20.0) -> None:
        super().__init__(ship, interval_s)
        if not lag_s > 0.0:
            raise ValueError(f"lag_s = {lag_s:g} s: must be above 0")
        self.inner = Combinator(self.ship, interval_s)
        self.keep = float(np.exp(-interval_s / lag_s))

    def fresh(self, seen: Readings) -> NDArray[Any]:
        """The filtered order, then the combinator's own memory."""
        inner = self.inner.fresh(seen).reshape(len(seen.speed_order), -1)
        return np.column_stack([seen.speed_order, inner])

    def act(
        self, seen: Readings, memory: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch and rack for the filtered order."""
        memory[:, 0] = self.keep * memory[:, 0] + (1.0 - self.keep) * seen.speed_order
        own = memory[:, 1:].reshape(self.inner.fresh(seen).shape).copy()
        answer = self.inner.act(seen._replace(speed_order=memory[:, 0].copy()), own)
        memory[:, 1:] = own.reshape(len(memory), -1)
        return answer
