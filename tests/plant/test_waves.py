from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Sea, get_sea, realise
from shaftline.plant.seas import jonswap, presets
from shaftline.plant.state import State
from shaftline.plant.waves import (
    SYNC_STEPS,
    calm_sea,
    pass_half_step,
    synchronise,
    unit_phasors,
    wave_field,
    wave_motion,
)

GRAVITY = 9.81
THESIS = Sea(hs_m=2.9, tp_s=9.3, gamma=3.3, heading_deg=180.0)
PEAK = 2.0 * math.pi / THESIS.tp_s


@pytest.mark.parametrize("name", presets())
def test_energy_is_exactly_that_of_the_wave_height(name: str) -> None:
    sea = get_sea(name)
    assert sea is not None
    energy = 0.5 * np.sum(realise(sea, 4.0, seed=1)["amplitude"] ** 2)
    assert energy == pytest.approx(sea.hs_m**2 / 16.0, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_components_lie_one_in_each_band(seed: int) -> None:
    """64 bands between 0.55 and 4.5 times the peak frequency that widen with it."""
    edges = 0.55 * (4.5 / 0.55) ** (np.arange(65) / 64.0) * PEAK
    frequency = realise(THESIS, 4.0, seed)["frequency"]
    assert np.all((edges[:-1] <= frequency) & (frequency < edges[1:]))
    place = (frequency - edges[:-1]) / np.diff(edges)
    assert place.min() < 0.1
    assert place.max() > 0.9


def test_places_and_phases_are_the_seeds() -> None:
    rng = np.random.default_rng(11)
    place, phase = rng.random(64), rng.uniform(0.0, 2.0 * math.pi, 64)
    sea = realise(THESIS, 4.0, 11)
    edges = np.geomspace(0.55, 4.5, 65) * PEAK
    np.testing.assert_allclose(sea["frequency"], edges[:-1] + np.diff(edges) * place, rtol=1e-14)
    np.testing.assert_array_equal(sea["phase"], phase)
    assert sea["present"] == 1


def test_each_component_has_the_energy_of_its_band() -> None:
    sea = realise(THESIS, 4.0, 2)
    width = np.diff(np.geomspace(0.55, 4.5, 65) * PEAK)
    energy = 0.5 * sea["amplitude"] ** 2
    scale = energy / (jonswap(sea["frequency"], THESIS) * width)
    np.testing.assert_allclose(scale, scale[0], rtol=1e-12)
    assert scale[0] == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    ("heading", "along"), [(180.0, -1.0), (0.0, 1.0), (60.0, 0.5), (-120.0, -0.5)]
)
def test_components_are_deep_water_waves(heading: float, along: float) -> None:
    """Dispersion k = w^2 / g; a particle below a crest runs with the wave and decays with depth."""
    sea = realise(THESIS.model_copy(update={"heading_deg": heading}), 3.0, 4)
    k = sea["frequency"] ** 2 / GRAVITY
    np.testing.assert_allclose(sea["wavenumber"], -k, rtol=1e-12)
    assert sea["along"] == pytest.approx(along)
    assert sea["met"] == -sea["along"]  # of a ship that has not turned yet
    particle = sea["amplitude"] * sea["frequency"] * np.exp(-k * 3.0)
    np.testing.assert_allclose(sea["velocity"], particle, rtol=1e-12)
    # d/dx of velocity * cos(wavenumber * x), per sine
    np.testing.assert_allclose(sea["slope"], particle * k, rtol=1e-12)


def test_orbital_motion_decays_with_depth() -> None:
    surface, deep = (realise(THESIS, depth, seed=4) for depth in (0.0, 6.0))
    decay = deep["velocity"] / surface["velocity"]
    np.testing.assert_allclose(decay, np.exp(-(surface["frequency"] ** 2) / GRAVITY * 6.0))


def test_water_under_a_crest_runs_with_the_waves() -> None:
    """In head seas that is towards the ship: more inflow; in following seas less."""
    head, following = (realise(Sea(hs_m=2.0, tp_s=9.0, heading_deg=h), 0.0, 1) for h in (180, 0))
    for sea, sign in ((head, 1.0), (following, -1.0)):
        times = np.arange(0.0, 200.0, 0.5)
        inflow, surface = np.transpose([wave_field(sea, t, 0.0) for t in times])
        assert np.corrcoef(inflow, surface)[0, 1] * sign > 0.9
        # a ship that has turned about meets it from the other side
        assert wave_field(sea, 7.0, 3.0, 0.0, math.pi)[0] == pytest.approx(
            -wave_field(sea, 7.0, 3.0)[0]
        )


