"""What the commands print beside their results."""

from __future__ import annotations

import warnings

import pytest
import typer

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


@pytest.mark.parametrize(("resumes", "said"), [(False, "stopped"), (True, "stopped; finished")])
def test_a_stop_promises_a_resumption_only_where_there_is_one(
    resumes: bool, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as stop, report_errors(resumes):
        raise KeyboardInterrupt
    assert stop.value.exit_code == 130
    printed = capsys.readouterr().err
    assert printed.startswith(said)
    assert ("resumes" in printed) is resumes
