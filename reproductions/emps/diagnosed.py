"""What ``diagnose`` names where the ship's file has the published numbers, no friction and no offset."""

from __future__ import annotations

import pandas as pd
import scipy

from shaftline.mismatch import Options, diagnose
from shaftline.mismatch.estimate import Tick, silent

from .runs import COULOMB, OFFSET, PUBLISHED, VISCOUS, Recordings, errors, rig

EVERY = (1, 5, 10, 20)
"""Of the recording's rows, one in so many is kept: 1000, 200, 100 and 50 Hz."""

PASSED = 0.4
"""Of the rate that is kept: cut-off of the filter, at most :data:`MOST_HZ`; zero-phase Butterworth of
fourth order on force and position alike."""

MOST_HZ = 40.0

QUICK = Options(quick=True)
"""The first search alone; the page of rigs has both."""

FILES = {
    "no Coulomb friction, no offset": {COULOMB: 0.0, OFFSET: 0.0},
    "no friction at all, no offset": {COULOMB: 0.0, OFFSET: 0.0, VISCOUS: 0.0},
}


def diagnosed(runs: Recordings, tick: Tick = silent) -> pd.DataFrame:
    """Verdict, names and sizes at every rate, raw and filtered; the validation's run is set aside.

    Returns:
        A row each, with the corrected ship's errors on the validation's run at 1 kHz.
    """
    rows = []
    tried = [(f, e, k) for f in FILES for e in EVERY for k in ("raw", "filtered")]
    for count, (file, every, kind) in enumerate(tried):
        tick("diagnosing", count, len(tried))
        ship = rig().with_values({**PUBLISHED, **FILES[file]})
        estimation, validation = (
            _logged(table, every, kind == "filtered")
            for table in (runs.estimation, runs.validation)
        )
        found = diagnose(ship, estimation, hold_out=[validation], options=QUICK)
        position, velocity = errors(found.corrected, runs.validation)
        rows.append(
            {
                "file": file,
                "rate_Hz": 1000 // every,
                "recording": kind,
                "verdict": found.verdict,
                "named": ", ".join(
                    f"{f.effect.id} {f.estimates[0].value:.4g}" for f in found.findings
                ),
                "judged_to_Hz": found.highest_Hz,
                "demands": "lines" if found.line else "held",
                "validation_mm": position,
                "validation_velocity_percent": velocity,
            }
        )
    tick("diagnosing", len(tried), len(tried))
    return pd.DataFrame(rows)


def _logged(table: pd.DataFrame, every: int, filtered: bool) -> pd.DataFrame:
    if filtered:
        low = scipy.signal.butter(4, min(PASSED * 1000.0 / every, MOST_HZ), output="sos", fs=1000.0)
        table = table.assign(
            **{
                c: scipy.signal.sosfiltfilt(low, table[c].to_numpy())
                for c in table
                if c != "time_s"
            }
        )
    return table.iloc[::every].reset_index(drop=True)
