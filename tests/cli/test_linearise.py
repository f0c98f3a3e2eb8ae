"""``shaftline linearise``: the thesis's point A, the files it writes, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from shaftline.display.linear import unit_of
from shaftline.plant import load_ship, ship_names

from .conftest import Command
from .test_bad_input import nothing_written, refused


def test_point_a_of_the_thesis(shaftline: Command, tmp_path: Path) -> None:
    """Poles of Table 2-2 and the steady gain of the rack, in the JSON and in the MATLAB file alike."""
    result = shaftline("linearise", "--drive", 22, "--pitch", 1.4, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert "10.51 rad/s, 8.712 m/s" in result.output
    told = json.loads((tmp_path / "linear.json").read_text())
    assert sorted(pole["real"] for pole in told["poles"]) == pytest.approx(
        [-1.128, -0.5, -0.02084], rel=2e-3
    )
    a, b, c = (np.array(told[name]) for name in "ABC")
    assert np.sort(np.linalg.eigvals(a).real) == pytest.approx([-1.128, -0.5, -0.02084], rel=2e-3)
    gain = -c @ np.linalg.solve(a, b) + np.array(told["D"])
    rack = told["inputs"].index("drive")
    channels = {(row["from"], row["to"]): row for row in told["channels"]}
    assert gain[told["outputs"].index("shaft_speed"), rack] == pytest.approx(0.3370, abs=1e-3)
    row = channels["drive [mm]", "shaft_speed [rad/s]"]
    assert row["steady gain"] == pytest.approx(0.3370, abs=1e-3)
    assert row["gain margin [dB]"] is None  # nothing bounds it
    whole = loadmat(tmp_path / "linear.mat")
    assert whole["A"] == pytest.approx(a)
    assert whole["D"] == pytest.approx(np.array(told["D"]))
    assert [str(name[0]) for name in whole["states"][0]] == told["states"]
    assert (tmp_path / "bode.png").stat().st_size > 20_000


def test_margins_are_of_negative_feedback(shaftline: Command, tmp_path: Path) -> None:
    """From pitch to shaft speed the steady gain is negative, and a gain of -1 is what holds it."""
    ask = ("--drive", 22, "--pitch", 1.4, "--output", "shaft_speed")
    assert shaftline("linearise", *ask, "--out", tmp_path).exit_code == 0
    told = json.loads((tmp_path / "linear.json").read_text())
    channels = {(row["from"], row["to"]): row for row in told["channels"]}
    row = channels["pitch_command [-]", "shaft_speed [rad/s]"]
    assert row["steady gain"] < 0.0
    assert 0.0 < row["phase margin [deg]"] < 90.0


@pytest.mark.parametrize("name", ship_names())
def test_every_input_and_output_has_a_unit(name: str) -> None:
    ship = load_ship(name)
    asked = ("drive", "pitch_command", "inflow", "resistance_factor", "shaft_speed", "thrust")
    assert "SI" not in {unit_of(quantity, ship) for quantity in asked}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "give either --speed or --drive"),
        (("--speed", 5, "--drive", 20), "give either --speed or --drive"),
        (("--speed", 50), "no drive command holds a speed of 50"),
        (("--drive", 22, "--output", "sped"), "unknown output 'sped'; known: "),
        (("--drive", 22, "--output", ","), "give at least one output"),
        (("--drive", 0.1), "steady state"),
        (("--ship", "unknown", "--drive", 1), "unknown ship 'unknown'"),
    ],
)
def test_what_cannot_be_is_refused(
    shaftline: Command, tmp_path: Path, arguments: tuple[object, ...], told: str
) -> None:
    result = shaftline("linearise", *arguments, "--out", tmp_path / "lin")
    refused(result, told)
    nothing_written(tmp_path)
