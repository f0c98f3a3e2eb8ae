"""What a newcomer tries first: a load case of a ship of the package, given back to the diagnosis."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch import diagnose
from shaftline.plant import load_ship
from shaftline.plant.columns import signal_columns
from shaftline.studies.thesis.load_cases import get_case


def written(ship: str, case: str, folder: Path) -> Path:
    """The file that ``shaftline simulate`` makes of a case."""
    vessel, file = load_ship(ship), folder / f"{ship}-{case}.csv"
    samples = get_case(case).run(vessel, seed=0)
    table = pd.DataFrame({c: samples[s] for c, s in signal_columns(vessel).items()})
    table.to_csv(file, index=False, float_format="%.10g")
    return file


@pytest.mark.parametrize("ship", ["towing-tank", "rov-thruster"])
def test_a_step_of_the_drive_lacks_nothing(ship: str, tmp_path: Path) -> None:
    """The towing tank's torque has steps of a hundred millionth, which are its last digit."""
    found = diagnose(load_ship(ship), written(ship, "rack_step", tmp_path))
    assert found.to_dict()["verdict"] == "nothing-missing"


@pytest.mark.parametrize(
    ("ship", "case"),
    [
        ("frigate-turning", "jonswap"),  # a straight course: sway and yaw are 0 to the last digit
        (
            "esso-osaka",
            "inflow_sine_high",
        ),  # led at one speed, a rudder at 0: not the one the other
        ("rov-thruster", "inflow_sine_low"),  # torque and current tell the same to ten digits
        ("ddg-51-surrogate", "jonswap"),
    ],
)
def test_any_case_is_judged(ship: str, case: str, tmp_path: Path) -> None:
    found = diagnose(load_ship(ship), written(ship, case, tmp_path)).to_dict()
    assert found["verdict"] in ("nothing-missing", "unexplained", "explained")
