"""Examples in docstrings give what they print; each public package has ten functions with an example."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from types import ModuleType

import pytest

import shaftline

PUBLIC = ("plant", "observers", "baselines", "envs", "agents", "mismatch", "performance")
LEAST = 10


def modules(package: str) -> list[ModuleType]:
    """Return all modules of a package."""
    top = importlib.import_module(f"shaftline.{package}")
    names = [one.name for one in pkgutil.walk_packages(top.__path__, f"{top.__name__}.")]
    return [top, *(importlib.import_module(name) for name in names if "__main__" not in name)]


@pytest.mark.parametrize("package", PUBLIC)
def test_examples_in_docstrings_give_what_they_print(package: str) -> None:
    options = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    results = [doctest.testmod(module, optionflags=options) for module in modules(package)]
    assert not sum(result.failed for result in results)


@pytest.mark.parametrize("package", PUBLIC)
def test_each_public_package_has_examples(package: str) -> None:
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = [test for module in modules(package) for test in finder.find(module) if test.examples]
    assert len(found) >= LEAST
    assert shaftline.__doc__
