"""Cache of compiled kernels on disk.

Each cache file contains a digest. A damaged file is deleted and its kernel compiled again, and so is a
file that is older than a source on which its kernel may depend.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import pickle
import re
from pathlib import Path
from typing import Any

from numba.core import caching

_Plain: Any = caching.IndexDataCacheFile
_DIGEST = 32
"""Number of bytes of the SHA-256 digest at the start of a file."""

_UNKNOWN_NAME = (ImportError, AttributeError)
"""Errors of a file whose writer had imported the package under another name, or had other classes."""


class CheckedCacheFile(_Plain):  # type: ignore[misc]
    """Numba's index and data files; a file with a wrong digest is removed instead of loaded.

    Numba unpickles and links the content without a check. A damaged file would raise an error inside
    pickle at every start, or be executed as machine code.
    """

    def _load_index(self) -> dict[Any, str]:
        content = _read(self._index_path)
        if content is None:
            return {}
        file = io.BytesIO(content)
        if pickle.load(file) != self._version:
            return {}
        try:
            stamp, overloads = pickle.load(file)
        except _UNKNOWN_NAME:
            return {}
        return dict(overloads) if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        version = pickle.dumps(self._version, protocol=-1)
        self._write(self._index_path, version + self._dump((self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        content = _read(self._data_path(name))
        if content is None:
            raise FileNotFoundError(name)  # Numba then compiles the kernel.
        try:
            return pickle.loads(content)
        except _UNKNOWN_NAME as error:
            raise FileNotFoundError(name) from error

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(content).digest() + content)


def _read(path: str) -> bytes | None:
    """Return the content of a file without its digest; if they differ, delete it and return None."""
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
    """Make the cache of a kernel, compiled with ``cache=True``, verify the digests of its files."""
    cache = kernel._cache
    plain = cache._cache_file
    base = plain._index_name.removesuffix(".nbi")
    cache._cache_file = CheckedCacheFile(cache.cache_path, base, plain._source_stamp)


_IMPORT = re.compile(r"^ *from (\.*)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def imported_files(source: Path, root: Path) -> set[Path]:
    """Return the files of the package, below the folder ``root``, that a module imports directly."""
    found = set()
    for dots, module, names in _IMPORT.findall(source.read_text(encoding="utf-8")):
        first, *rest = module.split(".") if module else [""]
        if dots:
            folder = source.parents[len(dots) - 1].joinpath(*filter(None, (first, *rest)))
        elif first in (root.name, "shaftline"):
            folder = root.joinpath(*rest)
        else:
            folder = root.joinpath(first, *rest)
        own = folder.with_suffix(".py")
        if own.is_file():
            found.add(own)
            continue
        for name in re.findall(r"\w+", names):
            part = folder / f"{name}.py"
            found.add(part if part.is_file() else folder / "__init__.py")
    return {file for file in found if file.is_file()}


def drop_stale_kernels(root: Path) -> None:
    """Delete cached kernels that are older than a source that their module imports, even indirectly.

    Numba compares a kernel only with its own source file. After a change of ``propeller.py`` it would
    still use the old propeller inside ``simulation.py``. ``root`` is the folder of the package.
    """
    packages = [folder for folder in root.iterdir() if (folder / "__init__.py").is_file()]
    changed = {file: file.stat().st_mtime for one in packages for file in one.rglob("*.py")}
    cached: dict[Path, list[Path]] = {}
    oldest = float("inf")
    for folder in packages:
        for file in folder.rglob("__pycache__/*.nb[ic]"):
            with contextlib.suppress(OSError):
                oldest = min(oldest, file.stat().st_mtime)
                module = file.parent.parent / f"{file.name.split('.')[0]}.py"
                cached.setdefault(module, []).append(file)
    if max(changed.values(), default=0.0) <= oldest:
        return
    imports: dict[Path, set[Path]] = {}  # only of the modules on which a kernel depends
    for module, files in cached.items():
        needed, new = {module}, {module}
        while new:
            for file in new - imports.keys():
                imports[file] = imported_files(file, root) if file in changed else set()
            new = set().union(*(imports[file] for file in new)) - needed
            needed |= new
        newest = max((changed.get(file, 0.0) for file in needed), default=0.0)
        for file in files:
            with contextlib.suppress(OSError):
                if file.stat().st_mtime < newest:
                    file.unlink()
