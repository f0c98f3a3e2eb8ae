"""Schedule of the advance velocity: sign, mean, band, and fallback to the nominal wake."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.baselines.controller import Measurements, measurements_of
from shaftline.baselines.inflow_schedule import (
    BAND,
    FILTER_S,
    LEAST_SPEED,
    SCHEDULE_COLUMNS,
    InflowSchedule,
    make_schedule,
)
from shaftline.plant import load_ship

PLANT = load_ship("frigate").record()
NOMINAL = 0.95 * 8.0  # (1 - w) v_s [m/s]


def seen(velocity: Any, valid: float = 1.0, ship_speed: float = 8.0) -> Measurements:
    rows = [[8.0, 10.0, 1.4e5, 1.3, 20.0, ship_speed, v, valid] for v in np.atleast_1d(velocity)]
    return measurements_of(rows)


def schedule(weight: float = 1.0) -> InflowSchedule:
    return InflowSchedule("test", PLANT, 0.5, weight)


def settled(velocity: float, seconds: float = 60.0, **measured: float) -> Any:
    state = np.zeros((1, SCHEDULE_COLUMNS))
    for _ in range(round(seconds / 0.5)):
        state = schedule().update(seen(velocity, **measured), state)
    return state


@pytest.mark.parametrize("deviation", [0.1, -0.1])
def test_a_steady_estimate_within_the_band_is_the_scheduled_velocity(deviation: float) -> None:
    state = settled((1.0 + deviation) * NOMINAL)
    assert state[0] == pytest.approx([deviation, 120.0])
    now = seen(0.0)  # a single sample has no effect on the velocity of this state
    assert schedule().velocity(now, state) == pytest.approx((1.0 + deviation) * NOMINAL)
    assert schedule(0.5).velocity(now, state) == pytest.approx((1.0 + 0.5 * deviation) * NOMINAL)
    assert schedule(0.0).velocity(now, state)[0] == NOMINAL
    # The deviation is relative: at another ship speed it needs no new samples.
    slower = seen(0.0, ship_speed=4.0)
    assert schedule().velocity(slower, state) == pytest.approx((1.0 + deviation) * 0.5 * NOMINAL)


def test_outside_the_band_the_velocity_returns_to_the_nominal_wake_without_a_jump() -> None:
    deviation = np.linspace(-3.0 * BAND, 3.0 * BAND, 601)
    factor = schedule().factor(np.column_stack([deviation, np.full(601, 60.0)]))
    inside, outside = np.abs(deviation) <= BAND, np.abs(deviation) >= 2.0 * BAND
    assert factor[inside] == pytest.approx(1.0 + deviation[inside])
    assert (factor[outside] == 1.0).all()
    assert np.abs(np.diff(factor)).max() < 3.0 * np.diff(deviation).max()
    assert BAND == 0.15


def test_the_mean_covers_all_samples_at_first_and_the_last_half_minute_later() -> None:
    state = np.zeros((1, SCHEDULE_COLUMNS))
    for k, deviation in enumerate((0.1, 0.0, 0.05, 0.05), start=1):
        state = schedule().update(seen((1.0 + deviation) * NOMINAL), state)
        assert state[0, 1] == k
    assert state[0, 0] == pytest.approx(0.05)
    state = np.array([[0.1, 1e4]])
    state = schedule().update(seen(NOMINAL), state)
    assert state[0, 0] == pytest.approx(0.1 * (1.0 - 0.5 / FILTER_S))
    assert FILTER_S == 30.0


def test_waves_hardly_change_the_deviation() -> None:
    state = np.zeros((1, SCHEDULE_COLUMNS))
    late = []
    for k in range(600):
        wave = 0.3 * np.sin(2.0 * np.pi * 0.5 * k / 10.0)
        state = schedule().update(seen((1.0 + wave) * NOMINAL), state)
        late.append(state[0, 0])
    assert np.abs(late[200:]).max() < 0.02


@pytest.mark.parametrize("lost", [seen(9.0, valid=0.0), seen(np.nan), seen(9.0, ship_speed=np.nan)])
def test_without_a_valid_estimate_the_deviation_decays(lost: Measurements) -> None:
    state = settled(1.1 * NOMINAL)
    samples = state[0, 1]
    for _ in range(60):
        state = schedule().update(lost, state)
    assert state[0] == pytest.approx([0.1 * (1.0 - 0.5 / FILTER_S) ** 60, samples])
    assert 0.1 * np.exp(-1.0) == pytest.approx(state[0, 0], rel=0.02)


def test_at_low_speed_the_deviation_is_kept() -> None:
    state = settled(1.1 * NOMINAL)
    slow = seen(0.5, ship_speed=0.9 * LEAST_SPEED)
    assert schedule().update(slow, state).tolist() == state.tolist()


def test_a_single_sample_is_limited() -> None:
    state = schedule().update(seen([1e6, -1e6]), np.array([[0.0, 1e4]] * 2))
    assert state[:, 0] == pytest.approx([0.5 * 0.5 / FILTER_S, -0.5 * 0.5 / FILTER_S])


def test_a_batch_equals_single_ships() -> None:
    rng = np.random.default_rng(3)
    states = np.zeros((4, SCHEDULE_COLUMNS))
    singles = [np.zeros((1, SCHEDULE_COLUMNS)) for _ in range(4)]
    for _ in range(50):
        velocity = rng.uniform(3.0, 12.0, 4)
        states = schedule().update(seen(velocity), states)
        for i in range(4):
            singles[i] = schedule().update(seen(velocity[i]), singles[i])
            np.testing.assert_array_equal(singles[i][0], states[i])


@pytest.mark.parametrize("weight", [-0.1, 1.1, float("nan")])
def test_a_weight_out_of_range_is_refused(weight: float) -> None:
    with pytest.raises(ValueError, match=r"combinator: va_weight = .*: must be from 0 to 1"):
        make_schedule("combinator", PLANT, 0.5, weight)
    assert make_schedule("combinator", PLANT, 0.5, None) is None
