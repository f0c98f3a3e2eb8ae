"""Our numbers beside the thesis's, within what the thesis's own methods allow."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from reproductions.side_by_side import published
from reproductions.thesis import observer_transfers, poles, sensitivity, snr, vaf, working_points
from shaftline.observers.following import add_noise, variance_accounted_for
from shaftline.plant import load_ship


@pytest.fixture(scope="module")
def vaf_table() -> pd.DataFrame:
    return vaf.vaf_table()[0]


def test_working_points() -> None:
    for cell in working_points.cells(working_points.working_points()):
        lenient = cell.row == "A" and cell.column in ("engine_torque_N_m", "ship_speed_m_s")
        assert cell.ours == pytest.approx(cell.printed, rel=0.03 if lenient else 0.015)


def test_gains_from_the_fuel_rack_to_the_shaft_speed() -> None:
    table = poles.plant_transfers(load_ship("frigate"))
    gains = table[table["table"] == "2-6"]
    assert len(gains) == 4
    assert gains["gain_difference_percent"].abs().max() < 2.0


def test_steady_gauge_torque_is_the_engines() -> None:
    """The identity by which the printed rows of M_m can be judged."""
    table = poles.plant_transfers(load_ship("frigate")).set_index(["transfer", "point"])["gain"]
    plant = load_ship("frigate").record()
    slope = plant["torque_per_speed"] * plant["gear_ratio"] ** 2 * plant["transmission_efficiency"]
    for point in "ABCD":
        for source in ("pitch_command", "inflow", "resistance_factor"):
            torque, speed = (
                table[f"{name} / {source}", point] for name in ("shaft_torque", "shaft_speed")
            )
            assert torque == pytest.approx(slope * speed, rel=1e-9)


def test_shaft_kalman_poles() -> None:
    system = observer_transfers.linear_observer("shaft-kalman", load_ship("frigate"))
    pair = np.sort_complex(system.poles())
    assert pair.real == pytest.approx([-10.53, -10.53], abs=0.005)
    assert pair.imag == pytest.approx([-10.41, 10.41], abs=0.005)
    (zero,) = system[0, 0].zeros().real
    assert zero == pytest.approx(-10.42, abs=0.005)


@pytest.mark.parametrize("row", published("advance_velocity_thesis_vaf").index)
def test_fast_inflow(vaf_table: pd.DataFrame, row: str) -> None:
    printed = published("advance_velocity_thesis_vaf").loc[row, "inflow_sine_high"]
    assert vaf_table.loc[row, "inflow_sine_high"] == pytest.approx(printed, abs=1.0)


@pytest.mark.parametrize("row", published("advance_velocity_thesis_vaf").index)
def test_seaway(vaf_table: pd.DataFrame, row: str) -> None:
    printed = published("advance_velocity_thesis_vaf").loc[row, "jonswap"]
    ours = vaf_table.loc[row, "jonswap"]
    assert ours < 5.0 if row == "luenberger-low" else abs(ours - printed) < 1.5


@pytest.mark.parametrize("row", ["immersion-invariance-low", "random-walk-kalman"])
def test_pitch_step_where_no_inverse_table_is_used(vaf_table: pd.DataFrame, row: str) -> None:
    printed = published("advance_velocity_thesis_vaf").loc[row, "pitch_step"]
    assert vaf_table.loc[row, "pitch_step"] == pytest.approx(printed, abs=1.0)


def test_high_gains_need_less_noise() -> None:
    needed = snr.snr_at(0.05, seeds=3)
    assert math.isnan(needed["luenberger-low"])
    names = [f"immersion-invariance-{tuning}" for tuning in ("low", "moderate", "high")]
    assert needed[names].is_monotonic_increasing
    assert needed["luenberger-high"] > needed["luenberger-moderate"] + 5.0


@pytest.mark.slow
def test_the_noise_sample_time_of_the_thesis() -> None:
    scan = snr.sample_time_scan()
    assert scan.loc["rms distance to the thesis"].drop("thesis").idxmin() == "0.01 s"
    assert abs(scan.loc["luenberger-high", "0.01 s"] - 67.6) < 1.0


def test_inertia_sensitivity_of_immersion_invariance() -> None:
    ours = sensitivity.sensitivity_table()
    printed = published("advance_velocity_thesis_sensitivity")
    for tuning in ("low", "moderate", "high"):
        for column in ("inertia_minus_10pct", "inertia_plus_10pct"):
            row = f"immersion-invariance-{tuning}"
            assert ours.loc[row, column] == pytest.approx(printed.loc[row, column], abs=0.2)
    # a power balance knows no inertia
    assert ours.loc["power-balance", "inertia_plus_10pct"] == 0.0


def test_vaf_is_what_it_says() -> None:
    truth = np.sin(np.arange(1000.0))
    assert variance_accounted_for(truth, truth + 3.0) == pytest.approx(100.0)
    assert variance_accounted_for(truth, 0.5 * truth) == pytest.approx(75.0)
    assert variance_accounted_for(truth, -truth) == 0.0


def test_noise_has_the_asked_ratio() -> None:
    readings = np.tile([10.0, 1e5, 1.4, 0.2, 8.0], (20000, 1))
    noise = np.random.default_rng(1).standard_normal(readings.shape)
    added = add_noise(readings, 40.0, noise) - readings
    ratio = readings[:, :4].std(axis=0) * 0 + readings[0, :4] / added[:, :4].std(axis=0)
    assert 20.0 * np.log10(ratio) == pytest.approx(40.0, abs=0.1)
    assert not added[:, 4].any()


def test_mid_range_point_predicts_what_it_was_not_fitted_to() -> None:
    table = poles.mid_range(load_ship("frigate")).set_index("table")
    for number in ("2-20", "2-21", "2-22", "2-23"):
        ours, thesis = (float(table.loc[number, c]) for c in ("gain", "gain, This thesis"))
        assert ours == pytest.approx(thesis, rel=0.06)


def test_five_signs_of_the_sensitivity_are_misprints() -> None:
    printed = published("advance_velocity_thesis_sensitivity")
    slips = sensitivity.find_sign_misprints(printed)
    assert slips == [
        ("luenberger-moderate", "open_water_minus_10pct"),
        ("power-balance", "ear_1.0"),
        ("immersion-invariance-moderate", "ear_0.6"),
        ("immersion-invariance-high", "open_water_plus_10pct"),
        ("random-walk-kalman", "ear_1.0"),
    ]
    for row, column in slips:
        assert printed.loc[row, column] > 0.0  # all of them lack their minus
        mended = printed.loc[row].iloc[1:7].astype(float)
        mended[column] *= -1.0
        assert mended.std() == pytest.approx(printed.loc[row, "sd"], abs=0.006)


def test_the_random_walk_filter_s_tables_follow_from_a_dead_beat_predictor() -> None:
    """Zeros to the printed digits but one sign, gains within their three digits."""
    table = observer_transfers.random_walk_transfers(load_ship("frigate"))
    assert table["gain follows"].to_numpy() == pytest.approx(table["gain printed"], rel=5e-3)
    zeros = table.dropna(subset="zero printed")
    wrong = (zeros["zero follows"] - zeros["zero printed"]).abs() > 1e-3
    assert zeros.loc[wrong, ["table", "point"]].to_numpy().tolist() == [["3-11", "C"]]
    slip = zeros[wrong].iloc[0]
    assert slip["zero follows"] == pytest.approx(-slip["zero printed"], abs=1e-3)
    filter_ = observer_transfers.predictor(-0.0659, 0.5139)
    assert max(abs(pole) for pole in filter_.poles) < 1e-5
    assert filter_.gain == pytest.approx((1.0 - 0.0659, 1.0 / 0.5139), rel=1e-4)


def test_the_thesis_s_averages_are_those_of_its_seven_cases() -> None:
    printed = published("advance_velocity_thesis_vaf")
    cells = printed[vaf.COLUMNS].astype(float)
    assert len(vaf.COLUMNS) == 7
    assert cells.mean(axis=1).to_numpy() == pytest.approx(printed["average"], abs=0.011)
    assert cells.std(axis=1).to_numpy() == pytest.approx(printed["sd"], abs=0.011)
