"""The positioning system: the real recordings, where they are, and the rig's file everywhere."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions.emps import page
from reproductions.emps.runs import (
    COULOMB,
    FILES,
    KEYS,
    MASS,
    OFFSET,
    POSITION,
    PUBLISHED,
    Recordings,
    diagnose_all,
    errors,
    fit_position,
    identify_all,
    load_runs,
    references,
    rig,
)
from shaftline.mismatch import identify
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

FOLDER = Path(os.environ.get("SHAFTLINE_DATA", "nowhere")) / "recordings" / "emps"
needs_recordings = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="needs recordings/emps under SHAFTLINE_DATA"
)


def moved(ship: Ship, rows: int = 4000) -> pd.DataFrame:
    """A short run of the rig to and fro, at 1 kHz."""
    time = 0.001 * np.arange(rows)
    force = 60.0 * np.sign(np.sin(3.0 * time + 0.2)) * (1.0 + 0.2 * np.sin(40.0 * time))
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": force, POSITION: 0.0})
    return table.assign(**{POSITION: simulate_recording(ship, table)[POSITION]})


def test_errors_are_of_the_run_from_the_force_alone() -> None:
    ship = rig().with_values(PUBLISHED)
    table = moved(ship)
    start = 0.02  # the first speed is estimated from three rows
    assert errors(ship, table) == pytest.approx((0.0, 0.0), abs=start)
    shifted = table.assign(**{POSITION: table[POSITION] + 0.004})
    position, velocity = errors(ship, shifted)
    assert position == pytest.approx(0.0, abs=start)  # it starts where the recording does
    assert velocity == pytest.approx(0.0, abs=start)
    position, velocity = errors(ship.with_values({OFFSET: 0.0}), table)
    assert position > 1.0
    assert velocity > 1.0


def test_the_least_position_error_of_its_own_run_is_none() -> None:
    ship = rig().with_values({**PUBLISHED, MASS: 100.0, COULOMB: 22.0})
    found = fit_position(moved(ship))
    for key in KEYS:
        assert found.parameter(key).value == pytest.approx(ship.parameter(key).value, rel=2e-3), key


@pytest.fixture(scope="module")
def runs() -> Recordings:
    return load_runs(FOLDER)


@needs_recordings
def test_the_published_numbers_carry_as_far_as_is_said(runs: Recordings) -> None:
    """102 % with mass and viscous friction alone, 18 with Coulomb friction, 7.4 with the offset."""
    ships = (
        rig().with_values({**PUBLISHED, COULOMB: 0.0, OFFSET: 0.0}),
        rig().with_values({**PUBLISHED, OFFSET: 0.0}),
        rig().with_values(PUBLISHED),
    )
    shares = [errors(ship, runs.validation)[1] for ship in ships]
    assert shares == pytest.approx([102.0, 18.0, 7.4], rel=0.04)


@needs_recordings
@pytest.mark.slow
@pytest.mark.parametrize("every", [5, 20])
def test_identify_finds_the_published_numbers(runs: Recordings, every: int) -> None:
    kept, judged = (
        table.iloc[::every].reset_index(drop=True) for table in (runs.estimation, runs.validation)
    )
    found = identify(rig(), kept, free=KEYS, hold_out=[judged])
    for key in KEYS[:3]:
        assert found.parameters[key] == pytest.approx(PUBLISHED[key], rel=0.02), key
    assert found.parameters[OFFSET] == pytest.approx(PUBLISHED[OFFSET], abs=0.15)
    assert errors(found.identified, runs.validation)[1] < 8.4


@needs_recordings
@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 10])
def test_diagnose_names_friction_and_offset_at_any_rate(
    runs: Recordings, monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    monkeypatch.setattr("reproductions.emps.runs.DIAGNOSED_EVERY", (every,))
    few = {name: FILES[name] for name in list(FILES)[:1]}
    monkeypatch.setattr("reproductions.emps.runs.FILES", few)
    for row in diagnose_all(runs).itertuples():
        assert row.verdict == "partly-explained"  # the encoder noise is far below the residual
        names = [said.split()[0] for said in row.named.split(", ")]
        assert names == ["coulomb-friction", "torque-offset"]
        assert row.validation_velocity_percent < 8.0


def few(monkeypatch: pytest.MonkeyPatch, files: int) -> None:
    """Make the tables short: one identification from each start, diagnoses at 50 Hz."""
    for name, value in (
        ("EVERY", (20,)),
        ("STICTIONS", (0.001,)),
        ("DIAGNOSED_EVERY", (20,)),
        ("FILES", dict(list(FILES.items())[:files])),
        ("fit_position", lambda recording: rig().with_values(PUBLISHED)),
    ):
        monkeypatch.setattr(f"reproductions.emps.runs.{name}", value)


@needs_recordings
def test_friction_and_offset_are_named(runs: Recordings, monkeypatch: pytest.MonkeyPatch) -> None:
    few(monkeypatch, 1)
    monkeypatch.setattr("reproductions.emps.runs.KINDS", ("raw",))
    (row,) = diagnose_all(runs).itertuples()
    assert row.verdict == "partly-explained"  # the encoder noise is far below the residual
    assert [said.split()[0] for said in row.named.split(", ")] == [
        "coulomb-friction",
        "torque-offset",
    ]
    assert row.validation_velocity_percent < 8.0


@needs_recordings
@pytest.mark.slow
def test_the_page_says_what_was_found(
    runs: Recordings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few(monkeypatch, 2)
    page.write(tmp_path, identify_all(runs), references(runs), diagnose_all(runs), runs)
    text = (tmp_path / "emps.md").read_text()
    assert "All 2 identifications are within 0." in text
    rows = [line.split(" | ") for line in text.splitlines() if "coulomb-friction" in line]
    verdicts = {file: {r[3] for r in rows if r[0].endswith(file)} for file in FILES}
    # friction and offset are identified; with no friction in the file, their forms are not
    told = {"explained", "partly-explained"}
    assert verdicts["no Coulomb friction, no offset"] <= told
    assert verdicts["no friction at all, no offset"] <= told
    assert (tmp_path / "figures" / "emps.png").stat().st_size > 20_000
