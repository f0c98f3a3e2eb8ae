"""Adaptive noise: simulated recordings, the filters that are compared, and the table."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from reproductions import adaptive_noise
from reproductions.adaptive_noise import (
    BOUND,
    CASES,
    FILTERS,
    GIVEN_ADAPTIVE,
    INFLOW_M_S,
    TORQUE,
    TRUE_SHARES,
    Case,
    Kind,
    draw_inflow,
    evaluate,
    filters_of,
    follow,
    follow_random_walk,
    load,
    simulate,
    summarise,
)


@pytest.mark.parametrize("waves", [False, True])
def test_the_inflow_has_its_strength(waves: bool) -> None:
    u = draw_inflow(waves, 60_000, np.random.default_rng(1))
    assert u.std() == pytest.approx(INFLOW_M_S, rel=0.06)
    after = np.corrcoef(u[:-1], u[1:])[0, 1]
    # the filter's process, or waves, which are smooth
    assert after == pytest.approx(
        1.0 if waves else math.exp(-0.1 / 3.0), abs=0.01 if waves else 0.005
    )


def test_noise_and_inflow_change_in_the_middle() -> None:
    before = simulate(Kind("ferry", waves=True), 4)
    run = simulate(Kind("ferry", waves=True, noise=4.0, sea=3.0, only=TORQUE), 4)
    half = len(run.table) // 2
    assert run.inflow[half:].std() == pytest.approx(3.0 * before.inflow[half:].std(), rel=0.01)
    np.testing.assert_allclose(run.inflow[:half], before.inflow[:half], atol=0.01)
    second = np.diff(run.table[TORQUE], 3) / math.sqrt(20.0) / run.noise[TORQUE]
    assert second[half:].std() / second[: half - 5].std() == pytest.approx(4.0, rel=0.15)
    file = [load("ferry").parameter(key).value for key in TRUE_SHARES]
    np.testing.assert_allclose(run.truth / file, [*TRUE_SHARES.values()])


def test_cases_of_a_kind_share_a_recording_and_the_bound_knows_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(adaptive_noise, "SECONDS", 90.0)
    kind = Kind(noise=4.0)
    cases = [Case("a", kind, noise=0.1), Case("b", kind, walk=10.0)]
    run = simulate(kind, 2)
    rows = []
    for case, name, filters in filters_of(run, cases):
        found = follow(filters, run)
        rows.append(evaluate(case, run, name, found, filters[-1].columns))
        if name == BOUND:
            first, last = found.noise[0], found.noise[-1]
            np.testing.assert_allclose(first, [*run.noise.values()])
            np.testing.assert_allclose(last, 4.0 * first)
        if name == GIVEN_ADAPTIVE:
            place = [*filters[0].columns].index(TORQUE)
            assert found.noise[0, place] == pytest.approx(case.noise * run.noise[TORQUE], rel=0.1)
    table = pd.DataFrame(rows)
    assert table["filter"].tolist() == [*FILTERS] * 2
    bound = table[table["filter"] == BOUND]
    assert bound["torque noise"].tolist() == [1.0, 1.0]
    assert bound["NIS"].between(0.85, 1.25).all()
    summary = summarise(table).set_index(["case", "filter"])
    assert summary.loc[("a", BOUND), "torque noise"] == "1.00"
    assert len(summary) == 2 * len(FILTERS)


def test_every_case_has_a_name_of_its_own() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    assert len(set(CASES)) == len(CASES)


@pytest.mark.parametrize(("noise", "process"), [(1.0, 1.0), (100.0, 0.01), (0.1, 1.0)])
def test_the_noises_of_a_random_walk_are_found(noise: float, process: float) -> None:
    found = follow_random_walk(False, noise, process, seed=5)
    assert found["R"] == pytest.approx(1.0, rel=0.15)
    assert found["Q"] == pytest.approx(1.0, rel=0.15)
    assert found["NIS"] == pytest.approx(1.0, abs=0.05)
    assert found["states in 95 %"] == pytest.approx(0.95, abs=0.015)


def test_covariance_matching_accepts_wrong_noises() -> None:
    """The variance of the innovations is right, the states are not."""
    found = follow_random_walk(True, 0.01, 1.0, seed=5)
    assert found["NIS"] == pytest.approx(1.0, abs=0.05)
    assert found["R"] < 0.02
    assert found["states in 95 %"] < 0.3
