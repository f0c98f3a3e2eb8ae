"""Search a formula for a residual that no effect of the catalogue explains.

Blocks (:mod:`.blocks`) at each location of the model are screened by linear regression
(:mod:`.formula_screen`). The best blocks and pairs of blocks are tried as a term *in the simulator*
under the same whitened likelihood, with coefficients fitted by Gauss-Newton steps. The regression is
repeated about the best formula, with the covariance of its residual, until no better formula is found.

A formula must gain more than its coefficients and the number of tried formulas give by chance, p ln N +
2 ln K. Each of its blocks must also increase the likelihood of the held-out data, and no channel may be
simulated worse there. The shortest formula with these properties is reported.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import ShipError
from ...plant.terms import PLACES, TERM_SIGNALS, Term
from ..estimate import Estimate
from ..simulate.balances import Channels
from ..simulate.joint_replay import Floats
from .blocks import Block, divide_units, join_blocks
from .catalogue import Effect, Parameter, SizedEffect
from .fitting import Fit, Fitter, Whiteness
from .formula_screen import Screen, Screened, balance_of_location, locations_of
from .selection import INDISTINGUISHABLE
from .spectra import SMALL_SAMPLE, Likelihood, is_divergent

INDIRECT = ("drive", "inflow_velocity")
"""Locations that are harder to interpret, used only if no other location fits equally well."""

ROUNDS = 4
"""Largest number of linear regressions."""

SINGLES, PAIRS = 8, 6
"""Number of formulas with one block and with two blocks that each round tries in the simulator."""

STEPS, SETTLED = 3, 0.5
"""Largest number of Gauss-Newton steps of the coefficients, and the gain in 2 log L that ends them."""

STEP = 0.02
"""Step of the finite difference for a coefficient, as a share of it."""

REACH = 10.0
"""Prior standard deviation of a Gauss-Newton step, as a multiple of a coefficient: nearly free."""

WIDE = 4.0
"""Factor on the tolerances with which a formula must gain too; else a biased parameter explains it."""

NEWLY = 10
"""Largest number of simulations with changed parameters."""

ALIKE = 0.999
"""Cosine of the responses of two locations from which they are indistinguishable."""

AS_GOOD = 0.95
"""Share of the held-out gain of a shape from which a formula replaces it."""

WORSE = 1.05
"""Factor by which the simulation error of a channel may grow on the held-out data."""


@dataclass(frozen=True)
class Formula:
    """Formula of the missing torque, force or power of a balance."""

    balance: str  # balance with the residual
    term: Term  # term of the corrected ship
    blocks: tuple[Block, ...]  # one or two blocks
    estimates: tuple[Estimate, ...]  # coefficients in the order of the blocks
    gain: float  # gain in 2 log L on the fitted data
    threshold: float  # threshold of the gain
    held_out: float  # gain in 2 log L on the held-out data
    rivals: tuple[str, ...] = ()  # indistinguishable expressions
    better_than: tuple[str, ...] = ()  # labels of identified effects that it replaced
    ahead: float = 0.0  # excess of gain over threshold above that of these effects, in 2 log L

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals on which the formula depends."""
        return tuple(dict.fromkeys(name for block in self.blocks for name in block.signals))

    @property
    def words(self) -> str:
        """Expression in mathematical notation."""
        return join_blocks(self.blocks, [e.name for e in self.estimates], words=True)


def search_formula(
    whiteness: Whiteness, base: Fit, judge: Callable[[Any], float], rows: NDArray[np.int64]
) -> Formula | None:
    """Return the formula of the residual of a model, for the balances whose residual exceeds the noise.

    Args:
        whiteness: test of the residuals on the fitted data.
        base: fit of the effects that are known to be missing.
        judge: function that returns 2 log L of a ship record on the held-out data.
        rows: indices of the held-out rows.

    Returns:
        The formula; None if no formula is significant, or if the recording has too little excitation.
    """
    names = whiteness.coloured_balances(base)
    if not names or not whiteness.fitter.balances.replay.excited:
        return None
    return choose_formula(FormulaSearch(whiteness.fitter, base, names), HeldOutData(judge, rows))


def is_as_good(brought: float, other: float) -> bool:
    """Return whether a formula explains as much as a shape, by their gains on the held-out data."""
    return brought > 0.0 and brought >= AS_GOOD * other


@dataclass(frozen=True)
class HeldOutData:
    """Held-out data."""

    judge: Callable[[Any], float]  # function that returns 2 log L of a ship record on the data
    rows: NDArray[np.int64]  # indices of the rows


