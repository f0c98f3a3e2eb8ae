"""The architecture: imports between packages, contents of the wheel, imports of a checkout."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAY_IMPORT: dict[str, set[str]] = {
    "core": set(),
    "plant": {"core"},
    "display": {"core", "plant"},
    "observers": {"core", "plant"},
    "baselines": {"core", "plant", "observers"},
    "envs": {"core", "plant", "observers", "baselines"},
    "fmi": {"core", "plant", "baselines"},
    "agents": {"core", "plant", "observers", "baselines", "envs", "display", "fmi"},
    "mismatch": {"core", "plant", "observers", "display"},
    "performance": {"core", "plant", "display", "mismatch"},
    "validation": {"core", "plant", "observers", "mismatch", "display"},
}
MAY_IMPORT["cli"] = {*MAY_IMPORT}
FOLDERS = tuple(MAY_IMPORT)


def modules(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imported_folders(file: Path) -> set[str]:
    """Folders that a module imports: relatively, or by the package's name."""
    found = set()
    up_to_the_root = len(file.relative_to(ROOT).parts)
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == up_to_the_root:
            found |= {node.module.split(".")[0]} if node.module else {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = node.module.split(".")
            if names[0] == "shaftline" and len(names) > 1:
                found.add(names[1])
    return found


def bare_imports(file: Path) -> set[str]:
    """Top-level names that a module imports absolutely."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("folder", FOLDERS)
def test_imports_point_one_way(folder: str) -> None:
    for file in modules(folder):
        others = imported_folders(file) - {folder}
        assert others <= MAY_IMPORT[folder], f"{file} imports {others - MAY_IMPORT[folder]}"


@pytest.mark.parametrize("folder", [*FOLDERS, "tests"])
def test_nobody_imports_a_folder_by_its_bare_name(folder: str) -> None:
    for file in modules(folder):
        assert not bare_imports(file) & set(FOLDERS), file


def test_no_other_python_file_stands_at_the_root() -> None:
    assert sorted(file.name for file in ROOT.glob("*.py")) == ["__init__.py", "__main__.py"]


def run_above(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Import shaftline in a folder that contains a checkout of that name, without an installation."""
    command = [sys.executable, "-S", "-c", "import shaftline; print(shaftline.__file__)"]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env=environment
    )


@pytest.fixture
def above(tmp_path: Path) -> Path:
    """Return a folder with a checkout named shaftline."""
    (tmp_path / "shaftline").symlink_to(ROOT)
    return tmp_path


def test_a_program_above_a_checkout_does_not_import_it_by_accident(above: Path) -> None:
    done = run_above(above)
    assert done.returncode == 1
    assert "is a checkout of shaftline, found only because this program runs in" in done.stderr
    assert "pip install -e" in done.stderr


def test_a_checkout_is_imported_where_it_is_asked_for(above: Path) -> None:
    done = run_above(above, PYTHONPATH=str(above))
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(above / "shaftline" / "__init__.py")


def test_every_folder_is_packaged() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = settings["tool"]["setuptools"]["packages"]
    rooms = [init.parent for folder in FOLDERS for init in (ROOT / folder).rglob("__init__.py")]
    within = [".".join(room.relative_to(ROOT).parts) for room in rooms]
    expected = ["shaftline", *(f"shaftline.{name}" for name in within)]
    assert sorted(listed) == sorted(expected)


def test_the_wheel_holds_only_the_package(tmp_path: Path) -> None:
    source = tmp_path / "source"  # a copy: building leaves folders behind
    shutil.copytree(
        ROOT, source, ignore=shutil.ignore_patterns(".*", "build", "out", "__pycache__")
    )
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", tmp_path, source],
        check=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"shaftline"}
    for folder in FOLDERS:
        expected = {f"shaftline/{f.relative_to(ROOT).as_posix()}" for f in modules(folder)}
        assert expected <= set(names)
    for data in (
        "plant/ships/frigate.toml",
        "plant/seas.toml",
        "plant/templates/drive-with-load.toml",
        "plant/data/b_series_polynomials.csv",
        "envs/tasks.toml",
        "fmi/slave.c",
        "fmi/ship.c",
        "mismatch/search/catalogue.toml",
        "mismatch/report/report.html.j2",
        "plant/data/tito_neri_operating_points.csv",
        "validation/challenge_set/challenge-truth.json",
        "validation/challenge_set/challenge/README.md",
        "validation/challenge_set/challenge/case-005/recording.csv",
        "py.typed",
    ):
        assert f"shaftline/{data}" in names
    assert not [name for name in names if "/tests/" in name or "/docs/" in name]


def imports(file: Path) -> set[Path]:
    """Return the modules of the package that a module imports when it is imported itself."""
    found = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            names = [folder.with_suffix(".py")] if folder.with_suffix(".py").is_file() else []
            found |= {*names} or {
                part if (part := folder / f"{alias.name}.py").is_file() else folder / "__init__.py"
                for alias in node.names
            }
    return found


def unit(file: Path) -> str:
    """Return the sub-package of a module; a module directly in a package stands for itself."""
    parts = file.relative_to(ROOT).parts
    return "/".join(parts[:-1]) if len(parts) > 2 else "/".join(parts)


def test_no_modules_and_no_sub_packages_import_each_other_in_a_circle() -> None:
    files = [file for folder in FOLDERS for file in modules(folder)]
    for key in (str, unit):
        graph: dict[str, set[str]] = {}
        for file in files:
            others = {key(other) for other in imports(file)} - {key(file)}
            graph.setdefault(key(file), set()).update(others)
        while leaves := [one for one, others in graph.items() if not others & graph.keys()]:
            for one in leaves:
                del graph[one]
        assert not graph, f"these import each other in a circle: {sorted(graph)}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_module_is_longer_than_a_reader_can_follow(folder: str) -> None:
    lengths = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in modules(folder)}
    assert not {str(file): length for file, length in lengths.items() if length > 750}
