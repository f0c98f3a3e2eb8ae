"""The ``shaftline`` command."""

from __future__ import annotations

import os
import sys
from types import TracebackType

STOPPED = 130
"""Exit code after Ctrl-C: 128 plus the number of SIGINT, as in shells."""

_before = sys.excepthook


def _one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print one line after Ctrl-C while modules are imported, before a command can catch it."""
    if not issubclass(kind, KeyboardInterrupt):
        _before(kind, error, trace)
        return
    sys.stderr.write("stopped\n")
    sys.stderr.flush()
    os._exit(STOPPED)


sys.excepthook = _one_line
