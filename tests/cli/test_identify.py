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
    assert "Numbers of frigate by output-error" in done.output
    assert str(out / "report.html") in done.output
    assert load_ship(out / "identified_ship.toml").hull.mass_kg == pytest.approx(3.6e6, rel=0.03)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--free", "hull.mas"), "hull.mas is no number of this ship that can be free"),
        (("--free", "prime_mover.fuel_base_g_kWh"), "it moves nothing that is measured here"),
        (("--method", "guess"), "unknown method 'guess'; known: output-error"),
    ],
)
def test_what_cannot_be_found_is_named_and_nothing_written(
    shaftline: Command, trial: Path, tmp_path: Path, options: tuple[str, str], words: str
) -> None:
    out = tmp_path / "out"
    refused(shaftline("identify", trial, "--ship", "frigate", "--out", out, *options), words)
    nothing_written(tmp_path, trial.name)