def test_beam_seas_bring_no_axial_inflow() -> None:
    sea = realise(THESIS.model_copy(update={"heading_deg": 90.0}), 4.0, seed=1)
    inflow, surface = np.transpose(
        [wave_field(sea, t, 8.0 * t) for t in np.arange(0.0, 100.0, 0.5)]
    )
    assert np.abs(inflow).max() < 1e-14
    assert np.abs(surface).max() > 1.0


def test_same_seed_gives_the_same_sea_and_another_seed_another() -> None:
    assert realise(THESIS, 4.0, 5).tobytes() == realise(THESIS, 4.0, 5).tobytes()
    one, other = realise(THESIS, 4.0, 5), realise(THESIS, 4.0, 6)
    assert np.all(one["phase"] != other["phase"])
    assert np.all(one["frequency"] != other["frequency"])


def test_field_is_the_sum_of_its_components() -> None:
    sea = calm_sea()
    sea["present"], sea["along"] = 1, -1.0
    for name, value in (
        ("amplitude", 2.0),
        ("velocity", 0.5),
        ("frequency", 0.8),
        ("wavenumber", 0.06),
        ("phase", 1.0),
    ):
        sea[name][5] = value
    angle = 0.8 * 7.0 - 0.06 * 30.0 + 1.0
    assert wave_field(sea, 7.0, 30.0) == pytest.approx(
        (0.5 * math.cos(angle), 2.0 * math.cos(angle))
    )


@pytest.mark.parametrize(
    "angle",
    [
        np.linspace(-3.2, 3.2, 6401),
        np.arange(-8, 9) * math.pi / 4,
        np.random.default_rng(0).uniform(-1e5, 1e5, 64 * 200),
    ],
    ids=["small", "edges", "large"],
)
def test_unit_phasors_are_cosine_and_sine(angle: NDArray[np.float64]) -> None:
    cosine, sine = np.empty_like(angle), np.empty_like(angle)
    unit_phasors(angle, cosine, sine)
    np.testing.assert_allclose(cosine, np.cos(angle), rtol=0.0, atol=2.1e-14)
    np.testing.assert_allclose(sine, np.sin(angle), rtol=0.0, atol=2.1e-14)


def test_synchronised_sea_is_the_field_and_its_slope(thesis_sea: Any) -> None:
    sea = thesis_sea.copy()
    for time, place in ((0.0, 0.0), (123.4, 950.0)):
        synchronise(sea, time, State(1.4, 10.0, 8.0, place), 0.025)
        found = wave_motion(sea)
        inflow, surface = wave_field(sea, time, place)
        assert (found.inflow, found.elevation) == pytest.approx((inflow, surface), abs=1e-12)
        assert found.place == -place  # where the inflow holds: they travel against the ship
        ahead, astern = (wave_field(sea, time, place + d)[0] for d in (1e-4, -1e-4))
        assert -found.inflow_slope == pytest.approx((ahead - astern) / 2e-4, abs=1e-8)
        ahead, astern = (wave_field(sea, time, place + d)[1] for d in (1e-4, -1e-4))
        assert -found.elevation_slope == pytest.approx((ahead - astern) / 2e-4, abs=1e-8)


def test_passing_sea_is_the_field_at_the_speed_of_the_ship(thesis_sea: Any) -> None:
    sea = thesis_sea.copy()
    synchronise(sea, 50.0, State(1.4, 10.0, 8.0, 300.0), 0.025)
    for k in range(1, 2 * SYNC_STEPS + 1):
        pass_half_step(sea)
        found = wave_motion(sea)
        place = 300.0 + 8.0 * 0.025 * k
        assert -found.place == pytest.approx(place, rel=1e-14)
        inflow, surface = wave_field(sea, 50.0 + 0.025 * k, place)
        assert (found.inflow, found.elevation) == pytest.approx((inflow, surface), abs=1e-12)


def test_no_sea_moves_nothing() -> None:
    assert tuple(wave_motion(calm_sea())) == 6 * (0.0,)


def test_no_wave_height_is_calm() -> None:
    assert realise(Sea(hs_m=0.0, tp_s=9.0), 4.0, 1).tobytes() == calm_sea().tobytes()
    assert realise(Sea(hs_m=0.01, tp_s=9.0), 4.0, 1)["present"] == 1
