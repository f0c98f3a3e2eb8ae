"""A change to a kernel reaches the machine code of all that call it, and goes with the change."""

from __future__ import annotations

from pathlib import Path

import pytest

from .changes import Change, changes
from .rests import Rests
from .tree import Tree
from .worker import PASSED, TIMED_OUT

ROOT = Path(__file__).parents[2]
ROOMS = ["core", "plant"]
LOW = "core/numeric.py"

TEST = """
from shaftline.plant import load_ship
from shaftline.plant.actuators import pitch_rate
from shaftline.plant.hull import resistance

def test_it():
    plant = load_ship("frigate").with_values({"pitch_actuator.rate_limit_per_s": 0.1}).record()
    assert pitch_rate(plant, 1.4, 0.6) == 0.1
    assert resistance(plant, 2.0, 1.0) == 4.0 * 3306.2
"""


def the_change(file: str, source: str, what: str) -> Change:
    (found,) = (
        c for c in changes((ROOT / file).read_bytes()) if c.source == source and c.what == what
    )
    return found


@pytest.mark.slow
def test_a_change_deep_down_is_compiled_into_what_the_tests_run(tmp_path: Path) -> None:
    files = [f.relative_to(ROOT).as_posix() for room in ROOMS for f in (ROOT / room).rglob("*.py")]
    tree = Tree(ROOT, tmp_path, ROOMS, Rests(ROOT, files))
    test = "tests/plant/test_of_the_tree.py"
    (tree.root / test).write_text(TEST)

    def code(changed: bool = True) -> int:
        return int(tree.test([test], 300.0, changed=changed)["code"])

    def machine_code(room: str) -> dict[Path, int]:
        return {kept: kept.stat().st_mtime_ns for kept in (tree.root / room).rglob("*.nb?")}

    try:
        assert code(changed=False) == PASSED  # and everything is compiled
        before = machine_code("plant") | machine_code("core")
        assert (tree.root / "plant/__pycache__").is_dir()
        change = the_change(LOW, "if value.real > high.real:", "`>` -> `<=`")
        with tree.with_change(LOW, change):
            assert code() == 1
        assert code() == PASSED
        assert machine_code("plant") | machine_code("core") == before
        change = the_change(
            "plant/hull.py",
            "factor = resistance_factor * (1.0 + plant.hull_fouling)",
            "`1.0` -> `1.1`",
        )
        with tree.with_change("plant/hull.py", change):
            assert code() == 1
        assert machine_code("plant") | machine_code("core") == before

        (tree.root / test).write_text("def test_it():\n    while True:\n        pass\n")
        assert tree.test([test], 5.0)["code"] == TIMED_OUT
        (tree.root / test).write_text("import os\ndef test_it():\n    os.abort()\n")
        assert code() == 1
        (tree.root / test).write_text("import shaftline.plant.nothing\n")
        found = tree.test([test], 60.0)
        assert found["code"] != PASSED
        assert test in found["failed"]
    finally:
        tree.close()
