"""User-defined rival for a challenge: a linear model of the residual over the commands and their lags.

    shaftline challenge make --seed 112 --cases 4 --out out/challenge
    shaftline challenge run out/challenge examples.challenge_rival:LaggedResidual --out out/own.json
    shaftline challenge score out/challenge out/own.json --out out/scores

It names no physics, so its entries have no verdict and it is scored by its predictions only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

LAGS_S = (0.1, 5.0, 30.0)
"""Time constants of the low-pass filters on the inputs [s]."""


class LaggedResidual:
    """Predict measurement minus simulation from inputs after low-pass filters, by least squares."""

    def analyse(self, case: Any) -> dict[str, Any]:
        """Return the predictions of a case's held-out part."""
        inputs = pd.concat([case.recording[case.inputs.columns], case.inputs], ignore_index=True)
        period = inputs["time_s"].diff().median()
        moving = inputs.drop(columns="time_s")
        lagged = [moving.ewm(alpha=1.0 - np.exp(-period / lag)).mean() for lag in LAGS_S]
        features = np.column_stack([np.ones(len(inputs)), *lagged])
        count = len(case.recording)
        predictions = {}
        for channel in case.channels:
            simulated = case.simulation[channel].to_numpy()
            residual = case.recording[channel].to_numpy() - simulated[:count]
            weights = np.linalg.lstsq(features[:count], residual, rcond=None)[0]
            predictions[channel] = simulated[count:] + features[count:] @ weights
        return {"predictions": predictions}
