"""Fits of ships to channels: what is found, how sure it is, and how much rows tell."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.search.placed import Placed
from shaftline.mismatch.structure.rows import telling

from .rigs import COULOMB, INERTIA, effects, motor, problem, run


def test_a_fit_finds_an_effect_a_number_and_a_shifted_clock_together() -> None:
    truth = {COULOMB: 0.03, INERTIA: 1.4e-3, "tolerances.inertia": 0.5}
    ship = motor().with_values({"tolerances.inertia": 0.5})
    late = []
    for seed in (4, 5):
        table = run(truth, seed, noise=0.1)
        speed = np.interp(table["time_s"] - 0.006, table["time_s"], table["shaft_speed_rad_s"])
        late.append(table.assign(shaft_speed_rad_s=speed))
    own, rows = problem(ship, *late)
    friction = effects(ship, "coulomb-friction")[0]
    model = own.fit((Placed(friction, (0.005,)),), own.nothing())
    assert model.effects[0].values[0] == pytest.approx(0.03, rel=0.03)
    moved = dict(zip([d.key for d in own.doubts], model.numbers, strict=True))
    assert 1e-3 * np.exp(moved[INERTIA]) == pytest.approx(1.4e-3, rel=0.03)
    assert model.nuisance[-1] == pytest.approx(-0.3, abs=0.05)  # rows of 0.02 s
    error = own.errors(model)[-1]
    assert 1e-5 < error < 1e-3
    assert float(own.held_error(model, rows)[0]) < 0.4  # 1.2 where the first state is not found


def test_an_effect_has_the_last_word_on_a_number() -> None:
    ship = motor()
    own, _ = problem(ship, run(), run(seed=1))
    friction = effects(ship, "viscous-friction")[0]
    record = own.record((Placed(friction, (3e-4,)),), np.full(len(own.doubts), 0.5))
    assert record["viscous_engine_side"] == 3e-4
    assert record["inertia_engine_side"] == pytest.approx(1e-3 * np.exp(0.5))


def test_a_recording_that_was_not_fitted_starts_from_its_own_first_state() -> None:
    """The mean over 40 time steps is no first state of a shaft that speeds up."""
    own, rows = problem(motor(), run(seed=6), run(seed=7).iloc[30:].reset_index(drop=True))
    model = own.fit((), own.nothing())
    free = own.channels(model.effects, model.numbers, model.nuisance)[0][:, rows]
    plain = np.sqrt(np.mean((own._measured[:, rows] - free)[0, :40] ** 2))
    told = np.sqrt(np.mean((own._measured - own.followed(model))[0, rows[:40]] ** 2))
    assert told < 0.5 < plain


def test_rows_that_lie_far_off_count_less() -> None:
    table = run(seed=8)
    table.loc[200:215, "shaft_speed_rad_s"] = 900.0
    own, _ = problem(motor(), table, run(seed=9))
    own.heed(own.fit((), own.nothing()))
    assert own.weights[0, 205] < 0.02
    assert np.median(own.weights[0]) == 1.0


@pytest.mark.parametrize("rows", [2000, 5000])
def test_independent_errors_tell_as_much_as_there_are_rows(rows: int) -> None:
    rng = np.random.default_rng(1)
    fast, slow = rng.standard_normal(rows), np.sin(np.arange(rows) / 40.0)
    columns = np.array([fast, slow])
    assert telling(rng.standard_normal(rows), columns) == pytest.approx(rows, rel=0.25)


def test_errors_that_drift_tell_less_of_what_moves_as_slowly() -> None:
    rng, rows = np.random.default_rng(2), 5000
    drift = np.convolve(rng.standard_normal(rows + 200), np.ones(200) / 200**0.5, "valid")[:rows]
    slow = np.convolve(rng.standard_normal(rows + 200), np.ones(200), "valid")[:rows]
    fast = rng.standard_normal(rows)
    assert telling(drift, slow[None]) < 0.03 * rows
    assert telling(drift, fast[None]) > 10.0 * telling(drift, slow[None])
