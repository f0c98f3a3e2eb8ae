"""User files: checks, safe input, atomic output, and limits of size and memory."""

from __future__ import annotations

import json
import math
import os
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

LARGEST_TEXT = 20_000_000
"""Largest file of settings: a ship, a column map, a recipe [bytes]."""

LARGEST_RESULT = 1_000_000_000
"""Largest file of results written by the package [bytes]."""


class FileError(ValueError):
    """A file that cannot be read or written; the message names it."""


def refuse_special(path: Path) -> None:
    """Refuse a folder, a device, a pipe or a socket in place of an ordinary file, with a FileError."""
    try:
        special = path.exists() and not path.is_file()
    except (OSError, ValueError) as error:  # the name is too long or contains a NUL character
        raise FileError(f"{str(path)!r}: cannot be a file: {error}") from None
    if special:
        what = "a folder" if path.is_dir() else "no ordinary file but a device, a pipe or a socket"
        raise FileError(f"{path}: is {what}")


def check_writable(path: Path, folder: bool = False) -> None:
    """Refuse a path of a file or folder that is not writable, before the computation of its content.

    The path need not exist, and the check leaves nothing behind.

    Raises:
        FileError: a device, an invalid file name, or a folder that is read-only or full.
    """
    if not (folder and path.is_dir()):
        refuse_special(path)
    places = [path.absolute(), *path.absolute().parents]
    nearest = next(place for place in places[0 if folder else 1 :] if place.exists())
    if not nearest.is_dir():
        raise FileError(f"{path}: {nearest} is a file, so nothing can be written below it")
    try:
        with tempfile.TemporaryFile(dir=nearest) as probe:
            probe.write(bytes(4096))
            probe.flush()
    except OSError as error:
        raise FileError(f"{path}: cannot be written to: {error.strerror}") from None


def reason_of(error: BaseException) -> str:
    """Return why a file cannot be read, without error numbers and names of library internals."""
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return " ".join(str(error).split())


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """Return the text of a file of at most ``largest`` bytes.

    Raises:
        FileError: not an ordinary file, too large, unreadable, or no text.
    """
    try:
        refuse_special(path)
        size = path.stat().st_size
        if size > largest:
            most = f"at most {largest / 1e6:.0f} MB are read"
            raise FileError(f"{path}: has {size / 1e6:.0f} MB; {most}")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(f"{path}: cannot be read: it is not UTF-8 text; save it as UTF-8") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {reason_of(error)}") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return a TOML text as a tree; a FileError names its source and says why it is invalid."""
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, or a number with too many digits
        raise FileError(f"{source}: not valid TOML: {error}") from None
    except RecursionError:
        raise FileError(f"{source}: not valid TOML: nested too deeply") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file as a tree; raises the errors of :func:`read_text` and :func:`parse_toml`."""
    return parse_toml(read_text(path), str(path))


def read_json(path: Path) -> Any:
    """Return the content of a JSON file that the package has written, or raise a FileError."""
    try:
        return json.loads(read_text(path, LARGEST_RESULT))
    except (ValueError, RecursionError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{path}: damaged, not valid JSON ({error}); remove the file") from None


_written: list[set[str]] = []


@contextmanager
def record_written_files() -> Iterator[set[str]]:
    """Collect the real paths of the files that are written in a ``with`` block."""
    _written.append(set())
    try:
        yield _written[-1]
    finally:
        _written.pop()


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it to ``path``.

    Raises:
        FileError: ``path`` exists and is no ordinary file.
        OSError: the folder is not writable; nothing is left behind.
    """
    refuse_special(path)
    if path.is_symlink():  # Replace the file to which the link points, not the link.
        path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)
        temporary.replace(path)
        for names in _written:
            names.add(os.path.realpath(path))
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file."""
    write_atomically(path, lambda file: file.write_text(text, encoding="utf-8"))


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file; numbers that are not finite raise an error."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


LARGEST_BYTES = 8e9
"""Largest memory of one run [bytes]."""


class SizeError(ValueError):
    """A computation that needs too much memory; the message says what needs it."""


def check_size(count: float, bytes_each: float, what: str) -> None:
    """Refuse a computation that would need more than :data:`LARGEST_BYTES`.

    ``what`` names the items and what determines their number. The SizeError gives the number of items
    and the largest possible number.
    """
    most = LARGEST_BYTES / bytes_each
    if not count <= most:
        number = f"{count:.3g}" if math.isfinite(count) else "infinitely many"
        raise SizeError(f"{number} {what}: at most {most:.2g} fit into {LARGEST_BYTES / 1e9:g} GB")
