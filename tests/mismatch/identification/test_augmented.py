"""The augmented filter as a method: recordings in, numbers and what is wrong with them out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.identification.augmented_filter import (
    ekf,
    smallest_change,
    state_sizes,
    tune_filter,
)
from shaftline.mismatch.identify import METHODS, MethodInput, identify
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.observers import ObserverError
from shaftline.plant import approach, get_sea, load_ship, realise, simulate_recording, zig_zag
from shaftline.plant.columns import (
    HEADING,
    RUDDER,
    RUDDER_COMMAND,
    SWAY_SPEED,
    YAW_RATE,
    drive_column,
)
from shaftline.plant.state import active_states

from ..voyages import bench_tug, frigate_voyage, tug_run

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
INERTIA = "transmission.inertia_engine_side_kg_m2"
RACK = "prime_mover.torque_per_rack_N_m_mm"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
FOULING = "hull.fouling_fraction"
TRUTH = {RESISTANCE: 3306.2 * 1.15, INERTIA: 53697.0 * 0.8, RACK: 1428.6 * 1.06, FRICTION: 6e3}


def test_numbers_far_off_are_found_within_their_errors() -> None:
    ship, keys = load_ship("frigate"), tuple(TRUTH)
    told: list[tuple[str, int, int]] = []
    table = frigate_voyage(TRUTH, seed=3, seconds=400.0)
    found = ekf(ship, [table], keys, lambda *what: told.append(what))
    assert found.keys == keys
    for key, value, error in zip(found.keys, found.values, found.standard_errors, strict=True):
        assert abs(value - TRUTH[key]) < 3.0 * error, key
        assert error < (0.15 if key == FRICTION else 0.02) * value, key
    assert found.remarks == ()
    assert {stage for stage, *_ in told} == {
        "noise of the states",
        "passes of the filter",
        "tolerances of the other numbers",
    }
    estimates = found.tables["estimates"]
    assert list(estimates) == ["time_s", *(f"{k}{s}" for k in keys for s in ("", " se"))]
    assert (estimates["time_s"].iloc[0], estimates["time_s"].iloc[-1]) == (0.0, 400.0)
    # it begins as unsure as the module says, and ends where the filter does, without the tolerances
    assert estimates[f"{RESISTANCE} se"].iloc[0] == pytest.approx(0.5 * 3306.2, rel=1e-3)
    assert estimates[RESISTANCE].iloc[-1] == pytest.approx(TRUTH[RESISTANCE], rel=2e-3)
    assert estimates[f"{RESISTANCE} se"].iloc[-1] < 0.5 * found.standard_errors[0]
    noises = found.tables["innovations"].set_index("channel")
    assert noises["noise"]["shaft_torque_N_m"] == pytest.approx(1.5e3, rel=0.1)
    np.testing.assert_allclose(noises["rms"], 1.0, atol=0.06)


def test_what_the_tolerances_add() -> None:
    """With the other numbers known exactly, the errors are the filter's own."""
    ship, table = load_ship("frigate"), frigate_voyage(TRUTH, seed=3, seconds=120.0)
    keys = (RESISTANCE, RACK)
    exact = ekf(ship, [table], keys, tolerance=0.0)
    own = exact.tables["estimates"][f"{RESISTANCE} se"].iloc[-1]
    assert exact.standard_errors[0] == pytest.approx(own, rel=0.1)
    unsure = ekf(ship, [table], keys, tolerance=2.0)
    assert unsure.values == exact.values
    # at least that of the thrust, which resistance stands against: 0.2 % of KT, twice
    assert unsure.standard_errors[0] > 2.0 * 0.002 * unsure.values[0]


def test_two_recordings_tell_more_than_one() -> None:
    ship = load_ship("frigate")
    tables = [frigate_voyage({FOULING: 0.1}, seed=s, seconds=150.0) for s in (1, 2)]
    one = ekf(ship, tables[:1], (FOULING,), tolerance=0.0)
    both = ekf(ship, tables, (FOULING,), tolerance=0.0)
    assert both.standard_errors[0] < 0.9 * one.standard_errors[0]
    assert both.values[0] == pytest.approx(0.1, abs=3.5 * both.standard_errors[0])


