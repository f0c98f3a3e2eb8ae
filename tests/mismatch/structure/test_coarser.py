"""Recordings of fewer rows for the search."""

from __future__ import annotations

import numpy as np

from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.noise_model import coarser

from .rigs import motor, run

SPEED = "shaft_speed_rad_s"


def test_the_averages_stay_and_the_simulation_is_as_close() -> None:
    tables = [run(seed=seed) for seed in (1, 2)]
    fine = JointReplay(motor(), *tables, every=10)
    coarse = coarser(fine, 100)
    assert coarse.every == 5  # two recorded rows in one
    assert coarse.runs[0].rows == fine.runs[0].rows // 2
    assert coarse.segments == fine.segments
    np.testing.assert_allclose(coarse.recorded[SPEED], fine.recorded[SPEED], rtol=1e-12)
    record = motor().record()
    difference = coarse.simulate_channels(record)[SPEED] - fine.simulate_channels(record)[SPEED]
    # a step of the command becomes a ramp over two rows
    assert np.sqrt(np.mean(difference**2)) < 0.04 * np.std(fine.recorded[SPEED])


def test_recordings_of_few_rows_or_of_rows_that_all_count_stay() -> None:
    fine = JointReplay(motor(), run(seed=1), every=10)
    assert coarser(fine, 900) is fine
    slow = JointReplay(motor(), run(seed=1), every=3)
    assert coarser(slow, 100) is slow
