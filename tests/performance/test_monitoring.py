"""Speed loss over years: logs of a ship with concealed fouling, cleanings and wind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.performance import (
    PerformanceReport,
    ReferenceShip,
    TableError,
    analyse_performance,
    canonical_log,
    load_reference_ship,
    read_log,
)
from shaftline.performance.monitoring import (
    DAY_S,
    SHORTEST_DAYS,
    change_points,
    filters,
    step_between,
    still_air_power,
)
from shaftline.performance.monitoring_report import periods_table, save_performance

SPEEDS = np.arange(7.0, 18.0)
EXPONENT = 3.3
COEFFICIENTS = [0.8, 0.9, 0.5, 0.1, -0.3, -0.6, -0.6]
AIR = {
    "frontal_area_m2": 600.0,
    "angle_deg": [0, 30, 60, 90, 120, 150, 180],
    "coefficient": COEFFICIENTS,
}
SHIP: dict[str, Any] = {
    "name": "bulk carrier",
    "beam_m": 32.0,
    "draught_m": 10.0,
    "speed_kn": SPEEDS.tolist(),
    "power_kW": (6000.0 * (SPEEDS / 12.0) ** EXPONENT).tolist(),
    "superstructure": AIR,
}
KNOT = 1852.0 / 3600.0


def log(
    seed: int, days: int, cleaned: int | None = None, noise: float = 0.03, hours: float = 1.0
) -> pd.DataFrame:
    """A log whose power rises by 8 % a year, and falls to that of a clean hull at a cleaning."""
    generator = np.random.default_rng(seed)
    count = int(days * 24 / hours)
    day = np.arange(count) * hours / 24.0
    speed = np.clip(12.5 + generator.normal(0.0, 1.2, count), 8.0, 16.0)
    since = day if cleaned is None else np.where(day < cleaned, day, day - cleaned)
    power = 6000.0 * (speed / 12.0) ** EXPONENT * (1.0 + 0.08 * since / 365.25)
    wind, angle = generator.rayleigh(4.0, count), generator.uniform(-np.pi, np.pi, count)
    ahead, aside = speed * KNOT + wind * np.cos(angle), wind * np.sin(angle)
    seen, from_bow = np.hypot(ahead, aside), np.arctan2(aside, ahead)
    drag = np.interp(np.abs(np.degrees(from_bow)), [0, 30, 60, 90, 120, 150, 180], COEFFICIENTS)
    blown = 0.5 * 1.225 * 600.0 * (drag * seen**2 - 0.8 * (speed * KNOT) ** 2)
    power = (power + blown * speed * KNOT / 0.7 / 1e3) * np.exp(
        noise * generator.standard_normal(count)
    )
    return pd.DataFrame(
        {
            "Date": pd.Timestamp("2024-02-03") + pd.to_timedelta(day, "D"),
            "STW [kn]": speed,
            "Power [kW]": power,
            "wind_speed_m/s": seen,
            "wind_angle_deg": np.degrees(from_bow),
            "water_depth_m": 400.0,
        }
    )


def analyse(folder: Path, table: pd.DataFrame) -> PerformanceReport:
    table.to_csv(folder / "log.csv", index=False)
    return analyse_performance(ReferenceShip.model_validate(SHIP), read_log(folder / "log.csv"))


LOSS_PER_YEAR = -100.0 * 0.08 / EXPONENT
"""Speed loss that 8 % of power a year cost, to first order [% per year]."""


@pytest.mark.parametrize("hours", [1.0, 24.0], ids=["hourly", "noon"])
def test_a_cleaning_is_found_on_its_day_and_the_trend_is_that_of_the_fouling(
    hours: float, tmp_path: Path
) -> None:
    report = analyse(tmp_path, log(5, 700, cleaned=420, hours=hours))
    first, second = report.periods
    assert second.start_s / DAY_S == pytest.approx(420.0, abs=5.0 if hours == 24.0 else 2.0)
    for period in (first, second):
        assert period.slope == pytest.approx(LOSS_PER_YEAR, abs=period.slope_half + 0.15)
    step, half = step_between(first, second)
    lost = 100.0 * (1.0 - (1.0 + 0.08 * 420 / 365.25) ** (-1.0 / EXPONENT))
    assert step == pytest.approx(lost, abs=half + 0.1)
    assert half < 0.5


@pytest.mark.parametrize("seed", range(6))
def test_without_an_event_there_is_one_period(seed: int, tmp_path: Path) -> None:
    report = analyse(tmp_path, log(seed, 400, noise=0.05, hours=2.0))
    assert len(report.periods) == 1
    assert report.periods[0].slope == pytest.approx(LOSS_PER_YEAR, abs=0.6)


def test_the_wind_is_taken_out(tmp_path: Path) -> None:
    table = log(2, 60, noise=0.0)
    with_wind = analyse(tmp_path, table)
    expected = -100.0 * (1.0 - (1.0 + 0.08 * 30 / 365.25) ** (-1.0 / EXPONENT))
    assert with_wind.periods[0].mean == pytest.approx(expected, abs=0.03)
    scatter = with_wind.rows["speed_loss_percent"].std()
    calm = SHIP | {"superstructure": None}
    ship = ReferenceShip.model_validate(calm)
    without = analyse_performance(ship, read_log(tmp_path / "log.csv"))
    assert without.rows["speed_loss_percent"].std() > 2.0 * scatter
    assert "no [superstructure] in the ship file" in without.remarks[0]


def test_each_condition_of_the_standard_leaves_its_rows_out(tmp_path: Path) -> None:
    table = log(3, 40).iloc[:200].copy()
    table["wind_speed_m/s"] = 6.0
    table["wind_angle_deg"] = 0.0
    table["draught_m"], table["rudder_deg"], table["temperature_C"] = 10.0, 1.0, 12.0
    table.loc[3, "wind_speed_m/s"] = 12.5 * KNOT + 12.0
    table.loc[5, "water_depth_m"] = 40.0
    table.loc[7, "temperature_C"] = 1.0
    table.loc[9, "rudder_deg"] = -9.0
    table.loc[11, "draught_m"] = 7.0
    table.loc[13, "Power [kW]"] = np.nan
    table.loc[15, "Power [kW]"] = 50.0
    report = analyse(tmp_path, table)
    assert list(report.rejected.values()) == [1] * 7
    # 3 sqrt(B T) = 53.7 m; 2.75 V^2 / g is 11.6 m at 12.5 kn
    shallow = filters(report.ship, read_log(tmp_path / "log.csv"))["shallow water"]
    assert np.flatnonzero(shallow).tolist() == [5]


def test_the_mean_of_the_draughts_fore_and_aft_is_the_draught(tmp_path: Path) -> None:
    table = log(0, 20).assign(**{"draught_fore_m": 9.6, "draught_aft_m": 10.2})
    table.loc[:99, "draught_fore_m"] = 7.0  # in ballast: 8.6 m of 10 m
    reference, reason = ReferenceShip.model_validate(SHIP), "draught off the reference"
    assert filters(reference, canonical_log(table))[reason].sum() == 100
    assert not any("draught" in remark for remark in analyse(tmp_path, table).remarks)
    table["draught_m"] = 10.0  # a measured mean is used before that of both ends
    assert filters(reference, canonical_log(table))[reason].sum() == 0


def test_a_log_without_wind_keeps_its_power(tmp_path: Path) -> None:
    table = log(4, 30)[["Date", "STW [kn]", "Power [kW]"]]
    report = analyse(tmp_path, table)
    power = still_air_power(report.ship, read_log(tmp_path / "log.csv"))
    assert power == pytest.approx(table["Power [kW]"].to_numpy() * 1e3, rel=1e-9)
    assert report.remarks[0] == "no wind in the log: neither filtered nor corrected"


def test_change_points_of_a_step_without_noise_are_exact() -> None:
    time = np.arange(100.0) * DAY_S
    loss = np.where(np.arange(100) < 37, -1.0, 0.5) + 1e-3 * np.sin(np.arange(100) * 7.0)
    assert change_points(time, loss) == [(0, 37), (37, 100)]
    assert change_points(time[: 2 * SHORTEST_DAYS - 1], loss[: 2 * SHORTEST_DAYS - 1]) == [(0, 19)]


@pytest.mark.parametrize(
    ("stamps", "second_s"),
    [
        (["03.02.2024 00:00:00", "04.02.2024 00:00:00"], DAY_S),
        (["2024-02-03 00:00", "2024-02-03 06:00"], 0.25 * DAY_S),
        (["13/02/2024", "14/02/2024"], DAY_S),
    ],
)
def test_dates_of_loggers_are_read(stamps: list[str], second_s: float, tmp_path: Path) -> None:
    table = pd.DataFrame({"Date": stamps, "STW [kn]": 12.0, "Power [kW]": 6000.0})
    table.to_csv(tmp_path / "log.csv", index=False)
    assert read_log(tmp_path / "log.csv")["time"].tolist() == [0.0, second_s]


def test_a_log_off_the_reference_curve_is_refused_with_the_reasons(tmp_path: Path) -> None:
    table = log(1, 20)
    table["Power [kW]"] *= 12.0
    with pytest.raises(TableError, match=r"none of the 480 rows .* outside the reference curve: "):
        analyse(tmp_path, table)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"power_kW": [1.0, 2.0]}, "speed_kn has 11 values and power_kW 2; they must be pairs"),
        (
            {"speed_kn": [2.0, 1.0], "power_kW": [1.0, 2.0]},
            "speed_kn must rise from a value above 0",
        ),
        ({"draft": 3.0}, "draft is not a known key"),
    ],
)
def test_a_ship_file_that_is_wrong_is_refused(
    keys: dict[str, Any], reason: str, tmp_path: Path
) -> None:
    tree = {key: value for key, value in (SHIP | keys).items() if key != "superstructure"}
    file = tmp_path / "ship.toml"
    file.write_text("".join(f"{key} = {value!r}\n" for key, value in tree.items()))
    with pytest.raises(TableError, match=reason):
        load_reference_ship(file)


def test_the_files_of_a_report(tmp_path: Path) -> None:
    report = analyse(tmp_path, log(5, 700, cleaned=420, hours=6.0))
    found = save_performance(report, tmp_path / "out")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {
        "periods.csv",
        "daily.csv",
        "report.json",
        "speed-loss.png",
    }
    assert found["periods"][0]["step_percent"] is None
    assert periods_table(report)["from"].tolist()[0] == "2024-02-03"


def test_monthly_logs_in_a_folder_are_one_log(tmp_path: Path) -> None:
    """With another separator, in another order of the columns, and with a row that both have."""
    days = pd.date_range("2026-01-20", periods=24, freq="D").strftime("%d.%m.%Y")
    speed = np.linspace(11.0, 12.0, 24)
    whole = pd.DataFrame({"Date": days, "STW [kn]": speed, "Power [kW]": 6000.0})
    whole.to_csv(tmp_path / "whole.csv", index=False)
    folder = tmp_path / "logs"
    folder.mkdir()
    whole[:13].to_csv(folder / "2026-01.csv", index=False)
    turned = whole[12:][["Power [kW]", "Date", "STW [kn]"]]
    turned.to_csv(folder / "2026-02.txt", index=False, sep=";", decimal=",")
    (folder / "readme.md").write_text("no table")
    pd.testing.assert_frame_equal(read_log(folder), read_log(tmp_path / "whole.csv"))
    turned.drop(columns="Power [kW]").to_csv(folder / "2026-03.csv", index=False)
    with pytest.raises(TableError, match=r"2026-03\.csv: other columns than 2026-01\.csv: Power"):
        read_log(folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(TableError, match=r"no table in this folder; expected \.csv"):
        read_log(tmp_path / "empty")
