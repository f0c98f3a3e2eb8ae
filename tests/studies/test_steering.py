"""Taylor's two steering controllers: the numbers of his chapter 5, and the voyages."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from shaftline.studies import reproduce
from shaftline.studies.side_by_side import Row, reasons, table
from shaftline.studies.steering import results, voyages


def test_the_printed_numbers_of_the_autopilot() -> None:
    found = results.autopilot_loop()
    assert found["gain_margin_dB"] == pytest.approx(29.8, abs=0.05)
    assert found["phase_margin_deg"] == pytest.approx(64.4, abs=0.05)
    assert found["overshoot_percent"] == pytest.approx(4.81, abs=0.01)
    assert found["settling_lengths"] == pytest.approx(4.20, abs=0.01)
    assert found["gain_at_0.01_dB"] == pytest.approx(40.0, abs=0.01)
    assert found["controller_gain_at_noise_dB"] == pytest.approx(8.1, abs=0.05)
    assert found["plant_gain_at_noise_dB"] == pytest.approx(-33.1, abs=0.05)


def test_forty_per_cent_wrong_is_still_under_control() -> None:
    nine = results.robustness()
    assert len(nine) == 9
    assert nine["phase_margin_deg"].min() == pytest.approx(56.0, abs=0.5)
    assert nine["phase_margin_deg"].max() == pytest.approx(83.0, abs=0.5)
    assert nine["gain_margin_dB"].min() == pytest.approx(24.0, abs=0.5)
    assert nine["gain_margin_dB"].max() == pytest.approx(36.5, abs=0.5)


def test_a_track_change_in_the_carried_current() -> None:
    """Crab angle asin(5 / 22); the excursion is found on the linear surrogate too, 0.31 lengths."""
    track = voyages.track_change()
    length = voyages.ship().manoeuvring.length_m
    settled = track[(track["way"] > 50.0) & (track["way"] < 60.0)]
    crab = math.degrees(settled["heading_rad"].mean())
    assert crab == pytest.approx(-math.degrees(math.asin(5.0 / 22.0)), abs=0.02)
    gust = track[(track["way"] > 20.0) & (track["way"] < 60.0)]
    assert gust["cross_track_m"].max() / length == pytest.approx(0.33, abs=0.03)
    changes = track[track["way"] > 60.0]
    assert (changes["cross_track_m"] - changes["aim"]).abs().max() / length < 0.025
    lines = [np.interp(w, track["way"], track["cross_track_m"]) / length for w in (130.0, 215.0)]
    assert lines == pytest.approx([-2.0, 0.0], abs=0.005)


def test_the_slow_force_of_waves_pushes_with_them() -> None:
    """The mean of rho g L a^2 / 2 over a sea is rho g L Hs^2 / 16: Hs^2 is 8 mean squares of a."""
    sea, density = voyages.in_waves(1)[1], voyages.ship().water.density_kg_m3
    time, force = voyages.drift(sea, 40_000.0, 1.0)
    expected = density * 9.81 * voyages.ship().manoeuvring.length_m * 1.88**2 / 16.0
    assert force.mean() == pytest.approx(expected, rel=0.05)
    assert np.all(force > 0.0)
    changes = np.abs(np.diff(force)) / (time[1] - time[0])
    assert changes.max() < force.max() / 10.0  # slow


@pytest.mark.slow
def test_the_pages(tmp_path: Path) -> None:
    ticks = []
    made = reproduce.reproduce_autopilot(tmp_path, lambda: ticks.append(1))
    assert len(ticks) == results.AUTOPILOT_TICKS
    assert (
        made.numbers["voyages"]["second_turn_error_lengths"]
        < made.numbers["voyages"]["first_turn_error_lengths"]
    )
    made = reproduce.reproduce_track(tmp_path, lambda: ticks.append(1))
    assert len(ticks) == results.AUTOPILOT_TICKS + results.TRACK_TICKS
    assert made.numbers["gain_margin_dB"] == pytest.approx(21.57, abs=0.01)
    for name in ("autopilot", "track"):
        text = (tmp_path / f"{name}.md").read_text()
        assert "| quantity | ours | printed | met |" in text
        for kind in ("loop", "voyages"):
            assert (tmp_path / "figures" / f"{name}-{kind}.png").stat().st_size > 10_000


def test_a_row_says_whether_it_is_met() -> None:
    rows = [
        Row("a", "x", 3.0, "about 3", 2.0, 4.0),
        Row("b", "y", 5.0, "3", 2.0, 4.0, "z"),
    ]
    assert table(rows)["met"].tolist() == ["yes", "no"]
    assert reasons(rows) == "- y: z"
