from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from shaftline.agents.evaluation.scores import Bound

from .conftest import Command
from .test_bad_input import nothing_written, refused

QUICK = ("--seeds", 4, "--episode-s", 20, "--jobs", 1)


def test_controllers_are_compared(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "evaluate", "--controller", "combinator", "--controller", "combinator:response_s=6",
        "--task", "transit", "--sea", "state-5", "--out", tmp_path, "--render", *QUICK,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    table = pd.read_csv(tmp_path / "table.csv")
    assert list(table["controller"]) == ["combinator", "combinator:response_s=6"]
    assert (table["fuel_kg_nmi_low"] <= table["fuel_kg_nmi"]).all()
    # a slower governor works the rack less
    assert table["rack_travel_mm_min"][1] < table["rack_travel_mm_min"][0]
    assert json.loads((tmp_path / "table.json").read_text())[0]["seeds"] == 4
    assert "combinator:response_s=6" in (tmp_path / "table.md").read_text()
    assert (tmp_path / "comparison.png").stat().st_size > 20_000
    assert (tmp_path / "dashboard-combinator.png").stat().st_size > 5_000


def test_the_score_is_shown_where_the_task_has_a_bound(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bound = Bound(combinator=0.5, tuned=0.6, best=0.9, spread=0.05)
    monkeypatch.setattr("shaftline.cli.evaluate_command.bounds", lambda: {"transit": bound})
    command = ("evaluate", "--controller", "va-pitch", "--task", "transit", *QUICK)
    result = shaftline(*command, "--out", tmp_path / "own")
    assert "score: 0 is the combinator, 1 the clairvoyant bound" in result.output
    table = pd.read_csv(tmp_path / "own" / "table.csv")
    assert table["score"][0] == pytest.approx((table["reward"][0] / 40.0 - 0.5) / 0.4)
    other = shaftline(*command, "--sea", "calm", "--out", tmp_path / "calm")
    assert "score: 0" not in other.output  # the bound is that of the seas of the task


def test_an_evaluation_goes_on_where_it_stopped(shaftline: Command, tmp_path: Path) -> None:
    arguments = ("evaluate", "--controller", "combinator", "--out", tmp_path, *QUICK)
    shaftline(*arguments)
    (cell,) = (tmp_path / "cells").glob("*.json")
    before = cell.stat().st_mtime_ns
    shaftline(*arguments, "--observer", "oracle", "--observer", "random-walk-kalman")
    assert cell.stat().st_mtime_ns == before
    assert len(list((tmp_path / "cells").glob("*.json"))) == 2


def test_an_evaluation_is_made_again_where_an_imported_module_has_changed(tmp_path: Path) -> None:
    (tmp_path / "gains.py").write_text("RACK = -1.0\n")
    (tmp_path / "mine.py").write_text(
        "import numpy as np\nfrom gains import RACK\n"
        "class Law:\n"
        "    def __init__(self, ship, interval_s): ...\n"
        "    def predict(self, observation, state=None, episode_start=None, deterministic=True):\n"
        "        return np.tile(np.float32([0.0, RACK]), (len(observation), 1)), state\n"
    )
    burnt = []
    for rack in ("-1.0", "-1.0", "0.5"):
        (tmp_path / "gains.py").write_text(f"RACK = {rack}\n")
        command = [sys.executable, "-c", "from shaftline.cli.main import main; main()"]
        done = subprocess.run(
            [*command, "evaluate", "--controller", "mine:Law", *map(str, QUICK), "--out", "found"],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        burnt.append(float(pd.read_csv(tmp_path / "found/table.csv")["fuel_kg_nmi"][0]))
    assert burnt[0] == burnt[1] != burnt[2]
    assert len(list((tmp_path / "found/cells").glob("*.json"))) == 2


def test_controllers_that_use_no_estimate_take_one_row(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "evaluate", "--controller", "combinator", "--controller", "cpp-optimiser",
        "--sea", "calm", "--sea", "state-5", "--observer", "oracle", "--observer", "power-balance",
        "--out", tmp_path, *QUICK,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert len(pd.read_csv(tmp_path / "table.csv")) == 8
    page = (tmp_path / "table.md").read_text()
    assert page.count("| combinator | any |") == page.count("## Sea:") == 2
    assert page.count("| cpp-optimiser | oracle |") == 2
    assert "Zero everywhere: `overload_s`" in page


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--controller", "autopilot"), ("unknown controller 'autopilot'", "combinator")),
        (("--controller", "combinator:speed=1"), ("combinator:speed=1", "speed")),
        (("--controller", "combinator:response_s=fast"), ("response_s=fast", "number")),
        (("--controller", "combinator", "--task", "race"), ("unknown task 'race'", "transit")),
        (("--controller", "combinator", "--sea", "state-9"), ("unknown sea 'state-9'",)),
        (("--controller", "combinator", "--observer", "eye"), ("unknown observer 'eye'",)),
        (("--controller", "combinator", "--ship", "tito-neri-sine"), ("tito-neri-sine",)),
        (("--controller", "combinator", "--jobs", "0"), ("--jobs",)),
        (("--controller", "combinator", "--backend", "threads"), ("--backend", "dask")),
        (("--controller", "combinator", "--backend", "dask"), ("--scheduler", "tcp://")),
        (("--controller", "combinator", "--scheduler", "tcp://x:1"), ("--backend dask",)),
    ],
)
def test_bad_input(
    shaftline: Command, tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    refused(shaftline("evaluate", *arguments, "--out", tmp_path, *QUICK[:4]), *words)
    nothing_written(tmp_path)
