"""Residuals against the instruments' noise, on a plant of straight lines."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from shaftline.mismatch.search.fitting import CHANCE, EXCESS, Colour, Fitter, Whiteness

from ..toy import FRICTION, RESISTANCE, ROWS, SLOPES, TIME, Toy, bands, fitter, white

RMS = (0.5, 2.0)
NOISE = {"engine": 0.5, "hull": 2.0}


def whiteness(
    truth: dict[str, float] | None = None, moving: bool = False, **known: Any
) -> Whiteness:
    fit = fitter(truth or {}, seed=5, rms=RMS, **known)
    fit.balances.moving = moving
    return Whiteness(fit, NOISE)


def residual(judge: Whiteness, rows: Any) -> Any:
    """A model that leaves these rows."""
    nothing = np.zeros(len(judge.fitter.nuisance))
    return SimpleNamespace(difference=bands().transform(np.asarray(rows)), tolerances=nothing)


def test_noise_has_the_power_of_noise() -> None:
    judge = whiteness()
    found = judge.ratios(residual(judge, white(11, *RMS)))
    assert found.shape == (len(bands().edges) - 1, 2)
    assert found[-4:].mean() == pytest.approx(1.0, abs=0.1)
    assert judge.ratios(residual(judge, 2.0 * white(11, *RMS))) == pytest.approx(4.0 * found)
    assert judge.colour(residual(judge, white(11, *RMS))) is None


def test_a_channel_without_noise_is_not_judged() -> None:
    judge = Whiteness(whiteness().fitter, {"hull": 2.0})
    found = judge.ratios(residual(judge, white(11, *RMS)))
    assert (found[:, 0] == 0.0).all()
    assert (found[:, 1] > 0.0).all()


def test_what_the_tolerances_explain_is_no_residual() -> None:
    judge = whiteness({RESISTANCE: 1.03 * 3306.2}, known=0.05)
    null = judge.fitter.null
    left = null.difference - null.tolerances[0] * judge.fitter.nuisance[0]
    expected = judge.ratios(SimpleNamespace(difference=left, tolerances=0.0 * null.tolerances))  # type: ignore[arg-type]
    assert judge.ratios(null) == pytest.approx(expected)
    assert judge.colour(null) is None


def test_of_a_ship_that_moves_only_what_is_slower_than_the_sea_is_judged() -> None:
    judge = whiteness(moving=True)
    found = judge.ratios(residual(judge, white(11, *RMS)))
    last = bands().frequency_Hz[bands().edges[1:] - 1]
    assert (found[last > 0.03] == 0.0).all()
    assert (found[last <= 0.03] > 0.0).all()
    assert {bool(x) for x in last > 0.03} == {True, False}


@pytest.mark.parametrize(("last", "judged"), [(17, True), (19, False)])
def test_the_sea_begins_at_three_hundredths_of_a_hertz(last: int, judged: bool) -> None:
    # every 1/600 Hz: bands that end at 0.0283 and at 0.0317
    grid = replace(bands(), edges=np.array([0, 8, last + 1, 60, len(bands().order)]))
    toy: Any = Toy({}, white(5, *RMS))
    judge = Whiteness(Fitter(toy, grid), NOISE)
    assert bool((judge.ratios(judge.fitter.null)[1] > 0.0).all()) is judged


def test_the_noise_is_what_it_adds_to_the_nominal_residuals() -> None:
    fit = whiteness().fitter
    fit.balances.nominal = {name: 50.0 + 9.0 * np.sin(TIME) for name in ("engine", "hull")}
    found = Whiteness(fit, NOISE)
    assert found.ratios(residual(found, white(11, *RMS)))[-4:].mean() == pytest.approx(1.0, abs=0.1)


def test_colour_is_where_the_excess_over_chance_is_largest() -> None:
    judge = whiteness()
    rows = white(11, *RMS)
    rows[1] += 20.0 * np.sin(2.0 * np.pi * 0.1 * TIME)
    found = judge.colour(residual(judge, rows))
    assert found is not None
    assert (found.balance, found.low_Hz <= 0.1 <= found.high_Hz) == (1, True)
    edges = bands().edges
    assert found.low_Hz == bands().frequency_Hz[edges[found.band]]
    assert found.high_Hz == bands().frequency_Hz[edges[found.band + 1] - 1]
    ratios = judge.ratios(residual(judge, rows))
    assert found.ratio == ratios[found.band, 1] == ratios.max()


@pytest.mark.parametrize(("share", "coloured"), [(0.999, False), (1.001, True)])
def test_the_limit_is_twice_what_chance_reaches(share: float, coloured: bool) -> None:
    assert (EXCESS, CHANCE) == (2.0, 1e-6)
    judge = whiteness()
    band, grid = 3, bands()
    inside = slice(grid.edges[band], grid.edges[band + 1])
    freedom = 2.0 * grid.weights[inside].sum()
    model: Any = residual(judge, white(11, *RMS))
    limit = 2.0 * chi2.isf(1e-6, freedom) / freedom
    model.difference[0, inside] *= np.sqrt(share * limit / judge.ratios(model)[band, 0])
    found = judge.colour(model)
    assert found == (
        None
        if not coloured
        else Colour(
            band,
            0,
            grid.frequency_Hz[inside][0],
            grid.frequency_Hz[inside][-1],
            pytest.approx(share * limit),  # type: ignore[arg-type]
        )
    )


def test_an_effect_that_is_missing_colours_the_null_and_not_its_own_fit() -> None:
    judge = whiteness({FRICTION: 30000.0})
    found = judge.colour(judge.fitter.null)
    assert found is not None
    assert found.balance == 0
    rows = np.array(white(5, *RMS))  # what is left with the friction in place
    assert judge.colour(residual(judge, rows)) is None
    assert np.abs(SLOPES[FRICTION]).max() * 30000.0 > 10.0 * RMS[0]
    assert rows.shape == (2, ROWS)


def test_coarse_steps_are_noise_as_slow_as_the_channel() -> None:
    """Read in steps, a slow channel is off slowly: what white noise of that size would leave is less."""
    fit = fitter({}, seed=5, rms=RMS)
    fit.balances.nominal = {"engine": 3.0 * np.sin(TIME / 40.0), "hull": 0.0 * TIME}  # type: ignore[attr-defined]
    step = 2.0
    off = np.round(fit.balances.nominal["engine"] / step) * step - fit.balances.nominal["engine"]
    left = residual(whiteness(), [off, white(11, *RMS)[1]])
    rms = {"engine": step / 12.0**0.5, "hull": 2.0}
    plain, coarse = Whiteness(fit, rms), Whiteness(fit, rms, {"engine": step})
    assert plain.colour(left) is not None
    assert coarse.colour(left) is None
