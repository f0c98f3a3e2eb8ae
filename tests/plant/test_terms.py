"""Terms: what an expression means, where it acts, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    linearise,
    load_ship,
    simulate,
    write_ship,
)
from shaftline.plant.dynamics import evaluate, settle_lags
from shaftline.plant.expressions import (
    MAX_SIGNALS,
    MAX_STATES,
    NO_SIGNALS,
    InputTermSums,
    LoadTermSums,
    TermError,
    sum_input_terms,
    sum_load_terms,
)
from shaftline.plant.linear import tangent
from shaftline.plant.state import Inputs, State
from shaftline.plant.terms import Term, add_term

from .terms import HEARD, LOADED, NO_STATES, with_term


def sailed(ship: Ship) -> Any:
    schedule = Schedule(
        lambda t: np.where(t < 20, 20.0, 26.0), lambda t: np.where(t < 35, 1.2, 1.0)
    )
    return simulate(ship, schedule, 60.0, initial=equilibrium(ship, 20.0, 1.2).state)


@pytest.mark.parametrize(
    ("acts_on", "expression", "same"),
    [
        (
            "load_torque",
            "60 * shaft_speed * abs(shaft_speed)",
            {"transmission.quadratic_drag_N_m_s2_rad2": 60.0},
        ),
        (
            "drive_torque",
            "-500 * shaft_speed",
            {"transmission.viscous_friction_engine_side_N_m_s_rad": 500.0},
        ),
        ("resistance", "0.2 * c1 * ship_speed ** 2", {"hull.fouling_fraction": 0.2}),
        ("inflow_velocity", "-0.05 * ship_speed", {"hull.wake_fraction": 0.05}),
        ("pitch_rate", "0.03 / tau", {"pitch_actuator.offset": 0.03}),
    ],
)
def test_a_term_is_the_effect_that_it_spells(
    frigate: Ship, acts_on: str, expression: str, same: dict[str, float]
) -> None:
    """The plant's own effects, once more as terms at the same place."""
    base = (
        frigate.with_values({"hull.wake_fraction": 0.0})
        if "hull.wake_fraction" in same
        else frigate
    )
    numbers = {
        "c1": frigate.hull.resistance_coefficient_N_s2_m2,
        "tau": frigate.pitch_actuator.time_constant_s,
    }
    used = {name: number for name, number in numbers.items() if name in expression}
    found, expected = (
        sailed(with_term(base, expression, acts_on, **used)),
        sailed(base.with_values(same)),
    )
    for name in ("shaft_speed", "ship_speed", "shaft_torque", "pitch_ratio"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
    assert np.abs(found["shaft_speed"] - sailed(base)["shaft_speed"]).max() > 0.01


def test_thrust_and_demand_are_added_to(frigate: Ship) -> None:
    weaker = sailed(with_term(frigate, "-1e4", "thrust"))
    assert weaker["thrust"][0] < sailed(frigate)["thrust"][0]
    more = with_term(frigate, "2.0", "drive")
    point, expected = equilibrium(more, 20.0, 1.2), equilibrium(frigate, 22.0, 1.2)
    assert point.state.shaft_speed == pytest.approx(expected.state.shaft_speed, rel=1e-9)


def test_terms_add_up_and_only_at_their_place(frigate: Ship) -> None:
    both = [
        {"id": name, "acts_on": place, "expression": "100.0"}
        for name, place in (("a", "load_torque"), ("b", "load_torque"), ("c", "resistance"))
    ]
    record = frigate.with_values({"term": both}).record()
    found = sum_load_terms(record, HEARD, LOADED, NO_STATES, NO_SIGNALS)._asdict()
    expected = dict.fromkeys(LoadTermSums._fields, 0.0)
    assert found == expected | {"load_torque": 200.0, "resistance": 100.0}
    assert sum_input_terms(record, HEARD, NO_STATES, NO_SIGNALS) == InputTermSums(0.0, 0.0)


def test_a_linear_model_knows_the_terms(frigate: Ship) -> None:
    drag = frigate.with_values({"transmission.quadratic_drag_N_m_s2_rad2": 60.0})
    term = with_term(frigate, "60 * shaft_speed * abs(shaft_speed)")
    models = [linearise(ship, equilibrium(ship, 22.0, 1.2)) for ship in (drag, term)]
    np.testing.assert_allclose(models[0].A, models[1].A, rtol=1e-12)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        ({"id": "a", "acts_on": "wind", "expression": "1"}, "acts_on"),
        ({"id": "A b", "acts_on": "thrust", "expression": "1"}, "id"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "parameters": {"drive": 1.0}},
         "choose another"),
        ({"id": "a", "acts_on": "thrust", "expression": "k",
          "parameters": {"k": {"value": 3.0, "high": 2.0}}}, "outside"),
        ({"id": "a", "acts_on": "thrust", "expression": "k"},
         r"'k' is unknown; known: shaft_speed.*under \[signals\]"),
        ({"id": "a", "acts_on": "drive", "expression": "thrust"},
         "thrust is not known yet where drive is computed"),
        ({"id": "a", "acts_on": "inflow_velocity", "expression": "pitch_rate"}, "not known yet"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "also": {"thrust": "2"}}, "combine both"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "also": {"wind": "2"}}, "also"),
        ({"id": "a", "acts_on": "thrust", "expression": "z", "state": "z"}, "must be given together"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "rate": "1"}, "must be given together"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "state": "drive", "rate": "1"},
         "choose another"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "state": "z", "rate": "1 +"},
         "not a valid expression"),
    ],
)  # fmt: skip
def test_a_bad_term_is_named(frigate: Ship, term: dict[str, Any], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        frigate.with_values({"term": [term]})


def test_a_term_stands_once(frigate: Ship) -> None:
    term = {"id": "a", "acts_on": "thrust", "expression": "1"}
    with pytest.raises(ShipError, match="is defined twice"):
        frigate.with_values({"term": [term, term]})


def test_a_file_with_terms_reads_back(frigate: Ship, tmp_path: Path) -> None:
    ship = with_term(frigate, "k * shaft_speed", k=3.0)
    again = load_ship(write_ship(ship, tmp_path / "mine.toml"))
    assert again == ship
    assert again.record().tobytes() == ship.record().tobytes()


def test_a_terms_parameter_is_a_number_of_the_ship(frigate: Ship) -> None:
    given = {"a": 2.0, "k": {"value": 3.0, "unit": "N m s/rad", "low": 0.0, "high": 9.0}}
    first = {"id": "first", "acts_on": "thrust", "expression": "5"}
    term = {"id": "more-drag", "acts_on": "load_torque", "expression": "a * k", "parameters": given}
    ship = frigate.with_values({"term": [first, term]})
    number = ship.parameter("term.more-drag.k")
    assert (number.value, number.info.unit, number.info.low, number.info.high) == (
        3.0,
        "N m s/rad",
        0.0,
        9.0,
    )
    changed = ship.with_values({"term.more-drag.k": 4.0})
    assert changed.term[1].parameters["k"].unit == "N m s/rad"
    record = ship.record()
    number.write(record, 4.0)
    assert record.tobytes() == changed.record().tobytes()
    assert number.read(record) == 4.0
    assert frigate.with_term(ship.term[0]).with_term(ship.term[1]) == ship
    for key in ("term.more-drag.b", "term.other.k", "term.more-drag", "term"):
        assert not ship.has_key(key)
    with pytest.raises(ShipError, match="outside its range from low = 0 to high = 9"):
        ship.with_values({"term.more-drag.k": 10.0})
    with pytest.raises(ShipError, match=r"term.other.k is not a known key"):
        ship.with_values({"term.other.k": 1.0})


def lagging(frigate: Ship, **more: Any) -> Ship:
    """The frigate with its inflow lag of 3 s, spelled as a term with a state."""
    term = {
        "id": "lag",
        "acts_on": "inflow_velocity",
        "expression": "z - advance_velocity",
        "state": "z",
        "rate": "(advance_velocity - z) / tau",
        "parameters": {"tau": 3.0},
    }
    return frigate.with_values({"term": [term | more]})


def test_a_state_of_ones_own_is_a_state_of_the_ship(frigate: Ship) -> None:
    own, built_in = lagging(frigate), frigate.with_values({"propeller.inflow_lag_s": 3.0})
    found, expected = sailed(own), sailed(built_in)
    for name in ("shaft_speed", "ship_speed", "shaft_torque"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
    assert np.abs(found["shaft_torque"] - sailed(frigate)["shaft_torque"]).max() > 100.0
    models = [linearise(ship, equilibrium(ship, 22.0, 1.2)) for ship in (own, built_in)]
    assert models[0].state_labels[-1] == "term_1"
    np.testing.assert_allclose(models[0].A, models[1].A, rtol=1e-9)


def test_a_state_begins_where_its_rate_vanishes(frigate: Ship) -> None:
    """Whether its rate is linear in it, as a lag's, or not, as that of water that is set in motion."""
    term = {
        "id": "flow",
        "acts_on": "load_torque",
        "expression": "-c * u",
        "state": "u",
        "rate": "(g * shaft_speed * abs(shaft_speed) - u * abs(u)) / m",
        "parameters": {"c": 500.0, "g": 0.04, "m": 5.0},
    }
    ship = frigate.with_values({"term": [term]})
    for omega in (11.0, -7.0):
        state = settle_lags(ship.record(), State(1.2, omega, 6.0), Inputs(22.0, 1.2))
        assert state.term_1 == pytest.approx(0.2 * omega, rel=1e-9)
    point = equilibrium(ship, 22.0, 1.2)
    rate, _ = evaluate(ship.record(), point.state, point.inputs, 1.2)
    assert abs(rate.term_1) < 1e-9
    assert point.state.term_1 == pytest.approx(0.2 * point.state.shaft_speed)
    assert point.state.shaft_speed > equilibrium(frigate, 22.0, 1.2).state.shaft_speed


def test_a_state_without_a_place_of_rest_begins_at_0(frigate: Ship) -> None:
    summed = {"id": "sum", "acts_on": "thrust", "expression": "0 * z", "state": "z", "rate": "1"}
    ship = frigate.with_values({"term": [summed]})
    assert settle_lags(ship.record(), State(1.2, 11.0, 6.0), Inputs(22.0, 1.2)).term_1 == 0.0


def test_each_term_has_a_state_of_its_own(frigate: Ship) -> None:
    terms = [
        {
            "id": f"lag-{k}",
            "acts_on": "thrust",
            "expression": "1000 * z",
            "state": "z",
            "rate": f"{k} * drive - z",
        }
        for k in (1, 2, 3)
    ]
    record = frigate.with_values({"term": terms}).record()
    state = settle_lags(record, State(1.2, 11.0, 6.0), Inputs(22.0, 1.2))
    assert state[-3:] == pytest.approx((22.0, 44.0, 66.0))
    more = {"id": "more", "acts_on": "thrust", "expression": "z", "state": "z", "rate": "-z"}
    with pytest.raises(TermError, match=f"at most {MAX_STATES} states"):
        add_term(record, Term.model_validate(more))


def test_one_piece_of_physics_may_act_at_several_places(frigate: Ship) -> None:
    """Blades that are a tenth worse: torque up, thrust down, by one number."""
    term = {
        "id": "worn",
        "acts_on": "load_torque",
        "expression": "k * propeller_torque",
        "also": {"thrust": "-0.5 * k * thrust"},
        "parameters": {"k": 0.1},
    }
    ship = frigate.with_values({"term": [term]})
    state, inputs = State(1.2, 11.0, 6.0), Inputs(22.0, 1.2)
    _, worn = evaluate(ship.record(), state, inputs, 1.2)
    _, new = evaluate(frigate.record(), state, inputs, 1.2)
    assert worn.thrust == pytest.approx(0.95 * new.thrust, rel=1e-12)
    own = new.shaft_torque - worn.shaft_torque
    inertia = frigate.transmission
    share = inertia.inertia_engine_side_kg_m2 / (
        inertia.inertia_engine_side_kg_m2 + inertia.inertia_propeller_side_kg_m2
    )
    assert -own == pytest.approx(share * 0.1 * new.propeller_torque, rel=1e-9)
    assert ship.parameter("term.worn.k").value == 0.1


def windy(frigate: Ship) -> Ship:
    term = {
        "id": "wind",
        "acts_on": "resistance",
        "expression": "k * head_wind * abs(head_wind)",
        "parameters": {"k": 40.0},
    }
    return frigate.with_values({"signals": {"head_wind": "m/s", "rudder": "rad"}, "term": [term]})


def test_a_signal_from_outside_is_heard(frigate: Ship) -> None:
    ship = windy(frigate)
    point = equilibrium(ship, 20.0, 1.2, signals={"head_wind": 15.0})
    extra = 40.0 * 15.0**2
    calm = equilibrium(frigate, 20.0, 1.2)
    assert point.outputs.resistance < calm.outputs.resistance + extra
    schedule = Schedule(20.0, 1.2, signals={"head_wind": lambda t: 15.0 * (t < 30.0)})
    found = simulate(ship, schedule, 300.0, initial=point.state)
    assert found["ship_speed"][250] == pytest.approx(point.state.ship_speed, abs=1e-6)
    assert found["ship_speed"][-1] > point.state.ship_speed + 0.1
    model = linearise(ship, point)
    still = linearise(frigate, equilibrium(frigate, 20.0, 1.2))
    assert model.A.shape == still.A.shape


def test_a_signal_that_is_not_there_is_refused_by_name(frigate: Ship) -> None:
    ship = windy(frigate)
    with pytest.raises(
        ShipError, match=r"term 'wind' uses the signal head_wind \[m/s\].*not given"
    ):
        equilibrium(ship, 20.0, 1.2)
    with pytest.raises(ShipError, match="head_wind"):
        simulate(ship, Schedule(20.0, 1.2), 10.0, initial=State(1.2, 10.0, 8.0))
    unused = frigate.with_signals({"rudder": "rad"})
    assert equilibrium(unused, 20.0, 1.2) == equilibrium(frigate, 20.0, 1.2)


def test_the_order_in_which_signals_are_named_does_not_matter(frigate: Ship) -> None:
    tree = windy(frigate).model_dump(exclude_unset=True)
    turned = tree | {"signals": {"rudder": "rad", "head_wind": "m/s"}}
    other = Ship.model_validate(turned)
    assert other.record().tobytes() == windy(frigate).record().tobytes()
    given = {"head_wind": 3.0, "rudder": 0.1}
    assert (
        other.external_values(given)
        == windy(frigate).external_values(given)
        == (3.0, 0.1, 0.0, 0.0, 0.0, 0.0)
    )


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ({"drive": "mm"}, "signals.drive: this name is already a signal"),
        ({"Wind": "m/s"}, "signals"),
        ({f"s{k}": "-" for k in range(MAX_SIGNALS + 1)}, "at most 6"),
    ],
)
def test_a_bad_signal_is_named(frigate: Ship, signals: dict[str, str], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        frigate.with_signals(signals)


def test_a_term_with_a_state_and_a_signal_reads_back(frigate: Ship, tmp_path: Path) -> None:
    ship = windy(lagging(frigate)).with_term(
        Term(
            id="swing",
            acts_on="thrust",
            expression="z",
            state="z",
            rate="head_wind - z",
            also={"load_torque": "table(z, 0, 0, 5, 1e3)"},
        )
    )
    again = load_ship(write_ship(ship, tmp_path / "mine.toml"))
    assert again == ship
    assert hash(again) == hash(ship)
    assert again.record().tobytes() == ship.record().tobytes()


def test_a_tangent_passes_through_states_and_signals(frigate: Ship) -> None:
    """By complex steps and by differences alike."""
    term = Term(
        id="swing",
        acts_on="inflow_velocity",
        expression="z * head_wind",
        state="z",
        rate="tanh(shaft_speed / 9) * head_wind - z ** 2",
    )
    ship = windy(frigate).with_term(term)
    state = State(1.2, 11.0, 6.0)._replace(term_1=0.4)
    inputs = Inputs(22.0, 1.2, outside=ship.external_values({"head_wind": 2.0}))
    names = ("shaft_speed", "term_1")
    found = tangent(ship.record(), state, inputs, 1.2, names, ("thrust",))
    for j, name in enumerate(names):
        h = 1e-6
        up, down = (
            evaluate(ship.record(), state._replace(**{name: getattr(state, name) + s}), inputs, 1.2)
            for s in (h, -h)
        )
        for i, other in enumerate(names):
            slope = (getattr(up[0], other) - getattr(down[0], other)) / (2.0 * h)
            assert found.a[i, j] == pytest.approx(slope, rel=1e-5, abs=1e-7)
