"""Parameters of the ship in a diagnosis: its start, their estimates and changes, and biased parameters.

A diagnosis starts with calibrated and with free parameters, and its parameters move within their
tolerances. A parameter whose bias explains a difference as well as an effect is reported with it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...core.statistics import covariance_of
from ...plant.keys import ShipParameter
from ...plant.ship import Ship, ShipError
from ..judge.held_out import fit_percents
from ..recordings.steady_rows import drive_by_shaft_speed
from ..search.catalogue import SizedEffect
from ..search.fitting import Fit, Fitter
from ..search.selection import INDISTINGUISHABLE, Selection
from ..simulate.joint_replay import map_threaded
from .free_parameters import Free, doubtful, number_of

Array = NDArray[np.float64]

WIDE = 0.3  # standard deviation of a free parameter, as a share of its value
REPORTED = 1.0  # tolerances from which a change of a parameter is reported
CORRECTED = 0.5  # tolerances from which the corrected ship may have the changed value
WORSE = 0.05  # largest loss of a channel in points of FitPercent by the changed parameters
FAR_TOLERANCES = 3.0  # tolerances beyond which a parameter is far from the ship file
NEAR_ENOUGH = 0.02  # relative change up to which the simulation is not linearised again
MOST_LINEARISATIONS = 4
STEP = 1e-2  # relative finite difference of a parameter
MOST_STEPS = 6  # of the search for a biased parameter
SETTLED = 0.1  # gain in 2 log L below which the search ends
HOPELESS = 0.5  # share of an effect's gain that the first step of a search must reach


@dataclass(frozen=True)
class Start:
    """A ship at the start of a diagnosis.

    Args:
        file: ship with the values of its file.
        ship: ship with the calibrated parameters and with all tolerances.
        calibrated: keys of the parameters that were estimated from a reference period.
        free: keys of the parameters that are free in the diagnosis itself.
        left_out: why a parameter was not calibrated, by key.
        remarks: remarks on the calibration, a sentence each.
    """

    file: Ship
    ship: Ship
    calibrated: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def start_at_recorded_speed(start: Start) -> Start:
    """Return the start with the recorded shaft speed in place of the prime mover of the ship file."""
    calibrated = tuple(key for key in start.calibrated if not key.startswith("prime_mover."))
    file, ship = drive_by_shaft_speed(start.file), drive_by_shaft_speed(start.ship)
    return replace(start, file=file, ship=ship, calibrated=calibrated)


def check_free_parameters(ship: Ship, keys: Sequence[str], calibrated: bool) -> None:
    """Refuse parameters that cannot be estimated.

    Args:
        ship: nominal ship.
        keys: dotted keys of the free parameters, possibly none.
        calibrated: whether they are estimated from a reference period.

    Raises:
        ValueError: a key that is no parameter of this ship or is given twice; without a reference
            period also a parameter that is 0, or that the ship record holds in another form.
    """
    if not keys:
        return
    free = Free(ship, keys)
    if calibrated:
        return
    for number in free.numbers:
        if not number.field:
            raise ValueError(
                f"{ship.name}: {number.key} cannot be estimated together with effects; estimate it from "
                "a reference period (--calibrate)"
            )
        if number.value == 0.0 and not ship.tolerances.numbers.get(number.key):
            raise ValueError(
                f"{ship.name}: {number.key} is 0, so a relative tolerance is not possible; give its "
                f"standard deviation [{number.info.unit}] under [tolerances.numbers]"
            )


def start_with_free_parameters(ship: Ship, keys: Sequence[str]) -> Start:
    """Return a start whose free parameters have a tolerance of at least :data:`WIDE`."""
    if not keys:
        return Start(ship, ship)
    return Start(ship, widen_tolerances(ship, Free(ship, keys).numbers, WIDE), free=tuple(keys))


def widen_tolerances(ship: Ship, numbers: Iterable[ShipParameter], share: float) -> Ship:
    """Return a ship whose parameters have at least a tolerance, given as a share of each value [-]."""
    known = ship.tolerances.numbers
    wide = {n.key: max(share * abs(n.value), known.get(n.key, 0.0)) for n in numbers}
    return ship.with_values({"tolerances.numbers": known | wide}) if wide else ship


@dataclass(frozen=True)
class MethodResult:
    """Estimates of a method of identification.

    Args:
        keys: dotted keys of n parameters.
        values: estimates, each in its key's unit.
        covariance: covariance of the estimates, shape (n, n), in these units.
        tables: intermediate results by file name without extension: states, frequency responses, steps
            of the search.
        remarks: remarks on the estimates, a sentence each.
        score: 2 log L; 0 if the method has none.
        line: whether the commands were interpolated linearly between rows; otherwise they were held.
        freedom: degrees of freedom of each variance [-], shape (n,); None for infinitely many.
        joint: these estimates together with those of the parameters that moved within their tolerances;
            None if the method has none.

    >>> found = MethodResult(("a.b", "a.c"), (1.0, 2.0), np.array([[0.04, 0.0], [0.0, 0.09]]))
    >>> found.standard_errors
    array([0.2, 0.3])
    """

    keys: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Array
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    score: float = 0.0
    line: bool = False
    freedom: Array | None = None
    joint: MethodResult | None = None

    @property
    def standard_errors(self) -> Array:
        """Standard error of each estimate, in its key's unit."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def degrees(self) -> Array:
        """Degrees of freedom of each variance [-]; infinite without ``freedom``."""
        return np.full(len(self.keys), np.inf) if self.freedom is None else self.freedom

    def mix_with(self, other: MethodResult, share: float) -> MethodResult:
        """Return these estimates with the uncertainty that another model of the data is the true one.

        The covariance is that of the mixture of both models about these estimates; ``share`` is the
        probability of the other model [-].
        """
        if not share > 0.0:
            return self
        apart = np.array(other.values) - np.array(self.values)
        there = other.covariance + np.outer(apart, apart)
        joint = self.joint and other.joint and self.joint.mix_with(other.joint, share)
        mixed = (1.0 - share) * self.covariance + share * there
        return replace(self, covariance=mixed, joint=joint)

    def with_tolerances(self) -> MethodResult:
        """Return the joint estimates, with the standard errors of these ones where they differ."""
        if self.joint is None:
            return self
        count = len(self.keys)
        before = self.joint.standard_errors
        scale = np.ones(len(before))
        scale[:count] = self.standard_errors / np.maximum(before[:count], 1e-300)
        return replace(self.joint, covariance=self.joint.covariance * np.outer(scale, scale))

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, shape (n, n)."""
        scale = np.where(self.standard_errors > 0.0, self.standard_errors, 1.0)
        return np.asarray(self.covariance / np.outer(scale, scale))


@dataclass(frozen=True)
class ParameterChange:
    """Change of a parameter by a diagnosis.

    Args:
        key: dotted key.
        unit: SI unit of the key.
        file: value in the ship file, in ``unit``.
        value: estimate from the reference period and this recording, in ``unit``.
        standard_error: standard error of the estimate, in ``unit``; NaN if it is unknown.
        shifts: change by this recording, in tolerances (standard deviations known beforehand).
        source: ``calibrated``, ``free`` or ``tolerance``.
        corrected: value in the corrected ship, in ``unit``.

    >>> key = "hull.resistance_coefficient_N_s2_m2"
    >>> ParameterChange(key, "N s2/m2", 3306.2, 3960.0, 40.0, 4.9, "tolerance", 3960.0).is_biased
    True
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
        """Whether a corrected parameter is far from the ship file although it was not free."""
        return self.is_far and self.source == "tolerance" and self.corrected != self.file


