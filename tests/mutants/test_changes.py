"""The changes that are made to the code, and what rests on them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from .changes import changed, changes, makes_other_code
from .mirror import mirror
from .report import Outcome, page, reason, shares
from .rests import Rests
from .sample import Mutant, sample

ROOT = Path(__file__).parents[2]


def made(text: str) -> set[str]:
    """What a line becomes."""
    data = text.encode()
    return {changed(data, change).decode() for change in changes(data)}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x = a + b", {"x = a - b"}),
        ("x = (a) * (b)  # * c", {"x = (a) / (b)  # * c"}),
        ("x = a ** 2", {"x = a * 2", "x = a ** 3", "x = a ** 1"}),
        ("x = 'a' + b", set()),
        ("x -= y", {"x += y"}),
        (
            "x = a < b <= c",
            {"x = a <= b <= c", "x = a >= b <= c", "x = a < b < c", "x = a < b > c"},
        ),
        ("x = a not in b", {"x = a in b"}),
        ("x = a and b or c", {"x = a or b or c", "x = a and b and c"}),
        ("x = not a", {"x =  a"}),
        ("x = -a", {"x = a"}),
        ("x = 2.0", {"x = 2.2"}),
        ("x = 0.0", {"x = 1.0"}),
        ("x = 1e-9", {"x = 0.0"}),
        ("x = 40", {"x = 44", "x = 36"}),
        ("x = 0", {"x = 1"}),
        ("x = True", {"x = False"}),
        ("x = min(a, b)", {"x = max(a, b)"}),
        ("x = np.cos(a)", {"x = np.sin(a)"}),
        ("x = abs(a)", {"x = (a)"}),
        ("x = f(a, b=c)", {"x = f(a, )"}),
        (
            "x = number('text', record='field', ge=0)",
            {"x = number('text', record='field', )", "x = number('text', record='field', ge=1)"},
        ),
        ("if a: f(b)", {"if (not a): f(b)", "if a: pass"}),
        ("a.b = c", {"pass"}),
        (
            "def f(a: int = 3) -> float: return a * b",
            {
                "def f(a: int = 4) -> float: return a * b",
                "def f(a: int = 2) -> float: return a * b",
                "def f(a: int = 3) -> float: return a / b",
                "def f(a: int = 3) -> float: return -(a * b)",
            },
        ),
        ("def f() -> bool: return g()", {"def f() -> bool: return not (g())"}),
        ("raise ValueError(f'{1 + a}')", set()),
        ("'''Text.'''", set()),
        ("__all__ = ['a'][0:1]", set()),
        ("a: Sequence[2] = b", set()),
        ("x = f'{a + 1}'", set()),
    ],
)
def test_changes_to_a_line(text: str, expected: set[str]) -> None:
    assert made(text) == expected


def test_a_change_tells_its_line() -> None:
    data = "é = 1.0\n\n\ndef f(a):\n    return (a\n            - 3.0)\n".encode()
    told = [(one.line, one.what, one.source) for one in changes(data)]
    assert told == [
        (1, "`1.0` -> `1.1`", "é = 1.0"),
        (6, "`-` -> `+`", "- 3.0)"),
        (6, "`3.0` -> `3.3`", "- 3.0)"),
    ]


def test_what_makes_the_same_code_is_no_change() -> None:
    data = b"x = -0 + a"
    same = [change.what for change in changes(data) if not makes_other_code(data, change)]
    assert same == ["`-` left out"]


@pytest.fixture(scope="module")
def rests() -> Rests:
    files = [f for room in ("core", "plant") for f in (ROOT / room).rglob("*.py")]
    return Rests(ROOT, [file.relative_to(ROOT).as_posix() for file in files])


def line_of(file: str, text: str) -> int:
    lines = (ROOT / file).read_text().splitlines()
    return 1 + next(i for i, line in enumerate(lines) if text in line)


def test_kernels_rest_on_what_they_call(rests: Rests) -> None:
    on = rests.on("core/numeric.py", line_of("core/numeric.py", "def clip") + 3)
    for name in (
        ("plant/actuators.py", "pitch_rate"),
        ("plant/dynamics.py", "evaluate"),
        ("plant/simulation.py", "trajectory"),
    ):
        assert name in on
    assert ("plant/fuel.py", "fuel_rate") not in on


def test_kernels_rest_on_constants_and_on_what_is_spelled_out(rests: Rests) -> None:
    on = rests.on("plant/surroundings.py", line_of("plant/surroundings.py", "ATMOSPHERE,"))
    assert ("plant/cavitation.py", "burrill_ratio") in on
    assert ("plant/state.py", "shift_state") in rests.on(
        "plant/state.py", line_of("plant/state.py", "def _root")
    )


def test_kernels_do_not_rest_on_the_range_of_a_number(rests: Rests) -> None:
    on = rests.on("plant/hull.py", line_of("plant/hull.py", "mass_kg: float"))
    assert ("plant/ship.py", "Ship") in on
    assert ("plant/dynamics.py", "evaluate") not in on


def test_the_nearest_tests_come_first(tmp_path: Path) -> None:
    texts = {
        "plant/hull.py": "",
        "plant/drives/hull.py": "",
        "plant/shaft.py": "",
        "tests/plant/test_hull.py": "from shaftline.plant.shaft import x",
        "tests/plant/drives/test_hull.py": "",
        "tests/plant/test_a.py": "from shaftline.plant.hull import x",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert mirror(tmp_path, "plant/hull.py", {}) == [
        "tests/plant/test_hull.py",
        "tests/plant/test_a.py",
    ]
    assert mirror(tmp_path, "plant/drives/hull.py", {}) == ["tests/plant/drives/test_hull.py"]
    assert mirror(tmp_path, "plant/shaft.py", {}) == ["tests/plant/test_hull.py"]
    assert mirror(tmp_path, "plant/shaft.py", {"tests/plant/test_a.py": ["plant/shaft.py"]}) == [
        "tests/plant/test_hull.py",
        "tests/plant/test_a.py",
    ]
    (tmp_path / "plant/other.py").write_text("")
    assert len(mirror(tmp_path, "plant/other.py", {})) == 3


def test_a_seed_draws_the_same_changes_and_one_a_line() -> None:
    drawn, again, other = (sample(ROOT, 20, seed, ["plant/shaft.py"], {}) for seed in (1, 1, 2))
    assert drawn == again != other
    assert len({mutant.change.line for mutant in drawn}) == 20
    assert len({mutant.key for mutant in drawn}) == 20


def test_a_survivor_has_a_reason_or_is_a_hole() -> None:
    first, second, *_ = sample(ROOT, 5, 1, ["plant/shaft.py"], {})
    let_pass = [
        {
            "file": first.file,
            "line": first.change.source,
            "change": first.change.what,
            "reason": "of no weight",
        },
    ]
    assert reason(first, let_pass) == "of no weight"
    assert reason(second, let_pass) == ""
    outcomes = [Outcome(first, False, "", 1.0), Outcome(second, True, "test_x", 1.0)]
    assert shares(outcomes) == {"plant": (1, 2)}
    assert "| `plant/` | 2 | 1 | 50.0% | 95% |" in page(outcomes, 1, let_pass)
    assert "**a hole**" in page([Outcome(second, False, "", 1.0)], 1, let_pass)


def test_every_accepted_survivor_is_a_line_of_its_file() -> None:
    declared = tomllib.loads((ROOT / "tests/mutants/let_pass.toml").read_text(encoding="utf-8"))
    for entry in declared["let_pass"]:
        lines = (ROOT / entry["file"]).read_text(encoding="utf-8").splitlines()
        assert entry["line"] in map(str.strip, lines), entry
    served = {file for files in declared["serves"].values() for file in files}
    assert [file for file in served if not (ROOT / file).is_file()] == []


def test_other_files_leave_the_draw_as_it_is(tmp_path: Path) -> None:
    for name, text in (("plant/a.py", "x = a + b\ny = c * d\n"), ("tests/conftest.py", "")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "tests/plant").mkdir()
    before = sample(tmp_path, 2, 1, ["plant"], {})
    (tmp_path / "plant/a.py").write_text("\nz = e\n\nx = a + b\ny = c * d\n")
    after = sample(tmp_path, 2, 1, ["plant"], {})
    assert [m.change.what for m in before] == [m.change.what for m in after]


def test_a_mutant_is_told_with_its_place() -> None:
    mutant: Mutant = sample(ROOT, 1, 1, ["plant/shaft.py"], {})[0]
    assert str(mutant).startswith(f"plant/shaft.py:{mutant.change.line}: ")
