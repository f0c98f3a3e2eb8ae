"""Search over effects and parameters together: a beam of models, each refitted as a whole.

A quick pass searches the richest model, because the noise spectrum and the outliers cannot be estimated
from a model that lacks an effect. The thorough pass starts again with this noise model. From each model
of its beam it tries the effects, and the pairs of effects, with the largest predicted gain. Each trial
is fitted with all other values free, first with the derivatives of the beam's model, which needs few
simulations; the best trials are fitted to convergence. Effects of the best models are then left out,
exchanged, or tried in other forms.

Screening predicts the gain. Each effect is simulated at its probes on the refitted model, its change of
the channels is whitened, and the part that the model's free values can absorb is projected out (score
test, Rao 1948). Screening determines the order of the trials; it rejects no effect. Of the fitted
models, the likeliest is chosen whose effects all improve the fit enough.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..estimate import Tick, ignore_progress
from ..judge.verdict import FORM_SHARE, parameter_at_bound
from ..search.catalogue import Effect, SizedEffect
from ..search.selection import threshold
from ..simulate.joint_replay import Floats, map_threaded
from .model import Model
from .noise_model import OUTLIER, deviations
from .output_error import OutputError

TIED = 10.0
"""2 log L below which the number of departures from the ship file, and then the order of the catalogue,
decide between models (Kass and Raftery 1995)."""

FINALISTS = 24
"""Number of models that are compared, the best first."""

VETO = 1.5
"""Times the least held-out rms error from which on a model is not chosen, however likely it is."""

NO_WORSE = 1.05
"""Largest held-out rms error as a multiple of the ship file's, or of the chosen model's."""

BETTER = 0.95
"""Largest held-out error with effects as a share of that with refitted parameters alone."""

NEARLY = 0.95
"""Share of the best model's gain in 2 log L from which a model that is as close to the held-out data is
an alternative, because approximate forms of models make differences of log L appear too certain."""

PAIRED = 14
"""Number of effects, the best first, from which pairs are formed."""

IDLE = 0.5
"""Predicted gain in 2 log L below which an effect is not tried."""

EXCHANGED = 4
"""Number of effects tried in place of one effect of a model."""

VARIED = 2
"""Number of the best models of a round whose effects are left out, exchanged, or take other forms."""

FITTED = 6
"""Number of models of a round, the best first, that are fitted with their own derivatives."""

POLISHED, WITHIN = 8, 100.0
"""Number of the best models that are fitted to convergence, and their distance in 2 log L."""

FROM_FAR = 3
"""Number of the best models of a round that are also fitted from parameters far from the file."""

MOST_EFFECTS = 3
"""Largest number of effects of a model by default."""


class Effort(NamedTuple):
    """Number of trials of a pass from each model of its beam."""

    kinds: int  # kinds of effects
    starts: int  # starting values of each kind
    pairs: int  # pairs of effects
    beam: int  # models that are kept


QUICK = Effort(kinds=4, starts=1, pairs=2, beam=1)
THOROUGH = Effort(kinds=8, starts=2, pairs=4, beam=3)
NEARBY = Effort(kinds=8, starts=1, pairs=0, beam=1)
"""Efforts of the quick and the thorough pass, and from a model held near the file."""


@dataclass(frozen=True)
class Screened:
    """Effect with the gain that a linearisation predicts."""

    effect: Effect  # entry of the catalogue
    starts: tuple[tuple[float, SizedEffect], ...]  # probes with predicted gains, best first
    response: Floats  # whitened change by the best probe, orthogonal to all free values

    @property
    def gain(self) -> float:
        """Predicted gain of the best probe, in 2 log L."""
        return self.starts[0][0]


class Base:
    """Fitted model with its derivatives, for the screening of effects.

    Attributes:
        tangent: derivatives by parameters and nuisance values, as :meth:`OutputError.fit` takes them.
    """

    def __init__(self, problem: OutputError, model: Model) -> None:
        self._problem, self.model = problem, model
        columns, search = problem.derivatives(model)
        self.tangent = columns[: search.edge]
        white = problem.likelihood.white(problem.residual(model))
        self._scale = problem.likelihood.scale(white)
        flat = (columns * self._scale).reshape(len(columns), -1)
        precision = search.precision(search.start, False)
        held = np.flatnonzero(np.diag(precision))  # values of effects have no prior
        root = np.zeros_like(precision)
        root[np.ix_(held, held)] = np.linalg.cholesky(precision[np.ix_(held, held)])
        whole = np.hstack([flat, root])
        self._basis = np.linalg.qr(whole.T)[0]
        # An effect also gains what the parameters cost that have taken its place.
        moved = np.zeros(len(root))
        moved[: len(model.shifts)] = model.shifts
        self._left = self._project(white, -root.T @ moved)

    def screen(self, effects: Iterable[Effect]) -> list[Screened]:
        """Return the effects of a catalogue that the model has in no form, the largest gain first."""
        problem, model = self._problem, self.model
        here, _ = problem.channels(model.effects, model.shifts, model.nuisance)
        others = [effect for effect in effects if effect.kind not in model.kinds]
        trials = [t for effect in others for t in problem.trial_ship.trials(effect, [])]

        def change(trial: SizedEffect) -> Floats:
            there, _ = problem.channels((*model.effects, trial), model.shifts, model.nuisance)
            return self._project(problem.likelihood.white((there - here)[:, problem.rows]))

        starts: dict[str, list[tuple[float, SizedEffect]]] = {}
        best: dict[str, Floats] = {}
        for trial, response in zip(trials, map_threaded(change, trials), strict=True):
            power = float(response @ response)
            if not math.isfinite(power) or power < 1e-12:
                continue
            along, own = float(self._left @ response), starts.setdefault(trial.effect.label, [])
            predicted = along**2 / power if along > 0.0 else 0.0
            gain = max(predicted, 2.0 * along - power)
            if all(gain > other for other, _ in own):
                best[trial.effect.label] = response
            own.append((gain, trial))
        screened = []
        for label, own in starts.items():
            own.sort(key=lambda start: -start[0])
            screened.append(Screened(own[0][1].effect, tuple(own), best[label]))
        return sorted((one for one in screened if one.gain > IDLE), key=lambda one: -one.gain)

    def pairs(self, screened: list[Screened]) -> list[tuple[SizedEffect, SizedEffect]]:
        """Return pairs of the first :data:`PAIRED` effects, the largest predicted gain first."""
        ranked = []
        for one, other in itertools.combinations(screened[:PAIRED], 2):
            if one.effect.kind == other.effect.kind:
                continue
            both = np.array([one.response, other.response])
            lhs, rhs = both @ both.T, both @ self._left
            size = np.linalg.lstsq(lhs, rhs, rcond=1e-9)[0]
            if np.all(size > 0.0):
                ranked.append((float(size @ rhs), one.starts[0][1], other.starts[0][1]))
        ranked.sort(key=lambda pair: -pair[0])
        return [(one, other) for _, one, other in ranked]

    def _project(self, white: Floats, prior: Floats | None = None) -> Floats:
        """Return whitened channels, scaled to variance 1, without the part that the free values absorb.

        The shape (channels, values) becomes (channels x values + free values,). The last part are the
        distances of free values from their priors, in standard deviations; 0 by default.
        """
        flat = (white * self._scale).ravel()
        rest = np.zeros(self._basis.shape[1]) if prior is None else prior
        long = np.concatenate([flat, rest])
        return np.asarray(long - self._basis @ (self._basis.T @ long))


Pool = dict[frozenset[str], Model]
"""Fitted models by the labels of their effects."""

Trials = list[tuple[Base, tuple[SizedEffect, ...]]]
"""Models from which a fit starts, with the effects to be fitted."""


class StructureSearch:
    """Search over effects and parameters together.

    Args:
        problem: output-error problem.
        effects: candidate effects; those that act for a limited time are ignored.
        tick: progress callback ``tick(stage, done, total)``.
        most: largest number of effects of a model.
        suggested: effects of a model that is fitted and ranked as well.

    Attributes:
        limit: residual by channel at which held-out rows are clipped, in the channels' units.
    """

    def __init__(
        self,
        problem: OutputError,
        effects: list[Effect],
        tick: Tick = ignore_progress,
        most: int | None = None,
        suggested: tuple[SizedEffect, ...] = (),
    ) -> None:
        self._most = MOST_EFFECTS if most is None else most
        self.problem = problem
        self.effects = [effect for effect in effects if not effect.windowed]
        self.tick = tick
        self.pool: Pool = {}
        self._suggested = suggested
        self._quick: list[Model] = []
        self._screened: dict[frozenset[str], list[Screened]] = {}  # of models by labels, best first
        self.limit = np.full(len(problem.names), math.inf)

    def search(self) -> list[Ranked]:
        """Return all fitted models, the best first."""
        richest = max(self.quick_pass(), key=_score)
        self.limit = OUTLIER * deviations(self.problem.residual(richest))
        self.problem.likelihood.set_noise(self.problem.residual(richest))
        self.pool = self._pass(THOROUGH, "searching physics and parameters together")
        best = _best(self.pool, self.merit, POLISHED)
        best = [model for model in best if self.merit(model) > self.merit(best[0]) - WITHIN]
        for model in self._counted("fitting the best models to convergence", best, set()):
            self._polish(model)
        return [self.rank(model) for model in _best(self.pool, self.merit)]

    def rank(self, model: Model) -> Ranked:
        """Return a fitted model with the measures by which it is ranked."""
        residual = self.problem.held_residual(model)
        ship, likelihood = self.problem.trial_ship, self.problem.likelihood
        errors = likelihood.rms(residual), likelihood.rms(residual, self.limit)
        gain = likelihood.held(residual, self.limit)
        order = {effect.label: k for k, effect in enumerate(self.effects)}
        place = sum(order[label] for label in model.labels)
        at_bound = any(parameter_at_bound(ship, sized) for sized in model.effects)
        departures = len(model.effects) + len(self.problem.far_parameters(model))
        return Ranked(model, self.merit(model), *errors, gain, departures, place, at_bound)

    def prune(self, best: Ranked) -> Ranked:
        """Return a model without the effects that do not pay after a fit of the others."""
        fits = map(self.problem.fit_from_far, self.without_each(best.model))
        part = max(map(self.rank, fits), key=lambda one: one.evidence, default=best)
        return self.prune(part) if part.evidence > best.evidence else best

    def without_each(self, model: Model) -> list[Model]:
        """Return a model without each of its effects, fitted again."""
        effects = model.effects
        rests = [effects[:k] + effects[k + 1 :] for k in range(len(effects))]
        return [self.problem.fit(rest, model) for rest in rests]

    def alternatives(self, best: Ranked, rests: list[Model]) -> list[Ranked]:
        """Return models of no more values, with another effect in place of one, that are as likely.

        Args:
            best: model.
            rests: results of :meth:`without_each`.
        """
        found = []
        for which, (rest, own) in enumerate(zip(rests, best.model.effects, strict=True)):
            # The search screened from other parameters where these were replaced since.
            others = [one for one in self.screen(rest) if one.effect.kind != own.effect.kind]
            for start in _starts(others)[:EXCHANGED]:
                effects = start.replace_in(best.model.effects, which)
                found.append(self.rank(self.problem.fit(effects, rest)))
        return [
            one
            for one in found
            if one.evidence > best.evidence - TIED
            and one.model.size <= best.model.size
            and not one.at_bound
        ]

    def without_weakest(self, model: Model, rests: list[Model]) -> Model | None:
        """Return the model without its weakest effect; None if each effect is significant.

        An effect is significant if its gain on the fitted rows reaches its threshold. The gain on the
        held-out rows does not count, because a slow disturbance in them may look like an effect.

        Args:
            model: fitted model.
            rests: results of :meth:`without_each`.
        """
        shares = [
            (model.score - rest.score) / self.threshold(sized.effect)
            for sized, rest in zip(model.effects, rests, strict=True)
        ]
        least = min(shares, default=math.inf)
        return rests[shares.index(least)] if least < 1.0 else None

    def quick_pass(self) -> list[Model]:
        """Return the models of the quick pass, which searches the richest model; it is run once."""
        if not self._quick:
            self._quick = [*self._pass(QUICK, "searching the richest model").values()]
        return self._quick

    def screen(self, base: Model) -> list[Screened]:
        """Return the effects that a model lacks by their predicted gain, the best first."""
        return Base(self.problem, base).screen(self.effects)

    def threshold(self, effect: Effect) -> float:
        """Return the least gain of an effect in 2 log L."""
        return threshold(effect, len(self.effects))

    def price(self, effects: tuple[SizedEffect, ...]) -> float:
        """Return the least gain of effects together in 2 log L, including the size of the search."""
        count = len({effect.kind for effect in self.effects})
        ways = math.log(math.comb(count, min(len(effects), count))) if effects else 0.0
        return 2.0 * ways + sum(self.threshold(p.effect) for p in effects)

    def merit(self, model: Model) -> float:
        """Return a model's 2 log L less the price of its effects."""
        return model.score - self.price(model.effects)

    def _pass(self, effort: Effort, stage: str) -> Pool:
        """Return the models of a pass; one with a single model in its beam ignores the tolerances."""
        problem, guessed = self.problem, effort.beam == 1
        worth = _score if guessed else self.merit
        self._screened.clear()
        first = problem.fit((), problem.file_model(), guessed)
        if not guessed:
            first = problem.fit_from_far(first)
        pool = {first.labels: first}
        if not guessed and self._suggested:
            self._keep(pool, problem.fit(self._suggested, first))
        beam, whole, far = [first], {first.labels}, {first.labels}
        varied: set[frozenset[str]] = set()
        for depth in range(self._most):
            before = max(map(worth, pool.values()))
            trials, now = self._trials(beam, effort), f"{stage}, round {depth + 1}"
            for done, (base, effects) in enumerate(trials):
                self.tick(now, done, len(trials))
                self._keep(pool, problem.fit(effects, base.model, guessed, base.tangent))
            self.tick(now, len(trials), len(trials))
            for model in self._counted(f"{now}, best models", _best(pool, worth, FITTED), whole):
                self._keep(pool, problem.fit(model.effects, model, guessed))
            if not guessed:
                best = _best(pool, worth, FROM_FAR)
                for model in self._counted(f"{now}, other parameters", best, far):
                    self._keep(pool, problem.fit_from_far(model))
                self._vary(pool, varied, f"{now}, other effects")
            beam = _best(pool, worth, effort.beam)
            if worth(beam[0]) <= before:
                break
        return pool

    def _counted(
        self, stage: str, models: list[Model], finished: set[frozenset[str]]
    ) -> Iterator[Model]:
        """Yield the models whose labels are not among the finished ones, with progress; add them."""
        missing = [model for model in models if model.labels not in finished]
        for done, model in enumerate(missing):
            self.tick(stage, done, len(missing))
            finished.add(model.labels)
            yield model
        self.tick(stage, len(missing), len(missing))

    @staticmethod
    def _keep(pool: Pool, model: Model) -> None:
        """Keep a model if it is the best fit with its effects."""
        known = pool.get(model.labels)
        if math.isfinite(model.score) and (known is None or model.score > known.score):
            pool[model.labels] = model

    def _polish(self, model: Model) -> None:
        """Fit a model to convergence, from parameters far from the file as well."""
        for _ in range(3):
            further = self.problem.fit_from_far(self.problem.fit(model.effects, model))
            gained, model = further.score - model.score, further
            if gained < 0.1:
                break
        self.pool[model.labels] = model

    def _vary(self, pool: Pool, varied: set[frozenset[str]], stage: str) -> None:
        """Add the best models with one effect left out, in another form, or exchanged, to the pool."""
        best = [model for model in _best(pool, self.merit, VARIED) if model.effects]
        for model in self._counted(stage, best, varied):
            tangent = Base(self.problem, model).tangent
            for which in range(len(model.effects)):
                rest = model.effects[:which] + model.effects[which + 1 :]
                begin = self.problem.fit(rest, model, tangent=tangent)
                self._keep(pool, begin)
                for start in self._in_place(begin, model.effects[which]):
                    effects = start.replace_in(model.effects, which)
                    labels = frozenset(sized.effect.label for sized in effects)
                    if labels not in pool:
                        self._keep(pool, self.problem.fit(effects, begin, tangent=tangent))

    def _in_place(self, rest: Model, own: SizedEffect) -> list[SizedEffect]:
        """Return candidates in place of an effect that a model lacks: its other forms, other effects."""
        if not math.isfinite(rest.score):
            return []
        if rest.labels not in self._screened:
            self._screened[rest.labels] = Base(self.problem, rest).screen(self.effects)
        screened = self._screened[rest.labels]
        forms = [one.starts[0][1] for one in screened if one.effect.kind == own.effect.kind]
        others = [one for one in screened if one.effect.kind != own.effect.kind]
        return [*forms, *_starts(others)[:EXCHANGED]]

    def _trials(self, beam: list[Model], effort: Effort) -> Trials:
        """Return models to fit, from each model of the beam.

        Parameters far from the file may have absorbed an effect; effects are then also tried on the
        model with its parameters near the file.
        """
        trials: Trials = []
        for model in (model for model in beam if len(model.effects) < self._most):
            trials += self._upon(Base(self.problem, model), effort)
            if effort.beam > 1 and self.problem.far_parameters(model):
                trials += self._upon(Base(self.problem, self.problem.fit_near_file(model)), NEARBY)
        return trials

    def _upon(self, base: Base, effort: Effort) -> Trials:
        """Return a model with each effect, and each pair of effects, that has a large predicted gain."""
        trials: Trials = []
        own, screened = base.model.effects, base.screen(self.effects)
        self._screened[base.model.labels] = screened
        kinds: Counter[tuple[str, str]] = Counter()
        for one in screened:
            kind = one.effect.kind
            if kinds[kind] < effort.starts and (kind in kinds or len(kinds) < effort.kinds):
                kinds[kind] += 1
                trials += [(base, (*own, start)) for _, start in one.starts[: effort.starts]]
        if len(own) + 2 <= self._most:
            trials += [(base, (*own, *pair)) for pair in base.pairs(screened)[: effort.pairs]]
        return trials


