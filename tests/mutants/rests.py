"""What rests on what in the product, name by name.

A kernel is compiled together with everything that it calls and every constant that it reads. So a
change to one definition makes wrong what was compiled from it, and from every definition that speaks
of it, at whatever distance - and leaves all other machine code right.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import TypeAlias

PACKAGE = "shaftline"
DISCOVERY = "classes_in"

Name: TypeAlias = tuple[str, str]
"""A file below the root, and a name that it defines at its top."""


@functools.cache
def imports(root: Path, file: str) -> dict[str, Name]:
    """What a file takes from others of the product, by the name that it has here.

    A module that is taken as a whole has the name ``*``.
    """
    found = {}
    for node in ast.walk(_tree(root, file)):
        if not isinstance(node, ast.ImportFrom):
            continue
        names = node.module.split(".") if node.module else []
        if node.level:
            place = list(PurePosixPath(file).parts[: -node.level])
        elif names[:1] == [PACKAGE]:
            place, names = [], names[1:]
        else:
            continue
        for alias in node.names:
            here = alias.asname or alias.name
            if module := _module(root, [*place, *names, alias.name]):
                found[here] = (module, "*")
            elif module := _module(root, [*place, *names]):
                found[here] = (module, alias.name)
    return found


def _module(root: Path, parts: list[str]) -> str | None:
    for path in ("/".join(parts) + ".py", "/".join([*parts, "__init__.py"])):
        if parts and (root / path).is_file():
            return path
    return None


@functools.cache
def _tree(root: Path, file: str) -> ast.Module:
    return ast.parse((root / file).read_bytes())


def defined(statement: ast.stmt) -> set[str]:
    """Names that a statement at the top of a file defines."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return {statement.name}
    if isinstance(statement, ast.Import | ast.ImportFrom):
        return set()
    nodes = (n for n in ast.walk(statement) if isinstance(n, ast.Name))
    return {n.id for n in nodes if isinstance(n.ctx, ast.Store)}


def spoken_of(statement: ast.stmt, everything: set[str]) -> set[str]:
    """Names that a statement speaks of; ``globals()`` is all of them."""
    found = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}
    return everything if "globals" in found else found


class Rests:
    """The product's definitions, each with those that speak of it.

    Args:
        root: of the repository.
        files: of the product, below it.
    """

    def __init__(self, root: Path, files: Iterable[str]) -> None:
        self.root = root
        self.speakers: dict[Name, set[Name]] = {}
        names = {f: set().union(*map(defined, _tree(root, f).body)) for f in files}
        for file, own in names.items():
            taken = imports(root, file)
            for here, (other, name) in taken.items():  # may be taken from here in its turn
                for one in names.get(other, ()) if name == "*" else (name,):
                    self.speakers.setdefault((other, one), set()).add((file, here))
            for statement in _tree(root, file).body:
                speakers = {(file, speaker) for speaker in defined(statement)}
                spoken = spoken_of(statement, own | {*taken})
                heard = {(file, name) for name in spoken & (own | {*taken})}
                if DISCOVERY in spoken:  # takes classes from the whole folder without naming them
                    beside = {f for f in names if Path(f).parent == Path(file).parent} - {file}
                    heard |= {(other, name) for other in beside for name in names[other]}
                for name_heard in heard:
                    self.speakers.setdefault(name_heard, set()).update(speakers)

    def on(self, file: str, line: int) -> set[Name]:
        """All that rests on the definition at a line of a file, itself among it."""
        body = _tree(self.root, file).body
        at = [s for s in body if s.lineno <= line <= (s.end_lineno or s.lineno)]
        fresh = {(file, name) for statement in at for name in defined(statement)}
        if not fresh:  # a statement that defines nothing may change anything
            fresh = {(file, name) for statement in body for name in defined(statement)}
        found = set(fresh)
        while fresh:
            fresh = {s for name in fresh for s in self.speakers.get(name, ())} - found
            found |= fresh
        return found
