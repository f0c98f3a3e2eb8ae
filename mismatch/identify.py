"""Identify parameters of a ship from recordings: hold data out, estimate, and evaluate the fit."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..plant.columns import TIME
from ..plant.ship import Ship, ShipError
from .estimate import Estimate, Tick, ignore_progress
from .identification.augmented_filter import ekf
from .identification.free_parameters import (
    AUTO,
    Free,
    UnidentifiableError,
    refuse_guesses,
    usual_keys,
)
from .identification.frequency import identifiable_keys, parameters_hertz
from .identification.output_error import output_error, refuse_uncertain
from .identification.parameters import MethodResult
from .identification.sine import sine
from .identification.steady import points_of, steady
from .identification.step import step
from .identification.welch import welch
from .judge.held_out import Segments, bands_of, fit_percents, split_held_out
from .recordings.excitation import course_changes, shaft_runs_one_way
from .recordings.joint import JointRecordings, Recorded, load_jointly
from .report.data import replace_non_finite
from .report.index import write_result
from .report.text import align_columns
from .search.catalogue import Window, applicable_effects
from .search.fitting import Fitter
from .search.selection import INDISTINGUISHABLE
from .setting import LINES
from .simulate.balances import Balances
from .simulate.joint_replay import JointReplay, LinearReplay
from .structure.diagnose import add_model_error

SHIP = "identified_ship.toml"
"""File name of the identified ship."""


@dataclass(frozen=True, repr=False)
class Identification:
    """Parameters of a ship estimated from recordings, with their fit.

    Args:
        method: name of the method.
        ship: nominal ship.
        identified: ship with the estimates, and with their standard errors as tolerances.
        estimates: estimates of n parameters.
        correlation: correlation of the estimates, shape (n, n).
        left_out: why a parameter was not estimated, by key.
        tables: intermediate results of the method, by file name.
        time_s: time of each row [s], recordings end to end, shape (rows,); empty for steady states.
        held_out: windows of the held-out data [s].
        measured: measured channels by column, each of shape (rows,).
        before: open-loop simulation of the nominal ship, likewise.
        after: open-loop simulation of the identified ship, likewise.
        fit_before: FitPercent of the nominal ship by column, on the held-out data if there are any.
        fit_after: FitPercent of the identified ship, likewise.
        limits: limits of the recordings, a sentence each.
        warnings: remarks on the recordings and the estimates, a sentence each.
        line: whether the commands were interpolated linearly between rows; otherwise they were held.
    """

    method: str
    ship: Ship
    identified: Ship
    estimates: tuple[Estimate, ...]
    correlation: NDArray[np.float64]
    left_out: dict[str, str] = field(default_factory=dict)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    time_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    held_out: list[Window] = field(default_factory=list)
    measured: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    before: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    after: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    fit_before: dict[str, float] = field(default_factory=dict)
    fit_after: dict[str, float] = field(default_factory=dict)
    limits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    line: bool = False

    @property
    def parameters(self) -> dict[str, float]:
        """Estimates by dotted key, in the keys' units."""
        return {estimate.key: estimate.value for estimate in self.estimates}

    @property
    def corrected(self) -> Ship:
        """The identified ship, under the name that the figures use."""
        return self.identified

    @property
    def judged_on(self) -> str:
        """Data on which the fit was evaluated, in words."""
        if not self.held_out:
            return "the fitted data, because no data were held out"
        held = ", ".join(f"{a:.4g} to {b:.4g} s" for a, b in self.held_out)
        return f"{held}, which was held out before anything was fitted"

    def strongest_correlation(self) -> tuple[str, str, float] | None:
        """Return the two parameters with the strongest correlation, and the correlation."""
        if len(self.estimates) < 2:
            return None
        apart = np.abs(np.triu(self.correlation, 1))
        i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
        names = [estimate.key for estimate in self.estimates]
        return names[i], names[j], float(self.correlation[i, j])

    def summary(self) -> str:
        """Return the estimates with their intervals, and the fit, as text for a terminal."""
        rows = []
        for estimate in self.estimates:
            low, high = estimate.ci95
            rows.append(
                {
                    "key": estimate.key,
                    "ship file": f"{estimate.neutral:.5g}",
                    "estimate": f"{estimate.value:.5g}",
                    "95 % from": f"{low:.5g}",
                    "to": f"{high:.5g}",
                    "unit": estimate.unit,
                }
            )
        parts = [
            f"Parameters of {self.ship.name} by {self.method}\n"
            + align_columns(rows, ("ship file", "estimate", "95 % from", "to"))
        ]
        if (pair := self.strongest_correlation()) is not None:
            parts[0] += f"\nstrongest correlation: {pair[0]} with {pair[1]}, {pair[2]:.2f}"
        if self.left_out:
            parts.append(
                "Parameters that were not estimated\n"
                + "\n".join(f"{key}: {why}" for key, why in self.left_out.items())
            )
        if self.fit_before:
            fit_percents = [
                {
                    "channel": column,
                    "before": f"{before:.1f}",
                    "after": f"{self.fit_after[column]:.1f}",
                }
                for column, before in self.fit_before.items()
            ]
            parts.append(
                "FitPercent, 100 is perfect\n"
                + align_columns(fit_percents, ("before", "after"))
                + f"\nevaluated on {self.judged_on}"
            )
        notes = [f"note: {note}" for note in (*self.limits, *self.warnings)]
        return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``report.json``: values in the units of their keys."""
        keys = [estimate.key for estimate in self.estimates]
        report: dict[str, Any] = {
            "method": self.method,
            "ship": self.ship.name,
            "recording": {
                "rows": len(self.time_s),
                "seconds": float(self.time_s[-1]) if len(self.time_s) else 0.0,
                "held_out": [list(window) for window in self.held_out],
            },
            "parameters": {
                e.key: {
                    "value": e.value, "se": e.standard_error, "ci95": list(e.ci95),
                    "unit": e.unit, "before": e.neutral,
                    "degrees_of_freedom": e.freedom,
                }
                for e in self.estimates
            },
            "correlation": {"keys": keys, "matrix": self.correlation.tolist()},
            "left_out": self.left_out,
            "fit": {
                "held_out" if self.held_out else "fitted": {
                    "before": self.fit_before, "after": self.fit_after,
                }
            },
            "demands_between_rows": "lines" if self.line else "held",
            "limits": self.limits,
            "warnings": self.warnings,
        }  # fmt: skip
        plain: dict[str, Any] = replace_non_finite(report)
        return plain

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html``, ``identified_ship.toml`` and the tables as CSV.

        Each file is renamed into place when it is complete.

        Args:
            folder: created if it does not exist.
            page: whether to write ``report.html`` with its figures.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        text = None
        if page:
            from .report.html import identification_html

            text = identification_html(self)
        return write_result(folder, self.to_dict(), text, {SHIP: self.identified}, self.tables)

    def __repr__(self) -> str:
        """Return ship, method and number of parameters, without the arrays."""
        count = len(self.estimates)
        return f"<Identification of {self.ship.name} by {self.method}: {count} parameters>"


def identification_without_fit(
    method: str, ship: Ship, found: MethodResult, left_out: dict[str, str]
) -> Identification:
    """Return the estimates from a table of steady states, without a simulation to compare."""
    identified = identified_ship(ship, found)
    return _build_identification(
        method, ship, identified, found, left_out=left_out, warnings=[*found.remarks]
    )


def identification_with_fit(
    method: str,
    balances: Balances,
    found: MethodResult,
    held: Segments,
    together: JointRecordings,
    left_out: dict[str, str],
) -> Identification:
    """Return the estimates of a method with the fit of the nominal and the identified ship.

    Raises:
        ValueError: the ship with these parameters cannot be simulated along the recordings.
    """
    replay = balances.replay
    rows = np.concatenate([np.arange(a, b) for a, b in held or replay.segments])
    interval = replay.interval_s
    identified = identified_ship(replay.ship, found)
    after = replay.simulated(replay.simulate(identified.record()))
    _refuse_diverged(method, found, after)
    return _build_identification(
        method,
        replay.ship,
        identified,
        found,
        left_out=left_out,
        time_s=replay.time_s,
        held_out=[(a * interval, b * interval) for a, b in held],
        measured=replay.recorded,
        before=balances.nominal,
        after=after,
        fit_before=fit_percents(replay.recorded, balances.nominal, rows),
        fit_after=fit_percents(replay.recorded, after, rows),
        limits=list(together.limits),
        warnings=[*together.warnings, *found.remarks],
    )


def _refuse_diverged(
    method: str, found: MethodResult, after: dict[str, NDArray[np.float64]]
) -> None:
    """Refuse estimates with which the simulation diverges.

    Raises:
        ValueError: names the first channel that diverges, and the estimates.
    """
    diverged = [column for column, values in after.items() if not np.isfinite(values).all()]
    if diverged:
        values = ", ".join(f"{k} = {v:.4g}" for k, v in zip(found.keys, found.values, strict=True))
        raise ValueError(
            f"{method}: with the estimates {values} the simulated {diverged[0]} diverges, so no files "
            "were written; free fewer parameters or use --method output-error"
        )


def _build_identification(
    method: str, ship: Ship, identified: Ship, found: MethodResult, **identification_with_fit: Any
) -> Identification:
    """Return an identification with the estimates of a method and further fields."""
    free = Free(ship, found.keys)
    return Identification(
        method=method,
        ship=ship,
        identified=identified,
        estimates=tuple(
            Estimate(
                n.key,
                v,
                n.info.unit,
                (n.info.low, n.info.high),
                n.value,
                float(e),
                freedom=float(f),
            )
            for n, v, e, f in zip(
                free.numbers, found.values, found.standard_errors, found.degrees, strict=True
            )
        ),
        correlation=found.correlation,
        tables=found.tables,
        line=found.line,
        **identification_with_fit,
    )


def identified_ship(ship: Ship, found: MethodResult) -> Ship:
    """Return the ship with the estimated parameters, their standard errors and their correlation.

    A parameter that the ship record holds in another form gets no tolerance.
    """
    own = [i for i, key in enumerate(found.keys) if ship.has_key(key)]
    keys, errors = [found.keys[i] for i in own], found.standard_errors[own]
    numbers = dict(ship.tolerances.numbers) | dict(zip(keys, map(float, errors), strict=True))
    correlations = {
        first: {k: v for k, v in others.items() if k not in keys}
        for first, others in ship.tolerances.correlations.items()
        if first not in keys
    }
    for i, j in itertools.combinations(range(len(own)), 2):
        one = float(np.clip(round(found.correlation[own[i], own[j]], 6), -1.0, 1.0))
        if one != 0.0:
            correlations.setdefault(keys[i], {})[keys[j]] = one
    known = Free(ship, found.keys).at(found.values)
    return known.with_values(
        {
            "tolerances.numbers": numbers,
            "tolerances.correlations": {k: v for k, v in correlations.items() if v},
        }
    )


DEFAULT = "output-error"

MOST_RESTARTS = 4
"""Largest number of searches by output error, each from the estimates of the one before."""

NEAR = 0.005
"""Relative distance of the estimates from the point of linearisation within which no search follows."""

SAME_BAND = 0.1
"""Relative change of the highest frequency below which no search follows."""


def identify(
    ship: Ship,
    *recordings: Recorded,
    free: Sequence[str] | str = AUTO,
    method: str = DEFAULT,
    hold_out: Sequence[Recorded] = (),
    columns: str | Path | None = None,
    tolerance: float = 1.0,
    tick: Tick = ignore_progress,
) -> Identification:
    """Estimate parameters of a ship from recordings in one condition.

    Args:
        ship: nominal ship.
        recordings: recordings that are fitted together, as in :func:`shaftline.mismatch.diagnose`. The
            method ``steady`` also accepts tables of steady states, one in each row, without ``time_s``.
        free: dotted keys of the parameters, or ``auto`` for those that are identifiable.
        method: one of :data:`METHODS`.
        hold_out: recordings that are held out for validation; without any, a quarter of the longest
            recording is held out if the method accepts part of a recording.
        columns: column map of the files; None without one.
        tolerance: factor on the tolerances of the parameters that are not free [-].
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        The estimates, with ``summary()``, ``to_dict()`` and ``save(folder)``.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: an unknown method or key, parameters that are not identifiable or not
            distinguishable, or recordings that do not suit the method.
        ShipError: the ship cannot be simulated.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; known: {', '.join(METHODS)}")
    if not isinstance(free, str):
        Free(ship, free)  # refuses invalid keys before any recording is read
    elif free != AUTO:
        raise ValueError(f"free = {free!r}: expected a list of keys or {AUTO!r}")
    keys = None if isinstance(free, str) else tuple(free)
    if method == "steady" and (points := points_of(ship, recordings, columns)) is not None:
        if hold_out:
            raise ValueError(
                "a table of steady states is fitted as a whole; use no --hold-out with it"
            )
        by_states = partial(steady, ship, points, tick=tick)
        found, left_out = _find_identifiable(
            by_states, keys or METHODS[method].usual(ship), chosen=keys is None
        )
        return identification_without_fit(method, ship, found, left_out)
    together = load_jointly(ship, recordings, hold_out, columns, tick)
    with threadpool_limits(1, "blas"):
        if together.steady and not METHODS[method].steady:
            raise ValueError(
                f"{method} needs the ship's response in time, but each row of the recording is treated "
                f"as an equilibrium; use --method {DEFAULT} or steady"
            )
        balances = Balances(JointReplay(ship, *together.tables, steady=together.steady))
        parts = METHODS[method].cut or together.held_out
        train, held = (
            split_held_out(balances.replay, together.held_out)[0]
            if parts
            else (balances.replay.segments, [])
        )
        unidentifiable: dict[str, str] = {}
        chosen = keys is None
        if keys is None:
            tick("selecting identifiable parameters", 0, 1)
            keys, unidentifiable = (
                identifiable_keys(balances, train)
                if METHODS[method].cut
                else (METHODS[method].usual(ship), {})
            )
        fitted = together.tables[: len(together.tables) - together.held_out]
        work = MethodInput(balances, fitted, train, tolerance, tick)
        find = partial(METHODS[method].find, work)
        found, more = _find_identifiable(find, keys, chosen, chosen and not METHODS[method].cut)
        left_out = unidentifiable | more
        if found.line:
            balances = Balances(JointReplay(ship, *together.tables, line=True))
        if METHODS[method].cut:
            tables = together.tables
            effects = applicable_effects(
                ship,
                tables[0].columns,
                turning=course_changes(tables),
                one_way=shaft_runs_one_way(ship, tables),
                steady=together.steady,
            )
            found = add_model_error(
                found, identified_ship(ship, found), balances, train, held, effects, tick
            )
        tick("judging", 0, 1)
        identification = identification_with_fit(method, balances, found, held, together, left_out)
        tick("judging", 1, 1)
        return identification


