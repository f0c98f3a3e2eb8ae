"""Classes are found in a folder: by module and place, without those that are only bases or borrowed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from shaftline.core.discovery import classes_in


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    folder = tmp_path / "found_here"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "base.py").write_text(
        "from abc import ABC, abstractmethod\n"
        "class Base(ABC):\n"
        "    @abstractmethod\n"
        "    def act(self): ...\n"
        "class Half(Base):\n"
        "    @abstractmethod\n"
        "    def see(self): ...\n"
    )
    one = "from .base import Base\nclass {}(Base):\n    def act(self): ...\n"
    (folder / "zebra.py").write_text(one.format("Zebra") + "class Antelope(Zebra): ...\n")
    (folder / "lion.py").write_text("from .zebra import Zebra\n" + one.format("Lion"))
    (folder / "asks.py").write_text("raise AssertionError('left out')\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield "found_here"
    for name in [name for name in sys.modules if name.startswith("found_here")]:
        del sys.modules[name]


def test_concrete_classes_are_found_by_module_and_place(package: str) -> None:
    sys.modules.pop("found_here", None)
    base = __import__("found_here.base").base.Base
    found = classes_in(package, base, but=("asks",))
    assert [cls.__name__ for cls in found] == ["Lion", "Zebra", "Antelope"]
    with pytest.raises(AssertionError, match="left out"):
        classes_in(package, base)
