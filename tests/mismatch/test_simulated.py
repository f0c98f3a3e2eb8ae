"""What a newcomer tries first: a load case of a ship of the package, given back to the diagnosis."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch import diagnose, identify
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import signal_columns
from shaftline.plant.load_cases import get_case
from shaftline.plant.ship_files import template


def written(ship: str | Ship, case: str, folder: Path) -> Path:
    """The file that ``shaftline simulate`` makes of a case."""
    vessel = load_ship(ship)
    file = folder / f"{vessel.name}-{case}.csv"
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
        # straight courses: sway and yaw are 0 to the last digit
        pytest.param("frigate-turning", "jonswap", marks=pytest.mark.slow),
        ("ddg-51-surrogate", "jonswap"),
        (
            "esso-osaka",
            "inflow_sine_high",
        ),  # led at one speed, a rudder at 0: not the one the other
        ("rov-thruster", "inflow_sine_low"),  # torque and current tell the same to ten digits
    ],
)
def test_any_case_is_judged(ship: str, case: str, tmp_path: Path) -> None:
    found = diagnose(load_ship(ship), written(ship, case, tmp_path)).to_dict()
    assert found["verdict"] in ("nothing-missing", "unexplained", "explained")


def test_a_step_in_one_quarter_is_fitted_and_tells_friction_from_the_motor(tmp_path: Path) -> None:
    """The quarter with the only step is not held out; without it friction is not identifiable."""
    ship = template("electric-fixed-pitch")
    recording = written(ship, "rack_step", tmp_path)
    found = identify(ship, recording)
    assert [*found.left_out] == ["hull.thrust_deduction"]
    friction = "transmission.coulomb_friction_engine_side_N_m"
    for key in ("hull.mass_kg", "prime_mover.motor_constant_V_s_rad", friction):
        assert found.parameters[key] == pytest.approx(ship.parameter(key).value, rel=1e-3)
