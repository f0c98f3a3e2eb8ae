"""Cache of compiled kernels on disk.

A kernel belongs to the content of its module and of all modules of the package that this one imports. So
it is compiled again where an equation changed, and only there; the age of files and the place of the
package do not matter. Each cache file contains a digest, so that a damaged one is never run.

Numba compiles for the processor at hand. Where there is no such kernel, one for :data:`PORTABLE` is
taken if the processor runs it: the wheel has these, so that the first use need not compile.
"""

from __future__ import annotations

import contextlib
import functools
import glob
import hashlib
import io
import os
import pickle
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from llvmlite.binding import get_host_cpu_features
from numba.core import caching

_Plain: Any = caching.IndexDataCacheFile
_DIGEST = 32
"""Number of bytes of the SHA-256 digest at the start of a file."""

_UNKNOWN_NAME = (ImportError, AttributeError)
"""Errors of a file whose writer had imported the package under another name, or had other classes."""

PORTABLE = "x86-64-v3"
"""Processors of portable kernels: x86-64 with AVX2 and FMA, made since about 2013. Results equal those
of other kernels to the bit; on a processor with AVX-512 a step takes 5 to 8 % longer with them."""

NEEDED = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""Features of :data:`PORTABLE` beyond those of any x86-64."""


def runs_portable(features: Mapping[str, bool]) -> bool:
    """Return whether a processor with some features runs kernels for :data:`PORTABLE`."""
    return all(features.get(name, False) for name in NEEDED)


class CheckedCacheFile(_Plain):  # type: ignore[misc]
    """Numba's index and data files; a file with a wrong digest is removed instead of loaded.

    Numba unpickles and links the content without a check. A damaged file would raise an error inside
    pickle at every start, or be executed as machine code.
    """

    def load(self, key: Any) -> Any:
        """Return a kernel by signature, processor and code; None if there is none to be used."""
        found = super().load(key)
        if found is None and runs_portable(get_host_cpu_features()):
            signature, (system, *_), code = key
            found = super().load((signature, (system, PORTABLE, ""), code))
        return found

    def _load_index(self) -> dict[Any, str]:
        return self._overloads(self._index_path)

    def _overloads(self, path: str) -> dict[Any, str]:
        """Return the names of the data files of an index; none if a source has changed since."""
        content = _read(path)
        if content is None:
            return {}
        file = io.BytesIO(content)
        if pickle.load(file) != self._version:
            return {}
        try:
            digest, overloads = pickle.load(file)
        except _UNKNOWN_NAME:
            return {}
        return dict(overloads) if digest == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        if not self._load_index():
            self._drop_stale()
        version = pickle.dumps(self._version, protocol=-1)
        self._write(self._index_path, version + self._dump((self._source_stamp, overloads)))

    def _drop_stale(self) -> None:
        """Delete kernels of the module as it was before: files are named by the lines of functions."""
        module = self._index_name.split(".")[0]
        for index in Path(self._cache_path).glob(f"{module}.*.nbi"):
            if not self._overloads(str(index)):
                for file in (index, *index.parent.glob(f"{glob.escape(index.stem)}.*.nbc")):
                    file.unlink(missing_ok=True)

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
    """Make the cache of a kernel, compiled with ``cache=True``, verify its files and its sources."""
    cache = kernel._cache
    plain = cache._cache_file
    base = plain._index_name.removesuffix(".nbi")
    source = Path(kernel.py_func.__code__.co_filename)
    # A cell of a notebook is no file; Numba's own stamp is the digest of its text.
    stamp = source_digest(source) if source.is_file() else plain._source_stamp
    cache._cache_file = CheckedCacheFile(cache.cache_path, base, stamp)


ROOT = Path(__file__).resolve().parent.parent
"""Folder of the package."""


@functools.cache
def source_digest(source: Path, root: Path = ROOT) -> str:
    """Return the digest of a module and of all modules of the package that it imports, even indirectly.

    Numba compares a kernel only with its own source file. After a change of ``propeller.py`` it would
    still use the old propeller inside ``simulation.py``. ``root`` is the folder of the package.
    """
    needed, new = {source}, {source}
    while new:
        new = set().union(*(_imports(file, root) for file in new)) - needed
        needed |= new
    return hashlib.sha256("".join(sorted(map(_digest, needed))).encode()).hexdigest()


@functools.cache
def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


_IMPORT = re.compile(r"^ *from (\.*)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


@functools.cache
def _imports(source: Path, root: Path) -> frozenset[Path]:
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
    return frozenset(file for file in found if file.is_file())
