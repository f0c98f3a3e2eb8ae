"""The thesis's figures without numbers: what they draw is what is printed and simulated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reproductions.thesis import dead_beat, drawn, followed, working_points
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES


def drawn_at(line: Any) -> tuple[Any, Any]:
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def test_torque_lines_are_the_rack_maps(frigate: Ship) -> None:
    (axis,) = drawn.fuel_rack_map(frigate).axes
    lines = {line.get_label(): line for line in axis.lines}
    assert drawn_at(lines["torque limit"])[1][-1] == pytest.approx(38.0)
    rpm, torque = drawn_at(axis.lines[drawn.RACKS_MM.index(20.0)])
    speed = float(rpm[0]) * np.pi / 30.0
    assert torque[0] == pytest.approx((-45.5 * speed + 1428.6 * 20.0 - 7381.0) / 1e3)


def test_load_cases_are_drawn_as_they_are_sailed(frigate: Ship) -> None:
    axes = drawn.load_case_overview(frigate).axes
    assert [axis.get_title() for axis in axes] == [name.replace("_", " ") for name in CASES]
    assert np.ptp(drawn_at(axes[0].lines[0])[1]) == 7.5
    assert np.abs(drawn_at(axes[2].lines[0])[1]).max() == pytest.approx(1.0, abs=1e-3)


def test_bode_plots_have_the_steady_gains(frigate: Ship) -> None:
    """omega and M_p of their own reading at low frequency: 0 dB, of the discrete filter too."""
    for figure in (drawn.shaft_observers(frigate), drawn.random_walk(frigate)):
        for line in figure.axes[0].lines:
            assert drawn_at(line)[1][0] == pytest.approx(0.0, abs=0.01)
    panels = drawn.invariance(frigate).axes
    assert len(panels) == 2
    assert len(panels[0].lines) == 8


def test_the_dead_beat_filter_forgets_at_once() -> None:
    system = dead_beat.response(-0.127, 0.631, 14411.0)
    assert np.abs(system.poles()).max() < 1e-4


def test_vaf_rises_with_the_snr(frigate: Ship, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawn, "SNRS_DB", np.array([20.0, 60.0, 100.0]))
    monkeypatch.setattr(drawn, "SEEDS", 2)
    monkeypatch.setattr(drawn, "ROWS", {"power-balance": "power-balance"})
    curves = drawn.snr_curves(frigate, lambda: None)
    assert curves["mean"].is_monotonic_increasing
    assert curves["mean"].iloc[0] < 1.0
    assert curves["mean"].iloc[-1] == pytest.approx(95.8, abs=0.3)
    assert (curves["least"] <= curves["most"]).all()


def test_what_the_text_says(frigate: Ship) -> None:
    """Sections 4-1-1, 4-1-2 and 2-7-3."""
    said = working_points.said(frigate)
    assert said["ours"].iloc[0] == pytest.approx(24.62, abs=0.05)
    assert said["ours"].iloc[1] == pytest.approx(23.23, abs=0.3)
    tabled = said["printed"].iloc[2:].astype(float)
    assert tabled.tolist() == pytest.approx([-1.3, -2.4, -28.7, -11.2], abs=0.1)
    assert said["ours"].iloc[2:].tolist() == pytest.approx(tabled.tolist(), abs=1.0)


def test_the_model_of_the_instant_follows_and_a_fixed_one_does_not() -> None:
    found = followed.compared(load_ship("frigate")).set_index(["load case", "state"])
    step = found["next step, of the state"]
    assert step["jonswap", "shaft_speed"] < 1e-4  # 1e-3 was asked for
    assert step["rack_step", "shaft_speed"] < 1e-6
    fixed = found["fixed model, whole run, of its deviation"]
    assert fixed["pitch_step", "ship_speed"] > 1.0
    assert fixed["jonswap", "shaft_speed"] == pytest.approx(0.025, abs=0.01)
