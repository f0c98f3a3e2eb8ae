"""Method 4: frequency responses by correlation, and numbers from them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.identification.drive_train import SIX
from shaftline.mismatch.identification.frequency import modelled_response
from shaftline.mismatch.identification.sine import sine, sine_response, sines

from .benches import recorded, shares_off, staircase, swing, tug

FREQUENCIES = (1.0, 10.0, 100.0, 1000.0)


@pytest.fixture(scope="module")
def tables() -> list[pd.DataFrame]:
    return [swing(tug(), w, 2.5 + 2.1 * 2.0 * math.pi / w) for w in FREQUENCIES]


def test_response_is_the_linear_model_s(tables: list[pd.DataFrame]) -> None:
    """Within what a swing of 5 % bends: 0.3 %."""
    found = sine_response(tug(), tables)
    assert found.frequency == pytest.approx(FREQUENCIES, rel=1e-4)
    for column, expected in modelled_response(tug(), found).items():
        assert found.response[column] == pytest.approx(expected, rel=4e-3), column


def test_all_six_from_the_other_set(tables: list[pd.DataFrame]) -> None:
    start = tug("staircase").with_values({"water.density_kg_m3": 1000.0})
    found = sine(start, tables)
    assert found.keys == SIX
    assert max(map(abs, shares_off(tug(), found).values())) < 4e-3


def test_sines_one_after_another_in_one_recording() -> None:
    parts, mean = [], 5.89
    for w, seconds in ((20.0, 3.0), (200.0, 2.0), (6.0, 5.0)):
        whole = round(seconds * w / (2.0 * math.pi)) * 2.0 * math.pi / w
        parts.append(mean * (1.0 + 0.04 * np.sin(w * np.arange(round(whole / 1e-4)) * 1e-4)))
    table = recorded(tug(), np.concatenate(parts))
    noise = np.random.default_rng(6).standard_normal(len(table))
    table["motor_voltage_V"] += 0.003 * noise
    found = sines(table["motor_voltage_V"].to_numpy(), 1e-4)
    assert [one.frequency for one in found] == pytest.approx([20.0, 200.0, 6.0], rel=1e-3)
    lengths = [one.end - one.begin for one in found]
    assert lengths == pytest.approx([len(part) for part in parts], rel=0.02)
    response = sine_response(tug(), [table])
    for column, expected in modelled_response(tug(), response).items():
        assert response.response[column] == pytest.approx(expected, rel=6e-3), column


def test_error_is_the_spread_of_repeated_noise() -> None:
    table, rng = swing(tug(), 100.0, 4.0), np.random.default_rng(7)
    found, stated = [], []
    for _ in range(20):
        noisy = table.assign(
            motor_current_A=table["motor_current_A"] + 0.05 * rng.standard_normal(len(table))
        )
        response = sine_response(tug(), [noisy])
        found.append(response.response["motor_current_A"][0])
        stated.append(response.error["motor_current_A"][0])
    spread = math.sqrt(0.5 * (np.var(np.real(found)) + np.var(np.imag(found))))
    assert math.sqrt(np.mean(np.square(stated))) == pytest.approx(spread, rel=0.25)


def test_starts_are_left_out() -> None:
    """Rest and a cold start before the sine: it is told from the settled part."""
    time = np.arange(30000) * 1e-4
    table = recorded(tug(), np.r_[np.full(200, 3.0), 5.89 * (1.0 + 0.05 * np.sin(40.0 * time))])
    found = sine_response(tug(), [table.iloc[200:].reset_index(drop=True)])
    expected = modelled_response(tug(), found)["shaft_speed_rad_s"]
    assert found.response["shaft_speed_rad_s"] == pytest.approx(expected, rel=4e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: [staircase(tug(), (5.0, 6.0, 5.0, 6.0))], "sine: no sine of motor_voltage_V"),
        (lambda: [recorded(tug(), np.full(20000, 5.89))], "sine: no sine of motor_voltage_V"),
        (
            lambda: [swing(tug(), 5.0, 2.0)],
            "5 rad/s ends before its transient does; .* must last 2.1",
        ),
        (
            lambda: [swing(tug(), 30.0, 3.0), swing(tug(), 50.0, 3.0, mean=5.0)],
            "has the mean 5.89?",
        ),
        (
            lambda: [
                swing(tug(), 30.0, 3.0),
                swing(tug(), 50.0, 3.0).drop(columns="motor_current_A"),
            ],
            "different columns",
        ),
    ],
)
def test_what_does_not_fit_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sine(tug(), make())
