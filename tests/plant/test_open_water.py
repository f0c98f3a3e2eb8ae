from __future__ import annotations

import functools
import math
from importlib import resources

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant.open_water import (
    MAX_ADVANCE_RATIO,
    MIN_ADVANCE_RATIO,
    MIN_REVOLUTIONS,
    PITCH_POWERS,
    advance_ratio,
    b_series,
    collapse_pitch,
    constant_coefficient,
    invert_torque_coefficient,
    open_water,
    open_water_slope,
)

PITCH_RATIOS = (0.6, 0.8, 1.0, 1.2, 1.4)
KQ_FRIGATE = b_series("KQ", 0.9, 5)


@functools.cache
def published_terms(curve: str) -> list[tuple[float, ...]]:
    file = resources.files("shaftline.plant").joinpath("data/b_series_polynomials.csv")
    with file.open() as stream:
        table = pd.read_csv(stream)
    return [tuple(row[1:]) for row in table[table["curve"] == curve].itertuples(index=False)]


def published_sum(curve: str, ear: float, blades: int, j: float, pitch: float) -> float:
    """The B-series polynomial as it is printed, term by term."""
    return math.fsum(
        c * j**s * pitch**t * ear**u * blades**v for c, s, t, u, v in published_terms(curve)
    )


@pytest.mark.parametrize(("curve", "terms"), [("KT", 39), ("KQ", 47)])
def test_table_has_all_published_terms(curve: str, terms: int) -> None:
    assert len(published_terms(curve)) == terms


@pytest.mark.parametrize("curve", ["KT", "KQ"])
@pytest.mark.parametrize(("ear", "blades"), [(0.9, 5), (0.4, 4), (1.0, 7), (0.55, 3)])
@pytest.mark.parametrize("pitch", PITCH_RATIOS)
def test_collapsed_curve_equals_published_sum(
    curve: str, ear: float, blades: int, pitch: float
) -> None:
    matrix = b_series(curve, ear, blades)
    for j in np.linspace(-0.2, 1.5, 18):
        expected = published_sum(curve, ear, blades, j, pitch)
        assert open_water(matrix, j, pitch) == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_every_entry_of_a_curve_has_its_power() -> None:
    curve = np.arange(1.0, 21.0).reshape(5, 4)
    pitch, j = 1.3, 0.7
    found = collapse_pitch(curve, pitch)
    expected = [pitch ** np.array(PITCH_POWERS) @ curve[:, i] for i in range(4)]
    assert found == pytest.approx(expected, rel=1e-14)
    assert open_water(curve, j, pitch) == pytest.approx(np.polyval(expected[::-1], j), rel=1e-14)
    slope = np.polyval(np.polyder(expected[::-1]), j)
    assert open_water_slope(curve, j, pitch) == pytest.approx(slope, rel=1e-14)


def test_curve_of_one_coefficient_depends_on_nothing() -> None:
    curve = constant_coefficient(0.136)
    assert {open_water(curve, j, p) for j in (-0.2, 0.0, 1.1) for p in (0.6, 1.4)} == {0.136}


@pytest.mark.parametrize("pitch", PITCH_RATIOS)
@pytest.mark.parametrize(("ear", "blades"), [(0.9, 5), (0.7, 4)])
def test_thrust_falls_with_advance_ratio(ear: float, blades: int, pitch: float) -> None:
    matrix = b_series("KT", ear, blades)
    thrust = [open_water(matrix, j, pitch) for j in np.linspace(0.0, 1.6, 100)]
    assert np.all(np.diff(thrust) < 0.0)


@pytest.mark.parametrize("pitch", PITCH_RATIOS)
def test_efficiency_stays_below_the_ideal_of_momentum_theory(pitch: float) -> None:
    kt, kq = b_series("KT", 0.9, 5), KQ_FRIGATE
    j = np.linspace(0.05, 0.9 * pitch, 60)
    thrust = np.array([open_water(kt, x, pitch) for x in j])
    torque = np.array([open_water(kq, x, pitch) for x in j])
    efficiency = j * thrust / (2.0 * math.pi * torque)
    loading = 8.0 * np.maximum(thrust, 0.0) / (math.pi * j**2)
    assert np.all(efficiency < 2.0 / (1.0 + np.sqrt(1.0 + loading)))
    assert 0.4 < efficiency.max() < 0.8


def test_torque_falls_over_the_usable_range_at_its_edges_too() -> None:
    """As the edges' note says: B5-90 at P/D 0.8 to 1.4, and to J 1.43 at P/D 0.6."""
    assert (MIN_ADVANCE_RATIO, MAX_ADVANCE_RATIO) == (-0.25, 1.6)
    for pitch, last in ((0.6, 1.42), (0.8, 1.6), (1.1, 1.6), (1.4, 1.6)):
        slopes = [open_water_slope(KQ_FRIGATE, j, pitch) for j in np.linspace(-0.25, last, 200)]
        assert max(slopes) < 0.0
    assert open_water_slope(KQ_FRIGATE, 1.44, 0.6) > 0.0


