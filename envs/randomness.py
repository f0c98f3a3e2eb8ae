"""White noise inside the compiled kernels, from a generator whose state is one integer of the episode.

NumPy's generators cannot run in a kernel that steps many environments, each with its own stream. This
module uses SplitMix64 (Steele, Lea & Flood 2014) and the ziggurat with 128 layers (Marsaglia & Tsang
2000, in the form of Doornik 2005). The NumPy generator of the environment draws the integer at reset, so
a seed determines all noise.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.records import Floats

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)
_LAYERS = 128
_TAIL = 3.442619855899  # right end of the lowest layer
_AREA = 9.91256303526217e-3  # of each layer


def _edges() -> Floats:
    """Return the right edges of the layers, lowest layer first; shape (129,)."""
    edges = np.zeros(_LAYERS + 1)
    height = math.exp(-0.5 * _TAIL**2)
    edges[0], edges[1] = _AREA / height, _TAIL
    for i in range(2, _LAYERS):
        height += _AREA / edges[i - 1]
        edges[i] = math.sqrt(-2.0 * math.log(height))
    return edges


_EDGES = _edges()
_INSIDE = _EDGES[1:] / _EDGES[:-1]  # share of a layer that is entirely under the curve


@compiled
def _bits(episode: Record) -> np.uint64:
    """Return the next 64 random bits."""
    episode.random = episode.random + _GOLDEN
    z = episode.random
    z = (z ^ (z >> np.uint64(30))) * _MIX1
    z = (z ^ (z >> np.uint64(27))) * _MIX2
    return np.uint64(z ^ (z >> np.uint64(31)))


@compiled
def _uniform(bits: np.uint64) -> float:
    """Return a number in [0, 1) from the upper 53 of 64 bits."""
    return float(bits >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@compiled
def normal(episode: Record) -> float:
    """Return the next standard normal number of the episode's stream."""
    while True:
        bits = _bits(episode)
        layer = np.int64(bits & np.uint64(_LAYERS - 1))  # the bits that _uniform does not use
        u = 2.0 * _uniform(bits) - 1.0
        x = u * _EDGES[layer]
        if abs(u) < _INSIDE[layer]:
            return float(x)
        if layer == 0:  # The tail beyond the lowest layer follows Marsaglia (1964).
            while True:
                beyond = -math.log(1.0 - _uniform(_bits(episode))) / _TAIL
                if -2.0 * math.log(1.0 - _uniform(_bits(episode))) > beyond * beyond:
                    return math.copysign(_TAIL + beyond, u)
        lower = math.exp(-0.5 * (_EDGES[layer] ** 2 - x * x))
        upper = math.exp(-0.5 * (_EDGES[layer + 1] ** 2 - x * x))
        if upper + _uniform(_bits(episode)) * (lower - upper) < 1.0:
            return float(x)
