"""The same of what is called from Python, and of processes that end before their time."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.core.compiled import kernel_folder
from shaftline.core.files import FileError, SizeError, check_size, check_writable, write_text
from shaftline.envs import FrigateEnv, FrigateVectorEnv
from shaftline.observers import follow, get_observer, variance_accounted_for
from shaftline.plant import (
    Schedule,
    State,
    get_sea,
    load_ship,
    realise,
    simulate,
    simulate_recording,
)


def test_more_environments_than_memory_are_refused_at_once() -> None:
    with pytest.raises(SizeError, match="1e\\+09 environments at once: at most 1e\\+05"):
        FrigateVectorEnv(10**9)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"max_episode_steps": float("inf")}, "max_episode_steps = inf: must be a whole number"),
        ({"max_episode_steps": float("nan")}, "max_episode_steps = nan: must be a whole number"),
        ({"max_episode_steps": 10**12}, "from 1 to 10 000 000, or None"),
        ({"max_episode_steps": "long"}, "max_episode_steps = 'long': must be a whole number"),
        ({"max_episode_steps": -1}, "max_episode_steps = -1: must be a whole number"),
        ({"episode_s": 300.0}, "unexpected keyword argument 'episode_s'"),
        ({"command": "nobody"}, "unknown command 'nobody'; known: shaft-speed"),
        ({"action_mode": "residual:nobody"}, "unknown controller 'nobody'"),
        ({"control_interval_s": 0.0}, "control_interval_s = 0.0"),
        ({"control_interval_s": 0.333}, "multiple of the time step"),
        ({"control_interval_s": None}, "must be a number"),
        ({"sensor_noise": float("nan")}, "sensor_noise = nan"),
        ({"sensor_noise": {"nobody": 1.0}}, "known instruments"),
        ({"sensor_noise": {"shaft_torque": -1.0}}, "each with an rms of at least 0"),
        ({"randomise": {"hull.nobody": 0.1}}, "hull.nobody"),
        ({"randomise": {"hull.mass_kg": float("nan")}}, "hull.mass_kg"),
        ({"observer": "nobody"}, "unknown observer"),
        ({"task": "nobody"}, "nobody"),
        ({"ship": "kvlcc2"}, "kvlcc2"),
        ({"sea": "state-99"}, "state-99"),
        ({"sea": {"hs_m": (5.0, 1.0), "tp_s": 9.0}}, "a pair \\(lowest, highest\\)"),
        ({"sea": []}, "must be a preset"),
        ({"action_mode": "nobody"}, "unknown action_mode"),
        ({"nobody": 1}, "unexpected keyword argument"),
    ],
)
def test_environments_say_what_they_cannot_be(settings: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        FrigateEnv(**settings)


@pytest.mark.parametrize("count", [0, -1, 2.5, True, None, "4"])
def test_a_number_of_environments_that_is_none_is_refused(count: Any) -> None:
    with pytest.raises(ValueError, match="must be a whole number of at least 1"):
        FrigateVectorEnv(count)


STATE = State(1.2, 10.0, 8.0)


@pytest.mark.parametrize(
    ("duration", "state", "words"),
    [
        (0.0, STATE, "duration_s = 0.0 must be above 0 s"),
        (-1.0, STATE, "duration_s = -1.0 must be above 0 s"),
        (float("nan"), STATE, "duration_s = nan must be above 0 s"),
        (
            10.0,
            STATE._replace(shaft_speed=float("nan")),
            "initial state contains a value that is not finite",
        ),
        (
            10.0,
            STATE._replace(ship_speed=1e200),
            r"the simulation diverges: true_ship_speed_m_s = 1e\+200 m/s at 0 s",
        ),
    ],
)
def test_a_simulation_that_would_give_no_numbers_is_refused(
    duration: float, state: State, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        simulate(load_ship("frigate"), Schedule(20.0, 1.2), duration, initial=state)


def test_columns_that_are_missing_or_no_numbers_are_named() -> None:
    rows = 20
    table = pd.DataFrame(
        {"time_s": 0.1 * np.arange(rows), "fuel_rack_mm": 20.0, "pitch_ratio_command": 1.2}
    )
    ship, gap = load_ship("frigate"), table.copy()
    gap.loc[7, "fuel_rack_mm"] = np.nan
    for bad, words in (
        (table.drop(columns="fuel_rack_mm"), "column 'fuel_rack_mm' is missing"),
        (gap, "fuel_rack_mm, row 8: nan is not a finite number"),
        (table[:0], "at least two rows"),
        (table[:1], "at least two rows"),
        (table[::-1], "rising time"),
    ):
        with pytest.raises(ValueError, match=words):
            simulate_recording(ship, bad)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_depths_and_sample_times_that_are_none_are_refused(value: float) -> None:
    sea = get_sea("state-5")
    assert sea is not None
    with pytest.raises(ValueError, match=f"depth_m = {value}"):
        realise(sea, value, 1)
    with pytest.raises(ValueError, match=f"dt = {value}"):
        follow(get_observer("random-walk-kalman"), load_ship("frigate"), np.zeros((9, 5)), value)


def test_an_estimate_that_is_lost_accounts_for_no_share() -> None:
    assert math.isnan(variance_accounted_for(np.array([1.0, np.nan, 3.0]), np.arange(3.0)))


def _alone(code: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_a_switch_of_the_compiler_that_would_stop_all_is_not_heeded(tmp_path: Path) -> None:
    code = (
        "from shaftline.plant import equilibrium, load_ship\n"
        "print(equilibrium(load_ship('frigate'), 22.0, 1.4).state.shaft_speed)"
    )
    done = _alone(code, tmp_path, NUMBA_DISABLE_JIT="1")
    assert float(done.stdout) == pytest.approx(10.514, abs=1e-3)
    assert "NUMBA_DISABLE_JIT is set" in done.stderr


def test_a_folder_that_is_gone_is_said(tmp_path: Path) -> None:
    code = (
        f"import os\nfrom shaftline.cli.main import main\nos.rmdir({str(tmp_path / 'a')!r})\nmain()"
    )
    (tmp_path / "a").mkdir()
    done = _alone(code, tmp_path / "a")
    assert done.returncode == 1
    assert done.stderr == (
        "error: the working folder does not exist any more; change to another one\n"
    )


@pytest.mark.parametrize("duration", [1e12, float("inf"), 1e300])
def test_a_span_that_no_memory_holds_is_refused_at_once(duration: float) -> None:
    ship = load_ship("frigate")
    with pytest.raises((ValueError, OverflowError)):
        simulate(ship, Schedule(20.0, 1.2), duration, initial=State(1.2, 5.0, 3.0))


def test_sizes_say_how_many_there_may_be() -> None:
    check_size(1e6, 1000.0, "samples")
    for count in (1e9, float("inf"), float("nan")):
        with pytest.raises(SizeError, match=r"samples: at most 8e\+06"):
            check_size(count, 1000.0, "samples")


def test_a_device_is_neither_replaced_nor_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    link = tmp_path / "link.csv"
    link.symlink_to("/dev/null")
    for path in (pipe, link, Path("/dev/null"), tmp_path):
        with pytest.raises(FileError, match=r"no ordinary file|is a folder"):
            write_text(path, "text")
        with pytest.raises(FileError, match=r"no ordinary file|is a folder"):
            check_writable(path)
    assert pipe.is_fifo()
    assert link.is_symlink()


def test_a_link_stays_one_and_its_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target = tmp_path / "there" / "file.txt"
    target.write_text("old")
    link = tmp_path / "link.txt"
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_nothing_is_left_by_trying_a_place(tmp_path: Path) -> None:
    check_writable(tmp_path / "new" / "folder" / "file.csv")
    check_writable(tmp_path / "new" / "folder", folder=True)
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match="is a file"):
        check_writable(tmp_path / "file" / "below" / "a.csv")


def test_kernels_find_a_private_place_where_the_usual_ones_cannot_be_written_to(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("x")
    none = tmp_path / "file" / "below"
    assert kernel_folder(tmp_path / "a", none, tmp_path) is None
    assert kernel_folder(none, tmp_path / "b", tmp_path) is None
    found = kernel_folder(none, none, tmp_path)
    assert found is not None
    assert found.stat().st_mode & 0o077 == 0
    assert kernel_folder(none, none, tmp_path) == found  # again the same
    found.chmod(0o777)  # as if somebody else had made it
    other = kernel_folder(none, none, tmp_path)
    assert other not in (None, found)


WORK = """
import faulthandler, signal, sys, time
from pathlib import Path
faulthandler.dump_traceback_later(25)  # where it hangs, if it does
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it
from shaftline.core.sweep import sweep
def work(cell):
    import os, time
    Path(sys.argv[1], f"pid-{os.getpid()}").touch()
    time.sleep(60)
