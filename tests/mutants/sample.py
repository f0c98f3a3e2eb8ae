"""Which changes are tried: a sample that a seed decides, folder by folder."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from .changes import Change, changed, changes, makes_other_code
from .mirror import draws, mirror

SHARES = {
    "core": 30,
    "plant": 150,
    "observers": 60,
    "baselines": 60,
    "envs": 60,
    "agents": 60,
    "mismatch": 60,
}
"""Changes to each folder in a whole sample."""


class Mutant(NamedTuple):
    """A change to a file of the product, and the tests that should notice it."""

    file: str  # below the root
    change: Change
    tests: tuple[str, ...]
    key: str  # of what it depends on

    @property
    def folder(self) -> str:
        """Top-level folder of the file."""
        return self.file.split("/")[0]

    def __str__(self) -> str:
        return f"{self.file}:{self.change.line}: {self.change.what} in `{self.change.source}`"


def sample(
    root: Path, size: int, seed: int, only: list[str], also: Mapping[str, list[str]]
) -> list[Mutant]:
    """Draw changes, at most one to a line of code.

    The draw goes by the text of the line, not by its place: an edit elsewhere leaves it as it is.

    Args:
        root: of the repository.
        size: changes in all, shared out by :data:`SHARES`; of files in ``only``, that many.
        seed: of the draw.
        only: files or folders to which the draw is confined.
        also: further modules by the test file that serves them.
    """
    if only:
        return _draw(root, only, size, seed, also)
    whole = sum(SHARES.values())
    shares = {folder: round(size * share / whole) for folder, share in SHARES.items()}
    return [m for folder, n in shares.items() for m in _draw(root, [folder], n, seed, also)]


def _draw(
    root: Path, places: list[str], size: int, seed: int, also: Mapping[str, list[str]]
) -> list[Mutant]:
    lots = []
    for file in _files(root, places):
        data = (root / file).read_bytes()
        lines: dict[int, list[Change]] = {}
        for change in changes(data):
            lines.setdefault(change.line, []).append(change)
        twins: dict[str, int] = {}
        for choice in lines.values():
            text = choice[0].source
            twins[text] = twins.get(text, -1) + 1
            lot = _number(seed, file, text, twins[text])
            lots.append((lot, file, choice[lot % len(choice)]))
    found: list[Mutant] = []
    for _, file, change in sorted(lots):
        if len(found) == size:
            break
        data = (root / file).read_bytes()
        if makes_other_code(data, change):
            tests = mirror(root, file, dict(also))
            found.append(
                Mutant(file, change, tuple(tests), _key(root, changed(data, change), tests))
            )
    return found


def _files(root: Path, places: list[str]) -> list[str]:
    paths = [root / place for place in places]
    files = [file for p in paths for file in ([p] if p.is_file() else sorted(p.rglob("*.py")))]
    names = [file.relative_to(root).as_posix() for file in files]
    return [name for name in names if not draws(root, name)]


def _number(*of: object) -> int:
    return int.from_bytes(hashlib.sha256(repr(of).encode()).digest()[:8])


def _key(root: Path, text: bytes, tests: list[str]) -> str:
    """A name that changes with the changed file, its tests, and what these share."""
    digest = hashlib.sha256(text)
    rooms = {(root / test).parent for test in tests}
    helpers = [f for room in rooms for f in room.glob("*.py") if not f.name.startswith("test_")]
    for file in (*(root / test for test in tests), *sorted(helpers), root / "tests/conftest.py"):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
