"""A column map is guessed for the files of other loggers, and works as it is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.logger_names import split_name
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import Ship, load_ship, simulate_recording

RPM = 30.0 / np.pi


@pytest.fixture(scope="module")
def rov() -> Ship:
    return load_ship("rov-thruster")


@pytest.fixture(scope="module")
def bench(rov: Ship) -> pd.DataFrame:
    """A thruster on a bench, ahead and astern, from rest."""
    time = 0.04 * np.arange(600)
    volts = (3.5 * np.sin(0.9 * time) + 1.0 * np.sign(np.sin(0.31 * time))) * (time > 1.0)
    table = pd.DataFrame({"time_s": time, "motor_voltage_V": volts})
    zero = dict.fromkeys(("shaft_speed_rad_s", "thrust_N", "shaft_torque_N_m"), 0.0)
    logged = simulate_recording(rov, table.assign(**zero))
    return table.assign(
        **{c: logged[c] for c in ("shaft_speed_rad_s", "thrust_N", "shaft_torque_N_m")}
    )


@pytest.fixture(scope="module")
def turn() -> pd.DataFrame:
    """A tanker at 12 rpm with the rudder to and fro."""
    time = 0.5 * np.arange(1200)
    rudder = 0.25 * np.sign(np.sin(0.02 * time)) * (time > 20.0)
    orders = pd.DataFrame({"time_s": time, "shaft_speed_rad_s": 8.0, "rudder_rad": rudder})
    logged = simulate_recording(load_ship("kvlcc2"), orders)
    channels = ("ship_speed_m_s", "sway_speed_m_s", "yaw_rate_rad_s", "heading_rad")
    return orders.assign(**{c: logged[c] for c in channels})


def drafted(table: pd.DataFrame, ship: Ship | str, folder: Path) -> tuple[pd.DataFrame, str]:
    """Draft a map, use it unchanged, and return the recording's table and the map."""
    ship = load_ship(ship) if isinstance(ship, str) else ship
    table.to_csv(folder / "log.csv", index=False)
    first = survey(folder / "log.csv", ship)
    (folder / "map.toml").write_text("\n".join(first.begin), encoding="utf-8")
    found = survey(folder / "log.csv", ship, folder / "map.toml")
    assert found.recording is not None, f"{found.refused}\n" + "\n".join(first.begin)
    return found.recording.table, "\n".join(first.begin)


def close(found: pd.DataFrame, expected: pd.DataFrame, columns: tuple[str, ...]) -> None:
    for column in columns:
        size = float(expected[column].abs().max())
        np.testing.assert_allclose(
            found[column], expected[column], atol=1e-3 * size, err_msg=column
        )


def test_rcbenchmark(bench: pd.DataFrame, rov: Ship, tmp_path: Path) -> None:
    top = rov.parameter("prime_mover.voltage_max_V").value
    rpm = RPM * bench["shaft_speed_rad_s"]
    log = pd.DataFrame(
        {
            "Time (s)": bench["time_s"],
            "ESC signal (µs)": 1500.0 + 500.0 * bench["motor_voltage_V"] / top,
            "Motor Electrical Speed (RPM)": 0.97 * rpm,
            "Motor Optical Speed (RPM)": rpm,
            "Thrust (N)": bench["thrust_N"],
            "Torque (N·m)": bench["shaft_torque_N_m"],
            "Voltage (V)": 14.8 - 0.1 * (rpm.abs() > 100.0),
            "Current (A)": 0.0,
            "Electrical Power (W)": 0.0,
            "Mechanical Power (W)": 0.0,
        }
    ).drop(columns="Current (A)")
    found, lines = drafted(log, rov, tmp_path)
    close(found, bench, ("motor_voltage_V", "shaft_speed_rad_s", "thrust_N", "shaft_torque_N_m"))
    assert '# also possible as shaft_speed_rad_s: "Motor Electrical Speed (RPM)" (RPM)' in lines
    assert '# also possible as motor_voltage_V: "Voltage (V)" (V)' in lines
    assert "Power" not in "".join(line for line in lines.splitlines() if line.startswith('"'))


@pytest.mark.parametrize(
    "names",
    [
        ("t", "u_volt", "shaftSpeed"),
        ("t_s", "motor_V", "omega"),
        ("timestamp", "command_V", "shaft.speed"),
        ("__time", "motorVoltage", "/motor/state/velocity"),
        ("header.stamp.secs", "motor_voltage_command", "joint_states.velocity[0]"),
        ("Time (s)", "vir", "rpm"),
        ("time_ms", "throttle", "n_prop"),
        ("Zeit", "pwm", "MotorSpeedRpm"),
    ],
)
def test_names_of_a_bench(
    bench: pd.DataFrame, rov: Ship, tmp_path: Path, names: tuple[str, str, str]
) -> None:
    time, drive, speed = names
    volts = bench["motor_voltage_V"]
    if drive == "throttle":
        volts = 100.0 * volts / rov.parameter("prime_mover.voltage_max_V").value
    if drive == "pwm":
        volts = volts / rov.parameter("prime_mover.voltage_max_V").value
    log = pd.DataFrame(
        {
            time: bench["time_s"] * (1000.0 if time == "time_ms" else 1.0),
            drive: volts,
            speed: bench["shaft_speed_rad_s"] * (RPM if "rpm" in speed.lower() else 1.0),
            "status": 1.0,
            "motorTemperature": 20.0 + bench["time_s"],
        }
    )
    found, lines = drafted(log, rov, tmp_path)
    close(found, bench, ("time_s", "motor_voltage_V", "shaft_speed_rad_s"))
    assert ("unit not stated" in lines) == (time != "Time (s)" or drive != "motor_V")


