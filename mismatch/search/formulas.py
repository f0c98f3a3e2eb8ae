"""Where no name fits: a formula, the shortest of a grammar that holds.

What :mod:`.formula_search` has tried is judged here. A formula pays for its coefficients and for the
size of the search, p ln N + 2 ln K; and each block must bring a gain on the data set aside, where no
channel may be simulated worse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.terms import Term
from ..estimate import Estimate
from ..judge.whiteness import Whiteness
from .blocks import Block, joined
from .fitting import Fit
from .formula_screen import home_of
from .formula_search import FormulaSearch, Trial
from .selection import TELL_APART

AS_WELL = 0.95
"""Share of a shape's gain on the data set aside from which on a formula takes its place."""

WORSE = 1.05
"""Factor by which the free-running error of a channel may grow on the data set aside."""


@dataclass(frozen=True)
class Formula:
    """What a balance lacks, as a formula.

    Args:
        balance: that lacks it.
        term: that a corrected ship carries.
        blocks: one or two.
        estimates: of the coefficients, in the order of the blocks.
        gain: in 2 log L, where it was fitted.
        threshold: that it had to pass.
        held_out: gain on the data set aside.
        rivals: expressions as short that do as well.
        better_than: labels of named effects that it follows the recordings better than, if it was tried
            in their place.
        ahead: by how much, in 2 log L beyond their thresholds.
    """

    balance: str
    term: Term
    blocks: tuple[Block, ...]
    estimates: tuple[Estimate, ...]
    gain: float
    threshold: float
    held_out: float
    rivals: tuple[str, ...] = ()
    better_than: tuple[str, ...] = ()
    ahead: float = 0.0

    @property
    def signals(self) -> tuple[str, ...]:
        """That it follows."""
        return tuple(dict.fromkeys(name for block in self.blocks for name in block.signals))

    @property
    def words(self) -> str:
        """The expression as an engineer reads it."""
        return joined(self.blocks, [e.name for e in self.estimates], words=True)


def formula_of(
    whiteness: Whiteness, base: Fit, judge: Callable[[Any], float], rows: NDArray[np.int64]
) -> Formula | None:
    """The formula of what a model leaves, in the balances in which that is more than noise.

    Args:
        whiteness: of the residuals on the part that is fitted.
        base: the model: effects that hold already, fitted; the null where none does.
        judge: 2 log L of a ship's record on the data set aside.
        rows: of the data set aside.

    Returns:
        None where no formula holds, and for demands that do not move, which tell nothing apart.
    """
    names = whiteness.coloured(base)
    if not names or not whiteness.fitter.balances.replay.excited:
        return None
    return found_formula(FormulaSearch(whiteness.fitter, base, names), SetAside(judge, rows))


def as_well(brought: float, other: float) -> bool:
    """Whether a formula does as well as a shape, by their gains on the data set aside."""
    return brought > 0.0 and brought >= AS_WELL * other


@dataclass(frozen=True)
class SetAside:
    """The data set aside, and how they judge.

    Args:
        judge: 2 log L of a ship's record on them.
        rows: theirs.
    """

    judge: Callable[[Any], float]
    rows: NDArray[np.int64]


def found_formula(search: FormulaSearch, aside: SetAside) -> Formula | None:
    """The shortest formula that holds; None where none does.

    Args:
        search: on the part that is fitted.
        aside: the data set aside.
    """
    trials = [t for t in search.trials if search.merit(t) > 0.0]
    judged: dict[int, float] = {}

    def held(trial: Trial) -> float:
        if id(trial) not in judged:
            judged[id(trial)] = _held(search, aside, trial)
        return judged[id(trial)]

    ones = [t for t in trials if len(t.blocks) == 1 and held(t) > 0.0]
    best = _shortest(ones)
    price = search.threshold(2) - search.threshold(1)
    twos = []
    for trial in (t for t in trials if len(t.blocks) == 2):
        if best is not None and _more(trial, best) < price:
            continue
        if held(trial) > max(0.0, 0.0 if best is None else held(best)) and _each(
            search, trial, held, price
        ):
            twos.append(trial)
    longer = _shortest(twos)
    chosen = longer or best
    if chosen is None:
        return None
    rivals = _near(twos if longer else ones, chosen)
    return _told(search, chosen, held(chosen), rivals)


def _more(trial: Trial, other: Trial) -> float:
    """What a formula gains beyond another, also where the ship's numbers may be farther off."""
    return min(trial.gain - other.gain, trial.sure - other.sure)


def _shortest(trials: list[Trial]) -> Trial | None:
    """Of those that cannot be told apart, the shortest; of these, the best."""
    if not trials:
        return None
    most = max(trial.gain for trial in trials)
    near = [trial for trial in trials if trial.gain > most - TELL_APART]
    return min(near, key=lambda trial: (trial.length, -trial.gain))


def _near(trials: list[Trial], chosen: Trial) -> list[Trial]:
    return [t for t in trials if t is not chosen and abs(t.gain - chosen.gain) < TELL_APART][:3]


def _each(
    search: FormulaSearch, trial: Trial, held: Callable[[Trial], float], price: float
) -> bool:
    """Whether each of two blocks brings what it costs, and a gain on the data set aside."""
    for block, coefficient in zip(trial.blocks, trial.placed.values, strict=True):
        alone = search.single(trial, block, coefficient)
        if alone is not None and (_more(trial, alone) < price or held(trial) <= held(alone)):
            return False
    return True


def _held(search: FormulaSearch, aside: SetAside, trial: Trial) -> float:
    """Gain on the data set aside; minus infinity where a channel is simulated worse there."""
    record = search.fitter.trial_ship.record
    before, after = (search.errors(fit, aside.rows) for fit in (search.base, trial.fit))
    # a run that is not finite compares as worse
    if not all(after[column] <= WORSE * before[column] for column in before):
        return -math.inf
    return aside.judge(record(trial.fit.effects)) - aside.judge(record(search.base.effects))


def _told(search: FormulaSearch, trial: Trial, held: float, rivals: list[Trial]) -> Formula:
    fitter, place = search.fitter, trial.place
    estimates = fitter.estimates(trial.fit)[-1]
    term = search.term(place, trial.blocks)
    tree = term.model_dump(exclude_unset=True)
    for name, estimate in zip(term.parameters, estimates, strict=True):
        tree["parameters"][name]["value"] = estimate.value
    return Formula(
        home_of(place, fitter.balances), Term.model_validate(tree), trial.blocks, estimates,
        trial.gain, search.threshold(len(trial.blocks)), held,
        tuple(f"{t.place}: {t.placed.effect.equation}" for t in rivals),
    )  # fmt: skip
