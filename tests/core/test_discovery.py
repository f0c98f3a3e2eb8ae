"""Classes are found in a folder: by module and place, without those that are only bases or borrowed."""

from __future__ import annotations

import json
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from shaftline.core import discovery
from shaftline.core.discovery import (
    classes_in,
    entry_point_names,
    external_class_digest,
    load_external_class,
)


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


def test_a_class_of_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine_for_a_test.py").write_text("class Outer:\n    class Law: ...\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    found = load_external_class("mine_for_a_test:Outer.Law", "shaftline.controllers")
    assert found.__qualname__ == "Outer.Law"
    assert load_external_class("no-place", "shaftline.controllers") is None


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("no_such_module:Law", "No module named 'no_such_module'"),
        ("json:Law", "no attribute 'Law'"),
        (":Law", "cannot be loaded: expected module:Class"),
        ("..:x", "cannot be loaded: expected module:Class"),
        (".json:x", "cannot be loaded: expected module:Class"),
        ("json:JSONDecoder.", "cannot be loaded: expected module:Class"),
        ("json:a b", "cannot be loaded: expected module:Class"),
        ("json:", None),
    ],
)
def test_what_is_not_there_is_told(
    name: str, told: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    if told is None:
        assert load_external_class(name, "shaftline.controllers") is None
        return
    with pytest.raises(ValueError, match=told):
        load_external_class(name, "shaftline.controllers")


def test_a_module_that_breaks_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_for_a_test.py").write_text("def (:\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    with pytest.raises(ValueError, match="broken_for_a_test:Law: cannot be loaded: invalid syntax"):
        load_external_class("broken_for_a_test:Law", "shaftline.controllers")


def test_what_packages_offer(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint("ahead", "json:JSONDecoder", "shaftline.controllers")]
    monkeypatch.setattr(discovery, "entry_points", lambda group: points)
    assert entry_point_names("shaftline.controllers") == ["ahead"]
    assert load_external_class("ahead", "shaftline.controllers") is json.JSONDecoder


def test_the_version_of_a_users_class_changes_with_all_that_it_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {
        "own_law.py": "import own_gains\nclass Law: ...\n",
        "own_gains.py": "def gains():\n    from own_tables.deep import TABLE\n    return TABLE\n",
        "own_tables/__init__.py": "",
        "own_tables/deep.py": "import numpy\nTABLE = [1.0]\n",
        "own_bystander.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    group = "shaftline.controllers"
    seen = {external_class_digest("own_law:Law", group)}
    for name in ("own_law.py", "own_gains.py", "own_tables/__init__.py", "own_tables/deep.py"):
        (tmp_path / name).write_text(files[name] + "# another version\n")
        seen.add(external_class_digest("own_law:Law", group))
    assert len(seen) == 5
    (tmp_path / "own_bystander.py").write_text("# another version\n")
    assert external_class_digest("own_law:Law", group) in seen
    assert external_class_digest("combinator", group) == ""
    installed = external_class_digest("gymnasium:Env", group)
    assert len(installed) == 8
    assert installed == external_class_digest("gymnasium:Env", group)


def test_a_class_in_a_folder_without_init_has_a_digest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as ``examples.own_controller:Steady`` of the documentation."""
    folder = tmp_path / "plain_folder"
    folder.mkdir()
    (folder / "gains.py").write_text("GAIN = 1.0\n")
    (folder / "law.py").write_text("from .gains import GAIN\n\nclass Law:\n    gain = GAIN\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    before = external_class_digest("plain_folder.law:Law", "shaftline.controllers")
    assert len(before) == 8
    (folder / "gains.py").write_text("GAIN = 2.0\n")
    assert external_class_digest("plain_folder.law:Law", "shaftline.controllers") != before
