"""Which of a ship's numbers a recording moves, and which of them the corrected ship carries.

Whether a wrong number of the ship's file explains a difference as well as a named effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import Ship, ShipError
from ..judge.held_out import fits
from ..search.catalogue import Placed
from ..search.fitting import Fit, Fitter
from ..search.selection import TELL_APART, Selection
from .free_parameters import Free, doubtful, number_of
from .start import Start

TOLD = 1.0
"""Standard deviations of a number from which on it is told that it moved."""

CARRIED = 0.5
"""The same from which on the corrected ship may carry it."""

WORSE = 0.05
"""Points of FitPercent that no channel may lose to the numbers that the corrected ship carries."""

FAR_TOLERANCES = 3.0
"""Tolerances beyond which a parameter is far from the ship file."""

FAR = 0.02
"""Share of a number by which it may move before the simulation is made straight anew about it."""

MOST_ROUNDS = 4
"""Of that."""


@dataclass(frozen=True)
class MovedNumber:
    """A number of a ship's file as a diagnosis sees it.

    Args:
        key: dotted key.
        unit: of the number; SI.
        file: value that stands in the ship's file.
        value: with the healthy period and this recording.
        standard_error: of it; NaN where nothing is known of it.
        shifts: standard deviations, as they were known before this recording, by which it moved it.
        source: ``calibrated``, ``free`` (let move widely), or ``tolerance``.
        corrected: value that the corrected ship has.
    """

    key: str
    unit: str
    file: float
    value: float
    standard_error: float
    shifts: float
    source: str
    corrected: float

    @property
    def is_far(self) -> bool:
        """Whether the recording moved the parameter beyond :data:`FAR_TOLERANCES`."""
        return abs(self.shifts) > FAR_TOLERANCES

    @property
    def is_biased(self) -> bool:
        """Whether it is far though the ship file's tolerance should hold it, and was corrected."""
        return self.is_far and self.source == "tolerance" and self.corrected != self.file


class Numbers:
    """The numbers of a ship in one diagnosis.

    Args:
        start: the ship before the diagnosis.
        fitter: of the recording, about that ship or one with other values of its free numbers.
    """

    def __init__(self, start: Start, fitter: Fitter) -> None:
        self.start = start
        self.fitter = fitter
        changes = [item for move in fitter.moves for item in move.numbers.items()]
        self.keys = tuple(dict.fromkeys(key for key, change in changes if change != 0.0))
        # by each of the fitter's regressors, of which some move no number
        self._changes = np.zeros((len(self.keys), len(fitter.nuisance)))
        for k, move in enumerate(fitter.moves):
            self._changes[:, k] = [move.numbers.get(key, 0.0) for key in self.keys]
        self._deviations = np.sqrt(np.sum(self._changes**2, axis=1))

    def values(self, fit: Fit) -> dict[str, float]:
        """Each number as a fit has it, by key, inside the range of the ship's file."""
        found = {}
        for key, change in zip(self.keys, self._changes @ fit.tolerances, strict=True):
            number = self.fitter.trial_ship.ship.number(key)
            value = float(np.clip(number.value + change, *number.searched))
            found[key] = number.info.inside(value)
        return found

    def shifts(self, fit: Fit) -> dict[str, float]:
        """How far each is from where the diagnosis began, in standard deviations."""
        return {
            key: float((value - self.start.ship.number(key).value) / deviation)
            for (key, value), deviation in zip(
                self.values(fit).items(), self._deviations, strict=True
            )
        }

    def relinearised(self) -> Ship | None:
        """The ship with its free numbers where the recording has them without any effect.

        None where they are near enough, or where the simulation does not follow them there.
        """
        own, fit = self.fitter.trial_ship.ship, self.fitter.null
        values = {k: v for k, v in self.values(fit).items() if k in self.start.free}
        if all(abs(v - own.number(k).value) <= FAR * abs(v) for k, v in values.items()):
            return None
        try:
            moved = own.with_values(values)
        except ShipError:
            return None
        return moved if self.fitter.scored(moved.record()).score > fit.score - TELL_APART else None

    def candidates(self, fit: Fit, judge: Callable[[Any], float], rows: Any) -> list[Ship]:
        """Corrected ships of a model: with the numbers that the recording moved, and without.

        Args:
            fit: the model.
            judge: 2 log L of a ship's record on the data set aside.
            rows: that were set aside.
        """
        plain = self.fitter.trial_ship.corrected(fit.effects)
        carried = self.carried(plain, fit, judge, rows)
        return [carried, plain] if carried != plain else [plain]

    def carried(self, corrected: Ship, fit: Fit, judge: Callable[[Any], float], rows: Any) -> Ship:
        """A corrected ship with the numbers as well that the recording moved.

        Only where the data set aside speak for them as clearly as one name must against another, and
        where no channel is followed worse there, open loop.

        Args:
            corrected: with effects.
            fit: of these effects.
            judge: 2 log L of a ship's record on the data set aside.
            rows: that were set aside.
        """
        file = {key: self.start.ship.number(key).value for key in self.start.free}
        plain = corrected.with_values(file) if file else corrected
        values = self.values(fit)
        moved = {
            k: values[k] for k, shift in self.shifts(fit).items()
            if abs(shift) >= CARRIED or k in self.start.free
        }  # fmt: skip
        if not moved:
            return plain
        try:
            other = plain.with_values(moved)
        except ShipError:  # two numbers that do not go together
            return plain
        if judge(other.record()) - judge(plain.record()) <= TELL_APART:
            return plain
        replay = self.fitter.balances.replay
        before, after = (
            fits(replay.recorded, replay.simulated(replay.simulate(ship.record())), rows)
            for ship in (plain, other)
        )
        worse = any(after[channel] < before[channel] - WORSE for channel in before)
        return plain if worse else other

    def told(self, fit: Fit, corrected: Ship) -> list[MovedNumber]:
        """Numbers that were calibrated or free, and those that moved far inside their tolerances.

        Args:
            fit: with the effects that were named.
            corrected: the ship that the diagnosis ends with.
        """
        start, values, shifts = self.start, self.values(fit), self.shifts(fit)
        errors = dict(zip(self.keys, self._errors(fit), strict=True))
        far = [key for key, shift in shifts.items() if abs(shift) >= TOLD]
        found = []
        for key in dict.fromkeys((*start.calibrated, *start.free, *far)):
            file, now = number_of(start.file, key), number_of(corrected, key).value
            value = values.get(key, number_of(start.ship, key).value)
            source = "calibrated" if key in start.calibrated else "tolerance"
            found.append(
                MovedNumber(
                    key, file.info.unit, file.value, value, float(errors.get(key, np.nan)),
                    shifts.get(key, 0.0), "free" if key in start.free else source, now,
                )
            )  # fmt: skip
        return found

    def _errors(self, fit: Fit) -> NDArray[np.float64]:
        """Standard error of each number, the effects beside it unsure as well, in its unit."""
        fitter = self.fitter
        columns = fitter.sensitivities(fit)[1]
        information = fitter.likelihood.information(fit.weight, columns)
        covariance = np.linalg.pinv(information, hermitian=True)[len(columns) :, len(columns) :]
        variances = np.einsum("nk,kl,nl->n", self._changes, covariance, self._changes)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


