"""What a user reaches through the doors is documented: every argument, units of numbers, errors."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest

DOORS = ("plant", "observers", "baselines", "envs", "agents", "mismatch", "performance")


def exported() -> Iterator[tuple[str, Any]]:
    for door in DOORS:
        module = importlib.import_module(f"shaftline.{door}")
        for name in module.__all__:
            yield f"{door}.{name}", getattr(module, name)


def callables() -> Iterator[Any]:
    """Functions, classes, and the classes' own public methods."""
    for label, thing in exported():
        if inspect.isfunction(thing) or inspect.isclass(thing):
            yield pytest.param(thing, id=label)
        if inspect.isclass(thing):
            for name, member in vars(thing).items():
                plain = (
                    member.__func__ if isinstance(member, staticmethod | classmethod) else member
                )
                inherits = any(hasattr(base, name) for base in thing.__mro__[1:])
                if inspect.isfunction(plain) and not name.startswith("_") and not inherits:
                    yield pytest.param(plain, id=f"{label}.{name}")


def section(doc: str, title: str) -> str:
    found = re.search(
        rf"^{title}:\n((?:[ \t]+.*\n?|\n)+)", inspect.cleandoc(doc) + "\n", re.MULTILINE
    )
    return textwrap.dedent(found.group(1)) if found else ""


def entries(text: str) -> dict[str, str]:
    """``name: what it is`` of a section; what stands further in belongs to the entry before."""
    found: dict[str, str] = {}
    for line in text.splitlines():
        head = re.match(r"^(\w+)(?: \(.*?\))?: (.*)", line)
        if head:
            found[head[1]] = head[2]
        elif found:
            found[next(reversed(found))] += " " + line.strip()
    return found


def parameters(thing: Any) -> dict[str, inspect.Parameter]:
    """Of the call, what every controller or environment has by its base class apart."""
    try:
        found = inspect.signature(thing).parameters
    except (TypeError, ValueError):
        return {}
    loose = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return {n: p for n, p in found.items() if n not in ("self", "cls") and p.kind not in loose}


def told_elsewhere(thing: Any) -> bool:
    """Errors say what happened; the fields of records and files carry their own descriptions."""
    if not inspect.isclass(thing):
        return False
    return (
        issubclass(thing, Exception)
        or hasattr(thing, "_fields")  # a comment with its unit stands behind each field
        or hasattr(thing, "model_fields")
        or thing.__init__ is object.__init__
    )


def commented(thing: Any) -> set[str]:
    """Fields of a dataclass that have a comment behind them, there or where they are inherited from."""
    if not inspect.isclass(thing):
        return set()
    family = [inspect.getsource(one) for one in thing.__mro__ if dataclasses.is_dataclass(one)]
    return set(re.findall(r"^ +(\w+): [^\n]*  # ", "".join(family), re.MULTILINE))


@pytest.mark.parametrize("thing", callables())
def test_says_what_it_is(thing: Any) -> None:
    assert thing.__doc__, "no docstring"
    assert thing.__doc__.strip()[0].isupper() or thing.__doc__.strip()[0] in "`0123456789"


@pytest.mark.parametrize("thing", [one for one in callables() if inspect.isfunction(one.values[0])])
def test_a_path_may_be_given_as_text(thing: Any) -> None:
    kinds = {name: str(one.annotation) for name, one in parameters(thing).items()}
    assert not [name for name, kind in kinds.items() if "Path" in kind and "str" not in kind]


@pytest.mark.parametrize("thing", callables())
def test_every_argument_is_documented(thing: Any) -> None:
    wanted = parameters(thing)
    inherited = thing.__doc__ is not None and "see :" in thing.__doc__
    if told_elsewhere(thing) or inherited or len(wanted) == 0:
        return
    family = thing.__mro__ if inspect.isclass(thing) else [thing]
    told: dict[str, str] = {}
    for one in family:
        told |= entries(section(one.__doc__ or "", "Args"))
    if not told and len(wanted) == 1 and inspect.isfunction(thing):
        return  # one argument whose meaning the sentence gives
    beside = commented(thing)
    missing = [name for name in wanted if name not in told and name not in beside]
    assert not missing, f"not documented: {missing}"
    own = entries(section(thing.__doc__ or "", "Args"))
    unknown = [name for name in own if name not in inspect.signature(thing).parameters]
    assert not unknown, f"documented, but no argument: {unknown}"


UNIT = re.compile(
    r"\[[^\]]+\]|_(s|m|rad_s|m_s|mm|N_m|kg|Hz|percent|db)\b|share|factor|ratio|fraction|unit|log L"
)


@pytest.mark.parametrize("thing", callables())
def test_numbers_have_units(thing: Any) -> None:
    told = entries(section(thing.__doc__ or "", "Args"))
    for name, parameter in parameters(thing).items():
        if name in told and str(parameter.annotation).startswith("float"):
            assert UNIT.search(f"{name}: {told[name]}"), f"{name}: {told[name]}: no unit"


def raised(function: Callable[..., Any]) -> set[str]:
    """Names of the errors that a function itself raises."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            name = node.exc.func
            found.add(name.id if isinstance(name, ast.Name) else "")
    return found - {""}


@pytest.mark.parametrize("thing", callables())
def test_errors_are_documented(thing: Any) -> None:
    function = thing.__init__ if inspect.isclass(thing) else thing
    made = getattr(function, "__code__", None)
    if made is None or made.co_filename.startswith("<"):
        return  # inherited, or a dataclass's own
    told = section(thing.__doc__ or "", "Raises")
    untold = [name for name in raised(function) if name not in told]
    assert not untold, f"raised, but not documented: {untold}"
