from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pandas as pd
import pytest

from shaftline.agents.evaluation.scores import Bound
from shaftline.baselines import steady_point
from shaftline.cli.evaluate_command import missed_orders
from shaftline.plant import load_ship

from .conftest import Command
from .test_bad_input import nothing_written, refused

QUICK = ("--seeds", 4, "--episode-s", 20, "--jobs", 1, "--no-stability")
LEVER = "lever_percent,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n50,90,1.3\n100,130,1.35\n"
OWN_SEA = "hs=2.5,tp=8,gamma=2,heading=150"
ORDERS = "time_s;speed_order_kn\n0;10\n5;14\n20;14\n"


def test_controllers_are_compared(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "evaluate",
        "--controller",
        "combinator",
        "--controller",
        "combinator:response_s=6",
        "--task",
        "transit",
        "--sea",
        "state-5",
        "--out",
        tmp_path,
        "--render",
        *QUICK,
    )
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


def test_an_evaluation_is_made_again_where_an_imported_module_has_changed(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "law_of_a_test.py").write_text(
        "import numpy as np\nfrom gains_of_a_test import RACK\n"
        "class Law:\n"
        "    def __init__(self, ship, interval_s): ...\n"
        "    def predict(self, observation, state=None, episode_start=None, deterministic=True):\n"
        "        return np.tile(np.float32([0.0, RACK]), (len(observation), 1)), state\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    burnt = []
    for rack in ("-1.0", "0.5"):
        (tmp_path / "gains_of_a_test.py").write_text(f"RACK = {rack}\n")
        for module in ("law_of_a_test", "gains_of_a_test"):
            sys.modules.pop(module, None)  # as a new process imports them
        done = shaftline("evaluate", "--controller", "law_of_a_test:Law", *QUICK, "--out", "found")
        assert done.exit_code == 0, done.output
        burnt.append(float(pd.read_csv("found/table.csv")["fuel_kg_nmi"][0]))
    assert burnt[0] != burnt[1]
    assert len(list(Path("found/cells").glob("*.json"))) == 2


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


def test_orders_lever_interval_and_seas(shaftline: Command, tmp_path: Path) -> None:
    (tmp_path / "orders.csv").write_text(ORDERS)
    (tmp_path / "lever.csv").write_text(LEVER)
    result = shaftline(
        "evaluate", "--controller", "combinator", "--sea", "calm", "--sea", OWN_SEA,
        "--orders", tmp_path / "orders.csv", "--interval", 1, "--lever", "ship",
        "--lever", tmp_path / "lever.csv", "--seeds", 4, "--jobs", 1, "--no-stability",
        "--out", tmp_path / "ev", "--json", tmp_path / "told.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["control_interval_s"] == 1.0
    orders = [value for row in told["orders"] for value in row]
    assert orders == pytest.approx([0, 5.1444, 5, 7.2022, 20, 7.2022], rel=1e-4)
    names = [cell["controller"] for cell in told["cells"]]
    assert names[0] == names[1] == "combinator"
    assert names[2] == names[3]
    assert names[2].startswith("combinator lever:lever.csv ")
    assert {cell["episode_s"] for cell in told["cells"]} == {20.0}
    cell = json.loads(next((tmp_path / "ev/cells").glob("combinator_*calm*.json")).read_text())
    assert cell["trace"]["time"] == [float(k) for k in range(20)]
    assert cell["trace"]["speed_order"] == pytest.approx([5.1444] * 6 + [7.2022] * 14, rel=1e-4)
    lever = json.loads(next((tmp_path / "ev/cells").glob("*lever*calm*.json")).read_text())
    assert lever["trace"]["blade_pitch"][-1] < cell["trace"]["blade_pitch"][-1] - 0.02
    sea = {"hs_m": 2.5, "tp_s": 8.0, "gamma": 2.0, "heading_deg": 150.0, "wind_m_s": 0.0}
    assert told["seas"][4:] == [{"seed": k, **sea, "sea": OWN_SEA} for k in range(4)]
    assert told["seas"][0] == {
        "seed": 0,
        **dict.fromkeys(sea),
        "hs_m": 0.0,
        "wind_m_s": 0.0,
        "sea": "calm",
    }
    assert ["2.5", "8", "2", "150", "0", "0,", "1,", "2,", "3"] in [
        line.split()[1:] for line in result.output.splitlines()
    ]
    assert len(pd.read_csv(tmp_path / "ev/seas.csv")) == 8


def test_an_unstable_controller_is_reported(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "evaluate",
        "--controller",
        "combinator",
        "--controller",
        "speed-pilot:shaft_gain=7.5",
        "--sea",
        "calm",
        *QUICK[:-1],
        "--out",
        tmp_path / "ev",
        "--json",
        tmp_path / "told.json",
    )
    assert result.exit_code == 0, result.output
    lines = [line for line in result.output.splitlines() if line.startswith("UNSTABLE")]
    assert len(lines) == 1
    assert lines[0].startswith(
        "UNSTABLE: speed-pilot:shaft_gain=7.5 (observer random-walk-kalman): "
    )
    assert "gain margin -1" in lines[0]
    assert list(pd.read_csv(tmp_path / "ev/table.csv")["stability"]) == ["stable", "unstable"]
    stable, unstable = json.loads((tmp_path / "told.json").read_text())["stability"]
    assert stable["stable"] is True
    assert unstable["stable"] is False
    assert -15.0 < unstable["gain_margin_dB"] < -9.0
    assert "unstable: speed-pilot:shaft_gain=7.5" in (tmp_path / "ev/table.md").read_text()


def test_a_policy_at_another_interval_is_refused(shaftline: Command, tmp_path: Path) -> None:
    line = ("evaluate", "--controller", "policy:transit", "--interval", 1, "--out", tmp_path / "ev")
    refused(shaftline(*line, *QUICK), "control_interval_s: the policy has 0.5 s", "1 s")


def test_lever_positions_of_orders_need_one_table(shaftline: Command, tmp_path: Path) -> None:
    (tmp_path / "lever.csv").write_text(LEVER)
    (tmp_path / "orders.csv").write_text("time_s,lever\n0,0.5\n20,0.5\n")
    line = ("evaluate", "--controller", "combinator", "--orders", tmp_path / "orders.csv", "--out")
    both = ("--lever", "ship", "--lever", tmp_path / "lever.csv")
    result = shaftline(*line, tmp_path / "ev", *both, *QUICK)
    refused(result, "the lever positions have another speed on each --lever")
    alone = shaftline(*line, tmp_path / "one", *both[2:], *QUICK, "--ramp")
    assert alone.exit_code == 0, alone.output
    (cell,) = (tmp_path / "one/cells").glob("*.json")
    order = json.loads(cell.read_text())["trace"]["speed_order"][0]
    table = steady_point(load_ship("frigate"), shaft_speed=90.0 * math.pi / 30.0, pitch_ratio=1.3)
    assert order == pytest.approx(table.ship_speed, abs=1e-4)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--controller", "combinator", "--interval", "0.33"), ("--interval 0.33 s", "0.05 s")),
        (("--controller", "combinator", "--interval", "0"), ("--interval 0 s", "multiple")),
        (("--controller", "combinator", "--interval", "nan"), ("--interval nan s",)),
        (("--controller", "combinator", "--interval", "61"), ("--interval 61 s", "at most 60 s")),
        (("--controller", "combinator", "--ramp"), ("--ramp", "--orders FILE")),
        (("--controller", "combinator", "--lever", "mine"), ("--lever mine", ".toml or .csv")),
        (("--controller", "combinator", "--lever", "no.csv"), ("no.csv", "cannot be read")),
        (("--controller", "combinator", "--orders", "no.csv"), ("no.csv", "cannot be read")),
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


def test_orders_beyond_the_ship_are_scaled_and_said(shaftline: Command, tmp_path: Path) -> None:
    command = ("evaluate", "--controller", "combinator", "--task", "transit", "--sea", "calm")
    result = shaftline(*command, "--ship", "ferry", *QUICK, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert (
        "orders: 3.95 to 5.08 m/s. Those of transit, 7 to 9 m/s for frigate, are above what ferry "
        "reaches in calm water" in result.output
    )
    assert "TOO SLOW" not in result.output
    assert pd.read_csv(tmp_path / "table.csv")["speed_error_rms_m_s"][0] < 1.0
    assert "orders:" not in shaftline(*command, *QUICK, "--out", tmp_path).output


def test_orders_that_no_controller_holds_are_said() -> None:
    """The better of two controllers lacks 0.7 m/s in the sea of the task, in hs=2,tp=8 only 0.2 m/s."""
    seas = ["task", "task", "hs=2,tp=8", "hs=2,tp=8"]
    rows = pd.DataFrame({"sea": seas, "speed_short_m_s": [0.7, 1.9, 0.2, 1.9]})
    (said,) = missed_orders(rows, load_ship("ferry"), 6.5)
    assert said == (
        "TOO SLOW: in the seas of the task every controller is on average at least 0.70 m/s below the "
        "orders of up to 6.50 m/s; ferry reaches 6.60 m/s in calm water. Give lower orders (--orders "
        "FILE) or a lower sea (--sea)\n"
    )
    assert not missed_orders(rows, load_ship("ferry"), 7.5)
