"""``--json`` of every command: one form, nothing beside it on the standard output, all of it JSON."""

from __future__ import annotations

import inspect
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shaftline.cli import main
from shaftline.cli.console import print_table, say
from shaftline.cli.machine import plain, with_json

from .conftest import Command
from .test_bad_input import nothing_written, refused


@pytest.mark.parametrize("name", main.COMMANDS)
def test_every_command_has_it(name: str) -> None:
    assert "--json" in {option for p in main.Later(name).itself().params for option in p.opts}


@pytest.mark.parametrize("name", main.COMMANDS)
def test_no_option_loses_its_help(name: str) -> None:
    assert all(getattr(p, "help", "") for p in main.Later(name).itself().params)


def test_in_a_file(shaftline: Command, tmp_path: Path) -> None:
    ask = ("linearise", "--drive", 22, "--pitch", 1.4, "--out", tmp_path / "lin")
    result = shaftline(*ask, "--json", tmp_path / "told.json")
    assert result.exit_code == 0, result.output
    assert "modes" in result.output
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["said"][0].startswith("frigate at X = 22 mm")
    slowest = told["tables"]["modes"][0]
    assert slowest["time constant [s]"] == pytest.approx(47.98, abs=0.1)
    assert told["tables"]["channels"][0]["gain margin [dB]"] is None  # infinite


def test_on_the_standard_output_stands_nothing_else(tmp_path: Path) -> None:
    arguments = ["linearise", "--drive", "22", "--out", str(tmp_path), "--json", "-"]
    result = CliRunner().invoke(main.app, arguments)
    assert result.exit_code == 0, result.output
    assert set(json.loads(result.stdout)) == {"said", "tables"}
    again = CliRunner().invoke(main.app, arguments[:-2])
    assert "modes" in again.stdout  # nothing stays quiet


def test_a_failure_writes_none(shaftline: Command, tmp_path: Path) -> None:
    ask = ("linearise", "--drive", 0.1, "--out", tmp_path / "lin", "--json", tmp_path / "told.json")
    refused(shaftline(*ask), "steady state")
    nothing_written(tmp_path)


def test_a_command_that_has_its_own_keeps_it() -> None:
    def own(json: Path | None = None) -> None: ...

    def none(count: int = 1) -> None:
        say(f"{count}")

    assert inspect.signature(with_json(own)) == inspect.signature(own)
    assert list(inspect.signature(with_json(none)).parameters) == ["count", "json"]


def test_what_json_allows() -> None:
    value = {
        "a": [np.float64(1.5), np.int64(2), math.inf, (math.nan, None)],
        3: Path("x/y"),
        "b": True,
    }
    assert plain(value) == {"a": [1.5, 2, None, [None, None]], "3": "x/y", "b": True}


def test_without_it_nothing_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(pd.DataFrame({"x": [1.0]}), "one")
    assert "one" in capsys.readouterr().out
