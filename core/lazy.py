"""Lazy import of libraries that take long to load.

python-control imports scipy.signal, scipy.stats and matplotlib.pyplot, which costs a second at every
start of the command and every ``import shaftline.plant``; most runs need no linear model.
"""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import control

__all__ = ["control", "lazy_import"]


def lazy_import(name: str) -> ModuleType:
    """Return a top-level module whose code runs at the first access to one of its attributes.

    A later ``import`` returns the same object. A module that is not installed raises an error
    immediately.
    """
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.find_spec(name)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    spec.loader = importlib.util.LazyLoader(spec.loader)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


if not TYPE_CHECKING:
    control = lazy_import("control")