def choose_formula(search: FormulaSearch, held_out: HeldOutData) -> Formula | None:
    """Return the shortest significant formula of a search on the fitted data; None if there is none."""
    trials = [t for t in search.trials if search.merit(t) > 0.0]
    judged: dict[int, float] = {}

    def gain_of(trial: Trial) -> float:
        if id(trial) not in judged:
            judged[id(trial)] = _held_out_gain(search, held_out, trial)
        return judged[id(trial)]

    ones = [t for t in trials if len(t.blocks) == 1 and gain_of(t) > 0.0]
    best = _shortest(ones)
    price = search.threshold(2) - search.threshold(1)
    least = max(0.0, 0.0 if best is None else gain_of(best))
    twos = []
    for trial in (t for t in trials if len(t.blocks) == 2):
        ahead = best is None or _gain_over(trial, best) >= price
        if ahead and gain_of(trial) > least and _both_needed(search, trial, gain_of, price):
            twos.append(trial)
    longer = _shortest(twos)
    chosen = longer or best
    if chosen is None:
        return None
    others = [t for t in (twos if longer else ones) if t is not chosen]
    rivals = [t for t in others if abs(t.gain - chosen.gain) < INDISTINGUISHABLE][:3]
    return _formula(search, chosen, gain_of(chosen), rivals)


def _held_out_gain(search: FormulaSearch, held_out: HeldOutData, trial: Trial) -> float:
    """Return the gain on the held-out data; minus infinity if a channel is simulated worse there."""
    record = search.fitter.trial_ship.record
    before, after = (search.errors(fit, held_out.rows) for fit in (search.base, trial.fit))
    # The comparison is false for a simulation that is not finite.
    if not all(after[column] <= WORSE * before[column] for column in before):
        return -math.inf
    return held_out.judge(record(trial.fit.effects)) - held_out.judge(record(search.base.effects))


def _both_needed(
    search: FormulaSearch, trial: Trial, gain_of: Callable[[Trial], float], price: float
) -> bool:
    """Return whether each of two blocks is significant and increases the held-out gain."""
    for block, coefficient in zip(trial.blocks, trial.sized_effect.values, strict=True):
        alone = search.single(trial, block, coefficient)
        if alone is None:
            continue
        if _gain_over(trial, alone) < price or gain_of(trial) <= gain_of(alone):
            return False
    return True


def _gain_over(trial: Trial, other: Trial) -> float:
    """Return the smaller difference of the gains of two formulas, with normal and wide tolerances."""
    return min(trial.gain - other.gain, trial.sure - other.sure)


def _shortest(trials: list[Trial]) -> Trial | None:
    """Return the shortest of the formulas that are indistinguishable from the best."""
    if not trials:
        return None
    most = max(trial.gain for trial in trials)
    near = [trial for trial in trials if trial.gain > most - INDISTINGUISHABLE]
    return min(near, key=lambda trial: (trial.length, -trial.gain))


def _formula(search: FormulaSearch, trial: Trial, held: float, rivals: list[Trial]) -> Formula:
    """Return a fitted formula with its estimates, its gain on the held-out data and its rivals."""
    estimates = search.fitter.estimates(trial.fit)[-1]
    balance = balance_of_location(trial.location, search.fitter.balances)
    tree = search.term(trial.location, trial.blocks).model_dump(exclude_unset=True)
    for parameter, estimate in zip(tree["parameters"].values(), estimates, strict=True):
        parameter["value"] = estimate.value
    equations = tuple(f"{t.location}: {t.sized_effect.effect.equation}" for t in rivals)
    return Formula(
        balance,
        Term.model_validate(tree),
        trial.blocks,
        estimates,
        trial.gain,
        search.threshold(len(trial.blocks)),
        held,
        equations,
    )


@dataclass(frozen=True)
class Trial:
    """Formula that was fitted in the simulator."""

    location: str  # location in the model
    blocks: tuple[Block, ...]  # one or two blocks
    fit: Fit  # fit with the formula as the last effect
    gain: float  # gain in 2 log L over the model without the formula
    sure: float  # gain with parameter tolerances that are :data:`WIDE` times as large

    @property
    def sized_effect(self) -> SizedEffect:
        """Formula with its coefficients, as an effect."""
        return self.fit.effects[-1]

    @property
    def length(self) -> int:
        """Description length."""
        return sum(1 + block.length for block in self.blocks) + (self.location in INDIRECT)


