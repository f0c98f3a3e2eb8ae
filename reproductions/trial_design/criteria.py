"""Two criteria by which a trial can be chosen.

The published one is that of Strouwen and Micluța-Câmpeanu 2026 (arXiv 2604.01231).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from shaftline.mismatch.planning.evidence import Noise, Predictions, evidence_of

Criterion = Callable[[Predictions, Sequence[Noise]], float]


def wrong_choice(predictions: Predictions, noise: Sequence[Noise]) -> float:
    """Return the planner's merit: minus the logarithm of the bound of a wrong choice's probability."""
    return evidence_of(predictions, noise).merit()


def largest_differences(predictions: Predictions, noise: Sequence[Noise]) -> float:
    """Return the published criterion: the mean over all pairs of the largest squared difference.

    Each instrument is divided by its noise, so that several can be compared.
    """
    scaled = predictions.own / np.array([one.sd for one in noise])[:, None]
    return float(np.mean([np.max((a - b) ** 2) for k, a in enumerate(scaled) for b in scaled[:k]]))


PLANNER, PUBLISHED, RANDOM = "planner", "published", "random"
CRITERIA: Mapping[str, Criterion] = {PLANNER: wrong_choice, PUBLISHED: largest_differences}
