"""Recordings with the measured pitch, but without its command."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch import Options, diagnose, identify
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.recordings.measured_pitch import (
    MEASURED_PITCH,
    follow_measured_pitch,
    restore_pitch_actuator,
)
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import Ship
from shaftline.plant.recording import RecordingError

from ..voyages import frigate_voyage, quick_frigate

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
FOULED, SLOW_AND_OFF = (
    {"hull.fouling_fraction": 0.15},
    {"pitch_actuator.time_constant_s": 3.0, "pitch_actuator.offset": 0.03},
)


def feedback_alone(values: dict[str, float], seconds: float = 300.0) -> pd.DataFrame:
    voyage = frigate_voyage(quick_frigate().with_values(values), seed=5, seconds=seconds)
    return voyage.drop(columns="pitch_ratio_command")


def test_fouling_is_found_without_a_pitch_command() -> None:
    found = diagnose(quick_frigate(), feedback_alone(FOULED), options=Options(quick=True))
    (finding,) = found.findings
    assert finding.effect.id == "hull-fouling"
    assert finding.estimates[0].value == pytest.approx(0.15, abs=0.005)
    assert found.ship.pitch_actuator == quick_frigate().pitch_actuator
    assert found.corrected.pitch_actuator == quick_frigate().pitch_actuator
    assert found.corrected.tolerances == quick_frigate().tolerances
    assert MEASURED_PITCH in found.warnings


def test_a_slow_actuator_with_an_offset_is_no_missing_physics() -> None:
    found = diagnose(quick_frigate(), feedback_alone(SLOW_AND_OFF), options=Options(quick=True))
    assert found.verdict == "nothing-missing"


def test_parameters_are_identified_without_a_pitch_command() -> None:
    table = feedback_alone(SLOW_AND_OFF)
    found = identify(quick_frigate(), table, free=[RESISTANCE])
    (estimate,) = found.estimates
    assert estimate.ci95[0] < quick_frigate().parameter(RESISTANCE).value < estimate.ci95[1]
    assert found.identified.pitch_actuator == quick_frigate().pitch_actuator


def test_the_actuator_itself_cannot_be_estimated() -> None:
    key = "pitch_actuator.time_constant_s"
    with pytest.raises(ValueError, match=f"{key} cannot be estimated: .* record the command"):
        identify(quick_frigate(), feedback_alone({}), free=[key])
    with pytest.raises(ValueError, match=f"{key} cannot be estimated: .* record the command"):
        diagnose(quick_frigate(), feedback_alone({}), options=Options(free=(key,)))


def test_recordings_with_and_without_a_command_do_not_go_together() -> None:
    complete = frigate_voyage(quick_frigate(), seed=6, seconds=100.0)
    with pytest.raises(RecordingError, match=r"table 2 has a pitch_ratio_command, table 1 has"):
        load_jointly(quick_frigate(), [feedback_alone({}, 100.0), complete])


def test_check_accepts_a_feedback_alone_and_its_draft_needs_no_command(
    tmp_path: Path, frigate: Ship
) -> None:
    table = feedback_alone({}, 100.0)
    table.to_csv(tmp_path / "log.csv", index=False)
    found = survey(tmp_path / "log.csv", frigate)
    understood = {row["in the file"]: row["understood as"] for row in found.table()}
    assert understood["pitch_ratio"] == "pitch_ratio_command"
    assert not {"pitch_ratio", "pitch_ratio_command"} & set(found.absent)
    assert not found.remarks
    table.rename(columns={"pitch_ratio": "propeller pitch P/D"}).to_csv(
        tmp_path / "own.csv", index=False
    )
    draft = "\n".join(survey(tmp_path / "own.csv", frigate).sentences())
    assert '"propeller pitch P/D" = { column = "pitch_ratio"' in draft
    assert "still missing" not in draft


def test_the_actuator_follows_within_a_quarter_of_a_row_and_is_restored(frigate: Ship) -> None:
    key = "pitch_actuator.time_constant_s"
    numbers = {key: 0.3, RESISTANCE: 30.0}
    file = frigate.with_values(
        {
            "pitch_actuator.rate_limit_per_s": 0.02,
            "tolerances.numbers": numbers,
            "tolerances.correlations": {RESISTANCE: {key: 0.5}},
        }
    )
    following = follow_measured_pitch(file, 1.0)
    assert following.pitch_actuator.time_constant_s == 0.25
    assert following.pitch_actuator.rate_limit_per_s == float("inf")
    assert following.tolerances.numbers == {RESISTANCE: 30.0}
    assert following.tolerances.correlations == {}
    assert following.tolerances.pitch_time_constant == 0.0
    found = following.with_values({"pitch_actuator.offset": 0.01})
    restored = restore_pitch_actuator(found, file)
    assert restored.pitch_actuator == file.pitch_actuator.model_copy(update={"offset": 0.01})
    assert restored.tolerances == file.tolerances
    calibrated = following.with_values({"tolerances.numbers": {RESISTANCE: 3.0}})
    restored = restore_pitch_actuator(calibrated, file)
    assert restored.tolerances.numbers == {key: 0.3, RESISTANCE: 3.0}
    assert restored.tolerances.correlations == {}
    assert restored.tolerances.pitch_time_constant == file.tolerances.pitch_time_constant
