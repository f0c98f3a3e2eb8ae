"""When effects are believed, from both sides of every limit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.verdict import (
    EXPLAINED,
    NOTHING,
    PARTLY,
    UNEXPLAINED,
    balance_verdicts,
    explained_shares,
    is_close_call,
    is_far_from_noise,
    is_undecidable,
    judge_selection,
    limit_verdict,
    sure_effects,
)
from shaftline.mismatch.search.fitting import Colour

RED = Colour(0, 1, 0.005, 0.02, 14.0)


class Whiteness:
    """Stands for the judge of residuals: given power ratios, and colour where a fit has one."""

    def __init__(self, before: Any, after: Any, null: bool = True, left: bool = False) -> None:
        names = [f"row{k}" for k in range(np.shape(before)[1])]
        trial_ship = SimpleNamespace(
            range_of=lambda _: (0.001, 5.0),
            origin=lambda _: 1.0,
            ship=None,
            plausible_range=lambda parameter: parameter.plausible,
        )
        self.fitter = SimpleNamespace(
            null="null", balances=SimpleNamespace(names=names), trial_ship=trial_ship
        )
        self._ratios = {"null": np.array(before), "fit": np.array(after)}
        self._colours = {"null": RED if null else None, "fit": RED if left else None}

    def _key(self, fit: Any) -> str:
        return fit if isinstance(fit, str) else "fit"

    def ratios(self, fit: Any) -> Any:
        return self._ratios[self._key(fit)]

    def colour(self, fit: Any, balance: int | None = None) -> Colour | None:
        """A balance is coloured where the whole is and its ratio is above 1."""
        key = self._key(fit)
        plain = balance is not None and self._ratios[key][:, balance].max() <= 1.0
        return None if plain else self._colours[key]


def selection(
    *gains: float,
    effects: int = 1,
    rivals: int = 0,
    value: float = 0.8,
    whole: bool = False,
    plausible: tuple[float, float] = (-np.inf, np.inf),
) -> Any:
    told = SimpleNamespace(
        key="sensors.torque_gain",
        name="torque_gain",
        whole=whole,
        plausible=plausible,
        in_ship=lambda _: SimpleNamespace(info=SimpleNamespace(unit="-")),
    )
    placed = SimpleNamespace(pairs=((told, value),))
    return SimpleNamespace(
        fit=SimpleNamespace(effects=(placed,) * effects),
        rivals=(("rival",) * rivals,) * effects,
        ranking=tuple(SimpleNamespace(gain=gain) for gain in gains),
    )


def verdict(chosen: Any, whiteness: Whiteness, gain: float = 50.0, excited: bool = True) -> str:
    return judge_selection(chosen, whiteness, gain, excited).name  # type: ignore[arg-type]


def test_the_explained_share_is_of_the_power_beyond_noise() -> None:
    whiteness: Any = Whiteness([[9.0, 3.0], [0.5, 1.0]], [[3.0, 1.5], [0.9, 0.2]])
    null: Any = "null"
    fit: Any = "fit"
    shares = explained_shares(whiteness, null, fit)
    assert shares == pytest.approx([1.0 - 2.0 / 8.0, 1.0 - 0.5 / 2.0, 1.0 - 2.5 / 10.0])
    noise: Any = Whiteness([[0.9, 1.0]], [[3.0, 0.2]])
    assert list(explained_shares(noise, null, fit)) == [
        0.0,
        1.0,
        0.0,
    ]  # worse than nothing, and noise


@pytest.mark.parametrize(("second", "close"), [(59.9, False), (60.0, False), (60.1, True)])
def test_a_second_name_is_close_beyond_three_fifths(second: float, close: bool) -> None:
    assert is_close_call(selection(100.0, second, 99.0)) is close
    assert is_close_call(selection(100.0)) is False


def test_what_explains_all_is_believed() -> None:
    found: Any = judge_selection(selection(100.0), Whiteness([[9.0]], [[1.0]]), 50.0, True)  # type: ignore[arg-type]
    assert (found.name, found.explained, found.colour, found.left_over) == (
        EXPLAINED,
        1.0,
        RED,
        None,
    )


@pytest.mark.parametrize(
    ("value", "name"),
    [(0.001, PARTLY), (0.001 * (1.0 + 1e-9), PARTLY), (5.0, PARTLY), (0.0011, EXPLAINED)],
)
@pytest.mark.parametrize("sure", [False, True])
def test_a_value_at_the_bound_of_its_search_explains_nothing_wholly(
    value: float, name: str, sure: bool
) -> None:
    chosen, whiteness = selection(100.0, value=value), Whiteness([[9.0]], [[1.0]])
    found: Any = judge_selection(chosen, whiteness, 50.0, True, sure)  # type: ignore[arg-type]
    assert found.name == name
    refuted: Any = judge_selection(chosen, whiteness, -np.inf, True, sure)  # type: ignore[arg-type]
    assert refuted.name == UNEXPLAINED


def test_the_upper_bound_of_what_is_whole_there_is_no_end_of_a_search() -> None:
    for value, name in ((5.0, EXPLAINED), (0.001, PARTLY)):
        chosen = selection(100.0, value=value, whole=True)
        assert verdict(chosen, Whiteness([[9.0]], [[1.0]])) == name


@pytest.mark.parametrize(
    ("value", "name"), [(0.49, PARTLY), (0.5, EXPLAINED), (2.0, EXPLAINED), (2.01, PARTLY)]
)
def test_a_value_outside_its_plausible_range_explains_nothing_wholly(
    value: float, name: str
) -> None:
    chosen = selection(100.0, value=value, plausible=(0.5, 2.0))
    assert verdict(chosen, Whiteness([[9.0]], [[1.0]])) == name


@pytest.mark.parametrize(("gain", "name"), [(-6.0, EXPLAINED), (-6.01, UNEXPLAINED)])
def test_data_set_aside_have_a_veto_beyond_six(gain: float, name: str) -> None:
    assert verdict(selection(100.0), Whiteness([[9.0]], [[1.0]]), gain) == name
    # where the null is noise, the veto leaves nothing
    assert verdict(selection(100.0), Whiteness([[9.0]], [[1.0]], null=False), -50.0) == NOTHING


@pytest.mark.parametrize(("after", "name"), [(2.599, EXPLAINED), (2.601, UNEXPLAINED)])
def test_four_fifths_must_be_explained_where_more_than_noise_is_left(
    after: float, name: str
) -> None:
    assert verdict(selection(100.0), Whiteness([[9.0]], [[after]], left=True)) == name
    assert verdict(selection(100.0), Whiteness([[9.0]], [[after]])) == EXPLAINED
    assert verdict(selection(100.0), Whiteness([[9.0]], [[after]], null=False, left=True)) == name


@pytest.mark.parametrize(("after", "name"), [(3.09, EXPLAINED), (3.11, NOTHING)])
def test_effects_that_add_to_the_power_beyond_noise_explain_nothing(
    after: float, name: str
) -> None:
    """Of a power of 2 beyond the noise, 0.05 may be added; neither residual is coloured."""
    dim = Whiteness([[3.0]], [[after]], null=False)
    found: Any = judge_selection(selection(100.0), dim, 50.0, True)  # type: ignore[arg-type]
    assert found.name == name


@pytest.mark.parametrize(
    ("ratio", "explained", "far"),
    [(99.9, 0.9, False), (100.1, 0.9, True), (100.1, 0.991, False), (100.1, 0.989, True)],
)
def test_ten_times_the_noise_s_amplitude_is_far_from_it(
    ratio: float, explained: float, far: bool
) -> None:
    assert is_far_from_noise(Colour(0, 1, 0.005, 0.02, ratio), explained) is far
    assert not is_far_from_noise(None, explained)


def test_shares_are_of_what_the_ship_file_leaves_where_parameters_differ() -> None:
    file: Any = Whiteness([[11.0, 3.0]], [[1.0, 1.0]])
    own: Any = Whiteness([[2.0, 2.0]], [[2.0, 1.0]], left=True)
    null: Any = "null"
    fit: Any = "fit"
    assert explained_shares(own, null, fit, file) == pytest.approx([0.9, 1.0, 1.0 - 1.0 / 12.0])
    found = balance_verdicts(own, fit, file)
    assert [(b.verdict, b.explained) for b in found] == [(EXPLAINED, 0.9), (EXPLAINED, 1.0)]


@pytest.mark.parametrize(
    ("chosen", "name"),
    [
        (selection(100.0, 10.0), EXPLAINED),
        (selection(100.0, 70.0), UNEXPLAINED),
        (selection(100.0, 10.0, rivals=1), UNEXPLAINED),
        (selection(100.0, 10.0, effects=2), UNEXPLAINED),
    ],
)
def test_a_dull_recording_decides_only_what_is_clear(chosen: Any, name: str) -> None:
    for null in (True, False):
        assert verdict(chosen, Whiteness([[9.0]], [[1.0]], null=null), excited=False) == name
        assert verdict(chosen, Whiteness([[9.0]], [[1.0]], null=null)) == EXPLAINED


def test_where_nothing_was_chosen_the_colour_decides() -> None:
    none = selection(3.0, 2.9, effects=0)
    for excited in (True, False):
        assert verdict(none, Whiteness([[9.0]], [[9.0]], left=True), 0.0, excited) == UNEXPLAINED
        assert verdict(none, Whiteness([[1.0]], [[1.0]], null=False), 0.0, excited) == NOTHING
        # what is vetoed must have been named
        assert verdict(none, Whiteness([[1.0]], [[1.0]], null=False), -9.0, excited) == NOTHING


def test_what_is_sure_in_one_balance_is_not_thrown_away_for_another() -> None:
    """Nine tenths of one balance explained, nothing of another that is as far from noise."""
    poor = Whiteness([[91.0, 91.0]], [[10.0, 91.0]], left=True)
    found: Any = judge_selection(selection(500.0), poor, 50.0, True, sure=True)  # type: ignore[arg-type]
    assert found.name == PARTLY
    assert [b.verdict for b in found.balances] == [EXPLAINED, UNEXPLAINED]
    assert [b.explained for b in found.balances] == pytest.approx([0.9, 0.0])
    assert verdict(selection(500.0), poor) == UNEXPLAINED  # where it is not
    refuted: Any = judge_selection(selection(500.0), poor, -6.01, True, sure=True)  # type: ignore[arg-type]
    assert refuted.name == UNEXPLAINED


@pytest.mark.parametrize(
    ("after", "name"), [(18.9, EXPLAINED), (19.1, PARTLY), (45.9, PARTLY), (46.1, UNEXPLAINED)]
)
def test_each_balance_is_judged_for_itself(after: float, name: str) -> None:
    whiteness: Any = Whiteness([[91.0, 1.0]], [[after, 1.0]], left=True)
    found: Any = judge_selection(selection(500.0), whiteness, 50.0, True, sure=True)  # type: ignore[arg-type]
    assert [b.verdict for b in found.balances] == [name, NOTHING]


@pytest.mark.parametrize(
    ("after", "gain", "sure"),
    [(45.9, 100.1, [0]), (46.1, 100.1, []), (45.9, 99.9, []), (45.9, 1e4, [0])],
)
def test_an_effect_is_sure_by_its_own_balance_and_its_gain(
    after: float, gain: float, sure: list[int]
) -> None:
    whiteness: Any = Whiteness([[500.0, 91.0]], [[499.0, after]], left=True)
    chosen: Any = SimpleNamespace(fit="fit", gains=(gain,), thresholds=(10.0,))
    assert sure_effects(chosen, [1], whiteness) == sure


@pytest.mark.parametrize(
    ("excited", "limits", "little"),
    [
        (True, [], False),
        (False, [], False),
        (False, ["insufficient excitation"], True),
        (True, ["insufficient excitation"], False),
        (True, ["too short for the hull"], True),
    ],
)
def test_too_little_is_told_by_what_limits_the_recordings(
    excited: bool, limits: list[str], little: bool
) -> None:
    assert is_undecidable(excited, limits) is little


@pytest.mark.parametrize(
    ("name", "undecidable", "biased", "expected"),
    [
        (NOTHING, False, False, NOTHING),
        (NOTHING, True, False, UNEXPLAINED),
        (NOTHING, False, True, UNEXPLAINED),
        (EXPLAINED, True, False, EXPLAINED),
        (EXPLAINED, False, True, PARTLY),
        (PARTLY, True, True, PARTLY),
        (UNEXPLAINED, True, True, UNEXPLAINED),
    ],
)
def test_dull_recordings_and_biased_parameters_limit_a_verdict(
    name: str, undecidable: bool, biased: bool, expected: str
) -> None:
    assert limit_verdict(name, undecidable, biased) == expected


def test_held_out_data_that_refute_the_corrected_ship_limit_a_verdict() -> None:
    assert limit_verdict(EXPLAINED, False, False, refuted=True) == PARTLY
    assert limit_verdict(NOTHING, False, False, refuted=True) == NOTHING