class MovableParameters:
    """Parameters of a ship that may move within their tolerances in a diagnosis.

    Args:
        start: ship at the start of the diagnosis.
        fitter: fitter of the recording, linearised at that ship or at other values of its parameters.
    """

    def __init__(self, start: Start, fitter: Fitter) -> None:
        self.start, self.fitter = start, fitter
        changes = [item for move in fitter.moves for item in move.numbers.items()]
        self.keys = tuple(dict.fromkeys(key for key, change in changes if change != 0.0))
        # One column for each regressor of the fitter; some regressors change no parameter.
        self._changes = np.zeros((len(self.keys), len(fitter.nuisance)))
        for k, move in enumerate(fitter.moves):
            self._changes[:, k] = [move.numbers.get(key, 0.0) for key in self.keys]
        self._deviations = np.sqrt(np.sum(self._changes**2, axis=1))

    def values(self, fit: Fit) -> dict[str, float]:
        """Return the parameters of a fit by key, inside the ranges that a ship file allows."""
        found = {}
        for key, change in zip(self.keys, self._changes @ fit.tolerances, strict=True):
            number = self.fitter.trial_ship.ship.parameter(key)
            found[key] = number.clipped(number.value + float(change))
        return found

    def shifts(self, fit: Fit) -> dict[str, float]:
        """Return the change of each parameter since the start of the diagnosis, in tolerances."""
        pairs = zip(self.values(fit).items(), self._deviations, strict=True)
        before = self.start.ship.parameter
        return {key: float((value - before(key).value) / size) for (key, value), size in pairs}

    def relinearised_ship(self) -> Ship | None:
        """Return the ship with the free parameters as fitted without effects.

        None where they are within :data:`NEAR_ENOUGH`, or where the nonlinear simulation fits worse
        with them.
        """
        own, fit = self.fitter.trial_ship.ship, self.fitter.null
        values = {k: v for k, v in self.values(fit).items() if k in self.start.free}
        if all(abs(v - own.parameter(k).value) <= NEAR_ENOUGH * abs(v) for k, v in values.items()):
            return None
        try:
            moved = own.with_values(values)
        except ShipError:
            return None
        score = self.fitter.evaluate_record(moved.record()).score
        return moved if score > fit.score - INDISTINGUISHABLE else None

    def corrected_ships(self, fit: Fit, judge: Callable[[Any], float], rows: Any) -> list[Ship]:
        """Return the ships with the effects of a fit: with changed parameters if they hold, and without.

        The arguments are those of :meth:`with_estimates`.
        """
        plain = self.fitter.trial_ship.corrected(fit.effects)
        changed = self.with_estimates(plain, fit, judge, rows)
        return [changed, plain] if changed != plain else [plain]

    def with_estimates(
        self, corrected: Ship, fit: Fit, judge: Callable[[Any], float], rows: Any
    ) -> Ship:
        """Return a corrected ship with the parameters that the recording changes.

        The parameters are kept only if they are clearly likelier on the held-out data and if no channel
        has a lower FitPercent there in open loop.

        Args:
            corrected: ship with the effects.
            fit: fit of these effects.
            judge: function that returns 2 log L of a ship's record on the held-out data.
            rows: held-out rows.
        """
        free = self.start.free
        file = {key: self.start.ship.parameter(key).value for key in free}
        plain = corrected.with_values(file) if file else corrected
        values, shifts = self.values(fit), self.shifts(fit)
        moved = {k: v for k, v in values.items() if abs(shifts[k]) >= CORRECTED or k in free}
        if not moved:
            return plain
        try:
            other = plain.with_values(moved)
        except ShipError:  # The ship file does not allow this combination of values.
            return plain
        if judge(other.record()) - judge(plain.record()) <= INDISTINGUISHABLE:
            return plain
        replay = self.fitter.balances.replay
        before, after = (
            fit_percents(replay.recorded, replay.simulate_channels(ship.record()), rows)
            for ship in (plain, other)
        )
        worse = any(after[channel] < before[channel] - WORSE for channel in before)
        return plain if worse else other

    def changes(self, fit: Fit, corrected: Ship) -> list[ParameterChange]:
        """Return the changes of calibrated and free parameters, and changes of a tolerance or more."""
        start, values, shifts = self.start, self.values(fit), self.shifts(fit)
        errors = dict(zip(self.keys, map(float, self._errors(fit)), strict=True))
        far = [key for key, shift in shifts.items() if abs(shift) >= REPORTED]
        found = []
        for key in dict.fromkeys((*start.calibrated, *start.free, *far)):
            file, now = number_of(start.file, key), number_of(corrected, key).value
            value = values.get(key, number_of(start.ship, key).value)
            error, shift = errors.get(key, np.nan), shifts.get(key, 0.0)
            source = "calibrated" if key in start.calibrated else "tolerance"
            source = "free" if key in start.free else source
            unit = file.info.unit
            found.append(ParameterChange(key, unit, file.value, value, error, shift, source, now))
        return found

    def _errors(self, fit: Fit) -> Array:
        """Return the standard error of each parameter in its unit, with uncertain effects."""
        fitter = self.fitter
        columns = fitter.sensitivities(fit)[1]
        information = fitter.likelihood.information(fit.weight, columns)
        covariance = covariance_of(information)[len(columns) :, len(columns) :]
        variances = np.einsum("nk,kl,nl->n", self._changes, covariance, self._changes)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


