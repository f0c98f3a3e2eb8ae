"""Evaluation of many settings, distributed over cores or a cluster; finished cells are kept."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ...baselines.controller import Predictor
from ...core.discovery import external_class_digest
from ...core.files import write_atomically, write_json, write_text
from ...core.sweep import digest_of, source_digest, sweep
from ...observers.registry import OBSERVERS
from ...plant import load_ship
from .episodes import TRACE, Setting, run_episodes
from .kpis import KPIS
from .page import page
from .statistics import summary


@dataclass(frozen=True)
class Evaluation:
    """Result of :func:`evaluate`.

    Args:
        table: one row for each cell: its fields, then each KPI with ``_low`` and ``_high``.
        traces: trace of the first episode of each cell, with columns :data:`TRACE`, to six digits.
    """

    table: pd.DataFrame
    traces: list[pd.DataFrame]

    def summary(self, kpis: Sequence[str] = tuple(KPIS)) -> str:
        """Return the table as text, with a row for each cell and a column for each KPI.

        Args:
            kpis: columns to show, of :data:`KPIS`.
        """
        shown = [c for c in ("controller", "sea", "observer") if c in self.table]
        return str(self.table[[*shown, *kpis]].to_string(index=False, float_format="%.4g"))

    def to_dict(self) -> dict[str, Any]:
        """Return tables and traces as JSON values; an interval that is not given is None."""
        traces = [trace.to_dict(orient="list") for trace in self.traces]
        return {"table": self._rows(), "traces": traces}

    def _rows(self) -> list[dict[str, Any]]:
        known = self.table.astype(object).where(self.table.notna(), None)
        return [
            {str(name): value for name, value in row.items()} for row in known.to_dict("records")
        ]

    def save(
        self, folder: str | Path, title: str = "Evaluation", columns: Sequence[str] = tuple(KPIS)
    ) -> None:
        """Write ``table.csv``, ``table.json`` and the page ``table.md`` to a folder.

        Args:
            folder: folder, created if necessary.
            title: title of the page.
            columns: KPIs to show on the page.
        """
        folder = Path(folder)
        write_atomically(folder / "table.csv", lambda file: self.table.to_csv(file, index=False))
        write_text(folder / "table.md", page(self.table, title, columns))
        write_json(folder / "table.json", self._rows())


class Episodes(NamedTuple):
    """Stored result of a cell."""

    kpis: pd.DataFrame  # columns :data:`KPIS`, one row for each seed
    trace: pd.DataFrame  # first episode with columns :data:`TRACE`, to six digits


def evaluate(
    settings: Sequence[Setting],
    make: Callable[[Setting], Predictor],
    folder: str | Path,
    **spread: Any,
) -> Evaluation:
    """Simulate every setting and summarise the KPIs.

    Args:
        settings: cells, all different.
        make: function that returns the controller of a cell; other processes call it too.
        folder: finished cells are kept in ``folder/cells`` and not simulated again.
        spread: ``jobs``, ``backend``, ``scheduler`` and ``tick`` of :func:`episodes`.
    """
    found = episodes(settings, make, Path(folder), **spread)
    rows = []
    for setting, kept in zip(settings, found, strict=True):
        row = setting.columns
        for name, (middle, low, high) in summary(kept.kpis).items():
            row |= {name: middle, f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    return Evaluation(pd.DataFrame(rows), [kept.trace for kept in found])


def episodes(
    settings: Sequence[Setting],
    make: Callable[[Setting], Predictor],
    folder: Path,
    *,
    jobs: int | None = None,
    backend: str = "processes",
    scheduler: str | None = None,
    tick: Callable[[], None] = lambda: None,
) -> list[Episodes]:
    """Simulate every setting; cells that the folder already contains are not simulated again.

    Args:
        settings: cells, all different.
        make: function that returns the controller of a cell; other processes call it too.
        folder: cells are kept in ``folder/cells`` as JSON. The name of a cell contains its setting and a
            digest of its ship and of the source code: where one of them changes, the cell is simulated
            again.
        jobs: number of processes, see :func:`shaftline.core.sweep.sweep`.
        backend: ``processes`` or ``dask``.
        scheduler: address of a dask scheduler.
        tick: function called after each cell.

    Raises:
        SweepError: the controller of a cell raised an error, or the backend is not available.
    """
    alone = backend == "processes" and (jobs == 1 or len(settings) == 1)
    work = functools.partial(_run_cell, make, None if alone else 1)
    cells = {f"{s.name}_{version_of_cells(s.vessel, s.observer)}": s for s in settings}
    found = sweep(
        work, cells, folder / "cells", jobs=jobs, backend=backend, scheduler=scheduler, tick=tick
    )
    return [
        Episodes(*(pd.DataFrame(kept[k]) for k in ("kpis", "trace"))) for kept in found.values()
    ]


def _run_cell(
    make: Callable[[Setting], Predictor], threads: int | None, setting: Setting
) -> dict[str, Any]:
    """Return the stored form of a cell; one thread where other processes use the other cores."""
    kpis, trace = run_episodes(setting, make(setting), threads=threads)
    rounded = {
        name: [float(f"{value:.6g}") for value in column]
        for name, column in zip(TRACE, trace.T, strict=True)
    }
    return {"setting": asdict(setting), "kpis": kpis.to_dict(orient="list"), "trace": rounded}


def version_of_cells(ship: str, observer: str = "") -> str:
    """Return eight letters that change with the ship, the source code and a user's own observer."""
    source = source_digest("core", "plant", "observers", "baselines", "envs", "agents/evaluation")
    return digest_of(f"{source} {load_ship(ship)!r} {external_class_digest(observer, OBSERVERS)}")
