"""Waves over time: long records, and what a ship meets that sails through them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import welch

from shaftline.plant import Equilibrium, Schedule, Sea, Ship, realise, simulate
from shaftline.plant.waves import (
    COMPONENTS,
    SYNC_STEPS,
    wave_field,
)

GRAVITY = 9.81
THESIS = Sea(hs_m=2.9, tp_s=9.3, gamma=3.3, heading_deg=180.0)
PEAK = 2.0 * math.pi / THESIS.tp_s
TEN = Sea(hs_m=3.0, tp_s=10.0, gamma=3.3)
GAMMAS = [1.0, 3.3, 7.0]


def elevation(sea: Any, times: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = np.outer(times, sea["frequency"]) + sea["phase"]
    return np.asarray(np.cos(angle) @ sea["amplitude"])


@pytest.mark.parametrize("seed", range(3))
def test_wave_height_is_recovered_from_a_long_record(seed: int) -> None:
    record = elevation(realise(THESIS, 4.0, seed), np.arange(0.0, 3600.0, 0.5))
    assert 4.0 * record.std() == pytest.approx(THESIS.hs_m, rel=0.03)


def test_peak_period_is_recovered_from_the_spectrum() -> None:
    times = np.arange(0.0, 3600.0, 0.5)
    spectra = [
        welch(elevation(realise(THESIS, 4.0, s), times), 2.0, nperseg=256) for s in range(20)
    ]
    mean = np.mean([s[1] for s in spectra], axis=0)
    period = 1.0 / spectra[0][0][np.argmax(mean)]
    assert period == pytest.approx(THESIS.tp_s, rel=0.06)


def sailing(ship: Ship, start: Equilibrium, heading: float, index: int) -> tuple[float, float]:
    """Frequency of one component at a fixed place, and as the sailing ship's propeller feels it."""
    sea = realise(THESIS.model_copy(update={"heading_deg": heading}), 4.0, seed=2)
    others = np.arange(COMPONENTS) != index
    for name in ("amplitude", "velocity", "slope"):
        sea[name][others] = 0.0
    s = simulate(ship, Schedule(22.0, 1.4), 1200.0, initial=start.state, sea=sea)
    inflow = s["advance_velocity"] - 0.95 * s["ship_speed"]
    frequency, power = welch(inflow, 20.0, nperseg=8000)
    return float(sea["frequency"][index]), float(2.0 * math.pi * frequency[np.argmax(power)])


@pytest.mark.parametrize("index", [10, 35])
@pytest.mark.parametrize(("heading", "sign"), [(180.0, 1.0), (0.0, -1.0)])
def test_frequency_of_encounter(
    frigate: Ship, design_point: Equilibrium, heading: float, sign: float, index: int
) -> None:
    fixed, met = sailing(frigate, design_point, heading, index)
    expected = fixed + sign * fixed**2 * design_point.state.ship_speed / GRAVITY
    assert met == pytest.approx(abs(expected), abs=0.016)  # one bin of the spectrum


def test_kernel_equals_the_plain_field_on_a_voyage(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    initial = design_point.state._replace(pitch_ratio=1.2)
    s = simulate(frigate, Schedule(22.0, 1.4), 300.0, initial=initial, sea=thesis_sea)
    plain = np.array([wave_field(thesis_sea, x["time"], x["position"]) for x in s])
    inflow = s["advance_velocity"] - 0.95 * s["ship_speed"] - plain[:, 0]
    surface = s["submergence"] - 4.0 - plain[:, 1]
    # exact where it is synchronised, and between by the field's slope
    assert np.abs(inflow[:-1:SYNC_STEPS]).max() < 1e-11
    assert np.abs(surface[:-1:SYNC_STEPS]).max() < 1e-11
    assert np.abs(inflow).max() < 1e-6  # m/s; measured: 1.2e-7
    assert np.abs(surface).max() < 1e-3  # m; measured: 5e-4


def test_flat_sea_changes_no_bit(frigate: Ship, design_point: Equilibrium) -> None:
    flat = realise(Sea(hs_m=0.0, tp_s=9.0), 4.0, 1)
    with_flat, without = (
        simulate(frigate, Schedule(25.0, 1.4), 20.0, initial=design_point.state, sea=sea)
        for sea in (flat, None)
    )
    assert with_flat.tobytes() == without.tobytes()
