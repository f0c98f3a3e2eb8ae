"""Sweeps: resumed, in processes, on a cluster; cells that fail and sweeps that are stopped."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.agents.evaluation.episodes import Setting
from shaftline.agents.evaluation.sweeps import evaluate
from shaftline.baselines.combinator import Combinator
from shaftline.core.sweep import SweepError, source_digest, sweep

CELLS = [
    Setting("combinator", "transit", sea, "random-walk-kalman", seeds=3, episode_s=20.0)
    for sea in ("calm", "state-3", "state-5")
]


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a scheduler with two workers, processes of their own."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=False
    ) as local:
        yield local.scheduler_address


# What travels to other processes is local, so that it goes by value: they cannot import the tests.


@pytest.fixture(scope="module")
def make() -> Any:
    made = Combinator("frigate", 0.5)
    return lambda _: made


@pytest.fixture(scope="module")
def not_three() -> Any:
    def not_three(number: int) -> int:
        if number == 3:
            raise ValueError("three is refused")
        return number**2

    return not_three


@pytest.fixture(scope="module")
def one_by_one(make: Any, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return evaluate(CELLS, make, tmp_path_factory.mktemp("one"), jobs=1).table


def test_processes_change_no_figure(make: Any, one_by_one: pd.DataFrame, tmp_path: Path) -> None:
    ticks: list[int] = []
    found = evaluate(CELLS, make, tmp_path, jobs=2, tick=lambda: ticks.append(1))
    pd.testing.assert_frame_equal(found.table, one_by_one, check_exact=True)
    assert len(ticks) == len(found.traces) == len(CELLS)


def test_a_cluster_changes_no_figure(
    make: Any, one_by_one: pd.DataFrame, cluster: str, tmp_path: Path
) -> None:
    found = evaluate(CELLS, make, tmp_path, backend="dask", scheduler=cluster)
    pd.testing.assert_frame_equal(found.table, one_by_one, check_exact=True)


def test_only_a_deleted_cell_is_sailed_again(
    make: Any, one_by_one: pd.DataFrame, tmp_path: Path
) -> None:
    evaluate(CELLS, make, tmp_path, jobs=1)
    (deleted,) = (tmp_path / "cells").glob("*state-3*")
    deleted.unlink()
    sailed: list[Setting] = []

    def counting(setting: Setting) -> Combinator:
        sailed.append(setting)
        return make(setting)  # type: ignore[no-any-return]

    again = evaluate(CELLS, counting, tmp_path, jobs=1)
    assert sailed == [CELLS[1]]
    pd.testing.assert_frame_equal(again.table, one_by_one, check_exact=True)


def test_a_changed_ship_is_sailed_anew(make: Any, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    text = (Path(__file__).parents[2] / "plant/ships/frigate.toml").read_text(encoding="utf-8")
    mine.write_text(text, encoding="utf-8")
    cells = [replace(CELLS[0], ship=str(mine))]
    evaluate(cells, make, tmp_path, jobs=1)
    evaluate(cells, make, tmp_path, jobs=1)
    assert len(list((tmp_path / "cells").iterdir())) == 1
    mine.write_text(text.replace("diameter_m = 4.2", "diameter_m = 4.1"), encoding="utf-8")
    evaluate(cells, make, tmp_path, jobs=1)
    assert len(list((tmp_path / "cells").iterdir())) == 2


def test_the_source_digest_tells_folders_apart() -> None:
    assert source_digest("plant") == source_digest("plant") != source_digest("plant", "envs")


NUMBERS = {f"n{i}": i for i in range(6)}


@pytest.mark.parametrize("spread", ["one", "processes", "dask"])
def test_a_cell_that_raises_is_named_and_the_others_are_kept(
    spread: str, not_three: Any, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    options: dict[str, Any] = {"jobs": 1 if spread == "one" else 2}
    if spread == "dask":
        options = {"backend": "dask", "scheduler": request.getfixturevalue("cluster")}
    with pytest.raises(SweepError, match=r"1 of 6 cells failed.*n3: ValueError: three is refused"):
        sweep(not_three, NUMBERS, tmp_path, **options)
    assert "in not_three" in (tmp_path / "n3.error.txt").read_text()
    assert sorted(file.stem for file in tmp_path.glob("*.json")) == ["n0", "n1", "n2", "n4", "n5"]
    assert sweep(abs, NUMBERS, tmp_path, **options)["n3"] == 3
    assert not (tmp_path / "n3.error.txt").exists()


def test_a_killed_process_is_reported(tmp_path: Path) -> None:
    def dies_at_two(number: int) -> int:
        if number == 2:
            os._exit(1)
        return number

    with pytest.raises(SweepError, match=r"processes broke down.*--jobs 1"):
        sweep(dies_at_two, NUMBERS, tmp_path, jobs=2)


def test_what_json_cannot_hold_is_a_failed_cell(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="n0: ValueError: Out of range float"):
        sweep(lambda _: float("nan"), {"n0": 0}, tmp_path, jobs=1)


STOPPED = """
import os, signal, sys, threading, time
from pathlib import Path
from shaftline.core.sweep import sweep

# a shell that starts the tests in the background has SIGINT ignored, and children inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)
left = [0, 1]

def slow(number):
    time.sleep(0.1 if number < 2 else 60.0)
    return number

def stop_after_two():
    left.pop()
    if not left:  # to the whole group, as a terminal does, while the sweep waits for the next cell
        threading.Timer(0.5, os.killpg, (0, signal.SIGINT)).start()

sweep(slow, {f"n{i}": i for i in range(6)}, Path(sys.argv[1]), jobs=2, tick=stop_after_two)
"""


def test_ctrl_c_leaves_finished_cells(tmp_path: Path) -> None:
    stopped = subprocess.run(
        [sys.executable, "-c", STOPPED, str(tmp_path)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        timeout=300.0,  # only so that a sweep that hangs fails
    )
    assert stopped.returncode != 0
    assert "KeyboardInterrupt" in stopped.stderr
    kept = {file.stem: json.loads(file.read_text()) for file in tmp_path.iterdir()}
    assert kept == {"n0": 0, "n1": 1}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"backend": "threads"}, "--backend threads.*processes, dask"),
        ({"jobs": 0}, "--jobs 0"),
        ({"backend": "dask"}, "--backend dask.*--scheduler"),
        ({"scheduler": "tcp://127.0.0.1:1"}, "--scheduler tcp://127.0.0.1:1.*--backend dask"),
        ({"backend": "dask", "scheduler": "tcp://127.0.0.1:1", "jobs": 2}, "--jobs 2"),
    ],
)
def test_options_that_contradict(options: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(SweepError, match=words):
        sweep(abs, NUMBERS, tmp_path, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere at all"])
def test_no_scheduler_answers(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("shaftline.core.sweep._PATIENCE_S", 0.5)
    with pytest.raises(SweepError, match=f"--scheduler {address}: no dask scheduler answers"):
        sweep(abs, NUMBERS, tmp_path, backend="dask", scheduler=address)
