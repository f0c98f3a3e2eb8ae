"""``--json`` of every command: one form, nothing beside it on the standard output, all of it JSON."""

from __future__ import annotations

import inspect
import json
import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shaftline.cli import machine, main
from shaftline.cli.console import print_table, say
from shaftline.cli.machine import add_json_option, to_json

from .conftest import Command
from .test_bad_input import nothing_written, refused

ONE_CHANNEL = ("--output", "pitch_ratio")
"""Option of ``linearise`` that draws one response instead of one for each pair of input and output."""


@pytest.mark.parametrize("name", main.COMMANDS)
def test_every_command_has_it(name: str) -> None:
    assert "--json" in {option for p in main.LazyCommand(name).itself().params for option in p.opts}


@pytest.mark.parametrize("name", main.COMMANDS)
def test_no_option_loses_its_help(name: str) -> None:
    assert all(getattr(p, "help", "") for p in main.LazyCommand(name).itself().params)


def test_in_a_file(shaftline: Command, tmp_path: Path) -> None:
    ask = ("linearise", "--drive", 22, "--pitch", 1.4, *ONE_CHANNEL, "--out", tmp_path / "lin")
    result = shaftline(*ask, "--json", tmp_path / "told.json")
    assert result.exit_code == 0, result.output
    assert "modes" in result.output
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["said"][0].startswith("frigate at X = 22 mm")
    slowest = told["tables"]["modes"][0]
    assert slowest["time constant [s]"] == pytest.approx(47.98, abs=0.1)
    assert told["tables"]["channels"][0]["gain margin [dB]"] is None  # infinite


def test_on_the_standard_output_stands_nothing_else(tmp_path: Path) -> None:
    arguments = ["linearise", "--drive", "22", *ONE_CHANNEL, "--out", str(tmp_path), "--json", "-"]
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

    assert inspect.signature(add_json_option(own)) == inspect.signature(own)
    assert list(inspect.signature(add_json_option(none)).parameters) == ["count", "json"]


def test_what_json_allows() -> None:
    value = {
        "a": [np.float64(1.5), np.int64(2), math.inf, (math.nan, None)],
        3: Path("x/y"),
        "b": True,
    }
    assert to_json(value) == {"a": [1.5, 2, None, [None, None]], "3": "x/y", "b": True}


def test_without_it_nothing_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(pd.DataFrame({"x": [1.0]}), "one")
    assert "one" in capsys.readouterr().out


LINES = [
    (
        "simulate --case rack_step --out x.csv --json x.csv",
        "--out x.csv and --json x.csv are the same",
    ),
    ("simulate --case rack_step --out x.csv --json ./sub/../x.csv", "--out x.csv and --json"),
    ("simulate --case rack_step --out x.png --figure x.png", "--out x.png and --figure x.png"),
    ("list --markdown x.md --json x.md", "--json x.md and --markdown x.md"),
    ("check ok.csv --ship frigate --draft x.toml --json x.toml", "--json x.toml and --draft"),
    ("simulate --case rack_step --out x.csv --json link.csv", "--out x.csv and --json link.csv"),
]


@pytest.mark.parametrize(("line", "words"), LINES, ids=[line for line, _ in LINES])
def test_two_results_are_not_one_file(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    Path("link.csv").symlink_to("x.csv")
    result = shaftline(*line.split())
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.output.split())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.csv", "sub"]


def test_every_option_of_a_file_to_be_written_is_known() -> None:
    """An option that names a path is one that is read, or stands in RESULTS."""
    read = {"inputs", "columns", "effects", "recipe", "space", "hold_out", "calibrate", "recording",
            "recordings", "template", "policy", "from_particulars", "runs", "log", "ship", "orders",
            "lever", "report", "limits", "references", "against", "folder", "truth"}  # fmt: skip
    for command in main.COMMANDS:
        module = import_module(f"shaftline.cli.{main._stem(command)}_command")
        function = inspect.signature(getattr(module, main._function(command)), eval_str=True)
        for name, option in function.parameters.items():
            if "Path" in str(option.annotation):
                assert name in {*read, *machine.RESULTS}, (command, name)


def test_json_does_not_replace_what_the_command_wrote(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    line = ("linearise", "--speed", "7", *ONE_CHANNEL, "--out", "li")
    plain = shaftline(*line)
    assert plain.exit_code == 0, plain.output
    name = next(p.name for p in Path("li").iterdir() if p.suffix == ".mat")
    result = shaftline(*line, "--json", f"li/{name}")
    assert result.exit_code == 2, result.output
    assert "the command wrote another result to this file" in " ".join(result.output.split())
    assert Path("li", name).read_bytes()[:1] != b"{"


def test_a_symbolic_link_is_written_through(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    for out, real in (("a.csv", "there/a.csv"), ("b.csv", "there/b.csv")):
        Path(out).symlink_to(real)
    Path("there/a.csv").write_text("old")  # b.csv leads to nothing yet
    for option, name in (("--out", "a.csv"), ("--out", "b.csv"), ("--json", "b.csv")):
        line = ["simulate", "--case", "rack_step", "--out", "c.csv"]
        line = [*line[:3], option, name, *([] if option == "--out" else line[3:])]
        result = shaftline(*line)
        assert result.exit_code == 0, result.output
        assert Path(name).is_symlink()
        assert Path("there", name).read_text()[:6] not in ("old", "")
