from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.baselines.registry import tunable
from shaftline.cli.list_command import effects, observers
from shaftline.mismatch import catalogue
from shaftline.plant import equilibrium, load_ship
from shaftline.plant.columns import signal_columns
from shaftline.plant.load_cases import CASES

from .conftest import Command

RECORDED = [
    "time_s",
    "fuel_rack_mm",
    "pitch_ratio_command",
    "pitch_ratio",
    "shaft_speed_rad_s",
    "shaft_torque_N_m",
    "ship_speed_m_s",
]


def recording(folder: Path, **changes: tuple[int, object]) -> Path:
    """A minute at 10 Hz: the rack steps from 20 to 25 mm after 10 s."""
    time = np.arange(600) * 0.1
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": np.where(time < 10.0, 20.0, 25.0),
            "pitch_ratio_command": 1.2,
        }
    )
    for column, (row, value) in changes.items():
        table[column] = table[column].astype(object)
        table.loc[row, column] = value
    path = folder / "recording.csv"
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    "command",
    [
        (),
        ("tour",),
        ("simulate",),
        ("reproduce",),
        ("diagnose",),
        ("validate",),
        ("list",),
        ("new-ship",),
    ],
)
def test_help_teaches(shaftline: Command, command: tuple[str, ...]) -> None:
    result = shaftline(*command, "--help")
    assert result.exit_code == 0
    assert len(result.output.splitlines()) > 5


def test_list_names_what_there_is(shaftline: Command) -> None:
    output = shaftline("list").output
    for name in ("frigate", "tito-neri-sine", "state-5", "jonswap", "immersion-invariance-high"):
        assert name in output


def test_list_fits_a_hundred_columns_and_describes_every_name(shaftline: Command) -> None:
    output = shaftline("list").output
    assert max(map(len, output.splitlines())) <= 100
    for name, description, _ in observers().itertuples(index=False):
        assert name in output
        assert len(description) > 20
    assert all(len(one.lacks) > 5 for one in catalogue())
    assert "Give no estimate (0 m/s, never valid)" in output


def test_list_of_controllers_shows_the_tuning_ranges_of_one(shaftline: Command) -> None:
    output = shaftline("list", "--controllers").output
    assert "va-pitch-silent" in output
    assert "track-keeper" in output
    assert "state-5" not in output
    for name in ("va-pitch", "track-keeper"):
        output = shaftline("list", "--controllers", name).output
        rows = [line.split() for line in output.splitlines()]
        for option, (low, high) in tunable(name).items():
            assert [option, f"{low:g}", f"{high:g}"] in rows


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("va-pitch",), "a name needs --controllers"),
        (("--controllers", "pilot"), "unknown controller 'pilot'; known: combinator"),
        (("--controllers", "--effects"), "give either --controllers or --effects"),
    ],
)
def test_list_refuses_what_it_cannot_show(
    shaftline: Command, arguments: tuple[str, ...], words: str
) -> None:
    result = shaftline("list", *arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())


def test_list_of_effects_tells_what_a_diagnosis_knows(shaftline: Command) -> None:
    output = shaftline("list", "--effects").output
    for effect in catalogue():
        assert effect.id in output
    assert "state-5" not in output


def test_list_of_effects_tells_terms_by_form_and_number() -> None:
    table = effects().set_index(["effect", "balance", "form"])
    assert len(table) == len(catalogue())
    band = table.loc[("pitch-dead-band", "pitch-actuator", "stops-inside")]
    assert band["parameters"] == "b [-], >= 0 and <= 0.5; r [-], >= 0 and <= 1"
    assert table.loc[("wind", "hull", ""), "parameters"] == "k [N s2/m2]"  # of any sign and size
    lag = table.loc[("engine-torque-lag", "engine", ""), "parameters"]
    assert lag == "prime_mover.lag_s [s], >= 0 and <= 30"


