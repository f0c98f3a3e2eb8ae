"""``shaftline export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..agents.policy.c_source import c_source
from ..agents.policy.policy import load_policy
from ..core.files import check_writable, write_text
from .console import report_errors, say


def export(
    policy: Annotated[
        str, typer.Argument(help="Policy: a name of the package or a file.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="File to write, ending in .c.", show_default=False)],
) -> None:
    """Write a learned policy as one C99 file, for a controller on board.

    The file needs no library but `math.h` and computes in double precision. It contains the scaling of
    the measurements, the memory of stacked observations and the network. The comment at its top names
    the measurements in their order and units, and what the actions mean. The functions are
    `NAME_reset` and `NAME_step`; NAME is the name of the file.

    Written: the file.

    Examples:
        shaftline export storm --out storm.c
    """
    with report_errors():
        check_writable(out)
        if out.suffix != ".c":
            raise ValueError(f"--out {out}: the name of a C file must end in .c")
        write_text(out, c_source(load_policy(policy), out.stem.replace("-", "_")))
        say(f"C source: {out}")
