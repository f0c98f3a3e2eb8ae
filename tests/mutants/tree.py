"""A scratch copy of the repository, in which one change at a time is made and tested.

Machine code is the difficulty. Numba keeps it on disk by the time stamp of the kernel's own file, so a
changed kernel would go unnoticed inside those that call it. So a change takes away what was compiled
from its definition and from every one that rests on it, and nothing else; what was taken away comes
back when the change is undone.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .changes import Change, changed
from .rests import PACKAGE, Name, Rests

LEFT_BEHIND = shutil.ignore_patterns(".*", "out", "build", "dist", "*.egg-info", "*.pyc")


class Tree:
    """A scratch copy with its worker.

    Args:
        source: the repository, or another tree's ``root``.
        place: folder to be made.
        rooms: the product's folders; what they import from elsewhere the worker has ready.
        rests: what rests on what in them.
    """

    def __init__(self, source: Path, place: Path, rooms: list[str], rests: Rests) -> None:
        self.rests = rests
        self.place = place
        self.root = place / PACKAGE  # installed and run from here
        shutil.copytree(source, self.root, ignore=LEFT_BEHIND)  # keeps time stamps
        environment = os.environ | {"PYTHONPATH": str(place)}
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        self.worker = subprocess.Popen(
            [sys.executable, "-m", "tests.mutants.worker", *rooms, "tests"],
            cwd=self.root,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def close(self) -> None:
        """End the worker."""
        self.worker.terminate()
        self.worker.communicate()

    def test(self, tests: list[str], limit_s: float, changed: bool = True) -> dict[str, Any]:
        """Run test files, up to the first test that fails.

        Returns:
            ``code`` of pytest, or :data:`.worker.TIMED_OUT`; the first that ``failed``, and why;
            ``seconds`` by test file.
        """
        order = {
            "tests": tests,
            "limit_s": limit_s,
            "changed": changed,
            "temporary": str(self.place / "temporary"),
            "findings": str(self.place / "findings"),
        }
        assert self.worker.stdin is not None
        assert self.worker.stdout is not None
        self.worker.stdin.write(json.dumps(order) + "\n")
        self.worker.stdin.flush()
        found: dict[str, Any] = json.loads(self.worker.stdout.readline())
        return found

    @contextmanager
    def with_change(self, file: str, change: Change) -> Iterator[None]:
        """Make a change, and undo it with all that was compiled from it."""
        path = self.root / file
        plain, stamp = path.read_bytes(), path.stat()
        resting = self.rests.on(file, change.line)
        store = self.place / "compiled"
        shutil.rmtree(store, ignore_errors=True)
        for kept in self._compiled(file, resting):
            aside = store / kept.relative_to(self.root)
            aside.parent.mkdir(parents=True, exist_ok=True)
            kept.rename(aside)
        try:
            path.write_bytes(changed(plain, change))
            # older than what was compiled from others, which is still right
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns - 2_000_000_000))
            yield
        finally:
            path.write_bytes(plain)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
            for wrong in self._compiled(file, resting):
                wrong.unlink()
            for aside in (file for file in store.rglob("*") if file.is_file()):
                aside.rename(self.root / aside.relative_to(store))

    def _compiled(self, file: str, names: set[Name]) -> list[Path]:
        """Machine code of some kernels, and all that was compiled from the changed file."""
        found = list((self.root / file).parent.glob(f"__pycache__/{Path(file).stem}.*"))
        for other in {other for other, _ in names} - {file}:
            path = self.root / other
            for kept in path.parent.glob(f"__pycache__/{path.stem}.*.nb[ic]"):  # stem.name-line.…
                name = kept.name.removeprefix(f"{path.stem}.").split("-")[0].split(".")[0]
                found += [kept] if (other, name) in names else []
        return found
