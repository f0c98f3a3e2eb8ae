"""Coordinates of a search: whatever it tries, a ship's file allows."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import catalogue
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.trial_ship import EffectSearch, JointSearch, TrialShip
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import load_ship, ship_names
from shaftline.plant.columns import signal_columns
from shaftline.plant.load_cases import get_case

FAR = (-60.0, -3.0, 3.0, 60.0)
"""Coordinates far beyond any size: a search that walks on ends there."""


@functools.cache
def on_trial(name: str) -> TrialShip:
    """A packaged ship as it answers to a step of its drive."""
    ship = load_ship(name)
    samples = get_case("rack_step").run(ship, seed=0)
    table = pd.DataFrame({c: samples[s] for c, s in signal_columns(ship).items()})
    return TrialShip(Balances(JointReplay(ship, table.iloc[:200])))


@pytest.mark.parametrize("name", ship_names())
def test_every_value_that_a_search_can_reach_is_one_that_a_ship_file_allows(name: str) -> None:
    trial_ship = on_trial(name)
    effects = [effect for effect in catalogue() if effect.acts_on(trial_ship.ship)]
    assert len(effects) > 5
    for effect in effects:
        windows = [(10.0, 40.0)]
        for placed in trial_ship.smallest_trials(effect, windows):
            search = EffectSearch(trial_ship, placed)
            count = len(search.point())
            for point in itertools.product(*[FAR] * count):
                reached = trial_ship.corrected(
                    (search.effects_at(point),)
                )  # refuses what is not allowed
                for parameter in effect.parameters:
                    low, high = trial_ship.range_of(parameter)
                    assert low <= reached.parameter(parameter.key).value <= high, effect.label


def test_a_search_stays_off_an_excluded_bound() -> None:
    """The astern share of a motor's torque must be above 0: a share that falls never gets there."""
    trial_ship = on_trial("rov-thruster")
    effect = next(e for e in catalogue() if e.label == "direction-asymmetry (motor)")
    key = effect.parameters[0].key
    search = EffectSearch(trial_ship, SizedEffect(effect, (0.9,)))
    lowest = search.effects_at([60.0]).values[0]
    assert 0.0 < lowest < 0.01
    assert trial_ship.ship.with_values({key: lowest}).parameter(key).value == lowest


def test_a_joint_search_moves_what_it_is_told_to() -> None:
    trial_ship = on_trial("frigate")
    labels = ("hull-fouling (hull)", "coulomb-friction (engine)")
    first, second = (next(e for e in catalogue() if e.label == label) for label in labels)
    both = (SizedEffect(first, (0.1,)), SizedEffect(second, (5000.0,)))
    search = JointSearch(trial_ship, both, [1])
    moved = search.effects_at(search.start + np.log(2.0))
    assert moved[0] == both[0]
    assert moved[1].values[0] == pytest.approx(10000.0)