def _find_identifiable(
    find: Callable[[tuple[str, ...]], MethodResult],
    keys: tuple[str, ...],
    chosen: bool,
    guessed: bool = False,
) -> tuple[MethodResult, dict[str, str]]:
    """Return the estimates of a method, and why some of the keys are left out.

    Args:
        find: the method as a function of the keys.
        keys: keys of the parameters.
        chosen: whether the tool chose the keys and may leave some out; keys of the user are all needed.
        guessed: whether the tool chose the keys without the recordings, so that parameters with a large
            standard error are left out as well.

    Raises:
        UnidentifiableError: parameters that are not identifiable; names them.
    """
    left_out: dict[str, str] = {}
    while True:
        try:
            found = find(keys)
            if guessed:
                refuse_guesses(keys, found.values, found.standard_errors)
            return found, left_out
        except UnidentifiableError as error:
            if not (chosen and error.rest):
                raise
            left_out |= error.worst
            keys = tuple(error.rest)


class MethodInput(NamedTuple):
    """Data that a method of identification may use."""

    balances: Balances
    tables: tuple[pd.DataFrame, ...]  # without held-out recordings
    train: Segments  # rows that may be fitted
    tolerance: float
    tick: Tick


class Method(NamedTuple):
    """A method of identification."""

    find: Callable[[MethodInput, tuple[str, ...]], MethodResult]  # by keys
    words: str  # description in one line
    cut: bool = False  # whether it accepts a part of a recording
    response: bool = False  # whether it uses the response in time besides steady states
    steady: bool = False  # whether it accepts rows that are equilibria

    def usual(self, ship: Ship) -> tuple[str, ...]:
        """Return the keys that the method estimates where the user gives none.

        Raises:
            ValueError: the method has no such keys for the drive of the ship.
        """
        keys = usual_keys(ship, response=self.response)
        if not keys:
            raise ValueError(
                f"{ship.name}: this method has no default parameters for a drive of type "
                f"{ship.prime_mover.type}; give some with --free, or use --method {DEFAULT}"
            )
        return keys


