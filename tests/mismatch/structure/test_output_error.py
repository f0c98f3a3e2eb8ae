"""Fits of ships to measured channels: estimates, standard errors, first states, outliers."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.search.catalogue import SizedEffect

from .rigs import COULOMB, INERTIA, effects, motor, problem, run


def test_a_fit_estimates_an_effect_a_parameter_and_a_shifted_clock_together() -> None:
    truth = {COULOMB: 0.03, INERTIA: 1.4e-3, "tolerances.inertia": 0.5}
    ship = motor().with_values({"tolerances.inertia": 0.5})
    late = []
    for seed in (4, 5):
        table = run(truth, seed, noise=0.1)
        speed = np.interp(table["time_s"] - 0.006, table["time_s"], table["shaft_speed_rad_s"])
        late.append(table.assign(shaft_speed_rad_s=speed))
    own = problem(ship, *late)
    friction = effects(ship, "coulomb-friction")[0]
    model = own.fit((SizedEffect(friction, (0.005,)),), own.file_model())
    assert model.effects[0].values[0] == pytest.approx(0.03, rel=0.03)
    moved = dict(zip([d.key for d in own.priors], model.shifts, strict=True))
    assert 1e-3 * np.exp(moved[INERTIA]) == pytest.approx(1.4e-3, rel=0.03)
    assert model.nuisance[-1] == pytest.approx(-0.3, abs=0.05)  # rows of 0.02 s
    error = own.standard_errors(model)[-1]
    assert 1e-5 < error < 1e-3
    assert float(own.held_error(model)[0]) < 0.4  # 1.2 where the first state is not found


def test_an_effect_has_the_last_word_on_a_parameter() -> None:
    ship = motor()
    own = problem(ship, run(), run(seed=1))
    friction = effects(ship, "viscous-friction")[0]
    record = own.record((SizedEffect(friction, (3e-4,)),), np.full(len(own.priors), 0.5))
    assert record["viscous_engine_side"] == 3e-4
    assert record["inertia_engine_side"] == pytest.approx(1e-3 * np.exp(0.5))


def test_a_recording_that_was_not_fitted_starts_from_its_own_first_state() -> None:
    """The shaft speed is read too high in the first rows, as after a logger's start."""
    late = run(seed=7).iloc[30:].reset_index(drop=True)
    late.loc[:5, "shaft_speed_rad_s"] += 15.0
    own = problem(motor(), run(seed=6), late)
    model = own.fit((), own.file_model())
    free = own.channels(model.effects, model.shifts, model.nuisance)[0][:, own.held_rows]
    plain = np.sqrt(np.mean((own.measured[:, own.held_rows] - free)[0, 6:60] ** 2))
    told = np.sqrt(np.mean((own.measured - own.simulate(model))[0, own.held_rows[6:60]] ** 2))
    assert told < 0.6 * plain


def test_rows_that_lie_far_off_count_less() -> None:
    table = run(seed=8)
    table.loc[200:215, "shaft_speed_rad_s"] = 900.0
    own = problem(motor(), table, run(seed=9))
    own.likelihood.set_noise(own.residual(own.fit((), own.file_model())))
    assert own.likelihood.weights[0, 205] < 0.02
    assert np.median(own.likelihood.weights[0]) == 1.0


def test_a_fit_with_the_derivatives_of_a_model_nearby_ends_where_the_other_one_does() -> None:
    ship = motor()
    own = problem(ship, run({COULOMB: 0.03}, 4), run({COULOMB: 0.03}, 5))
    start = own.fit((), own.file_model())
    friction = (SizedEffect(effects(ship, "coulomb-friction")[0], (0.02,)),)
    columns, search = own.derivatives(start)
    whole, before = own.fit(friction, start), own.simulations
    cheap = own.fit(friction, start, tangent=columns[: search.edge])
    assert own.simulations - before < 25
    assert cheap.score == pytest.approx(whole.score, abs=0.5)
    assert cheap.effects[0].values[0] == pytest.approx(whole.effects[0].values[0], rel=0.01)
