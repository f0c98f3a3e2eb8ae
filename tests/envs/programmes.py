"""Scripted programmes: what an agent may do without looking, from sensible to hopeless."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

TRIP = (-1.0, 1.0)
"""Least pitch and full fuel: the engine runs away."""
STALL = (1.0, -1.0)
"""Full pitch and no fuel: the engine stops."""


def scripted(intervals: int, actions: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return more than 200 programmes of actions, shape (intervals, programmes, actions).

    Constant actions on a grid, steps, ramps, sinusoids, bang-bang and random ones. Where the rudder is
    an action it is amidships, hard over, or random.

    Args:
        intervals: control intervals of an episode.
        actions: 2, or 3 with the rudder.
        rng: draws the random programmes and the rudder.
    """
    time = np.arange(intervals)[:, None] / max(intervals - 1, 1)
    grid = np.linspace(-1.0, 1.0, 9)
    programmes = [np.broadcast_to(pair, (intervals, 2)) for pair in itertools.product(grid, grid)]
    programmes.append(np.broadcast_to((-1.0, 0.2), (intervals, 2)))
    corners = [np.array(pair) for pair in itertools.product((-1.0, 0.2, 1.0), repeat=2)]
    for start, end in itertools.permutations(corners, 2):
        if len(programmes) % 2:
            programmes.append(start + (end - start) * time)
        else:
            programmes.append(np.where(time < rng.uniform(), start, end))
    for period, shift in itertools.product((2.0, 4.0, 9.0, 20.0, 60.0), np.linspace(0.0, 3.0, 4)):
        angle = 2.0 * np.pi * np.arange(intervals)[:, None] / period
        wave = np.hstack([np.sin(angle), np.sin(angle + shift)])
        programmes += [0.5 * wave, np.sign(wave + 1e-9)]
    programmes += list(rng.uniform(-1.0, 1.0, (20, intervals, 2)))
    held = rng.uniform(-1.0, 1.0, (20, intervals // 5 + 1, 2))
    programmes += [np.repeat(rows, 5, axis=0)[:intervals] for rows in held]
    found = np.clip(np.stack(programmes, axis=1), -1.0, 1.0)
    if actions == 3:
        n = found.shape[1]
        rudder = rng.choice((-1.0, 0.0, 1.0), (1, n, 1)) * np.ones((intervals, 1, 1))
        rudder[:, ::4] = rng.uniform(-1.0, 1.0, (intervals, len(range(0, n, 4)), 1))
        found = np.concatenate([found, rudder], axis=2)
    return np.asarray(found, dtype=np.float32)
