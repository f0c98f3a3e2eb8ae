"""Findings and what could not have been found, on a plant of straight lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.verdict import (
    detectable_effects,
    findings_of,
    implausible_parameter,
    parameter_at_bound,
)
from shaftline.mismatch.report.text import finding_sentence
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.search.selection import Selection

from ..toy import FOULING, FRICTION, ROWS, SLOPES, VISCOUS, Toy, bands, entry, fitter, white

ENGINE_FRICTION = entry("coulomb-friction (engine)")
VISCOUS_FRICTION = entry("viscous-friction (engine)")
HULL_FOULING = entry("hull-fouling (hull)")
GAUGE = entry("torque-sensor-gain (sensor)")
EPISODE = entry("resistance-episode (hull)")


@pytest.fixture
def both() -> tuple[Fitter, Selection]:
    fit = fitter({FRICTION: 6000.0, FOULING: 0.3})
    placed = (SizedEffect(ENGINE_FRICTION, (6000.0,)), SizedEffect(HULL_FOULING, (0.3,)))
    rivals: Any = ((), ("rival",))
    return fit, Selection(fit.evaluate(placed), (300.0, 200.0), (10.0, 11.0), rivals, ())


def residuals_against(fit: Fitter) -> Any:
    return fit.balances.residuals_against(fit.balances.nominal)


def test_a_finding_carries_what_was_found(both: tuple[Fitter, Selection]) -> None:
    fit, selection = both
    friction, fouling = findings_of(fit, selection, residuals_against(fit))
    assert (friction.effect, fouling.effect) == (ENGINE_FRICTION, HULL_FOULING)
    assert (friction.score, friction.threshold, friction.rivals) == (300.0, 10.0, ())
    assert (fouling.score, fouling.threshold) == (200.0, 11.0)
    assert list(map(str, fouling.rivals)) == ["rival"]
    assert friction.estimates == fit.estimates(selection.fit, 0.15)[0]
    assert friction.estimates[0].form_error == pytest.approx(0.15 * 6000.0)


def test_a_trace_is_what_the_effect_changes_in_its_balance(both: tuple[Fitter, Selection]) -> None:
    fit, selection = both
    friction, fouling = findings_of(fit, selection, residuals_against(fit))
    assert (friction.row, fouling.row) == (0, 1)
    assert friction.trace == pytest.approx(6000.0 * SLOPES[FRICTION][0])
    assert fouling.trace == pytest.approx(0.3 * SLOPES[FOULING][1])
    assert friction.windows == [(0.0, ROWS - 1.0)]
    assert friction.regime == ""


def test_an_instrument_is_shown_in_the_balance_that_feels_it_most() -> None:
    toy: Any = Toy({}, white(0, 0.5, 2.0))
    rows = np.array([np.full(ROWS, 4.0), np.full(ROWS, 5.0)])
    nominal = toy.nominal_samples

    def simulate(record: Any, shift: Any = None) -> Any:
        felt = rows * (float(record["torque_sensor_gain"]) - 1.0)
        return nominal | dict(zip(toy.names, felt, strict=True))

    toy.simulate = simulate
    fit = Fitter(toy, bands())
    chosen = Selection(fit.evaluate((SizedEffect(GAUGE, (1.1,)),)), (9.0,), (8.0,), ((),), ())
    (found,) = findings_of(fit, chosen, white(0, 0.5, 2.0))
    assert found.row == 0  # 4 of 0.5 is more than 5 of 2
    (found,) = findings_of(fit, chosen, white(0, 0.5, 0.4))
    assert found.row == 1


def test_a_value_at_the_bound_of_its_search_has_no_interval(both: tuple[Fitter, Selection]) -> None:
    fit, _ = both
    low, high = fit.trial_ship.range_of(HULL_FOULING.parameters[0])
    for bound in (low, high):
        placed = SizedEffect(HULL_FOULING, (bound,))
        chosen = Selection(fit.evaluate((placed,)), (90.0,), (8.0,), ((),), ())
        (found,) = findings_of(fit, chosen, residuals_against(fit))
        said = f"fouling_fraction is at the bound of its search, {bound:.4g}"
        assert found.unmeasured == said
        assert f"({said}: no interval)" in finding_sentence(found)
    for inside in (0.9 * low, 0.0, 0.99 * high):
        assert parameter_at_bound(fit.trial_ship, SizedEffect(HULL_FOULING, (inside,))) == ""
    # friction begins at 0, where it is absent: that bound is no end of a search
    assert parameter_at_bound(fit.trial_ship, SizedEffect(ENGINE_FRICTION, (0.0,))) == ""


def test_a_value_that_physics_does_not_allow_is_reported_as_such(
    both: tuple[Fitter, Selection],
) -> None:
    fit, selection = both
    chosen = Selection(
        fit.evaluate((SizedEffect(HULL_FOULING, (1.2,)),)), (90.0,), (8.0,), ((),), ()
    )
    (found,) = findings_of(fit, chosen, residuals_against(fit))
    said = "fouling_fraction lies outside its plausible range, -0.05 to 1"
    assert (found.implausible, found.unmeasured) == (said, "")
    assert finding_sentence(found).endswith(f"; {said}, so another cause is likely.")
    assert [f.implausible for f in findings_of(fit, selection, residuals_against(fit))] == ["", ""]
    for value in (-0.05, 1.0):
        assert implausible_parameter(fit.trial_ship, SizedEffect(HULL_FOULING, (value,))) == ""
    most = fit.trial_ship.plausible_range(ENGINE_FRICTION.parameters[0])[1]
    assert "N m" in implausible_parameter(
        fit.trial_ship, SizedEffect(ENGINE_FRICTION, (1.01 * most,))
    )


def test_windows_and_regime_are_those_of_the_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    late = np.where(np.arange(ROWS) > 480, 1e-3, 0.0)
    monkeypatch.setitem(SLOPES, FRICTION, np.array([late, np.zeros(ROWS)]))
    toy: Any = Toy({FRICTION: 6000.0}, white(0, 0.5, 2.0))
    samples = toy.simulate
    toy.simulate = lambda *given: samples(*given) | {"ship_speed": np.linspace(5.0, 8.0, ROWS)}
    fit = Fitter(toy, bands())
    placed = (SizedEffect(ENGINE_FRICTION, (6000.0,)),)
    (found,) = findings_of(
        fit, Selection(fit.evaluate(placed), (9.0,), (8.0,), ((),), ()), residuals_against(fit)
    )
    assert found.windows == [(479.0, ROWS - 1.0)]
    assert found.regime == "ship_speed above 7.4 m/s"


def test_an_episode_keeps_its_own_window() -> None:
    fit = fitter({})
    episode = SizedEffect(EPISODE, (0.5,), (60.0, 150.0))
    chosen = Selection(fit.evaluate((episode,)), (9.0,), (8.0,), ((),), ())
    (found,) = findings_of(fit, chosen, residuals_against(fit))
    assert found.windows == [(60.0, 150.0)]
    assert found.regime == ""


def test_the_smallest_size_seen_is_the_root_of_threshold_times_variance() -> None:
    fit = fitter({}, known=0.02)
    found = detectable_effects(fit, lambda effect: 16.0, fit.null, [ENGINE_FRICTION, HULL_FOULING])
    assert [(d.effect, d.unit) for d in found] == [(ENGINE_FRICTION, "N m"), (HULL_FOULING, "-")]
    for one, key in zip(found, (FRICTION, FOULING), strict=True):
        column = fit.bands.transform(SLOPES[key])[None]
        variance = np.linalg.inv(fit.likelihood.information(fit.null.weight, column))[0, 0]
        assert one.value == pytest.approx(
            4.0 * np.sqrt(variance)
        )  # of a straight line: at any probe


def test_a_size_is_told_of_one_number_that_can_be_small() -> None:
    fit = fitter({})
    untold = [
        "engine-torque-curvature (engine)",
        "resistance-episode (hull)",
        "rack-rate-limit (engine)",
        "current (hull)",
    ]
    effects = [
        entry(label) for label in untold
    ]  # two numbers; a window; absent at infinity; no trace
    assert detectable_effects(fit, lambda effect: 16.0, fit.null, effects) == []


def test_the_size_is_the_distance_from_the_ship_s_own() -> None:
    own = fitter({}).balances.replay.ship.with_values({FRICTION: 900.0})
    toy: Any = Toy({}, white(0, 0.5, 2.0), ship=own)
    fit = Fitter(toy, bands())
    (here,) = detectable_effects(fit, lambda effect: 16.0, fit.null, [ENGINE_FRICTION])
    there = fitter({})
    (usual,) = detectable_effects(there, lambda effect: 16.0, there.null, [ENGINE_FRICTION])
    assert here.value == pytest.approx(usual.value)


def test_effects_in_one_balance_have_traces_of_their_own() -> None:
    fit = fitter({})
    placed = (SizedEffect(ENGINE_FRICTION, (6000.0,)), SizedEffect(VISCOUS_FRICTION, (300.0,)))
    chosen = Selection(fit.evaluate(placed), (9.0, 9.0), (8.0, 8.0), ((), ()), ())
    first, second = findings_of(fit, chosen, residuals_against(fit))
    assert first.trace == pytest.approx(6000.0 * SLOPES[FRICTION][0])
    assert second.trace == pytest.approx(300.0 * SLOPES[VISCOUS][0])


def test_what_acts_always_has_no_regime(monkeypatch: pytest.MonkeyPatch) -> None:
    mostly = np.where(np.arange(ROWS) > 480, 1e-3, 2e-4)  # felt throughout, strongest at the end
    monkeypatch.setitem(SLOPES, FRICTION, np.array([mostly, np.zeros(ROWS)]))
    toy: Any = Toy({FRICTION: 6000.0}, white(0, 0.5, 2.0))
    samples = toy.simulate
    toy.simulate = lambda *given: samples(*given) | {"ship_speed": np.linspace(5.0, 8.0, ROWS)}
    fit = Fitter(toy, bands())
    chosen = Selection(
        fit.evaluate((SizedEffect(ENGINE_FRICTION, (6000.0,)),)), (9.0,), (8.0,), ((),), ()
    )
    (found,) = findings_of(fit, chosen, residuals_against(fit))
    assert (found.windows, found.regime) == ([(0.0, ROWS - 1.0)], "")


def test_sizes_are_told_beside_what_was_found() -> None:
    fit = fitter({FOULING: 0.3})
    found = fit.evaluate((SizedEffect(HULL_FOULING, (0.3,)),))
    (friction,) = detectable_effects(fit, lambda effect: 16.0, found, [ENGINE_FRICTION])
    column = fit.bands.transform(SLOPES[FRICTION])[None]
    variance = np.linalg.inv(fit.likelihood.information(found.weight, column))[0, 0]
    assert friction.value == pytest.approx(4.0 * np.sqrt(variance))


def test_a_size_is_worked_out_at_the_probe_nearest_to_none() -> None:
    fit = fitter({})
    tried: list[float] = []
    predicted = fit.predictions

    def spied(records: Any) -> Any:
        tried.extend(map(fit.trial_ship.ship.parameter(FOULING).read, records))
        return predicted(records)

    fit.predictions = spied  # type: ignore[method-assign]
    detectable_effects(fit, lambda effect: 16.0, fit.null, [HULL_FOULING])
    assert tried == [0.0, 0.03]


def test_an_effect_without_room_for_a_probe_has_no_size() -> None:
    full = fitter({}).balances.replay.ship.with_values({FRICTION: 1e7})
    toy: Any = Toy({}, white(0, 0.5, 2.0), ship=full)
    fit = Fitter(toy, bands())
    assert fit.trial_ship.probes(ENGINE_FRICTION.parameters[0]) == []
    assert detectable_effects(fit, lambda effect: 16.0, fit.null, [ENGINE_FRICTION]) == []


def test_an_effect_whose_probe_diverges_has_no_size() -> None:
    fit = fitter({})
    predicted = fit.predictions

    def diverging(records: Any) -> Any:
        fouled = map(fit.trial_ship.ship.parameter(FOULING).read, records)
        for prediction, value in zip(predicted(records), fouled, strict=True):
            yield prediction * (np.nan if value != 0.0 else 1.0)

    fit.predictions = diverging  # type: ignore[method-assign]
    (one,) = detectable_effects(fit, lambda effect: 16.0, fit.null, [HULL_FOULING, ENGINE_FRICTION])
    assert one.effect == ENGINE_FRICTION
