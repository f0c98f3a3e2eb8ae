"""Every documented method of every command, on the files that our own commands write, for every ship.

A result, or a refusal with exit code 2 that names its reason. What is refused is listed here, so that a
method which stops working is no refusal.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.baselines import controller_names, helmsman_names
from shaftline.mismatch.identify import METHODS
from shaftline.plant import load_ship
from shaftline.plant.load_cases import CASES

from .walks import SHIPS, Files, done, numbers_of, one_key, packaged, refused, run

HELD = {"kvlcc2", "esso-osaka", "constant-revolutions"}
"""Ships whose drive holds the shaft's speed."""

TURNING = {"kvlcc2", "esso-osaka", "ddg-51-surrogate", "frigate-turning"}
NO_DIESEL = {name for name in SHIPS if packaged(name).prime_mover.type != "diesel"}
NO_VOLTAGE = {name for name in SHIPS if not packaged(name).has_voltage}

REFUSED = {
    **{("output-error-linear", s): "which the linear replay does not model" for s in HELD},
    **{
        ("output-error-linear", s): "the linear replay has no equations of turning" for s in TURNING
    },
    **{
        (m, s): "the drive of .* prescribes the shaft speed"
        for m in ("sine", "welch")
        for s in HELD
    },
    **{("step", s): "needs a motor with a voltage" for s in NO_VOLTAGE},
    **{
        ("step", s): "moves; the model of the drive train needs hull.fixed = true"
        for s in ("electric-fixed-pitch", "harbour-tug")
    },
}
"""What a method cannot do on a ship, and the reason that it gives."""

KINDS = {"sine": "sine", "welch": "noise"}
"""Recordings that a method needs; the others get a staircase."""

ALIKE = {
    "diesel-controllable-pitch",
    "thruster-on-a-bench",
    "ferry-printed",
    "tito-neri-staircase",
    "esso-osaka",
    "frigate-turning",
}
"""Ships on which another of the list has every part; walked in the slow tests alone."""

QUICK = ("steady", "step", "sine", "welch")
EACH_KIND = ("frigate-at-sea", "kvlcc2", "tito-neri-sine", "drive-with-load")
BY_FILTER = ("drive-with-load",)
"""A ship of each kind, on which the slower methods are walked in the fast tests too."""


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return Files(tmp_path_factory.mktemp("walk"))


def identified(files: Files, ship: str, method: str, out: Path, *free: str) -> None:
    """Walk one method on one ship."""
    recording = files.recording(ship, KINDS.get(method, "staircase"))
    result = run(
        "identify", recording, "--ship", files.ship(ship), "--method", method, "--out", out, *free
    )
    if (reason := REFUSED.get((method, ship))) is not None:
        assert refused(result, reason), result.output
        assert not (out / "report.json").exists()
        return
    done(result)
    load_ship(out / "identified_ship.toml")
    report = json.loads((out / "report.json").read_text())
    assert report["parameters"]
    assert np.isfinite(numbers_of(report)).all()


def quick_walks() -> Iterator[object]:
    for method, ship in itertools.product(QUICK, SHIPS):
        yield pytest.param(method, ship, marks=[pytest.mark.slow] if ship in ALIKE else [])


@pytest.mark.parametrize(("method", "ship"), quick_walks())
def test_methods_that_free_what_they_usually_find(
    method: str, ship: str, files: Files, tmp_path: Path
) -> None:
    identified(files, ship, method, tmp_path / "out")


def slower_walks() -> Iterator[object]:
    for method, ship in itertools.product([m for m in METHODS if m not in QUICK], SHIPS):
        fast = ship in EACH_KIND and (not method.startswith("ekf") or ship in BY_FILTER)
        yield pytest.param(method, ship, marks=[] if fast else [pytest.mark.slow])


@pytest.mark.parametrize(("method", "ship"), slower_walks())
def test_methods_that_simulate(method: str, ship: str, files: Files, tmp_path: Path) -> None:
    free = one_key(load_ship(files.ship(ship)))
    identified(files, ship, method, tmp_path / "out", "--free", free)


