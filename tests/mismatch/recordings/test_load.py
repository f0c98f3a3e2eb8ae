"""Recordings through every check: what is read, what is kept, what is refused."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import fetch, load_recording
from shaftline.plant import (
    RecordingError,
    Schedule,
    Ship,
    equilibrium,
    load_ship,
    simulate,
    simulate_recording,
)

from .conftest import Load
from .trials import COLUMNS, EFFECTS, NOISE, voyage


def test_a_good_recording_comes_through_unchanged(load: Load, calm: pd.DataFrame) -> None:
    found = load(calm.assign(remark="calm"))
    assert found.channels == tuple(COLUMNS)
    assert found.interval_s == pytest.approx(0.1)
    assert (found.warnings, found.limits, len(found)) == ((), (), len(calm))
    for column in calm:
        np.testing.assert_allclose(found[column], calm[column], rtol=1e-12)
    for column, rms in NOISE.items():
        assert found.noise[column].white_rms == pytest.approx(rms, rel=0.1)
    assert "thrust_N" not in found


def test_parquet_and_csv_are_the_same(frigate: Ship, calm: pd.DataFrame, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    calm.to_parquet(tmp_path / "r.parquet")
    found = load_recording(tmp_path / "r.parquet", frigate)
    pd.testing.assert_frame_equal(found.table, calm)
    (tmp_path / "bad.parquet").write_text("no parquet")
    with pytest.raises(RecordingError, match=r"bad\.parquet: cannot be read as Parquet"):
        load_recording(tmp_path / "bad.parquet", frigate)


@pytest.mark.parametrize("sea", [None, "state-6"])
@pytest.mark.parametrize("effect", EFFECTS)
def test_real_effects_are_not_refused(
    load: Load, frigate: Ship, effect: str, sea: str | None
) -> None:
    found = load(voyage(frigate.with_values(EFFECTS[effect]), sea))
    assert found.warnings == ()


@pytest.mark.parametrize(("rack", "begins"), [(24.0, 8.0), (12.0, 27.0)], ids=["speeds", "slows"])
def test_getting_under_way_is_not_taken_for_a_wrong_unit(
    load: Load, frigate: Ship, calm: pd.DataFrame, rack: float, begins: float
) -> None:
    start = equilibrium(frigate, begins, 1.2).state
    samples = simulate(frigate, Schedule(rack, 1.2), 100.0, initial=start)[:-1:2]
    names = ["measured_pitch_ratio", "shaft_speed", "measured_shaft_torque", "measured_ship_speed"]
    values = dict(zip(NOISE, (samples[name] for name in names), strict=True))
    orders = {"fuel_rack_mm": rack, "pitch_ratio_command": 1.2}
    found = load(pd.DataFrame({"time_s": 0.1 * np.arange(1000)} | orders | values))
    assert any(
        sentence.startswith("insufficient excitation: fuel_rack_mm") for sentence in found.limits
    )


def test_missing_and_empty_are_named(load: Load, calm: pd.DataFrame, tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"column 'shaft_speed_rad_s' is missing; required: time"
    ):
        load(calm.drop(columns="shaft_speed_rad_s"))
    with pytest.raises(RecordingError, match=r"r\.csv: 0 row\(s\)"):
        load(calm.iloc[:0])
    with pytest.raises(RecordingError, match=r"nowhere\.csv: cannot be read"):
        load_recording(tmp_path / "nowhere.csv", load_ship("frigate"))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    """A folder with one recording, on this machine's own network."""
    (tmp_path / "public").mkdir()
    (tmp_path / "public" / "run.csv").write_bytes(b"time_s\n0\n")

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = partial(Quiet, directory=str(tmp_path / "public"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()


def test_fetch_checks_and_keeps(server: str, tmp_path: Path) -> None:
    digest = hashlib.sha256(b"time_s\n0\n").hexdigest()
    checksums = tmp_path / "checksums.txt"
    checksums.write_text(f"# runs\nrun.csv sha256:{digest}\ngone.csv sha256:{digest}\n")
    found = fetch("run.csv", server, checksums, tmp_path / "kept")
    assert found.read_bytes() == b"time_s\n0\n"
    (tmp_path / "public" / "run.csv").unlink()
    assert fetch("run.csv", server, checksums, tmp_path / "kept") == found
    for name in ("gone.csv", "other.csv"):
        with pytest.raises(RecordingError, match=name):
            fetch(name, server, checksums, tmp_path / "kept")


def test_fetch_refuses_what_was_changed(server: str, tmp_path: Path) -> None:
    (tmp_path / "checksums.txt").write_text(f"run.csv sha256:{'0' * 64}\n")
    with pytest.raises(RecordingError, match="hash"):
        fetch("run.csv", server, tmp_path / "checksums.txt", tmp_path / "kept")
    assert not (tmp_path / "kept" / "run.csv").exists()


THRUSTER = """
name = "thruster"
[water]
density_kg_m3 = 1000.0
[hull]
fixed = true
[propeller]
model = "bollard"
diameter_m = 0.1
torque_coefficient = 0.03
thrust_coefficient = 0.38
[prime_mover]
type = "dc-motor"
motor_constant_V_s_rad = 0.0186
armature_resistance_ohm = 1.0
voltage_max_V = 5.0
[transmission]
gear_ratio = 1.0
efficiency = 1.0
inertia_engine_side_kg_m2 = 2.5e-5
inertia_propeller_side_kg_m2 = 0.0
[integration]
time_step_s = 0.005
"""


def turning(ship: Ship, seed: int = 0) -> pd.DataFrame:
    """A servo's angle, its torque stepped in both directions."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(2000)
    torque = np.repeat(rng.uniform(-90.0, 90.0, 40), 50)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": torque, "shaft_angle_rad": 0.0})
    run = simulate_recording(ship, table)[list(table)]
    return run.assign(shaft_angle_rad=run["shaft_angle_rad"] + 1e-5 * rng.standard_normal(2000))


def test_an_angle_stands_for_the_speed(load: Load, servo: Ship) -> None:
    run = turning(servo.with_values({"transmission.coulomb_friction_engine_side_N_m": 25.0}))
    found = load(run, ship=servo)
    assert found.channels == ("motor_torque_N_m", "shaft_angle_rad")
    assert (found.warnings, found.limits) == ((), ())
    with pytest.raises(RecordingError, match="column 'shaft_speed_rad_s' is missing"):
        load(run.drop(columns="shaft_angle_rad"), ship=servo)


@pytest.mark.parametrize(
    ("slip", "words"),
    [
        (180.0 / np.pi, 'looks like deg .* set unit = "deg"'),
        (-1.0, "looks like itself with the opposite sign"),
    ],
)
def test_unit_errors_of_an_angle_are_recognised_by_its_steps(
    load: Load, servo: Ship, slip: float, words: str
) -> None:
    """Far from 0, where the angle itself tells nothing of its unit."""
    run = turning(servo)
    turned = run.assign(shaft_angle_rad=slip * (run["shaft_angle_rad"] + 300.0))
    with pytest.raises(RecordingError, match=f"shaft_angle_rad {words}"):
        load(turned, ship=servo)
    load(run.assign(shaft_angle_rad=run["shaft_angle_rad"] + 300.0), ship=servo)


def test_an_angle_that_begins_anew_is_refused(load: Load, servo: Ship) -> None:
    run = turning(servo.with_values({"transmission.viscous_friction_engine_side_N_m_s_rad": 5.0}))
    wrapped = run.assign(shaft_angle_rad=np.mod(run["shaft_angle_rad"], 2.0 * np.pi))
    with pytest.raises(RecordingError, match=r"row \d+: .* restarts at each turn, .*unwrap"):
        load(wrapped, ship=servo)


def test_an_angle_that_is_not_that_of_the_shaft_is_refused(load: Load, calm: pd.DataFrame) -> None:
    wind = calm.assign(shaft_angle_rad=0.4 * np.sin(0.01 * calm["time_s"]))
    with pytest.raises(RecordingError, match=r"shaft_angle_rad: changes by .* integrates to"):
        load(wind)


def test_a_speed_that_is_held_is_a_demand(
    load: Load, held_frigate: Ship, calm: pd.DataFrame
) -> None:
    run = calm.drop(columns="fuel_rack_mm")
    found = load(run, ship=held_frigate)
    assert found.channels == tuple(c for c in COLUMNS if c != "fuel_rack_mm")
    assert (found.warnings, found.limits) == ((), ())
    in_rpm = run.assign(shaft_speed_rad_s=run["shaft_speed_rad_s"] * 30.0 / np.pi)
    with pytest.raises(
        RecordingError, match=r"shaft_speed_rad_s looks like rpm .* takes -15 to 15"
    ):
        load(in_rpm, ship=held_frigate)
    steady = run.assign(shaft_speed_rad_s=10.0)
    assert not any("shaft_speed" in said for said in load(steady, ship=held_frigate).limits)
    still = steady.assign(ship_speed_m_s=8.0 + 0.01 * run["ship_speed_m_s"])
    assert any(
        "insufficient excitation: shaft_speed_rad_s" in said
        for said in load(still, ship=held_frigate).limits
    )


AXIS = """[columns]
motor_force_N = { column = "motor_torque_N_m", unit = "N", radius_m = 1.0 }
position_m = { column = "shaft_angle_rad", unit = "m", radius_m = 1.0 }
"""


def test_a_real_axis_is_followed_by_its_published_numbers(tmp_path: Path, servo: Ship) -> None:
    """EMPS: mass, viscous and Coulomb friction and offset leave 6.5 and 9 mm of position."""
    folder = Path(os.environ.get("SHAFTLINE_DATA", "")) / "recordings" / "emps"
    if "SHAFTLINE_DATA" not in os.environ or not folder.is_dir():
        pytest.skip("needs recordings/emps in the folder SHAFTLINE_DATA (docs/recordings.md)")
    (tmp_path / "map.toml").write_text(AXIS)
    emps = servo.with_values(
        {
            "prime_mover.torque_offset_N_m": 3.2,
            "transmission.inertia_engine_side_kg_m2": 95.11,
            "transmission.viscous_friction_engine_side_N_m_s_rad": 203.5,
            "transmission.coulomb_friction_engine_side_N_m": 20.4,
            "transmission.stiction_speed_rad_s": 1e-3,
        }
    )
    for name, most in (("estimation", 7e-3), ("validation", 9.5e-3)):
        found = load_recording(folder / f"{name}.csv", emps, tmp_path / "map.toml")
        sailed = simulate_recording(emps, found.table)["shaft_angle_rad"]
        assert np.sqrt(np.mean((sailed - found["shaft_angle_rad"]) ** 2)) < most


def test_real_thruster_runs_are_accepted(tmp_path: Path) -> None:
    folder = Path(os.environ.get("SHAFTLINE_DATA", "")) / "recordings" / "rov_thruster"
    if "SHAFTLINE_DATA" not in os.environ or not folder.is_dir():
        pytest.skip(
            "needs recordings/rov_thruster in the folder SHAFTLINE_DATA (docs/recordings.md)"
        )
    (tmp_path / "thruster.toml").write_text(THRUSTER)
    ship = load_ship(tmp_path / "thruster.toml")
    files = sorted(folder.glob("*.csv"))
    assert len(files) == 9
    for file in files:
        found = load_recording(file, ship)
        assert found.interval_s == pytest.approx(0.04)
        assert found.noise["shaft_speed_rad_s"].white_rms > 0.0


def test_a_ship_that_does_not_turn_hears_how_the_real_one_turned(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Path
) -> None:
    """Columns of a turn are signals of terms on a ship that has no sway and yaw of its own."""
    turned = calm.assign(yaw_rate_rad_s=0.01 * np.sin(calm["time_s"]))
    turned.to_csv(tmp_path / "run.csv", index=False)
    found = load_recording(tmp_path / "run.csv", frigate, signals={"yaw_rate": "rad/s"})
    np.testing.assert_allclose(found.table["yaw_rate"], turned["yaw_rate_rad_s"], atol=1e-12)
