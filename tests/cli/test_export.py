"""``shaftline export``: ships and policies, and what it refuses."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shaftline.plant import load_ship, ship_names, write_ship

from .conftest import Command
from .test_bad_input import nothing_written, refused

fmpy = pytest.importorskip("fmpy")
needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None, reason="needs a C compiler named cc"
)


@needs_compiler
def test_a_ship_file_becomes_an_fmu(shaftline: Command, tmp_path: Path) -> None:
    ship = load_ship("frigate").with_values({"hull.mass_kg": 2.0e6})
    own = write_ship(ship, tmp_path / "own.toml")
    file = tmp_path / "own-ship.fmu"
    result = shaftline(
        "export",
        "fmu",
        "--ship",
        own,
        "--speed",
        7,
        "--step",
        0.1,
        "--sea",
        "state-4",
        "--out",
        file,
    )
    assert result.exit_code == 0, result.output
    assert "time step of 0.1 s" in result.output
    assert "initial_ship_speed_m_s" in result.output
    description = fmpy.read_model_description(str(file))
    starts = {v.name: v.start for v in description.modelVariables if v.causality != "output"}
    assert float(starts["initial_ship_speed_m_s"]) == pytest.approx(7.0, abs=1e-6)
    assert description.defaultExperiment.stepSize == "0.1"
    result = fmpy.simulate_fmu(
        str(file), stop_time=20.0, output_interval=0.1, relative_tolerance=None
    )
    assert result["propeller_submergence_m"].std() > 0.3  # waves


def test_a_policy_becomes_a_c_file(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline("export", "storm", "--out", tmp_path / "my-storm.c")
    assert result.exit_code == 0, result.output
    assert "void my_storm_step(" in (tmp_path / "my-storm.c").read_text()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("fmu --out ship.c", "the name of an FMU must end in .fmu"),
        ("storm --out storm.txt", "the name must end in .c or .fmu"),
        ("storm --out storm.c --speed 8", "--speed is an option of `shaftline export fmu`"),
        ("nobody --out nobody.fmu", "no such policy file"),
        ("fmu --out s.fmu --speed 99", "no drive command holds a speed of 99 m/s"),
        ("fmu --out s.fmu --speed 8 --drive 20", "give either --speed or --drive, but not both"),
        ("fmu --out s.fmu --pitch 3", "the P/D of frigate must be from"),
        ("fmu --out s.fmu --drive 900", "--drive 900 mm: must be from 0 to 40 mm"),
        ("fmu --out s.fmu --step -1", "time_step_s"),
        ("fmu --out s.fmu --sea state-99", "unknown sea 'state-99'"),
        ("fmu --out s.fmu --ship nobody", "nobody"),
    ],
)
def test_wrong_options_are_refused(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(shaftline("export", *line.split()), words)
    nothing_written(tmp_path)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", ship_names())
def test_every_ship_becomes_a_valid_fmu(shaftline: Command, tmp_path: Path, name: str) -> None:
    from fmpy.validation import validate_fmu

    file = tmp_path / "ship.fmu"
    result = shaftline("export", "fmu", "--ship", name, "--out", file)
    assert result.exit_code == 0, result.output
    assert validate_fmu(str(file)) == []
    interval = 4 * load_ship(name).time_step_s
    assert (
        len(fmpy.simulate_fmu(str(file), stop_time=10 * interval, output_interval=interval)) == 11
    )
