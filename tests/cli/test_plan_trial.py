"""From the alternatives of a diagnosis to commands that ``simulate`` takes."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from shaftline.plant import load_ship
from shaftline.plant.ship_files import write_ship

from .conftest import Command

NOISE = {"ship_speed_m_s": 0.05, "shaft_speed_rad_s": 0.02}


def test_the_alternatives_of_a_report_are_planned_for(shaftline: Command, tmp_path: Path) -> None:
    """The report is written by hand, because a diagnosis with alternatives takes half a minute."""
    quick = load_ship("frigate").with_values({"integration.time_step_s": 0.25})
    fouled = quick.with_values({"hull.fouling_fraction": 0.1})
    slow_log = quick.with_values({"sensors.speed_log_gain": 0.96})
    write_ship(fouled, tmp_path / "corrected_ship.toml")
    write_ship(slow_log, tmp_path / "alternatives/speed-log-gain-sensor.toml")
    report = {
        "alternatives": {"speed-log-gain (sensor)": "alternatives/speed-log-gain-sensor.toml"},
        "hidden": {},
        "effects": [],
        "noise": {column: {"sd": sd, "correlation_s": 2.0} for column, sd in NOISE.items()},
    }
    (tmp_path / "report.json").write_text(json.dumps(report))
    (tmp_path / "limits.toml").write_text("drive = [14.0, 24.0]\npitch_ratio = [1.1, 1.3]\n")
    out = tmp_path / "plan"
    result = shaftline(
        "plan-trial",
        tmp_path / "report.json",
        "--minutes",
        5,
        "--out",
        out,
        "--limits",
        tmp_path / "limits.toml",
    )
    assert result.exit_code == 0, result.output
    assert "corrected ship or speed-log-gain (sensor):" in " ".join(result.output.split())
    plan = pd.read_csv(out / "plan.csv")
    assert len(plan) == 300
    assert plan["fuel_rack_mm"].between(14.0, 24.0).all()
    (pair,) = json.loads((out / "plan.json").read_text())["pairs"]
    assert pair["expected_2logL"] > 0.0
    again = tmp_path / "again.csv"
    ship = ("--ship", tmp_path / "corrected_ship.toml")
    simulated = shaftline("simulate", *ship, "--inputs", out / "plan.csv", "--out", again)
    assert simulated.exit_code == 0, simulated.output
    assert len(pd.read_csv(again)) == 300
