"""Tables and figures that several packages use.

Modules are imported at first use, as ``display.figures``, because matplotlib takes half a second.
"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import figures, linear, loops, manoeuvres, recipe_search

__all__ = ["figures", "linear", "loops", "manoeuvres", "recipe_search"]


def __getattr__(name: str) -> ModuleType:
    """Import a module of this package that needs matplotlib."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f".{name}", __name__)
