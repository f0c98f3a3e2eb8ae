"""Search for classes: in a sub-package, by ``module:Class``, and by entry points of other packages.

A new module of a sub-package is discovered without a list of modules.
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
    """Return the concrete subclasses of a base class that the modules of a package define.

    They are sorted by module, within a module in the order of their definition. ``but`` names modules to
    leave out, such as those that import the caller.
    """
    found: list[type[Base]] = []
    for _, name, _ in pkgutil.iter_modules(import_module(package).__path__):
        if name in but:
            continue
        module = import_module(f"{package}.{name}")
        found += [
            thing
            for thing in vars(module).values()
            if issubclass(type(thing), type)  # isinstance() would import lazy modules.
            and issubclass(thing, base)
            and thing.__module__ == module.__name__
            and not inspect.isabstract(thing)
        ]
    return found


def entry_point_names(group: str) -> list[str]:
    """Return the names of the classes that installed packages register in a group of entry points."""
    return sorted(point.name for point in entry_points(group=group))


def load_external_class(name: str, group: str) -> Any:
    """Return a class from outside the package: ``module:Class``, or a registered entry point.

    The module is searched on Python's path and in the working folder. Its import executes it. None is
    returned if the name is neither; a ValueError says why a class cannot be loaded.
    """
    name, module, place = _address(name, group)
    if not place:
        return None
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        if not all(part.isidentifier() for part in [*module.split("."), *place.split(".")]):
            raise ValueError("expected module:Class, such as my_controllers:Pilot")
        found: Any = import_module(module)
        for part in place.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError, SyntaxError, ValueError) as error:
        raise ValueError(f"{name}: cannot be loaded: {error}") from error
    return found


def _address(name: str, group: str) -> tuple[str, str, str]:
    """Return full name, module, and qualified name in the module of a class from outside the package."""
    for point in entry_points(group=group):
        if point.name == name:
            name = point.value
    module, _, place = name.partition(":")
    return name, module, place


def external_class_digest(name: str, group: str) -> str:
    """Return eight characters that change with the source of an external class and of its imports.

    The name is one that :func:`load_external_class` has loaded; the text is empty for a class of this
    package. Imports are found in the source of the modules (an import inside a function counts too). The
    standard library, installed packages and this package are left out. For a class of an installed
    package the whole package counts. Files that the code opens itself are not included.
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
        files = _imported_files(module, own)
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:8]


def _imported_files(module: str, path: list[str]) -> list[Path]:
    """Return the files of a module and of what it imports from the folders of a path."""
    finder = _Finder(path=path, excludes=["shaftline"])
    beside: list[Path] = []
    try:
        finder.import_hook(module)
    except ImportError:  # The module lies in a folder without __init__.py; all files there count.
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            return []
        beside = [*Path(spec.origin).parent.glob("*.py")]
        finder.run_script(spec.origin)
    imported = (getattr(one, "__file__", None) for one in finder.modules.values())
    return [*{*beside, *(Path(name) for name in imported if name)}]


class _Finder(ModuleFinder):
    """Finder of imports that refuses a folder without ``__init__.py`` with an ImportError."""

    def find_module(
        self, name: str, path: Any, parent: Any = None
    ) -> tuple[Any, str | None, tuple[str, str, int]]:
        try:
            return super().find_module(name, path, parent)
        except AttributeError:  # Such a folder has no loader.
            raise ImportError(f"{name}: a folder without __init__.py") from None
