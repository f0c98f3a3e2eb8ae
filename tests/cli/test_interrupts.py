"""Ctrl-C at any time ends with exit code 130 and one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import shaftline

ROOT = Path(shaftline.__file__).resolve().parents[1]
FINDER = """
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Finder())
sys.argv = ["shaftline", {command!r}, *{rest!r}]
from shaftline.cli.main import main
main()
"""


@pytest.mark.parametrize(
    ("name", "command", "rest"),
    [
        ("typer", "list", []),
        ("rich.table", "list", []),
        ("shaftline.cli.simulate_command", "simulate", ["--case", "rack_step", "--out", "o.csv"]),
        ("shaftline.cli.task_options", "train", ["--help"]),
        ("numba", "simulate", ["--case", "rack_step", "--out", "o.csv"]),
        ("shaftline.plant.dynamics", "diagnose", ["--example"]),
        ("shaftline.mismatch", "identify", ["o.csv", "--ship", "frigate", "--out", "id"]),
    ],
)
def test_while_a_module_loads(name: str, command: str, rest: list[str], tmp_path: Path) -> None:
    program = FINDER.format(name=name, command=command, rest=rest)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(ROOT), "PATH": "", "HOME": str(tmp_path)},
    )
    assert done.returncode == 130, done.stderr
    said = [line for line in done.stderr.splitlines() if line and line != "loading"]
    assert len(said) == 1, done.stderr
    assert said[0].startswith("stopped")
    assert list(tmp_path.glob("*.csv")) == []
