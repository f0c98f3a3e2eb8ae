"""What the commands print beside their results."""

from __future__ import annotations

import warnings

import pytest

from shaftline.cli.console import report_errors


@pytest.mark.filterwarnings("default")
def test_a_warning_is_printed_once_however_often_it_comes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for _ in range(2):  # each command prints its own
        with report_errors():
            for place in range(3):
                warnings.warn_explicit("overflow in square", RuntimeWarning, "x.py", place + 1)
            warnings.warn_explicit("another", RuntimeWarning, "x.py", 9)
        said = capsys.readouterr().err.splitlines()
        assert said == ["warning: overflow in square", "warning: another"]
