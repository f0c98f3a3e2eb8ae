r"""User-defined controller, used by the package without changing its code.

    shaftline evaluate --task acceleration --controller combinator \
        --controller examples.own_controller:Steady --out out/own

In an installed package, an entry point in the group `shaftline.controllers` registers it under a name.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftline.baselines import Combinator, Controller, Measurements


class Steady(Controller):
    """Combinator with a low-pass filter on the ordered speed, so that it follows orders slowly.

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

    def initial_state(self, signals: Measurements) -> NDArray[Any]:
        """Return the filtered order and the memory of the combinator."""
        inner = self.inner.initial_state(signals).reshape(len(signals.speed_order), -1)
        return np.column_stack([signals.speed_order, inner])

    def act(
        self, signals: Measurements, memory: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the commands of pitch and rack for the filtered order."""
        memory[:, 0] = self.keep * memory[:, 0] + (1.0 - self.keep) * signals.speed_order
        own = memory[:, 1:].reshape(self.inner.initial_state(signals).shape).copy()
        commands = self.inner.act(signals._replace(speed_order=memory[:, 0].copy()), own)
        memory[:, 1:] = own.reshape(len(memory), -1)
        return commands
