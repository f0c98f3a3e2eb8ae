"""The headline, and the answer in sentences."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shaftline.mismatch import Effect, Estimate, catalogue
from shaftline.mismatch.report.text import (
    MOST_WORDS,
    NEUTRAL,
    _between,
    finding_sentence,
    headline,
    sentence,
)
from shaftline.mismatch.report.wording import effect_words

from ..diagnoses import diagnosis_of, entry


def test_windows_in_words() -> None:
    assert _between([]) == ""
    assert _between([(10.4, 50.0)]) == "between 10 and 50 s"
    four = [(0.0, 1.0), (2.0, 3.0), (4.0, 5.0), (6.0, 7.0)]
    assert _between(four[:3]) == "between 0 and 1 s, between 2 and 3 s, between 4 and 5 s"
    assert _between(four).endswith("between 4 and 5 s, and in 1 more windows")


def test_a_finding_says_where_what_and_how_much() -> None:
    diagnosis = diagnosis_of("explained")
    assert finding_sentence(diagnosis.findings[0]) == (
        "Between 60 and 120 s, with shaft speed above 11 rad/s, the engine balance lacks "
        f"{diagnosis.findings[0].effect.lacks}, with coulomb friction engine side 8.00 kN m "
        "(95 % interval: 6.95 kN m to 9.05 kN m)."
    )
    everywhere = replace(diagnosis.findings[0], regime="", windows=[])
    assert finding_sentence(everywhere).startswith(" the engine balance lacks torque")


def test_an_interval_of_all_allowed_values_is_no_interval() -> None:
    finding = diagnosis_of("explained").findings[0]
    wide = replace(finding.estimates[0], standard_error=1e9, bounds=(0.0, 5e4))
    told = finding_sentence(replace(finding, estimates=(wide,)))
    assert "coulomb friction engine side not determined (0 N m to 50.0 kN m is possible)." in told
    close = replace(wide, standard_error=1e4)
    assert "not determined" not in finding_sentence(replace(finding, estimates=(close,)))


def test_parameters_have_names_and_instruments_are_called_instruments() -> None:
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
        "No physics is missing: the simulation"
    )
    limits = ["insufficient excitation: a", "too short: b"]
    assert sentence(diagnosis_of("nothing-missing", limits=limits)).endswith(
        "allow. Warning: the recording is limited: insufficient excitation: a; too short: b."
    )
    nothing_told = diagnosis_of("unexplained", limits=limits, undecidable=True, shape=None)
    assert (
        sentence(nothing_told)
        == "Whether physics is missing cannot be decided, because insufficient excitation: a; "
        "too short: b."
    )
    assert sentence(diagnosis_of("unexplained")) == (
        "No effect of the catalogue fits: the engine balance lacks −12.0 kN m to 500 N m, "
        "depending on shaft speed."
    )
    assert sentence(diagnosis_of("unexplained", limits=limits, excited=False)) == (
        "Simulation and recording differ; which effect is the cause cannot be decided, because "
        "insufficient excitation: a; too short: b."
    )
    for changes in ({"limits": limits}, {"excited": False}):
        assert "No effect of the catalogue" in sentence(diagnosis_of("unexplained", **changes))
    assert sentence(diagnosis_of("unexplained", shape=None)) == (
        "Simulation and recording differ, and no effect of the catalogue fits."
    )


SIGNED = [effect for effect in catalogue() if effect.parameters[0].signed]


def told_at(effect: Effect, value: float, neutral: float) -> str:
    """The sentence on an effect whose first value is known to a tenth of a unit."""
    first, *others = (Estimate(p.key, 1.0, "-", (-10.0, 10.0), 0.0, 0.1) for p in effect.parameters)
    first = replace(first, value=value, neutral=neutral)
    finding = diagnosis_of("explained").findings[0]
    return finding_sentence(replace(finding, effect=effect, estimates=(first, *others)))


@pytest.mark.parametrize("neutral", [0.0, 1.0, -2.0])
@pytest.mark.parametrize("effect", catalogue(), ids=lambda effect: effect.label)
def test_a_sentence_lacks_what_is_missing_and_has_what_is_too_much(
    effect: Effect, neutral: float
) -> None:
    more, less = (told_at(effect, neutral + change, neutral) for change in (0.5, -0.5))
    assert f" lacks {effect.lacks}, with " in more
    assert " lacks " not in less
    assert " has " in less
    alone = (
        effect.lacks if neutral in NEUTRAL else f"less {effect_words(effect)} than the ship file"
    )
    assert (effect.excess or alone) in less


def test_every_entry_of_either_sign_says_what_it_is_below_its_neutral_value() -> None:
    assert len(SIGNED) > 30
    for effect in SIGNED:
        assert effect.excess, effect.label
        assert effect.excess != effect.lacks, effect.label
        assert "lack" not in effect.excess, effect.label
        assert "too much" not in effect.lacks, effect.label


def test_an_entry_of_ones_own_without_words_for_too_much_has_some() -> None:
    own = replace(SIGNED[0], excess="", lacks="force as of ice")
    assert "has too much of this: force as of ice, with " in told_at(own, -0.5, 0.0)


def test_a_limit_that_is_absent_at_infinity_is_lacking_below_it() -> None:
    assert " lacks " in told_at(entry("pitch-rate-limit (pitch-actuator)"), 0.05, math.inf)


def test_a_shape_that_is_too_much_everywhere_is_said_to_be_too_much() -> None:
    found = diagnosis_of("unexplained")
    assert found.shape is not None
    much = replace(found, shape=replace(found.shape, values=-np.abs(found.shape.values)))
    assert "the engine balance has 0 N m to 12.0 kN m too much, depending on shaft" in sentence(
        much
    )


def test_a_headline_names_as_many_effects_as_it_has_words_for() -> None:
    found = diagnosis_of("explained")
    partly = replace(found, verdict="partly-explained")
    assert headline(partly) == "Partly explained by Coulomb friction."
    names = ("viscous-friction (engine)", "torque-sensor-gain (sensor)", "hull-fouling (hull)")
    several = [replace(found.findings[0], effect=entry(name)) for name in names]
    three = replace(found, verdict="explained", findings=several)
    assert headline(three) == "Explained by viscous friction, torque sensor gain and hull fouling."
    many = [replace(found.findings[0], effect=effect) for effect in catalogue()]
    line = headline(replace(found, findings=many))
    assert len(line.split()) <= MOST_WORDS
    assert line.endswith("more.")


@pytest.mark.parametrize(
    ("verdict", "changes", "line"),
    [
        ("nothing-missing", {}, "Nothing missing: the difference is within noise"),
        (
            "unexplained",
            {"limits": ["insufficient excitation"], "excited": False},
            "Cannot be decided: the recording",
        ),
    ],
)
def test_a_headline_without_effects(verdict: str, changes: dict[str, object], line: str) -> None:
    said = headline(diagnosis_of(verdict, **changes))
    assert said.startswith(line)
    assert len(said.split()) <= MOST_WORDS
