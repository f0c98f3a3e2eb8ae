"""Check that options of commands, verdicts and keys of reports in the pages exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from shaftline.cli import main
from shaftline.mismatch.judge import verdict

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
SOURCES = [
    file
    for folder in ROOT.iterdir()
    if folder.is_dir() and folder.name[0] != "." and folder.name not in ("tests", "out", "build")
    for file in folder.rglob("*.py")
]
VERDICTS = {verdict.EXPLAINED, verdict.PARTLY, verdict.NOTHING, verdict.UNEXPLAINED}
REPORTS = (
    "report/data.py",
    "report/wording.py",
    "identification/parameters.py",
    "identify.py",
    "estimate.py",
)
"""Modules of ``mismatch`` that write the keys of report.json."""

COMMANDS = {
    name: {
        option
        for parameter in main.LazyCommand(name).itself().params
        for option in (*parameter.opts, *parameter.secondary_opts)
    }
    for name in main.COMMANDS
}
pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())


def keys_of_reports() -> set[str]:
    """Return every key of the dictionaries that make up a report."""
    found: set[str] = set()
    for name in REPORTS:
        tree = ast.parse((ROOT / "mismatch" / name).read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            keys = node.keys if isinstance(node, ast.Dict) else []
            targets = [node.slice] if isinstance(node, ast.Subscript) else []
            for key in (*keys, *targets):
                if isinstance(key, ast.Constant) and isinstance(key.value, str):
                    found.add(key.value)
    return found


def lines_of_commands(text: str) -> list[str]:
    """Return the command lines in the blocks of a page, with continuation lines joined."""
    blocks = "\n".join(re.findall(r"^```[a-z]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE))
    joined = re.sub(r"\\\n\s*", " ", blocks)
    return re.findall(r"^(?:\$ )?shaftline .*$", joined, re.MULTILINE)


@pages
def test_every_option_of_a_command_line_is_one_of_that_command(page: Path) -> None:
    for line in lines_of_commands(page.read_text(encoding="utf-8")):
        command = line.removeprefix("$ ").split()[1]
        if command.startswith("-"):
            continue
        given = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", line.partition("#")[0]))
        assert given <= COMMANDS[command] | {"--help"}, line


@pages
def test_every_option_that_is_named_exists(page: Path) -> None:
    known = set().union(*COMMANDS.values())
    known |= {
        option
        for file in SOURCES
        for option in re.findall(r'"(--[a-z][a-z-]*)"', file.read_text(encoding="utf-8"))
    }
    named = re.findall(r"`(--[a-z][a-z-]*)", page.read_text(encoding="utf-8"))
    assert set(named) <= known | {"--help", "--strict"}  # mypy's


@pages
def test_every_key_of_a_report_that_is_named_exists(page: Path) -> None:
    known = keys_of_reports()
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    named = []
    for sentence in re.split(r"(?<=[.;:])\s+(?=[A-Z`*(-])|\n\s*\n|^\|", text, flags=re.MULTILINE):
        if "`report.json`" in sentence or "`report.json` " in sentence:
            named += re.findall(r"`([a-z]+(?:_[A-Za-z]+)*)`", sentence)
    assert set(named) <= known


def test_a_report_in_a_block_has_keys_that_exist() -> None:
    known, shown = keys_of_reports(), []
    for page in PAGES:
        for block in re.findall(r"```json\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            shown += re.findall(r'"([a-z]+(?:_[A-Za-z]+)*)":', block)
    assert {"numbers", "moved", "source"} <= set(shown)
    assert set(shown) <= known


def test_the_page_describes_every_verdict_and_no_other() -> None:
    text = (ROOT / "docs" / "diagnose.md").read_text(encoding="utf-8")
    found = re.search(r"^## The (\w+) verdicts\n(.*?)^## ", text, re.DOTALL | re.MULTILINE)
    assert found is not None
    heading, section = found.groups()
    assert set(re.findall(r"^\*\*([a-z-]+)\.\*\*", section, re.MULTILINE)) == VERDICTS
    assert heading == {3: "three", 4: "four", 5: "five"}[len(VERDICTS)]


def test_the_help_describes_every_verdict_and_no_other() -> None:
    words = main.LazyCommand("diagnose").itself().help
    assert set(re.findall(r"^\s*- \*\*([a-z-]+)\*\*", words, re.MULTILINE)) == VERDICTS
    assert "four verdicts" in words
