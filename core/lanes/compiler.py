"""Numba's and LLVM's interfaces for new types, of which the type checker knows little."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir as llvm
from numba.core import cgutils as _cgutils
from numba.core import datamodel as _datamodel
from numba.core import imputils
from numba.core import typeconv as _typeconv
from numba.core import types as _types
from numba.core.typing import templates
from numba.extending import intrinsic as _intrinsic
from numba.extending import lower_getattr as _lower_getattr
from numba.extending import overload as _overload
from numba.np import numpy_support

_datamodels: Any = _datamodel
_conversions: Any = _typeconv
ir: Any = llvm
types: Any = _types
cgutils: Any = _cgutils
signature: Any = templates.signature
Conversion: Any = _conversions.Conversion
as_dtype: Any = numpy_support.as_dtype
PrimitiveModel: Any = _datamodels.PrimitiveModel
AbstractTemplate: Any = templates.AbstractTemplate
AttributeTemplate: Any = templates.AttributeTemplate


def _untyped(decorator: Any) -> Callable[..., Any]:
    """Return a function of Numba that makes a decorator, for the type checker."""
    return decorator  # type: ignore[no-any-return]


register_default = _untyped(_datamodels.register_default)
lower_builtin = _untyped(imputils.lower_builtin)
lower_cast = _untyped(imputils.lower_cast)
lower_getattr = _untyped(_lower_getattr)
lower_getattr_generic = _untyped(imputils.lower_getattr_generic)
infer_global = _untyped(templates.infer_global)
infer_getattr = _untyped(templates.infer_getattr)


def intrinsic(function: Callable[..., Any]) -> Any:
    """Declare a function for which the compiler calls a generator of machine code."""
    return _intrinsic(function)


def literal_intrinsic(function: Callable[..., Any]) -> Any:
    """Declare such a function with constants as arguments."""
    return _untyped(_intrinsic)(prefer_literal=True)(function)


def inlined_overload(function: Any, implementation: Callable[..., Any]) -> None:
    """Let kernels call what ``implementation`` returns for the types of the arguments of a function."""
    _untyped(_overload)(function, jit_options={"forceinline": True}, strict=False)(implementation)
