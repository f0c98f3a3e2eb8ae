"""``shaftline dataset``, and the example that imitates what it records."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Command
from .test_bad_input import refused

EXAMPLE = Path(__file__).parents[2] / "examples" / "behaviour_cloning.py"


def test_what_is_recorded_can_be_imitated(shaftline: Command, tmp_path: Path) -> None:
    """Twelve episodes are enough for a clone to be better than random actions."""
    pytest.importorskip("minari")
    result = shaftline(
        "dataset",
        "--task",
        "speed-keeping",
        "--quality",
        "expert",
        "--episodes",
        12,
        "--out",
        tmp_path,
    )
    assert result.exit_code == 0, result.output
    assert "shaftline/speed-keeping/expert-v0" in result.output
    found = subprocess.run(
        [
            sys.executable,
            str(EXAMPLE),
            "--datasets",
            str(tmp_path),
            "--episodes",
            "3",
            "--dataset",
            "shaftline/speed-keeping/expert-v0",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    returns = dict(
        line.split(": ") for line in found.stdout.splitlines() if line.startswith("return")
    )
    clone, drawn = (float(returns[f"return of {name}"]) for name in ("the clone", "random actions"))
    assert clone > drawn + 100.0


def test_an_unknown_quality_is_refused(shaftline: Command, tmp_path: Path) -> None:
    pytest.importorskip("minari")
    result = shaftline("dataset", "--quality", "best", "--out", tmp_path)
    refused(result, "unknown quality 'best'; known: expert, medium, random")
