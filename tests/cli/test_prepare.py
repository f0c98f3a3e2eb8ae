"""``shaftline prepare`` runs small commands in other processes, and names one that fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from shaftline.cli import main, prepare_command
from shaftline.cli.prepare_command import RUNS

from .conftest import Command


@pytest.mark.parametrize("name", RUNS)
def test_the_commands_take_the_options_of_the_small_runs(name: str, tmp_path: Path) -> None:
    command, *options = RUNS[name]
    assert command in main.COMMANDS
    arguments = [*options, "--out", str(tmp_path)]
    main.LazyCommand(command).itself().make_context(command, arguments)


def test_each_run_is_timed(shaftline: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {
        "rack": ("simulate", "--case", "rack_step"),
        "pitch": ("simulate", "--case", "pitch_step"),
    }
    monkeypatch.setattr(prepare_command, "RUNS", runs)
    result = shaftline("prepare", "--jobs", 1)
    assert result.exit_code == 0, result.output
    assert "rack: " in result.output
    assert "pitch: " in result.output


def test_a_run_that_fails_is_named_with_its_error(
    shaftline: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepare_command, "RUNS", {"steady": ("linearise", "--drive", "0.1")})
    result = shaftline("prepare")
    assert result.exit_code == 2
    assert "shaftline linearise --drive 0.1 fails: " in result.output
    assert "steady state" in result.output