def _best(pool: Pool, worth: Callable[[Model], float], count: int | None = None) -> list[Model]:
    """Return the best models, all by default, the best first."""
    return sorted(pool.values(), key=worth, reverse=True)[:count]


def _score(model: Model) -> float:
    return model.score


def _starts(screened: list[Screened]) -> list[SizedEffect]:
    """Return the best start of the best form of each kind of effect, the best first."""
    starts: dict[tuple[str, str], SizedEffect] = {}
    for one in screened:
        starts.setdefault(one.effect.kind, one.starts[0][1])
    return list(starts.values())


@dataclass(frozen=True)
class Ranked:
    """Fitted model with the measures by which it is ranked."""

    model: Model  # fitted model
    merit: float  # 2 log L on the fitted data less the price of its effects and of the search
    held: Floats  # rms error on the held-out data by channel, in the channels' units
    compared: Floats  # rms error on the held-out data with clipped outliers, likewise
    likelihood: float = 0.0  # 2 log L of the held-out data with the noise model
    departures: int = 0  # number of its effects and of its parameters far from the ship file
    place: int = 0  # sum of the positions of its effects in the catalogue
    at_bound: bool = False  # whether a value of an effect is at the bound of its search

    @property
    def evidence(self) -> float:
        """2 log L of all data less the price."""
        return self.merit + self.likelihood


