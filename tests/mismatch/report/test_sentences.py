"""The answer in one sentence."""

from __future__ import annotations

from dataclasses import replace

from shaftline.mismatch import Estimate
from shaftline.mismatch.report.sentences import between, finding_sentence, sentence

from ..diagnoses import diagnosis_of, entry


def test_windows_in_words() -> None:
    assert between([]) == ""
    assert between([(10.4, 50.0)]) == "between 10 and 50 s"
    four = [(0.0, 1.0), (2.0, 3.0), (4.0, 5.0), (6.0, 7.0)]
    assert between(four[:3]) == "between 0 and 1 s, between 2 and 3 s, between 4 and 5 s"
    assert between(four).endswith("between 4 and 5 s, and in 1 more windows")


def test_a_finding_says_where_what_and_how_much() -> None:
    diagnosis = diagnosis_of("explained")
    assert finding_sentence(diagnosis.findings[0]) == (
        "Between 60 and 120 s, shaft_speed above 11 rad/s, the engine balance lacks torque that does "
        "not depend on speed: Coulomb friction on the engine side of the gauge, "
        "8.00 kN m (95 %: 6.95 kN m to 9.05 kN m)."
    )
    everywhere = replace(diagnosis.findings[0], regime="", windows=[])
    assert finding_sentence(everywhere).startswith(" the engine balance lacks torque")


def test_several_parameters_are_told_by_name_and_instruments_as_such() -> None:
    ship = diagnosis_of("explained").ship
    bend = entry("engine-torque-curvature (engine)")
    numbers = tuple(
        Estimate.of(ship, p.key, v, 0.1, neutral=0.0)
        for p, v in zip(bend.parameters, (-1.5, 70.0), strict=True)
    )
    told = finding_sentence(
        replace(diagnosis_of("explained").findings[0], effect=bend, estimates=numbers)
    )
    assert "torque curvature −1.50 N m s²/rad²" in told
    assert "torque curvature speed 70.0 rad/s" in told
    gauge = replace(
        diagnosis_of("explained").findings[0], effect=entry("torque-sensor-gain (sensor)")
    )
    assert "the instrument lacks" in finding_sentence(gauge)


def test_each_verdict_has_its_sentence() -> None:
    found = diagnosis_of("explained")
    two = replace(found, findings=found.findings * 2)
    assert sentence(two) == " ".join([finding_sentence(found.findings[0])] * 2)
    assert sentence(diagnosis_of("nothing-missing")).startswith(
        "Nothing is missing: the simulation"
    )
    limits = ["dull: a", "too short: b"]
    assert sentence(diagnosis_of("nothing-missing", limits=limits)).endswith(
        "allow. Mind that the recording is limited: dull: a; too short: b."
    )
    nothing_told = diagnosis_of("unexplained", limits=limits, undecidable=True, shape=None)
    assert sentence(nothing_told) == "Cannot be decided, because dull: a; too short: b."
    assert sentence(diagnosis_of("unexplained")) == (
        "Something is missing that has no name: the engine balance lacks −12.0 kN m to 500 N m, "
        "depending on shaft speed."
    )
    assert sentence(diagnosis_of("unexplained", limits=limits, excited=False)) == (
        "Something differs; which effect it is cannot be decided, because dull: a; too short: b."
    )
    for changes in ({"limits": limits}, {"excited": False}):
        assert "no name" in sentence(diagnosis_of("unexplained", **changes))
    assert sentence(diagnosis_of("unexplained", shape=None)) == (
        "Something is missing that the catalogue does not name."
    )
