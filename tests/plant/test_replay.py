"""A recording replayed: what drives the ship, where it starts, and the same by every way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    load_ship,
    realise,
    simulate,
)
from shaftline.plant.columns import MEASURED as ANSWERS
from shaftline.plant.columns import input_columns
from shaftline.plant.recording import RecordingError
from shaftline.plant.replay import Replay, simulate_recording
from shaftline.plant.seas import Sea
from shaftline.plant.simulation import alike_groups
from shaftline.plant.waves import wave_field

from .terms import with_term

FRICTION = "transmission.coulomb_friction_engine_side_N_m"
MEASURED = ["pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"]
LAGS = {"prime_mover.lag_s": 1.5, "propeller.inflow_lag_s": 2.0}


def sailed(ship: Ship, period: float = 0.05, rows: int = 400) -> pd.DataFrame:
    """A recording of the ship itself, its rack and pitch stepping on the way."""
    time = period * np.arange(rows)
    rack = np.where(time < 0.3 * time[-1], 22.0, 27.0)
    pitch = np.where(time < 0.6 * time[-1], 1.4, 1.2)
    per_row = round(period / ship.time_step_s)
    schedule = Schedule(np.repeat(rack[:-1], per_row), np.repeat(pitch[:-1], per_row))
    start = equilibrium(ship, 22.0, 1.4).state
    s = simulate(ship, schedule, time[-1], initial=start)[::per_row]
    names = ["measured_pitch_ratio", "shaft_speed", "measured_shaft_torque", "measured_ship_speed"]
    inputs = {"time_s": time, "fuel_rack_mm": rack, "pitch_ratio_command": pitch}
    return pd.DataFrame(inputs | dict(zip(MEASURED, (s[n] for n in names), strict=True)))


@pytest.mark.parametrize("period", [0.05, 0.1])
@pytest.mark.parametrize("values", [{}, LAGS], ids=["nominal", "lags"])
def test_ship_repeats_its_own_recording(
    frigate: Ship, values: dict[str, float], period: float
) -> None:
    ship = frigate.with_values(values)
    recording = sailed(ship, period)
    found = simulate_recording(ship, recording)
    for name in MEASURED:
        np.testing.assert_allclose(found[name], recording[name], rtol=1e-7, err_msg=name)


def test_recording_of_inputs_alone_starts_in_their_steady_state(frigate: Ship) -> None:
    recording = sailed(frigate)
    found = simulate_recording(frigate, recording[input_columns(frigate)])
    np.testing.assert_allclose(found["ship_speed_m_s"], recording["ship_speed_m_s"], rtol=1e-8)


@pytest.mark.parametrize("values", [{}, LAGS | {"hull.current_m_s": 0.4}], ids=["calm", "lags"])
def test_measured_inflow_and_submergence_act(frigate: Ship, values: dict[str, float]) -> None:
    """A gust and a rising surface that the recording knows only by what was measured."""
    losses = {"propeller.cavitation_breakdown": 0.3, "propeller.cavitation_onset_number": 8.0}
    ship = frigate.with_values(losses | values)
    schedule = Schedule(24.0, 1.3, inflow=lambda t: 0.05 * t, elevation=lambda t: -0.1 * t)
    s = simulate(ship, schedule, 20.0, initial=equilibrium(ship, 24.0, 1.3).state)
    water = s["ship_speed"] - ship.hull.current_m_s
    recording = pd.DataFrame(
        {
            "time_s": s["time"],
            "fuel_rack_mm": s["drive"],
            "pitch_ratio_command": 1.3,
            "pitch_ratio": s["measured_pitch_ratio"],
            "shaft_speed_rad_s": s["shaft_speed"],
            "shaft_torque_N_m": s["measured_shaft_torque"],
            "ship_speed_m_s": s["measured_ship_speed"],
            "inflow_velocity_m_s": 0.95 * water + 0.05 * s["time"],
            "propeller_submergence_m": s["submergence"],
        }
    )
    found = simulate_recording(ship, recording)
    for name in [*MEASURED, "inflow_velocity_m_s", "propeller_submergence_m"]:
        np.testing.assert_allclose(found[name], recording[name], rtol=1e-7, err_msg=name)
    blind = simulate_recording(ship, recording.drop(columns="inflow_velocity_m_s"))
    assert np.ptp(blind["shaft_speed_rad_s"] - recording["shaft_speed_rad_s"]) > 0.01
    deep = simulate_recording(ship, recording.drop(columns="propeller_submergence_m"))
    assert np.ptp(deep["shaft_speed_rad_s"] - recording["shaft_speed_rad_s"]) > 0.01


def test_measured_inflow_of_a_fixed_hull_needs_no_speed(frigate: Ship) -> None:
    moored = frigate.with_values({"hull.fixed": True})
    s = simulate(
        moored, Schedule(15.0, 0.8, inflow=2.0), 10.0, initial=equilibrium(moored, 15, 0.8).state
    )
    recording = pd.DataFrame(
        {
            "time_s": s["time"],
            "fuel_rack_mm": 15.0,
            "pitch_ratio_command": 0.8,
            "pitch_ratio": 0.8,
            "shaft_speed_rad_s": s["shaft_speed"],
            "ship_speed_m_s": 0.0,
            "inflow_velocity_m_s": 2.0,
        }
    )
    found = simulate_recording(moored, recording)
    np.testing.assert_allclose(found["shaft_speed_rad_s"], s["shaft_speed"], rtol=1e-9)


def test_measured_inflow_of_a_moving_hull_needs_its_speed(frigate: Ship) -> None:
    recording = sailed(frigate).drop(columns="ship_speed_m_s").assign(inflow_velocity_m_s=8.0)
    with pytest.raises(RecordingError, match="inflow_velocity_m_s needs the column ship_speed_m_s"):
        simulate_recording(frigate, recording)


def plain(rows: int = 41, interval: float = 0.05, **columns: Any) -> pd.DataFrame:
    """A recording of held demands and whatever else."""
    base = {
        "time_s": 100.0 + interval * np.arange(rows),
        "fuel_rack_mm": 22.0,
        "pitch_ratio_command": 1.4,
    }
    return pd.DataFrame(base | columns)


@pytest.mark.parametrize(
    ("interval", "per_row"),
    [(0.05, 1), (0.02, 1), (0.1, 2), (0.12, 3), (0.15, 3), (0.3, 6), (1.0, 20)],
)
def test_each_row_is_taken_in_steps_no_longer_than_the_ships(
    frigate: Ship, interval: float, per_row: int
) -> None:
    replay = Replay(frigate, plain(interval=interval))
    assert replay.per_row == per_row
    assert replay.dt == pytest.approx(interval / per_row, rel=1e-12)
    assert replay.interval_s == pytest.approx(interval, rel=1e-12)
    assert (replay.time_s[0], replay.rows) == (0.0, 41)
    assert len(replay.drive) == len(replay.pitch) == 40 * per_row


def test_demands_are_held_and_what_the_water_does_is_not(frigate: Ship) -> None:
    rack, depth = np.linspace(20.0, 24.0, 5), np.array([4.0, 5.0, 3.0, 4.0, 6.0])
    table = plain(5, 0.1, fuel_rack_mm=rack, propeller_submergence_m=depth)
    replay = Replay(frigate, table)
    assert replay.drive.tolist() == np.repeat(rack[:-1], 2).tolist()
    assert replay.elevation_rows.tolist() == [0.0, 1.0, -1.0, 0.0, 2.0]
    expected = np.interp(np.arange(17) / 4.0, np.arange(5), depth - 4.0)
    np.testing.assert_allclose(replay.elevation, expected, atol=1e-12)
    assert replay.resistance_factor.tolist() == [1.0] * 17


def test_demands_may_be_lines_between_rows(frigate: Ship) -> None:
    """Each step has the line's value at its middle; without steps between rows, the rows' mean."""
    rack = np.array([20.0, 22.0, 20.0])
    table = plain(3, interval=0.2, fuel_rack_mm=rack, pitch_ratio_command=[1.4, 1.4, 1.2])
    found = Replay(frigate, table, line=True)
    assert found.per_row == 4
    assert found.drive == pytest.approx([20.25, 20.75, 21.25, 21.75, 21.75, 21.25, 20.75, 20.25])
    assert found.pitch[4:] == pytest.approx([1.375, 1.325, 1.275, 1.225])
    close = Replay(frigate, table.assign(time_s=[0.0, 0.05, 0.1]), line=True)
    assert close.drive == pytest.approx([21.0, 21.0])


def test_channels_are_those_measured(frigate: Ship) -> None:
    table = plain(thrust_N=2e5, shaft_speed_rad_s=10.0, remark=1.0)
    assert Replay(frigate, table).channels == ["shaft_speed_rad_s", "thrust_N"]


def test_measured_inflow_takes_the_place_of_the_wakes(frigate: Ship) -> None:
    values = {
        "hull.current_m_s": 0.5,
        "hull.wake_slope_s_m": 0.01,
        "hull.wake_reference_speed_m_s": 6.0,
    }
    ship = frigate.with_values(values)
    speed = np.linspace(7.0, 9.0, 41)
    replay = Replay(ship, plain(ship_speed_m_s=speed, inflow_velocity_m_s=7.0))
    water = speed - 0.5
    expected = 7.0 - (0.95 - 0.01 * (water - 6.0)) * water
    np.testing.assert_allclose(replay.inflow_rows(ship.record()), expected, rtol=1e-12)
    assert not Replay(ship, plain()).inflow_rows(ship.record()).any()


MEASURED_START: dict[str, Any] = {
    "pitch_ratio": 1.2,
    "shaft_speed_rad_s": 10.0,
    "ship_speed_m_s": 8.0,
}


def test_it_starts_at_the_measured_state(frigate: Ship) -> None:
    assert Replay(frigate, plain(**MEASURED_START)).start == (1.2, 10.0, 8.0)


@pytest.mark.parametrize(
    ("over_s", "rows", "count"),
    [(0.0, 400, 1), (0.5, 400, 10), (0.26, 400, 5), (5.0, 400, 20), (5.0, 10, 1)],
)
def test_the_start_is_averaged_but_over_no_more_than_a_twentieth(
    frigate: Ship, over_s: float, rows: int, count: int
) -> None:
    speed = 10.0 + 0.1 * (-1.0) ** np.arange(rows) + 0.05 * np.sin(np.arange(rows))
    table = plain(rows, **(MEASURED_START | {"shaft_speed_rad_s": speed}))
    assert Replay(frigate, table, over_s).start[1] == pytest.approx(speed[:count].mean(), rel=1e-12)


def test_a_shaft_that_runs_up_starts_at_its_first_speed(frigate: Ship) -> None:
    speed = np.linspace(10.0, 11.0, 400) ** 2 / 10.0
    table = plain(400, **MEASURED_START).assign(shaft_speed_rad_s=speed)
    assert Replay(frigate, table, 0.5).start[1] == pytest.approx(10.0, abs=0.004)  # mean: 10.226


def test_what_was_not_measured_starts_steady(frigate: Ship) -> None:
    steady = equilibrium(frigate, 22.0, 1.4).state
    assert Replay(frigate, plain()).start == (1.4, steady.shaft_speed, steady.ship_speed)
    some = Replay(frigate, plain(shaft_speed_rad_s=9.0)).start
    assert some == (1.4, 9.0, steady.ship_speed)


def test_a_start_that_cannot_be_found_says_what_is_lacking(frigate: Ship) -> None:
    table = plain(fuel_rack_mm=2.0, pitch_ratio=1.4)
    words = "no shaft_speed_rad_s, ship_speed_m_s to start from, and frigate: no steady state"
    with pytest.raises(RecordingError, match=words):
        Replay(frigate, table)


def test_moored_ship_of_fixed_pitch_needs_a_shaft_speed_alone() -> None:
    tug = load_ship("tito-neri-sine")
    table = pd.DataFrame(
        {
            "time_s": 1e-3 * np.arange(9),
            "motor_voltage_V": 5.0,
            "shaft_speed_rad_s": 70.0,
            "ship_speed_m_s": 0.3,
            "pitch_ratio": 0.7,
            "pitch_ratio_command": 0.7,
        }
    )
    replay = Replay(tug, table)
    assert replay.start == (1.0, 70.0, 0.0)
    assert replay.command.tolist() == [1.0] * 9
    found = simulate_recording(tug, table)
    assert "pitch_ratio_command" not in found
    assert found["motor_voltage_V"].tolist() == [5.0] * 9
    assert "motor_current_A" not in found
    asked = simulate_recording(tug, table.assign(motor_current_A=1.0))
    assert asked["motor_current_A"].iloc[0] == pytest.approx((5.0 - 0.0183 * 210.0) / 1.51)


def test_a_delay_must_fit_the_replays_step(frigate: Ship) -> None:
    ship = frigate.with_values({"sensors.torque_delay_s": 5.5})
    with pytest.raises(ShipError, match=r"torque_delay_s = 5\.5 s exceeds 5\.1 s"):
        Replay(ship, plain(interval=0.01, **MEASURED_START))


STEADY = {
    "prime_mover.lag_s": 1.5,
    "prime_mover.dead_time_s": 0.22,
    "propeller.inflow_lag_s": 2.0,
    "pitch_actuator.offset": 0.05,
    "sensors.speed_log_lag_s": 5.0,
    "sensors.torque_delay_s": 0.13,
    "hull.current_m_s": 0.5,
    "hull.wake_slope_s_m": 0.004,
}


@pytest.mark.parametrize(
    "measured", [{}, {"propeller_submergence_m": 4.0}], ids=["inputs", "depth"]
)
def test_a_steady_recording_is_replayed_without_a_transient(
    frigate: Ship, measured: dict[str, float]
) -> None:
    ship = frigate.with_values(STEADY)
    found = simulate_recording(ship, plain(401, pitch_ratio_command=1.2, **measured))
    start = equilibrium(ship, 22.0, 1.2)
    for name in MEASURED:
        np.testing.assert_allclose(found[name], found[name][0], rtol=1e-8, err_msg=name)
    assert found["shaft_torque_N_m"][0] == pytest.approx(start.outputs.shaft_torque, rel=1e-8)
    assert found["pitch_ratio"][0] == pytest.approx(1.25)


def test_a_lagging_inflow_starts_where_the_measured_one_is(frigate: Ship) -> None:
    """A measured inflow a metre per second above the wake's, from the first row on."""
    ship = frigate.with_values(STEADY)
    start = equilibrium(ship, 22.0, 1.2, inflow=1.0).state
    water = start.ship_speed - 0.5
    table = plain(
        201,
        pitch_ratio_command=1.2,
        pitch_ratio=start.pitch_ratio,
        shaft_speed_rad_s=start.shaft_speed,
        ship_speed_m_s=start.ship_speed,
        inflow_velocity_m_s=(0.95 - 0.004 * water) * water + 1.0,
    )
    found = simulate_recording(ship, table)
    for name in MEASURED:
        np.testing.assert_allclose(found[name], found[name][0], rtol=1e-7, err_msg=name)


