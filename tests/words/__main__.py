"""Report private words with file and line: ``python -m tests.words [FOLDER OR FILE]...``.

The words and their replacements are in ``words.toml``, with contexts in which a word is allowed. Checked
are Markdown pages, and in Python files the docstrings, the comments and the texts of more than one word.
Names in backticks are left out.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
_FOLDERS = (
    "core", "plant", "observers", "baselines", "envs", "agents", "mismatch", "validation", "display",
    "cli", "docs", "examples", "reproductions", "README.md", "CONTRIBUTING.md",
)  # fmt: skip
_LEFT_OUT = re.compile(
    r"`[^`]*`|https?://\S+|\]\([^)]*\)|\b\w+[_.]\w[\w.]*|--[\w-]+|\b[\w-]+\.(?:py|md|toml|csv)\b"
)


class Word(NamedTuple):
    """A private word.

    Args:
        pattern: of the word.
        instead: what to write.
        allowed: contexts in which the word is a term of the field.
    """

    pattern: re.Pattern[str]
    instead: str
    allowed: re.Pattern[str] | None


def read_words() -> list[Word]:
    """Return the words of ``words.toml``."""
    table = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
    return [
        Word(
            re.compile(rf"\b(?:{entry['word']})\b", re.IGNORECASE),
            entry["instead"],
            re.compile(entry["allowed"], re.IGNORECASE) if "allowed" in entry else None,
        )
        for entry in table["words"]
    ]


def texts_of(file: Path) -> Iterator[tuple[int, str]]:
    """Return the texts of a file with the line of each."""
    content = file.read_text(encoding="utf-8")
    if file.suffix == ".md":
        code = False
        for line, text in enumerate(content.splitlines(), 1):
            code ^= text.startswith("```")
            if not code:
                yield line, text
        return
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            for offset, text in enumerate(node.value.splitlines()):
                yield node.lineno + offset, text
    for token in tokenize.generate_tokens(io.StringIO(content).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def found_in(file: Path, words: list[Word]) -> Iterator[tuple[int, str, str]]:
    """Return line, word and replacement of every private word in a file."""
    for line, raw in texts_of(file):
        text = _LEFT_OUT.sub("~", raw)
        for word in words:
            kept = word.allowed.sub("~", text) if word.allowed else text
            for match in word.pattern.finditer(kept):
                yield line, match[0], word.instead


def files_of(places: list[Path]) -> list[Path]:
    """Return the pages and modules of folders and files; result tables of data are left out."""
    return [
        file
        for place in places
        for file in ([place] if place.is_file() else sorted(place.rglob("*")))
        if file.suffix in (".md", ".py")
        and "CHANGELOG" not in file.name
        and not {"out", "__pycache__", "tests"} & set(file.relative_to(place).parts)
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print every private word; return 1 where there is one."""
    parser = argparse.ArgumentParser("python -m tests.words", description=__doc__.split("\n")[0])
    parser.add_argument("places", nargs="*", type=Path, help="folders or files; all by default")
    parser.add_argument("--count", action="store_true", help="only counts, by word")
    options = parser.parse_args(arguments)
    places = options.places or [ROOT / name for name in _FOLDERS]
    words, counts = read_words(), dict[str, int]()
    for file in files_of(places):
        for line, word, instead in found_in(file, words):
            counts[word.lower()] = counts.get(word.lower(), 0) + 1
            if not options.count:
                print(f"{file}:{line}: {word!r}: write {instead}")
    if options.count:
        for word, count in sorted(counts.items(), key=lambda item: -item[1]):
            print(f"{count:5d} {word}")
    print(f"{sum(counts.values())} private words")
    return 1 if counts else 0


if __name__ == "__main__":
    sys.exit(main())
