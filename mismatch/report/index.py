"""Write the result folder of a diagnosis or identification, and the index of many diagnoses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

import pandas as pd

from ...core.files import write_atomically, write_json, write_text
from ...plant.ship import Ship
from ...plant.ship_files import write_ship
from .data import replace_non_finite
from .text import align_columns

REPORT, PAGE, PDF = "report.json", "report.html", "report.pdf"
"""File names of the report as data, as a page and for print."""

SHIP = "corrected_ship.toml"
CALIBRATED = "calibrated_ship.toml"
"""File name of the corrected ship."""


class Result(ABC):
    """Result of a diagnosis or an identification, which can be written to a folder."""

    tables: Mapping[str, pd.DataFrame] = MappingProxyType({})

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html``, the corrected ship, and the tables as CSV.

        Each file is renamed into place when it is complete.

        Args:
            folder: created if it does not exist.
            page: whether to write ``report.html`` with its figures.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        folder = Path(folder)
        texts = {f"{name}.csv": table.to_csv(index=False) for name, table in self.tables.items()}
        if page:
            texts[PAGE] = self._page()
        write_json(folder / REPORT, self.to_dict())
        for name, ship in self._ships().items():
            write_ship(ship, folder / name)
        for name, text in texts.items():
            write_text(folder / name, text)
        return folder

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``report.json``."""

    @abstractmethod
    def _page(self) -> str:
        """Return the content of ``report.html``."""

    @abstractmethod
    def _ships(self) -> dict[str, Ship]:
        """Return the written ships by file name."""


INDEX_PAGE, INDEX_TABLE = (
    "index.html",
    "index.csv",
)  # File names of the index as a page and as a table

INDEX_COLUMNS = (
    "recording",
    "ship",
    "date",
    "verdict",
    "balances",
    "found",
    "windows_s",
    "regime",
    "channel",
    "fit_before",
    "fit_after",
    "sentence",
    "report",
    "error",
)
"""Columns of the index. ``fit_before`` and ``fit_after`` are FitPercent on the held-out data, of the
channel whose fit the corrected ship improves most."""

_ORDER = {"unexplained": 0, "partly-explained": 0, "explained": 0, "nothing-missing": 1, "": 2}


def index_row(
    recording: str,
    date: str,
    report: Mapping[str, Any] | None = None,
    link: str = "",
    error: str = "",
) -> dict[str, Any]:
    """Return a row of the index.

    Args:
        recording: file name of the recording.
        date: date of the recording.
        report: content of ``report.json``; None if the recording could not be diagnosed.
        link: path of ``report.html`` relative to the index.
        error: why the recording could not be diagnosed.
    """
    row: dict[str, Any] = dict.fromkeys(INDEX_COLUMNS, "")
    row |= {"recording": recording, "date": date, "error": error}
    row |= {"fit_before": float("nan"), "fit_after": float("nan")}
    if report is None:
        return row
    location, fit = report["location"], report["fit"]["held_out"]
    before, after = fit["before"], fit["after"]
    gains = {
        column: after[column] - before[column]
        for column in after
        if after[column] is not None and before.get(column) is not None
    }
    row |= {
        "ship": report["ship"],
        "verdict": report["verdict"],
        "balances": ", ".join(location["balances"]),
        "found": _effects_in_words(report),
        "windows_s": ", ".join(f"{a:.0f}..{b:.0f}" for a, b in location["windows_s"]),
        "regime": location["regime"],
        "sentence": report["sentence"],
        "report": link,
    }
    if gains:
        best = max(gains, key=lambda column: gains[column])
        row |= {"channel": best, "fit_before": before[best], "fit_after": after[best]}
    return row


def _effects_in_words(report: Mapping[str, Any]) -> str:
    """Return each effect with its first parameter, or the signal that the residual depends on."""
    parts = []
    for effect in report["effects"]:
        name, parameter = next(iter(effect["parameters"].items()))
        also = "".join(f" or {other}" for other in effect["equivalent_ids"])
        parts.append(f"{effect['id']}{also} ({name} = {parameter['value']:.4g})")
    if not parts and report["verdict"] == "unexplained":
        parts = ["unknown cause"]
        if (shape := report.get("unexplained")) is not None:
            parts.append(f"depends on {shape['signal'].replace('_', ' ')}")
    return "; ".join(parts)