def choose(
    ranked: list[Ranked], before: Floats, noise: Floats | float = math.inf
) -> tuple[Ranked, list[Ranked]]:
    """Return the likeliest model whose effects all pay, and the models that are as good.

    Of models that are as likely, that with the fewest effects and parameters far from the ship file is
    chosen. Models with a value at the bound of its search are chosen only if there are no others.

    Args:
        ranked: models by merit, the best first.
        before: held-out rms error of the ship file by channel, in the channels' units. A model with a
            larger error in a channel is not chosen.
        noise: held-out rms error by channel up to which it is noise. Where the chosen model leaves more,
            a model that is nearly as likely is an alternative.

    Returns:
        The model; and the models of no more values that the recordings cannot distinguish from it: as
        likely, or nearly so with no larger held-out error, or likelier with a clearly larger one.
    """
    runners = sorted(ranked, key=lambda one: one.evidence, reverse=True)
    runners = [one for one in runners if np.isfinite(one.evidence)] or ranked
    runners = [one for one in runners if _pays(one, ranked)][:FINALISTS] or runners[:1]
    runners = [one for one in runners if not one.at_bound] or runners
    runners = [one for one in runners if np.all(one.held <= NO_WORSE * before)] or runners
    errors = [total(one.compared, runners[0].compared) for one in runners]
    limit = VETO * min(errors)
    held = [one for one, error in zip(runners, errors, strict=True) if error <= limit]
    top = max(one.evidence for one in held)
    tied = (one for one in held if one.evidence > top - TIED)
    best = min(tied, key=lambda one: (one.departures, one.place))
    vetoed = [one for one in runners if one not in held and one.evidence > top]
    leaves_more = bool(np.any(best.held > noise))
    plain = next((one.evidence for one in ranked if not one.model.labels), top)

    def is_alternative(one: Ranked) -> bool:
        """Whether a model is as likely as the best, or nearly so and as close to the held-out data."""
        nearly = leaves_more and one.evidence - plain >= NEARLY * (top - plain)
        close = total(one.compared, best.compared) <= NO_WORSE
        return one.evidence > top - TIED or (nearly and close)

    others = [*(one for one in held if is_alternative(one)), *vetoed]
    return best, [o for o in others if o is not best and o.model.size <= best.model.size]


