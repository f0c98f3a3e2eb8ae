"""Bad input: exit code 2, one clear message, no traceback, no file left behind."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import Result

from .conftest import Command
from .test_commands import recording


def refused(result: Result, *words: str) -> None:
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    said = " ".join(result.output.split())
    for word in words:
        assert word in said, said


def nothing_written(folder: Path, *kept: str) -> None:
    assert sorted(file.name for file in folder.iterdir()) == sorted(kept)


def frigate(folder: Path, old: str, new: str) -> Path:
    """The frigate's file with one line changed."""
    text = (Path(__file__).parents[2] / "plant/ships/frigate.toml").read_text(encoding="utf-8")
    assert old in text
    path = folder / "mine.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--ship", "fregate", "--case", "rack_step"), ("unknown ship 'fregate'", "frigate")),
        (("--case", "rackstep"), ("unknown load case 'rackstep'", "rack_step")),
        (("--inputs", "nowhere.csv"), ("nowhere.csv", "cannot be read")),
        (("--ship", "tito-neri-sine", "--case", "pitch_step"), ("a variable pitch", "fixed pitch")),
        (("--case", "rack_step", "--sea", "state-9"), ("unknown sea 'state-9'", "state-3")),
        (("--case", "rack_step", "--observer", "lunberger"), ("unknown observer", "luenberger")),
        (
            ("--case", "rack_step", "--observer", "luenberger", "--tuning", "wild"),
            ("'luenberger' has no tuning 'wild'", "low, moderate, high"),
        ),
        (("--case", "rack_step", "--tuning", "low"), ("--tuning", "--observer")),
        ((), ("either --inputs", "--case")),
        (("--case", "rack_step", "--inputs", "x.csv"), ("either --inputs", "--case")),
    ],
)
def test_arguments(
    shaftline: Command, tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    refused(shaftline("simulate", *arguments, "--out", tmp_path / "s.csv"), *words)
    nothing_written(tmp_path)


def test_nothing_to_write(shaftline: Command) -> None:
    refused(shaftline("simulate", "--case", "rack_step"), "--out", "--figure")


def test_unknown_table(shaftline: Command) -> None:
    refused(shaftline("reproduce", "vof"), "vof", "sensitivity")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 3.3e6", "mass_kg = -1.0", ("hull.mass_kg", "-1.0", "unit kg", ">= 0.01")),
        ("mass_kg = 3.3e6", "mass_kg = nan", ("hull.mass_kg", "nan", "unit kg")),
        ("mass_kg = 3.3e6", 'mass_kg = "heavy"', ("hull.mass_kg", "heavy", "unit kg")),
        ("mass_kg = 3.3e6", "mass_t = 3300.0", ("hull.mass_t", "not a known key")),
        ("diameter_m = 4.2", "", ("propeller.diameter_m", "missing", "unit m")),
        ('type = "diesel"', 'type = "steam"', ("prime_mover", "steam", "diesel")),
        ("blades = 5", "blades = 9", ("propeller.blades", "9", ">= 2 and <= 7")),
        (
            'model = "b-series"',
            'model = "wageningen"',
            ("allowed: b-series, four-quadrant, bollard",),
        ),
        ("[hull]", "[hull", ("not valid TOML",)),
    ],
)
def test_ship_files(
    shaftline: Command, tmp_path: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    ship = frigate(tmp_path, old, new)
    result = shaftline(
        "simulate", "--ship", ship, "--case", "rack_step", "--out", tmp_path / "s.csv"
    )
    refused(result, "mine.toml", *words)
    nothing_written(tmp_path, "mine.toml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fuel_rack_mm": (17, float("nan"))}, ("fuel_rack_mm", "row 18", "not a finite number")),
        ({"fuel_rack_mm": (17, "full")}, ("fuel_rack_mm", "row 18", "full")),
        ({"fuel_rack_mm": (17, 4000.0)}, ("fuel_rack_mm", "row 18", "0 to 200 mm")),
        ({"pitch_ratio_command": (3, 30.0)}, ("pitch_ratio_command", "row 4", "-1.6 to 1.6")),
        ({"time_s": (5, 0.2)}, ("time_s", "row 6", "does not rise")),
        ({"time_s": (599, 99.0)}, ("time_s", "row 600", "even time base")),
    ],
)
def test_recordings(
    shaftline: Command,
    tmp_path: Path,
    change: dict[str, tuple[int, object]],
    words: tuple[str, ...],
) -> None:
    path = recording(tmp_path, **change)
    result = shaftline("simulate", "--inputs", path, "--out", tmp_path / "s.csv")
    refused(result, "recording.csv", *words)
    nothing_written(tmp_path, "recording.csv")


def test_a_missing_column_is_named(shaftline: Command, tmp_path: Path) -> None:
    path = recording(tmp_path)
    pd.read_csv(path).rename(columns={"fuel_rack_mm": "rack"}).to_csv(path, index=False)
    result = shaftline("simulate", "--inputs", path, "--out", tmp_path / "s.csv")
    refused(result, "'fuel_rack_mm' is missing", "found: time_s, rack")


@pytest.mark.parametrize("text", ["", "time_s,fuel_rack_mm,pitch_ratio_command\n0,20,1.2\n"])
def test_too_short(shaftline: Command, tmp_path: Path, text: str) -> None:
    path = tmp_path / "short.csv"
    path.write_text(text, encoding="utf-8")
    refused(shaftline("simulate", "--inputs", path, "--out", tmp_path / "s.csv"), "short.csv")


def test_an_unwritable_place(shaftline: Command, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("", encoding="utf-8")
    refused(shaftline("simulate", "--case", "rack_step", "--out", blocker / "s.csv"), "file")
