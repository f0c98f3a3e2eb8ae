"""Real rigs, read as the page reads them; one of them diagnosed."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd
import pytest

from reproductions.rigs import RIGS, Rig, describe_findings, errors, write
from shaftline.mismatch import Options, diagnose
from shaftline.mismatch.recordings.joint import load_jointly

FOLDER = Path(os.environ.get("SHAFTLINE_DATA", "nowhere")) / "recordings"
needs_recordings = pytest.mark.skipif(
    not (FOLDER / "dc_motor_generator").is_dir(), reason="needs recordings under SHAFTLINE_DATA"
)


@needs_recordings
@pytest.mark.parametrize("rig", RIGS, ids=[rig.folder for rig in RIGS])
def test_every_rig_is_read(rig: Rig) -> None:
    given = rig.load(FOLDER / rig.folder)
    together = load_jointly(given.ship, given.fitted, given.unseen, given.columns)
    assert together.held_out == len(given.unseen)


@needs_recordings
def test_the_generator_s_open_armature_friction_and_lag_are_found_together() -> None:
    """Independent fits reach 6.0 rad/s on the half that was not fitted; the file 207."""
    given = RIGS[0].load(FOLDER / RIGS[0].folder)
    others = (
        "supply-limit",
        "quadratic-drag",
        "viscous-friction",
        "speed-sensor-delay",
        "command-dead-zone",
        "load-friction",
        "direction-asymmetry",
    )
    found = diagnose(
        given.ship,
        *given.fitted,
        hold_out=given.unseen,
        options=Options(exclude=others),
    )
    ids = {f.effect.id: {c.effect.id for c in f.rivals} | {f.effect.id} for f in found.findings}
    assert len(ids) == 3
    for missing in ("open-circuit", "speed-sensor-lag", "coulomb-friction"):
        assert any(missing in named for named in ids.values()), (missing, describe_findings(found))
    before, after = errors(found)
    assert before == pytest.approx(208.0, rel=0.02)
    assert after < 6.0


def test_the_page_has_a_row_for_each_rig(tmp_path: Path) -> None:
    row = dict.fromkeys(
        ("rig", "missing", "verdict", "named", "parameters", "unit", "file", "quick",
         "full", "bound", "quick_named", "quick_verdict", "trap"), "x"
    )  # fmt: skip
    text = write(tmp_path, pd.DataFrame([row, row | {"rig": "another"}])).read_text(
        encoding="utf-8"
    )
    assert text.count("| another |") == 3
    assert all(rig.trap in text for rig in RIGS)
