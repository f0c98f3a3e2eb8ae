"""What `check` says of a recording before anything is diagnosed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Options
from shaftline.mismatch.example import COLUMN_MAP, FOLDER, RECORDING
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.recordings.load import EXTRA_SIGNALS
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import Ship, load_ship, ship_names
from shaftline.plant.columns import signal_columns
from shaftline.plant.load_cases import get_case
from shaftline.plant.terms import TURNING_SIGNALS


def test_a_good_recording_is_told_in_full(frigate: Ship) -> None:
    found = survey(FOLDER / RECORDING, frigate, FOLDER / COLUMN_MAP)
    assert found.recording is not None
    by_column = {row["understood as"]: row for row in found.table()}
    assert by_column["shaft_speed_rad_s"]["in the file"] == "Shaft speed"
    assert float(by_column["shaft_speed_rad_s"]["to"]) == pytest.approx(79.35 * 0.10472, rel=1e-3)
    assert float(by_column["pitch_ratio_command"]["to"]) == pytest.approx(0.793 * 1.4, rel=1e-3)
    assert by_column["ship_speed_m_s"]["missing"] == 2
    said = list(found.sentences())
    assert said[0] == "1401 rows over 700 s, one every 0.5 s"
    assert "separator semicolon, decimal comma, names in line 3, units in line 4" in said[1]
    assert set(found.absent) == {"thrust_N"}


def test_a_map_to_begin_with_is_right_on_the_example(frigate: Ship, tmp_path: Path) -> None:
    found = survey(FOLDER / RECORDING, frigate)
    assert found.recording is None
    said = list(found.sentences())
    assert any(s.startswith("refused: column 'time_s' is missing") for s in said)
    (tmp_path / "map.toml").write_text("\n".join(said[said.index("[columns]") :]))
    guessed = survey(FOLDER / RECORDING, frigate, tmp_path / "map.toml").recording
    mapped = survey(FOLDER / RECORDING, frigate, FOLDER / COLUMN_MAP).recording
    assert guessed is not None
    assert mapped is not None
    pd.testing.assert_frame_equal(guessed.table, mapped.table)


def test_what_is_missing_is_named_with_its_cost(calm: pd.DataFrame, tmp_path: Path) -> None:
    bare = calm.drop(columns=["shaft_torque_N_m", "ship_speed_m_s"]).assign(weather=1.0)
    bare.to_csv(tmp_path / "r.csv", index=False)
    said = list(survey(tmp_path / "r.csv", load_ship("frigate")).sentences())
    assert "left out, neither canonical nor in the column map: weather" in said
    assert any(s.startswith("without shaft_torque_N_m: losses of the drive and") for s in said)
    assert any(s.startswith("without ship_speed_m_s: effects on the hull") for s in said)
    assert said[-1].startswith("usable")


def test_a_remark_on_several_parts_names_them_once(calm: pd.DataFrame, tmp_path: Path) -> None:
    coarse = calm.assign(ship_speed_m_s=(calm["ship_speed_m_s"] / 0.05).round() * 0.05)
    rows = coarse.index.to_series()
    coarse[~rows.between(600, 700) & ~rows.between(1200, 1300)].to_csv(
        tmp_path / "r.csv", index=False
    )
    found = survey(tmp_path / "r.csv", load_ship("frigate"))
    quantised = [remark for remark in found.remarks if "ship_speed_m_s is quantised" in remark]
    assert len(quantised) == 1
    assert quantised[0].startswith(
        "parts 1, 2, 3 alike, with the values of part 1: ship_speed_m_s is"
    )
    coarse.loc[600:, "ship_speed_m_s"] = calm["ship_speed_m_s"]
    coarse[~rows.between(600, 700)].to_csv(tmp_path / "r.csv", index=False)
    found = survey(tmp_path / "r.csv", load_ship("frigate"))
    assert next(remark for remark in found.remarks if "is quantised" in remark).startswith(
        "part 1: "
    )


@pytest.mark.parametrize("name", ship_names())
def test_check_leaves_out_no_column_that_a_diagnosis_uses(name: str, tmp_path: Path) -> None:
    """Every column that any ship may record, on every packaged ship, turning or not."""
    ship, file = load_ship(name), tmp_path / "r.csv"
    samples = get_case("rack_step").run(ship, seed=0)
    samples = samples[:: max(1, len(samples) // 4000)]
    table = pd.DataFrame({c: samples[s] for c, s in signal_columns(ship).items()})
    drift = 0.1 * np.sin(0.05 * table["time_s"])
    turn = {column: drift for column in TURNING_SIGNALS.values() if column not in table}
    outside = {signal: drift for signal in EXTRA_SIGNALS if signal not in TURNING_SIGNALS}
    table.assign(**turn, **outside, weather=1.0).to_csv(file, index=False)
    found = survey(file, ship)
    assert found.recording is not None, found.refused
    left = next(s for s in found.sentences() if s.startswith("left out")).partition(": ")[2]
    used = {*load_jointly(ship, [file], signals=Options().signals).tables[0]}
    heard = {column for signal, column in TURNING_SIGNALS.items() if signal in used}
    assert not {*left.split(", ")} & (used | heard)
    assert "weather" in left.split(", ")
