"""Formulas where no name fits: found in the simulator, priced, and judged on data set aside."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import pytest
from threadpoolctl import threadpool_limits

from shaftline.mismatch.judge.correction import FreeRunning
from shaftline.mismatch.judge.held_out import HeldOut, bands_of, split_held_out
from shaftline.mismatch.search.blocks import Block, Factor
from shaftline.mismatch.search.fitting import Fitter, Whiteness
from shaftline.mismatch.search.formulas import (
    Formula,
    FormulaSearch,
    HeldOutData,
    choose_formula,
    is_as_good,
    search_formula,
)
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording
from shaftline.plant.terms import Term

from ..voyages import bench_tug, tug_run

FORCE = "side_force"
HIGHEST_HZ = 6.0


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """As a diagnosis has it: small matrices are slower on several."""
    with threadpool_limits(1, "blas"):
        yield


@functools.cache
def rig() -> Ship:
    return bench_tug().with_signals({FORCE: "N"})


def recorded(ship: Ship, seed: int) -> pd.DataFrame:
    """A run with a side force on the bearing that wanders, heard or not."""
    run = tug_run(bench_tug(), seed=seed)
    time = run["time_s"].to_numpy()
    run[FORCE] = 40.0 + 30.0 * np.sin(0.9 * time + seed) * np.cos(0.23 * time)
    sailed = simulate_recording(ship, run)
    rng = np.random.default_rng(seed)
    run["shaft_speed_rad_s"] = sailed["shaft_speed_rad_s"] + 0.3 * rng.standard_normal(len(run))
    return run


@functools.cache
def searched(
    expression: str, size: float, seed: int
) -> tuple[FormulaSearch, HeldOutData, Formula | None]:
    term = {"id": "truth", "acts_on": "drive_torque", "expression": expression}
    ship = rig()
    if expression:
        ship = ship.with_term(Term.model_validate(term | {"parameters": {"c": size}}))
    balances = Balances(JointReplay(rig(), recorded(ship, seed)))
    train, held = split_held_out(balances.replay, 0)[0]
    fitter = Fitter(balances, bands_of(balances, train, HIGHEST_HZ))
    aside = HeldOutData(HeldOut(fitter, held), np.concatenate([np.arange(a, b) for a, b in held]))
    search = FormulaSearch(fitter, fitter.null, balances.names)
    return search, aside, choose_formula(search, aside)


@pytest.mark.parametrize(
    ("expression", "size", "seed", "told"),
    [
        ("-c * drive * abs(shaft_speed)", 1e-5, 3, "a * drive * abs(shaft_speed)"),
        ("-c * side_force * drive", 5e-5, 4, "a * drive * side_force"),
    ],
)
def test_the_truth_s_own_form_is_found(expression: str, size: float, seed: int, told: str) -> None:
    _, _, formula = searched(expression, size, seed)
    assert formula is not None
    assert (formula.balance, formula.term.acts_on) == ("motor", "drive_torque")
    assert formula.term.expression == told
    (found,) = formula.estimates
    low, high = found.ci95
    assert low <= -size <= high
    assert high - low < 0.2 * size
    assert formula.gain > formula.threshold > 0.0
    assert formula.held_out > 0.0
    assert set(formula.signals) == {
        name for name in ("drive", "shaft_speed", FORCE) if name in told
    }


def test_a_coefficient_has_its_unit_and_the_term_its_value() -> None:
    _, _, formula = searched("-c * side_force * drive", 5e-5, 4)
    assert formula is not None
    (found,) = formula.estimates
    assert found.unit == "m/V"  # N m over N V
    assert formula.term.parameters["a"].value == found.value
    assert formula.words == "a drive side force"
    corrected = rig().with_term(formula.term)
    assert corrected.parameter("term.formula.a").value == found.value


@pytest.mark.parametrize("seed", [5, 6])
def test_nothing_is_told_of_noise(seed: int) -> None:
    assert searched("", 0.0, seed)[2] is None


def test_it_is_asked_only_where_more_than_noise_is_left() -> None:
    search, aside, _ = searched("", 0.0, 5)
    fitter = search.fitter
    whiteness = Whiteness(fitter, fitter.balances.replay.noise_rms)
    assert search_formula(whiteness, fitter.null, aside.judge, aside.rows) is None


def test_a_formula_pays_for_each_block_and_for_the_search() -> None:
    search, _, _ = searched("", 0.0, 5)
    expected = 1.5 * (np.log(search.samples) + 2.0 * np.log(search.count))
    assert search.threshold(1) == pytest.approx(expected)
    pairs = search.count * (search.count - 1) / 2.0
    assert search.threshold(2) == pytest.approx(
        1.5 * (2.0 * np.log(search.samples) + 2.0 * np.log(pairs))
    )


def test_what_the_data_set_aside_refute_is_not_told() -> None:
    search, aside, formula = searched("-c * side_force * drive", 5e-5, 4)
    assert formula is not None
    against = HeldOutData(lambda record: -aside.judge(record), aside.rows)
    assert choose_formula(search, against) is None


def test_a_wrong_number_is_no_formula() -> None:
    wrong = rig().with_values(
        {
            k: rig().parameter(k).value * 1.01
            for k in ("prime_mover.armature_resistance_ohm", "prime_mover.motor_constant_V_s_rad")
        }
    )
    balances = Balances(JointReplay(rig(), recorded(wrong, 8)))
    train, held = split_held_out(balances.replay, 0)[0]
    fitter = Fitter(balances, bands_of(balances, train, HIGHEST_HZ))
    rows = np.concatenate([np.arange(a, b) for a, b in held])
    search = FormulaSearch(fitter, fitter.null, balances.names)
    assert choose_formula(search, HeldOutData(HeldOut(fitter, held), rows)) is None


def test_coefficients_are_fitted_in_the_simulator() -> None:
    search, _, formula = searched("-c * drive * abs(shaft_speed)", 1e-5, 3)
    assert formula is not None
    block = Block.of(Factor("drive"), Factor("shaft_speed", "size"))
    for start in (-7e-6, -1.4e-5):  # beside where it ends
        trial = search.fit_formula("drive_torque", (block,), (start,))
        assert trial is not None
        assert trial.sized_effect.values[0] == pytest.approx(formula.estimates[0].value, rel=0.08)
        assert trial.gain > 0.95 * formula.gain


def test_one_that_runs_away_is_dropped() -> None:
    search, _, _ = searched("", 0.0, 5)
    cubed = Block.of(*[Factor("shaft_speed")] * 3)
    assert search.fit_formula("drive_torque", (cubed,), (1e3,)) is None


def test_a_formula_takes_a_shape_s_place_where_it_does_as_well() -> None:
    assert is_as_good(96.0, 100.0)
    assert not is_as_good(90.0, 100.0)
    assert not is_as_good(-1.0, -5.0)
    assert is_as_good(3.0, 0.0)


def test_a_channel_that_is_simulated_worse_is_seen() -> None:
    search, aside, formula = searched("-c * side_force * drive", 5e-5, 4)
    assert formula is not None
    replay: Any = search.fitter.balances.replay
    free = FreeRunning(replay, aside.rows)
    nominal, better = free.errors(rig()), free.errors(rig().with_term(formula.term))
    assert not free.worse(better, nominal)
    assert free.worse(nominal, better)
