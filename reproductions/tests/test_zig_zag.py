"""Steering coefficients by the augmented filter: the tanker's twin, the destroyer's linear model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reproductions.augmented_filter import destroyer, esso_osaka, zig_zag
from reproductions.cells import Kind, Verdict
from shaftline.plant import load_ship
from shaftline.plant.columns import RUDDER, RUDDER_COMMAND, SWAY_SPEED

PRINTED = [0.0244, 0.0138, 1.4578e-3, 8.093e-4]
"""Table 2.3."""


def ignored() -> None:
    """Ignore a tick."""


# -- zig-zag and measurements -------------------------------------------------------------------


def test_the_ship_s_keys_are_the_thesis_s_four_numbers() -> None:
    ship = load_ship("esso-osaka")
    assert zig_zag.coefficients(ship) == pytest.approx(PRINTED, rel=3e-5)
    half = zig_zag.with_coefficients(ship, 0.5 * zig_zag.coefficients(ship))
    assert zig_zag.coefficients(half) == pytest.approx(0.5 * np.array(PRINTED), rel=3e-5)
    # by hand, eq. 4.1 with m and m_x: forces by rho L^3 / 2, masses as in the file
    scale = 0.5 * 1025.0 * 325.0**3
    assert half.manoeuvring.Y_v == pytest.approx(-0.0122)
    assert half.manoeuvring.Y_r == pytest.approx(3.35428e8 / scale - 0.0069, rel=1e-5)
    assert half.manoeuvring.N_v == pytest.approx(-7.289e-4)
    off = 3.19455e8 * -7.62 / 325.0 / scale
    assert half.manoeuvring.N_r == pytest.approx(off - 0.5 * 8.093e-4, rel=1e-4)


def test_the_readings_are_the_voyage_and_noise_of_the_size_that_is_asked_for() -> None:
    truth = esso_osaka.voyage()
    assert truth.length_s == pytest.approx(325.0 / 3.601, rel=1e-4)
    speed = truth.track["ship_speed"].iloc[0]
    assert speed == pytest.approx(7.0 * 1852.0 / 3600.0)
    exact = zig_zag.make_recording(truth, 0.0, 0, 2)
    assert exact["time_s"].iloc[-1] == 1200.0
    assert exact[SWAY_SPEED].isna().tolist()[:4] == [False, True, False, True]
    pd.testing.assert_series_equal(
        exact[SWAY_SPEED][::2], truth.track["sway_speed"][::2], check_names=False
    )
    assert set(np.round(np.degrees(exact[RUDDER_COMMAND]), 6)) == {10.0, -10.0}
    assert exact["shaft_speed_rad_s"].nunique() == 1
    noisy = zig_zag.make_recording(truth, 0.01, 3, 2)
    error = (noisy - exact)[["ship_speed_m_s", SWAY_SPEED, "yaw_rate_rad_s"]].dropna()
    assert error.iloc[0].tolist() == [0.0, 0.0, 0.0]
    rms = error.std() / [speed, speed, speed / 325.0]
    assert rms.to_numpy() == pytest.approx(0.01, rel=0.1)
    # a gear that lags: what the rudder does was measured
    assert RUDDER in zig_zag.make_recording(destroyer.voyage(), 0.0, 0)


def test_a_voyage_that_is_too_short_is_refused() -> None:
    with pytest.raises(ValueError, match=r"4 executes take .* s, less than 5000 s"):
        zig_zag.simulate_zig_zag(load_ship("esso-osaka"), 3.6, 5000.0, 4)


# -- the tanker --------------------------------------------------------------------------------


def test_the_twin_finds_its_four_coefficients() -> None:
    """From half of them, within three minutes, where R is as small as the noise."""
    exact = esso_osaka.run_case(1e-8, 0.0, 0)
    rows = {minutes: round(60.0 * minutes / zig_zag.STEP_S) for minutes in (0, 3, 5, 20)}
    assert exact.ratios[0] == pytest.approx(0.5, abs=1e-6)
    assert exact.ratios[rows[3]] == pytest.approx(1.0, abs=2e-3)
    for seed in range(3):
        noisy = esso_osaka.run_case(1e-8, 1e-4, seed)
        assert noisy.ratios[rows[3]] == pytest.approx(1.0, abs=0.03)
        assert noisy.ratios[rows[5]] == pytest.approx(1.0, abs=0.004)
        assert noisy.ratios[rows[20]] == pytest.approx(1.0, abs=0.001)


def test_no_voyage_is_lost_where_a_coefficient_reaches_the_end_of_its_range() -> None:
    """-Yv falls to 0 on the way; held there alone, it took six of forty voyages with it."""
    lowest, worst = [], []
    for seed in range(20):
        run = esso_osaka.run_case(1e-8, 1e-4, seed)
        lowest.append(run.ratios[:, 0].min())
        worst.append(np.abs(run.ratios[-1] - 1.0).max())
    assert min(lowest) == pytest.approx(0.0, abs=1e-5)
    assert max(worst) < 1e-3


def test_readings_with_a_hundred_times_the_noise_tell_a_hundredth() -> None:
    """Twenty minutes at R = 1e-4: no bias, and an error that is the noise's share."""
    last = {
        variance: np.array(
            [
                esso_osaka.run_case(variance, math.sqrt(variance), seed).ratios[-1] - 1.0
                for seed in range(12)
            ]
        )
        for variance in (1e-8, 1e-4)
    }
    worst = {variance: np.median(np.abs(off).max(axis=1)) for variance, off in last.items()}
    assert 0.015 < worst[1e-4] < 0.045
    assert worst[1e-4] == pytest.approx(100.0 * worst[1e-8], rel=0.3)
    assert np.abs(np.median(last[1e-4], axis=0)).max() < 0.02


