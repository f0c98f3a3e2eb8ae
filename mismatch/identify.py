"""An identification: the numbers, how sure they are, and what they bring.

Build an identification from what a method found: the identified ship, and how well it fits.

Identify a ship's numbers from recordings: set data aside, find, and judge.
"""

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
from .estimate import Estimate, Tick, silent
from .identification.augmented_filter import ekf
from .identification.free_parameters import AUTO, Free, UntoldError, refuse_guesses, usual_keys
from .identification.frequency_band import numbers_hertz, told_by
from .identification.output_error import output_error, refuse_untold
from .identification.results import Found
from .identification.sine import sine
from .identification.steady import points_of, steady
from .identification.step import step
from .identification.welch import welch
from .judge.held_out import Segments, bands_of, fits, set_aside
from .recordings.excitation import one_way, turned
from .recordings.joint import JointRecordings, Recorded, load_jointly
from .report.data import finite
from .report.index import write_result
from .report.text import aligned
from .search.catalogue import Window, applicable
from .search.fitting import Fitter
from .search.selection import TELL_APART
from .simulate.balances import Balances
from .simulate.joint_replay import JointReplay
from .simulate.linear_replay import LinearReplay
from .structure.model_error import with_model_error

SHIP = "identified_ship.toml"
"""Name of the file of an identification that holds its ship."""


@dataclass(frozen=True, repr=False)
class Identification:
    """Numbers of a ship as recordings tell them.

    Args:
        method: by which they were found.
        ship: nominal.
        identified: the ship with these numbers, and how well each is known in its tolerances.
        estimates: of each number, n of them.
        correlation: of their errors, shape (n, n).
        left_out: why a number that might have been free is not, by its key.
        tables: what the method shows on the way, by file name.
        time_s: of the recordings' rows, end to end, shape (rows,); empty where states were given.
        held_out: stretches [s] that were set aside before anything was fitted.
        measured: channels by column, each of shape (rows,); likewise the next two.
        before: open-loop simulation of the nominal ship.
        after: of the identified ship.
        fit_before: FitPercent by column on what was set aside, or on all where nothing was.
        fit_after: likewise.
        limits: what the recordings cannot show.
        warnings: what a reader must know.
        line: whether the demands were taken as straight lines between rows instead of held.
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
        """Values by dotted key, in the keys' units."""
        return {estimate.key: estimate.value for estimate in self.estimates}

    @property
    def corrected(self) -> Ship:
        """The identified ship, as reports call one that was changed."""
        return self.identified

    @property
    def judged_on(self) -> str:
        """What the fit was judged on, in words."""
        if not self.held_out:
            return "what was fitted itself: nothing was set aside"
        held = ", ".join(f"{a:.4g} to {b:.4g} s" for a, b in self.held_out)
        return f"{held}, which was set aside before anything was fitted"

    def strongest_correlation(self) -> tuple[str, str, float] | None:
        """The two numbers whose errors go together most, and their correlation."""
        if len(self.estimates) < 2:
            return None
        apart = np.abs(np.triu(self.correlation, 1))
        i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
        names = [estimate.key for estimate in self.estimates]
        return names[i], names[j], float(self.correlation[i, j])

    def summary(self) -> str:
        """The numbers with their intervals, and the fit, as text for a terminal."""
        rows = []
        for estimate in self.estimates:
            low, high = estimate.ci95
            rows.append(
                {
                    "key": estimate.key,
                    "file": f"{estimate.neutral:.5g}",
                    "found": f"{estimate.value:.5g}",
                    "95 % from": f"{low:.5g}",
                    "to": f"{high:.5g}",
                    "unit": estimate.unit,
                }
            )
        parts = [
            f"Numbers of {self.ship.name} by {self.method}\n"
            + aligned(rows, ("file", "found", "95 % from", "to"))
        ]
        if (pair := self.strongest_correlation()) is not None:
            parts[0] += f"\nstrongest correlation: {pair[0]} with {pair[1]}, {pair[2]:.2f}"
        if self.left_out:
            parts.append(
                "Left as they are\n"
                + "\n".join(f"{key}: {why}" for key, why in self.left_out.items())
            )
        if self.fit_before:
            fits = [
                {
                    "channel": column,
                    "before": f"{before:.1f}",
                    "after": f"{self.fit_after[column]:.1f}",
                }
                for column, before in self.fit_before.items()
            ]
            parts.append(
                "FitPercent, 100 is perfect\n"
                + aligned(fits, ("before", "after"))
                + f"\njudged on {self.judged_on}"
            )
        notes = [f"note: {note}" for note in (*self.limits, *self.warnings)]
        return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)

    def to_dict(self) -> dict[str, Any]:
        """What stands in ``report.json``: numbers in the units of their keys."""
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
        plain: dict[str, Any] = finite(report)
        return plain

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html``, ``identified_ship.toml`` and the tables as CSV.

        All is made before anything is written, and each file is renamed into place.

        Args:
            folder: made where needed.
            page: whether ``report.html`` with its figures is wanted.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        text = None
        if page:
            from .report.identification_page import page_of

            text = page_of(self)
        return write_result(folder, self.to_dict(), text, {SHIP: self.identified}, self.tables)

    def __repr__(self) -> str:
        """Ship and method; the fields hold arrays as long as the recordings."""
        return (
            f"<Identification of {self.ship.name} by {self.method}: {len(self.estimates)} numbers>"
        )


