from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from shaftline.core.lanes import LANES
from shaftline.envs import FrigateEnv, FrigateVectorEnv
from shaftline.envs.batch import _divide
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


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_the_first_of_several_is_named_and_the_others_end_the_interval(threads: int) -> None:
    env = FrigateVectorEnv(96, task="transit", threads=threads)
    env.reset(seed=1)
    env.batch.arrays.states["charge"][[90, 41, 70]] = np.nan
    with pytest.raises(ValueError, match="environment 41 diverges"):
        env.step(np.zeros((96, 2), np.float32))
    assert env.batch.elapsed.tolist() == [1] * 96


@pytest.mark.parametrize("fails", [0, 16, 48])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_no_thread_works_on_after_an_error(fails: int, error: type[BaseException]) -> None:
    begun, ended = [], []

    def work(first: int, last: int) -> int:
        begun.append(first)
        if first == fails:
            raise error
        time.sleep(0.02)
        ended.append(first)
        return last

    with ThreadPoolExecutor(2) as pool:
        with pytest.raises(error):
            _divide(work, 64, pool, 4)
        assert sorted(begun) == [0, 16, 32, 48]
        assert sorted(ended) == sorted({0, 16, 32, 48} - {fails})


def test_parts_have_whole_groups_of_ships_in_order() -> None:
    with ThreadPoolExecutor(2) as pool:
        for count in range(1, 70):
            for parts in range(1, 7):
                found = _divide(lambda *part: part, count, pool, min(parts, count))
                assert [a for a, _ in found][1:] == [b for _, b in found][:-1]
                assert (found[0][0], found[-1][1]) == (0, count)
                assert all(first % LANES == 0 for first, _ in found)
