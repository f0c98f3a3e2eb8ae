from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shaftline.observers import follow, get_observer, observer_names, simulated_measurements, update
from shaftline.observers.records import ESTIMATE, Measurement
from shaftline.plant import Equilibrium, Schedule, Ship, simulate

MEASURING = [name for name in observer_names() if name not in ("none", "oracle")]
SPEED, TORQUE, PITCH, ACCELERATION, TRUTH = range(5)
BAD = slice(200, 206)
DT = 0.05


@pytest.fixture(scope="module")
def measurements(frigate: Ship, design_point: Equilibrium) -> NDArray[np.float64]:
    schedule = Schedule(22.0, 1.4, inflow=lambda t: np.sin(0.8 * t))
    return simulated_measurements(simulate(frigate, schedule, 40.0, initial=design_point.state))


def spoilt(
    measurements: NDArray[np.float64], column: int, value: float, where: slice = BAD
) -> NDArray[np.float64]:
    copy = measurements.copy()
    copy[where, column] = value
    return copy


def assert_recovers(
    name: str, ship: Ship, good: Any, bad: Any, start: int, within_s: float
) -> None:
    undisturbed, _ = follow(get_observer(name), ship, good, DT)
    estimate, valid = follow(get_observer(name), ship, bad, DT)
    later = start + int(within_s / DT)
    assert valid[later:].all()
    np.testing.assert_allclose(estimate[later:], undisturbed[later:], atol=0.05)


@pytest.mark.parametrize("name", MEASURING)
@pytest.mark.parametrize("column", [SPEED, TORQUE, PITCH])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
def test_lost_measurement_is_flagged_and_survived(
    frigate: Ship, measurements: NDArray[np.float64], name: str, column: int, value: float
) -> None:
    bad = spoilt(measurements, column, value)
    estimate, valid = follow(get_observer(name), frigate, bad, DT)
    assert np.all(np.isfinite(estimate))
    assert not valid[BAD].any()
    assert np.all(estimate[BAD] == estimate[BAD.start - 1])
    assert_recovers(name, frigate, measurements, bad, BAD.stop, within_s=5.0)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_accelerometer_that_fails_is_flagged(
    frigate: Ship, measurements: NDArray[np.float64], value: float
) -> None:
    bad = spoilt(measurements, ACCELERATION, value)
    estimate, valid = follow(get_observer("shaft-acceleration"), frigate, bad, DT)
    assert np.all(estimate[BAD] == estimate[BAD.start - 1])
    assert not valid[BAD].any()
    assert valid[BAD.stop :].all()


def test_oracle_without_truth_is_flagged(frigate: Ship, measurements: NDArray[np.float64]) -> None:
    estimate, valid = follow(
        get_observer("oracle"), frigate, spoilt(measurements, TRUTH, math.nan), DT
    )
    assert np.all(np.isfinite(estimate))
    assert not valid[BAD].any()


@pytest.mark.parametrize("name", MEASURING)
@pytest.mark.parametrize("torque", [1e6, -5e5], ids=["above", "below"])
def test_torque_off_the_curve_is_flagged(
    frigate: Ship, measurements: NDArray[np.float64], name: str, torque: float
) -> None:
    where = slice(200, 500)  # 15 s, so that the slowest observer has followed
    bad = spoilt(measurements, TORQUE, torque, where)
    estimate, valid = follow(get_observer(name), frigate, bad, DT)
    assert np.all(np.isfinite(estimate))
    assert np.all((estimate > -4.0) & (estimate < 40.0))
    assert not valid[400:500].any()
    assert_recovers(name, frigate, measurements, bad, where.stop, within_s=8.0)


@pytest.mark.parametrize("name", MEASURING)
def test_shaft_at_rest_gives_no_valid_estimate(
    frigate: Ship, measurements: NDArray[np.float64], name: str
) -> None:
    where = slice(0, 200)
    bad = spoilt(spoilt(measurements, SPEED, 0.0, where), TORQUE, 0.0, where)
    estimate, valid = follow(get_observer(name), frigate, bad, DT)
    assert np.all(np.isfinite(estimate))
    assert not valid[where].any()
    assert_recovers(name, frigate, measurements, bad, where.stop, within_s=6.0)


@pytest.mark.parametrize("name", MEASURING)
def test_shaft_that_stops_on_the_way_is_survived(
    frigate: Ship, measurements: NDArray[np.float64], name: str
) -> None:
    where = slice(200, 400)
    bad = spoilt(measurements, SPEED, 0.0, where)
    estimate, valid = follow(get_observer(name), frigate, bad, DT)
    assert np.all(np.isfinite(estimate))
    assert not valid[300:400].any()
    assert_recovers(name, frigate, measurements, bad, where.stop, within_s=6.0)


@pytest.mark.parametrize("name", MEASURING)
def test_shaft_turning_astern_is_not_valid(
    frigate: Ship, measurements: NDArray[np.float64], name: str
) -> None:
    bad = spoilt(measurements, SPEED, -5.0, slice(200, 400))
    estimate, valid = follow(get_observer(name), frigate, bad, DT)
    assert np.all(np.isfinite(estimate))
    assert not valid[300:400].any()


measurement = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -0.0, 1e-3, 10.0, 1.4e5, 1.4, -10.0, 1e3, 1e8, math.nan, math.inf]),
)


@pytest.mark.parametrize("name", observer_names())
@settings(max_examples=40)
@given(
    rows=st.lists(
        st.tuples(measurement, measurement, measurement, measurement, measurement), max_size=12
    )
)
def test_no_measurement_makes_the_estimate_anything_but_a_number(
    frigate: Ship, measurements: NDArray[np.float64], name: str, rows: list[tuple[float, ...]]
) -> None:
    wild = np.vstack([measurements[:5], np.reshape(rows, (-1, 5)), measurements[:5]])
    estimate, _ = follow(get_observer(name), frigate, wild, DT)
    assert np.all(np.isfinite(estimate))


@pytest.mark.parametrize("name", observer_names())
def test_lost_first_measurement_gives_a_finite_invalid_estimate(frigate: Ship, name: str) -> None:
    observer = get_observer(name).discretise(frigate, DT)
    estimate = np.zeros(1, ESTIMATE)[0]
    nothing = Measurement(math.nan, math.nan, math.nan, math.nan, math.nan)
    assert update(observer, estimate, nothing) == 0.0
    assert estimate["valid"] == 0