def test_at_sea_the_numbers_are_still_found() -> None:
    """Waves disturb the inflow; the noise of that is found, and said not to be white."""
    sea = get_sea("state-5")
    assert sea is not None
    truth = {RESISTANCE: 3306.2 * 1.15, RACK: 1428.6 * 1.06}
    table = frigate_voyage(
        truth, seed=2, seconds=300.0, sea=realise(sea, depth_m=4.0, seed=2), interval_s=0.1
    )
    found = ekf(load_ship("frigate"), [table], tuple(truth))
    np.testing.assert_allclose(found.values, [*truth.values()], rtol=0.01)
    for key, value, error in zip(found.keys, found.values, found.standard_errors, strict=True):
        assert abs(value - truth[key]) < 3.0 * error
    assert any("are not white" in remark and "waves" in remark for remark in found.remarks)


def test_a_number_that_drifts_is_followed() -> None:
    ship = load_ship("frigate")
    first, then = (frigate_voyage({FOULING: f}, seed=4, seconds=200.0) for f in (0.05, 0.25))
    still = ekf(ship, [first, then], (FOULING,))
    assert any(
        remark.startswith(f"the estimate of {FOULING} has not converged")
        for remark in still.remarks
    )
    drifting = ekf(ship, [first, then], (FOULING,), parameter_walk={FOULING: 0.01})
    assert drifting.values[0] == pytest.approx(0.25, abs=0.03)
    assert not any("has not converged" in remark for remark in drifting.remarks)
    estimates = drifting.tables["estimates"]
    halfway = estimates[FOULING].iloc[len(estimates) // 2 - 20]
    assert halfway == pytest.approx(0.05, abs=0.03)


def test_physics_that_is_missing_leaves_innovations_that_are_not_white() -> None:
    table = frigate_voyage({"prime_mover.lag_s": 2.5}, seed=3, seconds=150.0)
    found = ekf(load_ship("frigate"), [table], (RESISTANCE,))
    assert any("shaft_speed_rad_s are not white" in remark for remark in found.remarks)


def test_a_ratio_is_refused_with_both_names() -> None:
    keys = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
    with pytest.raises(
        ValueError, match=r"torque_coefficient and propeller\.relative_rotative_eff"
    ):
        ekf(bench_tug(), [tug_run()], keys)


def test_a_number_that_is_not_excited_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"fuel_base_g_kWh is not identifiable: no measured channel"
    ):
        ekf(
            load_ship("frigate"),
            [frigate_voyage(seed=1, seconds=60.0)],
            (RESISTANCE, "prime_mover.fuel_base_g_kWh"),
        )


def test_what_is_hardly_told_is_said() -> None:
    """Resistance, doubted by as little as a short recording tells of it."""
    table = frigate_voyage(seed=1, seconds=60.0)
    found = ekf(load_ship("frigate"), [table], (RESISTANCE,), spread={RESISTANCE: 5.0})
    assert any(f"little information about {RESISTANCE}" in remark for remark in found.remarks)


@pytest.mark.parametrize("key", [FRICTION, FOULING, "transmission.quadratic_drag_N_m_s2_rad2"])
def test_how_far_a_number_is_doubted_that_is_zero(key: str) -> None:
    """One standard deviation moves a channel by a tenth of its size."""
    ship = load_ship("frigate")
    replay = JointReplay(ship, frigate_voyage(seed=1, seconds=60.0))
    nominal = replay.simulate(ship.record())
    size = smallest_change(replay, key, nominal)
    moved = replay.simulate(ship.with_values({key: size}).record())
    before, after = replay.simulated(nominal), replay.simulated(moved)
    felt = max(
        math.sqrt(np.mean((after[c] - before[c]) ** 2) / np.mean(before[c] ** 2)) for c in before
    )
    assert felt == pytest.approx(0.1, rel=0.15)


