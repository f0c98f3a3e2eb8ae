"""``shaftline check``, and the recording that comes with the package."""

from __future__ import annotations

import json
from pathlib import Path

from shaftline.mismatch.example import COLUMN_MAP, CONCEALED, FOLDER, RECORDING
from shaftline.proof.example import main as write_example

from .conftest import Command


def test_the_command(shaftline: Command, tmp_path: Path) -> None:
    good = shaftline(
        "check", FOLDER / RECORDING, "--ship", "frigate", "--columns", FOLDER / COLUMN_MAP,
        "--figure", tmp_path / "c.png", "--json", tmp_path / "j.json",
    )  # fmt: skip
    assert good.exit_code == 0, good.output
    assert (tmp_path / "c.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "j.json").read_text())
    assert any("usable" in sentence for sentence in told["said"])
    bad = shaftline("check", FOLDER / RECORDING, "--ship", "frigate")
    assert bad.exit_code == 2
    assert "column map might begin so" in bad.output


def test_the_example_is_what_its_maker_writes(tmp_path: Path) -> None:
    write_example(tmp_path)
    for path in tmp_path.iterdir():
        assert path.read_text() == (FOLDER / path.name).read_text(), path.name


def test_the_example_names_what_is_concealed(shaftline: Command, tmp_path: Path) -> None:
    found = shaftline("diagnose", "--example", "--out", tmp_path / "ex")
    assert found.exit_code == 0, found.output
    report = json.loads((tmp_path / "ex" / "report.json").read_text())
    sizes = json.loads((FOLDER / CONCEALED).read_text())
    named = {effect["id"] for effect in report["effects"]}
    assert named == set(sizes)
    assert "what was concealed: hull-fouling of 0.1343" in found.output
    for name in (RECORDING, COLUMN_MAP, "ship.toml", "report.html"):
        assert (tmp_path / "ex" / name).is_file()


def test_diagnose_says_what_it_needs(shaftline: Command, tmp_path: Path) -> None:
    for line, words in (
        (("diagnose",), "a RECORDING is needed"),
        (("diagnose", "a.csv"), "--ship is needed"),
        (("diagnose", "a.csv", "--ship", "frigate"), "--out is needed"),
        (("diagnose", "--example", "--ship", "frigate"), "brings its own"),
    ):
        found = shaftline(*line)
        assert found.exit_code == 2
        assert words in found.output


def test_a_draft_of_the_column_map_is_written_once(shaftline: Command, tmp_path: Path) -> None:
    draft = tmp_path / "map.toml"
    ask = ["check", FOLDER / RECORDING, "--ship", "frigate"]
    first = shaftline(*ask, "--draft", draft)
    assert first.exit_code == 2
    assert "column map to complete: " in first.output
    assert shaftline(*ask, "--columns", draft).exit_code == 0
    draft.write_text("mine")
    again = shaftline(*ask, "--draft", draft)
    assert again.exit_code == 2
    assert "replaces no map of yours" in again.output
    assert draft.read_text() == "mine"