def test_ros_clock_and_angle(bench: pd.DataFrame, rov: Ship, tmp_path: Path) -> None:
    """Whole seconds beside nanoseconds: the seconds are taken, and spread; an angle beside its speed."""
    clock = 1.7e9 + bench["time_s"]
    log = pd.DataFrame(
        {
            "header.stamp.secs": np.floor(clock),
            "header.stamp.nsecs": np.round(1e9 * (bench["time_s"] % 1.0)),
            "joint_states.position[0]": (bench["shaft_speed_rad_s"] * 0.04).cumsum(),
            "joint_states.velocity[0]": bench["shaft_speed_rad_s"],
            "joint_states.effort[0]": bench["shaft_torque_N_m"],
            "motor.cmd": bench["motor_voltage_V"]
            / rov.parameter("prime_mover.voltage_max_V").value,
        }
    )
    found, lines = drafted(log, rov, tmp_path)
    close(found, bench, ("motor_voltage_V", "shaft_speed_rad_s", "shaft_torque_N_m"))
    assert "whole seconds: several rows in one are spread evenly" in lines
    assert "shaft_angle_rad" not in found
    np.testing.assert_allclose(np.diff(found["time_s"]), 0.04, rtol=1e-2)


def test_nanoseconds_since_1970(bench: pd.DataFrame, rov: Ship, tmp_path: Path) -> None:
    stamps = (1_700_000_000_000_000_000 + np.round(1e9 * bench["time_s"])).astype("int64")
    log = pd.DataFrame(
        {
            "timestamp": stamps,
            "voltage": bench["motor_voltage_V"],
            "rpm": RPM * bench["shaft_speed_rad_s"],
        }
    )
    found, lines = drafted(log, rov, tmp_path)
    assert 'unit = "ns" }  # unit not stated; the values are those of a clock in ns' in lines
    np.testing.assert_allclose(np.diff(found["time_s"]), 0.04, rtol=1e-3)


def test_nmea(turn: pd.DataFrame, tmp_path: Path) -> None:
    log = pd.DataFrame(
        {
            "Time (s)": turn["time_s"],
            "RPM.Source": "S",
            "RPM.Speed": RPM * turn["shaft_speed_rad_s"],
            "VHW.SpeedKnots": turn["ship_speed_m_s"] * 3600.0 / 1852.0,
            "VTG.SpeedOverGround": turn["ship_speed_m_s"] * 3600.0 / 1852.0,
            "RSA.RudderAngle": np.degrees(turn["rudder_rad"]),
            "HDT.Heading": np.degrees(turn["heading_rad"]),
            "ROT.Rate": np.degrees(turn["yaw_rate_rad_s"]) * 60.0,
        }
    )
    found, lines = drafted(log, "kvlcc2", tmp_path)
    close(
        found,
        turn,
        ("shaft_speed_rad_s", "ship_speed_m_s", "rudder_rad", "heading_rad", "yaw_rate_rad_s"),
    )
    assert '"VTG.SpeedOverGround" = { column = "speed_over_ground_m_s", unit = "m/s" }' in lines
    assert '"VHW.SpeedKnots" = { column = "ship_speed_m_s", unit = "knot" }' in lines


def test_signal_k(turn: pd.DataFrame, tmp_path: Path) -> None:
    log = pd.DataFrame(
        {
            "datetime": pd.Timestamp("2024-05-03 12:00:00")
            + pd.to_timedelta(turn["time_s"], unit="s"),
            "navigation.speedThroughWater": turn["ship_speed_m_s"],
            "navigation.speedOverGround": turn["ship_speed_m_s"],
            "propulsion.main.revolutions": turn["shaft_speed_rad_s"] / (2.0 * np.pi),
            "steering.rudderAngle": turn["rudder_rad"],
            "navigation.headingTrue": turn["heading_rad"],
            "navigation.rateOfTurn": turn["yaw_rate_rad_s"],
        }
    )
    found, lines = drafted(log, "kvlcc2", tmp_path)
    close(
        found,
        turn,
        ("shaft_speed_rad_s", "ship_speed_m_s", "rudder_rad", "heading_rad", "yaw_rate_rad_s"),
    )
    assert '"propulsion.main.revolutions" = { column = "shaft_speed_rad_s", unit = "rps" }' in lines


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("Thrust_kN", ("thrust",), "kN"),
        ("shaftSpeed", ("shaft", "speed"), ""),
        ("VHW.SpeedKnots", ("vhw", "speed"), "knot"),
        ("joint_states.position[0]", ("joint", "states", "position"), ""),
        ("header.stamp.nsecs", ("header", "stamp"), "ns"),
        ("speed_m_s", ("speed",), "m/s"),
        ("torque [N m]", ("torque",), "N m"),
        ("ESC signal (µs)", ("esc", "signal"), "µs"),
        ("u_volt", ("u",), "V"),
        ("rpm", ("rpm",), "rpm"),
        ("t", ("t",), ""),
    ],
)
def test_names_are_split(name: str, words: tuple[str, ...], unit: str) -> None:
    found = split_name(name)
    assert (found.core[: len(words)], found.unit) == (words, unit)