def unjudged(method: str, ship: Ship, found: Found, left_out: dict[str, str]) -> Identification:
    """Return what a method found in a table of steady states, which holds no run to compare with."""
    identified = identified_ship(ship, found)
    return _identification(
        method, ship, identified, found, left_out=left_out, warnings=[*found.remarks]
    )


def judged(
    method: str,
    balances: Balances,
    found: Found,
    held: Segments,
    together: JointRecordings,
    left_out: dict[str, str],
) -> Identification:
    """Return what a method found, compared with the nominal ship on the held-out rows.

    Raises:
        ValueError: the ship with these parameters cannot be simulated along the recordings.
    """
    replay = balances.replay
    rows = np.concatenate([np.arange(a, b) for a, b in held or replay.segments])
    interval = replay.interval_s
    identified = identified_ship(replay.ship, found)
    after = replay.simulated(replay.simulate(identified.record()))
    _refuse_diverged(method, found, after)
    return _identification(
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
        fit_before=fits(replay.recorded, balances.nominal, rows),
        fit_after=fits(replay.recorded, after, rows),
        limits=list(together.limits),
        warnings=[*together.warnings, *found.remarks],
    )


def _refuse_diverged(method: str, found: Found, after: dict[str, NDArray[np.float64]]) -> None:
    """Refuse parameters with which the ship cannot be simulated along the recording.

    Raises:
        ValueError: names the channel that leaves finite numbers, and the parameters.
    """
    endless = [column for column, values in after.items() if not np.isfinite(values).all()]
    if endless:
        values = ", ".join(f"{k} = {v:.4g}" for k, v in zip(found.keys, found.values, strict=True))
        raise ValueError(
            f"{method}: with what it found ({values}) the simulated {endless[0]} does not stay finite, "
            "so nothing was written; free fewer parameters or use --method output-error"
        )


def _identification(
    method: str, ship: Ship, identified: Ship, found: Found, **judged: Any
) -> Identification:
    """What a method found, with what it was judged by."""
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
        **judged,
    )


def identified_ship(ship: Ship, found: Found) -> Ship:
    """Return the ship with the estimated parameters, their standard errors and their correlation.

    A parameter that the record holds in another form has no tolerance, because nothing can shift it.
    """
    told = [i for i, key in enumerate(found.keys) if ship.has_key(key)]
    keys, errors = [found.keys[i] for i in told], found.standard_errors[told]
    numbers = dict(ship.tolerances.numbers) | dict(zip(keys, map(float, errors), strict=True))
    correlations = {
        first: {k: v for k, v in others.items() if k not in keys}
        for first, others in ship.tolerances.correlations.items()
        if first not in keys
    }
    for i, j in itertools.combinations(range(len(told)), 2):
        one = float(np.clip(round(found.correlation[told[i], told[j]], 6), -1.0, 1.0))
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

MOST_SEARCHES = 4
"""By output error, each from what the one before has found."""

NEAR = 0.005
"""Share of a number within which the simulation was made straight where the search has ended."""

SAME_BAND = 0.1
"""Share by which the highest frequency may change without another search."""


