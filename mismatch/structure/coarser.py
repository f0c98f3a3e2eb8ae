"""Recordings of fewer rows, for a search that simulates them thousands of times."""

from __future__ import annotations

import pandas as pd

from ..simulate.joint_replay import JointReplay, blocks

KEPT = 5
"""Rows that stay in each row of the replay's averages, at least."""


def coarser(replay: JointReplay, most: int) -> JointReplay:
    """Return a replay of means over the recordings' rows where they are many.

    Its averaged rows are those of the given replay: only rows that these average anyway are taken
    together beforehand. The commands are straight lines between the means.

    Args:
        replay: replay of the recordings.
        most: rows as recorded up to which the replay is returned as it is.
    """
    if replay.rows * replay.every <= most:
        return replay
    shares = [k for k in range(2, replay.every + 1) if replay.every % k == 0]
    shares = [k for k in shares if replay.every // k >= KEPT]
    if not shares:
        return replay
    tables = [
        pd.DataFrame(
            blocks(run.table.to_numpy(dtype=float), max(shares)), columns=run.table.columns
        )
        for run in replay.runs
    ]
    return JointReplay(replay.ship, *tables, line=True, every=replay.every // max(shares))