sweep(work, {str(k): k for k in range(4)}, Path(sys.argv[1]) / "cells", jobs=2)
"""


def _workers(folder: Path, count: int) -> list[int]:
    for _ in range(300):
        found = [int(file.name[4:]) for file in folder.glob("pid-*")]
        if len(found) >= count:
            return found
        time.sleep(0.1)
    raise AssertionError("no workers began")


def _gone(pids: list[int]) -> bool:
    for _ in range(100):
        alive = [
            p
            for p in pids
            if Path(f"/proc/{p}/stat").exists() and " Z " not in Path(f"/proc/{p}/stat").read_text()
        ]
        if not alive:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc to see processes")
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGINT])
def test_no_worker_outlives_its_parent(tmp_path: Path, blow: signal.Signals) -> None:
    (tmp_path / "work.py").write_text(WORK)
    parent = subprocess.Popen(
        [sys.executable, str(tmp_path / "work.py"), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    workers = _workers(tmp_path, 2)
    if blow is signal.SIGINT:  # as a terminal does: to all of them
        os.killpg(parent.pid, signal.SIGINT)
    else:
        parent.kill()
    try:
        _, said = parent.communicate(timeout=30)
    except subprocess.TimeoutExpired:
        os.killpg(parent.pid, signal.SIGKILL)
        raise AssertionError(f"it goes on: {parent.communicate()[1]}") from None
    assert _gone(workers)
    if blow is signal.SIGINT:
        assert said.count("Traceback") <= 1, said  # the parent's own
