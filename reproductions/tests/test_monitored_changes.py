"""Monitored ships with concealed changes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from reproductions.monitored_changes import CHANGES, KEYS, cells_of, record, summarise
from shaftline.plant import load_ship
from shaftline.validation.cases import draw_case


def test_each_change_is_drawn_within_its_sizes_and_has_a_key_of_the_ship() -> None:
    cells = cells_of(1, 12)
    assert {cell.key for cell in cells} == set(CHANGES)
    assert cells == cells_of(1, 12)
    for cell in cells:
        _, low, high = CHANGES[cell.key]
        assert low <= cell.size <= high
    for key in KEYS:
        load_ship("frigate").parameter(key)


def test_the_change_slows_the_ship_and_the_recordings_differ() -> None:
    cell = cells_of(1, 1)[0]
    case = draw_case(cell.seed, cell.number, keys=(cell.key,))
    before, other, after = record(case, 0, 0.0), record(case, 1, 0.0), record(case, 0, 0.3)
    same = ["time_s", "fuel_rack_mm", "pitch_ratio_command"]
    assert cell.key == "hull-fouling/hull"
    assert np.allclose(before[same], after[same])
    assert not np.allclose(before["fuel_rack_mm"], other["fuel_rack_mm"])
    assert after["ship_speed_m_s"].mean() < 0.98 * before["ship_speed_m_s"].mean()


def test_the_summary_counts_alarms_by_the_size_over_the_detection_limit() -> None:
    table = pd.DataFrame(
        {
            "true": [0.2, 1.5, 1.6, 3.0],
            "found": [0.3, 1.5, 2.6, 3.1],
            "half_95": 0.2,
            "detection_limit": 1.0,
            "alarm": [False, True, False, True],
            "other alarms": [0, 0, 1, 0],
        }
    )
    found = summarise(table).set_index("size over detection limit")
    assert found["ships"].tolist() == [1, 0, 2, 1]
    assert found.loc["1 to 2", "alarm of this parameter"].startswith("0.50 (")
    assert found.loc["1 to 2", "alarm of another"].startswith("0.50 (")
    assert found.loc["1 to 2", "95 % interval holds"].startswith("0.50 (")
    assert found.loc["0.5 to 1", "alarm of this parameter"] == "–"
    assert found.loc["> 2", "alarm of this parameter"].startswith("1.00 (")
