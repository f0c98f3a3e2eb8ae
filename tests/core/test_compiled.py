"""Kernels: strict arithmetic, kept machine code, and what is spelled out field by field."""

from __future__ import annotations

import math
import os
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import shaftline.core.compiled as module
from shaftline.core.compiled import compiled, compiled_polynomial, spelled_out


@compiled
def _over(a: float, b: float) -> float:
    return a / b


@compiled
def _there_and_back(x: float) -> float:
    return (x + 1e16) - 1e16


@compiled
def _line(a: float, x: float, b: float) -> float:
    return a * x + b


@compiled_polynomial
def _fused_line(a: float, x: float, b: float) -> float:
    return a * x + b


def test_division_by_zero_gives_infinity() -> None:
    assert _over(1.0, 0.0) == math.inf
    assert _over(-1.0, 0.0) == -math.inf
    assert math.isnan(_over(0.0, 0.0))


def test_sums_are_not_put_in_another_order() -> None:
    assert _there_and_back(1.0) == 0.0  # the number next to 1e16 is 1e16 + 2


def test_products_and_sums_round_one_by_one_but_for_horners_rule() -> None:
    a, x = 1.0 + 2.0**-30, 1.0 - 2.0**-30
    b = -1.0
    assert _line(a, x, b) == (a * x) + b == 0.0
    once = float(Fraction(a) * Fraction(x) + Fraction(b))
    assert _fused_line(a, x, b) in (once, 0.0)  # 0 on processors that cannot fuse


def test_kernels_are_kept_and_let_other_threads_run() -> None:
    for kernel in (_over, _fused_line):
        assert kernel.targetoptions["nogil"]  # type: ignore[attr-defined, union-attr]
        assert kernel.targetoptions["forceinline"]  # type: ignore[attr-defined, union-attr]
        assert Path(kernel.stats.cache_path).name == "__pycache__"  # type: ignore[attr-defined, union-attr]


class Pair(NamedTuple):
    left: float
    right: float


total: Any = spelled_out(
    """
def total(pair):
    found = 1.0
    found += pair.{field}
    return found
""",
    Pair._fields,
    globals(),
)


def test_a_line_is_spelled_out_for_every_field() -> None:
    assert total(Pair(2.0, 40.0)) == 43.0


def test_what_is_spelled_out_belongs_to_its_module() -> None:
    assert (total.__name__, total.__module__) == ("total", __name__)
    assert Path(total.stats.cache_path).name == "__pycache__"


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A house whose sources are of second 1000 and whose machine code of second 2000."""
    monkeypatch.setattr(module, "__file__", str(tmp_path / "core" / "compiled.py"))
    for layer in module._LAYERS:
        seconds = {
            "a.py": 1000, "deep/b.py": 1000, "__pycache__/a.pyc": 500,
            "__pycache__/a.f-1.nbi": 2000, "deep/__pycache__/b.g-1.nbc": 2000,
        }  # fmt: skip
        for name, second in seconds.items():
            file = tmp_path / layer / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
            os.utime(file, (second, second))
    return tmp_path


def kept(house: Path) -> set[str]:
    return {file.parts[len(house.parts)] for file in house.rglob("*.nb?")}


def test_machine_code_newer_than_its_sources_is_kept(house: Path) -> None:
    module._drop_stale_kernels()
    assert kept(house) == set(module._LAYERS)
    assert len(list(house.rglob("*.nb?"))) == 2 * len(module._LAYERS)


@pytest.mark.parametrize("source", ["a.py", "deep/b.py"])
@pytest.mark.parametrize("layer", ["core", "plant", "mismatch"])
def test_an_edit_drops_the_machine_code_of_its_folder_and_those_above(
    house: Path, layer: str, source: str
) -> None:
    os.utime(house / layer / source, (2001, 2001))
    module._drop_stale_kernels()
    below = module._LAYERS[: module._LAYERS.index(layer)]
    assert kept(house) == set(below)
    assert len(list(house.rglob("*.pyc"))) == len(module._LAYERS)


def test_machine_code_as_old_as_its_source_is_kept(house: Path) -> None:
    os.utime(house / "core" / "a.py", (2000, 2000))
    module._drop_stale_kernels()
    assert "core" in kept(house)


def test_each_layer_stands_above_those_that_it_calls() -> None:
    root = Path(module.__file__).parents[1]
    with_kernels = {
        file.relative_to(root).parts[0]
        for room in root.iterdir()
        if (room / "__init__.py").is_file() and room.name != "tests"
        for file in room.rglob("*.py")
        if "@compiled\n" in file.read_text(encoding="utf-8")
    }
    assert {"core", "plant", "envs"} <= with_kernels <= set(module._LAYERS)
    assert np.all(
        np.diff([module._LAYERS.index(n) for n in ("core", "plant", "observers", "envs")]) > 0
    )
