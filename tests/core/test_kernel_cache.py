"""A damaged cache of kernels is dropped and made again; no bit of it is run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import shaftline

PROGRAM = """
from shaftline.core.compiled import compiled

@compiled
def triple(x):
    return 3.0 * x

print(triple(2.0), sum(triple.stats.cache_hits.values()))
"""


def _run(folder: Path) -> tuple[float, int]:
    root = Path(shaftline.__file__).resolve().parents[1]
    done = subprocess.run(
        [sys.executable, "kernel.py"], cwd=folder, capture_output=True, text=True, check=False,
        env={"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(folder / "kept"), "PATH": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "junk"])
def test_a_damaged_file_is_made_again(ending: str, damage: str, tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(PROGRAM)
    assert _run(tmp_path) == (6.0, 0)
    assert _run(tmp_path) == (6.0, 1)
    (file,) = (tmp_path / "kept").rglob(f"*triple*.{ending}")
    good = file.read_bytes()
    middle = len(good) // 2
    file.write_bytes({
        "cut": good[:middle], "empty": b"", "junk": b"\x80\x05K" * 50,
        "flipped": good[:middle] + bytes([good[middle] ^ 16]) + good[middle + 1 :],
    }[damage])  # fmt: skip
    assert _run(tmp_path) == (6.0, 0)
    assert _run(tmp_path) == (6.0, 1)
