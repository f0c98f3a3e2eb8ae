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

from ..observers.ship_filter import LEAST_ROWS, NOISE_MEMORY_S
from ..plant.columns import TIME
from ..plant.ship import Ship, ShipError
from .estimate import Estimate, Tick, ignore_progress
from .identification.augmented_filter import ekf
from .identification.free_parameters import (
    AUTO,
    Free,
    UnidentifiableError,
    keys_at_bounds,
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
from .recordings.measured_pitch import (
    follow_measured_pitch,
    refuse_free_actuator,
    restore_pitch_actuator,
)
from .report.data import replace_non_finite
from .report.index import Result
from .report.text import align_columns, notes_of
from .search.catalogue import Effect, Window, applicable_effects
from .search.fitting import Fitter
from .search.selection import INDISTINGUISHABLE
from .setting import LINES
from .simulate.balances import Balances
from .simulate.joint_replay import START_STEPS, JointReplay, LinearReplay
from .simulate.time_step import with_longest_time_step
from .structure.diagnose import add_model_error

Array = NDArray[np.float64]

SHIP = "identified_ship.toml"  # file name of the identified ship


@dataclass(frozen=True, repr=False)
class Identification(Result):
    """Parameters of a ship estimated from recordings, with their fit.

    ``save`` writes ``report.json``, ``report.html``, ``identified_ship.toml`` and the tables as CSV.

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
        joint: ship in which the parameters that moved within their tolerances have their estimates too,
            with the standard errors and correlations of all; None if the method has no such estimates.
    """

    method: str
    ship: Ship
    identified: Ship
    estimates: tuple[Estimate, ...]
    correlation: Array
    left_out: dict[str, str] = field(default_factory=dict)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    time_s: Array = field(default_factory=lambda: np.zeros(0))
    held_out: list[Window] = field(default_factory=list)
    measured: dict[str, Array] = field(default_factory=dict)
    before: dict[str, Array] = field(default_factory=dict)
    after: dict[str, Array] = field(default_factory=dict)
    fit_before: dict[str, float] = field(default_factory=dict)
    fit_after: dict[str, float] = field(default_factory=dict)
    limits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    line: bool = False
    joint: Ship | None = None

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

    @property
    def adapted_noise(self) -> dict[str, tuple[float, float]]:
        """Adaptive noise of the filter at the beginning and end, by column of the table ``noise``."""
        table = self.tables.get("noise", pd.DataFrame({"time_s": []}))
        return {
            name: (float(values.iloc[0]), float(values.iloc[-1]))
            for name, values in table.drop(columns="time_s").items()
        }

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
        right = ("ship file", "estimate", "95 % from", "to")
        rows = []
        for estimate in self.estimates:
            sizes = (estimate.neutral, estimate.value, *estimate.ci95)
            texts = dict(zip(right, (f"{size:.5g}" for size in sizes), strict=True))
            rows.append({"key": estimate.key, **texts, "unit": estimate.unit})
        title = f"Parameters of {self.ship.name} by {self.method}"
        parts = [f"{title}\n{align_columns(rows, right)}"]
        if (pair := self.strongest_correlation()) is not None:
            parts[0] += f"\nstrongest correlation: {pair[0]} with {pair[1]}, {pair[2]:.2f}"
        if self.adapted_noise:
            noises = [
                {"noise": name, "at the beginning": f"{first:.3g}", "at the end": f"{last:.3g}"}
                for name, (first, last) in self.adapted_noise.items()
            ]
            table = align_columns(noises, ("at the beginning", "at the end"))
            parts.append(f"Noise of the filter, standard deviations\n{table}")
        if self.left_out:
            lines = [f"{key}: {why}" for key, why in self.left_out.items()]
            parts.append("\n".join(["Parameters that were not estimated", *lines]))
        if self.fit_before:
            fits = [
                {"channel": c, "before": f"{before:.1f}", "after": f"{self.fit_after[c]:.1f}"}
                for c, before in self.fit_before.items()
            ]
            table = align_columns(fits, ("before", "after"))
            parts.append(f"FitPercent, 100 is perfect\n{table}\nevaluated on {self.judged_on}")
        return "\n\n".join([*parts, *notes_of(self.limits, self.warnings)])

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
                    "value": e.value,
                    "se": e.standard_error,
                    "ci95": list(e.ci95),
                    "unit": e.unit,
                    "before": e.neutral,
                    "degrees_of_freedom": e.freedom,
                }
                for e in self.estimates
            },
            "correlation": {"keys": keys, "matrix": self.correlation.tolist()},
            "left_out": self.left_out,
            "fit": {
                "held_out" if self.held_out else "fitted": {
                    "before": self.fit_before,
                    "after": self.fit_after,
                }
            },
            "demands_between_rows": "lines" if self.line else "held",
            "limits": self.limits,
            "warnings": self.warnings,
        }
        if self.adapted_noise:
            report["noise"] = {
                name: {"beginning": first, "end": last}
                for name, (first, last) in self.adapted_noise.items()
            }
        plain: dict[str, Any] = replace_non_finite(report)
        return plain

    def _ships(self) -> dict[str, Ship]:
        return {SHIP: self.identified}

    def _page(self) -> str:
        from .report.html import identification_html

        return identification_html(self)

    def __repr__(self) -> str:
        """Return ship, method and number of parameters, without the arrays."""
        count = len(self.estimates)
        return f"<Identification of {self.ship.name} by {self.method}: {count} parameters>"


