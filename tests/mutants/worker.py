"""Runs test files in processes that begin where every test begins: third-party packages imported.

Started in a scratch tree as ``python -m tests.mutants.worker``. Each line of its input is an order,
each line of its output the answer; for each order it forks, so that whatever a change does (crash,
hang, leave something behind) ends with the child.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import json
import os
import signal
import sys
import time
import traceback
from collections import defaultdict
from pathlib import Path
from typing import Any

import hypothesis
import pytest

PASSED, TIMED_OUT = 0, -1


class Watch:
    """Notes the first test that fails, and how long each file takes."""

    def __init__(self) -> None:
        self.failed = ""
        self.seconds: dict[str, float] = defaultdict(float)

    def pytest_sessionstart(self) -> None:
        """To find that a test fails is enough; the smallest example is not sought."""
        phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
        settings = hypothesis.settings
        settings.register_profile("mutants", settings(), phases=phases, database=None)
        settings.load_profile("mutants")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid.split("::")[0]] += report.duration
        self._note(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self._note(report)

    def _note(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if report.failed and not self.failed:
            self.failed = f"{report.nodeid}\n{report.longrepr}"


def preload(places: list[str]) -> None:
    """Import what the product and its tests import from elsewhere."""
    names = set()
    for file in (file for place in places for file in Path(place).rglob("*.py")):
        for node in ast.parse(file.read_bytes()).body:
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names.add(node.module)
    for name in sorted(names):
        if name.split(".")[0] != "shaftline":
            with contextlib.suppress(ImportError):
                importlib.import_module(name)


def run(order: dict[str, Any]) -> None:
    """In the child: run the tests, leave the findings in a file."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.dont_write_bytecode = order["changed"]  # what a change is compiled to is nobody else's
    watch = Watch()
    options = ["-q", "-x", "-m", "not slow", "--assert=plain", f"--basetemp={order['temporary']}"]
    code = int(pytest.main([*options, *order["tests"]], plugins=[watch]))
    Path(order["findings"]).write_text(json.dumps([code, watch.failed, watch.seconds]))


def answer(order: dict[str, Any]) -> dict[str, Any]:
    """In the parent: how the tests ended; a child that takes too long is killed with its own."""
    findings = Path(order["findings"])
    findings.unlink(missing_ok=True)
    end = time.monotonic() + order["limit_s"]
    child = os.fork()
    if child == 0:
        os.setsid()
        try:
            run(order)
        except BaseException:
            findings.write_text(json.dumps([1, traceback.format_exc(), {}]))
        os._exit(0)
    try:
        while os.waitpid(child, os.WNOHANG) == (0, 0):
            if time.monotonic() > end:
                return {"code": TIMED_OUT, "failed": "", "seconds": {}}
            time.sleep(0.02)
    finally:  # also of processes that it left behind, and where this one is told to end
        with contextlib.suppress(ProcessLookupError, ChildProcessError):
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if not findings.is_file():
        return {"code": 1, "failed": "the process broke down", "seconds": {}}
    code, failed, seconds = json.loads(findings.read_text())
    return {"code": code, "failed": failed, "seconds": seconds}


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is the one who gave the orders that ends it
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    preload(sys.argv[1:])
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)
