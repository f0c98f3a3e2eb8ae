from __future__ import annotations

import numpy as np
import pytest

from shaftline.core.numeric import clip, newton_step, piecewise_linear, start_between

STEP = 1e-30
KNOTS = np.array([1.0, 2.0, 4.0, 0.0, 0.0])
VALUES = np.array([5.0, -1.0, 3.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("value", "clipped"), [(-3.0, -1.0), (-1.0, -1.0), (0.5, 0.5), (2.0, 2.0), (7.0, 2.0)]
)
def test_clip_limits_on_both_sides(value: float, clipped: float) -> None:
    assert clip(value, -1.0, 2.0) == clipped


@pytest.mark.parametrize(
    ("value", "slope"), [(-3.0, 0.0), (-1.0, 1.0), (0.5, 1.0), (2.0, 1.0), (7.0, 0.0)]
)
def test_clip_passes_a_derivative_up_to_its_limits(value: float, slope: float) -> None:
    assert complex(clip(value + STEP * 1j, -1.0, 2.0)).imag / STEP == slope


def test_a_limit_may_carry_the_derivative() -> None:
    assert complex(clip(3.0 + 0j, 0.0 + 0j, 2.0 + STEP * 1j)).imag == STEP
    assert complex(clip(-3.0 + 0j, -2.0 + STEP * 1j, 2.0 + 0j)) == -2.0 + STEP * 1j


def test_line_runs_between_knots_and_is_held_outside() -> None:
    x = np.array([-9.0, 1.0, 1.25, 2.0, 3.0, 4.0, 99.0])
    found = [piecewise_linear(KNOTS, VALUES, 3, one) for one in x]
    np.testing.assert_allclose(found, [5.0, 5.0, 3.5, -1.0, 1.0, 3.0, 3.0], rtol=1e-15)


def test_line_has_the_slope_to_the_right_of_a_knot() -> None:
    x = np.array([-9.0, 1.0, 1.25, 2.0, 3.0, 4.0, 99.0])
    found = [complex(piecewise_linear(KNOTS, VALUES, 3, one + STEP * 1j)).imag / STEP for one in x]
    assert found == pytest.approx([0.0, -6.0, -6.0, 2.0, 2.0, 0.0, 0.0])


def test_knots_beyond_the_count_are_not_there() -> None:
    assert piecewise_linear(KNOTS, VALUES, 2, 3.0) == -1.0


@pytest.mark.parametrize(
    ("guess", "start"), [(0.3, 0.3), (-1.0, 0.2), (9.0, 0.8), (np.nan, 0.5), (np.inf, 0.8)]
)
def test_a_search_begins_inside_its_bounds(guess: float, start: float) -> None:
    assert start_between(guess, 0.2, 0.8) == pytest.approx(start)


@pytest.mark.parametrize(
    ("value", "slope", "step"),
    [
        (0.1, -1.0, (0.6, 0.5, 1.0)),  # Newton's, the lower bound drawn in
        (-0.1, -1.0, (0.4, 0.0, 0.5)),
        (0.0, -1.0, (0.25, 0.0, 0.5)),  # a zero is an upper bound, and no step leaves it
        (0.1, -0.1, (0.75, 0.5, 1.0)),  # beyond a bound: halfway
        (-0.1, -0.1, (0.25, 0.0, 0.5)),
        (0.1, 0.0, (0.75, 0.5, 1.0)),
        (0.1, 2.0, (0.75, 0.5, 1.0)),  # uphill
    ],
)
def test_a_newton_step_stays_inside_its_bounds(
    value: float, slope: float, step: tuple[float, float, float]
) -> None:
    assert newton_step(0.5, value, slope, 0.0, 1.0) == pytest.approx(step)
