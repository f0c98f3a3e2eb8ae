"""The verdict on a model of the structure search, and why a recording is explained in part only."""

from __future__ import annotations

import numpy as np

from ..judge.findings import at_bound, implausible
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, UNEXPLAINED
from ..judge.whiteness import Whiteness
from ..search.fitting import Fit
from .choice import Ranked
from .model import Floats
from .output_error import OutputError

OF_NOISE = 2.0
"""Times the noise of every channel up to which a held-out error is noise."""


def noise_limit(problem: OutputError) -> Floats:
    """Return the rms error of each channel up to which it is noise, in the channels' units."""
    return OF_NOISE * np.array([problem.replay.noise_rms[c] for c in problem.names])


def within_noise(problem: OutputError, error: Floats) -> bool:
    """Return whether the rms error of every channel is noise."""
    return bool(np.all(error <= noise_limit(problem)))


def verdict_on(
    best: Ranked, problem: OutputError, whiteness: Whiteness, fit: Fit, gain: float
) -> tuple[str, list[str]]:
    """Return the verdict on a chosen model, and remarks on why it is explained in part only.

    Args:
        best: the model.
        problem: that fitted it.
        whiteness: of its residuals.
        fit: its effects as the balances have them.
        gain: of the corrected ship, without clock skews, on the held-out data in 2 log L.
    """
    quiet = within_noise(problem, best.held) or whiteness.colour(fit) is None
    far = problem.moved_far(best.model)
    if not best.model.effects:
        return (NOTHING if quiet and not far else UNEXPLAINED), []
    ship = problem.trial_ship
    limits = (limit(ship, placed) for placed in fit.effects for limit in (at_bound, implausible))
    reasons = [said for said in limits if said]
    if not quiet:
        reasons.append("more than noise is left on the held-out data")
    if far:
        reasons.append(
            f"{', '.join(problem.priors[k].key for k in far)} moved far from the ship file"
        )
    if gain < 0.0:
        reasons.append(
            "the corrected ship, which has no clock skews, is less likely on the held-out data than "
            f"the ship file by {-gain:.0f} in 2 log L"
        )
    if not reasons:
        return EXPLAINED, []
    return PARTLY, [f"explained in part only, because {'; '.join(reasons)}"]
