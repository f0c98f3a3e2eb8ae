"""Several ships at once: numbers of a kernel that hold the values of :data:`LANES` ships.

A kernel that is called with such numbers computes all ships with one instruction where it would need
one for each. The equations are those of a single ship, in the same order and with the same roundings,
so the results are equal to the bit.

A branch must be the same for all ships. Where they disagree, the kernel raises a
:class:`DisagreementError`, and the caller computes the ships one after the other. So :func:`where`
replaces branches in which ships often differ. A kernel under :func:`one_by_one` computes each ship by
itself.
"""

from .boxes import box_shape, put_lane, put_lanes, take_lane, take_lanes
from .kernels import one_by_one
from .numbers import LANES, DisagreementError, everywhere, of_kind, where
from .records import are_alike, block_shape, fill_block, ships_of

__all__ = [
    "LANES",
    "DisagreementError",
    "are_alike",
    "block_shape",
    "box_shape",
    "everywhere",
    "fill_block",
    "of_kind",
    "one_by_one",
    "put_lane",
    "put_lanes",
    "ships_of",
    "take_lane",
    "take_lanes",
    "where",
]
