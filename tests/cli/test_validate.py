"""``shaftline validate``: seals first, resumes, mixes nothing."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.cli import validate_command
from shaftline.validation.cases import hash_truth

from .conftest import Command
from .test_bad_input import refused


def test_a_case_is_sealed_diagnosed_and_scored(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    place = tmp_path / "case-112-0000"

    def tool(
        page: bool, recording: Path, ship: str, out: Path, exclude: tuple[str, ...]
    ) -> dict[str, Any]:
        asked.append((recording.name, ship, exclude))
        # The folder contains the recording and its seal, but not the truth.
        assert {file.name for file in place.iterdir()} == {"recording.csv", "sealed.sha256"}
        return {"verdict": "nothing-missing", "effects": []}

    monkeypatch.setattr(validate_command, "_tool", tool)
    arguments = ("validate", "--cases", 1, "--seed", 112, "--out", tmp_path, "--jobs", 1)
    result = shaftline(*arguments)
    assert result.exit_code == 0, result.output
    assert asked == [("recording.csv", "frigate", ())]
    seal = (place / "sealed.sha256").read_text().strip()
    assert f"case 112-0000  sealed {seal}" in result.output
    assert hash_truth(json.loads((place / "truth.json").read_text())) == seal
    assert "1 cases, made by `shaftline validate --cases 1 --seed 112`" in " ".join(
        (tmp_path / "validation.md").read_text(encoding="utf-8").split()
    )
    cases = pd.read_csv(tmp_path / "validation-cases.csv")
    assert list(cases["tool"]) == ["shaftline", "stepwise-bic"]
    assert cases["outcome"][0] == "nothing-missing"

    assert shaftline(*arguments).exit_code == 0
    assert len(asked) == 1
    refused(shaftline(*arguments[:4], 113, *arguments[5:]), "another seed", "112", "113")
    assert len(asked) == 1


def test_cases_of_unknown_origin_are_not_mixed_in(shaftline: Command, tmp_path: Path) -> None:
    (tmp_path / "case-1-0000").mkdir()
    refused(
        shaftline("validate", "--cases", 1, "--out", tmp_path), "cases of another command", "--out"
    )


def test_pysindy_is_an_extra(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    refused(shaftline("validate", "--sindy", "--out", tmp_path), "--sindy", "shaftline[rivals]")
    assert not list(tmp_path.iterdir())


def test_a_variant_is_known_and_mixed_with_no_other(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused(
        shaftline("validate", "--variant", "windy", "--out", tmp_path), "windy", "realistic", "1-hz"
    )
    refused(
        shaftline("validate", "--variant", "1-hz", "--sindy", "--out", tmp_path),
        "variant plain only",
    )
    assert not list(tmp_path.iterdir())
    rows = []

    def tool(
        page: bool, recording: Path, ship: str, out: Path, exclude: tuple[str, ...]
    ) -> dict[str, Any]:
        rows.append(len(pd.read_csv(recording)))
        return {"verdict": "nothing-missing", "effects": []}

    monkeypatch.setattr(validate_command, "_tool", tool)
    arguments = ("validate", "--cases", 1, "--seed", 112, "--out", tmp_path, "--jobs", 1)
    result = shaftline(*arguments, "--variant", "1-hz")
    assert result.exit_code == 0, result.output
    assert rows[0] < 1300
    assert "--seed 112 --variant 1-hz`" in (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert list(pd.read_csv(tmp_path / "validation-cases.csv")["tool"]) == ["shaftline"]
    refused(shaftline(*arguments), "another variant", "1-hz", "plain")
