"""A damaged cache of kernels is dropped and made again; no bit of it is run."""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import runpy
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numba
import pytest
from llvmlite.binding import get_host_cpu_features

import shaftline
from shaftline.core import kernel_cache
from shaftline.core.kernel_cache import source_digest

PROGRAM = """
from shaftline.core.compiled import compiled

@compiled
def triple(x):
    return 3.0 * x

print(triple(2.0), sum(triple.stats.cache_hits.values()))
"""


def _forget_sources() -> None:
    """Forget the digests of sources, as a new process has none."""
    for cached in (source_digest, kernel_cache._digest, kernel_cache._imports):
        cached.cache_clear()


def _run(folder: Path, program: str = "kernel.py") -> tuple[float, int]:
    """Run a program in this process; its kernel is a new one and looks for its own cache files."""
    _forget_sources()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as said:
        patch.setattr(numba.config, "CACHE_DIR", str(folder / "kept"))
        runpy.run_path(str(folder / program))
    value, hits = said.getvalue().split()
    return float(value), int(hits)


def _run_apart(folder: Path, program: str = "kernel.py", processor: str = "") -> tuple[float, int]:
    """Run a program in another process."""
    root = Path(shaftline.__file__).resolve().parents[1]
    done = subprocess.run(
        [sys.executable, program],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={
            "PYTHONPATH": str(root),
            "NUMBA_CACHE_DIR": str(folder / "kept"),
            "PATH": "",
            **({"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""} if processor else {}),
        },
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
"""Sources of a package; ``hull``, ``filter``, ``case`` and ``ship`` have kernels."""
KERNELS = ("plant/hull", "observers/deep/filter", "reproductions/case", "plant/ship")


def _write(root: Path, sources: dict[str, str]) -> None:
    for name, text in sources.items():
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def _digests(root: Path) -> dict[str, str]:
    """Return the digest of each module with kernels, as a new process reads them."""
    _forget_sources()
    return {name: source_digest(root / f"{name}.py", root) for name in KERNELS}


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
def test_an_edit_changes_the_digests_that_depend_on_it(
    edited: str, stale: set[str], tmp_path: Path
) -> None:
    _write(tmp_path, SOURCES)
    before = _digests(tmp_path)
    _write(tmp_path, {edited: SOURCES[edited] + "# edited\n"})
    after = _digests(tmp_path)
    assert {name for name in KERNELS if after[name] != before[name]} == stale


def test_an_import_of_the_package_depends_on_its_init(tmp_path: Path) -> None:
    _write(tmp_path, SOURCES | {"plant/hull.py": "from . import Ship\n"})
    before = _digests(tmp_path)
    _write(tmp_path, {"plant/ship.py": "# edited\n"})
    after = _digests(tmp_path)
    assert all(after[name] != before[name] for name in KERNELS)


def test_neither_the_place_nor_the_age_of_a_source_matters(tmp_path: Path) -> None:
    _write(tmp_path / "a", SOURCES)
    _write(tmp_path / "b", SOURCES)
    os.utime(tmp_path / "b" / "plant" / "water.py", (1000, 1000))
    assert _digests(tmp_path / "a") == _digests(tmp_path / "b")


def test_kernels_of_earlier_sources_are_deleted(tmp_path: Path) -> None:
    """Names of cache files contain the line of the function, so an edit above it gives new ones."""
    (tmp_path / "kernel.py").write_text(PROGRAM)
    (tmp_path / "kernels.py").write_text(PROGRAM)  # of another module
    _run(tmp_path)
    _run(tmp_path, "kernels.py")
    (tmp_path / "kernel.py").write_text(f"\n{PROGRAM}")
    assert _run(tmp_path) == (6.0, 0)
    kept = sorted(file.name.split("-")[0] for file in (tmp_path / "kept").rglob("*triple*.nbc"))
    assert kept == ["kernel.triple", "kernels.triple"]
    assert _run(tmp_path) == (6.0, 1)
    assert _run(tmp_path, "kernels.py") == (6.0, 1)
    (tmp_path / "kernel.py").write_text(PROGRAM)
    assert _run_apart(tmp_path) == (6.0, 0)
    assert _run_apart(tmp_path) == (6.0, 1)


@pytest.mark.skipif(
    not kernel_cache.runs_portable(get_host_cpu_features()), reason="not of that processor"
)
def test_a_portable_kernel_is_run_where_there_is_no_other(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(PROGRAM)
    assert _run_apart(tmp_path, processor="x86-64-v2") == (6.0, 0)
    assert _run_apart(tmp_path) == (6.0, 0)  # a kernel for another processor is not run
    (tmp_path / "kernels.py").write_text(PROGRAM)
    assert _run_apart(tmp_path, "kernels.py", "x86-64-v3") == (6.0, 0)
    assert _run_apart(tmp_path, "kernels.py") == (6.0, 1)


def test_a_portable_kernel_needs_every_feature() -> None:
    features = dict.fromkeys(kernel_cache.NEEDED, True)
    assert kernel_cache.runs_portable(features)
    assert not any(kernel_cache.runs_portable(features | {name: False}) for name in features)
