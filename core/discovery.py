"""What a folder holds, found by looking: so that a new file is known without a list that names it.

And what others bring: classes named ``module:Class``, and those of installed packages that offer them by
an entry point.
"""

from __future__ import annotations

import inspect
import pkgutil
import sys
from collections.abc import Collection
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar

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
            if issubclass(type(thing), type)  # isinstance would load what waits to be used
            and issubclass(thing, base)
            and thing.__module__ == module.__name__
            and not inspect.isabstract(thing)
        ]
    return found


def offered(group: str) -> list[str]:
    """Names by which installed packages offer classes of their own.

    Args:
        group: of entry points, such as ``shaftline.controllers``.
    """
    return sorted(point.name for point in entry_points(group=group))


def of_others(name: str, group: str) -> Any:
    """A class that is not ours: ``module:Class``, or one that an installed package offers by name.

    A module is looked for where Python looks, and in the working folder. Importing it runs it.

    Args:
        name: as above.
        group: of entry points.

    Returns:
        The class, or None where the name is neither.

    Raises:
        ValueError: there is no such module, it has no such class, or it cannot be imported; the message
            says which.
    """
    for point in entry_points(group=group):
        if point.name == name:
            name = point.value
    module, _, place = name.partition(":")
    if not place:
        return None
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        found: Any = import_module(module)
        for part in place.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError, SyntaxError, ValueError) as error:
        raise ValueError(f"{name}: cannot be loaded: {error}") from error
    return found