@pytest.mark.parametrize("ship", [pytest.param(s, marks=pytest.mark.slow) for s in SHIPS])
@pytest.mark.parametrize("method", [m for m in METHODS if METHODS[m].cut])
def test_methods_that_choose_by_the_recording(
    method: str, ship: str, files: Files, tmp_path: Path
) -> None:
    """``--free auto``; the filter may find that it cannot go by this recording, and then says so."""
    out = tmp_path / "out"
    result = run(
        "identify",
        files.recording(ship, "staircase"),
        "--ship",
        files.ship(ship),
        "--method",
        method,
        "--out",
        out,
    )
    reasons = [REFUSED.get((method, ship), "^$")]
    if method.startswith("ekf"):
        reasons += ["estimates of .* diverge", "are not identifiable together"]
    if not refused(result, *reasons):
        assert np.isfinite(numbers_of(json.loads((out / "report.json").read_text()))).all()


APPROACH = {"kvlcc2": 1.18, "esso-osaka": 3.6, "ddg-51-surrogate": 11.3, "frigate-turning": 9.0}
"""Speeds [m/s] from which each ship that turns begins her manoeuvres."""


def test_a_manoeuvre_s_tracks_are_recordings(files: Files, tmp_path: Path) -> None:
    ship = "ddg-51-surrogate"
    done(run("manoeuvre", "--ship", ship, "--speed", APPROACH[ship], "--out", tmp_path / "m"))
    done(run("check", tmp_path / "m" / "zig-zag-10-10-starboard.csv", "--ship", ship))


@pytest.mark.slow
@pytest.mark.parametrize("ship", APPROACH)
def test_a_manoeuvre_s_tracks_identify_a_coefficient(
    ship: str, files: Files, tmp_path: Path
) -> None:
    done(run("manoeuvre", "--ship", ship, "--speed", APPROACH[ship], "--out", tmp_path / "m"))
    zig_zag = tmp_path / "m" / "zig-zag-10-10-starboard.csv"
    out = tmp_path / "out"
    done(run("identify", zig_zag, "--ship", ship, "--free", "manoeuvring.N_r", "--out", out))
    found = load_ship(out / "identified_ship.toml").manoeuvring.N_r
    assert found == pytest.approx(load_ship(ship).manoeuvring.N_r, rel=0.01)


def some(ships: tuple[str, ...]) -> list[object]:
    """Return all ships, those beside one of each kind in the slow tests."""
    return [s if s in ships else pytest.param(s, marks=pytest.mark.slow) for s in SHIPS]


@pytest.mark.parametrize("ship", some(("tito-neri-sine",)))
def test_from_simulation_to_diagnosis_and_back(ship: str, files: Files, tmp_path: Path) -> None:
    recording, out, again = files.recording(ship, "staircase"), tmp_path / "d", tmp_path / "s.csv"
    done(run("check", recording, "--ship", files.ship(ship)))
    done(run("diagnose", recording, "--ship", files.ship(ship), "--out", out))
    assert json.loads((out / "report.json").read_text())["verdict"] == "nothing-missing"
    corrected = out / "corrected_ship.toml"
    done(run("simulate", "--ship", corrected, "--inputs", recording, "--out", again))
    before, after = pd.read_csv(recording), pd.read_csv(again)
    speed = "shaft_speed_rad_s"
    assert after[speed].to_numpy() == pytest.approx(before[speed].to_numpy(), rel=0.02)


@pytest.mark.parametrize("ship", some(("ferry", "drive-with-load")))
def test_from_simulation_to_an_identified_ship_s_loop(
    ship: str, files: Files, tmp_path: Path
) -> None:
    out, recording = tmp_path / "i", files.recording(ship, "staircase")
    common = ("identify", recording, "--ship", files.ship(ship), "--out", out)
    done(run(*common, "--free", one_key(packaged(ship))))
    found = out / "identified_ship.toml"
    drive = 0.55 * float(load_ship(found).record()["drive_max"])
    point = ("--drive", drive, "--output", "shaft_speed,shaft_torque")
    done(run("linearise", "--ship", found, *point, "--out", tmp_path / "l"))
    speed = float(pd.read_csv(recording)["ship_speed_m_s"].iloc[-1])
    loop = ("loop", "0.001/1,0", "--ship", found, "--speed", speed, "--out", tmp_path / "loop")
    result = run(*loop)
    if packaged(ship).moves:
        refused(result, "the closed loop is unstable")
    else:
        assert refused(result, "hull.fixed = true, but an approach needs")


