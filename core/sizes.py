"""What is too much for a machine, said before any of it is asked for."""

from __future__ import annotations

import math

LARGEST_BYTES = 8e9
"""That one run may keep in memory."""


class SizeError(ValueError):
    """More than a machine holds; the message says of what."""


def check_size(count: float, bytes_each: float, what: str) -> None:
    """Refuse what would take more than :data:`LARGEST_BYTES`.

    Args:
        count: how many.
        bytes_each: of memory each.
        what: they are, and what decides their number, for the message.

    Raises:
        SizeError: how many there would be and how many there may be.
    """
    most = LARGEST_BYTES / bytes_each
    if not count <= most:
        told = f"{count:.3g}" if math.isfinite(count) else "endlessly many"
        raise SizeError(f"{told} {what}: at most {most:.2g} fit into {LARGEST_BYTES / 1e9:g} GB")
