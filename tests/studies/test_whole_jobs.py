"""The recording that the timed diagnosis reads, and that a command which fails is no time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shaftline.mismatch import load_recording
from shaftline.plant import load_ship
from shaftline.studies import whole_jobs


def test_recording_is_twenty_minutes_of_a_ship_that_moves(tmp_path: Path) -> None:
    file = tmp_path / "recording.csv"
    whole_jobs.fouled_recording(file)
    recording = load_recording(file, load_ship("frigate"))
    assert len(recording) == 12_001
    assert recording.interval_s == pytest.approx(0.1)
    assert recording.limits == ()
    assert recording["shaft_speed_rad_s"].std() > 0.5


def test_a_command_that_fails_has_no_time() -> None:
    with pytest.raises(subprocess.CalledProcessError):
        whole_jobs.timed((sys.executable, "-c", "raise SystemExit(3)"))
    assert 0.0 < whole_jobs.timed((sys.executable, "-c", "pass"), 3) < 10.0
