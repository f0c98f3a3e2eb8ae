"""Time and regime of an effect: the truth by the noise of the channels, and F1 by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest

from shaftline.validation.cases import draw_case
from shaftline.validation.localisation import (
    SCORES,
    TrueLocation,
    f1,
    noticeable_rows,
    regime_bins,
    rows_inside,
    windows_of,
)
from shaftline.validation.recording import (
    CHANNELS,
    Scenario,
    simulate_case,
    simulate_case_with_sizes,
)
from shaftline.validation.simulator.instruments import NOISE
from shaftline.validation.simulator.parameters import Floats

SPEED, TORQUE = "shaft_speed_rad_s", "shaft_torque_N_m"


def change(**channels: float) -> pd.DataFrame:
    """Return changes that are zero but for the rows 100 to 299 of 400."""
    acts = np.repeat([0.0, 1.0, 1.0, 0.0], 100)
    return pd.DataFrame({name: size * acts for name, size in channels.items()})


@pytest.mark.parametrize(
    ("speed", "torque", "noticed"),
    [
        (0.19, 0.0, False),
        (0.21, 0.0, True),
        (-0.21, 0.0, True),
        (0.0, 1010.0, True),
        (0.19, 990.0, False),
    ],
)
def test_a_change_above_the_noise_of_any_channel_is_noticeable(
    speed: float, torque: float, noticed: bool
) -> None:
    table = change(shaft_speed_rad_s=speed, shaft_torque_N_m=torque)
    rows = noticeable_rows(table, {SPEED: 0.2, TORQUE: 1000.0}, 1.0)
    assert rows[110:290].all() == noticed
    assert rows.any() == noticed


def test_the_change_is_the_rms_over_ten_seconds() -> None:
    """A row at four times the noise counts among ten, not among twenty; signs do not cancel."""
    single = pd.DataFrame({SPEED: np.zeros(400)})
    single.loc[200, SPEED] = 0.8
    assert noticeable_rows(single, {SPEED: 0.2}, 1.0).sum() == 10
    assert noticeable_rows(single, {SPEED: 0.2}, 0.5).sum() == 0
    swings = pd.DataFrame({SPEED: 0.3 * np.sin(np.arange(400) * 0.2 * math.pi)})
    assert noticeable_rows(swings, {SPEED: 0.2}, 1.0)[5:-5].all()
    assert not noticeable_rows(swings, {SPEED: 0.22}, 1.0).any()


def test_windows_and_rows_are_the_inverse_of_each_other() -> None:
    time: Floats = 0.1 * np.arange(50.0)
    rows = np.isin(np.arange(50), [0, 1, 2, 20, 21, 49])
    windows = windows_of(rows, time)
    assert windows == [[0.0, 0.2], [2.0, 2.1], [4.9, 4.9]]
    np.testing.assert_array_equal(rows_inside(windows, np.round(time, 4)), rows)
    assert windows_of(~rows[:1], time[:1]) == []


def test_f1_is_the_harmonic_mean_of_precision_and_recall() -> None:
    true = np.arange(100) < 40
    found = (np.arange(100) >= 30) & (np.arange(100) < 50)
    precision, recall = 0.5, 0.25
    assert f1(found, true) == pytest.approx(2.0 * precision * recall / (precision + recall))
    assert f1(~true, true) == 0.0
    assert math.isnan(f1(found, np.zeros(100, dtype=bool)))


def test_the_regime_has_the_quartiles_of_two_channels() -> None:
    rng = np.random.default_rng(4)
    table = pd.DataFrame(rng.random((16_000, 3)), columns=["pitch_ratio", SPEED, "ship_speed_m_s"])
    bins = regime_bins(table)
    np.testing.assert_allclose(np.bincount(bins), 1000, atol=120)
    lowest = table[bins == 0]
    assert lowest[[SPEED, "ship_speed_m_s"]].max().max() < 0.27
    assert lowest["pitch_ratio"].max() > 0.9
    bench = pd.DataFrame({"motor_current_A": [0.0, 1.0, 2.0, 3.0], SPEED: [0.0, 0.0, 0.0, 9.0]})
    assert bench.assign(bin=regime_bins(bench))["bin"].iloc[-1] == 15


def test_a_bin_is_active_where_more_than_half_of_its_rows_are() -> None:
    bins = np.repeat([0, 1, 2, 3], [100, 100, 100, 2])
    rows = np.zeros(302, dtype=bool)
    rows[:51] = rows[100:150] = rows[300:] = True
    place = TrueLocation(np.arange(302.0), bins, rows)
    assert place.active_bins(rows).tolist() == [True, False, False]  # bin 3 has less than 1 %


def test_the_scores_of_windows_are_those_by_hand() -> None:
    """The effect acts in one bin of two, the tool marks half of this bin's rows and one more."""
    place = TrueLocation(np.arange(100.0), np.repeat([0, 1], 50), np.arange(100) < 50)
    found = place.scores([[25.0, 60.0]])
    assert tuple(found) == SCORES
    hits, marked = 25, 36
    assert found["time_f1"] == pytest.approx(2 * hits / (marked + 50))
    assert found["active_share"] == found["active_bins_share"] == 0.5
    assert found["time_f1_every_row"] == pytest.approx(2 * 0.5 / 1.5)
    assert found["regime_f1_every_row"] == pytest.approx(2 * 0.5 / 1.5)
    assert found["regime_f1"] == 0.0  # 25 of 50 rows are not more than half
    assert place.scores([[24.0, 60.0]])["regime_f1"] == 1.0
    every = place.scores([[0.0, 99.0]])
    assert every["time_f1"] == every["time_f1_every_row"]
    assert place.scores([])["time_f1"] == 0.0
    nowhere = TrueLocation(place.time, place.bins, np.zeros(100, dtype=bool))
    assert nowhere.scores([[0.0, 9.0]]) == {}