def identify(
    ship: Ship,
    *recordings: Recorded,
    free: Sequence[str] | str = AUTO,
    method: str = DEFAULT,
    hold_out: Sequence[Recorded] = (),
    columns: str | Path | None = None,
    tolerance: float = 1.0,
    tick: Tick = silent,
) -> Identification:
    """Find numbers of a ship from recordings of one condition of it.

    Args:
        ship: the nominal ship.
        recordings: to be fitted, together; as of :func:`shaftline.mismatch.diagnose`. By ``steady``
            also tables of points, a row each steady state, without ``time_s``.
        free: dotted keys of the numbers to find, or ``auto`` for those that the recordings tell.
        method: one of :data:`METHODS`.
        hold_out: recordings to judge on; without any, a quarter of the longest is set aside where the
            method can do with the rest.
        columns: column map of the files, or none.
        tolerance: factor on how far the numbers that are not free may be off.
        tick: told the stage, how much is done, and how much there is.

    Returns:
        The numbers, with ``summary()``, ``to_dict()`` and ``save(folder)``.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: an unknown method or key, numbers that the recordings do not tell or do not tell
            apart, or recordings that do not fit the method; names what it is.
        ShipError: a ship that cannot be simulated.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; known: {', '.join(METHODS)}")
    if not isinstance(free, str):
        Free(ship, free)  # refused before anything is read
    elif free != AUTO:
        raise ValueError(f"free = {free!r}: a list of keys is needed, or {AUTO!r}")
    keys = None if isinstance(free, str) else tuple(free)
    if method == "steady" and (points := points_of(ship, recordings, columns)) is not None:
        if hold_out:
            raise ValueError(
                "steady states given as points are fitted whole; set no recording aside"
            )
        by_points = partial(steady, ship, points, tick=tick)
        found, left_out = _without_untold(
            by_points, keys or METHODS[method].usual(ship), chosen=keys is None
        )
        return unjudged(method, ship, found, left_out)
    together = load_jointly(ship, recordings, hold_out, columns, tick)
    with threadpool_limits(1, "blas"):
        if together.steady and not METHODS[method].steady:
            raise ValueError(
                f"{method} compares how the ship moves, and each row of the recording is taken as an "
                f"equilibrium; use --method {DEFAULT} or steady"
            )
        balances = Balances(JointReplay(ship, *together.tables, steady=together.steady))
        parts = METHODS[method].cut or together.held_out
        train, held = (
            set_aside(balances.replay, together.held_out)[0]
            if parts
            else (balances.replay.segments, [])
        )
        untold: dict[str, str] = {}
        chosen = keys is None
        if keys is None:
            tick("which numbers are told", 0, 1)
            keys, untold = (
                told_by(balances, train)
                if METHODS[method].cut
                else (METHODS[method].usual(ship), {})
            )
        fitted = together.tables[: len(together.tables) - together.held_out]
        work = Work(balances, fitted, train, tolerance, tick)
        find = partial(METHODS[method].find, work)
        found, more = _without_untold(find, keys, chosen, chosen and not METHODS[method].cut)
        left_out = untold | more
        if found.line:
            balances = Balances(JointReplay(ship, *together.tables, line=True))
        if METHODS[method].cut:
            tables = together.tables
            effects = applicable(
                ship,
                tables[0].columns,
                turned=turned(tables),
                one_way=one_way(ship, tables),
                steady=together.steady,
            )
            found = with_model_error(
                found, identified_ship(ship, found), balances, train, held, effects, tick
            )
        tick("judging", 0, 1)
        identification = judged(method, balances, found, held, together, left_out)
        tick("judging", 1, 1)
        return identification


def _without_untold(
    find: Callable[[tuple[str, ...]], Found],
    keys: tuple[str, ...],
    chosen: bool,
    guessed: bool = False,
) -> tuple[Found, dict[str, str]]:
    """Return what a method finds, and why it leaves out some of the keys.

    Args:
        find: the method.
        keys: of the parameters.
        chosen: whether the tool chose the keys and may leave some out; a user's are all needed.
        guessed: whether it chose them without a look at the recordings, so that one whose standard error
            turns out too large is left out as well.

    Raises:
        UntoldError: parameters that cannot be identified; names them.
    """
    left_out: dict[str, str] = {}
    while True:
        try:
            found = find(keys)
            if guessed:
                refuse_guesses(keys, found.values, found.standard_errors)
            return found, left_out
        except UntoldError as error:
            if not (chosen and error.rest):
                raise
            left_out |= error.worst
            keys = tuple(error.rest)


class Work(NamedTuple):
    """What a method may look at."""

    balances: Balances
    tables: tuple[pd.DataFrame, ...]  # not those that are set aside
    train: Segments  # the rows that may be fitted
    tolerance: float
    tick: Tick


class Method(NamedTuple):
    """A method of identification."""

    find: Callable[[Work, tuple[str, ...]], Found]  # by keys
    words: str  # what it needs and does, in a line
    cut: bool = False  # whether it can do with a part of a recording
    response: bool = False  # whether it compares how the ship moves, besides where it rests
    steady: bool = False  # whether it can do with rows that are equilibria

    def usual(self, ship: Ship) -> tuple[str, ...]:
        """Return the keys that it frees on a ship where the user names none.

        Raises:
            ValueError: none.
        """
        keys = usual_keys(ship, response=self.response)
        if not keys:
            raise ValueError(
                f"{ship.name}: this method has no parameters that it usually identifies with a drive "
                f"of type {ship.prime_mover.type}; name some with --free, or use --method {DEFAULT}"
            )
        return keys


def _by_output_error(
    work: Work, keys: tuple[str, ...], replayed: type[JointReplay] = JointReplay
) -> Found:
    """Up to the frequency that tells of the numbers, with demands held between rows or as lines.

    The wrong one is half an interval late or early, which inertia and friction then make up for; so
    where the likelihood leaves it open, what the other one finds widens the errors. The frequency is
    that at what was found, as the ship's own numbers may mislead; and what the tolerances of the other
    numbers move is felt there too, for about a file that is wrong by a tenth it is wrong by as much.
    """
    ship, highest, near, steps = work.balances.replay.ship, 0.0, False, []
    runs = [run.table for run in work.balances.replay.runs]
    at_rest = work.balances.replay.steady  # then a row's demands act on that row alone
    free = Free(ship, keys)
    values: Sequence[float] = free.values
    for _ in range(MOST_SEARCHES):
        ways = [
            Balances(replayed(free.ship, *runs, line=line, steady=at_rest))
            for line in ((False,) if at_rest else (False, True))
        ]
        telling = numbers_hertz(ways[0], free, values, work.train)
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
        # held ones, which a controller's are, unless it is clear; as in a diagnosis
        ahead = gain - TELL_APART
        found, other = (drawn, held) if ahead > 0.0 else (held, drawn)
        values = found.values
        near = bool(np.allclose(values, free.values, rtol=NEAR))
        steps.append(found.tables["search"].assign(highest_Hz=highest))
        with contextlib.suppress(ShipError):  # a search may pass where no file may end
            free = Free(free.at(values), free.keys)
    refuse_untold(found, Free(ship, free.keys))
    if not at_rest:
        found = found.beside(other, float(scipy.special.expit(-0.5 * abs(ahead))))
    tables = {"search": pd.concat(steps, ignore_index=True)}
    if ahead <= 0.0:
        return replace(found, tables=tables)
    said = (
        "the demands are taken as straight lines between rows, which fits better than held ones: "
        f"2 log L is {gain:.0f} higher"
    )
    return replace(found, tables=tables, line=True, remarks=(*found.remarks, said))


def _by_linear(work: Work, keys: tuple[str, ...]) -> Found:
    """The same with the ship's linear model about the recordings' mean."""
    return _by_output_error(work, keys, LinearReplay)


def _by_filter(work: Work, keys: tuple[str, ...]) -> Found:
    """The rows that may be fitted, cut out as recordings of their own."""
    replay = work.balances.replay
    tables = [
        run.table.iloc[max(a, first) - first : min(b, last) - first].reset_index(drop=True)
        for a, b in sorted(work.train)
        for run, (first, last) in zip(replay.runs, replay.segments, strict=True)
        if max(a, first) < min(b, last)
    ]
    return ekf(replay.ship, tables, keys, work.tick, tolerance=work.tolerance)


def _whole(method: Callable[..., Found]) -> Callable[[Work, tuple[str, ...]], Found]:
    """A method that looks at whole recordings."""

    def find(work: Work, keys: tuple[str, ...]) -> Found:
        return method(work.balances.replay.ship, list(work.tables), keys, work.tick)

    return find


def _by_points(work: Work, keys: tuple[str, ...]) -> Found:
    """Least squares on the plateaus of recordings, or on rows that are equilibria as they are."""
    tables = list(work.tables)
    if work.balances.replay.steady:
        tables = [table.drop(columns=TIME) for table in tables]
    return steady(work.balances.replay.ship, tables, keys, work.tick)


METHODS: dict[str, Method] = {
    "output-error": Method(
        _by_output_error,
        "any recording: the simulation itself, under noise of any colour",
        cut=True,
        steady=True,
    ),
    "output-error-linear": Method(
        _by_linear,
        "any recording of small motions: the same with the ship's linear model about their mean",
        cut=True,
    ),
    "ekf": Method(
        _by_filter,
        "any recording of white noises: states and numbers together, row by row",
        cut=True,
    ),
    "steady": Method(
        _by_points, "plateaus, or a table of points: least squares on steady states", steady=True
    ),
    "step": Method(
        _whole(step), "one step of a motor's voltage: inertia and inductance", response=True
    ),
    "sine": Method(
        _whole(sine),
        "sines of the drive's demand: frequency response by correlation",
        response=True,
    ),
    "welch": Method(
        _whole(welch),
        "noise on the drive's demand: frequency response and coherence",
        response=True,
    ),
}
"""By name, the default first."""
