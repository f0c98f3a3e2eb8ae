"""What the picture of a run shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from shaftline.envs import FrigateEnv, dashboard
from shaftline.envs.dashboard import Dashboard

ACTION = np.array([0.5, 0.1], np.float32)


class Kept(Figure):
    """Figures that can be looked at after they were drawn."""

    made: list[Figure]

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        Kept.made.append(self)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    Kept.made = []
    monkeypatch.setattr(dashboard, "Figure", Kept)
    return Kept.made


def test_lines_are_what_was_seen(figures: list[Figure]) -> None:
    env = FrigateEnv(render_mode="rgb_array", task="transit", episode_s=10.0)
    env.reset(seed=0)
    rows, truth = [], []
    for _ in range(5):
        seen, *_, info = env.step(ACTION)
        rows.append(seen)
        truth.append(info["advance_velocity"])
    frame = env.render()
    assert frame.shape == (480, 800, 3)
    assert frame.dtype == np.uint8
    assert frame.std() > 10.0
    order, speed, torque, pitch, rack, log, estimate, _ = np.asarray(rows, np.float64).T
    expected = [[order, log], [speed], [torque * 1e-3], [pitch], [rack], [truth, estimate]]
    panels = figures[0].axes
    assert [panel.get_title().split(" [")[0] for panel in panels] == [
        "ship speed and order", "shaft speed", "shaft torque", "pitch ratio", "fuel rack",
        "v_a true, estimated",
    ]  # fmt: skip
    for panel, lines in zip(panels, expected, strict=True):
        for line, values in zip(panel.lines, lines, strict=True):
            assert np.asarray(line.get_xdata()) == pytest.approx(0.5 * np.arange(1, 6))
            assert np.asarray(line.get_ydata()) == pytest.approx(np.asarray(values))
        assert panel.get_xlim() == (2.5 - 120.0, 2.5)


def test_a_reset_begins_an_empty_picture(figures: list[Figure]) -> None:
    env = FrigateEnv(render_mode="rgb_array", episode_s=10.0)
    env.reset(seed=0)
    env.step(ACTION)
    env.reset(seed=0)
    env.render()
    (line,) = figures[0].axes[1].lines
    assert np.asarray(line.get_ydata()).tolist() == [0.0]


@pytest.mark.parametrize(("interval", "kept"), [(0.5, 240), (100.0, 2)])
def test_two_minutes_are_kept(interval: float, kept: int) -> None:
    env = FrigateEnv(control_interval_s=interval)
    assert Dashboard(env.batch).rows.maxlen == kept
    assert env.render() is None
