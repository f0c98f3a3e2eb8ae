"""Build an identification from what a method found: the identified ship, and how well it fits."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.ship import Ship
from ..estimate import Estimate
from ..judge.fit import fits
from ..judge.held_out import Segments
from ..recordings.joint import JointRecordings
from ..simulate.balances import Balances
from .found import Found
from .free import Free
from .identification import Identification


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
