"""What a folder holds, found by looking: so that a new file is known without a list that names it."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Collection
from importlib import import_module
from typing import TypeVar

Base = TypeVar("Base")


def classes_in(package: str, base: type[Base], but: Collection[str] = ()) -> list[type[Base]]:
    """Concrete classes under a base class that the modules of a package define.

    Args:
        package: its name, as ``__package__`` says it.
        base: class from which they derive.
        but: modules to leave out; those that import the caller must be.

    Returns:
        Classes by module in alphabetical order, within a module as they stand there.
    """
    found: list[type[Base]] = []
    for _, name, _ in pkgutil.iter_modules(import_module(package).__path__):
        if name in but:
            continue
        module = import_module(f"{package}.{name}")
        found += [
            thing
            for thing in vars(module).values()
            if isinstance(thing, type)
            and issubclass(thing, base)
            and thing.__module__ == module.__name__
            and not inspect.isabstract(thing)
        ]
    return found
