"""Which of several effects are kept."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.judge.correction import (
    ELSEWHERE_SHARE,
    REMNANT_SHARE,
    REMOTE_SHARE,
    add_rivals,
    drop_unconfirmed,
    settle_episode_edges,
)
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.selection import Candidate, Selection
from shaftline.mismatch.search.spectra import chance_gain
from shaftline.plant import load_ship, simulate_recording

from ..toy import entry

LAG = entry("engine-torque-lag (engine)")
DERATING = entry("engine-derating (engine)")
FOULING = entry("hull-fouling (hull)")
BEND = entry("engine-torque-curvature (engine)")
FRICTION = entry("coulomb-friction (engine)")
EPISODE = entry("resistance-episode (hull)")
ROUGH = entry("propeller-roughness (propeller)")


class Fitter:
    """Joins effects, and remembers that they were fitted again.

    Args:
        least: size of every effect that differs from none.
        lost: 2 log L that a lag of that size has less than at its own; others lose more.
    """

    def __init__(self, least: float = 0.0, lost: float = 0.0) -> None:
        self.trial_ship = SimpleNamespace(neutral=lambda _: 0.0, resolution=lambda _: least)
        self.least, self.lost = least, lost

    def evaluate(self, effects: Any) -> Any:
        small = {p.effect.id for p in effects if p.values[0] == self.least}
        score = -(self.lost if small == {LAG.id} else 100.0 * len(small))
        return SimpleNamespace(effects=effects, refitted=False, score=score)

    def evaluate_models(self, models: Any) -> Any:
        return map(self.evaluate, models)

    def refine_effects(self, fit: Any) -> Any:
        return SimpleNamespace(effects=fit.effects, refitted=True)


def told(rivals: Any) -> list[list[str]]:
    return [list(map(str, some)) for some in rivals]


def chosen(*effects: Any, gains: tuple[float, ...]) -> Selection:
    fit: Any = SimpleNamespace(
        effects=tuple(SizedEffect(e, (1.0,)) for e in effects), refitted=False, score=0.0
    )
    rivals: Any = tuple((f"rival of {e.id}",) for e in effects)
    return Selection(fit, gains, tuple(10.0 + i for i in range(len(effects))), rivals, ())


def kept(selection: Selection, **judged: float) -> Selection:
    """What is confirmed, where an effect's share in the data set aside is its score."""

    def judge(fit: Any) -> float:
        names = (placed.effect.id for placed in fit.effects)
        return sum(judged.get(name.replace("-", "_"), 1.0) for name in names)

    fitter: Any = Fitter()
    return drop_unconfirmed(selection, fitter, judge)


def ids(selection: Selection) -> list[str]:
    return [placed.effect.id for placed in selection.fit.effects]


def test_what_holds_stays_as_it_was() -> None:
    selection = chosen(LAG, FOULING, gains=(400.0, 50.0))
    assert kept(selection) is selection
    alone = chosen(LAG, gains=(400.0,))
    assert kept(alone, engine_torque_lag=-9.0) is alone  # the first one is judged elsewhere


@pytest.mark.parametrize(("least", "names"), [(0.99, ["engine-torque-lag"]), (1.0, [])])
def test_what_is_no_larger_than_the_recording_resolves_is_dropped(
    least: float, names: list[str]
) -> None:
    """A lag of 1 s where rows are that far apart: clocks and filters do the same."""
    fitter: Any = Fitter(least, lost=50.0)
    assert ids(drop_unconfirmed(chosen(LAG, gains=(400.0,)), fitter, lambda _: 0.0)) == names


@pytest.mark.parametrize(
    ("score", "names"),
    [(0.0, ["engine-torque-lag", "hull-fouling"]), (-0.01, ["engine-torque-lag"])],
)
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


@pytest.mark.parametrize(
    ("gain", "names"),
    [(60.1, ["engine-torque-lag", "engine-derating"]), (59.9, ["engine-torque-lag"])],
)
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


