from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.signal import welch

from shaftline.plant import Equilibrium, Schedule, Sea, Ship, get_sea, realise, simulate
from shaftline.plant.waves import SYNC_STEPS, field, jonswap, presets, unit_phasors

GRAVITY = 9.81
THESIS = Sea(hs_m=2.9, tp_s=9.3, gamma=3.3, heading_deg=180.0)
PEAK = 2.0 * math.pi / THESIS.tp_s


def elevation(sea: Any, times: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = np.outer(times, sea["frequency"]) + sea["phase"]
    return np.asarray(np.cos(angle) @ sea["amplitude"])


def spectral_peak(values: NDArray[np.float64], dt: float) -> float:
    """Frequency of the highest point of Welch's spectrum [rad/s]."""
    frequency, density = welch(values, 1.0 / dt, nperseg=int(400.0 / dt))
    return float(2.0 * math.pi * frequency[np.argmax(density)])


@pytest.mark.parametrize("name", presets())
def test_energy_is_exactly_that_of_the_wave_height(name: str) -> None:
    sea = get_sea(name)
    assert sea is not None
    energy = 0.5 * np.sum(realise(sea, 4.0, seed=1)["amplitude"] ** 2)
    assert energy == pytest.approx(sea.hs_m**2 / 16.0, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_wave_height_is_recovered_from_a_long_record(seed: int) -> None:
    record = elevation(realise(THESIS, 4.0, seed), np.arange(0.0, 3600.0, 0.5))
    assert 4.0 * record.std() == pytest.approx(THESIS.hs_m, rel=0.03)


def test_peak_period_is_recovered_from_the_spectrum() -> None:
    times = np.arange(0.0, 3600.0, 0.5)
    spectra = [
        welch(elevation(realise(THESIS, 4.0, s), times), 2.0, nperseg=256) for s in range(20)
    ]
    density = np.mean([s[1] for s in spectra], axis=0)
    period = 1.0 / spectra[0][0][np.argmax(density)]
    assert period == pytest.approx(THESIS.tp_s, rel=0.06)


@pytest.mark.parametrize("gamma", [1.0, 3.3, 7.0])
def test_spectrum_holds_the_wave_height(gamma: float) -> None:
    sea = Sea(hs_m=3.0, tp_s=10.0, gamma=gamma)
    frequency = np.linspace(0.05, 20.0, 200_000)
    area = np.trapezoid(jonswap(frequency, sea), frequency)
    assert 4.0 * math.sqrt(area) == pytest.approx(3.0, rel=0.01)  # DNV's factor is a fit
    assert frequency[np.argmax(jonswap(frequency, sea))] == pytest.approx(0.2 * math.pi, rel=1e-3)


def sailing(ship: Ship, start: Equilibrium, heading: float, index: int) -> tuple[float, float]:
    """Frequency of one component at a fixed place, and as the sailing ship's propeller feels it."""
    sea = realise(THESIS.model_copy(update={"heading_deg": heading}), 4.0, seed=2)
    others = np.arange(64) != index
    for name in ("amplitude", "velocity", "slope"):
        sea[name][others] = 0.0
    s = simulate(ship, Schedule(22.0, 1.4), 1200.0, initial=start.state, sea=sea)
    inflow = s["advance_velocity"] - 0.95 * s["ship_speed"]
    return float(sea["frequency"][index]), spectral_peak(inflow, 0.05)


@pytest.mark.parametrize("index", [10, 20, 35])
@pytest.mark.parametrize(("heading", "sign"), [(180.0, 1.0), (0.0, -1.0)])
def test_frequency_of_encounter(
    frigate: Ship, design_point: Equilibrium, heading: float, sign: float, index: int
) -> None:
    fixed, met = sailing(frigate, design_point, heading, index)
    expected = fixed + sign * fixed**2 * design_point.state.ship_speed / GRAVITY
    assert met == pytest.approx(abs(expected), abs=0.016)  # one bin of the spectrum


def test_kernel_equals_the_plain_field(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    initial = design_point.state._replace(pitch_ratio=1.2)
    s = simulate(frigate, Schedule(22.0, 1.4), 300.0, initial=initial, sea=thesis_sea)
    plain = np.array([field(thesis_sea, x["time"], x["position"]) for x in s])
    inflow = s["advance_velocity"] - 0.95 * s["ship_speed"] - plain[:, 0]
    surface = s["submergence"] - 4.0 - plain[:, 1]
    # exact where it is synchronised, and between by the field's slope
    assert np.abs(inflow[:-1:SYNC_STEPS]).max() < 1e-11
    assert np.abs(surface[:-1:SYNC_STEPS]).max() < 1e-11
    assert np.abs(inflow).max() < 1e-6  # m/s; measured: 1.2e-7
    assert np.abs(surface).max() < 1e-3  # m; measured: 5e-4


def test_unit_phasors_are_cosine_and_sine() -> None:
    angle = np.random.default_rng(0).uniform(-1e5, 1e5, 64 * 200)
    angle[:8] = np.arange(-4, 4) * math.pi / 4
    cosine, sine = np.empty_like(angle), np.empty_like(angle)
    unit_phasors(angle, cosine, sine)
    np.testing.assert_allclose(cosine, np.cos(angle), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(sine, np.sin(angle), rtol=0.0, atol=1e-13)


def test_orbital_motion_decays_with_depth() -> None:
    surface, deep = (realise(THESIS, depth, seed=4) for depth in (0.0, 6.0))
    decay = deep["velocity"] / surface["velocity"]
    np.testing.assert_allclose(decay, np.exp(-(surface["frequency"] ** 2) / GRAVITY * 6.0))


def test_water_under_a_crest_runs_with_the_waves() -> None:
    """In head seas that is towards the ship: more inflow; in following seas less."""
    head, following = (realise(Sea(hs_m=2.0, tp_s=9.0, heading_deg=h), 0.0, 1) for h in (180, 0))
    np.testing.assert_allclose(head["velocity"], head["amplitude"] * head["frequency"])
    np.testing.assert_allclose(following["velocity"], -head["velocity"])


def test_beam_seas_bring_no_axial_inflow() -> None:
    sea = realise(THESIS.model_copy(update={"heading_deg": 90.0}), 4.0, seed=1)
    inflow, surface = np.transpose([field(sea, t, 8.0 * t) for t in np.arange(0.0, 100.0, 0.5)])
    assert np.abs(inflow).max() < 1e-14
    assert np.abs(surface).max() > 1.0


def test_same_seed_gives_the_same_sea() -> None:
    assert realise(THESIS, 4.0, 5).tobytes() == realise(THESIS, 4.0, 5).tobytes()


def test_other_seed_gives_another_sea() -> None:
    one, other = realise(THESIS, 4.0, 5), realise(THESIS, 4.0, 6)
    assert np.all(one["phase"] != other["phase"])
    assert np.all(one["frequency"] != other["frequency"])


def test_no_wave_height_is_calm(frigate: Ship, design_point: Equilibrium) -> None:
    flat = realise(Sea(hs_m=0.0, tp_s=9.0), 4.0, 1)
    schedule = Schedule(25.0, 1.4)
    with_flat = simulate(frigate, schedule, 20.0, initial=design_point.state, sea=flat)
    without = simulate(frigate, schedule, 20.0, initial=design_point.state)
    assert with_flat.tobytes() == without.tobytes()


def test_thesis_sea_is_the_printed_one() -> None:
    assert get_sea("thesis") == THESIS


def test_calm_is_no_sea() -> None:
    assert get_sea("calm") is None


def test_unknown_sea_names_the_known_ones() -> None:
    with pytest.raises(
        ValueError, match=r"unknown sea 'stormy'; known seas: calm, thesis.*state-7"
    ):
        get_sea("stormy")


@pytest.mark.parametrize(
    "wrong",
    [
        {"hs_m": -0.1},
        {"hs_m": 26.0},
        {"hs_m": math.nan},
        {"tp_s": 1.0},
        {"tp_s": math.inf},
        {"gamma": 0.9},
        {"heading_deg": 400.0},
        {"hs_m": "3"},
        {"height": 2.0},
    ],
    ids=str,
)
def test_impossible_sea_is_rejected(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        Sea(**{"hs_m": 2.0, "tp_s": 9.0, **wrong})