def identification_without_fit(
    method: str, ship: Ship, found: MethodResult, left_out: dict[str, str]
) -> Identification:
    """Return the estimates of a method without a simulation to compare."""
    numbers = Free(ship, found.keys).numbers
    estimates = [
        Estimate(
            n.key, v, n.info.unit, (n.info.low, n.info.high), n.value, float(e), freedom=float(f)
        )
        for n, v, e, f in zip(
            numbers, found.values, found.standard_errors, found.degrees, strict=True
        )
    ]
    return Identification(
        method,
        ship,
        identified_ship(ship, found),
        tuple(estimates),
        found.correlation,
        left_out,
        found.tables,
        warnings=[*found.remarks],
        line=found.line,
        joint=None if found.joint is None else identified_ship(ship, found.with_tolerances()),
    )


def _add_fit(
    bare: Identification, balances: Balances, held: Segments, together: JointRecordings
) -> Identification:
    """Return an identification with the fit of the nominal and the identified ship.

    Raises:
        ValueError: the ship with these parameters cannot be simulated along the recordings.
    """
    replay, interval = balances.replay, balances.replay.interval_s
    rows = np.concatenate([np.arange(a, b) for a, b in held or replay.segments])
    after = replay.simulate_channels(bare.identified.record())
    _refuse_diverged(bare, after)
    return replace(
        bare,
        time_s=replay.time_s,
        held_out=[(a * interval, b * interval) for a, b in held],
        measured=replay.recorded,
        before=balances.nominal,
        after=after,
        fit_before=fit_percents(replay.recorded, balances.nominal, rows),
        fit_after=fit_percents(replay.recorded, after, rows),
        limits=list(together.limits),
        warnings=[*together.warnings, *bare.warnings],
    )


def _refuse_diverged(found: Identification, after: dict[str, Array]) -> None:
    """Refuse estimates with which the simulation diverges; name the first channel that diverges."""
    diverged = [column for column, values in after.items() if not np.isfinite(values).all()]
    if diverged:
        values = ", ".join(f"{key} = {value:.4g}" for key, value in found.parameters.items())
        raise ValueError(
            f"{found.method}: with the estimates {values} the simulated {diverged[0]} diverges, so no "
            "files were written; free fewer parameters or use --method output-error"
        )


def identified_ship(ship: Ship, found: MethodResult) -> Ship:
    """Return the ship with the estimated parameters, their standard errors and their correlation.

    A parameter that the ship record holds in another form gets no tolerance.
    """
    own = [i for i, key in enumerate(found.keys) if ship.has_key(key)]
    keys, errors = [found.keys[i] for i in own], found.standard_errors[own]
    numbers = ship.tolerances.numbers | dict(zip(keys, map(float, errors), strict=True))
    correlations = {
        first: {k: v for k, v in others.items() if k not in keys}
        for first, others in ship.tolerances.correlations.items()
        if first not in keys
    }
    for i, j in itertools.combinations(range(len(own)), 2):
        one = float(np.clip(round(found.correlation[own[i], own[j]], 6), -1.0, 1.0))
        if one != 0.0:
            correlations.setdefault(keys[i], {})[keys[j]] = one
    correlations = {first: others for first, others in correlations.items() if others}
    known = Free(ship, found.keys).at(found.values)
    return known.with_values(
        {"tolerances.numbers": numbers, "tolerances.correlations": correlations}
    )


