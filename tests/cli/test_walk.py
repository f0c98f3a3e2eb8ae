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
import pytest

from shaftline.mismatch.numbers.pipeline import METHODS
from shaftline.plant import load_ship

from .walks import SHIPS, Files, done, numbers_of, one_key, packaged, refused, run

HELD = {"kvlcc2", "esso-osaka", "constant-revolutions"}
"""Ships whose drive holds the shaft's speed."""

TURNING = {"kvlcc2", "esso-osaka", "ddg-51-surrogate", "frigate-turning"}
NO_VOLTAGE = {name for name in SHIPS if not packaged(name).has_voltage}

REFUSED = {
    **{("output-error-linear", s): "a speed that is held has no linear model" for s in HELD},
    **{("output-error-linear", s): "a ship that turns has no linear model" for s in TURNING},
    **{(m, s): "the drive of .* holds the shaft's speed" for m in ("sine", "welch") for s in HELD},
    **{("step", s): "has no motor with a voltage, but" for s in NO_VOLTAGE},
    ("step", "electric-fixed-pitch"): "moves; the drive train's model has hull.fixed = true",
}
"""What a method cannot do on a ship, and the reason that it gives."""

KINDS = {"sine": "sine", "welch": "noise"}
"""Recordings that a method needs; the others get a staircase."""

QUICK = ("steady", "step", "sine", "welch")
EACH_KIND = ("frigate-at-sea", "kvlcc2", "ddg-51-surrogate", "tito-neri-sine", "drive-with-load")
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
    yield from itertools.product(QUICK, SHIPS)


@pytest.mark.parametrize(("method", "ship"), quick_walks())
def test_methods_that_free_what_they_usually_find(
    method: str, ship: str, files: Files, tmp_path: Path
) -> None:
    identified(files, ship, method, tmp_path / "out")


def slower_walks() -> Iterator[object]:
    for method, ship in itertools.product([m for m in METHODS if m not in QUICK], SHIPS):
        yield pytest.param(method, ship, marks=[] if ship in EACH_KIND else [pytest.mark.slow])


@pytest.mark.parametrize(("method", "ship"), slower_walks())
def test_methods_that_simulate(method: str, ship: str, files: Files, tmp_path: Path) -> None:
    free = one_key(load_ship(files.ship(ship)))
    identified(files, ship, method, tmp_path / "out", "--free", free)
