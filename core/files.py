"""Files: only real ones are read, nobody ever sees half of one, and what cannot be is said first.

What is too much for a machine, said before any of it is asked for.
"""

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
"""Of a file of settings: a ship, a column map, a recipe [bytes]."""

LARGEST_RESULT = 1_000_000_000
"""Of a file of results that we wrote [bytes]."""


class FileError(ValueError):
    """A file that cannot be read or written; the message names it."""


def refuse_special(path: Path) -> None:
    """Refuse what is there under a name and is no ordinary file: a folder, a device, a pipe, a socket.

    Raises:
        FileError: names it.
    """
    try:
        special = path.exists() and not path.is_file()
    except (OSError, ValueError) as error:  # a name too long, or with a null in it
        raise FileError(f"{str(path)!r}: cannot be a file: {error}") from None
    if special:
        what = "a folder" if path.is_dir() else "no ordinary file but a device, a pipe or a socket"
        raise FileError(f"{path}: is {what}")


def check_writable(path: Path, folder: bool = False) -> None:
    """Refuse a place that cannot be written to, before the work whose result it shall hold.

    Args:
        path: of a file or a folder; nothing of it needs to be there, and nothing is left there.
        folder: which of the two.

    Raises:
        FileError: a device, a name that no file can have, or a folder that is read-only or full.
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
    """Return why a file cannot be read, without error numbers and the names of libraries' internals.

    Args:
        error: of the operating system, of a parser or of Python.
    """
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return " ".join(str(error).split())


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """The text of a file.

    Args:
        path: of the file.
        largest: its size may be [bytes].

    Raises:
        FileError: not an ordinary file, larger, unreadable, or no text.
    """
    try:
        refuse_special(path)
        size = path.stat().st_size
        if size > largest:
            raise FileError(f"{path}: {size / 1e6:.0f} MB; at most {largest / 1e6:.0f} MB are read")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(f"{path}: cannot be read: it is not UTF-8 text; save it as such") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {reason_of(error)}") from None


def toml_of(text: str, source: str) -> dict[str, Any]:
    """A TOML text as a tree.

    Args:
        text: of a file.
        source: named in the message.

    Raises:
        FileError: not valid, or nested too deeply.
    """
    try:
        return tomllib.loads(text)
    except (
        tomllib.TOMLDecodeError,
        ValueError,
    ) as error:  # a number of too many digits is a ValueError
        raise FileError(f"{source}: not valid TOML: {error}") from None
    except RecursionError:
        raise FileError(f"{source}: not valid TOML: nested too deeply") from None


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as a tree; raises as :func:`read_text` and :func:`toml_of`."""
    return toml_of(read_text(path), str(path))


def read_json(path: Path) -> Any:
    """What a JSON file of one of our own folders holds.

    Raises:
        FileError: it cannot be read, or is damaged.
    """
    try:
        return json.loads(read_text(path, LARGEST_RESULT))
    except (ValueError, RecursionError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{path}: damaged, no valid JSON ({error}); remove it") from None


_written: list[set[str]] = []


@contextmanager
def recorded() -> Iterator[set[str]]:
    """Collect the real paths of the files that are written in a block."""
    _written.append(set())
    try:
        yield _written[-1]
    finally:
        _written.pop()


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it into place.

    Raises:
        FileError: what is there is no ordinary file.
        OSError: the folder cannot be written to; nothing is left behind.
    """
    refuse_special(path)
    if path.is_symlink():  # the file that it points to is replaced, not the link
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
    """Write a JSON file; numbers that are not finite are refused."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


LARGEST_BYTES = 8e9
"""That one run may keep in memory."""


class SizeError(ValueError):
    """More than a machine holds; the message says of what."""


def check_size(count: float, bytes_each: float, what: str) -> None:
    """Refuse what would take more than :data:`LARGEST_BYTES`.

    Args:
        count: how many.
        bytes_each: of memory each.
        what: they are, and what decides their number, for the message.

    Raises:
        SizeError: how many there would be and how many there may be.
    """
    most = LARGEST_BYTES / bytes_each
    if not count <= most:
        told = f"{count:.3g}" if math.isfinite(count) else "endlessly many"
        raise SizeError(f"{told} {what}: at most {most:.2g} fit into {LARGEST_BYTES / 1e9:g} GB")
