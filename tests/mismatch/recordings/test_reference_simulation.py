"""Slips told by the nominal ship: other units, other signs, swapped names, dead channels."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.noise import estimate_noise
from shaftline.plant import RecordingError, Ship, approach, load_ship
from shaftline.plant.columns import SHAFT_ANGLE
from shaftline.plant.replay import simulate_recording

from .conftest import Load
from .trials import COLUMNS, EFFECTS, RPM, degrees, longest_rest, voyage

UNIT_ERRORS = [
    ("shaft_speed_rad_s", RPM, 'unit = "rpm"'),
    ("shaft_speed_rad_s", 0.5 / math.pi, 'unit = "rps"'),
    ("shaft_speed_rad_s", 7.38, "scale = 0.1355"),
    ("shaft_speed_rad_s", 7.38 * RPM, 'unit = "rpm", scale = 0.1355'),
    ("shaft_speed_rad_s", -1.0, "sign = -1"),
    ("shaft_torque_N_m", 1e-3, 'unit = "kN m"'),
    ("shaft_torque_N_m", 1e-6, 'unit = "MN m"'),
    ("shaft_torque_N_m", -1 / 9806.65, 'unit = "tf m", sign = -1'),
    ("shaft_torque_N_m", 1 / 7.38, "scale = 7.38"),
    ("shaft_torque_N_m", -1.0, "sign = -1"),
    ("shaft_torque_N_m", -1e-3, 'unit = "kN m", sign = -1'),
    ("ship_speed_m_s", 3600 / 1852, 'unit = "knot"'),
    ("ship_speed_m_s", 3.6, 'unit = "km/h"'),
    ("ship_speed_m_s", -1.0, "sign = -1"),
    ("fuel_rack_mm", 0.1, 'unit = "cm"'),
    ("fuel_rack_mm", 1e-3, 'unit = "m"'),
    ("fuel_rack_mm", 2.5, 'unit = "percent of range"'),
    ("fuel_rack_mm", -1.0, "sign = -1"),
    ("pitch_ratio", 100.0, 'unit = "percent"'),
    ("pitch_ratio", -1.0, "sign = -1"),
    ("pitch_ratio", degrees, 'unit = "deg"'),
    ("pitch_ratio_command", 100.0, 'unit = "percent"'),
    ("pitch_ratio_command", 100.0 / 1.6, 'unit = "percent of range"'),
    ("pitch_ratio_command", -1.0, "sign = -1"),
    ("pitch_ratio_command", degrees, 'unit = "deg"'),
]


@pytest.mark.parametrize(
    ("column", "change", "advice", "effect"),
    [
        pytest.param(*error, effect, id=f"{error[0]}-{error[2]}-{effect}")
        for effect, some in (
            ("nominal", UNIT_ERRORS),
            ("gauge-low", UNIT_ERRORS[::4]),
            ("friction", UNIT_ERRORS[2::4]),
        )
        for error in some
    ],
)
def test_unit_errors_are_named_and_the_advice_corrects_them(
    load: Load, frigate: Ship, column: str, change: object, advice: str, effect: str
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


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("kN m", "values that are 1000 times too large for N m"),
        ("mN m", "looks like kN m|MN m"),
        ("uN m", "looks like MN m"),
        ("nN m", r"values that are 1e\+09 times too small for N m"),
    ],
)
def test_a_map_with_a_wrong_unit_of_torque_is_refused(
    load: Load, calm: pd.DataFrame, unit: str, said: str
) -> None:
    given = f'[columns]\nshaft_torque_N_m = {{ column = "shaft_torque_N_m", unit = "{unit}" }}'
    with pytest.raises(RecordingError, match=said):
        load(calm, given)


@pytest.mark.parametrize(
    ("factor", "advice"),
    [(1e-6, 'unit = "MN"'), (1 / 9806.65, 'unit = "tf"'), (1e3, "scale = 0.001")],
)
def test_thrust_of_another_order_of_magnitude_is_refused(
    load: Load, frigate: Ship, factor: float, advice: str
) -> None:
    table = simulate_recording(frigate, voyage(frigate).assign(thrust_N=0.0))
    load(table[["time_s", *COLUMNS, "thrust_N"]])
    with pytest.raises(RecordingError, match="thrust_N looks like") as refused:
        load(table.assign(thrust_N=factor * table["thrust_N"]))
    assert advice in str(refused.value)


@pytest.mark.parametrize("begins", [0.0, -0.9], ids=["from-rest", "astern"])
@pytest.mark.parametrize(
    ("change", "advice"),
    [(1.0, ""), (-1.0, "sign = -1"), (RPM, 'unit = "rpm"'), (-RPM, 'unit = "rpm", sign = -1')],
    ids=["right", "turned", "rpm", "rpm-turned"],
)
def test_a_motor_that_runs_astern(load: Load, begins: float, change: float, advice: str) -> None:
    ship = load_ship("tito-neri-staircase")
    top, time = float(ship.record()["drive_max"]), 0.1 * np.arange(300)
    volts = top * np.where(time < 20.0, -0.5 - 0.4 * (time // 5 % 2 == 0), 0.3)
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


@pytest.mark.parametrize("column", ["pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m"])
@pytest.mark.parametrize("share", [0.4, 0.5, 0.8])
def test_a_sensor_that_stops_on_the_way_is_refused(
    load: Load, calm: pd.DataFrame, column: str, share: float
) -> None:
    stop = round((1.0 - share) * len(calm))
    table = calm.copy()
    table.loc[stop:, column] = table.loc[stop, column]
    with pytest.raises(
        RecordingError,
        match=rf"{column} is constant at .* from row {stop + 1} to {len(calm)}, where the simulation",
    ):
        load(table)


def test_a_shaft_that_its_friction_holds_is_no_dead_sensor(load: Load, servo: Ship) -> None:
    """It continues from the same value; a sensor that was dead reads where the shaft has come to."""
    friction = {
        "transmission.coulomb_friction_engine_side_N_m": 30.0,
        "transmission.stiction_speed_rad_s": 1e-4,
    }
    time = 0.2 * np.arange(1200)
    pushed = 180.0 * np.sign(np.sin(2.25 * time) + np.sin(1.82 * time))
    pushed[240:480] = 2.0
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": pushed})
    true = simulate_recording(servo.with_values(friction), table.assign(**{SHAFT_ANGLE: 0.0}))
    held = table.assign(**{SHAFT_ANGLE: np.round(true[SHAFT_ANGLE], 3)})
    assert (
        longest_rest(
            held[SHAFT_ANGLE].to_numpy(), estimate_noise(held[SHAFT_ANGLE].to_numpy(), 0.2)
        )[1]
        > 120
    )
    load(held, ship=servo)
    dead = held.copy()
    dead.loc[240:520, SHAFT_ANGLE] = dead.loc[240, SHAFT_ANGLE]
    with pytest.raises(RecordingError, match=r"shaft_angle_rad is constant at .*dead sensor"):
        load(dead, ship=servo)


def test_a_short_stop_is_told_and_one_while_the_ship_rests_as_well(
    load: Load, calm: pd.DataFrame
) -> None:
    short, resting = calm.copy(), calm.copy()
    short.loc[900:1000, "shaft_torque_N_m"] = short.loc[900, "shaft_torque_N_m"]
    resting[["fuel_rack_mm", "pitch_ratio_command"]] = 18.0, 1.3
    steady = calm.loc[380, ["pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m"]]
    noise = np.random.default_rng(0).standard_normal((len(calm), 3))
    resting[list(steady.index)] = steady.to_numpy() * (1.0 + 0.005 * noise)
    resting["ship_speed_m_s"] = calm["ship_speed_m_s"].iloc[:380].mean()
    resting["ship_speed_m_s"] += 0.02 * noise[::-1, 0]
    resting.loc[900:, "shaft_torque_N_m"] = resting.loc[900, "shaft_torque_N_m"]
    for table, rows in ((short, 101), (resting, len(calm) - 900)):
        said = "; ".join(load(table).warnings)
        assert f"shaft_torque_N_m does not change for {rows} rows from row 901" in said


def simulated(ship: Ship) -> pd.DataFrame:
    """A ship that accelerates from a steady course."""
    start = approach(ship, 4.0)
    time = 0.1 * np.arange(1200)
    orders = {
        "time_s": time,
        "fuel_rack_mm": 1.2 * start.inputs.drive,
        "pitch_ratio_command": start.state.pitch_ratio,
    }
    first = {
        "pitch_ratio": start.state.pitch_ratio,
        "ship_speed_m_s": 4.0,
        "shaft_speed_rad_s": start.state.shaft_speed,
    }
    table = simulate_recording(ship, pd.DataFrame(orders | first))
    return table[
        [
            "time_s",
            "fuel_rack_mm",
            "pitch_ratio_command",
            "pitch_ratio",
            "shaft_speed_rad_s",
            "shaft_torque_N_m",
            "ship_speed_m_s",
        ]
    ]


def test_another_ships_recording_is_not_taken_for_unit_errors(load: Load, frigate: Ship) -> None:
    """A ferry turns three times as fast and takes a hundredth of the torque: no unit explains both."""
    table = simulated(load_ship("ferry"))
    with pytest.raises(RecordingError, match="hardly a recording of frigate") as refused:
        load(table)
    assert "shaft_torque_N_m" in str(refused.value)
    assert "knot" not in str(refused.value)


@pytest.mark.parametrize(
    "pair", combinations(["shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"], 2)
)
def test_two_unit_errors_are_both_named(load: Load, frigate: Ship, pair: tuple[str, str]) -> None:
    factors = {"shaft_speed_rad_s": RPM, "shaft_torque_N_m": 1e-3, "ship_speed_m_s": 3.6}
    table = voyage(frigate, "state-5")
    for column in pair:
        table[column] *= factors[column]
    with pytest.raises(RecordingError) as refused:
        load(table)
    assert str(refused.value).count("looks like") == 2
