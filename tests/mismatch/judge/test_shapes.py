"""The shape of what has no name, on a plant of straight lines."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.shapes import (
    Shape,
    _hats,
    _knots,
    best_shapes,
    shape_to_show,
    signals_of,
)
from shaftline.mismatch.search.fitting import Colour, Fitter
from shaftline.mismatch.search.spectra import Likelihood, chance_gain
from shaftline.plant import load_ship

from ..toy import FRICTION, RESISTANCE, ROWS, SLOPES, SPEED, TIME, Toy, bands, fitter, white


def residuals_against(rows: Any, **changes: Any) -> Fitter:
    """A recording that differs by these rows of the two balances."""
    toy: Any = Toy({}, white(0, 0.5, 2.0) + rows, **changes)
    return Fitter(toy, bands())


def shape(balance: str, gain: float) -> Shape:
    ends = np.array([0.0, 1.0])
    return Shape(balance, "N", "time", "s", ends, ends, gain, 40.0, ends)


def test_hats_are_straight_between_knots_and_level_beyond() -> None:
    found = _hats(np.array([-1.0, 0.0, 0.5, 2.0, 9.0]), np.array([0.0, 1.0, 3.0]))
    assert found == pytest.approx(
        np.array([[1.0, 1.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5, 0.0], [0.0, 0.0, 0.0, 0.5, 1.0]])
    )


def test_knots_stand_at_quantiles() -> None:
    values = np.concatenate([np.linspace(0.0, 1.0, 301), np.linspace(1.0, 4.0, 100)])
    assert _knots(values, "v") == pytest.approx(np.quantile(values, [0, 0.25, 0.5, 0.75, 1.0]))


def test_knots_are_even_where_the_signal_rests() -> None:
    levels = np.repeat([1.0, 2.0], 200)
    assert _knots(levels, "v") == pytest.approx([1.0, 1.5, 2.0])
    seldom = np.repeat([1.0, 2.0], [320, 80])
    assert _knots(seldom, "v") == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0])  # two are too few
    near = np.concatenate([np.linspace(1.0, 1.019, 300), np.linspace(1.1, 2.0, 100)])
    assert _knots(near, "v") == pytest.approx(
        [1.0, 1.25, 1.5, 1.75, 2.0]
    )  # a fiftieth apart at least
    assert _knots(TIME, "time") == pytest.approx(np.linspace(0.0, ROWS - 1.0, 8))


@pytest.mark.parametrize(("moves", "any_"), [(0.0199, False), (0.0205, True)])
def test_a_signal_that_hardly_moves_is_not_followed(moves: float, any_: bool) -> None:
    assert (_knots(np.linspace(-1.0, -1.0 + moves, 100), "v") is not None) is any_


def test_signals_carry_their_units() -> None:
    fit = residuals_against(np.zeros((2, ROWS)))
    found = signals_of(fit, fit.null)
    assert {name: unit for name, (_, unit) in found.items()} == {
        "shaft_speed": "rad/s",
        "ship_speed": "m/s",
        "pitch_ratio": "",
        "drive": "mm",
        "time": "s",
    }
    assert found["shaft_speed"][0] == pytest.approx(SPEED)
    fit.balances.replay.runs = [fit, fit]  # type: ignore[list-item]
    assert "time" not in signals_of(fit, fit.null)
    fit.balances.replay.ship = load_ship("rov-thruster").with_values(
        {"hull.fixed": False, "hull.mass_kg": 90.0, "hull.resistance_coefficient_N_s2_m2": 40.0}
    )
    assert signals_of(fit, fit.null)["drive"][1] == "V"


def test_a_curve_over_a_signal_is_found_with_its_values() -> None:
    curve = 6.0 * (SPEED - 10.0) ** 2
    fit = residuals_against(np.array([curve, 0.0 * curve]))
    found = best_shapes(fit, fit.null)
    assert [one.balance for one in found] == ["engine", "hull"]
    best = found[0]
    assert (best.signal, best.signal_unit, best.unit) == ("shaft_speed", "rad/s", "N m")
    assert best.excess > 100.0
    assert best.threshold == pytest.approx(chance_gain(5, 5 * 2, 1e-3))
    assert best.values - best.values[2] == pytest.approx(6.0 * (best.knots - 10.0) ** 2, abs=1.0)
    assert best.trace == pytest.approx(np.interp(SPEED, best.knots, best.values))
    assert found[1].excess < 0.0  # nothing is missing there


def test_the_gain_is_that_of_the_likelihood() -> None:
    fit = residuals_against(np.array([5.0 * np.sign(np.sin(TIME / 60.0)), np.zeros(ROWS)]))
    best = best_shapes(fit, fit.null)[0]
    without = np.array([best.trace, np.zeros(ROWS)])
    toy: Any = fit.balances
    toy.measured = {n: toy.measured[n] - row for n, row in zip(toy.names, without, strict=True)}
    left = Fitter(toy, fit.bands)
    assert best.gain == pytest.approx(left.null.score - fit.null.score, rel=0.02)
    assert best.gain > 30.0


def test_a_shape_s_values_are_next_to_free(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their prior is ten times the rms of what their balance lacks."""
    asked = []

    with_columns = Likelihood.with_columns

    def spied(own: Likelihood, columns: Any) -> Likelihood:
        asked.append(columns)
        return with_columns(own, columns)

    fit = residuals_against(np.zeros((2, ROWS)))
    monkeypatch.setattr(Likelihood, "with_columns", spied)
    best_shapes(fit, fit.null)
    rms = np.sqrt(np.mean(np.abs(fit.null.difference) ** 2, axis=1))
    # over the shaft's speed, the drive and time; speed of ship and pitch rest
    assert len(asked) == 2 * 3
    for number, regressors in enumerate(asked):
        row, signal = divmod(number, 3)
        values = (SPEED, fit.balances.nominal_samples["drive"], TIME)[signal]
        knots = _knots(values, "time" if signal == 2 else "v")
        assert knots is not None
        expected = fit.bands.transform(_hats(values, knots)) * 10.0 * rms[row]
        assert regressors.shape[0] == len(knots)
        assert regressors[:, row] == pytest.approx(expected)
        assert not regressors[:, 1 - row].any()


def test_what_the_tolerances_take_up_is_no_shape() -> None:
    off = fitter({RESISTANCE: 1.04 * 3306.2}, known=0.05)
    sure = fitter({RESISTANCE: 1.04 * 3306.2})
    assert next(s for s in best_shapes(off, off.null) if s.balance == "hull").excess < 0.0
    assert next(s for s in best_shapes(sure, sure.null) if s.balance == "hull").excess > 0.0
    assert FRICTION in SLOPES


def test_the_shape_shown_is_the_best_beyond_chance_else_the_coloured_one() -> None:
    balances: Any = SimpleNamespace(names=["engine", "hull"])
    in_hull = Colour(0, 1, 0.01, 0.02, 9.0)
    sure = [shape("engine", 50.0), shape("hull", 30.0)]
    assert sure[0].excess == 10.0
    assert shape_to_show(sure, balances, in_hull) is sure[0]
    weak = [shape("engine", 39.0), shape("hull", 30.0)]
    assert shape_to_show(weak, balances, in_hull) is weak[1]
    assert shape_to_show(weak, balances, None) is weak[0]
    assert shape_to_show(weak[:1], balances, in_hull) is weak[0]
    assert shape_to_show([], balances, in_hull) is None
