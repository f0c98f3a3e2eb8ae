"""Progress in a log: a line at the start, at every stage, every ten seconds and at the end."""

from __future__ import annotations

import time

import numba
import pandas as pd
import pytest

from shaftline.cli import console
from shaftline.cli.console import (
    EVERY_S,
    Log,
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
        "simulating, 3 of 6, 10 s",
        "simulating, 5 of 6, 21 s",
        "simulating, 6 of 6, 22 s",
    ]


def test_a_line_at_every_new_stage() -> None:
    steps = [(1.0, 0, "loading"), (2.0, 1, "loading"), (3.0, 0, "trying"), (4.0, 1, "trying")]
    assert log_lines(steps, 9) == [
        "simulating: loading, 0 of 9, 1 s",
        "simulating: trying, 0 of 9, 3 s",
    ]


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
    assert "compiling the equations" in long[0]
    assert short == []


def test_loading_is_announced_where_it_lasts(capfd: pytest.CaptureFixture[str]) -> None:
    with announce_loading(patience_s=60.0):
        pass
    assert capfd.readouterr().err == ""
    with announce_loading(patience_s=0.0):
        time.sleep(0.2)
    assert capfd.readouterr().err == "loading\n"


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
