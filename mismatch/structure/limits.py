"""Recordings on which effects and parameters cannot be estimated together."""

from __future__ import annotations

from ..simulate.joint_replay import JointReplay
from .feedback import answers_waves

ANSWERS = (
    "the command answers the waves, as that of a governor does, which a simulation without the waves "
    "would mistake for a lag; record steps of the command, or calm water"
)
"""Why the search is left out on a ship in waves with a governor."""

MOST_VALUES, MOST_ROWS = 120_000, 30_000
"""Averaged rows of the recordings times channels, and rows as recorded, above which the search takes too
long."""


def left_out(replay: JointReplay) -> str:
    """Return why effects and parameters are not estimated together; empty where they can be."""
    rows, values = replay.rows * replay.every, replay.rows * len(replay.channels)
    if rows > MOST_ROWS:
        return f"the recordings have {rows} rows, more than {MOST_ROWS}; shorten them"
    if values > MOST_VALUES:
        return f"the recordings have {values} values, more than {MOST_VALUES}; leave a channel out"
    return ANSWERS if answers_waves(replay) else ""