class Rivals:
    """A fitter whose models are worth what their effects' ids say."""

    def __init__(self, **worth: float) -> None:
        self.worth = worth

    def evaluate(self, effects: Any) -> Any:
        score = sum(self.worth[p.effect.id.replace("-", "_")] for p in effects)
        return SimpleNamespace(effects=effects, score=score)

    def polish(self, fit: Any) -> Any:
        return fit


def alike(gain: float, rival: float, explained: float = 1.0) -> list[str]:
    """Names that are as good as a lag that is worth a gain, where a derating is worth another."""
    fitter: Any = Rivals(engine_torque_lag=gain, engine_derating=rival, hull_fouling=50.0)
    fit = fitter.evaluate((SizedEffect(FOULING, (1.0,)), SizedEffect(LAG, (1.0,))))
    near = Candidate(DERATING, fitter.evaluate((SizedEffect(DERATING, (1.0,)),)), rival)
    same = Candidate(LAG, fitter.evaluate((SizedEffect(LAG, (2.0,)),)), gain)
    selection = Selection(fit, (50.0, gain), (10.0, 10.0), ((), (same, near)), ())
    found = add_rivals(selection, fitter, explained)
    assert found.rivals[0] == ()
    for candidate in found.rivals[1]:
        assert candidate.gain == pytest.approx(rival)
    return [candidate.effect.id for candidate in found.rivals[1]]


@pytest.mark.parametrize(
    ("gain", "behind", "explained", "told_apart"),
    [
        (300.0, 5.9, 1.0, False),
        (300.0, 6.1, 1.0, True),  # odds of twenty to one
        (1000.0, 9.9, 1.0, False),
        (1000.0, 10.1, 1.0, True),  # a hundredth of the gain
        (1000.0, 59.9, 0.95, False),
        (1000.0, 60.1, 0.95, True),  # and what the form leaves
    ],
)
def test_a_rival_is_refuted_by_more_than_the_form_s_error(
    gain: float, behind: float, explained: float, told_apart: bool
) -> None:
    assert alike(gain, gain - behind, explained) == ([] if told_apart else ["engine-derating"])


def test_what_fewer_parameters_do_is_as_good_by_what_the_others_cost() -> None:
    """A bend in two parameters leads a derating in one by its price and a little."""
    price = chance_gain(2, 1, 0.01) - chance_gain(1, 1, 0.01)
    for behind, names in ((5.9 + price, ["engine-derating"]), (6.1 + price, [])):
        fitter: Any = Rivals(engine_torque_curvature=300.0, engine_derating=300.0 - behind)
        fit = fitter.evaluate((SizedEffect(BEND, (1.0, 1.0)),))
        near = Candidate(
            DERATING, fitter.evaluate((SizedEffect(DERATING, (1.0,)),)), 300.0 - behind
        )
        selection = Selection(fit, (300.0,), (10.0,), ((near,),), ())
        (rivals,) = add_rivals(selection, fitter, 1.0).rivals
        assert [c.effect.id for c in rivals] == names


def test_what_may_be_taken_for_an_effect_is_tried_in_its_place_however_far_behind_it_was() -> None:
    for other, names in ((DERATING, ["engine-derating"]), (FOULING, [])):
        fitter: Any = Rivals(coulomb_friction=300.0, engine_derating=299.0, hull_fouling=299.0)
        fit = fitter.evaluate((SizedEffect(FRICTION, (1.0,)),))
        then = Candidate(other, fitter.evaluate((SizedEffect(other, (1.0,)),)), 100.0)
        selection = Selection(fit, (300.0,), (10.0,), ((then,),), ())
        (rivals,) = add_rivals(selection, fitter, 1.0).rivals
        assert [c.effect.id for c in rivals] == names


