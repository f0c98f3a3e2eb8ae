"""Evaluations spread over processes and clusters, stopped and taken up again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.agents.evaluation.episodes import Setting
from shaftline.agents.evaluation.sweeps import evaluate
from shaftline.baselines.combinator import Combinator

CELLS = [
    Setting("combinator", "transit", sea, "random-walk-kalman", seeds=3, episode_s=20.0)
    for sea in ("calm", "state-3", "state-5")
]


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
def make() -> Any:
    made = Combinator("frigate", 0.5)
    return lambda _: made


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
    text = (Path(__file__).parents[3] / "plant/ships/frigate.toml").read_text(encoding="utf-8")
    mine.write_text(text, encoding="utf-8")
    cells = [replace(CELLS[0], ship=str(mine))]
    evaluate(cells, make, tmp_path, jobs=1)
    evaluate(cells, make, tmp_path, jobs=1)
    assert len(list((tmp_path / "cells").iterdir())) == 1
    mine.write_text(text.replace("diameter_m = 4.2", "diameter_m = 4.1"), encoding="utf-8")
    evaluate(cells, make, tmp_path, jobs=1)
    assert len(list((tmp_path / "cells").iterdir())) == 2