def test_the_thesis_s_r_is_too_large_for_three_minutes() -> None:
    """R = 0.01 and exact readings: docs/results/esso-osaka.md."""
    ratios = esso_osaka.run_case(1e-2, 0.0, 0).ratios
    assert ratios[360] == pytest.approx([0.4286, 0.6880, 0.4229, 0.6848], abs=1e-3)
    assert ratios[-1] == pytest.approx([0.9407, 0.9514, 0.9343, 0.9495], abs=1e-3)


def test_the_identified_ship_turns_as_the_ship() -> None:
    truth = zig_zag.steady_turn(load_ship("esso-osaka"), esso_osaka.SPEED)
    assert truth.steady_diameter == pytest.approx(12.07, abs=0.01)
    assert truth.shaft_speed_ratio == 1.0
    run = esso_osaka.run_case(1e-4, 1e-2, 0)
    assert esso_osaka.diameter(run.ratios[-1]) == pytest.approx(truth.steady_diameter, rel=0.02)
    # it hangs on the coefficients' ratios: half of each turns alike, half of one does not
    assert esso_osaka.diameter([0.5] * 4) == pytest.approx(truth.steady_diameter, rel=0.01)
    assert abs(esso_osaka.diameter([0.5, 1.0, 1.0, 1.0]) / truth.steady_diameter - 1.0) > 0.05
    assert math.isnan(esso_osaka.diameter([-1.0, 1.0, 1.0, 1.0]))


def test_the_tanker_s_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(esso_osaka, "SEEDS", 3)
    ticks: list[None] = []
    page = esso_osaka.page(lambda: ticks.append(None))
    assert len(ticks) == esso_osaka.TICKS
    numbers = page.numbers
    assert numbers["worst_error_percent_3_min"] < 3.0
    assert numbers["turn_diameter_error_percent"] < 2.0
    for name in zig_zag.COEFFICIENTS:
        assert numbers[f"{name} 3 min"] == pytest.approx(1.0, abs=0.03)
        assert numbers[f"{name} 20 min"] == pytest.approx(1.0, abs=0.05)
    kinds = {cell.row: cell.kind for cell in page.cells}
    assert kinds["-Yv"] is Kind.INPUT
    assert kinds["worst coefficient, 3 min, R = 1e-8 [%]"] is Kind.CALIBRATED  # R was chosen
    assert numbers["headings_apart_deg"] < 0.5
    assert "| 0.01 | 0 | 3 | 1 | 0.4286 | 0.6880 | 0.4229 | 0.6848 |" in page.body
    assert len(page.figures["esso-osaka"].axes) == 4


# -- the destroyer -----------------------------------------------------------------------------


def test_the_filter_s_ship_is_the_destroyer_without_what_is_not_linear() -> None:
    own = destroyer.linear().manoeuvring
    assert (own.X_vr, own.Y_vv, own.Y_rr, own.N_rr) == (0.0, 0.0, 0.0, 0.0)
    assert own.Y_v == load_ship("ddg-51-surrogate").manoeuvring.Y_v
    plain, theirs = zig_zag.steady_turn(destroyer.linear(), destroyer.SPEED), 6.583
    assert plain.steady_diameter == pytest.approx(5.634, abs=0.002)
    turn = zig_zag.steady_turn(load_ship("ddg-51-surrogate"), destroyer.SPEED)
    assert turn.steady_diameter == pytest.approx(theirs, abs=0.002)
    assert 100.0 * (1.0 - turn.speed_ratio) == pytest.approx(19.1, abs=0.1)
    assert 100.0 * (1.0 - turn.shaft_speed_ratio) == pytest.approx(10.78, abs=0.05)


