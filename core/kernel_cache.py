"""The cache of compiled kernels, each file with a digest: a damaged one is dropped and compiled anew."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import pickle
from typing import Any

from numba.core import caching

_Plain: Any = caching.IndexDataCacheFile
_DIGEST = 32
"""Bytes of SHA-256, which stand before the contents of a file."""


class CheckedCacheFile(_Plain):  # type: ignore[misc]
    """Numba's index and data files, of which those with a wrong digest are removed instead of loaded.

    Numba unpickles and links whatever stands there. Bits that a disk lost would raise an error from
    inside pickle at every start, or run as machine code.
    """

    def _load_index(self) -> dict[Any, str]:
        content = _read(self._index_path)
        if content is None:
            return {}
        file = io.BytesIO(content)
        if pickle.load(file) != self._version:
            return {}
        stamp, overloads = pickle.load(file)
        return dict(overloads) if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        version = pickle.dumps(self._version, protocol=-1)
        self._write(self._index_path, version + self._dump((self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        content = _read(self._data_path(name))
        if content is None:
            raise FileNotFoundError(name)  # which Numba takes as a kernel that is not in the cache
        return pickle.loads(content)

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(content).digest() + content)


def _read(path: str) -> bytes | None:
    """Return the contents of a file without its digest; None, and no file any more, if they differ."""
    try:
        with open(path, "rb") as file:
            whole = file.read()
    except FileNotFoundError:
        return None
    content = whole[_DIGEST:]
    if hashlib.sha256(content).digest() == whole[:_DIGEST]:
        return content
    with contextlib.suppress(OSError):
        os.unlink(path)
    return None


def check_files(kernel: Any) -> None:
    """Let a kernel's cache look at its files' digests.

    Args:
        kernel: compiled with ``cache=True``.
    """
    cache = kernel._cache
    plain = cache._cache_file
    base = plain._index_name.removesuffix(".nbi")
    cache._cache_file = CheckedCacheFile(cache.cache_path, base, plain._source_stamp)
