"""The recipes of CONTRIBUTING name every place that has to be touched, and no more than is allowed.

Each recipe gives its places, and some things that are there already and were made by it. A place that
does not speak of its example is not needed; a file of the product that does and is no place is one more
to touch. ``__init__.py`` files may export anything, and the independent simulator of ``validation`` is
another ship on purpose.
"""

from __future__ import annotations

import ast
import functools
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PRODUCT = (
    "core",
    "plant",
    "display",
    "observers",
    "baselines",
    "envs",
    "agents",
    "mismatch",
    "cli",
)
MOST = {
    "observer": 2,
    "controller": 2,
    "reward-term": 2,
    "term": 2,
    "compiled-effect": 2,
    "effect-with-state": 4,
    "drive": 3,
    "ship": 1,
    "sea": 1,
    "task": 1,
}
"""Places that each may ask for, its test counted."""

_TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
RECIPES: dict[str, dict[str, Any]] = {}
for _block in re.findall(r"```toml\n(.*?)```", _TEXT, re.DOTALL):
    RECIPES |= tomllib.loads(_block)

EXAMPLES = [(recipe, example) for recipe, own in RECIPES.items() for example in own["examples"]]


def places(recipe: str, example: dict[str, Any]) -> list[str]:
    """Files of a recipe for one of its examples."""
    found = list(RECIPES[recipe]["places"])
    for key, value in example.items():
        found = [place.replace(f"<{key}>", str(value)) for place in found]
    return found


@functools.cache
def said(file: Path) -> frozenset[str]:
    """Names and strings of a module's code, its docstrings and comments left out."""
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    prose = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    found: set[str | None] = set()
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            found.add(node.value)
        for attribute in ("id", "attr", "name", "asname", "arg", "module"):
            value = getattr(node, attribute, None)
            if isinstance(value, str):
                found.add(value)
                found.add(value.rpartition(".")[2])
    return frozenset(word for word in found if word)


def test_every_recipe_is_there() -> None:
    assert set(RECIPES) == set(MOST)


@pytest.mark.parametrize("recipe", MOST)
def test_a_recipe_asks_for_no_more_places_than_the_house_allows(recipe: str) -> None:
    assert len(RECIPES[recipe]["places"]) <= MOST[recipe]


EACH = pytest.mark.parametrize(
    ("recipe", "example"),
    [pytest.param(*known, id=f"{known[0]}-{known[1]['words'][0]}") for known in EXAMPLES],
)


@EACH
def test_every_place_is_needed(recipe: str, example: dict[str, Any]) -> None:
    for place in places(recipe, example):
        text = (ROOT / place).read_text(encoding="utf-8")
        assert any(word in text for word in example["words"]), f"{place} has nothing to do with it"


@EACH
def test_no_other_place_is_touched(recipe: str, example: dict[str, Any]) -> None:
    named = {ROOT / place for place in places(recipe, example)}
    for room in PRODUCT:
        for file in (ROOT / room).rglob("*.py"):
            if file.name != "__init__.py" and file not in named:
                found = said(file) & set(example["words"])
                assert not found, f"{file.relative_to(ROOT)} speaks of {', '.join(found)}"


@pytest.mark.parametrize(("recipe", "table"), [("term", "term"), ("compiled-effect", "effect")])
def test_a_recipe_names_the_table_of_the_catalogue_that_its_author_writes(
    recipe: str, table: str
) -> None:
    text = next(part for part in _TEXT.split("```toml\n") if f"[{recipe}]" in part.split("```")[0])
    before = _TEXT[: _TEXT.index(text)].rpartition("```")[0].rpartition("```")[2]
    named = set(re.findall(r"\[\[(\w+)\]\]", before)) & {"term", "effect"}
    assert named == {table}
    catalogue = tomllib.loads((ROOT / "mismatch/search/catalogue.toml").read_text("utf-8"))
    if recipe == "term":
        ids = {entry["id"] for entry in catalogue[table]}
        assert {word for example in RECIPES[recipe]["examples"] for word in example["words"]} <= ids
