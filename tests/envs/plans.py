"""What is done to an environment."""

from __future__ import annotations

from typing import Any

import numpy as np

SHORT: dict[str, Any] = {"episode_s": 4.0}


def actions(steps: int, n: int = 1, seed: int = 0) -> np.ndarray[Any, Any]:
    # ahead of the stall, so that episodes last
    raw = np.random.default_rng(seed).uniform(-0.2, 0.6, (steps, n, 2))
    return raw.astype(np.float32)