NO_CONTROL = (
    "needs a diesel",
    "needs a controllable-pitch propeller",
    "needs a controllable pitch, but",
)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_ship_meets_controllers_and_helmsmen(ship: str, files: Files, tmp_path: Path) -> None:
    """The classic controllers command a diesel; other ships are refused by that."""
    vessel = packaged(ship)
    speed = (4 if vessel.has_diesel else 1) if vessel.moves else 0
    for controller in controller_names():
        if vessel.prime_mover.type == "diesel":
            continue
        common = (controller, "--ship", files.ship(ship), "--out", tmp_path / controller)
        assert refused(run("loop", *common, "--speed", speed), *NO_CONTROL), controller
        evaluated = run("evaluate", "--controller", *common, "--seeds", 1, "--episode-s", 5)
        assert refused(evaluated, *NO_CONTROL), controller
    if not vessel.turns:
        for helmsman in helmsman_names():
            result = run("loop", helmsman, "--ship", files.ship(ship), "--out", tmp_path)
            assert refused(result, "cannot be steered: the ship file has no manoeuvring"), helmsman
        result = run("manoeuvre", "--ship", files.ship(ship), "--speed", speed, "--out", tmp_path)
        assert refused(result, "cannot be steered|an approach needs a hull that moves"), ship


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "ship"),
    itertools.product(controller_names(), [s for s in SHIPS if s not in NO_DIESEL]),
)
def test_a_diesel_ship_is_evaluated_and_her_loop_shown(
    controller: str, ship: str, files: Files, tmp_path: Path
) -> None:
    refused(
        run("loop", controller, "--ship", files.ship(ship), "--speed", 5, "--out", tmp_path / "l"),
        "the closed loop is unstable",
        "--command .*: must be one of",
        "the analysis needs the methods",
        "cannot be linearised",
    )
    task = ("--task", "wave-preview") if controller.endswith("-preview") else ()
    done(
        run(
            "evaluate",
            "--controller",
            controller,
            "--ship",
            files.ship(ship),
            "--seeds",
            1,
            "--episode-s",
            5,
            "--jobs",
            1,
            "--out",
            tmp_path / "e",
            *task,
        )
    )


OBSERVER_NEEDS = (
    "needs a propeller, because it estimates the inflow",
    "needs the inertia behind the shaft torque meter",
    "needs a torque that depends on the inflow, but propeller.model is 'bollard'",
)


@pytest.mark.parametrize(
    "ship", some(("frigate", "kvlcc2", "thruster-on-a-bench", "drive-with-load"))
)
@pytest.mark.parametrize("observer", ["luenberger", "random-walk-kalman", "power-balance"])
def test_a_voyage_in_a_sea_with_an_observer(
    observer: str, ship: str, files: Files, tmp_path: Path
) -> None:
    file, inputs = tmp_path / "voyage.csv", files.recording(ship, "staircase")
    common = ("simulate", "--ship", files.ship(ship), "--inputs", inputs, "--sea", "state-4")
    result = run(*common, "--observer", observer, "--seed", 3, "--out", file)
    if not refused(result, *OBSERVER_NEEDS):
        estimate = pd.read_csv(file)["estimated_advance_velocity_m_s"]
        assert np.isfinite(estimate).all()


CASE_NEEDS = (
    "needs a propeller; .* has none",
    "needs a variable pitch; .* has a fixed pitch",
    "needs a hull that moves; .*'s is fixed",
)


@pytest.mark.parametrize("ship", some(("kvlcc2", "electric-fixed-pitch", "drive-with-load")))
@pytest.mark.parametrize("case", CASES)
def test_a_load_case_is_written_and_checked(
    case: str, ship: str, files: Files, tmp_path: Path
) -> None:
    file = tmp_path / "case.csv"
    result = run("simulate", "--ship", files.ship(ship), "--case", case, "--out", file)
    if not refused(result, *CASE_NEEDS):
        done(run("check", file, "--ship", files.ship(ship)))
