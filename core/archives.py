"""Numbers on disk that anyone may hand over: NumPy archives without objects, and not too large."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .files import write_atomically

SKELETON = "skeleton"
"""Member that tells how the others belong together."""

_ARRAY, _PAIRS, _TUPLE = "array", "pairs", "tuple"


class ArchiveError(ValueError):
    """A file that is no archive of numbers, or too large a one."""


def write_archive(path: Path, arrays: dict[str, NDArray[Any]], *, compressed: bool = True) -> None:
    """Write named arrays to one file."""
    save: Any = np.savez_compressed if compressed else np.savez

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            save(file, **arrays)

    write_atomically(path, write)


def read_archive(path: Path, limit_bytes: float = 1e8) -> dict[str, NDArray[Any]]:
    """Arrays of a file, by name.

    Args:
        path: of the file.
        limit_bytes: that its arrays may take in memory, together.

    Raises:
        ArchiveError: not an archive of numbers, damaged, or larger; nothing large was read by then.
    """
    try:
        with zipfile.ZipFile(path) as members:
            size = sum(member.file_size for member in members.infolist())
        if size > limit_bytes:
            raise ArchiveError(
                f"{path}: unpacks to {size / 1e6:.0f} MB; at most {limit_bytes / 1e6:.0f} MB are read"
            )
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except ArchiveError:
        raise
    except Exception as error:  # damaged files make zipfile, zlib and numpy raise nearly anything
        raise ArchiveError(
            f"{path}: not an archive of numbers, or a damaged one ({type(error).__name__}: {error})"
        ) from None


def packed(tree: Any) -> dict[str, NDArray[Any]]:
    """A tree of dicts, lists, tuples, arrays, numbers and texts as arrays by name.

    Args:
        tree: its leaves may also be anything with ``numpy()``, as tensors of torch.

    Raises:
        TypeError: a leaf of another kind.
    """
    arrays: dict[str, NDArray[Any]] = {}

    def told(value: Any) -> Any:
        if isinstance(value, dict):
            return {_PAIRS: [[key, told(part)] for key, part in value.items()]}
        if isinstance(value, (list, tuple)):
            parts = [told(part) for part in value]
            return {_TUPLE: parts} if isinstance(value, tuple) else parts
        if hasattr(value, "detach"):
            value = value.detach().cpu().numpy()
        if isinstance(value, (np.ndarray, np.generic)):
            name = f"{_ARRAY}-{len(arrays)}"
            arrays[name] = np.asarray(value)
            return {_ARRAY: name}
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        raise TypeError(f"{type(value).__name__} cannot be packed")

    skeleton = json.dumps(told(tree))
    return {SKELETON: np.frombuffer(skeleton.encode(), dtype=np.uint8), **arrays}


def unpacked(arrays: dict[str, NDArray[Any]]) -> Any:
    """The tree that :func:`packed` took; tensors come back as arrays.

    Raises:
        ArchiveError: the arrays are no packed tree.
    """

    def tree(told: Any) -> Any:
        if isinstance(told, list):
            return [tree(part) for part in told]
        if isinstance(told, dict):
            ((kind, inside),) = told.items()
            if kind == _ARRAY:
                return arrays[inside]
            if kind == _TUPLE:
                return tuple(tree(part) for part in inside)
            return {key: tree(part) for key, part in inside}
        return told

    try:
        return tree(json.loads(bytes(arrays[SKELETON]).decode()))
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise ArchiveError(f"not a packed tree ({error})") from None
