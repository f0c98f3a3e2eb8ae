from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from shaftline.plant import Sea, get_sea, realise
from shaftline.plant.state import State
from shaftline.plant.waves import (
    SYNC_STEPS,
    calm,
    field,
    jonswap,
    motion,
    pass_half_step,
    presets,
    synchronise,
    unit_phasors,
)

GRAVITY = 9.81
THESIS = Sea(hs_m=2.9, tp_s=9.3, gamma=3.3, heading_deg=180.0)
PEAK = 2.0 * math.pi / THESIS.tp_s
TEN = Sea(hs_m=3.0, tp_s=10.0, gamma=3.3)
GAMMAS = [1.0, 3.3, 7.0]


def density(ratio: float, sea: Sea = TEN) -> float:
    """Spectrum at a multiple of the peak frequency [m2 s]."""
    peak = 2.0 * math.pi / sea.tp_s
    return float(jonswap(np.array([ratio * peak]), sea)[0])


def moment(order: int, sea: Sea) -> float:
    """Spectral moment by quadrature, its tail beyond 40 peak frequencies by hand."""
    peak = 2.0 * math.pi / sea.tp_s
    w = np.geomspace(0.2, 40.0, 400_000) * peak
    tail = density(40.0, sea) * w[-1] ** (order + 1) / (4.0 - order)
    return float(np.trapezoid(w**order * jonswap(w, sea), w) + tail)


def test_peak_has_its_value() -> None:
    """A_gamma 5/16 Hs^2 / omega_p e^(-5/4) gamma, DNV-RP-C205 eq. 3.5.5.2, by hand."""
    expected = (1.0 - 0.287 * math.log(3.3)) * 0.3125 * 9.0 / (0.2 * math.pi) * 0.2865048 * 3.3
    assert density(1.0) == pytest.approx(expected, rel=1e-7)
    assert density(1.0) == pytest.approx(2.78196, rel=2e-6)


@pytest.mark.parametrize("gamma", GAMMAS)
def test_peak_is_gamma_times_that_without_enhancement(gamma: float) -> None:
    """But for the normalisation, which keeps the energy."""
    sea = TEN.model_copy(update={"gamma": gamma})
    plain = TEN.model_copy(update={"gamma": 1.0})
    kept = 1.0 - 0.287 * math.log(gamma)
    assert density(1.0, sea) / density(1.0, plain) == pytest.approx(kept * gamma, rel=1e-12)
    assert density(1.001, sea) < density(1.0, sea) > density(0.999, sea)


@pytest.mark.parametrize(
    ("ratio", "width"), [(0.93, 0.07), (1.09, 0.09), (0.86, 0.07), (1.18, 0.09)]
)
def test_enhancement_is_wider_above_the_peak(ratio: float, width: float) -> None:
    plain = density(ratio, TEN.model_copy(update={"gamma": 1.0}))
    deviations = (ratio - 1.0) / width
    enhanced = 3.3 ** math.exp(-0.5 * deviations**2)
    kept = 1.0 - 0.287 * math.log(3.3)
    assert density(ratio) / plain == pytest.approx(kept * enhanced, rel=1e-12)


def test_tail_falls_with_the_fifth_power() -> None:
    slope = math.log(density(20.0) / density(10.0)) / math.log(2.0)
    assert slope == pytest.approx(-5.0, abs=2e-4)
    low = TEN.model_copy(update={"gamma": 1.0})
    front = math.log(density(0.5, low) / density(0.25, low) * 2.0**5)
    assert front == pytest.approx(-1.25 * (2.0**4 - 4.0**4), rel=1e-12)


def test_energy_grows_with_the_square_of_the_height() -> None:
    assert density(1.3, TEN.model_copy(update={"hs_m": 6.0})) == pytest.approx(4.0 * density(1.3))


