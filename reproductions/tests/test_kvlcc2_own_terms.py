"""KVLCC2: terms of one's own in the measured flow, their files, and how a form is chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions.kvlcc2.oblique import (
    FITTED,
    FORMS,
    SIGNALS,
    WEIGHTS,
    Tried,
    choose_form,
    errors_in_flow,
    file_of,
    fit_least_squares,
    fixed_hull,
    propeller_table,
    with_form,
    write_start,
)
from reproductions.kvlcc2.runs import SPEED, SWAY, THRUST, TORQUE, YAW, Errors, loads_at
from shaftline.mismatch.search.catalogue import read_entries
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

from .tanker import OMEGA, tanker


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Ship:
    return tanker(tmp_path_factory.mktemp("kvlcc2"))


def a_run(ship: Ship, seconds: float = 60.0) -> pd.DataFrame:
    """A run that slows down and drifts to both sides, loaded as a ship without drift is."""
    time = np.arange(0.0, seconds, 0.05)
    speed = 1.1 - 0.2 * np.sin(0.1 * time) ** 2
    thrust, torque = loads_at(ship, speed, np.full(len(time), OMEGA))
    return pd.DataFrame(
        {
            "time_s": time,
            "shaft_speed_rad_s": OMEGA,
            TORQUE: torque,
            THRUST: thrust,
            SPEED: speed,
            SWAY: 0.2 * np.sin(0.3 * time),
            YAW: 0.03 * np.cos(0.3 * time),
            "rudder_rad": 0.1,
        }
    )


def test_the_held_ship_is_judged_in_the_measured_flow(own: Ship) -> None:
    error = errors_in_flow(fixed_hull(own), a_run(own))
    assert error.thrust < 1e-6
    assert error.torque < 1e-8


def test_rows_are_averaged_and_a_rest_is_left_out(own: Ship) -> None:
    run = a_run(own).iloc[:403]
    table = propeller_table(run, 4)
    assert len(table) == 100
    assert table["time_s"].diff().iloc[1] == pytest.approx(0.2)
    assert table["inflow_velocity_m_s"].iloc[0] == pytest.approx(0.6 * run[SPEED][:4].mean())


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_an_entry_that_hears_what_is_declared(own: Ship, form: str) -> None:
    (effect,) = read_entries(file_of(form))
    assert effect.term is not None
    assert set(effect.term.external_signals) <= set(SIGNALS)
    assert effect.balance == "propeller"
    ship, keys = with_form(fixed_hull(own), form)
    assert len(keys) == 1 + len(effect.parameters)
    assert errors_in_flow(ship, a_run(own)).thrust > 0.01  # the first values change something


def test_least_squares_find_a_wake_that_is_there(own: Ship, tmp_path: Path) -> None:
    start, keys = with_form(fixed_hull(own), "quadratic")
    term = start.term[0].id
    truth = {"a": -0.4, "b": 0.8, "a0": -0.06, "s": 0.2}
    true = start.with_values({f"term.{term}.{name}": value for name, value in truth.items()})
    run = a_run(own)
    assert errors_in_flow(true, run).thrust > 0.5
    simulated = simulate_recording(true, propeller_table(run))
    run[THRUST], run[TORQUE] = simulated[THRUST], simulated[TORQUE]
    found = fit_least_squares(start, keys, [run], WEIGHTS)
    for name, value in truth.items():
        assert found.parameter(f"term.{term}.{name}").value == pytest.approx(value, abs=0.01)
    assert errors_in_flow(found, run).thrust < 0.05

    # a user's file that begins there
    (effect,) = read_entries(write_start("quadratic", found, tmp_path))
    probes = {p.name: p.probes for p in effect.parameters}
    assert probes["b"] == (found.parameter(f"term.{term}.b").value,)


def test_the_simplest_of_the_near_best_forms_is_chosen() -> None:
    def form(name: str, numbers: int, thrust: float) -> Tried:
        return Tried(name, numbers, {run: Errors(thrust, 0.03) for run in FITTED})

    one, two, three = form("one", 4, 1.2), form("two", 8, 1.01), form("three", 10, 1.0)
    assert choose_form([one, two, three]) is two
    assert choose_form([one, form("two", 8, 1.03), three]) is three
    assert three.thrust == pytest.approx(1.0)
