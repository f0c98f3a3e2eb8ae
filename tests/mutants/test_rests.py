"""What rests on a definition, at whatever distance and however it is taken."""

from __future__ import annotations

from pathlib import Path

import pytest

from .rests import Rests

ROOT = Path(__file__).parents[2]
ROOMS = ("core", "plant", "observers", "baselines", "envs")


@pytest.fixture(scope="module")
def rests() -> Rests:
    files = [f.relative_to(ROOT).as_posix() for room in ROOMS for f in (ROOT / room).rglob("*.py")]
    return Rests(ROOT, files)


def line_of(file: str, text: str) -> int:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    return next(i for i, line in enumerate(lines, 1) if text in line)


def test_the_environment_rests_on_the_hull(rests: Rests) -> None:
    found = rests.on("plant/hull.py", line_of("plant/hull.py", "def resistance("))
    assert {("plant/dynamics.py", "loads"), ("envs/kernel.py", "control_interval")} <= found
    assert ("plant/propeller.py", "propeller_load") not in found


def test_what_discovers_classes_rests_on_every_file_beside_it(rests: Rests) -> None:
    file = "observers/random_walk_kalman.py"
    found = rests.on(file, line_of(file, "class "))
    assert {("observers/registry.py", "_dispatch"), ("observers/registry.py", "update")} <= found
    assert ("envs/kernel.py", "control_interval") in found
