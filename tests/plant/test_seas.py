from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from shaftline.plant import Sea, get_sea
from shaftline.plant.seas import jonswap

THESIS = Sea(hs_m=2.9, tp_s=9.3, gamma=3.3, heading_deg=180.0)
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


def test_thesis_sea_is_the_printed_one() -> None:
    assert get_sea("thesis") == THESIS


@pytest.mark.parametrize(
    ("name", "hs", "tp"),
    [
        ("state-3", 0.88, 7.5),
        ("state-4", 1.88, 8.8),
        ("state-5", 3.25, 9.7),
        ("state-6", 5.0, 12.4),
        ("state-7", 7.5, 15.0),
    ],
)
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
        flat = {"tp_s": {"hs_m": 0.1}, "hs_m": {"tp_s": 15.0}}.get(key, {})
        assert getattr(Sea(**{"hs_m": 2.0, "tp_s": 9.0, **flat, key: value}), key) == value
    for value in outside:
        with pytest.raises(ValidationError, match=key):
            Sea(**{"hs_m": 2.0, "tp_s": 9.0, key: value})


def test_a_sea_is_head_seas_of_usual_enhancement_and_stays() -> None:
    sea = Sea(hs_m=2.0, tp_s=9.0)
    assert (sea.gamma, sea.heading_deg) == (3.3, 180.0)
    with pytest.raises(ValidationError, match="frozen"):
        sea.hs_m = 3.0


def test_a_sea_by_its_numbers() -> None:
    assert get_sea("hs=3.2, tp=9.1") == Sea(hs_m=3.2, tp_s=9.1)
    assert get_sea("tp=9,hs=2,gamma=1,heading=90") == Sea(
        hs_m=2.0, tp_s=9.0, gamma=1.0, heading_deg=90.0
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("hs=30,tp=9", r"significant wave height \[m\]: .*less than or equal to 25"),
        ("hs=nan,tp=9", "finite"),
        ("hs=3", r"peak period \[s\]: field required"),
        ("hs=a,tp=9", "hs = 'a' is not a number"),
        ("hs=3,hs=2,tp=9", "each once"),
        ("height=3", "must be one of hs, tp, gamma, heading"),
    ],
)
def test_impossible_numbers_of_a_sea_are_named(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        get_sea(text)


@pytest.mark.parametrize(
    ("hs", "tp", "highest"), [(25.0, 1.5, "0.49"), (5.0, 4.0, "3.54"), (3.6, 4.0, "3.54")]
)
def test_waves_that_would_break_are_refused_with_the_highest(
    hs: float, tp: float, highest: str
) -> None:
    with pytest.raises(ValueError, match=f"such waves break.* at most {highest} m"):
        get_sea(f"hs={hs},tp={tp}")
    assert get_sea(f"hs={highest},tp={tp}") is not None