@pytest.mark.parametrize("interval", [0.05, 0.1])
def test_every_way_of_replaying_gives_the_same(frigate: Ship, interval: float) -> None:
    """With a current, a wake that changes with speed, lags, and a measured inflow and depth."""
    ship = frigate.with_values(STEADY)
    rows = 200
    time = interval * np.arange(rows)
    table = plain(
        rows,
        interval,
        fuel_rack_mm=22.0 + 3.0 * np.sin(0.3 * time),
        pitch_ratio_command=1.2,
        pitch_ratio=1.25,
        shaft_speed_rad_s=10.4,
        shaft_torque_N_m=9e4,
        ship_speed_m_s=8.0 + 0.02 * time,
        inflow_velocity_m_s=7.6 + 0.3 * np.sin(time),
        propeller_submergence_m=4.0 + 0.2 * np.cos(time),
    )
    found = simulate_recording(ship, table)
    joint = JointReplay(ship, table)
    replay = Replay(ship, table)
    # a diagnosis averages the start over some rows
    pitch, shaft, speed = (a - b for a, b in zip(replay.start, joint.start, strict=True))
    again = joint.simulate(ship.record(), (pitch, shaft, speed))
    for column in MEASURED:
        np.testing.assert_allclose(found[column], again[ANSWERS[column]], rtol=1e-9, err_msg=column)
    # and by a schedule that knows the disturbance
    half = np.arange(2 * len(replay.drive) + 1) * 0.5 * replay.dt
    inflow = np.interp(half, replay.time_s, replay.inflow_rows(ship.record()))
    first = equilibrium(ship, 22.0, 1.2).state._replace(
        pitch_ratio=1.25,
        shaft_speed=10.4,
        ship_speed=8.0,
        inflow=7.6,
        brake_torque=-45.5 * 7.38 * 10.4 + 1428.6 * table["fuel_rack_mm"][0] - 7381.0,
    )
    schedule = Schedule(replay.drive, replay.pitch, inflow, 1.0, replay.elevation)
    direct = simulate(ship, schedule, replay.time_s[-1], initial=first)[:: replay.per_row]
    for column in MEASURED:
        np.testing.assert_allclose(
            found[column], direct[ANSWERS[column]], rtol=1e-9, err_msg=column
        )


