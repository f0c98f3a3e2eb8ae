"""Identify a ship's numbers from recordings: set data aside, find, and judge."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ...plant.ship import Ship
from ..estimate import Estimate
from ..judge.fit import fits
from ..judge.held_out import Segments, bands_of, set_aside
from ..progress import Tick, silent
from ..recordings.joint import JointRecordings, Recorded, load_jointly
from ..search.fitting import Fitter
from ..simulate.balances import Balances
from ..simulate.joint_replay import JointReplay
from ..simulate.linear_replay import LinearReplay
from .augmented import ekf
from .automatic import told_by
from .band import numbers_hertz
from .found import Found
from .free import AUTO, Free
from .identifiable import UntoldError
from .identification import Identification
from .output_error import output_error, refuse_untold
from .points import points_of
from .sine import sine
from .steady import steady
from .step import step
from .welch import welch

DEFAULT = "output-error"

MOST_SEARCHES = 4
"""By output error, each from what the one before has found."""

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
        found = steady(ship, points, keys, tick)
        identified = _identified(ship, found)
        return _identification(method, ship, identified, found, warnings=[*found.remarks])
    together = load_jointly(ship, recordings, hold_out, columns, tick)
    with threadpool_limits(1, "blas"):
        balances = Balances(JointReplay(ship, *together.tables))
        parts = METHODS[method].cut or together.held_out
        train, held = (
            set_aside(balances.replay, together.held_out)[0]
            if parts
            else (balances.replay.segments, [])
        )
        left_out: dict[str, str] = {}
        chosen = keys is None and METHODS[method].cut
        if chosen:
            tick("which numbers are told", 0, 1)
            keys, left_out = told_by(balances, train)
        fitted = together.tables[: len(together.tables) - together.held_out]
        work = Work(balances, fitted, train, tolerance, tick)
        while True:
            try:
                found = METHODS[method].find(work, keys)
                break
            except UntoldError as error:
                if not (chosen and error.rest):
                    raise
                left_out |= error.worst
                keys = tuple(error.rest)
        if found.line:
            balances = Balances(JointReplay(ship, *together.tables, line=True))
        tick("judging", 0, 1)
        identification = _judged(method, balances, found, held, together, left_out)
        tick("judging", 1, 1)
        return identification


class Work(NamedTuple):
    """What a method may look at."""

    balances: Balances
    tables: tuple[pd.DataFrame, ...]  # not those that are set aside
    train: Segments  # the rows that may be fitted
    tolerance: float
    tick: Tick


class Method(NamedTuple):
    """A method of identification."""

    find: Callable[[Work, tuple[str, ...] | None], Found]  # by keys, or those that it usually finds
    words: str  # what it needs and does, in a line
    cut: bool = False  # whether it can do with a part of a recording


def _by_output_error(
    work: Work, keys: tuple[str, ...] | None, replayed: type[JointReplay] = JointReplay
) -> Found:
    """Up to the frequency that tells of the numbers, with demands held between rows or as lines.

    Whichever leaves less: the wrong one is half an interval late or early, which inertia and friction
    then make up for. The frequency is that at what was found, as the ship's own numbers may mislead.
    """
    ship = work.balances.replay.ship
    runs = [run.table for run in work.balances.replay.runs]
    free = Free(ship, keys or ())
    ways = [Balances(replayed(ship, *runs, line=line)) for line in (False, True)]
    values: Sequence[float] = free.values
    highest, steps = 0.0, []
    for _ in range(MOST_SEARCHES):
        telling = numbers_hertz(ways[0], free, values, work.train)
        if highest and abs(telling / highest - 1.0) < SAME_BAND:
            break
        highest = telling
        held, drawn = (
            output_error(
                Fitter(some, bands_of(some, work.train, highest), work.tolerance, free.keys),
                free, work.tick, values,
            )
            for some in ways
        )  # fmt: skip
        gain = drawn.score - held.score
        found = drawn if gain > 0.0 else held
        values = found.values
        steps.append(found.tables["search"].assign(highest_Hz=highest))
    refuse_untold(found, free)
    tables = {"search": pd.concat(steps, ignore_index=True)}
    if found is held:
        return replace(found, tables=tables)
    said = (
        "the demands are taken as straight lines between rows, which fits better than held ones: "
        f"2 log L is {gain:.0f} higher"
    )
    return replace(found, tables=tables, line=True, remarks=(*found.remarks, said))


def _by_linear(work: Work, keys: tuple[str, ...] | None) -> Found:
    """The same with the ship's linear model about the recordings' mean."""
    return _by_output_error(work, keys, LinearReplay)


def _by_filter(work: Work, keys: tuple[str, ...] | None) -> Found:
    """The rows that may be fitted, cut out as recordings of their own."""
    replay = work.balances.replay
    tables = [
        run.table.iloc[max(a, first) - first : min(b, last) - first].reset_index(drop=True)
        for a, b in sorted(work.train)
        for run, (first, last) in zip(replay.runs, replay.segments, strict=True)
        if max(a, first) < min(b, last)
    ]
    return ekf(replay.ship, tables, keys or (), work.tick, tolerance=work.tolerance)


def _whole(method: Callable[..., Found]) -> Callable[[Work, tuple[str, ...] | None], Found]:
    """A method that looks at whole recordings."""

    def find(work: Work, keys: tuple[str, ...] | None) -> Found:
        return method(work.balances.replay.ship, list(work.tables), keys, work.tick)

    return find


METHODS: dict[str, Method] = {
    "output-error": Method(
        _by_output_error,
        "any recording: the simulation itself, under noise of any colour",
        cut=True,
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
        _whole(steady), "plateaus, or a table of points: least squares on steady states"
    ),
    "step": Method(_whole(step), "one step of a motor's voltage: inertia and inductance"),
    "sine": Method(_whole(sine), "sines of a motor's voltage: frequency response by correlation"),
    "welch": Method(_whole(welch), "noise on a motor's voltage: frequency response and coherence"),
}
"""By name, the default first."""


def _judged(
    method: str,
    balances: Balances,
    found: Found,
    held: Segments,
    together: JointRecordings,
    left_out: dict[str, str],
) -> Identification:
    """What a method found, beside the nominal ship on what was set aside."""
    replay = balances.replay
    rows = np.concatenate([np.arange(a, b) for a, b in held or replay.segments])
    interval = replay.interval_s
    identified = _identified(replay.ship, found)
    after = replay.simulated(replay.simulate(identified.record()))
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
            Estimate(n.key, v, n.info.unit, (n.info.low, n.info.high), n.value, float(e))
            for n, v, e in zip(free.numbers, found.values, found.standard_errors, strict=True)
        ),
        correlation=found.correlation,
        tables=found.tables,
        line=found.line,
        **judged,
    )


def _identified(ship: Ship, found: Found) -> Ship:
    """The ship with the numbers that were found, how well each is known, and how that goes together.

    A number that the record holds in another form is left out of that: nothing can be moved by it.
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