@given(
    j=st.floats(0.0, 1.4),
    pitch=st.floats(0.6, 1.4),
    guess=st.floats(allow_nan=True, allow_infinity=True),
)
def test_inversion_returns_the_advance_ratio(j: float, pitch: float, guess: float) -> None:
    found, valid = invert_torque_coefficient(
        KQ_FRIGATE, open_water(KQ_FRIGATE, j, pitch), pitch, guess
    )
    assert valid
    assert found == pytest.approx(j, abs=1e-10)


@pytest.mark.parametrize("pitch", PITCH_RATIOS)
def test_inversion_at_and_above_bollard_is_held_there(pitch: float) -> None:
    bollard = open_water(KQ_FRIGATE, 0.0, pitch)
    assert invert_torque_coefficient(KQ_FRIGATE, bollard, pitch, 0.7) == (0.0, True)
    assert invert_torque_coefficient(KQ_FRIGATE, 1.01 * bollard, pitch, 0.7) == (0.0, False)


@pytest.mark.parametrize("pitch", [0.8, 1.0, 1.2, 1.4])
def test_inversion_beyond_the_last_advance_ratio_is_held_there(pitch: float) -> None:
    """Where KQ falls all the way."""
    beyond = open_water(KQ_FRIGATE, 1.6, pitch) - 1e-9
    assert invert_torque_coefficient(KQ_FRIGATE, beyond, pitch, 0.7) == (1.6, False)
    assert invert_torque_coefficient(KQ_FRIGATE, -1.0, pitch, 0.7) == (1.6, False)
    inside = open_water(KQ_FRIGATE, 1.599, pitch)
    found, valid = invert_torque_coefficient(KQ_FRIGATE, inside, pitch, 0.7)
    assert valid
    assert found == pytest.approx(1.599, abs=1e-10)


def test_inversion_ends_where_the_torque_stops_falling() -> None:
    held, valid = invert_torque_coefficient(KQ_FRIGATE, -1.0, 0.6, 0.7)
    assert not valid
    assert 1.42 < held < 1.44
    assert open_water_slope(KQ_FRIGATE, held, 0.6) == pytest.approx(0.0, abs=1e-12)


def test_inversion_of_a_straight_or_bulging_curve_reaches_to_the_end() -> None:
    """Neither a line nor a cubic that falls ever faster has a point where it stops falling."""
    for c in ((0.06, -0.03, 0.0, 0.0), (0.06, -0.01, 0.0, -0.005), (0.06, -0.03, 0.0, 0.001)):
        curve = constant_coefficient(0.0)
        curve[0] = c
        for j in (0.2, 1.0, 1.59):
            found, valid = invert_torque_coefficient(curve, open_water(curve, j, 1.0), 1.0, 0.7)
            assert valid
            assert found == pytest.approx(j, abs=1e-12)


@pytest.mark.parametrize("guess", [0.0, 1.6, 0.8, math.nan])
def test_inversion_keeps_to_its_bracket_where_newton_leaves_it(guess: float) -> None:
    """A curve with a flat step in the middle, where Newton's step leads far away."""
    curve = constant_coefficient(0.0)
    curve[0] = (0.064 + 0.512e-1, -0.192, 0.24, -0.1)  # -(J - 0.8)^3 / 10 and a constant
    for j in (0.05, 0.5, 0.81, 1.2, 1.55):
        found, valid = invert_torque_coefficient(curve, open_water(curve, j, 1.0), 1.0, guess)
        assert valid
        assert found == pytest.approx(j, abs=1e-5)


@pytest.mark.parametrize(
    ("kq", "pitch"), [(math.nan, 1.0), (math.inf, 1.0), (0.03, math.nan), (0.03, math.inf)]
)
def test_inversion_of_no_number_gives_the_guess(kq: float, pitch: float) -> None:
    assert invert_torque_coefficient(KQ_FRIGATE, kq, pitch, 0.7) == (0.7, False)


@pytest.mark.parametrize("omega", [10.0, -10.0])
def test_advance_ratio_is_velocity_per_revolution_and_diameter(omega: float) -> None:
    assert advance_ratio(8.0, omega, 4.2) == pytest.approx(2 * math.pi * 8.0 / (omega * 4.2))


@pytest.mark.parametrize("omega", [0.0, 0.0062, -0.0062])
def test_advance_ratio_is_finite_at_standstill(omega: float) -> None:
    """Below a thousandth of a revolution per second, that is taken."""
    assert MIN_REVOLUTIONS == 1e-3
    assert advance_ratio(8.0, omega, 4.2) == pytest.approx(8.0 / (1e-3 * 4.2))
    assert advance_ratio(8.0, 0.0064, 4.2) < 8.0 / (1e-3 * 4.2)
    assert advance_ratio(8.0, -0.0064, 4.2) < 0.0
