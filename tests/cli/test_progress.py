"""Progress in a log: a line at the start, at every stage, every ten seconds and at the end."""

from __future__ import annotations

import io
import time

import numba
import pandas as pd
import pytest
from rich.console import Console

from shaftline.cli import console
from shaftline.cli.console import (
    EVERY_S,
    Log,
    TimeLeft,
    announce_compilation,
    announce_loading,
    progress,
    stages,
)


def log_lines(steps: list[tuple[float, int, str]], total: int) -> list[str]:
    lines: list[str] = []
    times = iter([0.0, *(when for when, _, _ in steps)])
    log = Log("simulating", lines.append, lambda: next(times))
    for _, done, stage in steps:
        log.at(done, total, stage)
    return lines


def test_a_line_every_ten_seconds_and_at_the_end() -> None:
    steps = [
        (1.0, 1, ""),
        (9.9, 2, ""),
        (EVERY_S, 3, ""),
        (12.0, 4, ""),
        (21.0, 5, ""),
        (22.0, 6, ""),
    ]
    assert log_lines(steps, 6) == [
        "simulating, 3 of 6, 10 s, about 10 s left",
        "simulating, 5 of 6, 21 s, about 4 s left",
        "simulating, 6 of 6, 22 s",
    ]


def test_a_line_at_every_new_stage() -> None:
    steps = [(1.0, 0, "loading"), (2.0, 1, "loading"), (3.0, 0, "trying"), (4.0, 1, "trying")]
    assert log_lines(steps, 9) == [
        "simulating: loading, 0 of 9, 1 s",
        "simulating: trying, 0 of 9, 3 s",
    ]


def test_the_time_left_is_that_of_the_stage() -> None:
    """The first stage takes 2 s a part, the second 20 s; a text that changes does not begin a stage."""
    steps = [(2.0 * k, k, "loading") for k in range(6)]
    steps += [(10.0, 0, "trying"), (30.0, 1, "trying"), (50.0, 2, "best 7"), (51.0, 0, "trying")]
    lines = log_lines([(0.0, 0, "loading"), *steps], 5)
    assert lines == [
        "simulating: loading, 0 of 5, 0 s",
        "simulating: loading, 5 of 5, 10 s",
        "simulating: trying, 0 of 5, 10 s",
        "simulating: trying, 1 of 5, 30 s, about 80 s left in this stage",
        "simulating: best 7, 2 of 5, 50 s, about 60 s left in this stage",
        "simulating: trying, 0 of 5, 51 s",
    ]


def test_a_resumed_count_is_timed_from_where_it_resumes() -> None:
    left = TimeLeft(0.0)
    assert left.text(60.0, 5000, 10000) == ""
    assert left.text(64.0, 5100, 10000) == ""  # too early
    assert left.text(80.0, 5100, 10000) == "about 16 min left"
    assert left.text(260.0, 5100, 10000) == "about 2.7 h left"
    assert left.text(270.0, 10000, 10000) == ""


def test_on_a_terminal_the_bar_has_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(console, "errors", Console(force_terminal=True, width=100, file=screen))
    monkeypatch.setattr(console, "LEAST_TIMED_S", 0.0)
    with progress("simulating", 4) as tick:
        tick()
        time.sleep(0.3)  # The bar is drawn ten times a second.
    with stages("diagnosing") as say:
        say("loading", 0, 3)
        say("loading", 1, 3)
        time.sleep(0.3)
    assert screen.getvalue().count("about 1 s left") >= 2


def test_in_a_pipe_it_begins_at_once(capfd: pytest.CaptureFixture[str]) -> None:
    with progress("simulating", 2) as tick:
        tick()
        tick()
    with stages("diagnosing") as say:
        say("loading", 0, 3)
    assert capfd.readouterr().err.splitlines() == [
        "simulating, 2 in total",
        "simulating, 2 of 2, 0 s",
        "diagnosing",
        "diagnosing: loading, 0 of 3, 0 s",
    ]


def test_compiling_is_announced_once_and_not_where_it_is_short() -> None:
    long: list[str] = []
    short: list[str] = []
    announce_compilation(long.append, patience_s=-1.0)
    announce_compilation(short.append, patience_s=1e6)
    for shift in (1.0, 2.0):
        numba.njit(lambda x, shift=shift: x + shift)(1.0)
    assert len(long) == 1
    assert "each command does so at its first use" in long[0]
    assert "half a minute to a few minutes" in long[0]
    assert short == []


def test_loading_is_announced_where_it_lasts(capfd: pytest.CaptureFixture[str]) -> None:
    with announce_loading(patience_s=60.0):
        pass
    assert capfd.readouterr().err == ""
    with announce_loading(patience_s=0.0):
        time.sleep(0.2)
    assert capfd.readouterr().err == "loading\n"
    with announce_loading("torch", patience_s=0.0):
        time.sleep(0.2)
    assert capfd.readouterr().err == "loading torch\n"


@pytest.mark.parametrize("width", [48, 60, 200])
def test_words_of_a_table_stay_whole_where_there_is_room(
    width: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(console.console, "width", width)
    cells = {"from": ["resistance_factor [-]"], "to": ["shaft_speed [rad/s]"], "gain [-]": [1.5]}
    console.print_table(pd.DataFrame(cells), "channels")
    output = capfd.readouterr().out
    assert {"resistance_factor", "shaft_speed", "[rad/s]", "1.50"} <= set(output.split())
    assert max(map(len, output.splitlines())) <= width
