"""Options that the commands for the identification of parameters share."""

from __future__ import annotations

from typing import Annotated

import typer

from .source import constant, dictionary_keys

_IDENTIFY = "mismatch/identify.py"
DEFAULT: str = constant(_IDENTIFY, "DEFAULT")
"""Method by default."""

AUTO: str = constant("mismatch/identification/free_parameters.py", "AUTO")
"""Value of ``--free`` in place of keys."""

Method = Annotated[
    str,
    typer.Option(
        help=f"Method of estimation: {', '.join(dictionary_keys(_IDENTIFY, 'METHODS'))}.",
        metavar="METHOD",
    ),
]
