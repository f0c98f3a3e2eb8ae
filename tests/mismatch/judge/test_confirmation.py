"""Which of several effects are kept."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from shaftline.mismatch.judge.confirmation import confirmed
from shaftline.mismatch.search.placed import Placed
from shaftline.mismatch.search.selection import Selection

from ..toy import entry

LAG = entry("engine-torque-lag (engine)")
DERATING = entry("engine-derating (engine)")
FOULING = entry("hull-fouling (hull)")


class Fitter:
    """Joins effects, and remembers that they were fitted again."""

    def fitted(self, effects: Any) -> Any:
        return SimpleNamespace(effects=effects, refitted=False)

    def joint(self, fit: Any) -> Any:
        return SimpleNamespace(effects=fit.effects, refitted=True)


def told(rivals: Any) -> list[list[str]]:
    return [list(map(str, some)) for some in rivals]


def chosen(*effects: Any, gains: tuple[float, ...]) -> Selection:
    fit: Any = SimpleNamespace(effects=tuple(Placed(e, (1.0,)) for e in effects), refitted=False)
    rivals: Any = tuple((f"rival of {e.id}",) for e in effects)
    return Selection(fit, gains, tuple(10.0 + i for i in range(len(effects))), rivals, ())


def kept(selection: Selection, **judged: float) -> Selection:
    """What is confirmed, where an effect's share in the data set aside is its score."""

    def judge(fit: Any) -> float:
        names = (placed.effect.id for placed in fit.effects)
        return sum(judged.get(name.replace("-", "_"), 1.0) for name in names)

    fitter: Any = Fitter()
    return confirmed(selection, fitter, judge)


def ids(selection: Selection) -> list[str]:
    return [placed.effect.id for placed in selection.fit.effects]


def test_what_holds_stays_as_it_was() -> None:
    selection = chosen(LAG, FOULING, gains=(400.0, 50.0))
    assert kept(selection) is selection
    alone = chosen(LAG, gains=(400.0,))
    assert kept(alone, engine_torque_lag=-9.0) is alone  # the first one is judged elsewhere


@pytest.mark.parametrize(("score", "names"), [(0.0, ["engine-torque-lag", "hull-fouling"]),
                                              (-0.01, ["engine-torque-lag"])])  # fmt: skip
def test_a_later_effect_that_new_data_speak_against_is_dropped(
    score: float, names: list[str]
) -> None:
    selection = chosen(LAG, FOULING, gains=(400.0, 50.0))
    found = kept(selection, hull_fouling=score)
    assert ids(found) == names
    if len(names) == 1:
        assert found.fit.refitted  # type: ignore[attr-defined]
        assert (found.gains, found.thresholds) == ((400.0,), (10.0,))
        assert told(found.rivals) == [["rival of engine-torque-lag"]]


@pytest.mark.parametrize(("gain", "names"), [(60.1, ["engine-torque-lag", "engine-derating"]),
                                             (59.9, ["engine-torque-lag"])])  # fmt: skip
def test_a_later_effect_in_the_same_balance_must_bring_fifteen_hundredths(
    gain: float, names: list[str]
) -> None:
    assert ids(kept(chosen(LAG, DERATING, gains=(400.0, gain)))) == names
    assert ids(kept(chosen(LAG, FOULING, gains=(400.0, gain)))) == [
        "engine-torque-lag",
        "hull-fouling",
    ]


def test_each_is_judged_beside_those_that_are_kept() -> None:
    selection = chosen(LAG, FOULING, DERATING, gains=(400.0, 300.0, 20.0))
    found = kept(selection)
    assert ids(found) == ["engine-torque-lag", "hull-fouling"]
    assert (found.gains, found.thresholds) == ((400.0, 300.0), (10.0, 11.0))
    assert told(found.rivals) == [["rival of engine-torque-lag"], ["rival of hull-fouling"]]
    # the strongest beside it counts, whichever it is
    late = chosen(LAG, DERATING, FOULING, gains=(20.0, 400.0, 300.0))
    assert ids(kept(late)) == ["engine-torque-lag", "engine-derating", "hull-fouling"]
