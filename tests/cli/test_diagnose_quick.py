"""``shaftline diagnose --quick``."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from .conftest import Command
from .test_diagnose import trial


def test_quick_leaves_out_the_second_search(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def stand_in(*_: object, options: object, **given: object) -> object:
        asked.append(options)
        nothing: dict[str, Any] = {"alternatives": {}, "hidden": {}, "calibrated": None}
        return SimpleNamespace(save=lambda out, pdf: out, summary=str, **nothing)

    monkeypatch.setattr("shaftline.mismatch.diagnose", stand_in)
    trial(60.0).to_csv(tmp_path / "t.csv", index=False)
    given = ("diagnose", tmp_path / "t.csv", "--ship", "frigate", "--out", tmp_path / "out")
    for flags in ((), ("--quick",), ("--steady",)):
        assert shaftline(*given, *flags).exit_code == 0
    assert [options.quick for options in asked] == [False, True, False]
    assert [options.steady for options in asked] == [False, False, True]
