from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from shaftline.core.files import (
    FileError,
    read_json,
    write_atomically,
    write_json,
    write_text,
)


def test_a_file_appears_whole_under_its_name(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "table.csv"
    seen: list[Path] = []

    def write(file: Path) -> None:
        seen.append(file)
        file.write_text("whole")
        assert not target.exists()

    write_atomically(target, write)
    assert target.read_text() == "whole"
    (draft,) = seen
    assert draft.parent == target.parent  # on the same disk
    assert draft.suffix == ".csv"  # by which writers tell formats
    assert not draft.exists()


def test_everybody_may_read_it(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "v_a [m/s] ± 0,1")
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o644
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "v_a [m/s] ± 0,1"


def test_failed_writing_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    target.write_text("old")

    def half(file: Path) -> None:
        file.write_text("ha")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(target, half)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_json_is_indented_and_ends_its_last_line(tmp_path: Path) -> None:
    write_json(tmp_path / "new" / "a.json", {"x": 1.5})
    text = (tmp_path / "new" / "a.json").read_text()
    assert json.loads(text) == {"x": 1.5}
    assert text == '{\n  "x": 1.5\n}\n'


def test_json_refuses_what_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "b.json", {"x": math.nan})
    assert not list(tmp_path.iterdir())


def test_a_damaged_result_is_named(tmp_path: Path) -> None:
    file = tmp_path / "curve.json"
    write_json(file, {"a": [1.5]})
    assert read_json(file) == {"a": [1.5]}
    for text in ("{", "", "[" * 100_000):
        file.write_text(text)
        with pytest.raises(
            FileError, match=r"curve\.json: damaged, not valid JSON .* remove the file"
        ):
            read_json(file)
    with pytest.raises(FileError, match="cannot be read"):
        read_json(tmp_path / "nowhere.json")
