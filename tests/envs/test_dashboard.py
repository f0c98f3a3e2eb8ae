"""What the dashboard draws."""

from __future__ import annotations

from typing import Any

import gymnasium
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


@pytest.mark.parametrize("normalised", [False, True])
def test_lines_are_the_signals_in_physical_units(figures: list[Figure], normalised: bool) -> None:
    env = FrigateEnv(render_mode="rgb_array", task="transit", normalised=normalised)
    env.reset(seed=0)
    rows, truth, engine, reward = [], [], [], 0.0
    for _ in range(5):
        _, rewarded, *_, info = env.step(ACTION)
        rows.append(env.batch.signals[0, :8].copy())
        truth.append(info["advance_velocity"])
        engine.append(info["brake_torque"])
        reward += float(rewarded)
    frame = env.render()
    assert frame.shape == (600, 960, 3)
    assert frame.dtype == np.uint8
    assert frame.std() > 10.0
    order, speed, torque, pitch, rack, log, estimate, _ = np.asarray(rows, np.float64).T
    expected = [[order, log], [torque * 1e-3], [pitch], [rack], [truth, estimate]]
    ship_speed, plane, *others = figures[0].axes
    titles = [panel.get_title("left").split(" [")[0] for panel in figures[0].axes]
    assert titles == [
        "ship speed",
        "engine torque",
        "shaft torque",
        "pitch ratio P/D",
        "fuel rack",
        "advance velocity",
    ]
    for panel, lines in zip((ship_speed, *others), expected, strict=True):
        for line, values in zip(panel.lines, lines, strict=True):
            assert np.asarray(line.get_xdata()) == pytest.approx(0.5 * np.arange(1, 6))
            assert np.asarray(line.get_ydata()) == pytest.approx(np.asarray(values))
        assert panel.get_xlim() == (0.5, 30.5)
    limit, trail, now = plane.lines
    gear = env.batch.ship.transmission.gear_ratio
    assert np.asarray(trail.get_xdata()) == pytest.approx(gear * speed * 30.0 / np.pi)
    assert np.asarray(trail.get_ydata()) == pytest.approx(1e-3 * np.array(engine))
    assert np.asarray(now.get_ydata()) == pytest.approx(1e-3 * np.array(engine[-1:]))
    assert max(np.asarray(limit.get_ydata())) == pytest.approx(38.0, rel=0.01)
    (title,) = (text.get_text() for text in figures[0].texts if "reward" in text.get_text())
    assert title.endswith(f"transit · random-walk-kalman · 2 s · reward {reward:.1f}")


def test_a_reset_empties_the_picture(figures: list[Figure]) -> None:
    env = FrigateEnv(render_mode="rgb_array")
    env.reset(seed=0)
    env.step(ACTION)
    env.reset(seed=0)
    env.render()
    (line,) = figures[0].axes[2].lines
    assert np.asarray(line.get_ydata()).tolist() == [0.0]


def test_of_a_steered_ship_the_course_is_drawn(figures: list[Figure]) -> None:
    env = gymnasium.make("shaftline/Steering-v0", render_mode="rgb_array")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.render()
    assert figures[0].axes[4].get_title("left") == "heading [deg]"


@pytest.mark.parametrize(("interval", "kept"), [(0.5, 240), (100.0, 2)])
def test_two_minutes_are_kept(interval: float, kept: int) -> None:
    env = FrigateEnv(control_interval_s=interval)
    assert Dashboard(env.batch).rows.maxlen == kept
    assert env.render() is None