@pytest.mark.parametrize(("gamma", "fit"), [(1.0, 1e-9), (2.0, 3e-3), (3.3, 3e-3), (7.0, 0.018)])
def test_spectrum_holds_the_wave_height(gamma: float, fit: float) -> None:
    """As closely as DNV's factor, a fit, keeps the energy."""
    sea = TEN.model_copy(update={"gamma": gamma})
    assert moment(0, sea) == pytest.approx(9.0 / 16.0, rel=fit)


def test_without_enhancement_the_moments_are_exact() -> None:
    """Pierson-Moskowitz: m0 = A / 4B, m2 = A sqrt(pi / B) / 4, S = A w^-5 exp(-B w^-4)."""
    sea = TEN.model_copy(update={"gamma": 1.0})
    assert moment(0, sea) == pytest.approx(9.0 / 16.0, rel=1e-7)
    zero_up = 2.0 * math.pi * math.sqrt(moment(0, sea) / moment(2, sea))
    assert zero_up / 10.0 == pytest.approx((1.25 * math.pi) ** -0.25, rel=1e-5)
    mean = 2.0 * math.pi * moment(0, sea) / moment(1, sea)
    assert mean / 10.0 == pytest.approx(1.25**-0.25 / math.gamma(0.75), rel=1e-6)
    energy = 2.0 * math.pi * moment(-1, sea) / moment(0, sea)
    assert energy / 10.0 == pytest.approx(1.25**-0.25 * math.gamma(1.25), rel=1e-6)


@pytest.mark.parametrize("gamma", [1.0, 2.0, 3.3, 5.0, 7.0])
def test_mean_periods_are_the_published_shares_of_the_peaks(gamma: float) -> None:
    """DNV-RP-C205 section 3.5.5.4, fits for gamma of 1 to 7."""
    sea = TEN.model_copy(update={"gamma": gamma})
    zero_up = 2.0 * math.pi * math.sqrt(moment(0, sea) / moment(2, sea))
    mean = 2.0 * math.pi * moment(0, sea) / moment(1, sea)
    tz = 0.6673 + 0.05037 * gamma - 0.006230 * gamma**2 + 0.0003341 * gamma**3
    t1 = 0.7303 + 0.04936 * gamma - 0.006556 * gamma**2 + 0.0003610 * gamma**3
    assert zero_up / sea.tp_s == pytest.approx(tz, rel=5e-3)
    assert mean / sea.tp_s == pytest.approx(t1, rel=5e-3)


def test_energy_period_of_the_usual_enhancement_is_nine_tenths_of_the_peaks() -> None:
    energy = 2.0 * math.pi * moment(-1, TEN) / moment(0, TEN)
    assert energy / TEN.tp_s == pytest.approx(0.90, abs=0.005)


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
        inflow, surface = np.transpose([field(sea, t, 0.0) for t in times])
        assert np.corrcoef(inflow, surface)[0, 1] * sign > 0.9
        # a ship that has turned about meets it from the other side
        assert field(sea, 7.0, 3.0, 0.0, math.pi)[0] == pytest.approx(-field(sea, 7.0, 3.0)[0])


def test_beam_seas_bring_no_axial_inflow() -> None:
    sea = realise(THESIS.model_copy(update={"heading_deg": 90.0}), 4.0, seed=1)
    inflow, surface = np.transpose([field(sea, t, 8.0 * t) for t in np.arange(0.0, 100.0, 0.5)])
    assert np.abs(inflow).max() < 1e-14
    assert np.abs(surface).max() > 1.0


def test_same_seed_gives_the_same_sea_and_another_seed_another() -> None:
    assert realise(THESIS, 4.0, 5).tobytes() == realise(THESIS, 4.0, 5).tobytes()
    one, other = realise(THESIS, 4.0, 5), realise(THESIS, 4.0, 6)
    assert np.all(one["phase"] != other["phase"])
    assert np.all(one["frequency"] != other["frequency"])


