"""Steering controllers: a controller of pitch and fuel rack combined with a helmsman."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .controller import (
    OBSERVED,
    Controller,
    Predictor,
    actions,
    encode_all,
    measurements_of,
    resume_state,
)
from .helmsman import STEERED, ShapedHelmsman, SteeringMeasurements

OBSERVED_STEERED = (*OBSERVED, *STEERED)  # signals of the steering environment, in order


def steering_measurements(observation: Any) -> SteeringMeasurements:
    """Return the measurements of a helmsman from observations of shape (14,) or (n, 14)."""
    table = np.atleast_2d(np.asarray(observation, dtype=np.float64))
    speed = table[:, OBSERVED.index("measured_ship_speed")]
    steered = table[:, len(OBSERVED) : len(OBSERVED_STEERED)]
    return SteeringMeasurements(*np.column_stack([steered, speed]).T)


class SteeringController(Predictor):
    """Compute pitch, fuel rack and rudder actions from observations of ``shaftline/Steering-v0``.

    Args:
        propulsion: controller of pitch and fuel rack.
        helmsman: helmsman of the same ship with the same interval.

    Raises:
        ValueError: the ships or the intervals differ.
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
        """Return actions and state as :meth:`Controller.predict`, with the rudder command.

        The observation has the shape (14,) or (n, 14), the actions (3,) or (n, 3).
        """
        signals = measurements_of(np.atleast_2d(observation)[:, : len(OBSERVED)])
        steering = steering_measurements(observation)
        of_drive, of_helm = (None, None) if state is None else state
        drive = resume_state(of_drive, self.propulsion.initial_state(signals), episode_start)
        helm = resume_state(of_helm, self.helmsman.initial_state(steering), episode_start)
        pitch, rack = self.propulsion.act(signals, drive)
        most = self.helmsman.rudder_max
        rudder = encode_all(self.helmsman.rudder(steering, helm), -most, most)
        table = np.column_stack([actions(self.propulsion.plant, pitch, rack), rudder])
        return table if np.ndim(observation) > 1 else table[0], (drive, helm)
