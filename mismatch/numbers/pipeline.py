"""Identify a ship's numbers from recordings: set data aside, find, and judge."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from threadpoolctl import threadpool_limits

from ...plant.columns import TIME
from ...plant.ship import Ship
from ...plant.ship_errors import ShipError
from ..judge.held_out import Segments, bands_of, set_aside
from ..progress import Tick, silent
from ..recordings.joint import Recorded, load_jointly
from ..recordings.loading import one_way, turned
from ..search.catalogue import applicable
from ..search.fitting import Fitter
from ..search.selection import TELL_APART
from ..simulate.balances import Balances
from ..simulate.joint_replay import JointReplay
from ..simulate.linear_replay import LinearReplay
from ..structure.model_error import with_model_error
from .augmented import ekf
from .automatic import told_by
from .band import numbers_hertz
from .found import Found
from .free import AUTO, Free, usual_keys
from .identifiable import UntoldError, refuse_guesses
from .identification import Identification
from .identified import identified_ship, judged, unjudged
from .output_error import output_error, refuse_untold
from .points import points_of
from .sine import sine
from .steady import steady
from .step import step
from .welch import welch

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