def ships_of_every_kind(ship: Ship) -> list[Any]:
    """Return records of eight ships that are alike, and of others among them that are not."""
    mass = ship.hull.mass_kg
    alike = [ship.with_values({"hull.mass_kg": mass * (1.0 + 0.02 * i)}) for i in range(8)]
    rubbing = ship.with_values({FRICTION: 2e3})
    with_a_term = with_term(ship, "-1e4", "thrust")
    return [s.record() for s in (*alike[:3], with_a_term, *alike[3:5], rubbing, *alike[5:])]


def test_ships_are_grouped_that_can_be_simulated_at_once(frigate: Ship) -> None:
    records = ships_of_every_kind(frigate)
    assert alike_groups(records) == [[0, 1, 2, 4], [3], [5, 7, 8, 9], [6]]
    assert alike_groups(records[:3]) == [[0, 1, 2]]
    assert alike_groups(records[:2]) == [[0], [1]]  # which two at once would not make faster
    assert alike_groups(records[:1]) == [[0]]
    assert alike_groups([]) == []


@pytest.mark.parametrize("interval", [0.05, 0.1])
@pytest.mark.parametrize("water", [{}, {"inflow_velocity_m_s": 7.0}], ids=["wake", "measured"])
@pytest.mark.parametrize("count", [3, 4, 10])
def test_several_ships_are_simulated_with_the_bits_of_each_alone(
    frigate: Ship, count: int, water: dict[str, float], interval: float
) -> None:
    # The measured inflow gives another disturbance for each wake.
    records = ships_of_every_kind(frigate.with_values({"prime_mover.lag_s": 0.5}))[-count:]
    for i, record in enumerate(records):
        record["wake_fraction"] = 0.05 + 0.01 * i
    rows = 201
    rack = 20.0 + 4.0 * np.sin(0.05 * np.arange(rows))
    replay = Replay(frigate, plain(rows, interval, **MEASURED_START | water, fuel_rack_mm=rack))
    starts = [tuple(0.01 * i + x for x in replay.start) for i in range(count)]
    found = replay.channels_of_ships(records, starts)
    for record, start, channels in zip(records, starts, found, strict=True):
        alone = replay.simulate_channels(record, start)
        samples = replay.simulate(record, start)
        assert list(channels) == replay.channels
        for column, values in channels.items():
            assert np.array_equal(values, alone[column])
            assert np.array_equal(values, samples[ANSWERS[column]])
    speeds = {float(channels["shaft_speed_rad_s"][-1]) for channels in found}
    assert len(speeds) == count