def test_field_is_the_sum_of_its_components() -> None:
    sea = calm()
    sea["present"], sea["along"] = 1, -1.0
    for name, value in (("amplitude", 2.0), ("velocity", 0.5), ("frequency", 0.8),
                        ("wavenumber", 0.06), ("phase", 1.0)):  # fmt: skip
        sea[name][5] = value
    angle = 0.8 * 7.0 - 0.06 * 30.0 + 1.0
    assert field(sea, 7.0, 30.0) == pytest.approx((0.5 * math.cos(angle), 2.0 * math.cos(angle)))


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
        found = motion(sea)
        inflow, surface = field(sea, time, place)
        assert (found.inflow, found.elevation) == pytest.approx((inflow, surface), abs=1e-12)
        assert found.place == -place  # where the inflow holds: they travel against the ship
        ahead, astern = (field(sea, time, place + d)[0] for d in (1e-4, -1e-4))
        assert -found.inflow_slope == pytest.approx((ahead - astern) / 2e-4, abs=1e-8)


def test_passing_sea_is_the_field_at_the_speed_of_the_ship(thesis_sea: Any) -> None:
    sea = thesis_sea.copy()
    synchronise(sea, 50.0, State(1.4, 10.0, 8.0, 300.0), 0.025)
    for k in range(1, 2 * SYNC_STEPS + 1):
        pass_half_step(sea)
        found = motion(sea)
        place = 300.0 + 8.0 * 0.025 * k
        assert -found.place == pytest.approx(place, rel=1e-14)
        inflow, surface = field(sea, 50.0 + 0.025 * k, place)
        assert (found.inflow, found.elevation) == pytest.approx((inflow, surface), abs=1e-12)


def test_no_sea_moves_nothing() -> None:
    assert tuple(motion(calm())) == 5 * (0.0,)


def test_no_wave_height_is_calm() -> None:
    assert realise(Sea(hs_m=0.0, tp_s=9.0), 4.0, 1).tobytes() == calm().tobytes()
    assert realise(Sea(hs_m=0.01, tp_s=9.0), 4.0, 1)["present"] == 1


def test_thesis_sea_is_the_printed_one() -> None:
    assert get_sea("thesis") == THESIS


@pytest.mark.parametrize(
    ("name", "hs", "tp"),
    [("state-3", 0.88, 7.5), ("state-4", 1.88, 8.8), ("state-5", 3.25, 9.7), ("state-6", 5.0, 12.4),
     ("state-7", 7.5, 15.0)],
)  # fmt: skip
def test_sea_states_are_the_north_atlantics(name: str, hs: float, tp: float) -> None:
    """Bales 1983: mean significant height and most probable modal period; head seas."""
    assert get_sea(name) == Sea(hs_m=hs, tp_s=tp, gamma=3.3, heading_deg=180.0)


def test_calm_is_no_sea() -> None:
    assert get_sea("calm") is None


def test_unknown_sea_names_the_known_ones() -> None:
    with pytest.raises(
        ValueError, match=r"unknown sea 'stormy'; known seas: calm, thesis.*state-7"
    ):
        get_sea("stormy")


@pytest.mark.parametrize(
    ("key", "inside", "outside"),
    [
        ("hs_m", (0.0, 25.0), (-0.1, 25.1, math.nan, math.inf, "3")),
        ("tp_s", (1.01, 30.0), (1.0, 30.1, math.inf)),
        ("gamma", (1.0, 10.0), (0.99, 10.1)),
        ("heading_deg", (-360.0, 360.0), (-360.1, 360.1)),
        ("height", (), (2.0,)),
    ],
)
def test_impossible_sea_is_rejected(key: str, inside: Any, outside: Any) -> None:
    for value in inside:
        assert getattr(Sea(**{"hs_m": 2.0, "tp_s": 9.0, key: value}), key) == value
    for value in outside:
        with pytest.raises(ValidationError, match=key):
            Sea(**{"hs_m": 2.0, "tp_s": 9.0, key: value})


def test_a_sea_is_head_seas_of_usual_enhancement_and_stays() -> None:
    sea = Sea(hs_m=2.0, tp_s=9.0)
    assert (sea.gamma, sea.heading_deg) == (3.3, 180.0)
    with pytest.raises(ValidationError, match="frozen"):
        sea.hs_m = 3.0
