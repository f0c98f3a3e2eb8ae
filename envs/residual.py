"""Action mode ``residual``: an action is added to the commands of a classic base controller.

This is residual policy learning (Silver et al. 2018; Johannink et al. 2019). An action of 1 adds
:data:`REACH` of the range of a command to the command of the base controller:

    command = base command + REACH (highest - lowest) action

so a zero action leaves the commands of the base controller unchanged.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED, PREVIEW, Predictor
from ..baselines.steering import OBSERVED_STEERED
from ..plant import Ship
from .records import BASE_COMMANDS, OBSERVATION

REACH = 0.25  # share of the range of a command that an action of 1 adds [-]
_NAMES: tuple[str, ...] = OBSERVATION.names or ()
_FIRST_BASE_COMMAND = _NAMES.index(BASE_COMMANDS[0])


class BaseController:
    """Classic controller that computes the base commands of a batch of n environments.

    With ``preview`` it receives the signals :data:`PREVIEW` of the waves ahead.
    """

    def __init__(
        self, controller: Predictor, ship: Ship, n: int, steered: bool, preview: bool = False
    ) -> None:
        self._controller = controller
        names = OBSERVED_STEERED if steered else (*OBSERVED, *(PREVIEW if preview else ()))
        self._inputs = np.array([_NAMES.index(name) for name in names])
        self._memory: Any = None
        self._action = np.zeros((n, 3 if steered else 2), np.float32)
        plant = ship.record()
        low = [plant["pitch_ratio_min"], plant["drive_min"], -plant["rudder_max"]]
        high = [plant["pitch_ratio_max"], plant["drive_max"], plant["rudder_max"]]
        columns = slice(self._action.shape[1])
        self._low, self._span = np.array(low)[columns], np.subtract(high, low)[columns]

    def begin(self, signals: NDArray[np.float32], which: NDArray[np.int64]) -> None:
        """Compute the first base commands of environments and write them into the signals, (n, k)."""
        seen = signals[which[:, None], self._inputs]
        self._action[which], memory = self._controller.predict(
            seen, None, np.ones(len(which), dtype=bool)
        )
        if self._memory is None:
            self._memory = _zeros(memory, len(self._action))
        _assign(self._memory, which, memory)
        self._show(signals)

    def follow(self, signals: NDArray[np.float32]) -> None:
        """Compute the base commands of all environments after a control interval."""
        seen = signals[:, self._inputs]
        self._action[:], self._memory = self._controller.predict(
            seen, self._memory, np.zeros(len(seen), dtype=bool)
        )
        self._show(signals)

    def add(self, action: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the base commands with an action added, as absolute actions in [-1, 1]."""
        return np.clip(self._action + 2.0 * REACH * action, -1.0, 1.0).astype(np.float32)

    def towards(self, wanted: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions for which :meth:`add` returns absolute actions, clipped to [-1, 1]."""
        reached = (wanted - self._action) / (2.0 * REACH)
        return np.asarray(np.clip(reached, -1.0, 1.0), dtype=np.float32)

    def _show(self, signals: NDArray[np.float32]) -> None:
        """Write the base commands in physical units into the signals."""
        columns = slice(_FIRST_BASE_COMMAND, _FIRST_BASE_COMMAND + self._action.shape[1])
        signals[:, columns] = self._low + 0.5 * (self._action + 1.0) * self._span


def _zeros(tree: Any, n: int) -> Any:
    """Return zeros in the form of a controller memory, for n environments."""
    if isinstance(tree, tuple):
        return tuple(_zeros(part, n) for part in tree)
    return np.zeros((n, *np.shape(tree)[1:]), np.asarray(tree).dtype)


def _assign(tree: Any, which: NDArray[np.int64], values: Any) -> None:
    """Write rows of a controller memory, in place."""
    if isinstance(tree, tuple):
        for part, new in zip(tree, values, strict=True):
            _assign(part, which, new)
    else:
        tree[which] = values
