"""The thesis's figures without numbers: what they draw is what is printed and simulated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reproductions.thesis import figures, observer_transfers, snr, working_points
from shaftline.plant import Ship, linearise_along
from shaftline.plant.load_cases import CASES


def drawn_at(line: Any) -> tuple[Any, Any]:
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def test_torque_lines_are_the_rack_maps(frigate: Ship) -> None:
    (axis,) = figures.fuel_rack_map(frigate).axes
    lines = {line.get_label(): line for line in axis.lines}
    assert drawn_at(lines["torque limit"])[1][-1] == pytest.approx(38.0)
    rpm, torque = drawn_at(axis.lines[figures.RACKS_MM.index(20.0)])
    speed = float(rpm[0]) * np.pi / 30.0
    assert torque[0] == pytest.approx((-45.5 * speed + 1428.6 * 20.0 - 7381.0) / 1e3)


def test_load_cases_are_drawn_as_they_are_sailed(frigate: Ship) -> None:
    axes = figures.load_case_overview(frigate).axes
    assert [axis.get_title() for axis in axes] == [name.replace("_", " ") for name in CASES]
    assert np.ptp(drawn_at(axes[0].lines[0])[1]) == 7.5
    assert np.abs(drawn_at(axes[2].lines[0])[1]).max() == pytest.approx(1.0, abs=1e-3)


def test_bode_plots_have_the_steady_gains(frigate: Ship) -> None:
    """omega and M_p of their own measurement at low frequency: 0 dB, of the discrete filter too."""
    for figure in (figures.shaft_observer_bode(frigate), figures.random_walk_bode(frigate)):
        for line in figure.axes[0].lines:
            assert drawn_at(line)[1][0] == pytest.approx(0.0, abs=0.01)
    panels = figures.invariance_bode(frigate).axes
    assert len(panels) == 2
    assert len(panels[0].lines) == 8


def test_the_dead_beat_filter_forgets_at_once() -> None:
    system = observer_transfers.random_walk_response(-0.127, 0.631, 14411.0)
    assert np.abs(system.poles()).max() < 1e-4


def test_vaf_rises_with_the_snr(frigate: Ship, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snr, "SNRS_DB", np.array([20.0, 60.0, 100.0]))
    monkeypatch.setattr(snr, "SEEDS", 2)
    monkeypatch.setattr(snr, "ROWS", {"power-balance": "power-balance"})
    curves = snr.snr_curves(frigate, lambda: None)
    assert curves["mean"].is_monotonic_increasing
    assert curves["mean"].iloc[0] < 1.0
    assert curves["mean"].iloc[-1] == pytest.approx(95.8, abs=0.3)
    assert (curves["least"] <= curves["most"]).all()


def test_what_the_text_says(frigate: Ship) -> None:
    """Sections 4-1-1, 4-1-2 and 2-7-3."""
    said = working_points.numbers_of_text(frigate)
    assert said["ours"].iloc[0] == pytest.approx(24.62, abs=0.05)
    assert said["ours"].iloc[1] == pytest.approx(23.23, abs=0.3)
    tabled = said["printed"].iloc[2:].astype(float)
    assert tabled.tolist() == pytest.approx([-1.3, -2.4, -28.7, -11.2], abs=0.1)
    assert said["ours"].iloc[2:].tolist() == pytest.approx(tabled.tolist(), abs=1.0)


@pytest.mark.parametrize(("case", "limit"), [("jonswap", 1e-4), ("rack_step", 1e-6)])
def test_the_linear_model_of_each_instant_predicts_the_next_step(
    frigate: Ship, case: str, limit: float
) -> None:
    """Section 2-7-2: rms error of the shaft speed 0.05 s ahead, as a share of its mean."""
    models = linearise_along(frigate, CASES[case].run(frigate), 0.05)
    speed = models[0].states.index("shaft_speed")
    states = np.array([model.state[speed] for model in models])
    ahead = np.array([model.predict(0.05)[speed] for model in models[:-1]])
    assert np.sqrt(np.mean((ahead - states[1:]) ** 2)) / states.mean() < limit
