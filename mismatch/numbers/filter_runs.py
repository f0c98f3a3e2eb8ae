"""The augmented filter over one recording after the other, as it is told beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...observers.ship_filter import Followed, ShipFilter
from ...plant.derivatives import acting
from ..simulate.joint_replay import JointReplay


class Noises(NamedTuple):
    """What the filter is told beforehand."""

    readings: dict[str, float]  # rms by column
    states: dict[str, float]  # at the start, by name
    numbers: dict[str, float]  # at the start, by key
    state_walk: dict[str, float]  # [unit/s^0.5]
    number_walk: Mapping[str, float]


class FilterRuns:
    """Filters over the recordings."""

    def __init__(self, replay: JointReplay, keys: tuple[str, ...], noises: Noises) -> None:
        self.replay, self.keys, self.noises = replay, keys, noises
        self.start = np.array([acting(replay.ship, key).value for key in keys])

    def filter(self, state_walk: Mapping[str, float], record: Any = None) -> ShipFilter:
        """One that has seen nothing."""
        noises = self.noises
        return ShipFilter(
            self.replay.ship, self.keys, number_spread=noises.numbers, noise=noises.readings,
            state_spread=noises.states, state_walk=state_walk, number_walk=noises.number_walk,
            record=record,
        )  # fmt: skip

    def passed(
        self, values: NDArray[np.float64], record: Any = None
    ) -> tuple[list[Followed], ShipFilter]:
        """All recordings once, from these numbers on."""
        own = self.filter(self.noises.state_walk, record)
        own.restart(values)
        return [own.follow(run) for run in self.replay.runs], own
