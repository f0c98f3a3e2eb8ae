"""Kernels: strict arithmetic, kept machine code, and what is spelled out field by field."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from shaftline.core.compiled import compiled, compiled_polynomial, generate_kernel


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


@compiled
def _add_first(record: Any, more: float) -> float:
    record.first += more
    return float(record.first)


def test_a_kernel_reads_and_writes_the_memory_of_a_record() -> None:
    rows = np.zeros(3, np.dtype([("first", np.float64), ("second", np.int64)]))
    rows["first"] = 1.0, 2.0, 3.0
    assert _add_first(rows[1], 0.5) == 2.5
    assert _add_first(rows.view(np.recarray)[2], 0.25) == 3.25
    assert rows["first"].tolist() == [1.0, 2.5, 3.25]
    row = rows[0]
    count = sys.getrefcount(row)
    for _ in range(100):
        _add_first(row, 1.0)
    assert rows["first"][0] == 101.0
    assert sys.getrefcount(row) == count
    kept = "\n".join(_add_first.inspect_llvm().values())  # type: ignore[attr-defined]
    assert "PyObject_GetBuffer" in kept
    assert "numba_extract_record_data" not in kept


ORDER = """
from shaftline.core.compiled import compiled, compiled_polynomial

@compiled_polynomial
def fused(a, x, b):
    return a * x + b

@compiled
def strict(a, x, b):
    return a * x + b

numbers = 1.0 + 2.0j, 2.0 + 1.0j, 0.5 + 0.0j
for kernel in KERNELS:
    kernel(*numbers)
    (text,) = kernel.inspect_llvm().values()
    print(kernel.__name__, "contract" in text)
"""


@pytest.mark.parametrize("order", ["fused, strict", "strict, fused"])
def test_a_complex_product_is_fused_only_where_the_kernel_is(order: str, tmp_path: Path) -> None:
    """Numba compiles the product once in a process, with the flags of its first user."""
    file = tmp_path / "kernels.py"
    file.write_text(ORDER.replace("KERNELS", order))
    done = subprocess.run([sys.executable, file], capture_output=True, text=True, check=True)
    assert dict(line.split() for line in done.stdout.splitlines()) == {
        "fused": "True",
        "strict": "False",
    }


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


total: Any = generate_kernel(
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
