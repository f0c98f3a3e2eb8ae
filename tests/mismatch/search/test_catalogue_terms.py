"""Entries of the catalogue that are terms, and those that ask for a ship or a signal of their own."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import catalogue, diagnose
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.trial_ship import TrialShip
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

from ..structure.test_search import BY_SWITCHING
from ..voyages import bench_tug, frigate_voyage, quick_frigate, tug_run
from . import test_catalogue, test_catalogue_rigs, test_catalogue_turning, test_inflow_torque
from .test_catalogue import _named, one_round  # noqa: F401 (a fixture)


def test_weaker_thrust_astern_is_named_where_the_shaft_turns_both_ways() -> None:
    """A model at held revolutions, of which only the speed is measured."""
    tree = load_ship("kvlcc2").model_dump(exclude_unset=True)
    ship = Ship.model_validate(
        {k: v for k, v in tree.items() if k not in ("manoeuvring", "rudder")}
    )
    true = ship.with_values({"propeller.astern_load_fraction": 0.7})
    time = np.arange(0.0, 900.0, 0.2)
    turns = 60.0 * np.sign(np.sin(time / 40.0)) * (0.7 + 0.3 * np.sin(time / 170.0))
    given = pd.DataFrame({"time_s": time, "shaft_speed_rad_s": turns, "ship_speed_m_s": 0.0})
    table = simulate_recording(true, given)
    table["shaft_speed_rad_s"] = turns
    table["ship_speed_m_s"] += 0.003 * np.random.default_rng(1).standard_normal(len(time))
    found = diagnose(ship, table[["time_s", "shaft_speed_rad_s", "ship_speed_m_s"]])
    _named(found, "astern-thrust", "propeller")
    assert found.findings[0].estimates[0].value == pytest.approx(0.7, rel=0.05)


FORMS: list[tuple[str, tuple[float, ...]]] = [
    ("engine-torque-curvature (engine, knee-in-speed)", (-9000.0, 9.5)),
    ("engine-torque-curvature (engine, knee-in-rack)", (-8000.0, 19.0)),
    ("propeller-roughness (propeller, scaled)", (0.06, 0.7)),
    ("inflow-lag (propeller, of-j)", (5.0,)),
    ("pitch-dead-band (pitch-actuator, stops-at-the-edge)", (0.03,)),
    ("pitch-dead-band (pitch-actuator, stops-inside)", (0.05, 0.3)),
    ("wake-speed-dependence (propeller, and-level)", (0.02, 0.08)),
    ("wake-in-drift (propeller)", (2.0, 0.3)),
    ("wind (hull)", (900.0,)),
    ("turning-resistance (hull)", (4e6,)),
    ("rudder-resistance (hull)", (2e6,)),
    ("coulomb-friction (motor, stribeck)", (0.03, 1.5, 20.0)),
    ("command-dead-zone (motor, by-direction)", (0.6, 0.5)),
    ("direction-asymmetry (motor, demand)", (-0.12,)),
    ("direction-asymmetry (motor, load-torque)", (-0.15,)),
    ("inflow-lag (motor, induced-flow)", (1.5, 30.0)),
]


def of_form(label: str, values: tuple[float, ...]) -> tuple[Ship, pd.DataFrame]:
    """A ship, and its recording with an effect of some form and size in it."""
    effect = next(e for e in catalogue() if e.label == label)
    outside = {
        "drift_angle": lambda t: 0.25 * np.sin(t / 31.0) + 0.05,
        "head_wind": lambda t: 8.0 + 7.0 * np.sin(t / 47.0),
        "sway_speed": lambda t: -0.8 * np.sin(t / 31.0),
        "yaw_rate": lambda t: 0.015 * np.sin(t / 31.0 + 0.3),
        "rudder_angle": lambda t: 0.3 * np.sin(t / 23.0),
    }
    heard = {name: outside[name] for name in (effect.term.external_signals if effect.term else ())}
    frigate = effect.balance != "motor"
    ship = quick_frigate() if frigate else bench_tug()
    nominal = ship.with_signals(dict.fromkeys(heard, "-"))
    plain = frigate_voyage(nominal, seed=3, seconds=300.0, extra=heard) if frigate else tug_run()
    trial_ship = TrialShip(Balances(JointReplay(nominal, plain)))
    true = trial_ship.corrected((SizedEffect(effect, values),))
    if not frigate:
        return ship, tug_run(true, seed=1)
    return ship, frigate_voyage(true, seed=3, seconds=300.0, extra=heard)


@pytest.mark.parametrize(("label", "values"), FORMS, ids=[label for label, _ in FORMS])
def test_another_form_of_known_physics_is_named_as_what_it_is(
    label: str, values: tuple[float, ...]
) -> None:
    ship, table = of_form(label, values)
    found = diagnose(ship, table)
    effect, balance = label.split(" (")[0], label.split("(")[1].split(",")[0].rstrip(")")
    _named(found, effect, balance)
    assert found.explained > 0.9


def test_signals_that_no_effect_hears_do_not_change_what_the_corrected_ship_is_judged_by() -> None:
    """A record hears its signals by their place: those left out of the corrected ship's file count."""
    label = "turning-resistance (hull)"
    ship, table = of_form(label, (4e6,))
    table["drift_angle"] = 0.1 * np.sin(table["time_s"] / 17.0)
    found = diagnose(ship, table)
    _named(found, "turning-resistance", "hull")
    assert set(found.corrected.signals) == {"sway_speed", "yaw_rate"}
    again = simulate_recording(found.corrected, table)["ship_speed_m_s"].to_numpy()
    np.testing.assert_allclose(found.after["ship_speed_m_s"], again, atol=0.05)  # another start
    assert found.fit_after["ship_speed_m_s"] > 80.0 > found.fit_before["ship_speed_m_s"]


def test_every_entry_is_concealed_by_a_test_here() -> None:
    rigs = {
        label
        for group in ("ON_THE_BENCH", "ON_THE_THRUSTER", "ON_A_HELD_SHAFT")
        for label, _ in getattr(test_catalogue_rigs, group)
    }
    turning = {label for label, _ in test_catalogue_turning.TURNING} | rigs
    turning |= {test_inflow_torque.LABEL}
    turning |= {
        e.label for e in catalogue() if e.together
    }  # tests/mismatch/structure/test_together.py
    terms = {e.label for e in catalogue() if e.term is not None}
    assert {label for label, _ in FORMS} == terms - turning
    concealed = {(e, b) for e, b, _ in test_catalogue.ON_THE_FRIGATE} | {
        (e, "motor") for e, _ in test_catalogue.ON_THE_TUG
    }
    concealed |= {("ventilation", "propeller"), ("inflow-lag", "propeller")}
    concealed |= {("astern-thrust", "propeller"), ("speed-sensor-lag", "sensor")}
    concealed |= {(label, "motor") for label in BY_SWITCHING}
    found = {e.kind for e in catalogue() if e.term is None and e.label not in turning}
    assert found == concealed
