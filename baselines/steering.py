"""Whole controllers of a ship that is steered: one for the propulsion, and a helmsman."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .controller import OBSERVED, Controller, encode_all, readings, resumed
from .helmsman import STEERED, Course, ShapedHelmsman

OBSERVED_STEERED = (*OBSERVED, *STEERED)
"""Signals of an observation of the steering environment, in order."""


def course(observation: Any) -> Course:
    """What a helmsman sees of observations of shape (14,) or (n, 14)."""
    table = np.atleast_2d(np.asarray(observation, dtype=np.float64))
    speed = table[:, OBSERVED.index("measured_ship_speed")]
    ahead = dict(zip(STEERED, table[:, len(OBSERVED) : len(OBSERVED_STEERED)].T, strict=True))
    return Course(
        ahead["heading_order"], ahead["heading"], ahead["yaw_rate"], ahead["rudder_angle"],
        ahead["cross_track_order"], ahead["cross_track"], speed,
    )  # fmt: skip


class SteeringController:
    """Answers observations of ``shaftline/Steering-v0`` with actions, as stable-baselines3's models do.

    Args:
        propulsion: who sets pitch and rack.
        helmsman: who lays the rudder of the same ship, at the same interval.

    Raises:
        ValueError: ships or intervals differ.
    """

    def __init__(self, propulsion: Controller, helmsman: ShapedHelmsman) -> None:
        if propulsion.ship != helmsman.ship or propulsion.interval_s != helmsman.interval_s:
            raise ValueError(
                f"propulsion is made for {propulsion.ship.name} every {propulsion.interval_s:g} s, the "
                f"helmsman for {helmsman.ship.name} every {helmsman.interval_s:g} s"
            )
        self.propulsion, self.helmsman = propulsion, helmsman

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Actions for one observation or a batch.

        Args:
            observation: shape (14,) or (n, 14), the signals of the steering environment.
            state: what the last call returned, None at first; it stays untouched.
            episode_start: shape (n,), true where an episode begins and the memory must be forgotten.
            deterministic: without effect: a classic controller draws no noise.

        Returns:
            Action(s) in [-1, 1], shape (3,) or (n, 3): pitch, fuel rack and rudder command, each over
            the ship's range; and the state to pass to the next call.
        """
        seen, ahead = readings(np.atleast_2d(observation)[:, : len(OBSERVED)]), course(observation)
        of_drive, of_helm = (None, None) if state is None else state
        drive = resumed(of_drive, self.propulsion.fresh(seen), episode_start)
        helm = resumed(of_helm, self.helmsman.fresh(ahead), episode_start)
        pitch, rack = self.propulsion.act(seen, drive)
        rudder = self.helmsman.rudder(ahead, helm)
        plant = self.propulsion.plant
        table = np.column_stack(
            [
                encode_all(pitch, plant["pitch_ratio_min"], plant["pitch_ratio_max"]),
                encode_all(rack, plant["drive_min"], plant["drive_max"]),
                encode_all(rudder, -self.helmsman.most, self.helmsman.most),
            ]
        )
        return table if np.ndim(observation) > 1 else table[0], (drive, helm)
