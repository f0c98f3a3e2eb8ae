"""``trial``, ``performance``, ``export`` and ``new-ship --from-particulars``: results and refusals."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from shaftline.cli.main import app
from shaftline.plant.surroundings import KNOT

from ..mismatch.service_logs import fouled_log

SHIP = """\
name = "tanker"
mcr_kW = 27000
propulsive_efficiency = 0.75
[hull]
length_m = 320
beam_m = 58
draught_m = 20.8
displacement_m3 = 312622
midship_coefficient = 0.998
waterplane_coefficient = 0.9
lcb_percent = 3.5
"""
RUNS = """\
start;HDG (deg);SOG [kn];Power [kW]
01.05.2026 08:00;20;15,1;16000
01.05.2026 09:15;200;14,2;16100
01.05.2026 10:30;20;16,4;22000
01.05.2026 11:45;200;15,7;22100
"""
LOG = "Date;STW [kn];Power [kW]\n" + "".join(
    f"{1 + k % 28:02d}.{1 + k // 28:02d}.2026;11,8;6000\n" for k in range(56)
)
REFERENCE = """\
name = "bulk carrier"
beam_m = 32
draught_m = 10
speed_kn = [8, 12, 16]
power_kW = [1570, 6000, 15500]
"""
PARTICULARS = """\
name = "ferry"
length_m = 150.0
beam_m = 25.0
draught_m = 6.0
displacement_t = 13500.0
design_speed_kn = 21.0
shafts = 2
mcr_kW = 10000.0
engine_speed_rpm = 500.0
shaft_speed_rpm = 140.0
propeller_diameter_m = 4.6
controllable_pitch = true
"""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(one) for one in arguments])


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (
        ("ship.toml", SHIP),
        ("runs.csv", RUNS),
        ("log.csv", LOG),
        ("reference.toml", REFERENCE),
        ("particulars.toml", PARTICULARS),
    ):
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_trial_prints_speeds_and_writes_its_files(files: Path) -> None:
    out = files / "out"
    result = run(
        "trial", files / "runs.csv", "--ship", files / "ship.toml", "--speed", 15, "--out", out
    )
    assert result.exit_code == 0, result.output
    assert "at 20250 kW" in result.output
    assert "no wind correction" in result.output
    report = json.loads((out / "report.json").read_text())
    assert report["method"] == "mean of means"
    assert 14.6 < report["runs"][0]["corrected_speed_kn"] < 14.7
    assert 15.0 < report["speed_at_power"][0]["speed_kn"] < 16.1
    assert {file.name for file in out.iterdir()} == {
        "runs.csv",
        "curve.csv",
        "report.json",
        "reference.toml",
        "speed-power.png",
    }


def test_a_trial_from_a_log_names_the_runs_it_found(files: Path) -> None:
    legs = [
        (20, 15.1, 16000),
        (110, 14.0, 15900),
        (200, 14.2, 16100),
        (20, 16.4, 22000),
        (200, 15.7, 22100),
    ]
    rows = [row for row in legs for _ in range(15)]
    clocks = pd.date_range("2026-05-01 08:00", periods=len(rows), freq="2min")
    table = pd.DataFrame(rows, columns=["HDG (deg)", "SOG [kn]", "Power [kW]"])
    table.insert(0, "time", clocks.strftime("%d.%m.%Y %H:%M"))
    log = files / "trial.csv"
    table.to_csv(log, index=False, sep=";", decimal=",")
    line = ("trial", log, "--ship", files / "ship.toml", "--out", files / "out")
    result = run(*line, "--from-log", 20)
    assert result.exit_code == 0, result.output
    assert "run 1: 2026-05-01 08:10 to 2026-05-01 08:30, heading 20 deg, 15.1 kn" in result.output
    assert result.output.count("left out, no run on the reciprocal course") == 1
    report = json.loads((files / "out/report.json").read_text())
    assert [row["heading_deg"] for row in report["runs"]] == pytest.approx([20, 200, 20, 200])
    powers = [row["shaft_power_kW"] for row in report["runs"]]
    assert powers == pytest.approx([16000, 16100, 22000, 22100])
    refused = run(*line)
    assert refused.exit_code == 2
    assert "a log of the whole trial needs --from-log 10" in " ".join(refused.output.split())


def test_performance_prints_periods_and_writes_its_files(files: Path) -> None:
    out = files / "out"
    result = run("performance", files / "log.csv", "--ship", files / "reference.toml", "--out", out)
    assert result.exit_code == 0, result.output
    report = json.loads((out / "report.json").read_text())
    assert report["periods"][0]["speed_loss_percent"] == pytest.approx(
        100 * (11.8 / 12 - 1), abs=1e-6
    )
    assert report["periods"][0]["from"] == "2026-01-01"
    assert (out / "speed-loss.png").stat().st_size > 5000


COLUMNS = """\
[columns]
"Date" = { column = "time_s", unit = "datetime" }
"STW [kn]" = { column = "ship_speed_m_s", unit = "knot" }
"rack" = "fuel_rack_mm"
"pitch order" = "pitch_ratio_command"
"pitch" = "pitch_ratio"
"rpm" = { column = "shaft_speed_rad_s", unit = "rpm" }
"torque" = "shaft_torque_N_m"
"""


def explained(files: Path, log: pd.DataFrame, parts: int = 1) -> str:
    """Return the output of ``performance`` with a plant for a log of the ferry, in several files."""
    power = 2e-3 * log["shaft_torque_N_m"] * log["shaft_speed_rad_s"]
    stamps = pd.Timestamp("2025-03-01") + pd.to_timedelta(log["time_s"], unit="s")
    table = pd.DataFrame(
        {
            "Date": stamps.dt.strftime("%d.%m.%Y %H:%M:%S"),
            "STW [kn]": log["ship_speed_m_s"] / KNOT,
            "Power [kW]": power,
            "rack": log["fuel_rack_mm"],
            "pitch order": log["pitch_ratio_command"],
            "pitch": log["pitch_ratio"],
            "rpm": 30.0 / math.pi * log["shaft_speed_rad_s"],
            "torque": log["shaft_torque_N_m"],
        }
    )
    (files / "logs").mkdir()
    for k in range(parts):
        own = table[k * len(table) // parts : (k + 1) * len(table) // parts]
        own.to_csv(files / f"logs/{k}.csv", sep=";", decimal=",", index=False)
    (files / "map.toml").write_text(COLUMNS)
    (files / "ferry.toml").write_text(
        'name = "ferry"\nbeam_m = 25\ndraught_m = 6\nspeed_kn = [2, 8, 16]\n'
        "power_kW = [0.375, 24, 192]\n"
    )
    result = run(
        "performance",
        files / ("logs/0.csv" if parts == 1 else "logs"),
        "--ship",
        files / "ferry.toml",
        "--plant",
        "ferry",
        "--columns",
        files / "map.toml",
        "--out",
        files / "out",
    )
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


def test_performance_names_the_cause_of_a_speed_loss(files: Path) -> None:
    assert "from 2025-03-21: Explained by hull fouling." in explained(files, fouled_log(), parts=2)
    out = files / "out"
    first, second = json.loads((out / "report.json").read_text())["periods"]
    assert "cause" not in first
    assert second["cause"] == "Explained by hull fouling."
    diagnosis = json.loads((out / second["diagnosis"]).read_text())
    assert diagnosis["effects"][0]["id"] == "hull-fouling"


def test_a_log_without_an_event_keeps_its_speed_loss(files: Path) -> None:
    output = explained(files, fouled_log().head(480))
    assert "note: no physical cause: the log has one period without an event" in output
    (only,) = json.loads((files / "out/report.json").read_text())["periods"]
    assert "cause" not in only


def test_a_ship_from_particulars_is_a_ship_file(files: Path) -> None:
    ship = files / "ferry.toml"
    assert (
        run("new-ship", "--from-particulars", files / "particulars.toml", "--out", ship).exit_code
        == 0
    )
    point = ("--speed", 9, "--output", "shaft_speed")
    linear = run("linearise", "--ship", ship, *point, "--out", files / "linear")
    assert linear.exit_code == 0, linear.output


def test_a_pitch_that_does_not_suit_the_engine_is_said(files: Path) -> None:
    heavy = files / "heavy.toml"
    text = (files / "particulars.toml").read_text()
    heavy.write_text(text.replace("controllable_pitch = true", "") + "\npitch_ratio = 0.6\n")
    made = run("new-ship", "--from-particulars", heavy, "--out", files / "heavy_ship.toml")
    assert made.exit_code == 0, made.output
    assert "remark: with P/D 0.6 " in made.output


def test_a_policy_is_exported(files: Path) -> None:
    result = run("export", "storm", "--out", files / "storm.c")
    assert result.exit_code == 0, result.output
    assert "void storm_step(" in (files / "storm.c").read_text()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("trial", "log.csv", "--ship", "ship.toml"), "no column is read as heading"),
        (("trial", "runs.csv", "--ship", "reference.toml"), "hull is missing"),
        (("trial", "none.csv", "--ship", "ship.toml"), "none.csv"),
        (
            ("performance", "runs.csv", "--ship", "reference.toml"),
            "no column is read as speed_through_water",
        ),
        (("performance", "log.csv", "--ship", "ship.toml"), "beam_m is missing"),
        (
            ("performance", "log.csv", "--ship", "reference.toml", "--columns", "map.toml"),
            "--columns: has an effect with --plant only; give --plant SHIP as well",
        ),
        (
            ("performance", "log.csv", "--ship", "reference.toml", "--plant", "ferry"),
            "fuel_rack_mm",
        ),
        (("export", "storm", "--out", "storm.txt"), "must end in .c"),
        (("export", "calm", "--out", "calm.c"), "no such policy file"),
        (("new-ship",), "give either --template or --from-particulars"),
        (("new-ship", "--from-particulars", "reference.toml"), "length_m is missing"),
    ],
)
def test_input_that_cannot_be_used_ends_with_its_reason(
    arguments: tuple[str, ...], reason: str, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files)
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert reason in " ".join(result.output.split())
