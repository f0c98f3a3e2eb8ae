"""Cells are simulated once; an evaluation returns, prints and saves their results."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.agents import KPIS, Evaluation, Setting, evaluate, run_episodes, summary
from shaftline.agents.evaluation import sweeps
from shaftline.agents.evaluation.episodes import TRACE
from shaftline.agents.evaluation.page import page
from shaftline.agents.evaluation.sweeps import episodes, version_of_cells
from shaftline.baselines.combinator import Combinator

CELL = Setting("combinator", "transit", "state-5", "random-walk-kalman", seeds=4, episode_s=10.0)
FRIGATE = Path(__file__).parents[3] / "plant/ships/frigate.toml"


@pytest.fixture(scope="module")
def combinator() -> Combinator:
    return Combinator("frigate", 0.5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("evaluation")


@pytest.fixture(scope="module")
def found(combinator: Combinator, folder: Path) -> Evaluation:
    return evaluate([CELL, replace(CELL, sea="calm")], lambda setting: combinator, folder, jobs=1)


def test_a_row_is_a_cell_with_the_summary_of_its_episodes(
    found: Evaluation, combinator: Combinator
) -> None:
    kpis, trace = run_episodes(CELL, combinator)
    row = found.table.iloc[0].to_dict()
    for name, ends in summary(kpis).items():
        assert (row[name], row[f"{name}_low"], row[f"{name}_high"]) == pytest.approx(ends), name
    fields = {
        key: value
        for key, value in (asdict(CELL) | {"ship": "frigate"}).items()
        if key not in ("task_model", "randomise", "tuning", "interval_s", "order_profile")
    }
    assert {key: row[key] for key in fields} == fields
    assert len(row) == len(fields) + 3 * len(KPIS)
    assert found.table["sea"].tolist() == ["state-5", "calm"]
    assert found.table["torque_sd_kN_m"][1] < found.table["torque_sd_kN_m"][0]
    assert [tuple(trace.columns) for trace in found.traces] == [TRACE, TRACE]
    kept = found.traces[0].to_numpy()
    assert kept == pytest.approx(trace, rel=5e-6)
    assert not np.array_equal(kept, trace)  # to six digits


def test_finished_cells_are_not_sailed_again(
    found: Evaluation, folder: Path, combinator: Combinator
) -> None:
    made: list[Setting] = []

    def make(setting: Setting) -> Combinator:
        made.append(setting)
        return combinator

    ticks: list[None] = []
    cells = [replace(CELL, sea="state-3"), CELL]
    again = evaluate(cells, make, folder, jobs=1, tick=lambda: ticks.append(None))
    assert made == cells[:1]
    assert len(ticks) == 2
    assert again.table["sea"].tolist() == ["state-3", "state-5"]
    pd.testing.assert_frame_equal(again.traces[1], found.traces[0])
    kept = episodes(cells, make, folder, jobs=1)
    assert made == cells[:1]
    assert list(kept[1].kpis.columns) == list(KPIS)
    assert len(kept[1].kpis) == 4
    assert summary(kept[1].kpis)["reward"][0] == found.table["reward"][0]


def test_a_cells_name_changes_with_ship_and_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(FRIGATE.read_text(encoding="utf-8"), encoding="utf-8")
    first = version_of_cells(str(mine))
    assert first == version_of_cells("frigate") == version_of_cells(str(mine))
    assert len(first) == 8
    text = mine.read_text(encoding="utf-8")
    mine.write_text(text.replace("diameter_m = 4.2", "diameter_m = 4.1"), encoding="utf-8")
    assert version_of_cells(str(mine)) != first
    asked: list[str] = []

    def digest(*places: str) -> str:
        asked.extend(places)
        return "another"

    monkeypatch.setattr(sweeps, "source_digest", digest)
    assert version_of_cells("frigate") != first
    assert set(asked) == {
        "core",
        "plant",
        "observers",
        "baselines",
        "envs",
        "agents/evaluation",
    }


def test_one_process_may_use_all_cores_and_several_one_each(
    tmp_path: Path, combinator: Combinator, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads: list[Any] = []

    def run(setting: Setting, controller: Any, **options: Any) -> Any:
        threads.append(options["threads"])
        return run_episodes(setting, controller, threads=1)

    def in_line(work: Any, cells: dict[str, Any], *_: Any, **__: Any) -> dict[str, Any]:
        return {name: work(cell) for name, cell in cells.items()}

    monkeypatch.setattr(sweeps, "run_episodes", run)
    monkeypatch.setattr(sweeps, "sweep", in_line)
    two = [CELL, replace(CELL, sea="calm")]
    for cells, options in (
        (two, {"jobs": 1}),
        (two[:1], {}),
        (two, {"jobs": 2}),
        (two, {}),
        (two[:1], {"backend": "dask"}),
    ):
        threads.clear()
        episodes(cells, lambda setting: combinator, tmp_path, **options)  # type: ignore[arg-type]
        alone = options == {"jobs": 1} or (len(cells) == 1 and not options)
        assert threads == [None if alone else 1] * len(cells), options


def test_an_evaluation_says_gives_and_saves_itself(found: Evaluation, tmp_path: Path) -> None:
    lines = found.summary(["fuel_kg_nmi", "failed"]).splitlines()
    assert lines[0].split() == ["controller", "sea", "observer", "fuel_kg_nmi", "failed"]
    assert lines[1].split() == [
        "combinator",
        "state-5",
        "random-walk-kalman",
        f"{found.table['fuel_kg_nmi'][0]:.4g}",
        "0",
    ]
    assert found.summary().splitlines()[0].split()[3:] == list(KPIS)
    told = json.loads(json.dumps(found.to_dict()))
    assert told["table"][1]["sea"] == "calm"
    assert told["table"][0]["reward_low"] == found.table["reward_low"][0]
    assert told["traces"][0]["time"] == found.traces[0]["time"].tolist()
    found.save(tmp_path / "new", "Trial", ["reward"])
    assert (tmp_path / "new/table.md").read_text() == page(found.table, "Trial", ["reward"])
    assert json.loads((tmp_path / "new/table.json").read_text()) == told["table"]
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "new/table.csv"), found.table)
    few = replace(found, table=found.table.assign(reward_low=np.nan))
    assert few.to_dict()["table"][0]["reward_low"] is None
    few.save(tmp_path / "few")
    assert json.loads((tmp_path / "few/table.json").read_text()) == few.to_dict()["table"]
    found.save(tmp_path)
    assert (tmp_path / "table.md").read_text() == page(found.table, "Evaluation", list(KPIS))