def test_a_linear_filter_of_the_linear_ship_is_exact() -> None:
    """What the linear model misses is the destroyer's own: without it the coefficients are right."""
    truth = zig_zag.simulate_zig_zag(destroyer.linear(), destroyer.SPEED, 400.0, 10)
    table = zig_zag.make_recording(truth, 0.0, 0)
    run = zig_zag.run_filter(truth, truth.ship, table, zig_zag.Tuning(1e-8))
    assert run.ratios[-1] == pytest.approx(1.0, abs=0.005)


def test_the_tuning_is_by_ship_length() -> None:
    """FQ and Q are what the covariances gain over a length, where nothing is read."""
    truth = destroyer.voyage()
    rows = round(truth.length_s / zig_zag.STEP_S) + 1
    own = truth._replace(track=truth.track.iloc[:rows])
    table = zig_zag.make_recording(own, 0.0, 0)
    table.loc[1:, list(zig_zag.MEASURED)] = math.nan
    run = zig_zag.run_filter(own, destroyer.linear(), table, zig_zag.Tuning(0.01, 0.0, 0.04))
    theta = zig_zag.coefficients(truth.ship)
    grown = (run.errors[-1] * theta) ** 2 - (run.errors[0] * theta) ** 2
    assert grown == pytest.approx(0.04, rel=0.01)


@pytest.mark.parametrize(
    ("name", "ratios", "tighter"),
    [
        ("a", [1.0015, 1.2603, 0.7557, 0.9343], 9.11),
        ("b", [1.3293, 1.3990, 0.9822, 1.1395], 6.11),
        ("c", [1.0569, 1.1810, 0.9976, 1.1574], 9.94),
    ],
)
def test_the_three_runs_with_exact_readings(name: str, ratios: list[float], tighter: float) -> None:
    """docs/results/destroyer.md, the rows without noise."""
    run = destroyer.run_case(destroyer.RUNS[name], 0.0, 0)
    mean = destroyer.mean_ratios(run)
    assert mean == pytest.approx(ratios, abs=5e-3)
    turn: Any = destroyer.turn_of(mean)
    assert 100.0 * (1.0 - turn.steady_diameter / 6.5827) == pytest.approx(tighter, abs=0.1)
    told = destroyer.tracking_errors(run)
    assert told["sway_rms"] == pytest.approx(0.041, abs=1e-3)
    assert told["yaw_rms"] == pytest.approx(0.148, abs=1e-3)
    # a model that must be believed altogether tracks worse than one that may be wrong
    assert told["yaw_rms_error"] < (5e-3 if name == "a" else 1e-4)


def test_the_destroyer_s_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(destroyer, "SEEDS", 2)
    ticks: list[None] = []
    page = destroyer.page(lambda: ticks.append(None))
    assert len(ticks) == destroyer.TICKS
    # near 9, where the thesis has about 15: not met
    assert 8.0 < page.numbers["turn_tighter_percent"] < 10.0
    assert page.numbers["speed_loss_percent"] == pytest.approx(19.1, abs=0.1)
    assert page.numbers["revolutions_loss_percent"] == pytest.approx(10.8, abs=0.1)
    assert set(page.numbers["runs"]) == {
        f"{run}, noise {noise:g}" for run in "abc" for noise in destroyer.NOISES
    }
    cells = {cell.row: cell for cell in page.cells}
    for name in ("sway", "yaw"):
        assert cells[f"rms error of the {name} over its rms [%]"].verdict is Verdict.MET
    # the surrogate was scaled to these
    for name in ("K [-]", "T [L]", "speed lost in the plant's turn [%]"):
        assert cells[name].kind is Kind.CALIBRATED
        assert cells[name].verdict is Verdict.MET
    # what the thesis has and this plant does not
    tighter = "turn of the identified ship tighter than the plant's [%]"
    for name in (
        tighter,
        f"{tighter}, noise of 0.01",
        "slowest pole of the ship identified in run (a) [1/L]",
    ):
        assert cells[name].verdict is Verdict.UNEXPLAINED
    assert len(page.figures["destroyer"].axes) == 6
    assert "nan" not in page.body