class FormulaSearch:
    """Search of a formula for the residual of a model in balances of given names."""

    def __init__(self, fitter: Fitter, base: Fit, names: Sequence[str]) -> None:
        self.fitter, self.base = fitter, base
        self.screen = Screen(fitter, base)
        balances = fitter.balances
        self.locations = self._distinguishable(locations_of(balances, names))
        self.count = sum(len(self.screen.blocks(location)) for location in self.locations)
        self.samples = sum(fitter.bands.ends) - sum(fitter.bands.starts)
        self._wide = Likelihood(fitter.bands, WIDE * fitter.nuisance)
        self._base_wide = self._score_with_wide_tolerances()
        ship = fitter.trial_ship.with_terms(base.effects)
        units = {name: _unit_in(text) for name, text in TERM_SIGNALS.items() if "[" in text}
        self.units = units | {"drive": ship.prime_mover.demand.unit} | {**ship.signals}
        ids = itertools.chain(["formula"], (f"formula-{k}" for k in itertools.count(2)))
        used = {term.id for term in ship.term}
        self._id = next(name for name in ids if name not in used)
        self._names = [name for name in "abcdefghk" if name not in ship.signals]

    def _distinguishable(self, locations: list[str]) -> list[str]:
        """Return the locations with distinguishable responses; direct locations come first."""
        kept: dict[str, Floats] = {}
        for location in sorted(locations, key=lambda location: location in INDIRECT):
            response = self.screen.unit_response(location)
            if not response.any():
                continue
            response = response / np.linalg.norm(response)
            if all(abs(float(np.sum(response * other))) < ALIKE for other in kept.values()):
                kept[location] = response
        return list(kept)

    def _score_with_wide_tolerances(self) -> float:
        """Return 2 log L of the model with wider parameter tolerances.

        The linear estimate of the parameters is simulated, and the model is linearised there again.
        """
        fitter, base = self.fitter, self.base
        marginal = self._wide(base.difference, base.tolerances / WIDE)
        best: float = marginal.score
        ship = fitter.trial_ship.corrected(base.effects)
        shift = np.zeros(len(marginal.shares))
        for _ in range(NEWLY):
            shift = shift + marginal.shares
            values: dict[str, float] = {}
            for share, move in zip(WIDE * shift, fitter.moves, strict=False):
                for key, change in move.numbers.items():
                    own = values.get(key, ship.parameter(key).value)
                    values[key] = own + share * change / move.share
            is_parameter = [bool(move.numbers) for move in fitter.moves]
            shift[: len(is_parameter)] *= is_parameter
            shift[len(is_parameter) :] = 0.0
            try:
                record = ship.with_values(values).record()
            except ShipError:
                break
            difference = fitter.measured - fitter.predict(record)
            if is_divergent(difference):
                break
            marginal = self._wide(difference)
            # The prior refers to the parameters of the ship file, not to the previous linearisation.
            own_cost, whole = marginal.shares @ marginal.shares, shift + marginal.shares
            best = max(best, float(marginal.score + own_cost - whole @ whole))
        return best

    def threshold(self, blocks: int) -> float:
        """Return the gain that chance does not reach: p ln N + 2 ln K for K formulas with p blocks."""
        tried = math.comb(max(self.count, blocks), blocks)
        return SMALL_SAMPLE * (blocks * math.log(self.samples) + 2.0 * math.log(max(tried, 2)))

    def term(self, location: str, blocks: Sequence[Block]) -> Term:
        """Return a formula as a term with coefficients of 0."""
        names = self._names[: len(blocks)]
        unit = self.units["drive"] if location == "drive" else _unit_in(PLACES[location])
        units = [divide_units(unit, block.unit(self.units)) for block in blocks]
        parameters = {n: {"value": 0.0, "unit": u} for n, u in zip(names, units, strict=True)}
        tree = {"id": self._id, "acts_on": location, "expression": join_blocks(blocks, names)}
        return Term.model_validate(tree | {"parameters": parameters})

    def fit_formula(
        self, location: str, blocks: tuple[Block, ...], start: Sequence[float]
    ) -> Trial | None:
        """Fit the coefficients of a formula in the simulator, as :meth:`fit_term`."""
        return self.fit_term(self.term(location, blocks), blocks, start)

    def fit_term(
        self, term: Term, blocks: tuple[Block, ...], start: Sequence[float]
    ) -> Trial | None:
        """Fit the parameters of a term in the simulator; return None if the simulation diverges.

        The term is 0 if its parameters are 0. It has no blocks if it is not made of blocks.
        """
        balance = balance_of_location(term.acts_on, self.fitter.balances)
        keys = [f"term.{term.id}.{name}" for name in term.parameters]
        parameters = tuple(Parameter(key, (), term=term) for key in keys)
        effect = Effect(term.id, balance, parameters, term.expression, "", "", "", term=term)
        sizes = np.asarray(start, dtype=np.float64)
        for _ in range(4):
            fit = self.fitter.evaluate(self._with(effect, sizes))
            if math.isfinite(fit.score):
                break
            sizes = 0.3 * sizes
        else:
            return None
        for _ in range(STEPS):
            better = self._step(effect, sizes, fit)
            if better is None:
                break
            gain = better[1].score - fit.score
            sizes, fit = better
            if gain < SETTLED:
                break
        sure = self._wide(fit.difference, fit.tolerances / WIDE).score - self._base_wide
        return Trial(term.acts_on, blocks, fit, fit.score - self.base.score, sure)

    def _with(self, effect: Effect, sizes: Any) -> tuple[SizedEffect, ...]:
        """Return the effects of the model and a formula with coefficients."""
        return (*self.base.effects, SizedEffect(effect, tuple(map(float, sizes))))

    def _step(self, effect: Effect, sizes: Any, fit: Fit) -> tuple[Any, Fit] | None:
        """Make a Gauss-Newton step that increases the score; return None if no step does."""
        fitter = self.fitter
        steps = STEP * np.where(sizes == 0.0, 1.0, sizes)
        trials = [self._with(effect, sizes + row) for row in np.diag(steps)]
        records = map(fitter.trial_ship.record, (fit.effects, *trials))
        here, *others = fitter.predictions(list(records))
        changes = [prediction - here for prediction in others]
        columns = np.array([c / step for c, step in zip(changes, steps, strict=True)])
        if not np.isfinite(columns).all():
            return None
        reach = REACH * np.where(sizes == 0.0, 1.0, np.abs(sizes))
        shares = fitter.project_residual(fit, columns * reach[:, None, None]).shares
        step = shares[: len(sizes)] * reach
        for share in (1.0, 0.3, 0.09):
            trial = sizes + share * step
            better = fitter.evaluate(self._with(effect, trial))
            if better.score > fit.score:
                return trial, better
        return None

    def errors(self, fit: Fit, rows: NDArray[np.int64]) -> dict[str, float]:
        """Return the rms error on some rows of each channel, with the fitted nominal parameters."""
        replay = self.fitter.balances.replay
        simulated = replay.simulate_channels(self.fitter.trial_ship.record(fit.effects))
        errors = {c: (replay.measured[c] - x)[rows] for c, x in simulated.items()}
        for share, changes in zip(fit.tolerances, self._changes, strict=False):
            for column, change in changes.items():
                errors[column] = errors[column] - share * change[rows]
        # The error of a diverging formula may overflow to infinity.
        with np.errstate(over="ignore"):
            return {c: float(np.sqrt(np.mean(np.square(x)))) for c, x in errors.items()}

    @functools.cached_property
    def _changes(self) -> list[Channels]:
        """Change of the channels by one standard deviation of each nominal parameter."""
        fitter, replay = self.fitter, self.fitter.balances.replay
        nominal, moves = replay.simulate_channels(fitter.trial_ship.nominal), fitter.moves
        ships = replay.simulate_ships([m.record for m in moves], [m.start for m in moves])
        return [
            {c: (channels[c] - x) / move.share for c, x in nominal.items()}
            for move, channels in zip(moves, ships, strict=True)
        ]

    @functools.cached_property
    def trials(self) -> list[Trial]:
        """Formulas that were fitted in the simulator, by their gain over the threshold, best first."""
        tried: dict[tuple[str, frozenset[Block]], Trial] = {}
        about: Trial | None = None
        for _ in range(ROUNDS):
            for one in self._screened(about):
                key = (one.location, frozenset(one.blocks))
                if key in tried:
                    continue
                trial = self.fit_formula(one.location, one.blocks, one.coefficients)
                if trial is not None:
                    tried[key] = trial
            if not tried:
                break
            best = max(tried.values(), key=self.merit)
            if best is about:
                break
            about = best
        return sorted(tried.values(), key=self.merit, reverse=True)

    def merit(self, trial: Trial) -> float:
        """Return the gain over the threshold."""
        return min(trial.gain, trial.sure) - self.threshold(len(trial.blocks))

    def _screened(self, about: Trial | None) -> Iterator[Screened]:
        """Yield the best formulas by linear regression; pairs only after the first formula is found."""
        screen = self.screen
        fit = self.base if about is None else about.fit
        values = screen.values(fit.effects)
        residual = fit.difference
        if about is not None:
            own = screen.columns(about.location, about.blocks, values)
            residual = residual + np.einsum("k,kmf->mf", np.array(about.sized_effect.values), own)
        singles: list[Screened] = []
        pairs: list[Screened] = []
        for location in self.locations:
            ones, twos = screen.singles_and_pairs(location, residual, fit.weight, values)
            singles += ones
            pairs += twos
        yield from screen.likeliest(singles, residual, fit.tolerances, values)[:SINGLES]
        if about is not None:
            yield from screen.likeliest(pairs, residual, fit.tolerances, values)[:PAIRS]

    def single(self, trial: Trial, block: Block, coefficient: float) -> Trial | None:
        """Refit a formula with only one of its blocks."""
        return self.fit_formula(trial.location, (block,), (coefficient,))


def _unit_in(text: str) -> str:
    """Return the unit in the brackets of a description."""
    return text.split("[")[-1].rstrip("]")
