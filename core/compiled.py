"""The one decorator of every kernel."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar, cast

import numba
from numba.misc.appdirs import AppDirs

from .kernel_cache import check_files, drop_stale_kernels

Record: TypeAlias = Any
"""One element of a NumPy structured array, as a kernel sees it (fields as attributes)."""

Real: TypeAlias = Any
"""A float, or a complex number where the linearisation asks for an exact derivative."""

P = ParamSpec("P")
R = TypeVar("R")


drop_stale_kernels(Path(__file__).resolve().parent.parent)


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def kernels_kept_in(beside: Path, home: Path, temporary: Path) -> Path | None:
    """A folder of its own for the machine code, where none of the usual places can be written to.

    What lies there is run: so it is a folder that nobody else can write to.

    Args:
        beside: the package's own.
        home: the user's.
        temporary: where a folder may be made.

    Returns:
        None where one of the usual places will do.
    """
    if _is_writable(beside) or _is_writable(home):
        return None
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = temporary / f"shaftline-kernels-{user}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        if stat.S_ISDIR(state.st_mode) and state.st_uid == user and not state.st_mode & 0o077:
            return folder
    return Path(tempfile.mkdtemp(prefix="shaftline-kernels-", dir=temporary))


_settings: Any = numba.config
if _settings.DISABLE_JIT:  # a ship's record has its fields as attributes in compiled code only
    _settings.DISABLE_JIT = 0
    warnings.warn(
        "NUMBA_DISABLE_JIT is set, but the equations run compiled only; it is not heeded",
        RuntimeWarning,
        stacklevel=1,
    )
_appdirs: Any = AppDirs
if not _settings.CACHE_DIR:  # what the user has set goes before
    _kept = kernels_kept_in(
        Path(__file__).parent / "__pycache__",
        Path(_appdirs(appname="numba", appauthor=False).user_cache_dir),
        Path(tempfile.gettempdir()),
    )
    if _kept is not None:
        _settings.CACHE_DIR = str(_kept)
        warnings.warn(
            f"neither the package nor the home can be written to: compiled kernels are kept in {_kept}",
            RuntimeWarning,
            stacklevel=1,
        )


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel to machine code and keep it on disk.

    IEEE arithmetic is left strict (no fastmath), so a kernel gives the same bits wherever it is
    inlined: in a single simulation or in a batch. Division by zero gives inf, never an exception.
    """
    return _compiled(function, fastmath=False)


def compiled_polynomial(function: Callable[P, R]) -> Callable[P, R]:
    """The same for Horner's rule alone: each ``a * x + b`` becomes one fused operation.

    Every product there has exactly one use, so fusing is no choice of the compiler's and the result
    does not depend on where the function is inlined.
    """
    return _compiled(function, fastmath={"contract"})


def compiled_apart(function: Callable[P, R]) -> Callable[P, R]:
    """The same for what is seldom called: it stays a call, and costs its callers nothing when unused."""
    return _compiled(function, fastmath=False, inline=False)


def compiled_sum(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a sum of many products, whose order is the compiler's: so it vectorises.

    It stays a call, one piece of machine code whoever calls it, so the order is always the same.
    """
    return _compiled(function, fastmath={"contract", "reassoc"}, inline=False)


def _compiled(
    function: Callable[P, R], fastmath: bool | set[str], inline: bool = True
) -> Callable[P, R]:
    kernel = numba.njit(
        cache=True, error_model="numpy", nogil=True, forceinline=inline, fastmath=fastmath
    )(function)
    check_files(kernel)
    return cast("Callable[P, R]", kernel)


def spelled_out(source: str, fields: Iterable[str], scope: dict[str, Any]) -> Callable[..., Any]:
    """A kernel over all fields of a record, made from one line for each.

    Kernels cannot loop over a tuple's or a record's fields by name. So the fields are declared once, and
    what must name every one of them is spelled out from that declaration.

    Args:
        source: of one function, in which a line that holds ``{field}`` is repeated for every field.
        fields: names.
        scope: ``globals()`` of the module that the function shall belong to.

    Returns:
        The kernel, compiled like any other.
    """
    names = tuple(fields)
    lines = []
    for line in source.strip().splitlines():
        lines += [line.format(field=name) for name in names] if "{field}" in line else [line]
    text = "\n".join(lines)
    found: dict[str, Any] = {}
    # under the module's own name, where Numba looks for what it has kept
    exec(compile(text, scope["__file__"], "exec"), scope, found)
    (function,) = found.values()
    return compiled(function)  # type: ignore[no-any-return]