@dataclass(frozen=True)
class BiasedParameter:
    """Parameter of the ship file whose bias explains a difference as well as an identified effect.

    Args:
        key: dotted key.
        file: value in the ship file, in ``unit``.
        value: value that would explain the difference, in ``unit``.
        unit: SI unit of the key.
        gain: gain in 2 log L in place of the effect.
    """

    key: str
    file: float
    value: float
    unit: str
    gain: float


def find_biased_parameters(fitter: Fitter, selection: Selection) -> list[BiasedParameter | None]:
    """Return for each identified effect the parameter that fits as well in its place, or None.

    Parameters with a tolerance of their own in the ship file are not tried: they are free in every
    model, and calibrated ones were right in the reference period.
    """
    fit, ship = selection.fit, fitter.trial_ship.ship
    keys = [k for k in doubtful(ship) if k not in ship.tolerances.numbers and ship.has_key(k)]
    found = []
    for index, gain in enumerate(selection.gains):
        rest = fit.effects[:index] + fit.effects[index + 1 :]
        base = fitter.evaluate(rest)
        best: BiasedParameter | None = None
        fit_one = functools.partial(
            _fit_parameter, fitter, base, rest, HOPELESS * (fit.score - base.score)
        )
        for key, (value, score) in zip(keys, map_threaded(fit_one, keys), strict=True):
            brought = gain - (fit.score - score)
            near = fit.score - score < INDISTINGUISHABLE
            if near and (best is None or brought > best.gain):
                number = ship.parameter(key)
                best = BiasedParameter(key, number.value, value, number.info.unit, brought)
        found.append(best)
    return found


def _fit_parameter(
    fitter: Fitter, base: Fit, rest: tuple[SizedEffect, ...], least: float, key: str
) -> tuple[float, float]:
    """Return the best value of a parameter together with some effects, and its score."""
    host = fitter.trial_ship.with_terms(rest)
    number = host.parameter(key)
    (low,), (high,) = Free(host, (key,)).bounds

    def record(value: float) -> object:
        plant = fitter.trial_ship.record(rest)
        number.write(plant, value)
        return plant

    value, fit = number.value, base
    for step in range(MOST_STEPS):
        size = STEP * abs(value) if value + STEP * abs(value) < high else -STEP * abs(value)
        column = fitter.predict(record(value + size)) - fitter.predict(record(value))
        if not np.isfinite(column).all():
            break
        share, _ = fitter.likelihood.amount(fit.weight, fit.difference, column)
        wanted = float(np.clip(value + share * size, low, high))
        found = fitter.evaluate_record(record(wanted), rest)
        gained = found.score - fit.score
        if gained > 0.0:
            value, fit = wanted, found
        if gained < SETTLED or (step == 0 and fit.score - base.score < least):
            break
    return value, fit.score
