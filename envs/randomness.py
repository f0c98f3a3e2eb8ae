"""White noise inside the kernels: a generator whose whole state is one integer of the episode.

NumPy's generators cannot run in a kernel that steps many environments, each with its own stream. This is
SplitMix64 (Steele, Lea & Flood 2014) with the Box-Muller transform; the integer is drawn by the
environment's own NumPy generator at reset, so a seed fixes everything.
"""

from __future__ import annotations

import math

import numpy as np

from ..plant.compiled import Record, compiled

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)


@compiled
def _uniform(episode: Record) -> float:
    """Next number in [0, 1)."""
    episode.random = episode.random + _GOLDEN
    z = episode.random
    z = (z ^ (z >> np.uint64(30))) * _MIX1
    z = (z ^ (z >> np.uint64(27))) * _MIX2
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@compiled
def two_normals(episode: Record) -> tuple[float, float]:
    """Two independent standard normal numbers from the episode's stream."""
    radius = math.sqrt(-2.0 * math.log(1.0 - _uniform(episode)))
    angle = 2.0 * math.pi * _uniform(episode)
    return radius * math.cos(angle), radius * math.sin(angle)