def _find_by_output_error(
    work: MethodInput, keys: tuple[str, ...], replayed: type[JointReplay] = JointReplay
) -> MethodResult:
    """Estimate parameters by output error with held and with linearly interpolated commands.

    The wrong interpolation is half an interval late or early, for which inertia and friction would
    compensate. Where the likelihood does not decide, the estimates of the other interpolation widen the
    errors. The frequency range and the sensitivities to the other parameters' tolerances are taken at
    the estimates, because those at the values of the ship file may be wrong; the search is therefore
    repeated.
    """
    ship, highest, near, steps = work.balances.replay.ship, 0.0, False, []
    runs = [run.table for run in work.balances.replay.runs]
    at_rest = work.balances.replay.steady  # the commands of a row then act on that row alone
    free = Free(ship, keys)
    values: Sequence[float] = free.values
    for _ in range(MOST_RESTARTS):
        ways = [
            Balances(replayed(free.ship, *runs, line=line, steady=at_rest))
            for line in ((False,) if at_rest else (False, True))
        ]
        telling = parameters_hertz(ways[0], free, values, work.train)
        if near and abs(telling / highest - 1.0) < SAME_BAND:
            break
        highest = telling
        held, *others = (
            output_error(
                Fitter(some, bands_of(some, work.train, highest), work.tolerance, free.keys),
                free, work.tick, values,
            )
            for some in ways
        )  # fmt: skip
        drawn = next(iter(others), held)
        gain = drawn.score - held.score
        # Commands of a controller are held, so lines must be clearly likelier, as in a diagnosis.
        ahead = gain - INDISTINGUISHABLE
        found, other = (drawn, held) if ahead > 0.0 else (held, drawn)
        values = found.values
        near = bool(np.allclose(values, free.values, rtol=NEAR))
        steps.append(found.tables["search"].assign(highest_Hz=highest))
        with contextlib.suppress(ShipError):  # a search may leave the range of a valid ship file
            free = Free(free.at(values), free.keys)
    refuse_uncertain(found, Free(ship, free.keys))
    if not at_rest:
        found = found.mix_with(other, float(scipy.special.expit(-0.5 * abs(ahead))))
    tables = {"search": pd.concat(steps, ignore_index=True)}
    if ahead <= 0.0:
        return replace(found, tables=tables)
    remarks = (*found.remarks, LINES.format(gain=gain))
    return replace(found, tables=tables, line=True, remarks=remarks)