def test_the_method_takes_what_is_not_set_aside() -> None:
    ship = load_ship("frigate")
    table = frigate_voyage({FOULING: 0.1}, seed=6, seconds=200.0)
    spoilt = table.copy()
    spoilt.loc[601:800, "ship_speed_m_s"] = 3.0
    calls: list[Any] = []
    for recording in (table, spoilt):
        balances = Balances(JointReplay(ship, recording))
        work = MethodInput(balances, (recording,), [(0, 601), (801, 1001)], 1.0, lambda *_: None)
        calls.append(METHODS["ekf"].find(work, (FOULING,)))
    assert calls[0].values == calls[1].values
    assert calls[0].values[0] == pytest.approx(0.1, abs=3.5 * calls[0].standard_errors[0])


@pytest.mark.parametrize(
    ("name", "speed", "helm", "every", "within"),
    [
        ("ddg-51-surrogate", 11.3, RUDDER, 10, (0.03, 0.04, 0.02, 0.02)),
        ("esso-osaka", 3.6, RUDDER_COMMAND, 1, (0.01, 0.025, 0.01, 0.005)),
    ],
)
def test_derivatives_of_a_hull_are_told_from_a_zig_zag(
    name: str, speed: float, helm: str, every: int, within: tuple[float, ...]
) -> None:
    """With a shaft that is free or held, a rudder that was measured or commanded."""
    ship = load_ship(name)
    keys = tuple(f"manoeuvring.{k}" for k in ("Y_v", "Y_r", "N_v", "N_r"))
    shares = np.array([1.2, 0.8, 0.9, 1.15])
    truth = shares * [ship.parameter(key).value for key in keys]
    own = ship.with_values(dict(zip(keys, map(float, truth), strict=True)))
    point, ten = approach(own, speed), math.radians(10.0)
    track = zig_zag(own, point, ten, ten, executes=8).track[::every].reset_index(drop=True)
    rng = np.random.default_rng(1)

    def read(values: pd.Series, rms: float) -> pd.Series:
        return values + rms * rng.standard_normal(len(values))

    columns = {"time_s": track["time_s"], helm: track["rudder_rad"]}
    if ship.turns_freely:
        columns["shaft_speed_rad_s"] = read(track["shaft_speed_rad_s"], 0.01)
    columns[drive_column(ship)] = 0.0 * track["time_s"] + point.inputs.drive
    ahead = track["speed_m_s"] * np.cos(track["drift_rad"])
    across = -track["speed_m_s"] * np.sin(track["drift_rad"])
    columns["ship_speed_m_s"] = read(ahead, 0.005 * speed)
    columns[SWAY_SPEED] = read(across, 0.002 * speed)
    columns[YAW_RATE] = read(track["yaw_rate_rad_s"], 2e-4)
    columns[HEADING] = read(track["heading_rad"], 2e-3)
    found = ekf(ship, [pd.DataFrame(columns)], keys, tolerance=0.0)
    off = np.array(found.values) / truth - 1.0
    assert np.all(np.abs(off) < within)
    # 20 % wrong before; and as sure of it as the noise allows
    errors = np.asarray(found.standard_errors) / np.abs(truth)
    assert np.all(errors < within)
    assert np.all(np.abs(off) < 4.0 * errors)
    assert found.remarks == ()


@pytest.mark.parametrize("name", ["frigate-at-sea", "frigate-turning", "tito-neri-sine"])
def test_every_state_that_a_ship_has_has_a_size(name: str) -> None:
    """Charge air, warmth, ventilation and the like are no signals of a simulation."""
    ship = load_ship(name)
    drive = 0.55 * float(ship.record()["drive_max"])
    orders = pd.DataFrame({"time_s": np.arange(60) * 0.5, drive_column(ship): drive})
    if ship.has_variable_pitch:
        orders["pitch_ratio_command"] = 1.2
    replay = JointReplay(ship, simulate_recording(ship, orders))
    sizes = state_sizes(replay, (INERTIA,))
    assert list(sizes) == active_states(ship.record())
    nominal = replay.simulate(ship.record())
    for state in ("brake_torque", "motor_current", "ship_speed"):
        if state in sizes:
            expected = math.sqrt(float(np.mean(nominal[state] ** 2)))
            assert sizes[state] == pytest.approx(expected, rel=1e-6)
    assert sizes.get("charge", 1.0) > 0.0
    assert sizes.get("warmth", 1.0) > 0.0