def test_an_episode_acts_inside_its_window_where_the_channels_show_it() -> None:
    case = draw_case(112, 5)
    assert [effect.key for effect in case.effects] == ["resistance-episode/hull"]
    found = simulate_case(case)
    (window,) = found.truth["windows"].values()
    time = found.recording["time_s"].to_numpy()
    shown = np.zeros(len(time), dtype=bool)
    for channel in CHANNELS:
        if channel in found.recording:
            shift = (found.concealed[channel] - found.without[channel]).abs().to_numpy()
            shown |= shift > case.instruments[NOISE[channel][0]]
    inside = (time >= window[0]) & (time <= window[1])
    active = rows_inside(found.truth["active_s"], time)
    assert (active == (shown & inside)).mean() > 0.98
    assert (shown & ~inside).sum() > 100  # The ship's speed recovers after the episode.
    assert active.sum() > 3000


def test_a_null_case_has_no_active_time() -> None:
    case = dataclasses.replace(draw_case(112, 0), seconds=60.0)
    assert simulate_case(case).truth["active_s"] == []


def test_ventilation_acts_although_calm_water_does_not_show_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    key = "ventilation/propeller"
    case = dataclasses.replace(draw_case(1, 0, keys=(key,)), seconds=150.0)
    found = simulate_case_with_sizes(case, {key: 0.5})
    assert found.truth["active_s"] != []
    monkeypatch.setattr(Scenario, "needs_waves", False)
    assert simulate_case_with_sizes(case, {key: 0.5}).truth["active_s"] == []


@pytest.mark.parametrize(("missing", "noticed"), [("", True), ("pitch_ratio", False)])
def test_a_channel_that_is_not_recorded_shows_nothing(missing: str, noticed: bool) -> None:
    key = "pitch-actuator-offset/pitch-actuator"
    case = draw_case(1, 0, keys=(key,))
    loud = {"encoder_noise": 1.0, "gauge_noise": 1e5, "log_noise": 1.0, "pitch_noise": 0.001}
    case = dataclasses.replace(
        case, seconds=60.0, missing=missing, instruments=case.instruments | loud
    )
    assert bool(simulate_case_with_sizes(case, {key: 0.005}).truth["active_s"]) == noticed