def test_tour_writes_its_pictures(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline("tour", "--out", tmp_path)
    assert result.exit_code == 0
    assert (tmp_path / "seaway.png").stat().st_size > 20_000
    assert (tmp_path / "tito-neri.png").stat().st_size > 20_000
    assert "balance differs most" in result.output


def test_simulate_drives_a_ship_with_a_recording(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "simulate",
        "--ship",
        "frigate",
        "--inputs",
        recording(tmp_path),
        "--out",
        tmp_path / "s.csv",
    )
    assert result.exit_code == 0
    table = pd.read_csv(tmp_path / "s.csv")
    assert list(table.columns)[:5] == RECORDED[:5]
    assert {*RECORDED} <= {*table.columns}
    assert {*signal_columns(load_ship("frigate"))} <= set(table.columns)
    assert len(table) == 600
    start = equilibrium(load_ship("frigate"), 20.0, 1.2)
    assert table["shaft_speed_rad_s"][:100].to_numpy() == pytest.approx(start.state.shaft_speed)
    assert table["shaft_speed_rad_s"].iloc[-1] > 1.05 * start.state.shaft_speed
    # the torque follows the rack at once, the speed does not
    assert table["shaft_torque_N_m"][100] > 1.05 * table["shaft_torque_N_m"][99]


def test_simulate_starts_where_the_recording_starts(shaftline: Command, tmp_path: Path) -> None:
    path = recording(tmp_path)
    table = pd.read_csv(path).assign(pitch_ratio=1.0, shaft_speed_rad_s=8.0, ship_speed_m_s=6.0)
    table.to_csv(path, index=False)
    shaftline("simulate", "--inputs", path, "--out", tmp_path / "s.csv")
    first = pd.read_csv(tmp_path / "s.csv").iloc[0]
    assert (first["pitch_ratio"], first["shaft_speed_rad_s"], first["ship_speed_m_s"]) == (1, 8, 6)


def test_simulating_the_output_again_gives_it_again(shaftline: Command, tmp_path: Path) -> None:
    first, second = tmp_path / "1.csv", tmp_path / "2.csv"
    shaftline("simulate", "--inputs", recording(tmp_path), "--out", first)
    shaftline("simulate", "--inputs", first, "--out", second)
    pd.testing.assert_frame_equal(pd.read_csv(first), pd.read_csv(second), rtol=1e-6)


def test_simulate_drives_a_dc_motor(shaftline: Command, tmp_path: Path) -> None:
    path = tmp_path / "motor.csv"
    pd.DataFrame(
        {
            "time_s": np.arange(40) * 0.01,
            "motor_voltage_V": np.repeat([3.91, 7.87], 20),
            "motor_current_A": 0.0,
        }
    ).to_csv(path, index=False)
    out = tmp_path / "s.csv"
    assert (
        shaftline("simulate", "--ship", "tito-neri-sine", "--inputs", path, "--out", out).exit_code
        == 0
    )
    table = pd.read_csv(out)
    assert table["motor_current_A"][21] > 2.0 * table["motor_current_A"][20]  # inrush
    assert table["shaft_speed_rad_s"][39] > 1.5 * table["shaft_speed_rad_s"][20]


@pytest.mark.parametrize("case", CASES)
def test_every_load_case_runs(shaftline: Command, tmp_path: Path, case: str) -> None:
    out, picture = tmp_path / "case.csv", tmp_path / "case.png"
    result = shaftline("simulate", "--case", case, "--out", out, "--figure", picture)
    assert result.exit_code == 0
    table = pd.read_csv(out)
    assert np.isfinite(table.to_numpy()).all()
    assert np.ptp(table["advance_velocity_m_s"]) > 0.1
    assert picture.stat().st_size > 10_000


def test_the_noisy_case_has_noisy_readings(shaftline: Command, tmp_path: Path) -> None:
    tables = []
    for case in ("inflow_sine_high", "measurement_noise"):
        shaftline("simulate", "--case", case, "--out", tmp_path / "case.csv", "--seed", 3)
        tables.append(pd.read_csv(tmp_path / "case.csv"))
    clean, noisy = tables
    error = noisy["shaft_speed_rad_s"] - clean["shaft_speed_rad_s"]
    assert error.std() == pytest.approx(0.01 * clean["shaft_speed_rad_s"].mean(), rel=0.1)
    assert (noisy["advance_velocity_m_s"] == clean["advance_velocity_m_s"]).all()


def test_an_observer_follows_a_driven_ship_through_a_sea(
    shaftline: Command, tmp_path: Path
) -> None:
    out = tmp_path / "s.csv"
    result = shaftline(
        "simulate",
        "--inputs",
        recording(tmp_path),
        "--sea",
        "state-4",
        "--out",
        out,
        "--observer",
        "immersion-invariance",
        "--tuning",
        "high",
    )
    assert result.exit_code == 0
    table = pd.read_csv(out)
    assert list(table.columns)[:5] == RECORDED[:5]
    assert {*RECORDED} <= {*table.columns}
    assert list(table.columns)[-2:] == ["estimated_advance_velocity_m_s", "estimate_valid"]
    assert table["estimate_valid"].mean() > 0.99
    wake = 0.95 * table["ship_speed_m_s"]
    swell = table["estimated_advance_velocity_m_s"] - wake
    assert 0.05 < swell[100:].std() < 1.0
    assert abs(swell[100:].mean()) < 0.1


def test_reproduce_writes_numbers_by_the_published_names(
    shaftline: Command, tmp_path: Path
) -> None:
    out = tmp_path / "numbers.json"
    result = shaftline("reproduce", "working-points", "--json", out, "--out", tmp_path)
    assert result.exit_code == 0
    numbers = json.loads(out.read_text())["working-points"]
    assert set(numbers) == {"A", "B", "C", "D", "base"}
    assert numbers["base"]["shaft_speed_rad_s"] == pytest.approx(10.51, abs=0.02)
    assert numbers["base"]["ship_speed_m_s"] == pytest.approx(8.73, abs=0.04)
    assert "10.51" in result.output
    assert (tmp_path / "working-points.md").is_file()
    assert (tmp_path / "working-points.csv").is_file()


def test_reference_page_is_up_to_date(shaftline: Command, tmp_path: Path) -> None:
    shaftline("list", "--markdown", tmp_path / "reference.md")
    page = Path(__file__).parents[2] / "docs" / "reference.md"
    assert page.read_text() == (tmp_path / "reference.md").read_text(), "run `make docs`"


def test_a_new_ship_is_printed_or_written(shaftline: Command, tmp_path: Path) -> None:
    printed = shaftline("new-ship", "--template", "drive-with-load")
    assert printed.exit_code == 0
    assert 'name = "drive-with-load"' in printed.output
    out = tmp_path / "servo.toml"
    result = shaftline("new-ship", "--template", "drive-with-load", "--out", str(out))
    assert result.exit_code == 0
    assert load_ship(out).name == "servo"
    before = out.read_text()
    again = shaftline("new-ship", "--template", "electric-fixed-pitch", "--out", str(out))
    assert again.exit_code == 2
    assert "the file already exists; nothing was written" in again.output
    assert out.read_text() == before


@pytest.mark.parametrize(
    ("name", "out", "words"),
    [
        (
            "yacht",
            "y.toml",
            "unknown template 'yacht'; known templates: constant-revolutions, diesel",
        ),
        ("drive-with-load", "y.txt", "the name of a ship file must end in .toml"),
    ],
)
def test_a_new_ship_that_cannot_be_made_is_named(
    shaftline: Command, tmp_path: Path, name: str, out: str, words: str
) -> None:
    result = shaftline("new-ship", "--template", name, "--out", str(tmp_path / out))
    assert result.exit_code == 2
    assert words in result.output
    assert not list(tmp_path.iterdir())
