from __future__ import annotations

import functools
import math
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import Ship, load_ship
from shaftline.plant.open_water import (
    MAX_ADVANCE_RATIO,
    advance_ratio,
    b_series,
    invert_torque_coefficient,
    open_water,
    open_water_slope,
)
from shaftline.plant.propeller import propeller_load

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


def load(ship: Ship, velocity: float, omega: float, pitch: float, depth: float = 4.0) -> Any:
    return propeller_load(ship.record(), velocity, omega, pitch, depth, 0.0)


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


@pytest.mark.parametrize("pitch", PITCH_RATIOS)
@pytest.mark.parametrize("j", [0.0, 0.3, 0.9])
def test_slope_is_the_derivative(j: float, pitch: float) -> None:
    h = 1e-5
    rise = open_water(KQ_FRIGATE, j + h, pitch) - open_water(KQ_FRIGATE, j - h, pitch)
    assert open_water_slope(KQ_FRIGATE, j, pitch) == pytest.approx(rise / (2 * h), rel=1e-7)


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
def test_torque_above_the_curve_is_held_at_bollard(pitch: float) -> None:
    above = 1.01 * open_water(KQ_FRIGATE, 0.0, pitch)
    assert invert_torque_coefficient(KQ_FRIGATE, above, pitch, 0.7) == (0.0, False)


@pytest.mark.parametrize("pitch", PITCH_RATIOS)
def test_torque_below_the_curve_is_held_at_its_end(pitch: float) -> None:
    held, valid = invert_torque_coefficient(KQ_FRIGATE, -1.0, pitch, 0.7)
    assert not valid
    assert 1.4 < held <= MAX_ADVANCE_RATIO
    assert open_water_slope(KQ_FRIGATE, held, pitch) < 1e-9


@pytest.mark.parametrize(
    ("kq", "pitch"), [(math.nan, 1.0), (math.inf, 1.0), (0.03, math.nan), (0.03, math.inf)]
)
def test_inversion_of_no_number_gives_the_guess(kq: float, pitch: float) -> None:
    assert invert_torque_coefficient(KQ_FRIGATE, kq, pitch, 0.7) == (0.7, False)


def test_advance_ratio_is_velocity_per_revolution_and_diameter() -> None:
    assert advance_ratio(8.0, 10.0, 4.2) == pytest.approx(2 * math.pi * 8.0 / (10.0 * 4.2))


def test_advance_ratio_is_finite_at_standstill() -> None:
    assert math.isfinite(advance_ratio(8.0, 0.0, 4.2))


def test_load_scales_the_coefficients(frigate: Ship) -> None:
    velocity, omega, pitch = 7.0, 9.5, 1.15
    n = omega / (2 * math.pi)
    j = velocity / (n * 4.2)
    found = load(frigate, velocity, omega, pitch)
    assert found.thrust == pytest.approx(
        1025.0 * n**2 * 4.2**4 * published_sum("KT", 0.9, 5, j, pitch), rel=1e-12
    )
    assert found.torque == pytest.approx(
        1025.0 * n**2 * 4.2**5 * published_sum("KQ", 0.9, 5, j, pitch), rel=1e-12
    )


def test_curve_is_held_beyond_its_last_advance_ratio(frigate: Ship) -> None:
    n, omega = 1.0, 2 * math.pi
    edge = load(frigate, MAX_ADVANCE_RATIO * n * 4.2, omega, 1.0)
    beyond = load(frigate, 3.0 * n * 4.2, omega, 1.0)
    assert beyond.torque == pytest.approx(edge.torque, rel=1e-12)


def test_standstill_gives_no_load(frigate: Ship) -> None:
    assert load(frigate, 5.0, 0.0, 1.0)[:2] == (0.0, 0.0)


def test_bollard_propeller_does_not_feel_the_inflow() -> None:
    tug = load_ship("tito-neri-sine")
    n = 20.0 / (2 * math.pi)
    expected = 0.136 * 1000.0 * n**2 * 0.065**5
    for velocity in (0.0, 0.3):
        assert load(tug, velocity, 20.0, 1.0).torque == pytest.approx(expected, rel=1e-12)


def test_roughness_takes_the_ittc_corrections(frigate: Ship) -> None:
    rough = frigate.with_values({"propeller.roughness_drag": 0.004})
    n, pitch = 1.5, 1.2
    clean, dirty = (load(ship, 6.0, 2 * math.pi * n, pitch) for ship in (frigate, rough))
    solidity = 2.073 * 0.9
    lost_kt = (clean.thrust - dirty.thrust) / (1025.0 * n**2 * 4.2**4)
    added_kq = (dirty.torque - clean.torque) / (1025.0 * n**2 * 4.2**5)
    assert lost_kt == pytest.approx(0.3 * pitch * solidity * 0.004, rel=1e-9)
    assert added_kq == pytest.approx(0.25 * solidity * 0.004, rel=1e-9)


def cavitation_number(n: float, depth: float) -> float:
    return (101325.0 - 1671.0 + 1025.0 * 9.81 * depth) / (0.5 * 1025.0 * n**2 * 4.2**2)


def test_cavitation_loss_is_linear_below_the_onset(frigate: Ship) -> None:
    n, depth = 2.0, 4.0
    onset = 2.0 * cavitation_number(n, depth)  # half of the onset number is missing
    cavitating = frigate.with_values(
        {
            "propeller.cavitation_breakdown": 0.4,
            "propeller.cavitation_onset_number": onset,
            "propeller.cavitation_torque_share": 0.75,
        }
    )
    sound, broken = (load(ship, 8.0, 2 * math.pi * n, 1.4, depth) for ship in (frigate, cavitating))
    assert broken.thrust / sound.thrust == pytest.approx(1.0 - 0.4 * 0.5, rel=1e-9)
    assert broken.torque / sound.torque == pytest.approx(1.0 - 0.4 * 0.5 * 0.75, rel=1e-9)


def test_no_cavitation_above_the_onset(frigate: Ship) -> None:
    onset = 0.99 * cavitation_number(2.0, 4.0)
    ship = frigate.with_values(
        {"propeller.cavitation_breakdown": 0.4, "propeller.cavitation_onset_number": onset}
    )
    assert load(ship, 8.0, 4 * math.pi, 1.4) == load(frigate, 8.0, 4 * math.pi, 1.4)
