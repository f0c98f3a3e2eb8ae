"""Libraries that take long to import, loaded when they are first used.

python-control brings scipy.signal, scipy.stats and matplotlib.pyplot with it, a second of every start of
the command and every ``import shaftline.plant``, and most runs never make a linear model.
"""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import control

__all__ = ["control", "when_used"]


def when_used(name: str) -> ModuleType:
    """A module whose code runs at the first access to one of its attributes.

    Whoever imports it later gets this one.

    Args:
        name: of a module at the top level.

    Raises:
        ModuleNotFoundError: it is not installed, which is known at once.
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
    control = when_used("control")
