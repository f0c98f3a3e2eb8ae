"""Formulas in the simulator: what straight lines recommend, tried as terms and fitted.

Blocks (:mod:`.blocks`) at each place where a balance may lack something are screened by straight lines
(:mod:`.formula_screen`); the best, and pairs of them, are tried as a term *in the simulator* under the
same whitened likelihood, their coefficients fitted by Gauss-Newton steps. Lines are then drawn anew
about the best formula, under the covariance of what it leaves, until no better one turns up.

Where no name fits: a formula, the shortest of a grammar that holds.

What :mod:`.formula_search` has tried is judged here. A formula pays for its coefficients and for the
size of the search, p ln N + 2 ln K; and each block must bring a gain on the data set aside, where no
channel may be simulated worse.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import ShipError
from ...plant.terms import PLACES, TERM_SIGNALS, Term
from ..estimate import Estimate
from .blocks import Block, joined, quotient
from .catalogue import Effect, Parameter, Placed
from .fitting import Fit, Fitter
from .formula_screen import Screen, Screened, home_of, places_of
from .selection import TELL_APART
from .spectra import SMALL_SAMPLE, Likelihood, runs_away
from .whiteness import Whiteness

INDIRECT = ("drive", "inflow_velocity")
"""Places that say less plainly what a balance lacks, where another does as well."""

ROUNDS = 4
"""Times that lines are drawn anew."""

SINGLES, PAIRS = 8, 6
"""Formulas of one block and of two that a round tries in the simulator."""

STEPS, SETTLED = 3, 0.5
"""Gauss-Newton steps of a formula's coefficients at most, and the gain in 2 log L that ends them."""

STEP = 0.02
"""Share of a coefficient over which its column is taken."""

REACH = 10.0
"""Prior standard deviation of a step, as a share of a coefficient: next to free."""

WIDE = 4.0
"""Factor on the tolerances of the ship's numbers under which a formula must hold too: what a number that
is wrong explains as well is none."""

NEWLY = 10
"""Times that the ship is simulated anew with such numbers."""

ALIKE = 0.999
"""Cosine of what two places do to the balances from which on they are one."""


@dataclass(frozen=True)
class Trial:
    """A formula in the simulator, fitted.

    Args:
        place: where it acts.
        blocks: one or two.
        fit: with the formula as its last effect.
        gain: in 2 log L on top of the model.
        sure: likewise where the ship's numbers may be :data:`WIDE` times as far off.
    """

    place: str
    blocks: tuple[Block, ...]
    fit: Fit
    gain: float
    sure: float

    @property
    def placed(self) -> Placed:
        """The formula with its coefficients."""
        return self.fit.effects[-1]

    @property
    def length(self) -> int:
        """What it costs to say it."""
        return sum(1 + block.length for block in self.blocks) + (self.place in INDIRECT)


