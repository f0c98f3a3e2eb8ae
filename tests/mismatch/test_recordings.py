from __future__ import annotations

import hashlib
import math
import os
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings import Recording, fetch, load_recording
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, load_ship, realise, simulate
from shaftline.plant.recording import RecordingError
from shaftline.plant.replay import simulate_recording

RPM = 30.0 / math.pi
NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.02,
    "shaft_torque_N_m": 1000.0,
    "ship_speed_m_s": 0.02,
}
COLUMNS = ["fuel_rack_mm", "pitch_ratio_command", *NOISE]
Load = Callable[..., Recording]


def voyage(ship: Ship, sea: str | None = None, seconds: float = 300.0) -> pd.DataFrame:
    """A recording at 10 Hz of a ship whose rack and pitch step, with noisy instruments."""
    rng = np.random.default_rng(1)
    time = ship.time_step_s * np.arange(round(seconds / ship.time_step_s))
    rack, pitch = 18.0 + 6.0 * (time // 40 % 2), 1.3 - 0.2 * (time // 60 % 2)
    waves = get_sea(sea) if sea else None
    realised = realise(waves, depth_m=ship.propeller.depth_m, seed=1) if waves else None
    start = equilibrium(ship, rack[0], pitch[0]).state
    samples = simulate(ship, Schedule(rack, pitch), seconds, initial=start, sea=realised)[:-1:2]
    names = ["measured_pitch_ratio", "shaft_speed", "measured_shaft_torque", "measured_ship_speed"]
    table = {
        "time_s": np.round(time[::2], 6), "fuel_rack_mm": rack[::2], "pitch_ratio_command": pitch[::2]
    }  # fmt: skip
    for (column, rms), name in zip(NOISE.items(), names, strict=True):
        table[column] = samples[name] + rms * rng.standard_normal(len(samples))
    return pd.DataFrame(table)


@pytest.fixture(scope="module")
def calm(frigate: Ship) -> pd.DataFrame:
    return voyage(frigate)


@pytest.fixture
def load(frigate: Ship, tmp_path: Path) -> Load:
    """Write a table, and a column map, and load them."""

    def through_files(table: pd.DataFrame, columns: str = "", ship: Ship = frigate) -> Recording:
        table.to_csv(tmp_path / "r.csv", index=False)
        (tmp_path / "map.toml").write_text(columns)
        return load_recording(tmp_path / "r.csv", ship, tmp_path / "map.toml" if columns else None)

    return through_files


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


# -- honest recordings ------------------------------------------------------------------------

EFFECTS: dict[str, dict[str, float]] = {
    "nominal": {},
    "fouled": {"hull.fouling_fraction": 1.0},
    "cleaner": {"hull.fouling_fraction": -0.5},
    "friction": {"transmission.coulomb_friction_engine_side_N_m": 26000.0},
    "propeller-friction": {"transmission.viscous_friction_propeller_side_N_m_s_rad": 2500.0},
    "rough": {"propeller.roughness_drag": 0.01},
    "derated": {"prime_mover.derating_fraction": 0.4},
    "lag": {"prime_mover.lag_s": 8.0},
    "gauge-low": {"sensors.torque_gain": 0.8},
    "gauge-high": {"sensors.torque_gain": 1.2},
    "gauge-late": {"sensors.torque_delay_s": 5.0},
    "head-current": {"hull.current_m_s": -2.0},
    "stern-current": {"hull.current_m_s": 2.0},
    "pitch-offset": {"sensors.pitch_offset": 0.2},
    "dead-band": {"pitch_actuator.dead_band": 0.08},
    "slow-pitch": {"pitch_actuator.rate_limit_per_s": 0.01},
    "slow-log": {"sensors.speed_log_lag_s": 60.0},
    "ventilated": {"ventilation.thrust_loss": 0.7, "ventilation.torque_loss": 0.6},
    "all-at-once": {
        "hull.fouling_fraction": 0.5,
        "prime_mover.derating_fraction": 0.2,
        "sensors.torque_gain": 0.8,
        "hull.current_m_s": -1.0,
    },
}


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
    assert any(sentence.startswith("dull: fuel_rack_mm") for sentence in found.limits)


# -- slips ------------------------------------------------------------------------------------


def degrees(pitch: pd.Series) -> pd.Series:
    return np.degrees(np.arctan(pitch / (0.7 * math.pi)))


SLIPS = [
    ("shaft_speed_rad_s", RPM, 'unit = "rpm"'),
    ("shaft_speed_rad_s", 0.5 / math.pi, 'unit = "rps"'),
    ("shaft_speed_rad_s", 7.38, "scale = 0.1355"),
    ("shaft_speed_rad_s", 7.38 * RPM, 'unit = "rpm", scale = 0.1355'),
    ("shaft_speed_rad_s", -1.0, "sign = -1"),
    ("shaft_torque_N_m", 1e-3, 'unit = "kN m"'),
    ("shaft_torque_N_m", 1 / 7.38, "scale = 7.38"),
    ("shaft_torque_N_m", -1.0, "sign = -1"),
    ("shaft_torque_N_m", -1e-3, 'unit = "kN m", sign = -1'),
    ("ship_speed_m_s", 3600 / 1852, 'unit = "knot"'),
    ("ship_speed_m_s", 3.6, 'unit = "km/h"'),
    ("ship_speed_m_s", -1.0, "sign = -1"),
    ("fuel_rack_mm", 0.1, 'unit = "cm"'),
    ("fuel_rack_mm", 1e-3, 'unit = "m"'),
    ("fuel_rack_mm", 2.5, "scale = 0.4"),
    ("fuel_rack_mm", -1.0, "sign = -1"),
    ("pitch_ratio", 100.0, 'unit = "percent"'),
    ("pitch_ratio", -1.0, "sign = -1"),
    ("pitch_ratio", degrees, 'unit = "deg"'),
    ("pitch_ratio_command", 100.0, 'unit = "percent"'),
    ("pitch_ratio_command", -1.0, "sign = -1"),
    ("pitch_ratio_command", degrees, 'unit = "deg"'),
]


@pytest.mark.parametrize("effect", ["nominal", "gauge-low", "friction"])
@pytest.mark.parametrize(
    ("column", "change", "advice"), SLIPS, ids=[f"{c}-{a}" for c, _, a in SLIPS]
)
def test_slips_are_named_and_the_advice_mends_them(
    load: Load, frigate: Ship, effect: str, column: str, change: object, advice: str
) -> None:
    table = voyage(frigate.with_values(EFFECTS[effect]), "state-5")
    table[column] = change(table[column]) if callable(change) else change * table[column]
    with pytest.raises(RecordingError) as refused:
        load(table)
    message = str(refused.value)
    assert f"r.csv: {column} looks like" in message
    assert advice in message
    assert len(message.splitlines()) == 1
    full = advice.replace("0.1355", "0.135501")
    load(table, f'[columns]\n{column} = {{ column = "{column}", {full} }}')


@pytest.mark.parametrize("begins", [0.0, -0.9], ids=["from-rest", "astern"])
@pytest.mark.parametrize(
    ("change", "advice"),
    [(1.0, ""), (-1.0, "sign = -1"), (RPM, 'unit = "rpm"'), (-RPM, 'unit = "rpm", sign = -1')],
    ids=["right", "turned", "rpm", "rpm-turned"],
)
def test_a_motor_that_runs_astern(load: Load, begins: float, change: float, advice: str) -> None:
    ship = load_ship("tito-neri-staircase")
    top, time = float(ship.record()["drive_max"]), 0.1 * np.arange(600)
    volts = top * np.where(time < 40.0, -0.5 - 0.4 * (time // 5 % 2 == 0), 0.3)
    first = {"pitch_ratio": 1.0, "ship_speed_m_s": 0.0}
    first["shaft_speed_rad_s"] = begins * top / float(ship.record()["motor_constant"])
    orders = pd.DataFrame({"time_s": time, "motor_voltage_V": volts} | first)
    table = simulate_recording(ship, orders)[["time_s", "motor_voltage_V", "shaft_speed_rad_s"]]
    table["shaft_speed_rad_s"] *= change
    if not advice:
        load(table, ship=ship)
        return
    with pytest.raises(RecordingError, match="shaft_speed_rad_s looks like") as refused:
        load(table, ship=ship)
    assert advice in str(refused.value)


@pytest.mark.parametrize("effect", ["nominal", "gauge-low", "friction"])
@pytest.mark.parametrize("pair", combinations(COLUMNS, 2), ids="-".join)
def test_swapped_columns_are_named(
    load: Load, frigate: Ship, effect: str, pair: tuple[str, str]
) -> None:
    a, b = pair
    if effect == "friction" and pair == ("shaft_speed_rad_s", "ship_speed_m_s"):
        pytest.skip("with a quarter less torque either order of these two is equally far off")
    table = voyage(frigate.with_values(EFFECTS[effect]), "state-5")
    with pytest.raises(RecordingError, match=rf"r\.csv: {a} .* and {b} .* look swapped"):
        load(table.rename(columns={a: b, b: a}))


@pytest.mark.parametrize("column", ["shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"])
def test_dead_channel_is_refused(load: Load, calm: pd.DataFrame, column: str) -> None:
    with pytest.raises(RecordingError, match=rf"{column} is constant at .* in every row"):
        load(calm.assign(**{column: calm[column].mean()}))
    with pytest.raises(RecordingError, match=rf"{column} is constant at 0 "):
        load(calm.assign(**{column: 0.0}))


def test_demand_beyond_the_stop_is_refused(load: Load, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"fuel_rack_mm, row 1: 190 mm .* takes 0 to 40 mm"):
        load(calm.assign(fuel_rack_mm=190.0))


# -- values and time --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("ship_speed_m_s", 7, math.nan, r"ship_speed_m_s, row 8: .*nan.* is not a finite number"),
        ("shaft_speed_rad_s", 0, math.inf, r"shaft_speed_rad_s, row 1: .*inf.*rad/s"),
        ("fuel_rack_mm", 2, "full", r"fuel_rack_mm, row 3: 'full' is not a finite number"),
        ("ship_speed_m_s", 5, 70.0, r"ship_speed_m_s, row 6: 70 m/s lies outside -40 to 40 m/s"),
        ("time_s", 5, 0.1, r"time_s, row 6: 0\.1 s after 0\.4 s; time must rise"),
        ("time_s", 2999, 400.0, r"time_s, row 3000: a gap of 100.* s .* cut the recording"),
    ],
)
def test_bad_value_is_named(
    load: Load, calm: pd.DataFrame, column: str, row: int, value: object, words: str
) -> None:
    table = calm.astype(object)
    table.loc[row, column] = value
    with pytest.raises(RecordingError, match=rf"r\.csv: {words}"):
        load(table)


@pytest.mark.parametrize("missing", [1, 3])
def test_short_gap_is_filled_with_a_warning(load: Load, calm: pd.DataFrame, missing: int) -> None:
    found = load(calm.drop(index=range(500, 500 + missing)))
    assert len(found) == len(calm)
    assert "missing before row 501" in found.warnings[0]
    np.testing.assert_allclose(found["ship_speed_m_s"], calm["ship_speed_m_s"], atol=0.2)


def test_long_gap_is_refused(load: Load, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"time_s, row 501: a gap of 0\.5 s after 49\.9 s"):
        load(calm.drop(index=range(500, 504)))


def test_jitter_is_resampled_with_a_warning(load: Load, calm: pd.DataFrame) -> None:
    jitter = np.random.default_rng(2).uniform(-0.02, 0.02, len(calm))
    jitter[[0, -1]] = 0.0
    found = load(calm.assign(time_s=calm["time_s"] + jitter))
    assert "onto an even time base" in found.warnings[0]
    np.testing.assert_allclose(np.diff(found.time_s), 0.1, rtol=1e-3)


def test_uneven_time_is_refused(load: Load, calm: pd.DataFrame) -> None:
    steps = np.random.default_rng(2).choice([0.03, 0.1, 0.2], len(calm), p=[0.3, 0.4, 0.3])
    with pytest.raises(RecordingError, match="of all steps differ as much; resample"):
        load(calm.assign(time_s=np.cumsum(steps)))


def test_time_in_milliseconds_is_refused_and_mended(load: Load, calm: pd.DataFrame) -> None:
    table = calm.assign(time_s=1000 * calm["time_s"])
    with pytest.raises(RecordingError, match=r"time_s steps by 100 s .*unit = .ms."):
        load(table)
    assert load(table, '[columns]\ntime_s = { column = "time_s", unit = "ms" }').interval_s == (
        pytest.approx(0.1)
    )


def test_missing_and_empty_are_named(load: Load, calm: pd.DataFrame, tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"column 'shaft_speed_rad_s' is missing; needed: time"
    ):
        load(calm.drop(columns="shaft_speed_rad_s"))
    with pytest.raises(RecordingError, match=r"r\.csv: 0 row\(s\)"):
        load(calm.iloc[:0])
    with pytest.raises(RecordingError, match=r"nowhere\.csv: cannot be read"):
        load_recording(tmp_path / "nowhere.csv", load_ship("frigate"))


# -- warnings and limits ----------------------------------------------------------------------


def test_saturated_and_frozen_sensors_are_warned_of(load: Load, calm: pd.DataFrame) -> None:
    limit = calm["shaft_torque_N_m"].quantile(0.9)
    table = calm.assign(shaft_torque_N_m=calm["shaft_torque_N_m"].clip(upper=limit))
    table.loc[1000:1100, "ship_speed_m_s"] = table.loc[1000, "ship_speed_m_s"]
    warnings = load(table).warnings
    assert any("shaft_torque_N_m stands at its extreme" in w and "10%" in w for w in warnings)
    assert any("ship_speed_m_s does not change for 101 rows from row 1001" in w for w in warnings)


def test_drive_at_its_stop_is_warned_of(load: Load, frigate: Ship) -> None:
    table = voyage(frigate).assign(fuel_rack_mm=40.0)
    assert any("fuel_rack_mm is at its end stop in 100.0%" in w for w in load(table).warnings)


def test_short_and_dull_are_limits_not_errors(load: Load, frigate: Ship) -> None:
    start = equilibrium(frigate, 22.0, 1.3).state
    rng = np.random.default_rng(3)
    values = [start.pitch_ratio, start.shaft_speed, 1.3e5, start.ship_speed]
    table = pd.DataFrame({"time_s": 0.1 * np.arange(100), "fuel_rack_mm": 22.0,
                          "pitch_ratio_command": 1.3})  # fmt: skip
    for (column, rms), value in zip(NOISE.items(), values, strict=True):
        table[column] = value + rms * rng.standard_normal(100)
    limits = load(table).limits
    assert any(sentence.startswith("too short: 100 rows") for sentence in limits)
    assert any("hull's time constant" in sentence for sentence in limits)
    for column in COLUMNS:
        assert any(sentence.startswith(f"dull: {column} moves") for sentence in limits), column


# -- column maps ------------------------------------------------------------------------------


def test_foreign_names_units_and_signs_are_carried_over(load: Load, calm: pd.DataFrame) -> None:
    foreign = pd.DataFrame(
        {
            "Date": pd.Timestamp("2024-05-01T12:00:00Z")
            + pd.to_timedelta(calm["time_s"], unit="s"),
            "Index": calm["fuel_rack_mm"] / 0.4,
            "Pitch set": degrees(calm["pitch_ratio_command"]),
            "P/D": calm["pitch_ratio"],
            "N": -RPM * calm["shaft_speed_rad_s"],
            "Q": 1e-3 * calm["shaft_torque_N_m"] + 2.0,
            "STW": calm["ship_speed_m_s"] * 3600 / 1852,
        }
    )
    found = load(
        foreign,
        """[columns]
        Date = { column = "time_s", unit = "datetime" }
        Index = { column = "fuel_rack_mm", scale = 0.4 }
        "Pitch set" = { column = "pitch_ratio_command", unit = "deg" }
        "P/D" = "pitch_ratio"
        N = { column = "shaft_speed_rad_s", unit = "RPM", sign = -1 }
        Q = { column = "shaft_torque_N_m", unit = "kNm", offset = -2.0 }
        STW = { column = "ship_speed_m_s", unit = "kn" }
        """,
    )
    for column in calm:
        np.testing.assert_allclose(found[column], calm[column], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("columns = ", r"not valid TOML"),
        ("", r"columns is missing"),
        ("[columns]", r"columns: .*at least 1"),
        ("[columns]\nN = {}", r"columns\.N\.column is missing"),
        ("[columns]\nN = 3", r"columns\.N: "),
        ('[columns]\nN = "speed"', r"columns\.N\.column: 'speed' is not canonical \(allowed: time_s"),
        ('[columns]\nN = { column = "time_s", units = "s" }',
         r"columns\.N\.units is not a known key \(allowed: column, unit, sign, scale, offset\)"),
        ('[columns]\nN = { column = "thrust_N", sign = 2 }', r"columns\.N\.sign: .* 1 or -1"),
        ('[columns]\nN = { column = "thrust_N", scale = 0 }', r"columns\.N\.scale: 0 would leave"),
        ('[columns]\nN = { column = "thrust_N", scale = inf }', r"columns\.N\.scale: .*finite"),
        ('[columns]\nN = { column = "thrust_N", unit = "kp m" }', r"columns\.N: unit 'kp m' is not"),
        ('[columns]\nN = { column = "thrust_N", unit = "kg" }', r"'kg' cannot be turned into N"),
        ('[columns]\nN = { column = "shaft_speed_rad_s", unit = "Hz" }', r"does not say what turns"),
        ('[columns]\nN = { column = "thrust_N", unit = "datetime" }', r"is for time_s only"),
        ('[columns]\nN = "thrust_N"\nM = "thrust_N"', r"thrust_N is given by more than one"),
        ("[column]\nN = 1", r"column is not a known key \(allowed: columns\)"),
    ],
)  # fmt: skip
def test_bad_map_is_named(load: Load, calm: pd.DataFrame, text: str, words: str) -> None:
    with pytest.raises(RecordingError, match=rf"map\.toml: .*{words}"):
        load(calm, text or "\n")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('Thrust = "thrust_N"', r"column 'Thrust' of the column map is missing; found: time_s"),
        ('extra = "pitch_ratio"', r"pitch_ratio is in the recording and given by 'extra' as well"),
        ('time_s = { column = "time_s", unit = "datetime" }', r"'time_s' as time_s"),
    ],
)
def test_map_that_does_not_fit_is_named(
    load: Load, calm: pd.DataFrame, line: str, words: str
) -> None:
    table = calm.assign(extra=1.0).astype({"time_s": str}).assign(time_s="tomorrow or so")
    with pytest.raises(RecordingError, match=rf"r\.csv: {words}"):
        load(table, f"[columns]\n{line}")


# -- public and real recordings ---------------------------------------------------------------


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
