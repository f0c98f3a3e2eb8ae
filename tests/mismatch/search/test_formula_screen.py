"""Straight lines about a model: what a place does to the balances, and which blocks they ask for."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from shaftline.mismatch.judge.held_out import bands_of, split_held_out
from shaftline.mismatch.search.blocks import Block, Factor
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.search.formula_screen import Screen, balance_of_location, locations_of
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant.terms import Term

from ..voyages import bench_tug, frigate_voyage, quick_frigate, tug_run


@functools.cache
def frigate() -> Fitter:
    truth = {"id": "truth", "acts_on": "resistance", "expression": "5.0 * ship_speed ** 4"}
    ship = quick_frigate().with_term(Term.model_validate(truth))
    table = frigate_voyage(ship, seed=4, seconds=400.0)
    balances = Balances(JointReplay(quick_frigate(), table))
    train, _ = split_held_out(balances.replay, 0)[0]
    return Fitter(balances, bands_of(balances, train, 0.2))


@functools.cache
def screen() -> Screen:
    return Screen(frigate(), frigate().null)


@pytest.mark.parametrize(
    ("place", "size"),
    [
        ("drive_torque", 50.0),
        ("load_torque", 50.0),
        ("thrust", 100.0),
        ("resistance", 100.0),
        ("inflow_velocity", 1e-3),
        ("drive", 1e-2),
    ],
)
def test_an_answer_is_what_a_constant_in_the_simulator_does(place: str, size: float) -> None:
    balances = frigate().balances
    replay = balances.replay
    term = Term.model_validate({"id": "one", "acts_on": place, "expression": repr(size)})
    moved = replay.simulate_channels(quick_frigate().with_term(term).record())
    felt = (balances.residuals(moved) - balances.residuals(balances.nominal)) / size
    answer = screen().unit_response(place)
    told = np.median(felt[:, 100:], axis=1)
    expected = np.median(answer[:, 100:], axis=1)
    largest = np.abs(expected).max()
    assert told == pytest.approx(expected, rel=0.02, abs=0.02 * largest)


def test_a_place_is_told_in_a_balance_that_is_measured() -> None:
    balances = frigate().balances
    assert balance_of_location("load_torque", balances) == "propeller"
    assert balance_of_location("thrust", balances) == "hull"
    assert balance_of_location("inflow_velocity", balances) == "propeller"
    bench = Balances(JointReplay(bench_tug(), tug_run(seed=1)))
    assert balance_of_location("load_torque", bench) == "motor"
    assert locations_of(bench, bench.names) == ["drive", "drive_torque"]
    assert locations_of(balances, ["hull"]) == ["inflow_velocity", "resistance"]


def test_the_missing_power_of_speed_is_among_the_likeliest() -> None:
    fitter, lines = frigate(), screen()
    null = fitter.null
    values = lines.values(())
    singles, pairs = lines.singles_and_pairs("resistance", null.difference, null.weight, values)
    best = lines.likeliest(singles, null.difference, null.tolerances, values)[0]
    fourth = Block.of(*[Factor("ship_speed")] * 4)
    (found,) = lines.likeliest(
        [one for one in singles if one.blocks == (fourth,)],
        null.difference,
        null.tolerances,
        values,
    )
    assert found.coefficients[0] == pytest.approx(5.0, rel=0.3)
    assert found.gain > best.gain - 15.0  # along the nominal ship's speed, not the true one
    assert all(pair.gain >= singles[0].gain - 1e-6 for pair in pairs[:3])


def test_only_signals_that_are_known_there_are_heard() -> None:
    assert "thrust" not in screen().signals_at("inflow_velocity")
    assert "propeller_torque" in screen().signals_at("load_torque")
