"""Actions of the tests of the environments."""

from __future__ import annotations

from typing import Any

import numpy as np

SHORT: dict[str, Any] = {"max_episode_steps": 8}


def actions(steps: int, n: int = 1, seed: int = 0) -> np.ndarray[Any, Any]:
    """Return random actions, shape (steps, n, 2), under which the engine of an episode keeps running."""
    raw = np.random.default_rng(seed).uniform(-0.2, 0.6, (steps, n, 2))
    return raw.astype(np.float32)
