"""A damaged cache of kernels is dropped and made again; no bit of it is run."""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import shaftline
from shaftline.core.kernel_cache import drop_stale_kernels

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
        [sys.executable, "kernel.py"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(folder / "kept"), "PATH": ""},
    )
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.parametrize(
    ("ending", "damages"), [("nbi", ("cut", "flipped")), ("nbc", ("empty", "junk"))]
)
def test_a_damaged_file_is_made_again(
    ending: str, damages: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "kernel.py").write_text(PROGRAM)
    assert _run(tmp_path) == (6.0, 0)
    assert _run(tmp_path) == (6.0, 1)
    for damage in damages:
        (file,) = (tmp_path / "kept").rglob(f"*triple*.{ending}")
        good = file.read_bytes()
        middle = len(good) // 2
        file.write_bytes(
            {
                "cut": good[:middle],
                "empty": b"",
                "junk": b"\x80\x05K" * 50,
                "flipped": good[:middle] + bytes([good[middle] ^ 16]) + good[middle + 1 :],
            }[damage]
        )
        assert _run(tmp_path) == (6.0, 0), damage
        assert _run(tmp_path) == (6.0, 1), damage


def test_a_file_written_under_another_name_of_the_package_is_made_again(tmp_path: Path) -> None:
    """A checkout that a script imports by its folder's name pickles classes of that name."""
    (tmp_path / "kernel.py").write_text(PROGRAM)
    assert _run(tmp_path) == (6.0, 0)
    for ending in ("nbi", "nbc"):
        (file,) = (tmp_path / "kept").rglob(f"*triple*.{ending}")
        content = b"cmain.ship\nShip\n."  # pickle's opcode c names a global: module, then class
        if ending == "nbi":  # numba's version comes first
            content = pickle.dumps(numba.__version__) + content
        file.write_bytes(hashlib.sha256(content).digest() + content)
        assert _run(tmp_path) == (6.0, 0)
        assert _run(tmp_path) == (6.0, 1)


SOURCES = {
    "plant/__init__.py": "from .ship import Ship\n",
    "plant/ship.py": "",
    "plant/water.py": "DENSITY = 1025.0\n",
    "plant/hull.py": "from .water import (\n    DENSITY,\n)\n",
    "observers/__init__.py": "",
    "observers/deep/__init__.py": "",
    "observers/deep/filter.py": "from ...plant.hull import drag\n",
    "reproductions/__init__.py": "",
    "reproductions/case.py": "from shaftline.plant import hull\n",
    "cli/__init__.py": "",
    "cli/main.py": "from ..plant import Ship\n",
}
"""Sources of a package; kernels are cached for ``hull``, ``filter``, ``case`` and ``ship``."""
KERNELS = ("plant/hull", "observers/deep/filter", "reproductions/case", "plant/ship")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a package whose sources are of second 1000 and whose cached kernels of second 2000."""
    files = dict(SOURCES)
    for kernel in KERNELS:
        folder, _, name = kernel.rpartition("/")
        files |= {f"{folder}/__pycache__/{name}.run-1.py311.nb{end}": "" for end in "ic"}
        files[f"{folder}/__pycache__/{name}.cpython-311.pyc"] = ""
    for name, text in files.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        second = 1000 if name in SOURCES else 2000
        os.utime(file, (second, second))
    return tmp_path


def kept(root: Path) -> set[str]:
    """Return the kernels of which both cache files are left."""
    found = [
        (file.parent.parent / file.name.split(".")[0]).relative_to(root).as_posix()
        for file in root.rglob("*.nb[ic]")
    ]
    return {name for name in found if found.count(name) == 2}


def test_kernels_newer_than_every_source_are_kept(root: Path) -> None:
    drop_stale_kernels(root)
    assert kept(root) == set(KERNELS)


@pytest.mark.parametrize(
    ("edited", "stale"),
    [
        ("plant/water.py", {"plant/hull", "observers/deep/filter", "reproductions/case"}),
        ("plant/hull.py", {"plant/hull", "observers/deep/filter", "reproductions/case"}),
        ("observers/deep/filter.py", {"observers/deep/filter"}),
        ("plant/ship.py", {"plant/ship"}),
        ("cli/main.py", set()),
        ("plant/__init__.py", set()),
    ],
)
def test_an_edit_drops_the_kernels_that_depend_on_it(
    root: Path, edited: str, stale: set[str]
) -> None:
    os.utime(root / edited, (2001, 2001))
    drop_stale_kernels(root)
    assert kept(root) == set(KERNELS) - stale
    assert len(list(root.rglob("*.pyc"))) == len(KERNELS)


def test_an_import_of_the_package_depends_on_its_init(root: Path) -> None:
    (root / "plant" / "hull.py").write_text("from . import Ship\n")
    os.utime(root / "plant" / "hull.py", (1000, 1000))
    os.utime(root / "plant" / "ship.py", (2001, 2001))
    drop_stale_kernels(root)
    assert kept(root) == set()


def test_a_kernel_as_old_as_its_source_is_kept(root: Path) -> None:
    os.utime(root / "plant" / "hull.py", (2000, 2000))
    drop_stale_kernels(root)
    assert kept(root) == set(KERNELS)
