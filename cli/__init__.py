"""The ``shaftline`` command."""

from __future__ import annotations

import os
import sys
from types import TracebackType

STOPPED = 130
"""Exit code after Ctrl-C: 128 and the number of SIGINT, as shells count."""

_before = sys.excepthook


def _one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Answer Ctrl-C while modules are imported, when no command is there yet to catch it."""
    if not issubclass(kind, KeyboardInterrupt):
        _before(kind, error, trace)
        return
    sys.stderr.write("stopped\n")
    sys.stderr.flush()
    os._exit(STOPPED)


sys.excepthook = _one_line
