"""Four-quadrant curves, inverted: branch by branch, both ways round, through the ring vortex."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import Ship, load_ship
from shaftline.plant.four_quadrant import PITCH_NODES, b4_70_family, ring_vortex
from shaftline.plant.propeller import (
    FOLD_MARGIN,
    advance_ratio_of,
    outside_ring_vortex,
    propeller_load,
    torque_in_any_quadrant,
)

FAMILY = b4_70_family()
SHIP = load_ship("frigate").with_values(
    {"propeller.model": "four-quadrant", "propeller.astern_load_fraction": 0.9}
)
PLANT = SHIP.record()
BOTH = (1.0, -1.0)


def kq(j: float, pitch: float, direction: float) -> float:
    """KQ in the direction of rotation, by the plant's own load."""
    w = direction * 2.0 * math.pi
    v = j * direction * PLANT["diameter"]
    torque = propeller_load(PLANT, v, w, pitch, 4.0, 0.0).torque
    return float(direction * torque / (PLANT["density"] * PLANT["diameter"] ** 5))


def fold(node: int, direction: float) -> tuple[float, float]:
    dip, peak = PLANT["ring_vortex"][0 if direction > 0.0 else 1, node]
    return float(dip), float(peak)


@pytest.mark.parametrize(
    ("v", "n"), [(2.0, 1.5), (-2.0, 1.5), (2.0, -1.5), (-2.0, -1.5), (1.0, 0.0)]
)
def test_torque_is_the_plants(v: float, n: float) -> None:
    load = propeller_load(PLANT, v, n * 2.0 * math.pi, 1.1, 4.0, 0.0)
    found = torque_in_any_quadrant(PLANT, v / PLANT["diameter"], n, 1.1)
    assert found * PLANT["density"] * PLANT["diameter"] ** 5 == pytest.approx(
        load.torque, rel=1e-12
    )


@pytest.mark.parametrize("direction", BOTH)
@pytest.mark.parametrize("node", range(len(PITCH_NODES)))
def test_the_curve_falls_but_for_one_fold(node: int, direction: float) -> None:
    dip, peak = fold(node, direction)
    assert -0.55 < dip < peak < 0.1
    j = 0.7 * math.pi * np.tan(np.radians(np.arange(-89.9, 89.9, 0.05)))
    q = np.array([kq(x, PITCH_NODES[node], direction) for x in j])
    rising = j[:-1][np.diff(q) > 0.0]
    assert dip - 0.005 < rising.min() < dip + 0.01
    assert peak - 0.01 < rising.max() < peak + 0.005


def test_a_curve_without_a_fold_is_refused() -> None:
    flat = np.zeros_like(FAMILY)
    flat[:, 0, 2] = 0.1  # CQ* the same all round
    with pytest.raises(
        ValueError, match="KQ of pitch node 0 has 1 extrema instead of a dip and a peak"
    ):
        ring_vortex(flat)


@given(
    j=st.floats(-8.0, 8.0),
    pitch=st.floats(0.5, 1.4),
    direction=st.sampled_from(BOTH),
    away=st.floats(-0.3, 0.3),
)
def test_the_inverse_finds_its_way_back_on_either_branch(
    j: float, pitch: float, direction: float, away: float
) -> None:
    """From a guess on the same branch, anywhere but in the fold."""
    if -0.55 < j < 0.1:
        return
    guess = max(j + away, 0.1) if j > 0.0 else min(j + away, -0.55)
    found, valid = advance_ratio_of(PLANT, kq(j, pitch, direction), pitch, guess, direction)
    assert found == pytest.approx(j, rel=1e-8)
    assert valid == (j > 0.0)


@pytest.mark.parametrize("direction", BOTH)
def test_between_the_folds_torques_the_guess_chooses_the_branch(direction: float) -> None:
    pitch, node = 1.0, 3
    dip, peak = fold(node, direction)
    middle = 0.5 * (kq(dip, pitch, direction) + kq(peak, pitch, direction))
    near, trusted = advance_ratio_of(PLANT, middle, pitch, 0.0, direction)
    far, distrusted = advance_ratio_of(PLANT, middle, pitch, -0.8, direction)
    assert far < dip < peak < near
    assert trusted
    assert not distrusted
    for j in (near, far):
        assert kq(j, pitch, direction) == pytest.approx(middle, rel=1e-9)


@pytest.mark.parametrize("direction", BOTH)
def test_beyond_the_fold_one_branch_is_left(direction: float) -> None:
    pitch, node = 1.0, 3
    dip, peak = fold(node, direction)
    most, least = kq(peak, pitch, direction), kq(dip, pitch, direction)
    # a little beyond it is held at the end, whence it may come back
    j, valid = advance_ratio_of(PLANT, (1.0 + 0.5 * FOLD_MARGIN) * most, pitch, 0.3, direction)
    assert j == pytest.approx(peak)
    assert not valid
    j, valid = advance_ratio_of(PLANT, (1.0 - 0.5 * FOLD_MARGIN) * least, pitch, -0.9, direction)
    assert j == pytest.approx(dip)
    assert not valid
    # well beyond it the other branch is taken, whatever the guess
    j, valid = advance_ratio_of(PLANT, 1.2 * most, pitch, 0.3, direction)
    assert j < dip
    assert not valid
    j, valid = advance_ratio_of(PLANT, 0.8 * least, pitch, -0.9, direction)
    assert j > 0.0
    assert valid


def test_what_is_no_number_gives_the_guess() -> None:
    assert advance_ratio_of(PLANT, math.nan, 1.0, 0.4, 1.0) == (0.4, False)
    assert advance_ratio_of(PLANT, 0.03, math.nan, 0.4, 1.0) == (0.4, False)
    j, valid = advance_ratio_of(PLANT, kq(0.5, 1.0, 1.0), 1.0, math.nan, 1.0)
    assert valid
    assert j == pytest.approx(0.5)


@pytest.mark.parametrize("direction", BOTH)
def test_the_ring_vortex_is_left_by_an_unmistakable_torque_alone(direction: float) -> None:
    pitch, node = 1.0, 3
    dip, peak = fold(node, direction)
    least, most = kq(dip, pitch, direction), kq(peak, pitch, direction)
    ratios = np.arange(0.0, 1.5, 0.005)
    q = np.array([kq(j, pitch, direction) for j in ratios])

    def trusted(known: bool) -> Any:
        return np.array([outside_ring_vortex(PLANT, j, pitch, direction, known) for j in ratios])

    assert np.array_equal(trusted(True), (q < (1.0 - FOLD_MARGIN) * most) & (ratios >= peak))
    assert np.array_equal(trusted(False), (q < (1.0 - FOLD_MARGIN) * least) & (ratios >= peak))
    assert trusted(True).sum() > trusted(False).sum() > 0
    for j in (-1e-9, -0.3, -2.0, math.nan):
        assert not outside_ring_vortex(PLANT, j, pitch, direction, True)


def test_ahead_in_the_first_quadrant_other_curves_have_no_direction(frigate: Ship) -> None:
    plant = frigate.record()
    assert advance_ratio_of(plant, 0.03, 1.2, 0.5) == advance_ratio_of(plant, 0.03, 1.2, 0.5, 1.0)
