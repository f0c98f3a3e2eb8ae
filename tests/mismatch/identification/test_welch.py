"""Method 5: frequency response and coherence from noise, and numbers from them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.identification.drive_train import SIX
from shaftline.mismatch.identification.frequency import modelled_response
from shaftline.mismatch.identification.welch import keep_coherent, noise_response, welch

from .benches import recorded, shares_off, staircase, swing, tug

STEP = 4e-4


def noise(seconds: float, seed: int = 0, top: float = 1000.0) -> pd.DataFrame:
    rows = round(seconds / STEP)
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(rows))
    spectrum[2.0 * np.pi * np.fft.rfftfreq(rows, STEP) > top] = 0.0
    values = np.fft.irfft(spectrum, rows)
    return recorded(tug(), 5.89 * (1.0 + 0.05 * values / values.std()), STEP)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return noise(60.0)


def test_response_is_the_linear_model_s_where_it_is_coherent(table: pd.DataFrame) -> None:
    """Gain within 5 %, phase within 5 degrees, from 0.5 to 900 rad/s."""
    found = noise_response(tug(), [table])
    expected = modelled_response(tug(), found)
    for column, values in found.response.items():
        sure = (found.coherence[column] > 0.9) & (found.frequency > 0.5)
        ratio = (values / expected[column])[sure]
        assert np.abs(np.abs(ratio) - 1.0).max() < 0.05
        assert np.degrees(np.abs(np.angle(ratio))).max() < 5.0
        assert sure.sum() > 30
    assert found.frequency[0] < 0.4
    assert 800.0 < found.frequency[-1] < 1010.0  # nothing where the demand has no power


def test_all_six_from_the_other_set(table: pd.DataFrame) -> None:
    start = tug("staircase").with_values({"water.density_kg_m3": 1000.0})
    found = welch(start, [table])
    assert found.keys == SIX
    assert max(map(abs, shares_off(tug(), found).values())) < 0.03
    assert "motor_current_coherence" in found.tables["frequency-response"]


def test_several_recordings_are_averaged(table: pd.DataFrame) -> None:
    one, both = noise_response(tug(), [table]), noise_response(tug(), [table, noise(60.0, 1)])
    for column in one.response:
        assert np.median(both.error[column]) < 0.85 * np.median(one.error[column])


def test_noise_of_the_instrument_lowers_the_coherence_and_widens_the_error() -> None:
    """Spread over 15 draws, of all frequencies by their stated error."""
    clean, rng = noise(20.0), np.random.default_rng(8)
    draws = []
    for _ in range(15):
        noisy = clean.assign(
            motor_current_A=clean["motor_current_A"] + 0.3 * rng.standard_normal(len(clean))
        )
        draws.append(noise_response(tug(), [noisy]))
    values = np.array([one.response["motor_current_A"] for one in draws])
    stated = np.sqrt(np.mean([one.error["motor_current_A"] ** 2 for one in draws], axis=0))
    ratio = np.sqrt(0.5 * (np.var(values.real, axis=0) + np.var(values.imag, axis=0))) / stated
    assert 0.7 < np.median(ratio) < 1.3
    assert np.median(draws[0].coherence["motor_current_A"]) < 0.9
    assert np.median(noise_response(tug(), [clean]).coherence["motor_current_A"]) > 0.99


def test_what_is_not_coherent_counts_for_nothing(table: pd.DataFrame) -> None:
    rng = np.random.default_rng(9)
    deaf = table.assign(motor_current_A=1.3 + rng.standard_normal(len(table)))
    kept = keep_coherent(noise_response(tug(), [deaf]))
    assert (kept.error["motor_current_A"] == 1e6).mean() > 0.8
    speed = kept.error["shaft_speed_rad_s"]
    assert (speed < 1.0).mean() > 0.9
    deaf["shaft_speed_rad_s"] = 70.0 + rng.standard_normal(len(table))
    found = noise_response(tug(), [deaf])
    none = replace(found, coherence={c: 0.0 * v for c, v in found.coherence.items()})
    with pytest.raises(ValueError, match="welch: no channel has a coherence of"):
        keep_coherent(none)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: [staircase(tug(), (5.0, 6.0, 5.0, 6.0))], "welch: motor_voltage_V is no noise"),
        (lambda: [swing(tug(), 20.0, 5.0)], "welch: motor_voltage_V is no noise"),
        (lambda: [recorded(tug(), np.full(20000, 5.89))], "welch: motor_voltage_V is no noise"),
        (lambda: [noise(5.0), noise(5.0).drop(columns="motor_current_A")], "different columns"),
        (list, "welch: no recording"),
    ],
)
def test_what_does_not_fit_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        welch(tug(), make())
