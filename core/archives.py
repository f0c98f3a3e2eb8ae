"""NumPy archives that are safe to load from others: without Python objects, and of limited size."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .files import write_atomically

SKELETON = "skeleton"
"""Member that describes the structure of the tree in :func:`pack_tree`."""

_ARRAY, _PAIRS, _TUPLE = "array", "pairs", "tuple"


class ArchiveError(ValueError):
    """A file that is no archive of numbers, or one that is too large."""


def write_archive(path: Path, arrays: dict[str, NDArray[Any]], *, compressed: bool = True) -> None:
    """Write named arrays to one file, atomically."""
    save: Any = np.savez_compressed if compressed else np.savez

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            save(file, **arrays)

    write_atomically(path, write)


def read_archive(path: Path, limit_bytes: float = 1e8) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file, by name.

    Raises:
        ArchiveError: the file is no archive of numbers, is damaged, or exceeds ``limit_bytes`` in
            memory, which is checked before the arrays are read.
    """
    try:
        refuse_large_archive(path, limit_bytes, ArchiveError)
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except ArchiveError:
        raise
    except Exception as error:  # Damaged files make zipfile, zlib and numpy raise nearly any error.
        raise ArchiveError(
            f"{path}: not a NumPy archive of numbers, or damaged ({type(error).__name__}: {error}); "
            "write or download it again"
        ) from None


def refuse_large_archive(path: Path, limit_bytes: float, error: type[ValueError]) -> None:
    """Refuse a zip archive that exceeds a size when it is unpacked, by an error of a class.

    A file that is no zip archive raises an error of :mod:`zipfile`.
    """
    with zipfile.ZipFile(path) as members:
        size = sum(member.file_size for member in members.infolist())
    if size > limit_bytes:
        raise error(
            f"{path}: unpacks to {size / 1e6:.0f} MB; at most {limit_bytes / 1e6:.0f} MB are read"
        )


def pack_tree(tree: Any) -> dict[str, NDArray[Any]]:
    """Return a tree of dicts, lists, tuples, arrays, numbers and texts as named arrays.

    Leaves may also be torch tensors; a leaf of another type raises a TypeError.
    """
    arrays: dict[str, NDArray[Any]] = {}

    def skeleton_of(value: Any) -> Any:
        if isinstance(value, dict):
            return {_PAIRS: [[key, skeleton_of(part)] for key, part in value.items()]}
        if isinstance(value, (list, tuple)):
            parts = [skeleton_of(part) for part in value]
            return {_TUPLE: parts} if isinstance(value, tuple) else parts
        if hasattr(value, "detach"):
            value = value.detach().cpu().numpy()
        if isinstance(value, (np.ndarray, np.generic)):
            name = f"{_ARRAY}-{len(arrays)}"
            arrays[name] = np.asarray(value)
            return {_ARRAY: name}
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        raise TypeError(
            f"{type(value).__name__} cannot be stored; use dicts, lists, tuples, arrays, numbers, texts"
        )

    skeleton = json.dumps(skeleton_of(tree))
    return {SKELETON: np.frombuffer(skeleton.encode(), dtype=np.uint8), **arrays}


def unpack_tree(arrays: dict[str, NDArray[Any]]) -> Any:
    """Return the tree that :func:`pack_tree` stored, tensors as arrays; else raise an ArchiveError."""

    def tree(skeleton: Any) -> Any:
        if isinstance(skeleton, list):
            return [tree(part) for part in skeleton]
        if isinstance(skeleton, dict):
            ((kind, inside),) = skeleton.items()
            if kind == _ARRAY:
                return arrays[inside]
            if kind == _TUPLE:
                return tuple(tree(part) for part in inside)
            return {key: tree(part) for key, part in inside}
        return skeleton

    try:
        return tree(json.loads(bytes(arrays[SKELETON]).decode()))
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise ArchiveError(f"the archive does not contain a stored tree ({error})") from None
