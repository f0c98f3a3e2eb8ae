from __future__ import annotations

from collections.abc import Callable

import pytest
from typer.testing import CliRunner, Result

from shaftline.cli.main import app

Command = Callable[..., Result]


@pytest.fixture
def shaftline() -> Command:
    """Run the command in this process."""

    def run(*arguments: object) -> Result:
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return run
