"""Which tests stand in the mirror of a module."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from .rests import imports


def mirror(root: Path, file: str, also: dict[str, list[str]]) -> list[str]:
    """Test files that answer for a module, the nearest first.

    First the one that has its name (``tests/plant/drives/test_diesel.py`` or
    ``tests/plant/test_diesel.py`` for ``plant/drives/diesel.py``; that of a folder for its
    ``__init__``), then those of the folder's tests that import it, then those that are declared to
    serve it; all tests of the folder where that is none.

    Args:
        root: of the repository.
        file: the module's path below it.
        also: by test file, further modules that it serves.
    """
    path = PurePosixPath(file)
    room = root / "tests" / path.parts[0]
    stem = path.parent.name if path.stem == "__init__" else path.stem
    tests = sorted(test.relative_to(root).as_posix() for test in room.rglob("test_*.py"))
    named = [test for test in tests if PurePosixPath(test).name == f"test_{stem}.py"]
    if len(named) > 1:  # the same name in two rooms of the folder
        within = (root / "tests" / path.parent).relative_to(root).as_posix()
        named = [test for test in named if str(PurePosixPath(test).parent) == within] or named
    taken = {test: {module for module, _ in imports(root, test).values()} for test in tests}
    importing = [test for test in tests if file in taken[test]]
    declared = [test for test, modules in also.items() if file in modules]
    return list(dict.fromkeys([*named, *importing, *declared])) or tests


def draws(root: Path, file: str) -> bool:
    """Whether a module makes figures: how they look is seen, not tested."""
    return b"import matplotlib" in (root / file).read_bytes()
