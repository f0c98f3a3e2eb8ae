"""Sweeps: resumed, in processes, on a cluster; cells that fail and sweeps that are stopped."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import shaftline.core.sweep as module
from shaftline.core.sweep import SweepError, check_backend, refuse_other_plan, source_digest, sweep


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a scheduler with two workers, processes of their own."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=False
    ) as local:
        yield local.scheduler_address


# What travels to other processes is local, so that it goes by value: they cannot import the tests.


@pytest.fixture(scope="module")
def not_three() -> Any:
    def not_three(number: int) -> int:
        if number == 3:
            raise ValueError("three is refused")
        return number**2

    return not_three


NUMBERS = {f"n{i}": i for i in range(6)}
SQUARES = {f"n{i}": i**2 for i in range(6)}


@pytest.fixture(scope="module")
def square() -> Any:
    return lambda number: number**2


@pytest.mark.parametrize("jobs", [None, 1, 2])
def test_results_come_in_the_order_of_the_cells(
    jobs: int | None, square: Any, tmp_path: Path
) -> None:
    ticks: list[int] = []
    found = sweep(square, NUMBERS, tmp_path, jobs=jobs, tick=lambda: ticks.append(1))
    assert list(found.items()) == list(SQUARES.items())
    assert len(ticks) == len(NUMBERS)
    assert {file.name: json.loads(file.read_text()) for file in tmp_path.iterdir()} == {
        f"{name}.json": square for name, square in SQUARES.items()
    }


def test_only_what_is_missing_is_worked_on(square: Any, tmp_path: Path) -> None:
    sweep(square, NUMBERS, tmp_path, jobs=1)
    (tmp_path / "n2.json").unlink()
    worked: list[int] = []
    ticks: list[int] = []

    def counting(number: int) -> int:
        worked.append(number)
        return number**2

    again = sweep(counting, NUMBERS, tmp_path, jobs=1, tick=lambda: ticks.append(1))
    assert (worked, again) == ([2], SQUARES)
    assert len(ticks) == len(NUMBERS)
    assert sweep(counting, NUMBERS, tmp_path, jobs=1) == SQUARES
    assert worked == [2]


def test_no_more_processes_than_asked(tmp_path: Path) -> None:
    def who(_: int) -> int:
        time.sleep(0.05)
        return os.getpid()

    assert set(sweep(who, NUMBERS, tmp_path / "one", jobs=1).values()) == {os.getpid()}
    two = set(sweep(who, NUMBERS, tmp_path / "two", jobs=2).values())
    assert len(two) <= 2
    assert os.getpid() not in two


def test_a_cluster_gives_what_one_process_does(square: Any, cluster: str, tmp_path: Path) -> None:
    assert sweep(square, NUMBERS, tmp_path, backend="dask", scheduler=cluster) == SQUARES


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

    with pytest.raises(SweepError, match=r"worker processes stopped.*--jobs 1"):
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
    with pytest.raises(SweepError, match=f"--scheduler {address}: no dask scheduler responds"):
        sweep(abs, NUMBERS, tmp_path, backend="dask", scheduler=address)


def test_options_that_go_together() -> None:
    check_backend(None, "processes", None)
    check_backend(1, "processes", None)
    check_backend(None, "dask", "tcp://127.0.0.1:1")


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A small house of which the digest is taken."""
    monkeypatch.setattr(module, "__file__", str(tmp_path / "core" / "sweep.py"))
    for name in ("plant/a.py", "plant/deep/b.toml", "plant/c.csv", "plant/notes.md", "envs/d.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    source_digest.cache_clear()
    yield tmp_path
    source_digest.cache_clear()


def digest(*places: str) -> str:
    source_digest.cache_clear()
    return source_digest(*places)


def test_the_digest_does_not_hang_on_the_order_of_a_folders_files(
    house: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual, listed = digest("plant"), Path.rglob
    monkeypatch.setattr(Path, "rglob", lambda *of: reversed(list(listed(*of))))
    assert digest("plant") == usual


def test_the_digest_tells_folders_and_files_apart(house: Path) -> None:
    found = {digest(*p) for p in (("plant",), ("envs",), ("plant", "envs"), ("plant/a.py",))}
    assert len(found) == 4
    assert all(len(one) == 8 for one in found)
    assert digest("plant") in found


@pytest.mark.parametrize("name", ["a.py", "deep/b.toml", "c.csv"])
def test_the_digest_changes_with_source_and_data(house: Path, name: str) -> None:
    before = digest("plant")
    (house / "plant" / name).write_text("other")
    assert digest("plant") != before


def test_the_digest_changes_with_a_files_name_and_not_with_notes(house: Path) -> None:
    before = digest("plant")
    (house / "plant/notes.md").write_text("other")
    assert digest("plant") == before
    (house / "plant/a.py").rename(house / "plant/z.py")
    assert digest("plant") != before


def test_a_folder_holds_one_plan(tmp_path: Path) -> None:
    note = tmp_path / "plan.json"
    plan = {"seeds": 3, "ship": {"name": "frigate"}, "steps": (1, 2)}
    refuse_other_plan(tmp_path, note, plan, "validation")  # nothing is there yet
    note.write_text(json.dumps(plan | {"more": 1}))
    refuse_other_plan(tmp_path, note, plan, "validation")
    with pytest.raises(
        ValueError, match=r"holds a validation of another seeds \(3, now 4\); remove it"
    ):
        refuse_other_plan(tmp_path, note, plan | {"seeds": 4}, "validation")
    with pytest.raises(ValueError, match=r"another ship \(name: frigate, now ferry\); remove it"):
        refuse_other_plan(tmp_path, note, plan | {"ship": {"name": "ferry"}}, "validation")
    with pytest.raises(ValueError, match=r"another new \(None, now 1\)"):
        refuse_other_plan(tmp_path, note, plan | {"new": 1}, "validation")