def _find_by_linear_model(work: MethodInput, keys: tuple[str, ...]) -> MethodResult:
    """Estimate parameters by output error with the ship's linear model about the recordings' mean."""
    return _find_by_output_error(work, keys, LinearReplay)


def _find_by_filter(work: MethodInput, keys: tuple[str, ...]) -> MethodResult:
    """Estimate parameters by the augmented filter; each fitted segment is a recording of its own."""
    replay = work.balances.replay
    tables = [
        run.table.iloc[max(a, first) - first : min(b, last) - first].reset_index(drop=True)
        for a, b in sorted(work.train)
        for run, (first, last) in zip(replay.runs, replay.segments, strict=True)
        if max(a, first) < min(b, last)
    ]
    return ekf(replay.ship, tables, keys, work.tick, tolerance=work.tolerance)


def _on_whole_recordings(
    method: Callable[..., MethodResult],
) -> Callable[[MethodInput, tuple[str, ...]], MethodResult]:
    """Return a method that uses whole recordings."""

    def find(work: MethodInput, keys: tuple[str, ...]) -> MethodResult:
        return method(work.balances.replay.ship, list(work.tables), keys, work.tick)

    return find


def _find_by_steady_states(work: MethodInput, keys: tuple[str, ...]) -> MethodResult:
    """Estimate parameters by least squares on plateaus, or on rows that are equilibria."""
    tables = list(work.tables)
    if work.balances.replay.steady:
        tables = [table.drop(columns=TIME) for table in tables]
    return steady(work.balances.replay.ship, tables, keys, work.tick)


METHODS: dict[str, Method] = {
    "output-error": Method(
        _find_by_output_error,
        "any recording: simulation error under noise of any colour",
        cut=True,
        steady=True,
    ),
    "output-error-linear": Method(
        _find_by_linear_model,
        "recordings of small motions: simulation error of the ship's linear model about their mean",
        cut=True,
    ),
    "ekf": Method(
        _find_by_filter,
        "recordings with white noise: states and parameters together, row by row",
        cut=True,
    ),
    "steady": Method(
        _find_by_steady_states,
        "plateaus, or a table of steady states: least squares on steady states",
        steady=True,
    ),
    "step": Method(
        _on_whole_recordings(step),
        "steps of a motor's voltage: inertia and inductance",
        response=True,
    ),
    "sine": Method(
        _on_whole_recordings(sine),
        "sines of the drive command: frequency response by correlation",
        response=True,
    ),
    "welch": Method(
        _on_whole_recordings(welch),
        "noise on the drive command: frequency response and coherence",
        response=True,
    ),
}
"""Methods of identification by name, the default first."""
