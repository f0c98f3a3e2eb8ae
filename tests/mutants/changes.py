"""Small wrong changes that could be made to a source file, found on its syntax tree.

Left alone are texts (docstrings, messages, descriptions), type hints, decorators, ``__all__`` and
whatever is raised: a change there makes no result wrong.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from types import CodeType
from typing import NamedTuple

ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
COMPARISON: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: (r"is", ("is not",)),
    ast.IsNot: (r"is\s+not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: (r"not\s+in", ("in",)),
}
TWINS = {
    "min": "max",
    "max": "min",
    "any": "all",
    "all": "any",
    "sorted": "list",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "sin": "cos",
    "cos": "sin",
    "floor": "ceil",
    "ceil": "floor",
}
"""Functions that are easily taken for one another."""

TEXT_KEYWORDS = {"description", "unit", "record", "encoding", "strict"}
"""Arguments that hold a text, or that only guard (``zip(strict=True)``)."""

ROUNDING = 1e-6
"""Constants below it guard against rounding; 10 % more of them is no other program, none of them is."""


class Change(NamedTuple):
    """A stretch of a file, and what it is replaced by."""

    line: int  # from 1
    start: int  # bytes from the file's beginning
    end: int
    new: str
    what: str  # told
    source: str  # the line, as it is


def changed(data: bytes, change: Change) -> bytes:
    """A file with a change made to it."""
    return data[: change.start] + change.new.encode() + data[change.end :]


def changes(data: bytes) -> list[Change]:
    """Every change that could be made to a file."""
    finder = _Finder(data)
    finder.visit(ast.parse(data))
    return sorted(set(finder.found))


def makes_other_code(data: bytes, change: Change) -> bool:
    """Whether the change is one to the compiler too."""
    before, after = (compile(text, "", "exec") for text in (data, changed(data, change)))
    return _bare(before) != _bare(after)


def _bare(code: CodeType) -> CodeType:
    """Code without the places in the source that it came from."""
    constants = (_bare(c) if isinstance(c, CodeType) else c for c in code.co_consts)
    return code.replace(co_linetable=b"", co_consts=tuple(constants))


def _wrong(value: object) -> list[str]:
    """Wrong values of a constant: a tenth too large, one more or less, the other truth."""
    if isinstance(value, bool):
        return [str(not value)]
    if isinstance(value, int):
        step = max(1, value // 10)
        return [str(value + step)] if value == 0 else [str(value + step), str(value - step)]
    if isinstance(value, float) and value == 0.0:
        return ["1.0"]
    if isinstance(value, float):
        return ["0.0" if abs(value) < ROUNDING else repr(float(f"{1.1 * value:.6g}"))]
    return []


class _Finder(ast.NodeVisitor):
    def __init__(self, data: bytes) -> None:
        self.data = data
        self.lines = data.decode().splitlines()
        self.starts = [0]
        for line in data.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.found: list[Change] = []
        self.returns = ""

    # places

    def _start(self, node: ast.expr | ast.stmt | ast.keyword) -> int:
        return self.starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr | ast.stmt | ast.keyword) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.starts[node.end_lineno - 1] + node.end_col_offset

    def _add(self, start: int, end: int, new: str, what: str = "") -> None:
        line = next(i for i in range(len(self.starts), 0, -1) if self.starts[i - 1] <= start)
        old = self.data[start:end].decode()
        what = what or f"`{old}` -> `{new}`"
        what = " ".join(what.split())
        self.found.append(Change(line, start, end, new, what, self.lines[line - 1].strip()))

    def _between(self, left: ast.expr, right: ast.expr, pattern: str) -> tuple[int, int]:
        """Where an operator stands between its operands."""
        start, end = self._end(left), self._start(right)
        gap = re.sub(rb"#[^\n]*", lambda m: b" " * len(m[0]), self.data[start:end])
        found = re.search(pattern.encode(), gap)
        assert found is not None
        return start + found.start(), start + found.end()

    # what is left alone

    def visit_Raise(self, node: ast.Raise) -> None:
        pass

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        pass

    def visit_arguments(self, node: ast.arguments) -> None:
        for default in (*node.defaults, *node.kw_defaults):
            if default is not None:
                self.visit(default)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for statement in node.body:
            self.visit(statement)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None and "TypeAlias" not in ast.unparse(node.annotation):
            self.visit(node.value)

    # statements

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        outer, self.returns = self.returns, ast.unparse(node.returns) if node.returns else ""
        self.visit(node.args)
        for statement in node.body:
            self.visit(statement)
        self.returns = outer

    def visit_Lambda(self, node: ast.Lambda) -> None:
        self.visit(node.body)

    def visit_Assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if isinstance(target, ast.Name) and target.id == "__all__":
            return
        if isinstance(target, ast.Attribute | ast.Subscript):
            self._leave_out(node)
            self.visit(target)
        self.visit(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in ARITHMETIC:
            old, new = ARITHMETIC[type(node.op)]
            start, _ = self._between(node.target, node.value, re.escape(old + "="))
            self._add(start, start + len(old) + 1, f"{new}=")
        self.visit(node.target)
        self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._leave_out(node)
            self.visit(node.value)

    def _leave_out(self, node: ast.stmt) -> None:
        self._add(self._start(node), self._end(node), "pass", "left out")

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is None:
            return
        plain = isinstance(node.value, ast.Constant | ast.UnaryOp | ast.Compare)
        text = self.data[self._start(node.value) : self._end(node.value)].decode()
        if not plain and self.returns in ("float", "Real", "complex"):
            self._add(self._start(node.value), self._end(node.value), f"-({text})", "sign turned")
        if not plain and self.returns == "bool":
            self._add(self._start(node.value), self._end(node.value), f"not ({text})", "negated")
        self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self._negate(test)
        self.generic_visit(node)

    def _negate(self, test: ast.expr) -> None:
        """A condition without an operator of its own to be changed."""
        if isinstance(test, ast.Name | ast.Attribute | ast.Call | ast.Subscript):
            text = self.data[self._start(test) : self._end(test)].decode()
            self._add(self._start(test), self._end(test), f"(not {text})", f"`{text}` negated")

    # expressions

    def visit_BinOp(self, node: ast.BinOp) -> None:
        texts = any(
            isinstance(side, ast.JoinedStr | ast.List | ast.Tuple | ast.Dict | ast.Set)
            or (isinstance(side, ast.Constant) and isinstance(side.value, str))
            for side in (node.left, node.right)
        )
        if type(node.op) in ARITHMETIC and not texts:
            old, new = ARITHMETIC[type(node.op)]
            start, end = self._between(node.left, node.right, re.escape(old))
            self._add(start, end, new)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
            old, others = COMPARISON[type(operator)]
            start, end = self._between(left, right, old)
            for new in others:
                self._add(start, end, new)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            start, end = self._between(left, right, rf"\b{old}\b")
            self._add(start, end, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        word = {ast.Not: "not", ast.USub: "-", ast.Invert: "~"}.get(type(node.op))
        if word:
            start = self._start(node)
            self._add(start, start + len(word), "", f"`{word}` left out")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        for new in _wrong(node.value):
            self._add(self._start(node), self._end(node), new)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else None
        name = node.func.id if isinstance(node.func, ast.Name) else name
        if name in ("TypeVar", "ParamSpec", "cast"):
            return
        end = self._end(node.func)
        if name in TWINS:
            self._add(end - len(name), end, TWINS[name])
        if name == "abs" and isinstance(node.func, ast.Name):
            self._add(end - len(name), end, "", "`abs` left out")
        for keyword in self._told(node):
            self._add(*self._argument(keyword), "", f"`{keyword.arg}` left out")
        self.visit(node.func)
        for argument in (*node.args, *(k.value for k in node.keywords)):
            self.visit(argument)

    def _told(self, node: ast.Call) -> Iterator[ast.keyword]:
        for keyword in node.keywords:
            text = isinstance(keyword.value, ast.Constant) and isinstance(keyword.value.value, str)
            if keyword.arg and keyword.arg not in TEXT_KEYWORDS and not text:
                yield keyword

    def _argument(self, keyword: ast.keyword) -> tuple[int, int]:
        """A named argument and the comma behind it."""
        end = self._end(keyword)
        comma = re.match(rb"\s*,", self.data[end:])
        return self._start(keyword), end + (comma.end() if comma else 0)
