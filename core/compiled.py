"""Decorators that compile kernels to machine code, and the folder of their cache."""

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
from llvmlite import ir
from numba.core.cpu import CPUContext
from numba.core.pythonapi import PythonAPI
from numba.misc.appdirs import AppDirs

from .kernel_cache import check_files

Record: TypeAlias = Any
"""One element of a NumPy structured array, as a kernel uses it (fields as attributes)."""

Real: TypeAlias = Any
"""A float, or a complex number if the linearisation computes an exact derivative."""

P = ParamSpec("P")
R = TypeVar("R")


def separate_shared_parts(context: Any) -> None:
    """Keep the parts of kernels that Numba compiles once in a process apart by their fast-math flags.

    Numba compiles a part such as the product of complex numbers with the flags of the first kernel that
    needs it, and links it into all others (``BaseContext.compile_subroutine``, up to 0.68 at least).
    Whether a kernel fuses operations, and so its last bits, would depend on the kernels that the same
    process had compiled before. ``context`` is Numba's class of contexts for the processor.
    """
    plain = context.subtarget
    parts: dict[frozenset[str], dict[Any, Any]] = {}

    def subtarget(self: Any, **options: Any) -> Any:
        target = plain(self, **options)
        if target.fastmath:
            flags = frozenset(target.fastmath.flags)
            target.cached_internal_func = parts.setdefault(flags, {})
        return target

    context.subtarget = subtarget


separate_shared_parts(CPUContext)


def read_records_directly(api: Any) -> None:
    """Let kernels take the address of a record from the record itself.

    Numba takes it from a view of the record, and the creation of the view writes a description of every
    field (``numba_extract_record_data``, up to 0.68 at least). For a ship record this takes about 25
    microseconds at each call, far longer than most kernels. ``api`` is Numba's class of calls to Python.
    """

    def extract_record_data(self: Any, record: Any, buffer: Any) -> Any:
        whole = ir.IntType(32)
        kind = ir.FunctionType(whole, [self.pyobj, ir.PointerType(self.py_buffer_t), whole])
        get_buffer = self._get_function(kind, name="PyObject_GetBuffer")
        simple = ir.Constant(whole, 0)  # PyBUF_SIMPLE, without a description of the fields
        error = self.builder.call(get_buffer, [record, buffer, simple])
        # The address is the first member of a Py_buffer; Numba takes 0 for an error.
        address = self.builder.load(self.builder.bitcast(buffer, ir.PointerType(self.voidptr)))
        good = self.builder.icmp_signed("==", error, ir.Constant(whole, 0))
        return self.builder.select(good, address, ir.Constant(self.voidptr, None))

    api.extract_record_data = extract_record_data


read_records_directly(PythonAPI)


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def kernel_folder(beside: Path, home: Path, temporary: Path) -> Path | None:
    """Return a private folder for compiled kernels below ``temporary``, or None if none is needed.

    None is needed if the cache folder of the package (``beside``) or of the user (``home``) is writable.
    Cached kernels are executed, so the folder must not be writable by other users.
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


def _warn(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=2)


_settings: Any = numba.config
if _settings.DISABLE_JIT:  # Kernels use fields of a record as attributes, which needs compilation.
    _settings.DISABLE_JIT = 0
    _warn("NUMBA_DISABLE_JIT is set but ignored, because the equations run only as compiled code")
_appdirs: Any = AppDirs
if not _settings.CACHE_DIR:  # A setting of the user takes precedence.
    _kept = kernel_folder(
        Path(__file__).parent / "__pycache__",
        Path(_appdirs(appname="numba", appauthor=False).user_cache_dir),
        Path(tempfile.gettempdir()),
    )
    if _kept is not None:
        _settings.CACHE_DIR = str(_kept)
        _warn(
            "neither the package folder nor the home folder is writable: compiled kernels are kept in "
            f"{_kept}"
        )


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel to machine code and cache it on disk.

    IEEE arithmetic is strict (no fastmath), so a kernel gives the same bits wherever it is inlined: in a
    single simulation or in a batch. Division by zero gives inf, never an exception.
    """
    return _compiled(function)


def compiled_polynomial(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel of Horner's rule only: each ``a * x + b`` becomes one fused operation.

    Every product there is used exactly once, so the compiler has no choice which operations to fuse, and
    the result does not depend on where the function is inlined.
    """
    return _compiled(function, fastmath={"contract"})


def compiled_apart(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a seldom used kernel without inlining, so that callers that do not use it lose no time."""
    return _compiled(function, inline=False)


def compiled_sum(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel of a sum of many products; the compiler chooses the order, so it vectorises.

    The kernel is not inlined: all callers use the same machine code, so the order is always the same.
    """
    return _compiled(function, fastmath={"contract", "reassoc"}, inline=False)


def _compiled(
    function: Callable[P, R], fastmath: bool | set[str] = False, inline: bool = True
) -> Callable[P, R]:
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
    kernel = numba.njit(**options, forceinline=inline, fastmath=fastmath)(function)
    check_files(kernel)
    return cast("Callable[P, R]", kernel)


def generate_kernel(
    source: str, fields: Iterable[str], scope: dict[str, Any]
) -> Callable[..., Any]:
    """Return a kernel over all fields of a record, generated from one line for each field.

    Kernels cannot iterate over the fields of a tuple or record by name. So the fields are declared once,
    and each kernel over all of them is generated from that declaration: a line of ``source``, one
    function, that contains ``{field}`` is repeated for every field. ``scope`` is ``globals()`` of its
    module.
    """
    names = tuple(fields)
    lines = []
    for line in source.strip().splitlines():
        lines += [line.format(field=name) for name in names] if "{field}" in line else [line]
    text = "\n".join(lines)
    defined: dict[str, Any] = {}
    # Compile under the file name of the module, because Numba looks for its cache there.
    exec(compile(text, scope["__file__"], "exec"), scope, defined)
    (function,) = defined.values()
    return compiled(function)  # type: ignore[no-any-return]


def generate_tuple_kernel(
    signature: str, result: str, entry: str, fields: Iterable[str], scope: dict[str, Any]
) -> Callable[..., Any]:
    """Return a kernel of :func:`generate_kernel` that returns a tuple of the class ``result``.

    ``signature`` is the name of the function with its arguments, ``entry`` an expression with
    ``{field}``.
    """
    source = f"def {signature}:\n    return {result}(\n        {entry},\n    )"
    return generate_kernel(source, fields, scope)