def parameters_alone(best: Ranked, ranked: list[Ranked], price: float) -> Ranked | None:
    """Return the model without effects in place of the best one, if it is as good.

    It is as good if the effects neither reduce the held-out error to :data:`BETTER` of its own nor
    increase 2 log L of the held-out data by their price, that is, its likelihood does not confirm them.
    It is not if more of its parameters are far from the ship file than the best model has effects and
    far parameters.

    Args:
        best: best model.
        ranked: all models.
        price: price of the best model's effects in 2 log L, from :meth:`StructureSearch.price`.
    """
    plain = next(one for one in ranked if not one.model.labels)
    more = plain.departures > best.departures
    confirmed = best.likelihood - plain.likelihood >= price
    if not best.model.labels or more or confirmed or total(best.held, plain.held) <= BETTER:
        return None
    return plain


def _pays(one: Ranked, ranked: list[Ranked]) -> bool:
    """Return whether all effects of a model pay: no part of them is nearly as good as the whole.

    A part is a model with some of the effects, or with the same effects in forms of fewer values. The
    approximate forms of its effects leave :data:`FORM_SHARE` squared of their gain, which is no evidence
    of a further effect.
    """
    plain = min((o for o in ranked if not o.model.labels), key=lambda o: o.merit, default=None)
    for other in ranked:
        part = other.model.labels < one.model.labels
        if part or (other.model.kinds == one.model.kinds and other.model.size < one.model.size):
            gained = other.evidence - plain.evidence if plain is not None else 0.0
            if one.evidence <= other.evidence + FORM_SHARE**2 * max(gained, 0.0):
                return False
    return True


def total(held: Floats, best: Floats) -> float:
    """Return the geometric mean over the channels of held-out errors relative to the best errors."""
    return float(np.exp(np.mean(np.log(held / best)))) if np.isfinite(held).all() else math.inf
