"""``shaftline identify``: what it writes and says, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from shaftline.plant import load_ship

from ..mismatch.voyages import frigate_voyage
from .conftest import Command
from .test_bad_input import nothing_written, refused

MASS = "hull.mass_kg"


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    path = tmp_path / "trial.csv"
    frigate_voyage({MASS: 3.6e6}, seed=2, seconds=200.0).to_csv(path, index=False)
    return path


def test_numbers_are_found_and_written(shaftline: Command, trial: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = shaftline("identify", trial, "--ship", "frigate", "--free", MASS, "--out", out)
    assert done.exit_code == 0, done.output
    assert "Parameters of frigate by output-error" in done.output
    assert str(out / "report.html") in done.output
    assert load_ship(out / "identified_ship.toml").hull.mass_kg == pytest.approx(3.6e6, rel=0.03)


@pytest.mark.parametrize("free", ["", " , "])
def test_no_key_is_refused_with_the_keys_that_can_be_free(
    shaftline: Command, trial: Path, tmp_path: Path, free: str
) -> None:
    out = tmp_path / "out"
    done = shaftline("identify", trial, "--ship", "frigate", "--free", free, "--out", out)
    refused(
        done, "contains no key; give auto, or keys of the ship file", MASS, "hull.wake_fraction"
    )
    nothing_written(tmp_path, "trial.csv")


POINTS = """\
motor_voltage_V,shaft_speed_rad_s,motor_current_A
2.11,31.2,1.40
4.03,58.7,2.44
5.89,83.7,3.74
7.76,107.7,5.30
9.62,130.6,7.10
"""


def test_a_table_of_steady_states_needs_no_time(shaftline: Command, tmp_path: Path) -> None:
    file, out = tmp_path / "points.csv", tmp_path / "out"
    file.write_text(POINTS)
    common = ("--ship", "tito-neri-staircase", "--method", "steady", "--out", out)
    done = shaftline("identify", file, *common)
    assert done.exit_code == 0, done.output
    assert "5 steady states" in done.output
    assert {p.name for p in out.iterdir()} >= {
        "identified_ship.toml",
        "steady-states.csv",
        "fit.csv",
    }
    refused(shaftline("identify", file, *common, "--hold-out", file), "is fitted as a whole")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n3,4\n", "column 'time_s' is missing; found: a, b"),
        (POINTS.replace("3.74", "x"), "motor_current_A, row 3: 'x' is not a finite number"),
        (POINTS.replace("shaft_speed", "speed"), "column 'shaft_speed_rad_s' is missing"),
        (POINTS.replace("130.6", "1e7"), "shaft_speed_rad_s, row 5: 1e+07 rad/s lies outside"),
    ],
)
def test_a_table_of_points_that_is_none_is_refused(
    shaftline: Command, tmp_path: Path, text: str, words: str
) -> None:
    file, out = tmp_path / "points.csv", tmp_path / "out"
    file.write_text(text)
    common = ("--ship", "tito-neri-staircase", "--method", "steady", "--out", out)
    refused(shaftline("identify", file, *common), words)
    nothing_written(tmp_path, file.name)


def test_points_and_recordings_do_not_go_together(
    shaftline: Command, trial: Path, tmp_path: Path
) -> None:
    file, out = tmp_path / "points.csv", tmp_path / "out"
    file.write_text(POINTS)
    common = ("--ship", "tito-neri-staircase", "--method", "steady", "--out", out)
    refused(
        shaftline("identify", file, trial, *common),
        "steady states",
        "recordings cannot be combined",
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--free", "hull.mas"), "hull.mas is no parameter of this ship that can be free"),
        (("--free", "prime_mover.fuel_base_g_kWh"), "no measured channel depends on it here"),
        (("--method", "guess"), "unknown method 'guess'; known: output-error"),
    ],
)
def test_what_cannot_be_found_is_named_and_nothing_written(
    shaftline: Command, trial: Path, tmp_path: Path, options: tuple[str, str], words: str
) -> None:
    out = tmp_path / "out"
    refused(shaftline("identify", trial, "--ship", "frigate", "--out", out, *options), words)
    nothing_written(tmp_path, trial.name)
