from __future__ import annotations

import math
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import Ship
from shaftline.plant.four_quadrant import (
    PITCH_NODES,
    b4_70_family,
    four_quadrant_coefficients,
    scaled_to_bollard,
)
from shaftline.plant.open_water import b_series, open_water
from shaftline.plant.propeller import propeller_load

NODES = np.array(PITCH_NODES)
SPEEDS = [(0.0, 1.0), (0.8, 1.0), (0.8, -1.0), (-0.8, -1.0), (-0.8, 1.0), (1.0, 0.0)]
"""v_a / D and n in the four quadrants and on two of the axes between them."""


@pytest.fixture(scope="module")
def plant(frigate: Ship) -> Any:
    """Record of the frigate with a four-quadrant propeller."""
    return frigate.with_values({"propeller.model": "four-quadrant"}).record()


def fourier_sum(pitch: float, velocity: float, n: float) -> tuple[float, float]:
    """KT n^2 and KQ n^2 straight from the published table, by cos(k beta) and sin(k beta)."""
    file = resources.files("shaftline.plant").joinpath("data/four_quadrant_b_series.csv")
    with file.open() as stream:
        table = pd.read_csv(stream)
    of = (table["blades"] == 4) & (table["expanded_area_ratio"] == 0.7)
    rows = table[of & (table["pitch_ratio"] == pitch)]
    beta = math.atan2(velocity, 0.7 * math.pi * n)
    k = rows["k"].to_numpy()
    cos, sin = np.cos(k * beta), np.sin(k * beta)
    ct = (rows["ct_cos_x100"] @ cos + rows["ct_sin_x100"] @ sin) / 100.0
    cq = -(rows["cq_cos_x1000"] @ cos + rows["cq_sin_x1000"] @ sin) / 1000.0
    square = math.pi / 8.0 * (velocity**2 + (0.7 * math.pi * n) ** 2)
    return ct * square, cq * square


@pytest.mark.parametrize(("velocity", "n"), SPEEDS)
def test_pitch_between_two_nodes_has_the_loads_between(velocity: float, n: float) -> None:
    family = b4_70_family()
    for low, high, share in ((0.5, 0.6, 0.25), (0.8, 1.0, 0.5), (1.2, 1.4, 0.9)):
        found = four_quadrant_coefficients(family, NODES, velocity, n, low + share * (high - low))
        ends = [np.array(fourier_sum(pitch, velocity, n)) for pitch in (low, high)]
        expected = (1.0 - share) * ends[0] + share * ends[1]
        assert found == pytest.approx(tuple(expected), rel=1e-10, abs=1e-12)


def test_loads_have_the_slope_over_pitch_and_none_outside() -> None:
    family = b4_70_family()

    def slope(pitch: float) -> float:
        found = four_quadrant_coefficients(family, NODES, 0.5, 1.0 + 0j, pitch + 1e-30j)
        return float(found[0].imag / 1e-30)

    rise = fourier_sum(1.0, 0.5, 1.0)[0] - fourier_sum(0.8, 0.5, 1.0)[0]
    assert slope(0.9) == pytest.approx(rise / 0.2, rel=1e-9)
    assert slope(0.4) == slope(1.5) == 0.0
    # at the outer nodes it is that of the range: the frigate's blades stand at 1.4
    for low, high, node in ((1.2, 1.4, 1.4), (0.5, 0.6, 0.5)):
        rise = fourier_sum(high, 0.5, 1.0)[0] - fourier_sum(low, 0.5, 1.0)[0]
        assert slope(node) == pytest.approx(rise / (high - low), rel=1e-9)


def loads(plant: Any, velocity: float, omega: float, pitch: float) -> Any:
    return propeller_load(plant, velocity, omega, pitch, 4.0, 0.0)


@pytest.mark.parametrize("pitch", PITCH_NODES)
@pytest.mark.parametrize(("velocity", "n"), SPEEDS)
def test_rotation_equals_direct_fourier_sum(pitch: float, velocity: float, n: float) -> None:
    found = four_quadrant_coefficients(b4_70_family(), NODES, velocity, n, pitch)
    assert found == pytest.approx(fourier_sum(pitch, velocity, n), rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("pitch", PITCH_NODES)
def test_family_is_scaled_to_the_ships_bollard_pull(pitch: float) -> None:
    kt, kq = b_series("KT", 0.9, 5), b_series("KQ", 0.9, 5)
    table = scaled_to_bollard(
        np.array([open_water(kt, 0.0, p) for p in PITCH_NODES]),
        np.array([open_water(kq, 0.0, p) for p in PITCH_NODES]),
    )
    found = four_quadrant_coefficients(table, NODES, 0.0, 1.0, pitch)
    expected = (open_water(kt, 0.0, pitch), open_water(kq, 0.0, pitch))
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("pitch", [0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4])
@pytest.mark.parametrize("j", np.linspace(0.0, 0.6, 7))
def test_first_quadrant_is_near_the_b_series(
    plant: Any, frigate: Ship, pitch: float, j: float
) -> None:
    omega = 10.0
    velocity = j * omega / (2 * math.pi) * 4.2
    four, one = (loads(p, velocity, omega, pitch) for p in (plant, frigate.record()))
    assert four.thrust == pytest.approx(one.thrust, rel=0.10)  # worst measured: 9.5 %
    assert four.torque == pytest.approx(one.torque, rel=0.10)  # worst measured: 9.3 %


@pytest.mark.parametrize("pitch", [0.6, 1.0, 1.4])
@pytest.mark.parametrize("velocity", [-6.0, 0.0, 6.0])
def test_loads_are_continuous_through_shaft_reversal(
    plant: Any, pitch: float, velocity: float
) -> None:
    omega = np.linspace(-0.2, 0.2, 401)
    thrust, torque = np.array([loads(plant, velocity, w, pitch)[:2] for w in omega]).T
    assert np.all(np.isfinite(thrust))
    assert np.all(np.isfinite(torque))
    scale = loads(plant, 0.0, 10.0, 1.0)
    assert np.abs(np.diff(thrust)).max() < 1e-3 * scale.thrust
    assert np.abs(np.diff(torque)).max() < 1e-3 * scale.torque


def test_standstill_in_still_water_gives_no_load(plant: Any) -> None:
    assert loads(plant, 0.0, 0.0, 1.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("pitch", [0.6, 1.0, 1.4])
@pytest.mark.parametrize("velocity", [-2.0, 0.0, 5.0])
def test_turning_astern_pushes_astern(plant: Any, pitch: float, velocity: float) -> None:
    astern = loads(plant, velocity, -10.0, pitch)
    assert astern.thrust < 0.0
    assert astern.torque < 0.0


@pytest.mark.parametrize("pitch", [0.8, 1.0, 1.4])
def test_stopped_propeller_is_driven_by_the_water(plant: Any, pitch: float) -> None:
    stopped = loads(plant, 6.0, 0.0, pitch)
    assert stopped.thrust < 0.0
    assert stopped.torque < 0.0


@pytest.mark.parametrize(("outside", "node"), [(0.3, 0.5), (1.5, 1.4)])
def test_pitch_is_held_at_the_outer_nodes(plant: Any, outside: float, node: float) -> None:
    assert loads(plant, 3.0, 10.0, outside) == loads(plant, 3.0, 10.0, node)
