"""Several recordings replayed end to end."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.noise import estimate_noise
from shaftline.mismatch.simulate.joint_replay import (
    NO_SHIFT,
    SEPARATE_STEPS,
    JointReplay,
    LinearReplay,
)
from shaftline.plant import Ship
from shaftline.plant.replay import Replay

from ..voyages import frigate_voyage, quick_frigate

FIRST, SECOND = frigate_voyage(seconds=20.0, seed=1), frigate_voyage(seconds=30.0, seed=2)
OVER_S = 2.0  # 40 steps of 0.05 s


@pytest.fixture(scope="module")
def both(frigate: Ship) -> JointReplay:
    return JointReplay(frigate, FIRST, SECOND)


def test_recordings_stand_end_to_end(both: JointReplay) -> None:
    assert both.segments == [(0, 101), (101, 252)]
    assert both.rows == 252
    assert both.interval_s == pytest.approx(0.2)
    assert both.time_s == pytest.approx(0.2 * np.arange(252))
    assert both.drive_rows == pytest.approx([*FIRST["fuel_rack_mm"], *SECOND["fuel_rack_mm"]])
    assert both.command == pytest.approx(
        [*FIRST["pitch_ratio_command"], *SECOND["pitch_ratio_command"]]
    )
    assert not both.inflow_rows.any()
    assert both.controllable


def test_each_starts_from_its_own_state(both: JointReplay, frigate: Ship) -> None:
    alone = [Replay(frigate, table, OVER_S) for table in (FIRST, SECOND)]
    expected = np.concatenate([run.simulate(frigate.record()) for run in alone])
    assert (both.simulate(frigate.record()) == expected).all()
    assert both.start == alone[0].start
    assert both.start[1] == pytest.approx(FIRST["shaft_speed_rad_s"][:5].mean())  # 1/20 of the rows


def test_the_first_states_are_shifted_alike(both: JointReplay, frigate: Ship) -> None:
    plain = both.simulate(frigate.record())
    moved = both.simulate(frigate.record(), (0.01, 0.2, -0.3))
    for first, _ in both.segments:
        change = [
            moved[name][first] - plain[name][first]
            for name in ("pitch_ratio", "shaft_speed", "ship_speed")
        ]
        assert change == pytest.approx([0.01, 0.2, -0.3])


def test_channels_are_measured_and_simulated_alike(both: JointReplay, frigate: Ship) -> None:
    measured = both.measured
    assert list(measured) == [
        "pitch_ratio",
        "shaft_speed_rad_s",
        "shaft_torque_N_m",
        "ship_speed_m_s",
    ]
    assert measured["ship_speed_m_s"] == pytest.approx(
        [*FIRST["ship_speed_m_s"], *SECOND["ship_speed_m_s"]]
    )
    samples = both.simulate(frigate.record())
    simulated = both.simulated(samples)
    assert list(simulated) == list(measured)
    assert (simulated["shaft_torque_N_m"] == samples["measured_shaft_torque"]).all()


def test_what_the_water_did_is_joined(frigate: Ship) -> None:
    tables = [
        table.assign(
            propeller_submergence_m=4.0 + 0.1 * i, inflow_velocity_m_s=0.9 * table["ship_speed_m_s"]
        )
        for i, table in enumerate((FIRST, SECOND))
    ]
    found = JointReplay(frigate, *tables)
    assert found.elevation_rows == pytest.approx(np.repeat([0.0, 0.1], [101, 151]))
    expected = -0.05 * np.concatenate([table["ship_speed_m_s"] for table in tables])
    assert found.inflow_rows == pytest.approx(expected)


@pytest.mark.parametrize(
    "other",
    [
        SECOND.drop(columns="shaft_torque_N_m"),
        SECOND.assign(time_s=1.02 * SECOND["time_s"]),
    ],
    ids=["columns", "interval"],
)
def test_recordings_that_do_not_go_together_are_named(frigate: Ship, other: pd.DataFrame) -> None:
    with pytest.raises(ValueError, match="recording 3 has other columns or another interval than"):
        JointReplay(frigate, FIRST, SECOND, other)
    JointReplay(frigate, FIRST, SECOND.assign(time_s=1.005 * SECOND["time_s"]))


def steady(rack: object = 20.0, pitch: object = 1.2) -> pd.DataFrame:
    return FIRST.assign(fuel_rack_mm=rack, pitch_ratio_command=pitch)


@pytest.mark.parametrize(("rise", "excited"), [(0.051, True), (0.049, False)])
def test_demands_excite_where_they_move_a_twentieth_of_their_size(
    frigate: Ship, rise: float, excited: bool
) -> None:
    half = np.arange(101) < 50
    assert not JointReplay(frigate, steady()).excited
    moving = np.where(half, 20.0 * (1.0 - rise), 20.0)
    assert JointReplay(frigate, steady(rack=moving)).excited is excited
    assert (
        JointReplay(frigate, steady(pitch=np.where(half, 1.2, 1.2 * (1.0 - rise)))).excited
        is excited
    )
    # the largest counts whatever its sign
    assert (
        JointReplay(frigate, steady(pitch=np.where(half, -1.2, -1.2 * (1.0 - rise)))).excited
        is excited
    )


def test_at_a_speed_that_is_held_the_ships_speed_excites(frigate: Ship, held_frigate: Ship) -> None:
    table = steady().assign(shaft_speed_rad_s=10.0, ship_speed_m_s=8.0)
    assert not JointReplay(held_frigate, table).excited
    slowing = table.assign(ship_speed_m_s=np.linspace(8.0, 6.0, 101))
    assert JointReplay(held_frigate, slowing).excited
    assert not JointReplay(frigate, slowing).excited


def test_a_demand_that_moves_for_a_moment_does_not_excite(frigate: Ship) -> None:
    rows = np.arange(101)
    assert not JointReplay(frigate, steady(rack=np.where(rows < 2, 10.0, 20.0))).excited
    assert JointReplay(frigate, steady(rack=np.where(rows < 4, 10.0, 20.0))).excited


def test_a_channel_without_noise_is_read_to_its_resolution(frigate: Ship) -> None:
    exact = FIRST.assign(ship_speed_m_s=np.linspace(-8.0, 5.0, 101))
    found = JointReplay(frigate, exact, exact)
    assert found.recorded["ship_speed_m_s"] == pytest.approx(
        [*exact["ship_speed_m_s"]] * 2, abs=0.0
    )
    added = found.measured["ship_speed_m_s"] - found.recorded["ship_speed_m_s"]
    assert added.std() == pytest.approx(8e-5, rel=0.15)
    assert (added[:101] != added[101:]).any()
    again = JointReplay(frigate, exact, exact)
    assert (again.measured["ship_speed_m_s"] == found.measured["ship_speed_m_s"]).all()
    for column in ("pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m"):
        assert (found.measured[column] == found.recorded[column]).all()


def test_an_angle_is_read_to_a_share_of_its_largest_step(servo: Ship) -> None:
    """However far it has counted: its derivative is then known as a speed would be."""
    time = 0.01 * np.arange(400)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": 10.0})
    found = JointReplay(servo, table.assign(shaft_angle_rad=1e4 + 50.0 * time))
    added = found.measured["shaft_angle_rad"] - found.recorded["shaft_angle_rad"]
    assert added.std() == pytest.approx(1e-5 * 0.5, rel=0.15)


@pytest.mark.parametrize(("rms", "left_alone"), [(1.2e-5, True), (0.8e-5, False)])
def test_noise_of_a_hundred_thousandth_is_noise(
    frigate: Ship, rms: float, left_alone: bool
) -> None:
    long = frigate_voyage(seconds=300.0)
    noise = 10.0 * rms * np.random.default_rng(1).standard_normal(len(long))
    found = JointReplay(frigate, long.assign(shaft_speed_rad_s=10.0 + noise))
    speed = "shaft_speed_rad_s"
    assert (found.measured[speed] == found.recorded[speed]).all() == left_alone
    expected = 10.0 * (rms if left_alone else np.hypot(rms, 1e-5))
    assert found.noise_rms[speed] == pytest.approx(expected, rel=0.1)


def test_the_noise_is_that_of_the_first_recording(frigate: Ship) -> None:
    rng = np.random.default_rng(1)
    tables = [
        frigate_voyage(seconds=60.0, seed=1).assign(
            shaft_speed_rad_s=10.0 + rms * rng.standard_normal(301)
        )
        for rms in (0.02, 0.5)
    ]
    found = JointReplay(frigate, *tables).noise_rms
    assert found["shaft_speed_rad_s"] == pytest.approx(0.02, rel=0.2)
    assert list(found) == ["pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"]


def voyage_of(seconds: float, seed: int) -> pd.DataFrame:
    return frigate_voyage(quick_frigate(), seed=seed, seconds=seconds)


@pytest.mark.parametrize("every", [1, 4])
def test_the_channels_alone_are_those_of_the_samples(every: int) -> None:
    tables = [voyage_of(60.0, 1), voyage_of(90.0, 2)]
    both = JointReplay(quick_frigate(), *tables, every=every)
    record = quick_frigate().record()
    whole, alone = both.simulated(both.simulate(record)), both.simulate_channels(record)
    for column, values in alone.items():
        np.testing.assert_array_equal(values, whole[column])


def test_rows_are_averaged_alike_in_what_was_recorded_and_simulated() -> None:
    tables = [voyage_of(60.0, 1), voyage_of(90.0, 2)]
    fine, coarse = (JointReplay(quick_frigate(), *tables, every=every) for every in (1, 4))
    assert coarse.interval_s == pytest.approx(0.8)
    assert coarse.segments == [(0, 75), (75, 187)]  # 301 and 451 rows
    record = quick_frigate().record()
    pairs = [
        (fine.recorded["shaft_speed_rad_s"], coarse.recorded["shaft_speed_rad_s"]),
        (fine.drive_rows, coarse.drive_rows),
        (fine.simulate(record)["thrust"], coarse.simulate(record)["thrust"]),
    ]
    for rows, means in pairs:
        assert means[:75] == pytest.approx(rows[:300].reshape(75, 4).mean(axis=1))
        assert means[75:] == pytest.approx(rows[301:749].reshape(112, 4).mean(axis=1))


def test_mistimed_demands_are_held_where_lines_were_drawn() -> None:
    table = voyage_of(200.0, 1)
    drawn = JointReplay(quick_frigate(), table, line=True)
    held = JointReplay(quick_frigate(), table)
    others = list(drawn.with_held_commands())
    moves = int(np.sum((np.diff(held.drive_rows) != 0.0) | (np.diff(held.command) != 0.0)))
    assert len(others) == moves <= SEPARATE_STEPS
    changed = [np.flatnonzero(other.runs[0].drive != drawn.runs[0].drive) for other in others]
    assert all(len(rows) <= held.runs[0].per_row for rows in changed)
    together = np.unique(np.concatenate(changed))
    np.testing.assert_array_equal(
        together, np.flatnonzero(held.runs[0].drive != drawn.runs[0].drive)
    )
    first = changed[0]
    np.testing.assert_array_equal(others[0].runs[0].drive[first], held.runs[0].drive[first])


def test_steps_coarser_than_noise_are_told() -> None:
    table = voyage_of(200.0, 1)
    assert JointReplay(quick_frigate(), table).quantisation == {}
    coarse = table.assign(pitch_ratio=np.round(table["pitch_ratio"] / 0.02) * 0.02)
    found = JointReplay(quick_frigate(), coarse).quantisation
    assert found == {"pitch_ratio": pytest.approx(0.02)}


def test_the_last_digits_of_a_simulation_are_no_steps() -> None:
    """They would stand in for the noise of the resolution, and be far less than it."""
    table = voyage_of(200.0, 1)
    torque = 1.0 + 1e-6 * np.sin(table["time_s"] / 7.0)
    rounded = table.assign(shaft_torque_N_m=1e6 * np.round(torque, 7))
    assert estimate_noise(rounded["shaft_torque_N_m"].to_numpy(), 0.1).quantisation > 0.0
    assert JointReplay(quick_frigate(), rounded).quantisation == {}


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("way", ["nonlinear", "steady", "linear"])
def test_several_ships_have_the_channels_of_each_alone(frigate: Ship, every: int, way: str) -> None:
    kind = LinearReplay if way == "linear" else JointReplay
    replay = kind(frigate, FIRST, SECOND, every=every, steady=way == "steady")
    records = [frigate.record() for _ in range(5)]
    for i, record in enumerate(records):
        record["mass"] *= 1.0 + 0.1 * i
        record["resistance_coefficient"] *= 1.0 + 0.02 * i
    shifts = [(0.0, 0.1 * i, 0.05 * i) for i in range(5)]
    for given in (shifts, []):
        found = replay.simulate_ships(records, given)
        for record, shift, channels in zip(records, given or [NO_SHIFT] * 5, found, strict=True):
            alone = replay.simulate_channels(record, shift)
            assert list(channels) == list(alone) == replay.channels
            assert all(np.array_equal(values, alone[c]) for c, values in channels.items())


@pytest.mark.parametrize("every", [1, 3])
def test_some_signals_have_the_values_of_the_whole_simulation(frigate: Ship, every: int) -> None:
    replay = JointReplay(frigate, FIRST, SECOND, every=every)
    samples = replay.simulate(frigate.record())
    found = replay.simulate_signals(frigate.record(), ["resistance", "thrust"])
    assert list(found) == ["resistance", "thrust"]
    for name, values in found.items():
        np.testing.assert_allclose(values, samples[name], rtol=1e-13)


def test_no_ships_have_no_channels(both: JointReplay) -> None:
    assert both.simulate_ships([]) == []
