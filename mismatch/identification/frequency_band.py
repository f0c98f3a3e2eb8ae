"""Frequency range of parameters, and parameters that recordings identify (``--free auto``)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..judge.held_out import Segments, bands_of
from ..search.band import informative_frequencies
from ..search.fitting import Fitter
from ..search.spectra import Likelihood
from ..simulate.balances import Balances
from .free_parameters import Free, UnidentifiableError, distinguishable, doubtful
from .output_error import OutputError


def parameters_hertz(
    balances: Balances, free: Free, values: Sequence[float], segments: Segments
) -> float:
    """Return the highest frequency with information about parameters.

    Args:
        balances: balances of the ship and the recordings.
        free: the parameters.
        values: their values.
        segments: segments of the fitted data.

    Returns:
        Frequency [Hz]; infinite for a parameter without influence.
    """
    replay = balances.replay
    moved = []
    for i, value in enumerate(values):
        there = [*values]
        there[i] += 1e-3 * abs(value) or 1e-3
        moved.append(there)
    return max(
        informative_frequencies(
            replay,
            replay.simulate_channels(free.record(values)),
            (replay.simulate_channels(free.record(there)) for there in moved),
            segments,
        )
    )


def identifiable_keys(
    balances: Balances, train: Segments
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the keys of identifiable parameters, and why other uncertain parameters are left out.

    Args:
        balances: balances of the ship and the recordings.
        train: segments of the fitted data.

    Raises:
        UnidentifiableError: no parameter is identifiable.
    """
    ship = balances.replay.ship
    free = Free(ship, doubtful(ship))
    fitter = Fitter(balances, bands_of(balances, train), free=free.keys)
    search = OutputError(fitter, free)
    fit = fitter.evaluate_record(free.record(free.values))
    columns = search.slopes(free.values, fit)
    # The noise is that which would remain if the parameters explained as much as they can.
    sizes = np.abs(np.array(free.values))[:, None, None]
    everything = Likelihood(fitter.bands, np.concatenate([columns * sizes, fitter.nuisance]))
    weight = everything(fit.difference).weight
    information = fitter.likelihood.information(weight, columns)
    count = len(free.keys)
    # The tolerances of the other parameters reduce the information.
    own, crossed = information[:count, :count], information[:count, count:]
    own = own - crossed @ np.linalg.solve(information[count:, count:], crossed.T)
    rest, left = distinguishable(free.keys, free.values, own)
    if not rest:
        why = "; ".join(f"{key}: {reason}" for key, reason in left.items())
        raise UnidentifiableError(
            f"these recordings identify no parameter of {ship.name}: {why}", free.keys, ()
        )
    return tuple(free.keys[i] for i in rest), left
