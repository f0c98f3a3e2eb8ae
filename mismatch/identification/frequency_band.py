"""Up to which frequency a recording tells of some numbers (see :mod:`..search.band`).

``--free auto``: of all that a ship's file may be wrong about, what these recordings tell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..judge.held_out import Segments, bands_of
from ..search.band import telling_hertz
from ..search.fitting import Fitter
from ..search.spectra import Likelihood
from ..simulate.balances import Balances
from .free_parameters import Free, UntoldError, doubtful, told_apart
from .output_error import OutputError


def numbers_hertz(
    balances: Balances, free: Free, values: Sequence[float], segments: Segments
) -> float:
    """Highest frequency that tells of some numbers.

    Args:
        balances: of ship and recordings.
        free: the numbers.
        values: of them.
        segments: the part that may be fitted.

    Returns:
        [Hz]; infinite where a number does nothing.
    """
    replay = balances.replay
    moved = []
    for i, value in enumerate(values):
        there = [*values]
        there[i] += 1e-3 * abs(value) or 1e-3
        moved.append(there)
    return max(
        telling_hertz(
            replay,
            replay.channels_of(free.record(values)),
            (replay.channels_of(free.record(there)) for there in moved),
            segments,
        )
    )


def told_by(balances: Balances, train: Segments) -> tuple[tuple[str, ...], dict[str, str]]:
    """Keys whose numbers the recordings tell apart, and why the other doubtful ones are left out.

    Args:
        balances: of ship and recordings.
        train: the part that may be fitted.

    Raises:
        UntoldError: the recordings tell no number.
    """
    ship = balances.replay.ship
    free = Free(ship, doubtful(ship))
    fitter = Fitter(balances, bands_of(balances, train), free=free.keys)
    search = OutputError(fitter, free)
    fit = fitter.scored(free.record(free.values))
    columns = search.slopes(free.values, fit)
    # as sure as the recordings would be of the numbers if these explained what they can
    sizes = np.abs(np.array(free.values))[:, None, None]
    everything = Likelihood(fitter.bands, np.concatenate([columns * sizes, fitter.nuisance]))
    weight = everything(fit.difference).weight
    information = fitter.likelihood.information(weight, columns)
    count = len(free.keys)
    # what the tolerances of the others take away
    own, crossed = information[:count, :count], information[:count, count:]
    own = own - crossed @ np.linalg.solve(information[count:, count:], crossed.T)
    rest, left = told_apart(free.keys, free.values, own)
    if not rest:
        why = "; ".join(f"{key}: {reason}" for key, reason in left.items())
        raise UntoldError(f"these recordings tell no number of {ship.name}: {why}", free.keys, ())
    return tuple(free.keys[i] for i in rest), left
