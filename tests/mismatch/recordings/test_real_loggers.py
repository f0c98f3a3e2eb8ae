"""Drafted column maps and remarks on public recordings, where the folder SHAFTLINE_DATA has them."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd
import pytest

from reproductions.emps.runs import rig
from reproductions.esso_osaka_model.turning import turning_ship
from shaftline.mismatch.recordings.survey import Survey, survey
from shaftline.plant import Ship, load_ship


def folder(name: str) -> Path:
    found = Path(os.environ.get("SHAFTLINE_DATA", "")) / "recordings" / name
    if "SHAFTLINE_DATA" not in os.environ or not found.is_dir():
        pytest.skip(f"needs recordings/{name} in the folder SHAFTLINE_DATA (docs/recordings.md)")
    return found


def drafted(file: Path, ship: Ship, to: Path) -> tuple[Survey, str]:
    """Survey a file by the map that is drafted for it."""
    lines = "\n".join(survey(file, ship).begin)
    (to / "map.toml").write_text(lines, encoding="utf-8")
    found = survey(file, ship, to / "map.toml")
    assert found.recording is not None, f"{file.name}: {found.refused}\n{lines}"
    return found, lines


def servo(to: Path) -> Ship:
    """Load the servo, whose gravity depends on the simulated angle."""
    text = (folder("servo_pendulum") / "ship.toml").read_text()
    text = text.replace('[signals]\npendulum_angle = "rad"\n', "")
    (to / "servo.toml").write_text(text.replace("pendulum_angle", "shaft_angle"))
    return load_ship(to / "servo.toml")


def test_servo_sticks(tmp_path: Path) -> None:
    ship = servo(tmp_path)
    files = sorted(folder("servo_pendulum").glob("*.csv"))
    assert len(files) == 12
    for file in files:
        found, lines = drafted(file, ship, tmp_path)
        assert '# also possible as shaft_angle_rad: "pendulum_angle" (no unit)' in lines
        assert found.recording is not None
        assert not any("stopped there" in said for said in found.recording.warnings)
    found, _ = drafted(folder("servo_pendulum") / "kp200_sin_sin_v.csv", ship, tmp_path)
    assert found.recording is not None
    (said,) = (said for said in found.recording.warnings if "does not change" in said)
    assert "144 rows (0.72 s) from row 358 and continues from the same value" in said
    assert (
        "motor_voltage_V lies between 1.272 and 4.819 V: static friction may hold the machine"
        in said
    )


def test_generator(tmp_path: Path) -> None:
    there = folder("dc_motor_generator")
    found, lines = drafted(there / "data.csv", load_ship(there / "ship.toml"), tmp_path)
    assert "if it counts rows, add scale = seconds per row" in lines
    assert (
        '"speed_raw" = { column = "shaft_speed_rad_s", unit = "rpm" }  # unit not stated' in lines
    )
    assert any(said.startswith("shaft_speed_rad_s lags the simulation") for said in found.remarks)


def test_positioning_system(tmp_path: Path) -> None:
    for file in sorted(folder("emps").glob("*.csv")):
        _, lines = drafted(file, rig(), tmp_path)
        assert '"position_m" = { column = "shaft_angle_rad", unit = "m", radius_m = 1.0 }' in lines


def test_model_tanker(tmp_path: Path) -> None:
    ship = turning_ship()
    for file in sorted(folder("esso_osaka").glob("turn*.csv")):
        found, lines = drafted(file, ship, tmp_path)
        assert '"n_prop [rps]" = { column = "shaft_speed_rad_s", unit = "rps" }' in lines
        assert any("rudder_rad is quantised" in said for said in found.remarks)


def test_propeller_in_flight(tmp_path: Path) -> None:
    there = folder("propeller_inflow")
    text = (there / "ship.toml").read_text().replace("= 700.0", "= 1000.0")
    (tmp_path / "ship.toml").write_text(text)
    _, lines = drafted(there / "flight_10Hz.csv", load_ship(tmp_path / "ship.toml"), tmp_path)
    assert '"airspeed_mps" = { column = "inflow_velocity_m_s", unit = "m/s" }' in lines


def test_a_tachometer_without_sign(tmp_path: Path) -> None:
    """The thruster's tachometer gave a magnitude; its sign was restored in the files."""
    table = pd.read_csv(folder("rov_thruster") / "closed_loop_lookup_ramp.csv")
    table["shaft_speed_rad_s"] = table["shaft_speed_rad_s"].abs()
    table.to_csv(tmp_path / "r.csv", index=False)
    found = survey(tmp_path / "r.csv", load_ship("rov-thruster"))
    assert any(said.startswith("shaft_speed_rad_s looks rectified") for said in found.remarks)