def test_a_group_that_disagrees_has_the_bits_of_each_alone(frigate: Ship) -> None:
    replay = Replay(frigate, plain(201, **MEASURED_START, fuel_rack_mm=0.0))  # the engines stall
    records = [frigate.with_values({"propeller.depth_m": 3.0 + 0.2 * i}).record() for i in range(4)]
    starts = [(1.2, 2.0 + i, 8.0) for i in range(4)]
    assert len(alike_groups(records)) == 1
    for record, start, channels in zip(
        records, starts, replay.channels_of_ships(records, starts), strict=True
    ):
        alone = replay.simulate_channels(record, start)
        assert all(np.array_equal(values, alone[c]) for c, values in channels.items())


def test_a_sea_is_added_and_left_as_it_was(frigate: Ship) -> None:
    sea = realise(Sea(hs_m=2.0, tp_s=9.0), 4.0, 3)
    before = sea.tobytes()
    table = plain(101, **MEASURED_START)
    samples = Replay(frigate, table).simulate(frigate.record(), sea=sea)
    assert sea.tobytes() == before
    inflow, _ = wave_field(sea, 0.0, 0.0)
    assert samples["advance_velocity"][0] == pytest.approx(0.95 * 8.0 + inflow, rel=1e-12)
    calm = Replay(frigate, table).simulate(frigate.record())
    assert calm["advance_velocity"][0] == pytest.approx(0.95 * 8.0, rel=1e-12)


def test_a_replay_starts_elsewhere_where_it_is_told_and_runs_again_the_same(frigate: Ship) -> None:
    replay, plant = Replay(frigate, plain(**MEASURED_START)), frigate.record()
    first = replay.simulate(plant)
    other = replay.simulate(plant, (1.1, 9.0, 7.0))
    assert (other[0]["pitch_ratio"], other[0]["shaft_speed"], other[0]["ship_speed"]) == (
        1.1,
        9.0,
        7.0,
    )
    assert replay.simulate(plant).tobytes() == first.tobytes()  # and the first is no view
    assert first[0]["shaft_speed"] == 10.0


def test_only_what_the_recording_asks_for_is_told_besides(frigate: Ship) -> None:
    found = simulate_recording(frigate, plain(**MEASURED_START))
    assert list(found) == [*input_columns(frigate), *MEASURED]
    more = simulate_recording(
        frigate, plain(**MEASURED_START, thrust_N=1.0, propeller_submergence_m=4.0)
    )
    assert list(more) == [*input_columns(frigate), "propeller_submergence_m", *MEASURED, "thrust_N"]
    assert more["time_s"][0] == 100.0
    assert more["thrust_N"][0] > 1e4
