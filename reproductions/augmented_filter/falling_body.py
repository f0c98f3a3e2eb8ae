"""A body that falls through air with unknown drag: Taylor 2000, appendix A; Gelb 1974, example 6.1-2.

The thesis prints figures without numbers. The numbers are those of Gelb's example as it is commonly
recomputed (Simon 2006, example 13.1; A. Ganse's page on Gelb's examples).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.observers import AugmentedFilter

SEA_LEVEL_DENSITY = 3.4e-3  # lb s2/ft4
SCALE_HEIGHT = 22e3  # ft
GRAVITY = 32.2  # ft/s2
TRUE_START = (1e5 + 100.0, -6000.0 + 350.0)  # ft, ft/s
ASSUMED_START = (1e5, -6000.0)
ASSUMED_BETA = 2500.0  # lb/ft2
START_VARIANCES = (500.0, 2e4, 2.5e5)
RANGE_VARIANCE = 100.0  # ft2
UPDATE_S = 0.1
SECONDS = 16.0


def rate(x: Any, theta: Any, u: Any) -> Any:
    """Return the rates of height [ft] and velocity [ft/s]; theta is beta [lb/ft2]."""
    drag = SEA_LEVEL_DENSITY * np.exp(-x[0] / SCALE_HEIGHT) * x[1] ** 2 / (2.0 * theta[0])
    return np.array([x[1], drag - GRAVITY])


def height(x: Any, theta: Any, u: Any) -> Any:
    """Return the height that the radar below the body measures [ft]."""
    return x[:1]


def simulate_fall(
    beta: float, seed: int, update_s: float = UPDATE_S, noise_ft: float = RANGE_VARIANCE**0.5
) -> pd.DataFrame:
    """Simulate a fall of a body with beta [lb/ft2], and run the filter on it.

    The filter assumes :data:`RANGE_VARIANCE` for any rms noise [ft]. Each update is a row:
    ``time_s``, true ``height_ft``, ``velocity_error_ft_s``, ``beta`` and ``beta_sd``.
    """
    rng = np.random.default_rng(seed)
    body = AugmentedFilter(
        rate, height, TRUE_START, [beta], covariance=np.zeros(3), noise=RANGE_VARIANCE
    )
    own = AugmentedFilter(
        rate,
        height,
        ASSUMED_START,
        [ASSUMED_BETA],
        covariance=START_VARIANCES,
        noise=RANGE_VARIANCE,
    )
    rows = []
    for k in range(1, round(SECONDS / update_s) + 1):
        body.predict(None, update_s)
        own.predict(None, update_s)
        own.update(body.z[0] + noise_ft * rng.standard_normal())
        rows.append(
            (
                k * update_s,
                body.z[0],
                own.z[1] - body.z[1],
                own.parameters[0],
                own.standard_errors[2],
            )
        )
    columns = ["time_s", "height_ft", "velocity_error_ft_s", "beta", "beta_sd"]
    return pd.DataFrame(rows, columns=columns)


LIMITS = {
    "velocity error from 2 s on [ft/s]": 5.0,
    "beta unchanged above 65 000 ft, within": 0.02,
    "beta at 12 s, within": 0.10,
    "beta from 14 s on, within": 0.05,
}
"""Limits that we derive from the description of the thesis's figure."""


def largest_errors(fall: pd.DataFrame, beta: float) -> NDArray[np.float64]:
    """Return the quantities of :data:`LIMITS` of one fall with a true beta [lb/ft2], shape (4,)."""
    time = fall["time_s"].to_numpy()
    off = np.abs(fall["beta"].to_numpy() / beta - 1.0)
    high = fall["beta"][fall["height_ft"] > 65e3] / ASSUMED_BETA
    speed = fall["velocity_error_ft_s"].abs()[time > 1.99].max()
    above = (high - 1.0).abs().max()
    return np.array([speed, above, off[np.argmax(time > 11.99)], off[time > 13.99].max()])
