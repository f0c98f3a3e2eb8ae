"""A wrong number beside a named effect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from shaftline.mismatch import diagnose
from shaftline.mismatch.identification.parameters import find_biased_parameters
from shaftline.mismatch.report.wording import biased_parameter_sentence
from shaftline.plant import Ship

from ..toy import fitter
from ..voyages import frigate_voyage, quick_frigate

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"


def only(ship: Ship) -> Ship:
    """A ship of which nothing but the resistance may be wrong."""
    others = ("mass", "wake_fraction", "thrust_curve")
    return ship.with_values({f"tolerances.{key}": 0.0 for key in others})


def test_fouling_is_a_wrong_resistance_as_well() -> None:
    table = frigate_voyage(
        quick_frigate().with_values({"hull.fouling_fraction": 0.2}), seed=1, seconds=300.0
    )
    found = diagnose(only(quick_frigate()), table)
    assert [f.effect.id for f in found.findings] == ["hull-fouling"]
    (wrong,) = found.biased
    assert wrong is not None
    score = found.findings[0].score
    assert score - 6.0 < wrong.gain
    if wrong.key == RESISTANCE:  # mass and 1 - t do it together with the tolerances of the others
        assert wrong.value == pytest.approx(1.2 * 3306.2, rel=0.02)
    report = found.to_dict()["effects"][0]["wrong_number"]
    assert report == {
        "key": wrong.key,
        "file": wrong.file,
        "value": wrong.value,
        "gain": wrong.gain,
    }
    assert f"A biased {wrong.key} would explain the difference as well" in found.summary()
    assert biased_parameter_sentence(wrong) in found.summary()


def test_a_lag_is_no_wrong_number() -> None:
    true = quick_frigate().with_values({"prime_mover.lag_s": 1.5})
    found = diagnose(quick_frigate(), frigate_voyage(true, seed=2, seconds=300.0))
    assert [f.effect.id for f in found.findings] == ["engine-torque-lag"]
    assert found.biased == [None]
    assert found.to_dict()["effects"][0]["wrong_number"] is None
    assert "would explain the difference as well" not in found.summary()


def test_a_number_that_the_file_knows_is_not_blamed() -> None:
    table = frigate_voyage(
        quick_frigate().with_values({"hull.fouling_fraction": 0.2}), seed=1, seconds=300.0
    )
    known = {RESISTANCE: 5.0, "hull.thrust_deduction": 1e-3, "hull.mass_kg": 1e4}
    sure = quick_frigate().with_values({"tolerances.numbers": known})
    found = diagnose(sure, table)
    assert [f.effect.id for f in found.findings] == ["hull-fouling"]
    assert all(wrong is None or wrong.key not in known for wrong in found.biased)


@pytest.mark.parametrize(("lost", "named"), [(5.0, True), (7.0, False)])
def test_a_number_must_come_as_near_as_another_name(lost: float, named: bool) -> None:
    """The resistance is wrong; an effect that did a little better than it does would be told with it."""
    toy: Any = fitter({RESISTANCE: 1.02 * 3306.2})
    base = toy.evaluate_record(_record(toy, 1.0))
    right = toy.evaluate_record(_record(toy, 1.02))
    assert right.score > base.score + 20.0
    effect = SimpleNamespace(effects=(None,), score=right.score + lost)
    fit: Any = SimpleNamespace(fit=effect, gains=(right.score + lost - base.score,))
    (wrong,) = find_biased_parameters(toy, fit)
    assert (wrong is not None) == named
    if wrong is not None:
        assert wrong.key == RESISTANCE
        assert wrong.value == pytest.approx(1.02 * 3306.2, rel=0.005)
        assert wrong.gain == pytest.approx(right.score - base.score, abs=1.0)


def _record(toy: Any, factor: float) -> Any:
    plant = toy.trial_ship.record(())
    plant["resistance_coefficient"] *= factor
    return plant