class FormulaSearch:
    """The search on one fitter.

    Args:
        fitter: of the recordings.
        base: effects that hold already, fitted.
        names: of the balances that lack something.
    """

    def __init__(self, fitter: Fitter, base: Fit, names: Sequence[str]) -> None:
        self.fitter, self.base = fitter, base
        self.screen = Screen(fitter, base)
        balances = fitter.balances
        self.places = self._apart(places_of(balances, names))
        self.count = sum(len(self.screen.blocks(place)) for place in self.places)
        self.samples = sum(
            b - a for a, b in zip(fitter.bands.starts, fitter.bands.ends, strict=True)
        )
        self._wide = Likelihood(fitter.bands, WIDE * fitter.nuisance)
        self._base_wide = self._by_numbers()
        ship = fitter.trial_ship.host(base.effects)
        outside = {**ship.signals}
        told = {
            n: text.split("[")[-1].rstrip("]") for n, text in TERM_SIGNALS.items() if "[" in text
        }
        self.units = told | {"drive": ship.prime_mover.demand.unit} | outside
        taken = {term.id for term in ship.term}
        self._id = next(n for n in _ids() if n not in taken)
        self._names = [n for n in ("a", "b", "c", "d", "e", "f", "g", "h", "k") if n not in outside]

    def _apart(self, places: list[str]) -> list[str]:
        """Places that can be felt and told from each other; of those that cannot, the plainer."""
        kept: dict[str, NDArray[np.float64]] = {}
        for place in sorted(places, key=lambda place: place in INDIRECT):
            answer = self.screen.answer(place)
            if not answer.any():
                continue
            answer = answer / np.linalg.norm(answer)
            if all(abs(float(np.sum(answer * other))) < ALIKE for other in kept.values()):
                kept[place] = answer
        return list(kept)

    def _by_numbers(self) -> float:
        """2 log L of the model where the ship's numbers are farther off than the file says.

        What a straight line says of them is simulated, and lines are drawn anew there.
        """
        fitter, base = self.fitter, self.base
        found = self._wide(base.difference, base.tolerances / WIDE)
        best: float = found.score
        ship = fitter.trial_ship.corrected(base.effects)
        moved = np.zeros(len(found.shares))
        for _ in range(NEWLY):
            moved = moved + found.shares
            values: dict[str, float] = {}
            for share, move in zip(WIDE * moved, fitter.moves, strict=False):
                for key, change in move.numbers.items():
                    own = values.get(key, ship.number(key).value)
                    values[key] = own + share * change / move.share
            told = [bool(move.numbers) for move in fitter.moves]
            moved[: len(told)] *= told
            moved[len(told) :] = 0.0
            try:
                record = ship.with_values(values).record()
            except ShipError:
                break
            difference = fitter.measured - fitter.predicted(record)
            if runs_away(difference):
                break
            found = self._wide(difference)
            # the prior is about the file's numbers, not those of the line before
            whole = moved + found.shares
            best = max(best, float(found.score + found.shares @ found.shares - whole @ whole))
        return best

    def threshold(self, blocks: int) -> float:
        """Gain that chance does not reach: p ln N + 2 ln K, of K formulas of so many blocks."""
        tried = math.comb(max(self.count, blocks), blocks)
        return SMALL_SAMPLE * (blocks * math.log(self.samples) + 2.0 * math.log(max(tried, 2)))

    def term(self, place: str, blocks: Sequence[Block]) -> Term:
        """A formula as a term, at coefficients that change nothing."""
        names = self._names[: len(blocks)]
        own = PLACES[place].split("[")[-1].rstrip("]")
        if place == "drive":
            own = self.units["drive"]
        return Term.model_validate(
            {
                "id": self._id,
                "acts_on": place,
                "expression": joined(blocks, names),
                "parameters": {
                    name: {"value": 0.0, "unit": quotient(own, block.unit(self.units))}
                    for name, block in zip(names, blocks, strict=True)
                },
            }
        )

    def refined(
        self, place: str, blocks: tuple[Block, ...], start: Sequence[float]
    ) -> Trial | None:
        """A formula in the simulator, its coefficients fitted; None where it runs away.

        Args:
            place: where it acts.
            blocks: one or two.
            start: coefficients to begin with.
        """
        return self.of_term(self.term(place, blocks), blocks, start)

    def of_term(
        self, term: Term, blocks: tuple[Block, ...], start: Sequence[float]
    ) -> Trial | None:
        """A term in the simulator, its parameters fitted; None where it runs away.

        Args:
            term: that changes nothing where its parameters are 0.
            blocks: of which it is made; none of what is not of the grammar.
            start: parameters to begin with.
        """
        place = term.acts_on
        parameters = tuple(
            Parameter(f"term.{term.id}.{name}", (), term=term) for name in term.parameters
        )
        effect = Effect(
            term.id, home_of(place, self.fitter.balances), parameters, term.expression, "", "", "",
            term=term,
        )  # fmt: skip
        sizes = np.asarray(start, dtype=np.float64)
        for _ in range(4):
            fit = self._at(effect, sizes)
            if math.isfinite(fit.score):
                break
            sizes = 0.3 * sizes
        else:
            return None
        for _ in range(STEPS):
            better = self._stepped(effect, sizes, fit)
            if better is None:
                break
            gain = better[1].score - fit.score
            sizes, fit = better
            if gain < SETTLED:
                break
        sure = self._wide(fit.difference, fit.tolerances / WIDE).score - self._base_wide
        return Trial(place, blocks, fit, fit.score - self.base.score, sure)

    def _at(self, effect: Effect, sizes: Any) -> Fit:
        return self.fitter.fitted((*self.base.effects, Placed(effect, tuple(map(float, sizes)))))

    def _stepped(self, effect: Effect, sizes: Any, fit: Fit) -> tuple[Any, Fit] | None:
        """One Gauss-Newton step, shortened until it helps; None where none does."""
        fitter, record = self.fitter, self.fitter.trial_ship.record
        here = fitter.predicted(record(fit.effects))
        columns = []
        for i, size in enumerate(sizes):
            moved = sizes.copy()
            moved[i] += STEP * (size or 1.0)
            placed = Placed(effect, tuple(map(float, moved)))
            there = fitter.predicted(record((*self.base.effects, placed)))
            columns.append((there - here) / (STEP * (size or 1.0)))
        if not np.isfinite(columns).all():
            return None
        reach = REACH * np.where(sizes == 0.0, 1.0, np.abs(sizes))
        found = fitter.beside(fit, np.array(columns) * reach[:, None, None])
        step = found.shares[: len(sizes)] * reach
        for share in (1.0, 0.3, 0.09):
            trial = sizes + share * step
            better = self._at(effect, trial)
            if better.score > fit.score:
                return trial, better
        return None

    def errors(self, fit: Fit, rows: NDArray[np.int64]) -> dict[str, float]:
        """Free-running error of each channel, rms, the nominal numbers where a fit has them.

        Args:
            fit: a model.
            rows: that are judged.
        """
        replay = self.fitter.balances.replay
        found = replay.channels_of(self.fitter.trial_ship.record(fit.effects))
        off = {c: (replay.measured[c] - x)[rows] for c, x in found.items()}
        for share, moved in zip(fit.tolerances, self._moved, strict=False):
            for column, change in moved.items():
                off[column] = off[column] - share * change[rows]
        with np.errstate(over="ignore"):  # a formula that runs away is infinitely wrong
            return {c: float(np.sqrt(np.mean(np.square(x)))) for c, x in off.items()}

    @functools.cached_property
    def _moved(self) -> list[dict[str, NDArray[np.float64]]]:
        """What each nominal number does to the channels, by one standard deviation."""
        fitter, replay = self.fitter, self.fitter.balances.replay
        here = replay.channels_of(fitter.trial_ship.nominal)
        found = []
        for move in fitter.moves:
            there = replay.channels_of(move.record, move.start)
            found.append({c: (there[c] - x) / move.share for c, x in here.items()})
        return found

    @functools.cached_property
    def trials(self) -> list[Trial]:
        """Formulas that were tried in the simulator, by what they gain beyond chance, best first."""
        tried: dict[tuple[str, frozenset[Block]], Trial] = {}
        about: Trial | None = None
        for _ in range(ROUNDS):
            for one in self._screened(about):
                key = (one.place, frozenset(one.blocks))
                if key not in tried:
                    found = self.refined(one.place, one.blocks, one.coefficients)
                    if found is not None:
                        tried[key] = found
            if not tried:
                break
            best = max(tried.values(), key=self.merit)
            if best is about:
                break
            about = best
        return sorted(tried.values(), key=self.merit, reverse=True)

    def merit(self, trial: Trial) -> float:
        """Gain beyond what chance reaches."""
        return min(trial.gain, trial.sure) - self.threshold(len(trial.blocks))

    def _screened(self, about: Trial | None) -> Iterator[Screened]:
        """What straight lines about a formula recommend, pairs only once there is one."""
        screen = self.screen
        fit = self.base if about is None else about.fit
        values = screen.values(fit.effects)
        residual = fit.difference
        if about is not None:
            own = screen.columns(about.place, about.blocks, values)
            residual = residual + np.einsum("k,kmf->mf", np.array(about.placed.values), own)
        singles, pairs = [], []
        for place in self.places:
            ones, twos = screen.singles_and_pairs(place, residual, fit.weight, values)
            singles += ones
            pairs += twos
        yield from screen.likeliest(singles, residual, fit.tolerances, values)[:SINGLES]
        if about is not None:
            yield from screen.likeliest(pairs, residual, fit.tolerances, values)[:PAIRS]

    def single(self, trial: Trial, block: Block, coefficient: float) -> Trial | None:
        """One block of a formula alone, fitted anew."""
        return self.refined(trial.place, (block,), (coefficient,))


def _ids() -> Iterator[str]:
    yield "formula"
    for number in range(2, 99):
        yield f"formula-{number}"


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