@dataclass(frozen=True)
class DiagnosisIndex:
    """Diagnoses of many recordings, the largest mismatch first.

    The order is by the points of FitPercent that the corrected ship gains on the held-out data.
    Recordings in which nothing is missing follow, then recordings that could not be diagnosed.

    Args:
        table: one row for each recording, columns as in :data:`INDEX_COLUMNS`.

    >>> DiagnosisIndex.of([index_row("a.csv", "2024-05-01", error="a.csv: no column time_s")]).summary()
    'could not be diagnosed: a.csv: no column time_s'
    """

    table: pd.DataFrame

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]]) -> DiagnosisIndex:
        """Return the index of some rows.

        Args:
            rows: rows of :func:`index_row`, in any order.
        """
        table = pd.DataFrame(list(rows), columns=list(INDEX_COLUMNS))
        table["order"] = table["verdict"].map(_ORDER)
        table["gain"] = (table["fit_after"] - table["fit_before"]).fillna(0.0).round(6)
        table = table.sort_values(
            ["order", "gain", "recording"], ascending=[True, False, True], ignore_index=True
        )
        return cls(table[list(INDEX_COLUMNS)])

    @property
    def diagnosed(self) -> pd.DataFrame:
        """Rows of the recordings that were diagnosed."""
        return self.table[self.table["error"] == ""]

    @property
    def failed(self) -> pd.DataFrame:
        """Rows of the recordings that could not be diagnosed, with their ``error``."""
        return self.table[self.table["error"] != ""]

    def summary(self) -> str:
        """Return the verdicts, the effects and the errors as text for a terminal."""
        parts = []
        if len(self.diagnosed):
            heads = ["recording", "date", "verdict", "balances", "found"]
            rows = [
                {head: str(row[head]) for head in heads}
                | {"before": _percent(row["fit_before"]), "after": _percent(row["fit_after"])}
                for row in self.diagnosed.to_dict("records")
            ]
            head = "Largest mismatch first; FitPercent on the held-out data, 100 is perfect"
            parts.append(f"{head}\n{align_columns(rows, ('before', 'after'))}")
        parts += [f"could not be diagnosed: {error}" for error in self.failed["error"]]
        return "\n\n".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Return ``{"recordings": [...]}``, one entry for each recording with the table's columns."""
        return {"recordings": replace_non_finite(self.table.to_dict("records"))}

    def save(self, folder: str | Path) -> Path:
        """Write ``index.csv`` and ``index.html``.

        Args:
            folder: created if it does not exist.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        folder, table = Path(folder), self.table
        write_atomically(
            folder / INDEX_TABLE, lambda file: table.to_csv(file, index=False, float_format="%.6g")
        )
        write_text(folder / INDEX_PAGE, index_html(self))
        return folder


def _percent(value: float) -> str:
    return "–" if pd.isna(value) else f"{value:.1f}"


_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; padding: 0 1rem;
       color: #1b2733; background: #fff }
table { border-collapse: collapse; width: 100%; margin: 1rem 0 2rem }
th, td { text-align: left; vertical-align: top; padding: .45rem .6rem; border-bottom: 1px solid #d8dee4 }
th { border-bottom: 2px solid #1b2733; white-space: nowrap }
td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }
td.narrow { white-space: nowrap }
small { color: #57636f }
.verdict { padding: .1rem .5rem; border-radius: .6rem; white-space: nowrap }
.explained { background: #d7e8f7 } .partly-explained { background: #e6ecd9 }
.unexplained { background: #f9dfc4 }
.nothing-missing { background: #dcefdc }
"""

_NOTE = (
    "Largest mismatch first: by the points of FitPercent that the corrected ship gains on the held-out "
    "data in the channel given. FitPercent = 100 (1 − ‖measured − simulated‖ / ‖measured − mean‖), open "
    "loop: 100 is perfect, 0 is no better than the mean."
)


_HEADS = ("Recording", "Ship", "Date", "Verdict", "Balance and time", "Effects", "FitPercent")


def index_html(index: DiagnosisIndex) -> str:
    """Return ``index.html``, self-contained apart from its links to the reports."""
    good, bad = index.diagnosed, index.failed
    counts = good["verdict"].value_counts()
    parts = [f"{counts[v]} {v.replace('-', ' ')}" for v in _ORDER if v in counts]
    if len(bad):
        parts.append(f"{len(bad)} could not be diagnosed")
    ships = ", ".join(dict.fromkeys(good["ship"]))
    body = [
        "<h1>Differences between simulation and recordings</h1>",
        f"<p><b>{len(index.table)} recordings{f' of {escape(ships)}' if ships else ''}</b>: "
        f"{', '.join(parts)}.</p>",
    ]
    if len(good):
        body += [f"<p>{_NOTE}</p>", _table(_HEADS, map(_row, good.to_dict("records")))]
    if len(bad):
        lines = [
            f"<td class=narrow>{escape(row['recording'])}</td><td class=narrow>{row['date']}</td>"
            f"<td>{escape(row['error'])}</td>"
            for row in bad.to_dict("records")
        ]
        body += ["<h2>Could not be diagnosed</h2>", _table(("Recording", "Date", "Error"), lines)]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>Recordings</title><style>{_STYLE}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _table(heads: Iterable[str], lines: Iterable[str]) -> str:
    head = "".join(f"<th>{text}</th>" for text in heads)
    rows = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table>\n<tr>{head}</tr>\n{rows}\n</table>"


def _row(row: dict[Any, Any]) -> str:

    def small(text: str) -> str:
        return f"<br><small>{escape(text)}</small>" if text else ""

    where = escape(row["balances"]) + small(row["windows_s"] and f"{row['windows_s']} s")
    where += small(row["regime"])
    what = f"{escape(row['found'])}<br>" if row["found"] else ""
    what += f"<small>{escape(row['sentence'])}</small>"
    fit = ""
    if row["channel"]:
        fit = f"{row['fit_before']:.1f} → {row['fit_after']:.1f}{small(row['channel'])}"
    verdict = escape(row["verdict"])
    return (
        f'<td class=narrow><a href="{quote(row["report"])}">{escape(row["recording"])}</a></td>'
        f"<td>{escape(row['ship'])}</td><td class=narrow>{row['date']}</td>"
        f'<td><span class="verdict {verdict}">{verdict.replace("-", " ")}</span></td>'
        f"<td>{where}</td><td>{what}</td><td class=number>{fit}</td>"
    )
