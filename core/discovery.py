"""Find classes: in a folder of the package, by ``module:Class``, and by entry points of other packages.

A new file is found without a list that names it.
"""

from __future__ import annotations

import hashlib
import inspect
import pkgutil
import sys
import sysconfig
from collections.abc import Collection
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from modulefinder import ModuleFinder
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
    name, module, place = _address(name, group)
    if not place:
        return None
    if not all(part.isidentifier() for part in [*module.split("."), *place.split(".")]):
        raise ValueError(
            f"{name}: cannot be loaded: expected module:Class, such as my_controllers:Pilot"
        )
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


def _address(name: str, group: str) -> tuple[str, str, str]:
    """Return the full name, the module and the class's place in it of a class of others."""
    for point in entry_points(group=group):
        if point.name == name:
            name = point.value
    module, _, place = name.partition(":")
    return name, module, place


def version_of_others(name: str, group: str) -> str:
    """Return eight letters that change with the source of a user's class and of what it imports.

    Imports are followed by reading the modules (an import inside a function counts as well). Python's
    own modules, installed packages and this package are left out. For a class of an installed package
    the whole package counts. Files that the code itself opens are not noticed.

    Args:
        name: as of :func:`of_others`, which has loaded the class.
        group: of entry points.

    Returns:
        An empty text for a name that is not of others.
    """
    _, module, place = _address(name, group)
    spec = find_spec(module.partition(".")[0]) if place else None
    if spec is None:
        return ""
    installed = [sysconfig.get_path(scheme) for scheme in ("stdlib", "purelib", "platlib")]
    own = [entry for entry in sys.path if not any(entry.startswith(path) for path in installed)]
    top = Path(spec.origin or "")
    if any(str(top).startswith(path) for path in installed):
        files = sorted(top.parent.rglob("*.py")) if top.name == "__init__.py" else [top]
    else:
        finder = ModuleFinder(path=own, excludes=["shaftline"])
        finder.import_hook(module)
        found = (getattr(one, "__file__", None) for one in finder.modules.values())
        files = [Path(file) for file in found if file]
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:8]
