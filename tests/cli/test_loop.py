"""``shaftline loop``: numbers, figure, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .conftest import Command
from .test_bad_input import nothing_written, refused


def test_help_teaches(shaftline: Command) -> None:
    result = shaftline("loop", "--help")
    assert result.exit_code == 0
    for word in ("autopilot", "--interval", "linearised", "numerator/denominator", "loop.png"):
        assert word in result.output


@pytest.mark.parametrize(
    ("arguments", "stands"),
    [
        (("combinator", "--speed", 7), {"overshoot_percent": 0.0}),
        (
            ("autopilot", "--ship", "ddg-51-surrogate", "--speed", 11.318),
            {"phase_margin_deg": 69.37},
        ),
        (("3,0.4/1,0", "--speed", 7), {"phase_margin_deg": 100.92}),
    ],
)
def test_measures_a_loop(
    shaftline: Command, tmp_path: Path, arguments: tuple[object, ...], stands: dict[str, float]
) -> None:
    result = shaftline("loop", *arguments, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    numbers = json.loads((tmp_path / "loop.json").read_text())
    for key, value in stands.items():
        assert numbers[key] == pytest.approx(value, abs=0.05)
    assert "gain margin" in result.output
    assert (tmp_path / "loop.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("unknown",), "unknown controller 'unknown'"),
        (("1,2/1",), "numerator must not be longer"),
        (("1,x/1,2",), "with falling powers of s"),
        (("3,0.4/1,0", "--output", "speed"), "--output speed: must be one of shaft_speed"),
        (("-3000/1", "--speed", 7), "closed loop is unstable"),
        (("combinator", "--command", "rudder"), "unknown command 'rudder'"),
        (("combinator", "--speed", 50), "no drive command holds a speed of 50"),
        (("autopilot", "--ship", "kvlcc2", "--speed", 1.18), "stable on a straight course"),
        (("autopilot",), "frigate cannot be steered"),
    ],
)
def test_what_cannot_be_is_refused(
    shaftline: Command, tmp_path: Path, arguments: tuple[object, ...], told: str
) -> None:
    options = arguments[1:]
    refused(shaftline("loop", *options, "--out", tmp_path / "out", "--", arguments[0]), told)
    nothing_written(tmp_path)


def test_a_loop_without_a_crossover_is_drawn(shaftline: Command, tmp_path: Path) -> None:
    """Its gain stays below 1, so there is no phase margin to draw."""
    result = shaftline("loop", "0.001/1,0", "--ship", "ferry", "--speed", 4.7, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "loop.png").stat().st_size > 20_000