STEP = 1e-2
"""Share of a number over which its influence is felt."""

MOST_STEPS = 6
"""Of the search for its best value."""

SETTLED = 0.1
"""Gain in 2 log L below which that search ends."""

HOPELESS = 0.5
"""Share of an effect's gain that a number must bring at the first step to be searched further."""


@dataclass(frozen=True)
class WrongNumber:
    """A number of the ship's file that explains a difference as well as a named effect.

    Args:
        key: dotted key.
        file: value in the ship's file.
        value: that would explain the difference, likewise in ``unit``.
        unit: SI.
        gain: in 2 log L, in place of the effect.
    """

    key: str
    file: float
    value: float
    unit: str
    gain: float


def wrong_numbers(fitter: Fitter, selection: Selection) -> list[WrongNumber | None]:
    """For each named effect, the number that in its place does as well; None where there is none.

    A number whose own deviation the ship's file states is not asked: it moves in every model that is
    tried, and a calibrated one was right while the ship was healthy.
    """
    fit = selection.fit
    return [_instead(fitter, fit, i, gain) for i, gain in enumerate(selection.gains)]


def _instead(fitter: Fitter, fit: Fit, index: int, gain: float) -> WrongNumber | None:
    ship = fitter.trial_ship.ship
    rest = fit.effects[:index] + fit.effects[index + 1 :]
    base = fitter.fitted(rest)
    lost = fit.score - base.score
    best: WrongNumber | None = None
    for key in doubtful(ship):
        if key in ship.tolerances.numbers or not ship.has_key(key):
            continue
        value, score = _fitted(fitter, base, rest, key, HOPELESS * lost)
        if fit.score - score < TELL_APART and (
            best is None or gain - fit.score + score > best.gain
        ):
            number = ship.number(key)
            brought = gain - (fit.score - score)
            best = WrongNumber(key, number.value, value, number.info.unit, brought)
    return best


def _fitted(
    fitter: Fitter, base: Fit, rest: tuple[Placed, ...], key: str, least: float
) -> tuple[float, float]:
    """Best value of a number beside some effects, and the score there, by steps of least squares."""
    host = fitter.trial_ship.host(rest)
    number = host.number(key)
    (low,), (high,) = Free(host, (key,)).bounds

    def record(value: float) -> object:
        plant = fitter.trial_ship.record(rest)
        number.write(plant, value)
        return plant

    value, fit = number.value, base
    for step in range(MOST_STEPS):
        size = STEP * abs(value) if value + STEP * abs(value) < high else -STEP * abs(value)
        column = fitter.predicted(record(value + size)) - fitter.predicted(record(value))
        if not np.isfinite(column).all():
            break
        share, _ = fitter.likelihood.amount(fit.weight, fit.difference, column)
        wanted = float(np.clip(value + share * size, low, high))
        found = fitter.scored(record(wanted), rest)
        gained = found.score - fit.score
        if gained > 0.0:
            value, fit = wanted, found
        if gained < SETTLED or (step == 0 and fit.score - base.score < least):
            break
    return value, fit.score