DEFAULT = "output-error"
MOST_RESTARTS = 4  # searches by output error, each from the estimates of the one before
NEAR = 0.005  # relative change of the estimates within which no search follows
SAME_BAND = 0.1  # relative change of the highest frequency below which no search follows


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
    own, chosen = METHODS[method], isinstance(free, str)
    keys = () if chosen else tuple(free)
    if method == "steady" and (points := points_of(ship, recordings, columns)) is not None:
        if hold_out:
            raise ValueError(
                "a table of steady states is fitted as a whole; use no --hold-out with it"
            )
        by_states = partial(steady, ship, points, tick=tick)
        found, left_out = _find_identifiable(by_states, keys or own.usual(ship), chosen)
        return identification_without_fit(method, ship, found, left_out)
    together = load_jointly(ship, recordings, hold_out, columns, tick)
    if not together.measured_pitch:
        return _identify(ship, together, keys, chosen, method, tolerance, tick)
    refuse_free_actuator(keys)
    following = follow_measured_pitch(ship, together.interval_s)
    result = _identify(following, together, keys, chosen, method, tolerance, tick)
    joint = None if result.joint is None else restore_pitch_actuator(result.joint, ship)
    identified = restore_pitch_actuator(result.identified, ship)
    return replace(result, ship=ship, identified=identified, joint=joint)


def _identify(
    ship: Ship,
    together: JointRecordings,
    keys: tuple[str, ...],
    chosen: bool,
    method: str,
    tolerance: float,
    tick: Tick,
) -> Identification:
    """Estimate parameters from loaded recordings; all identifiable ones if they are ``chosen`` here."""
    tables, own, left_out = together.tables, METHODS[method], dict[str, str]()
    with threadpool_limits(1, "blas"):
        if together.steady and not own.steady:
            raise ValueError(
                f"{method} needs the ship's response in time, but each row of the recording is treated "
                f"as an equilibrium; use --method {DEFAULT} or steady"
            )
        by_own_step = partial(JointReplay, ship, *tables, steady=together.steady)
        replayed = by_own_step
        effects: list[Effect] = []
        if own.cut:
            effects = applicable_effects(
                ship,
                tables[0].columns,
                turning=course_changes(tables),
                one_way=shaft_runs_one_way(ship, tables),
                steady=together.steady,
            )
        if own.cut and not together.steady:
            slower = with_longest_time_step(ship, tables, [effect.on for effect in effects])
            over_s = START_STEPS * ship.time_step_s
            replayed = partial(JointReplay, slower, *tables, start_over_s=over_s)
        balances = Balances(replayed())
        train: Segments = balances.replay.segments
        held: Segments = []
        if own.cut or together.held_out:
            train, held = split_held_out(balances.replay, together.held_out)[0]
        if chosen:
            tick("selecting identifiable parameters", 0, 1)
            if own.cut:
                keys, left_out = identifiable_keys(balances, train)
            else:
                keys = own.usual(ship)
        fitted = tables[: len(tables) - together.held_out]

        def estimate(by: Balances) -> tuple[MethodResult, dict[str, str]]:
            find = partial(own.find, MethodInput(by, fitted, train, tolerance, tick))
            return _find_identifiable(find, keys, chosen, chosen and not own.cut)

        found, more = estimate(balances)
        values = [*zip(found.keys, found.values, strict=True)]
        if keys_at_bounds(balances.replay.ship, values) != keys_at_bounds(ship, values):
            # The longer time step limits a time constant that the ship's own step resolves.
            replayed = by_own_step
            balances = Balances(replayed())
            found, more = estimate(balances)
        if found.line:
            balances = Balances(replayed(line=True))
        if own.cut:
            identified = identified_ship(ship, found)
            found = add_model_error(found, identified, balances, train, held, effects, tick)
        tick("judging", 0, 1)
        bare = identification_without_fit(method, ship, found, left_out | more)
        judged = Balances(by_own_step(line=found.line))
        identification = _add_fit(bare, judged, held, together)
        tick("judging", 1, 1)
        return identification


