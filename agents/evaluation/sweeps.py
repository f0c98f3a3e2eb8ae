"""Many settings sailed, spread over cores or a cluster, and summed up; finished ones are kept."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ...baselines.controller import Predictor
from ...core.discovery import version_of_others
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
    """What :func:`evaluate` found.

    Args:
        table: one row a cell: its fields, then each KPI with ``_low`` and ``_high``.
        traces: of each cell its first episode, with columns :data:`TRACE`, to six digits.
    """

    table: pd.DataFrame
    traces: list[pd.DataFrame]

    def summary(self, kpis: Sequence[str] = tuple(KPIS)) -> str:
        """A row a cell, a column a KPI, as text.

        Args:
            kpis: columns to show, of :data:`KPIS`.
        """
        shown = [c for c in ("controller", "sea", "observer") if c in self.table]
        return str(self.table[[*shown, *kpis]].to_string(index=False, float_format="%.4g"))

    def to_dict(self) -> dict[str, Any]:
        """Return tables and traces as JSON allows; an interval that is not given is null."""
        traces = [trace.to_dict(orient="list") for trace in self.traces]
        return {"table": self._rows(), "traces": traces}

    def _rows(self) -> list[dict[str, Any]]:
        known = self.table.astype(object).where(self.table.notna(), None)
        return [
            {str(name): value for name, value in row.items()} for row in known.to_dict("records")
        ]

    def save(
        self,
        folder: str | Path,
        title: str = "Evaluation",
        columns: Sequence[str] = tuple(KPIS),
    ) -> None:
        """Write ``table.csv``, ``table.json`` and the page ``table.md`` into a folder.

        Args:
            folder: made where needed.
            title: of the page.
            columns: KPIs that the page shows.
        """
        folder = Path(folder)
        write_atomically(folder / "table.csv", lambda file: self.table.to_csv(file, index=False))
        write_text(folder / "table.md", page(self.table, title, columns))
        write_json(folder / "table.json", self._rows())


class Episodes(NamedTuple):
    """What is kept of a cell."""

    kpis: pd.DataFrame
    """One row a seed, columns :data:`KPIS`."""
    trace: pd.DataFrame
    """The first seed's episode, columns :data:`TRACE`, to six digits."""


def evaluate(
    settings: Sequence[Setting],
    make: Callable[[Setting], Predictor],
    folder: str | Path,
    **spread: Any,
) -> Evaluation:
    """Sail every setting and sum it up.

    Args:
        settings: cells, each once.
        make: controller of a cell; travels to the other processes and is called there.
        folder: cells are kept in ``folder/cells``; those that stand there are not sailed again.
        spread: ``jobs``, ``backend``, ``scheduler`` and ``tick``, as of :func:`episodes`.
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
    """Sail every setting; cells that already stand in the folder are not sailed again.

    Args:
        settings: cells, each once.
        make: controller of a cell; travels to the other processes and is called there.
        folder: cells are kept in ``folder/cells`` as JSON. A cell's name tells its setting, its ship
            and the version of the equations: where one of them changes, the cell is sailed anew.
        jobs: see :func:`shaftline.core.sweep.sweep`, as for the backend and the scheduler.
        backend: ``processes`` or ``dask``.
        scheduler: address of a dask scheduler.
        tick: called after each cell.

    Raises:
        SweepError: cells whose controller raised, or a backend that is not there.
    """
    alone = backend == "processes" and (jobs == 1 or len(settings) == 1)
    work = functools.partial(_sail, make, None if alone else 1)
    cells = {
        f"{setting.name}_{version_of_cells(setting.vessel, setting.observer)}": setting
        for setting in settings
    }
    found = sweep(
        work, cells, folder / "cells", jobs=jobs, backend=backend, scheduler=scheduler, tick=tick
    )
    return [
        Episodes(pd.DataFrame(kept["kpis"]), pd.DataFrame(kept["trace"])) for kept in found.values()
    ]


def _sail(
    make: Callable[[Setting], Predictor], threads: int | None, setting: Setting
) -> dict[str, Any]:
    """A cell as it is kept; with one thread where other processes take the other cores."""
    kpis, trace = run_episodes(setting, make(setting), threads=threads)
    return {
        "setting": asdict(setting),
        "kpis": kpis.to_dict(orient="list"),
        "trace": {
            name: [float(f"{value:.6g}") for value in column]
            for name, column in zip(TRACE, trace.T, strict=True)
        },
    }


def version_of_cells(ship: str, observer: str = "") -> str:
    """Return eight letters that change with the ship, the package's source and a user's own observer.

    Args:
        ship: preset or path.
        observer: name; ``module:Class`` of a user's own.
    """
    source = source_digest("core", "plant", "observers", "baselines", "envs", "agents/evaluation")
    return digest_of(f"{source} {load_ship(ship)!r} {version_of_others(observer, OBSERVERS)}")
