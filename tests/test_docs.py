"""Check the pages: blocks run, imports are public, links, files and commands exist."""

from __future__ import annotations

import ast
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from shaftline.cli.main import app
from shaftline.plant import load_ship

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = [
    (page.relative_to(ROOT).as_posix(), i, block)
    for page in PAGES
    for i, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL))
]
CELLS = [
    (page.name, "".join(line for line in cell.splitlines(True) if not line.startswith(("!", "%"))))
    for page in sorted((ROOT / "docs" / "notebooks").glob("*.md"))
    for cell in re.findall(r"```\{code-cell\} python\n(.*?)```", page.read_text(), re.DOTALL)
]
"""Code cells of the notebooks, which the build of the site runs."""
blocks = pytest.mark.parametrize(
    ("page", "number", "block"), BLOCKS, ids=[f"{p}-{i}" for p, i, _ in BLOCKS]
)

PACKAGES = ("plant", "observers", "baselines", "envs", "agents", "mismatch", "performance")
PUBLIC = {f"shaftline.{package}" for package in PACKAGES} | {
    "shaftline.envs.sb3"  # separate, because it needs stable-baselines3
}


@blocks
def test_python_block_runs(
    page: str, number: int, block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # a block may write files
    exec(block, {"__name__": "__main__"})  # unchanged, as copied into a file


@pytest.mark.parametrize(
    ("page", "block"), [*((p, b) for p, _, b in BLOCKS), *CELLS], ids=lambda text: str(text)[:30]
)
def test_python_block_imports_public_packages(page: str, block: str) -> None:
    for node in ast.walk(ast.parse(block)):
        named = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            named = [node.module or ""]
        ours = {name for name in named if name.split(".")[0] == "shaftline"}
        assert ours <= PUBLIC, f"{page}: {ours - PUBLIC}"


def test_targets_of_links_exist() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page}: {target}"


def test_named_files_exist() -> None:
    packages = "|".join(file.parent.name for file in ROOT.glob("*/__init__.py"))
    for page in PAGES:
        for name in re.findall(rf"`((?:{packages}|docs)/[\w./-]+)`", page.read_text()):
            assert (ROOT / name).exists(), f"{page}: {name}"


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "Makefile"], ids=lambda page: page.relative_to(ROOT).as_posix()
)
def test_named_commands_exist(page: Path) -> None:
    text = page.read_text()
    for module in re.findall(r"python -m shaftline\.([\w.]+)", text):
        place = ROOT.joinpath(*module.rstrip(".").split("."))
        assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file(), module
    for command in re.findall(r"(?:^|`|/)shaftline ([a-z][a-z-]*)", text, re.MULTILINE):
        file = f"{command.replace('-', '_')}_command.py"
        assert (ROOT / "cli" / file).is_file(), command
    for target in re.findall(r"(?:^|`)make ([a-z-]+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE), target


def test_the_commands_of_the_page_on_own_physics(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "own-physics.md").read_text()
    made: dict[str, Any] = {}
    exec(next(block for page, i, block in BLOCKS if (page, i) == ("docs/own-physics.md", 0)), made)
    entry, column_map, carried = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    made["log"].to_csv("log.csv", index=False)
    Path("MY.toml").write_text(entry)
    Path("map.toml").write_text(column_map)
    commands = re.findall(r"^shaftline (.*)$", text, re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        result = CliRunner().invoke(app, command.split())
        assert result.exit_code == 0, result.output
    report = json.loads(Path("out/wind/report.json").read_text())
    said = re.search(r"\*\"(Between .*), …\"\*", text)
    assert said is not None
    assert said[1] in report["sentence"]
    assert [effect["id"] for effect in report["effects"]] == ["apparent-wind"]
    corrected, refined = (
        load_ship("out/wind/corrected_ship.toml"),
        load_ship("out/k/identified_ship.toml"),
    )
    for ship in (corrected, refined):
        assert ship.parameter("term.apparent-wind-hull.k").value == pytest.approx(300.0, rel=0.02)
    shown = tomllib.loads(carried)
    assert dict(corrected.signals) == shown["signals"]
    (term,) = corrected.term
    assert {"id": term.id, "acts_on": term.acts_on, "expression": term.expression} == {
        key: shown["term"][0][key] for key in ("id", "acts_on", "expression")
    }
    wrong = entry.replace("probes", "probs")
    Path("MY.toml").write_text(wrong)
    result = CliRunner().invoke(app, commands[0].split())
    assert "MY.toml: term apparent-wind: parameters.k.probs is not a known key" in result.output