def test_the_edge_of_an_episode_in_data_set_aside_is_where_these_have_it() -> None:
    replay = SimpleNamespace(interval_s=0.5)
    fitter: Any = Fitter()
    fitter.balances = SimpleNamespace(replay=replay)

    def judge(fit: Any) -> float:
        begin, end = fit.effects[1].window
        return -float(abs(end - 175.0) + abs(begin - 150.0))

    windows = {
        (20.0, 190.0): (20.0, 175.0),
        (20.0, 90.0): (20.0, 90.0),
        (110.0, 300.0): (150.0, 300.0),
    }
    for before, after in windows.items():
        fit: Any = SimpleNamespace(
            effects=(SizedEffect(LAG, (1.0,)), SizedEffect(EPISODE, (0.1,), before))
        )
        selection = Selection(fit, (9.0, 9.0), (1.0, 1.0), ((), ()), ())
        found = settle_episode_edges(selection, fitter, [(200, 400)], judge)  # 100 to 200 s
        assert found.fit.effects[1].window == after
        assert found.fit.effects[0] == fit.effects[0]


def test_a_name_elsewhere_needs_a_smaller_share_than_one_beside() -> None:
    """Torque lag and derating are the engine's; roughness is the propeller's, fouling beyond it."""
    others = ((DERATING, REMNANT_SHARE), (ROUGH, ELSEWHERE_SHARE), (FOULING, REMOTE_SHARE))
    for other, share in others:
        for part, expected in ((1.01, 2), (0.99, 1)):
            selection = chosen(LAG, other, gains=(1000.0, 1000.0 * share * part))
            assert len(ids(kept(selection))) == expected


@pytest.mark.parametrize(
    ("lost", "names"), [(5.0, ["hull-fouling"]), (7.0, ["engine-torque-lag", "hull-fouling"])]
)
def test_what_does_as_well_at_the_least_size_is_not_measured(lost: float, names: list[str]) -> None:
    fitter: Any = Fitter(least=0.1, lost=lost)
    found = drop_unconfirmed(
        chosen(LAG, FOULING, gains=(100.0, 90.0)), fitter, lambda fit: len(fit.effects)
    )
    assert [placed.effect.id for placed in found.fit.effects] == names


def diagnose_friction(key: str, size: float) -> Diagnosis:
    """Diagnose a frigate with friction that its file lacks, in steps of the rack."""
    random, seconds = np.random.default_rng(1), np.arange(900.0)
    rack = np.repeat(random.uniform(14.0, 30.0, 15), 60)
    commands = {"time_s": seconds, "fuel_rack_mm": rack, "pitch_ratio_command": 1.2}
    ship = load_ship("frigate")
    recording = simulate_recording(ship.with_values({key: size}), pd.DataFrame(commands))
    noise = {"shaft_speed_rad_s": 0.03, "ship_speed_m_s": 0.05, "shaft_torque_N_m": 2500.0}
    for channel, deviation in noise.items():
        recording[channel] += random.normal(0.0, deviation, len(recording))
    return diagnose(ship, recording, options=Options(quick=True))


def test_a_residual_that_is_noise_leaves_nothing_unexplained_in_favour_of_rivals() -> None:
    """The explained share of so small a power is one of noise."""
    found = diagnose_friction("transmission.coulomb_friction_engine_side_N_m", 4000.0)
    assert found.left_over is None
    assert found.explained < 0.7
    assert [one.effect.id for one in found.findings] == ["coulomb-friction"]
    assert {label.split(" ")[0] for label in found.alternatives} <= {"engine-torque-curvature"}


def test_a_bend_at_speed_0_is_no_alternative_to_viscous_friction() -> None:
    found = diagnose_friction("transmission.viscous_friction_engine_side_N_m_s_rad", 900.0)
    assert [one.effect.id for one in found.findings] == ["viscous-friction"]
    (finding,) = found.findings
    bend = next(c for c, _ in found.ranking if c.effect.label.endswith("knee-in-speed)"))
    assert bend.gain == pytest.approx(finding.score, rel=0.02)
    assert found.alternatives == {}
