"""Instruments that fail: what the faults do, and how their diagnoses are counted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from reproductions.faulty_instruments import FAULTS, SOUND, outcome_table


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_changes_as_many_rows_as_it_says(fault: str) -> None:
    values = np.arange(1.0, 100_001.0)
    broken = FAULTS[fault](values, np.random.default_rng(0))
    changed = broken != values
    shares = {
        SOUND: 0.0,
        "stops for a tenth": 0.1,
        "stops for half": 0.5,
        "drops to 0 in 0.2 % of the rows": 0.002,
        "drops to 0 in 2 %": 0.02,
        "shows twice as much in 2 %": 0.02,
        "cut off above its 85th percentile": 0.15,
    }
    assert changed.mean() == pytest.approx(shares[fault], rel=0.25)
    if "stops" in fault:
        assert len({*broken[changed]}) == 1
        assert np.ptp(np.flatnonzero(changed)) == changed.sum() - 1
    if "drops" in fault:
        assert not broken[changed].any()
    if "twice" in fault:
        assert (broken[changed] == 2.0 * values[changed]).all()
    if "cut off" in fault:
        assert broken.max() == pytest.approx(85_000.0, rel=1e-3)


def test_physics_beside_the_right_one_is_a_wrong_name() -> None:
    fault = "drops to 0 in 2 %"
    told = [
        ("single", "refused", "shaft_speed_rad_s is constant"),
        ("single", "nothing-missing", ""),
        ("single", "named", "viscous-friction"),
        ("single", "class", "coulomb-friction"),
        ("single", "named", "viscous-friction + current"),
        ("single", "family", "current"),
        ("single", "unexplained", ""),
        ("null-calm", "false alarm", "current"),
    ]
    rows = pd.DataFrame(told, columns=["kind", "outcome", "said"]).assign(fault=fault)
    table = outcome_table(rows).set_index(["one channel", "missing"]).loc[fault]
    assert [*table.loc["one effect"]] == [7, 1, 1, 2, 1, 2]
    assert [*table.loc["nothing"]] == [1, 0, 0, 0, 0, 1]
