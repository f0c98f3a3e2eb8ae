"""Controllers in the same waves, filmed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from shaftline.agents.evaluation import film
from shaftline.cli.main import app
from shaftline.envs import DEFAULTS
from shaftline.plant.waves import wave_field

SEEN, SPAN = DEFAULTS.observer, film.Span(60.0, 40.0)


def test_a_film_shows_the_same_sea_and_each_ship_s_own_signals() -> None:
    runs = [
        film.simulate_episode(name, "rough-sea", 5, SEEN) for name in ("combinator", "va-pitch")
    ]
    figure, draw, frames = film.build_animation(runs, film.draw_sea("rough-sea", 5, SEEN), SPAN)
    assert frames == 160
    draw(frames - 1)
    now = SPAN.begin + (frames - 1) * film.EVERY_S
    axes = np.array(figure.axes).reshape(4, 2)
    for column, run in enumerate(runs):
        (line,) = axes[3, column].lines
        shown = np.interp(now, run.trace.index, run.trace["blade_pitch"])
        assert line.get_ydata()[-1] == pytest.approx(shown)
        assert axes[0, column].get_title().startswith(run.words)
        assert run.fluctuations[0] > run.fluctuations[1] > 0.0
    surfaces = [axes[0, k].collections[0].get_paths()[0].vertices for k in range(2)]
    assert surfaces[0].shape == surfaces[1].shape
    assert np.ptp(surfaces[0][:90, 1]) > 1.0  # waves of more than a metre


def test_the_sea_of_a_film_is_that_of_its_episode() -> None:
    """The inflow that its waves give is the one that the ship meets."""
    run, sea = (
        film.simulate_episode("va-pitch", "rough-sea", 5, SEEN),
        film.draw_sea("rough-sea", 5, SEEN),
    )
    trace = run.trace
    met = trace["advance_velocity"] - trace["advance_velocity"].rolling(40, center=True).mean()
    waves = [wave_field(sea, t, x)[0] for t, x in trace["position"].items()]
    assert np.corrcoef(met[20:-20], waves[20:-20])[0, 1] > 0.9


def test_the_command_writes_an_animated_picture(tmp_path: Path) -> None:
    path = tmp_path / "film.gif"
    arguments = ["video", "combinator", "--seconds", "1", "--out", str(path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert path.read_bytes()[:6] == b"GIF89a"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["combinator", "--out", "film.mp4"], "must end in .gif"),
        (["combinator"] * 5, "at most 4"),
        (["combinator", "--begin-s", "290"], "length of an episode, 300 s"),
        (["nobody"], "unknown controller"),
        (["combinator", "--task", "nobody"], "nobody"),
        (["combinator", "--observer", "nobody"], "unknown observer"),
    ],
)
def test_what_cannot_be_filmed_is_refused(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["video", *arguments])
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert not list(tmp_path.iterdir())


def test_a_task_with_a_rudder_can_be_filmed() -> None:
    run = film.simulate_episode("va-pitch", "track-keeping", 1, SEEN)
    assert run.trace["ship_speed"].between(1.0, 12.0).all()
    assert film.draw_sea("track-keeping", 1, SEEN)["present"] != 0
