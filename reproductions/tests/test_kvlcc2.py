"""KVLCC2: identification from straight parts of zig-zags, evaluated on whole zig-zags."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reproductions.kvlcc2 import oblique, page, turning
from reproductions.kvlcc2 import runs as numbers
from reproductions.kvlcc2.runs import (
    APPROACH_SPEED,
    BEFORE,
    CHANNELS,
    NAMES,
    RUDDER,
    SMALL,
    SPEED,
    SWAY,
    THRUST,
    UNSEEN,
    YAW,
    Errors,
    Runs,
    drift_at_propeller,
    load_runs,
    loads_at,
    ship_of,
    straight_parts,
    straight_rows,
)
from shaftline.display import figures
from shaftline.mismatch import identify
from shaftline.mismatch.identify import Identification
from shaftline.plant import RecordingError, Ship

from .tanker import OMEGA, tanker


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Ship:
    return tanker(tmp_path_factory.mktemp("kvlcc2"))


def a_run(seconds: float = 20.0) -> pd.DataFrame:
    """Return a straight run that a test modifies."""
    time = np.arange(0.0, seconds, 0.05)
    return pd.DataFrame({"time_s": time, SPEED: 1.1, SWAY: 0.0, YAW: 0.0, RUDDER: 0.0})


def test_loads_are_those_of_the_table_at_the_measured_speed(own: Ship) -> None:
    speed = np.array([1.179, 0.7])
    thrust, torque = loads_at(own, speed, np.full(2, OMEGA))
    n = OMEGA / (2.0 * np.pi)
    j = 0.6 * speed / (n * 0.204)
    assert thrust == pytest.approx(1000.0 * n**2 * 0.204**4 * (0.32 - 0.35 * j), rel=1e-6)
    assert torque == pytest.approx(1000.0 * n**2 * 0.204**5 * 0.1 * (0.37 - 0.35 * j), rel=1e-6)
    better = own.with_values({numbers.EFFICIENCY: 1.05})
    assert loads_at(better, speed, np.full(2, OMEGA))[1] == pytest.approx(torque / 1.05)


def test_the_printed_numbers_are_in_balance_at_the_approach_speed(own: Ship) -> None:
    thrust, _ = loads_at(own, np.array([APPROACH_SPEED]), np.array([2.0 * np.pi * 10.23]))
    resistance = own.parameter(numbers.RESISTANCE).value * APPROACH_SPEED**2
    assert 0.75 * thrust[0] == pytest.approx(resistance, rel=1e-3)


def test_drift_at_the_propeller_is_larger_in_a_turn_than_amidships() -> None:
    """A turning ship drifts outwards, and its stern, aft of midship, further than its middle."""
    run = a_run(1.0).assign(**{SWAY: -0.05, YAW: 0.03})
    assert drift_at_propeller(run) == pytest.approx(np.arctan2(-0.05 - 3.386 * 0.03, 1.1))


@pytest.mark.parametrize(
    ("column", "value"),
    [(SWAY, 0.04), (YAW, np.radians(0.25)), (RUDDER, np.radians(-7.0))],
)
def test_straight_parts_end_where_drift_yaw_or_rudder_begin(column: str, value: float) -> None:
    run = a_run()
    run.loc[200:219, column] = value
    assert straight_rows(run, SMALL) == [(60, 200), (220, 400)]
    run.loc[230:399, column] = value  # ten rows in between are too few
    assert straight_rows(run, SMALL) == [(60, 200)]


def test_before_the_first_order_only_the_first_rows_count() -> None:
    run = a_run()
    run.loc[20:100, RUDDER] = np.radians(1.5)
    assert straight_rows(run, BEFORE) == [(0, 20)]
    run.loc[5, RUDDER] = np.radians(1.5)
    assert straight_rows(run, BEFORE) == []


def test_the_unseen_run_gives_no_parts() -> None:
    blank = dict.fromkeys(CHANNELS[1:4], 1.0)
    runs = {"z_10_10_p": a_run(10.0).assign(**blank), UNSEEN: a_run().assign(**blank)}
    (part,) = straight_parts(runs, SMALL)
    assert (len(part), part["time_s"].iloc[0]) == (140, 0.0)
    assert tuple(part) == CHANNELS


def test_straight_parts_tell_wake_and_a_ratio_of_the_hull(own: Ship) -> None:
    """Eight parts of a ship that differs in wake, eta_R and resistance, each with its own wake."""
    rng = np.random.default_rng(3)
    parts = []
    for _ in range(8):
        wake = 0.45 + 0.01 * rng.standard_normal()
        truth = own.with_values({numbers.WAKE: wake, numbers.EFFICIENCY: 1.04})
        part = a_run(4.0)[["time_s", SPEED]].assign(shaft_speed_rad_s=OMEGA)
        part[SPEED] = 1.16 + 2e-4 * rng.standard_normal(len(part))
        thrust, torque = loads_at(
            truth, part[SPEED].to_numpy(), part["shaft_speed_rad_s"].to_numpy()
        )
        part[THRUST] = thrust + 0.1 * rng.standard_normal(len(part))
        part["shaft_torque_N_m"] = torque + 0.002 * rng.standard_normal(len(part))
        parts.append(part[[*CHANNELS]])
    found = identify(own, *parts, free=numbers.FREE)
    held = np.mean([part[THRUST].mean() for part in parts]) * 0.75 / 1.16**2
    assert found.parameters[numbers.WAKE] == pytest.approx(0.45, abs=0.012)
    assert found.parameters[numbers.EFFICIENCY] == pytest.approx(1.04, abs=0.004)
    assert found.parameters[numbers.RESISTANCE] == pytest.approx(held, rel=0.03)
    with pytest.raises(ValueError, match="not identifiable"):
        identify(own, *parts, free=numbers.REFUSED[0])
    by_itself = identify(own, *parts)
    assert set(by_itself.parameters) == set(numbers.FREE)
    why = by_itself.left_out[numbers.DEDUCTION]
    assert why == f"only its combination with {numbers.RESISTANCE} is identifiable"


def test_the_best_constant_wake_is_the_one_that_made_the_thrust(own: Ship) -> None:
    run = a_run().assign(shaft_speed_rad_s=OMEGA, shaft_torque_N_m=1.0)
    run[SPEED] = np.linspace(1.1, 0.7, len(run))
    truth = own.with_values({numbers.WAKE: 0.33})
    run[THRUST] = loads_at(truth, run[SPEED].to_numpy(), run["shaft_speed_rad_s"].to_numpy())[0]
    wake, least = numbers.best_wake(own, run)
    assert wake == pytest.approx(0.33, abs=1e-3)
    assert least < 0.02 < 1.0 < numbers.errors(own, run).thrust


@pytest.fixture(scope="module")
def folder() -> Path:
    found = Path(os.environ.get("SHAFTLINE_DATA", "")) / "recordings" / "kvlcc2_hsva"
    if "SHAFTLINE_DATA" not in os.environ or not found.is_dir():
        pytest.skip(
            "needs recordings/kvlcc2_hsva in the folder SHAFTLINE_DATA (docs/recordings.md)"
        )
    return found


@pytest.fixture(scope="module")
def runs(folder: Path) -> Runs:
    return load_runs(folder)


@pytest.fixture(scope="module")
def ship(folder: Path) -> Ship:
    return ship_of(folder)


@pytest.fixture(scope="module")
def small(ship: Ship, runs: Runs) -> Identification:
    return numbers.identify_straight(ship, runs, SMALL)


def test_the_straight_parts_have_more_wake_than_is_printed(small: Identification) -> None:
    """Found 0.468 (0.456 to 0.481)."""
    low, high = small.estimates[0].ci95
    assert 0.445 < low < 0.46 < high < 0.49
    assert small.parameters[numbers.EFFICIENCY] == pytest.approx(1.039, abs=0.003)


def test_before_the_first_order_the_wake_is_about_the_printed_one(ship: Ship, runs: Runs) -> None:
    found = numbers.identify_straight(ship, runs, BEFORE)
    assert found.parameters[numbers.WAKE] == pytest.approx(0.40, abs=0.01)


def test_resistance_and_thrust_deduction_are_refused_together(ship: Ship, runs: Runs) -> None:
    said = numbers.refusals(ship, runs)
    assert set(said) == set(numbers.REFUSED)
    assert "hull.thrust_deduction are not identifiable together" in said[numbers.REFUSED[1]]


def test_the_unseen_zigzag_comes_near_what_a_constant_wake_can_reach(
    ship: Ship, runs: Runs, small: Identification
) -> None:
    """3.47 -> 3.07 N, where 3.05 is the least."""
    table = numbers.zigzag_errors(ship, {"small_drift": small.identified}, {UNSEEN: runs[UNSEEN]})
    (row,) = table.to_dict("records")
    assert row["unseen"] == "yes"
    assert row["thrust_before_N"] == pytest.approx(3.47, abs=0.01)
    assert row["thrust_least_N"] == pytest.approx(3.05, abs=0.01)
    assert row["thrust_least_N"] < row["thrust_small_drift_N"] < 3.15


def test_the_page_tells_every_run(
    ship: Ship,
    runs: Runs,
    small: Identification,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sensitivity = pd.DataFrame(
        [{"title": BEFORE.title, "from_s": 0.0}, {"title": SMALL.title, "from_s": 3.0}]
    )
    sensitivity = sensitivity.assign(
        drift_deg=1.0,
        yaw_deg_s=1.0,
        rudder_deg=1.0,
        parts=8,
        rows=80,
        wake_fraction=0.4,
        wake_fraction_se=0.01,
        relative_rotative_efficiency=1.0,
        resistance_coefficient_N_s2_m2=25.0,
    )
    others = numbers.identify_variants(ship, runs, SMALL)
    here = oblique.fixed_hull(ship)
    errors = {name: Errors(1.25, 0.031) for name in oblique.FITTED}
    tried = tuple(oblique.Tried(form, 4, errors) for form in oblique.FORMS)
    said_of: Any = SimpleNamespace(
        verdict="unexplained",
        findings=[],
        corrected=here,
        ranking=[],
        sentence="what the tool says",
    )
    own = oblique.Own(here, tried, here, said_of, said_of, said_of, Errors(0.9, 0.02))
    steered: Any = SimpleNamespace()  # tested separately
    monkeypatch.setattr(page, "turning_section", lambda found: "how the ship manoeuvres")
    monkeypatch.setattr(turning, "figure_of", lambda *_: figures.new_figure(1, 1, (4.0, 3.0))[0])
    found = page.Findings(ship, runs, small, small, {}, sensitivity, others, own, steered)
    page.write(tmp_path, found)
    said = (tmp_path / "kvlcc2.md").read_text()
    assert all(f"| {name}" in said for name in NAMES)
    assert f"{small.parameters[numbers.WAKE]:.3f} (" in said
    assert len(pd.read_csv(tmp_path / "kvlcc2.csv")) == len(NAMES)
    assert "what the tool says" in said
    assert "how the ship manoeuvres" in said
    assert "| 1.25 | 31 |" in said
    assert (tmp_path / "figures" / "kvlcc2-own-term.png").stat().st_size > 10_000
    assert (tmp_path / "figures" / "kvlcc2.png").stat().st_size > 10_000


def test_missing_recordings_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["kvlcc2", "--recordings", str(tmp_path)])
    with pytest.raises(RecordingError, match=r"z_05_01\.csv"):
        page.main()
    with pytest.raises(RecordingError, match=r"open_water\.csv"):
        ship_of(tmp_path)
