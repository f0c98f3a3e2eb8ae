"""Diagnoses and identifications of a ship that turns."""

from __future__ import annotations

import pytest

from shaftline.mismatch import Diagnosis, diagnose, identify
from shaftline.plant.terms import Term

from .turning import quick_tanker, swinging


def hidden(place: str, expression: str) -> Term:
    return Term.model_validate({"id": "hidden", "acts_on": place, "expression": expression})


def named(found: Diagnosis, label: str, verdict: str = "explained") -> tuple[float, ...]:
    assert found.verdict == verdict
    assert [f.effect.label for f in found.findings] == [label]
    for column, before in found.fit_before.items():
        assert found.fit_after[column] > before
    return tuple(e.value for e in found.findings[0].estimates)


@pytest.mark.parametrize("seed", range(1, 5))
def test_nothing_is_invented_where_nothing_is_missing(seed: int) -> None:
    found = diagnose(quick_tanker(), swinging(quick_tanker(), seed=seed))
    assert (found.verdict, found.findings, found.formula) == ("nothing-missing", [], None)
    assert [name for name, _ in found.balances] == ["hull", "sway", "yaw"]
    assert dict(found.balances)["yaw"] == "N m"


def test_a_wrong_damping_of_the_turn_is_named_with_its_number() -> None:
    true = quick_tanker().with_values({"manoeuvring.N_r": -0.049 * 1.3})
    found = diagnose(quick_tanker(), swinging(true))
    (size,) = named(found, "yaw-damping (yaw)")
    assert size == pytest.approx(-0.0637, rel=0.04)
    low, high = found.findings[0].estimates[0].ci95
    assert low < -0.0637 < high
    (wrong,) = found.biased
    assert wrong is not None
    assert wrong.key == "manoeuvring.N_r"
    assert (
        "the yaw balance has too much moment in proportion to the rate of turn" in found.summary()
    )


def test_a_smaller_rudder_is_named_as_less_force() -> None:
    true = quick_tanker().with_values({"rudder.area_m2": 0.0539 * 0.8})
    found = diagnose(quick_tanker(), swinging(true))
    assert named(found, "rudder-force (yaw)") == pytest.approx((0.8 * 2.747,), rel=0.03)


def test_the_same_numbers_are_found_by_identify() -> None:
    true = quick_tanker().with_values({"manoeuvring.N_r": -0.0637, "rudder.area_m2": 0.0431})
    found = identify(
        quick_tanker(), swinging(true), free=("manoeuvring.N_r", "rudder.normal_force_slope")
    )
    assert found.parameters["manoeuvring.N_r"] == pytest.approx(-0.0637, rel=0.04)
    assert found.parameters["rudder.normal_force_slope"] == pytest.approx(
        2.747 * 0.0431 / 0.0539, rel=0.03
    )
    assert found.fit_after["yaw_rate_rad_s"] > 97.0 > found.fit_before["yaw_rate_rad_s"]


def test_a_concealed_force_across_is_named_in_its_balance() -> None:
    """Its form is no entry's: the damping of sway comes nearest, and is told in the sway balance."""
    true = quick_tanker().with_term(hidden("side_force", "-900 * sway_speed * abs(sway_speed)"))
    found = diagnose(quick_tanker(), swinging(true))
    assert {f.effect.balance for f in found.findings} == {"sway"}
    assert found.fit_after["sway_speed_m_s"] > found.fit_before["sway_speed_m_s"] + 10.0


def test_a_concealed_steady_moment_is_named_in_the_yaw_balance() -> None:
    true = quick_tanker().with_term(hidden("yaw_moment", "6"))
    found = diagnose(quick_tanker(), swinging(true))
    # the formula beside it, a moment that is constant, is the truth
    (share,) = named(found, "propeller-walk (yaw, ahead)", "partly-explained")
    assert found.formula is not None
    assert found.formula.term.expression == "a"
    assert share < 0.0  # a force to port at the stern turns to starboard


def test_what_no_entry_describes_gets_a_formula_in_the_yaw_balance() -> None:
    true = quick_tanker().with_term(hidden("yaw_moment", "40 * tanh(sway_speed / 0.02)"))
    found = diagnose(quick_tanker(), swinging(true))
    assert found.verdict == "unexplained"
    assert {b.name: b.verdict for b in found.balance_verdicts} == {
        "hull": "nothing-missing",
        "sway": "nothing-missing",
        "yaw": "unexplained",
    }
    assert found.shape is not None
    assert (found.shape.balance, found.shape.signal, found.shape.unit) == (
        "yaw",
        "sway_speed",
        "N m",
    )
    assert found.formula is not None
    assert found.formula.term.acts_on == "yaw_moment"
    assert "In the yaw balance the yaw moment changes as" in found.summary()
    assert set(found.formula.term.external_signals) == {"sway_speed"}
    assert found.fit_after["yaw_rate_rad_s"] > 90.0 > found.fit_before["yaw_rate_rad_s"]


def test_heading_alone_tells_the_turn() -> None:
    """Without a gyro of rate or a sway log: the rate is the heading's derivative."""
    true = quick_tanker().with_values({"manoeuvring.N_r": -0.049 * 1.5})
    table = swinging(true).drop(columns=["yaw_rate_rad_s", "sway_speed_m_s"])
    found = diagnose(quick_tanker(), table)
    assert [name for name, _ in found.balances] == ["hull", "yaw"]
    assert found.findings[0].effect.balance == "yaw"