def _find_identifiable(
    find: Callable[[tuple[str, ...]], MethodResult],
    keys: tuple[str, ...],
    chosen: bool,
    guessed: bool = False,
) -> tuple[MethodResult, dict[str, str]]:
    """Return the estimates of a method, and why some of the keys are left out.

    Keys of the user are all needed. Of keys that the tool has ``chosen`` some may be left out, and of
    keys ``guessed`` without the recordings also those with a large standard error.
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
    replay = work.balances.replay
    ship, highest, near, steps = replay.ship, 0.0, False, []
    runs = [run.table for run in replay.runs]
    at_rest = replay.steady  # the commands of a row then act on that row alone
    free = Free(ship, keys)
    values: Sequence[float] = free.values
    lines = (False,) if at_rest else (False, True)
    for _ in range(MOST_RESTARTS):
        begun = partial(
            replayed, free.ship, *runs, steady=at_rest, start_over_s=replay.start_over_s
        )
        ways = [Balances(begun(line=line)) for line in lines]
        telling = parameters_hertz(ways[0], free, values, work.train)
        if near and abs(telling / highest - 1.0) < SAME_BAND:
            break
        highest = telling
        held, *others = (
            output_error(
                Fitter(some, bands_of(some, work.train, highest), work.tolerance, free.keys),
                free,
                work.tick,
                values,
            )
            for some in ways
        )
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


def _find_by_filter(
    work: MethodInput, keys: tuple[str, ...], adaptive: bool = False
) -> MethodResult:
    """Estimate parameters by the augmented filter; each fitted segment is a recording of its own.

    With ``adaptive`` noise the memory is long enough for the interval of the rows.
    """
    replay = work.balances.replay
    memory_s = max(NOISE_MEMORY_S, LEAST_ROWS * replay.interval_s) if adaptive else None
    tables = [
        run.table.iloc[max(a, first) - first : min(b, last) - first].reset_index(drop=True)
        for a, b in sorted(work.train)
        for run, (first, last) in zip(replay.runs, replay.segments, strict=True)
        if max(a, first) < min(b, last)
    ]
    return ekf(
        replay.ship, tables, keys, work.tick, noise_memory_s=memory_s, tolerance=work.tolerance
    )


def _on_whole_recordings(
    method: Callable[..., MethodResult],
) -> Callable[[MethodInput, tuple[str, ...]], MethodResult]:
    """Return a method that uses whole recordings; rows that are equilibria have no time."""

    def find(work: MethodInput, keys: tuple[str, ...]) -> MethodResult:
        replay, tables = work.balances.replay, list(work.tables)
        if replay.steady:
            tables = [table.drop(columns=TIME) for table in tables]
        return method(replay.ship, tables, keys, work.tick)

    return find


METHODS: dict[str, Method] = {
    "output-error": Method(
        _find_by_output_error,
        cut=True,
        steady=True,
        words="any recording: simulation error under noise of any colour",
    ),
    "output-error-linear": Method(
        partial(_find_by_output_error, replayed=LinearReplay),
        "recordings of small motions: simulation error of the ship's linear model about their mean",
        cut=True,
    ),
    "ekf": Method(
        _find_by_filter,
        cut=True,
        words="recordings with white noise: states and parameters together, row by row",
    ),
    "ekf-adaptive": Method(
        partial(_find_by_filter, adaptive=True),
        "recordings along which noise or sea change: ekf that estimates its noises from its innovations",
        cut=True,
    ),
    "steady": Method(
        _on_whole_recordings(steady),
        steady=True,
        words="plateaus, or a table of steady states: least squares on steady states",
    ),
    "step": Method(
        _on_whole_recordings(step),
        response=True,
        words="steps of a motor's voltage: inertia and inductance",
    ),
    "sine": Method(
        _on_whole_recordings(sine),
        response=True,
        words="sines of the drive command: frequency response by correlation",
    ),
    "welch": Method(
        _on_whole_recordings(welch),
        response=True,
        words="noise on the drive command: frequency response and coherence",
    ),
}
"""Methods of identification by name, the default first."""