def test_the_adaptive_method_follows_the_noise() -> None:
    """The torque meter becomes three times noisier at half time; the report says so."""
    table = frigate_voyage({FOULING: 0.1}, seed=7, seconds=240.0)
    rng, later = np.random.default_rng(1), table["time_s"] > 120.0
    more = math.sqrt(8.0) * 1400.0 * rng.standard_normal(later.sum())
    table.loc[later, "shaft_torque_N_m"] += more
    other = frigate_voyage({FOULING: 0.1}, seed=8, seconds=60.0)
    found = {
        method: identify(
            load_ship("frigate"), table, free=[FOULING], method=method, hold_out=[other]
        )
        for method in ("ekf", "ekf-adaptive")
    }
    plain, own = found["ekf"], found["ekf-adaptive"]
    assert "noise" not in plain.tables
    assert "noise" not in plain.to_dict()
    assert "Noise of the filter" not in plain.summary()
    noise = own.tables["noise"]
    assert (noise["time_s"].iloc[0], noise["time_s"].iloc[-1]) == (0.0, 240.0)
    first, last = own.adapted_noise["shaft_torque_N_m"]
    # the given noise is that of the whole recording: the root of (1 + 9) / 2
    assert first == pytest.approx(2.24 * 1400.0, rel=0.15)
    assert noise["shaft_torque_N_m"][590] == pytest.approx(1400.0, rel=0.2)
    assert last == pytest.approx(3.0 * 1400.0, rel=0.2)
    assert own.to_dict()["noise"]["shaft_torque_N_m"] == {"beginning": first, "end": last}
    assert "Noise of the filter, standard deviations\nnoise" in own.summary()
    section = own.summary().split("Noise of the filter")[1].splitlines()
    line = next(text for text in section if text.startswith("shaft_torque_N_m "))
    assert line.split()[1:] == [f"{first:.3g}", f"{last:.3g}"]
    page = own._page()
    assert "Noise of the filter" in page
    assert 'data-figure="noise"' in page
    assert 'data-figure="noise"' not in plain._page()
    # the fouling is 0 in the file, so that no relative change is drawn
    assert "Change of each parameter" not in page
    estimate = own.estimates[0]
    assert abs(estimate.value - 0.1) < 3.5 * estimate.standard_error


def test_adaptive_noise_stays_above_a_third_of_the_white_noise() -> None:
    table = frigate_voyage({FOULING: 0.1}, seed=7, seconds=60.0)
    runs = tune_filter(JointReplay(load_ship("frigate"), table), (FOULING,))
    least, given = runs.noises.least, runs.noises.readings
    assert least["shaft_torque_N_m"] == pytest.approx(given["shaft_torque_N_m"] / 3.0)
    # the encoder is good: 0.03 % of the shaft speed, about 13 rad/s, is more than a third of its noise
    assert given["shaft_speed_rad_s"] / 3.0 < least["shaft_speed_rad_s"]
    assert least["shaft_speed_rad_s"] == pytest.approx(3e-4 * 13.0, rel=0.3)
    assert runs.filter(runs.noises.state_walk)._memory_s is None
    assert runs.noise_memory_s is None


def test_slow_rows_get_a_longer_memory() -> None:
    """Rows 2 s apart need 40 s."""
    table = frigate_voyage({FOULING: 0.1}, seed=7, seconds=600.0, interval_s=2.0)
    found = identify(load_ship("frigate"), table, free=[FOULING], method="ekf-adaptive")
    assert found.adapted_noise
    with pytest.raises(ObserverError, match=r"noise_memory_s = 30: the rows are 2 s apart"):
        ekf(load_ship("frigate"), [table], (FOULING,), noise_memory_s=30.0)
