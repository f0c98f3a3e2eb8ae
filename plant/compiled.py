"""The one decorator of every kernel."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar, cast

import numba

Record: TypeAlias = Any
"""One element of a NumPy structured array, as a kernel sees it (fields as attributes)."""

Real: TypeAlias = Any
"""A float, or a complex number where the linearisation asks for an exact derivative."""

P = ParamSpec("P")
R = TypeVar("R")


_KERNEL_FOLDERS = ("plant", "observers", "baselines", "envs", "mismatch")


def _drop_stale_kernels() -> None:
    """Delete this package's cached machine code where any source is newer.

    Numba looks only at the file of the cached function itself: after an edit of
    ``propeller.py`` it would go on using the old propeller inside ``simulate.py``.
    """
    house = Path(__file__).resolve().parent.parent
    folders = [house / name for name in _KERNEL_FOLDERS]
    newest = max(source.stat().st_mtime for folder in folders for source in folder.glob("*.py"))
    for folder in folders:
        for cached in folder.glob("__pycache__/*.nb[ic]"):
            with contextlib.suppress(OSError):
                if cached.stat().st_mtime < newest:
                    cached.unlink()


_drop_stale_kernels()


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


def _compiled(function: Callable[P, R], fastmath: bool | set[str]) -> Callable[P, R]:
    kernel = numba.njit(
        cache=True, error_model="numpy", nogil=True, forceinline=True, fastmath=fastmath
    )(function)
    return cast("Callable[P, R]", kernel)
