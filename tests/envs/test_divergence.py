from __future__ import annotations

import numpy as np
import pytest

from shaftline.envs import FrigateEnv, FrigateVectorEnv
from shaftline.plant import load_ship

TERM = {
    "id": "runaway",
    "acts_on": "resistance",
    "expression": "u",
    "state": "u",
    "rate": "1 + u * 15",
}
SHIP = load_ship("frigate").with_values({"term": [TERM]})


def test_a_state_that_is_not_finite_is_not_passed_on() -> None:
    env = FrigateEnv(ship=SHIP, task="transit")
    env.reset(seed=1)
    env.batch.arrays.states[0]["term_1"] = 1e300
    with pytest.raises(ValueError, match="environment 0 diverges: its state is not finite"):
        env.step(np.zeros(2, np.float32))


def test_a_state_of_one_among_many_is_named() -> None:
    env = FrigateVectorEnv(num_envs=3, ship="frigate", task="transit")
    env.reset(seed=1)
    env.step(np.zeros((3, 2), np.float32))
    env.batch.arrays.states[1]["charge"] = np.nan
    with pytest.raises(ValueError, match="environment 1 diverges: its state is not finite"):
        env.step(np.zeros((3, 2), np.float32))
