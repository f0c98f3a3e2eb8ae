"""Four-quadrant propeller loads from the B-series Fourier table.

CT*(beta) and CQ*(beta), beta = atan2(J, 0.7 pi), as 31-term Fourier series (Roddy, Hess & Faller,
NSWCCD-50-TR-2006/004). The table has no five-bladed propeller with variable pitch. A controllable-pitch
propeller uses the B4-70 family at P/D 0.5 to 1.4, each member scaled so that KT and KQ at bollard pull
equal those of the ship's own B-series propeller.

Where the shaft turns against the inflow (J = v_a / n D below 0), the opposing flows form a ring vortex
and KQ is not monotonic: it falls from a peak near J = 0 to a dip and rises again, so three inflows have
the same torque.
"""

from __future__ import annotations

import math
from importlib import resources

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Real, compiled
from ..core.numeric import clip

HARMONICS = 31
PITCH_NODES = (0.5, 0.6, 0.8, 1.0, 1.2, 1.4)
TABLE_SHAPE = (len(PITCH_NODES), HARMONICS, 4)
_FAMILY_BLADES, _FAMILY_AREA = 4, 0.7


def b4_70_family() -> NDArray[np.float64]:
    """Return the Fourier coefficients of the B4-70 family, shape (6, 31, 4).

    The axes are P/D node, harmonic, and (CT cos, CT sin, CQ cos, CQ sin), all [-]. The table's factors
    (CT x 100, CQ x 1000 with a minus sign) are removed.
    """
    with resources.files("shaftline.plant").joinpath("data/four_quadrant_b_series.csv").open() as f:
        table = pd.read_csv(f)
    family = table.query("blades == @_FAMILY_BLADES and expanded_area_ratio == @_FAMILY_AREA")
    columns = ["ct_cos_x100", "ct_sin_x100", "cq_cos_x1000", "cq_sin_x1000"]
    factors = np.array([1e-2, 1e-2, -1e-3, -1e-3])
    nodes = [
        family[family["pitch_ratio"] == pitch].sort_values("k")[columns].to_numpy() * factors
        for pitch in PITCH_NODES
    ]
    return np.stack(nodes)


def scaled_to_bollard(
    kt_bollard: NDArray[np.float64], kq_bollard: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the B4-70 family scaled to KT and KQ [-] at bollard pull, shape (6, 31, 4)."""
    table = b4_70_family()
    pitch = np.array(PITCH_NODES)
    for i, p in enumerate(PITCH_NODES):
        kt, kq = four_quadrant_coefficients(table, pitch, 0.0, 1.0, p)
        table[i, :, :2] *= kt_bollard[i] / kt
        table[i, :, 2:] *= kq_bollard[i] / kq
    return table


def ring_vortex(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return J [-] of the dip and of the peak of KQ(J), to 0.001, shape (2, nodes, 2).

    Rotation ahead comes first. ``table`` holds the Fourier coefficients, shape (nodes, 31, 4). KQ falls
    with J above the peak and below the dip; a curve without exactly one dip and one peak raises a
    ValueError.
    """
    j = np.arange(-1.0, 0.5, 1e-3)
    ahead = np.arctan2(j, 0.7 * math.pi)
    k = np.arange(HARMONICS)[:, None]
    ends = np.empty((2, len(table), 2))
    for side, beta in enumerate((ahead, ahead + math.pi)):
        cq = table[:, :, 2] @ np.cos(k * beta) + table[:, :, 3] @ np.sin(k * beta)
        kq = (1.0, -1.0)[side] * cq * (j * j + (0.7 * math.pi) ** 2)
        for node, rises in enumerate(np.diff(kq) > 0.0):
            turns = np.flatnonzero(np.diff(rises)) + 1
            if len(turns) != 2:
                found = f"{len(turns)} extrema instead of a dip and a peak"
                raise ValueError(f"KQ of pitch node {node} has {found}")
            ends[side, node] = j[turns]
    return ends


@compiled
def between_nodes(nodes: NDArray[np.float64], pitch_ratio: Real) -> tuple[int, Real]:
    """Return the node below a pitch ratio and the interpolation weight of the next node, in [0, 1]."""
    i = 0
    while i < len(nodes) - 2 and pitch_ratio.real > nodes[i + 1]:
        i += 1
    return i, clip((pitch_ratio - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0)


@compiled
def four_quadrant_coefficients(
    table: NDArray[np.float64],
    nodes: NDArray[np.float64],
    velocity_per_diameter: Real,
    revolutions: Real,
    pitch_ratio: Real,
) -> tuple[Real, Real]:
    """Return KT n^2 and KQ n^2 [1/s2] in any quadrant, at v_a / D and n [1/s] of either sign.

    ``table`` holds the Fourier coefficients, shape (nodes, 31, 4), at the rising pitch ratios ``nodes``.
    They are linear in P/D between nodes and constant beyond the outer ones.

    KT n^2 = CT* (pi/8) ((v_a/D)^2 + (0.7 pi n)^2). The harmonics follow from cos(beta) and sin(beta) by
    rotation, so the angle itself is never computed and complex steps remain exact.
    """
    tangential = 0.7 * math.pi * revolutions
    square = velocity_per_diameter * velocity_per_diameter + tangential * tangential
    resultant = np.sqrt(square + 1e-300)  # above 0 at standstill
    cos1 = tangential / resultant
    sin1 = velocity_per_diameter / resultant

    i, weight = between_nodes(nodes, pitch_ratio)
    cosk = 1.0
    sink = 0.0
    ct = 0.0
    cq = 0.0
    for k in range(HARMONICS):
        low = table[i, k]
        high = table[i + 1, k]
        ct = ct + (low[0] + weight * (high[0] - low[0])) * cosk
        ct = ct + (low[1] + weight * (high[1] - low[1])) * sink
        cq = cq + (low[2] + weight * (high[2] - low[2])) * cosk
        cq = cq + (low[3] + weight * (high[3] - low[3])) * sink
        cosk, sink = cosk * cos1 - sink * sin1, sink * cos1 + cosk * sin1
    scale = math.pi / 8.0 * square
    return ct * scale, cq * scale
