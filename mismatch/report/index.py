"""The folder of a result: its report, its page, its ship and its tables.

The index of many diagnoses: what was found where, worst first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pandas as pd

from ...core.files import write_atomically, write_json, write_text
from ...plant.ship import Ship
from ...plant.ship_files import write_ship
from .data import finite
from .text import aligned

REPORT, PAGE = "report.json", "report.html"
"""Names of the files that every result has."""


def write_result(
    folder: str | Path,
    report: dict[str, Any],
    page: str | None,
    ships: Mapping[str, Ship],
    tables: Mapping[str, pd.DataFrame] | None = None,
) -> Path:
    """Write a result, of which all has been made; each file is renamed into place.

    Args:
        folder: made where needed.
        report: for :data:`REPORT`.
        page: for :data:`PAGE`; None where none is wanted.
        ships: by the names of their files.
        tables: by the names of theirs, without ``.csv``.

    Returns:
        The folder.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder = Path(folder)
    texts = {f"{name}.csv": table.to_csv(index=False) for name, table in (tables or {}).items()}
    if page is not None:
        texts[PAGE] = page
    write_json(folder / REPORT, report)
    for name, ship in ships.items():
        write_ship(ship, folder / name)
    for name, text in texts.items():
        write_text(folder / name, text)
    return folder


INDEX_PAGE, INDEX_TABLE = "index.html", "index.csv"
"""Names of the files of an index."""

INDEX_COLUMNS = (
    "recording", "ship", "date", "verdict", "balances", "found", "windows_s", "regime", "channel",
    "fit_before", "fit_after", "sentence", "report", "error",
)  # fmt: skip
"""Columns of the index. ``fit_before`` and ``fit_after`` are FitPercent on the data set aside, of the
channel that gains most by the corrected ship."""

_ORDER = {"unexplained": 0, "partly-explained": 0, "explained": 0, "nothing-missing": 1, "": 2}


def row_of(
    recording: str,
    date: str,
    report: Mapping[str, Any] | None = None,
    link: str = "",
    error: str = "",
) -> dict[str, Any]:
    """A row of the index.

    Args:
        recording: file name.
        date: when it was recorded.
        report: what stands in ``report.json``; none of a recording that could not be diagnosed.
        link: where its ``report.html`` is, seen from the index.
        error: why it could not.
    """
    row: dict[str, Any] = dict.fromkeys(INDEX_COLUMNS, "")
    row |= {"recording": recording, "date": date, "error": error}
    row |= {"fit_before": float("nan"), "fit_after": float("nan")}
    if report is None:
        return row
    fit = report["fit"]["held_out"]
    gains = {
        column: after - fit["before"][column]
        for column, after in fit["after"].items()
        if after is not None and fit["before"].get(column) is not None
    }
    location = report["location"]
    row |= {
        "ship": report["ship"],
        "verdict": report["verdict"],
        "balances": ", ".join(location["balances"]),
        "found": _found(report),
        "windows_s": ", ".join(f"{a:.0f}..{b:.0f}" for a, b in location["windows_s"]),
        "regime": location["regime"],
        "sentence": report["sentence"],
        "report": link,
    }
    if gains:
        channel = max(gains, key=lambda column: gains[column])
        row |= {"channel": channel, "fit_before": fit["before"][channel]}
        row["fit_after"] = fit["after"][channel]
    return row


def _found(report: Mapping[str, Any]) -> str:
    """Each effect with its main parameter; or what has no name."""
    parts = []
    for effect in report["effects"]:
        name, parameter = next(iter(effect["parameters"].items()))
        also = "".join(f" or {other}" for other in effect["equivalent_ids"])
        parts.append(f"{effect['id']}{also} ({name} = {parameter['value']:.4g})")
    if not parts and report["verdict"] == "unexplained":
        shape = report.get("unexplained")
        return f"no name; follows {shape['signal'].replace('_', ' ')}" if shape else "no name"
    return "; ".join(parts)


@dataclass(frozen=True)
class DiagnosisIndex:
    """What was found in each of many recordings, worst first.

    That is by the points of FitPercent that the corrected ship gains on the data set aside; then where
    nothing is missing; then what could not be diagnosed.

    Args:
        table: one row a recording, columns as in :data:`INDEX_COLUMNS`.
    """

    table: pd.DataFrame

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]]) -> DiagnosisIndex:
        """The index of some rows.

        Args:
            rows: as of :func:`row_of`, in any order.
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
        """Rows of the recordings that could be diagnosed."""
        return self.table[self.table["error"] == ""]

    @property
    def failed(self) -> pd.DataFrame:
        """Rows of those that could not, with their ``error``."""
        return self.table[self.table["error"] != ""]

    def summary(self) -> str:
        """What was found where, and what could not be diagnosed, as text for a terminal."""
        parts = []
        if len(self.diagnosed):
            heads = ["recording", "date", "verdict", "balances", "found"]
            rows = [
                {head: str(row[head]) for head in heads}
                | {"before": _percent(row["fit_before"]), "after": _percent(row["fit_after"])}
                for row in self.diagnosed.to_dict("records")
            ]
            head = "Worst first; FitPercent on what was set aside, 100 is perfect"
            parts.append(f"{head}\n{aligned(rows, ('before', 'after'))}")
        parts += [f"could not be diagnosed: {error}" for error in self.failed["error"]]
        return "\n\n".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """``{"recordings": [...]}``, one entry a recording with the columns of the table."""
        return {"recordings": finite(self.table.to_dict("records"))}

    def save(self, folder: str | Path) -> Path:
        """Write ``index.csv`` and ``index.html``.

        Args:
            folder: made where needed.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        folder, table = Path(folder), self.table
        write_atomically(
            folder / INDEX_TABLE, lambda file: table.to_csv(file, index=False, float_format="%.6g")
        )
        write_text(folder / INDEX_PAGE, page(self))
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
    "Worst first: by the points of FitPercent that the missing physics costs on data set aside, in "
    "the channel named. FitPercent = 100 (1 − ‖measured − simulated‖ / ‖measured − mean‖), open loop: "
    "100 is perfect, 0 no better than the mean."
)


def page(index: DiagnosisIndex) -> str:
    """``index.html``, with nothing outside it but the reports that it links to."""
    good, bad = index.diagnosed, index.failed
    counts = good["verdict"].value_counts()
    parts = [f"{counts[v]} {v.replace('-', ' ')}" for v in _ORDER if v in counts]
    if len(bad):
        parts.append(f"{len(bad)} could not be diagnosed")
    ships = ", ".join(dict.fromkeys(good["ship"]))
    body = [
        "<h1>Where simulation and recordings differ</h1>",
        f"<p><b>{len(index.table)} recordings{f' of {escape(ships)}' if ships else ''}</b>: "
        f"{', '.join(parts)}.</p>",
    ]
    if len(good):
        heads = ("Recording", "Ship", "Date", "Verdict", "Where", "What", "FitPercent")
        body += [f"<p>{_NOTE}</p>", _table(heads, map(_row, good.to_dict("records")))]
    if len(bad):
        lines = [
            f"<td class=narrow>{escape(row['recording'])}</td><td class=narrow>{row['date']}</td>"
            f"<td>{escape(row['error'])}</td>"
            for row in bad.to_dict("records")
        ]
        body += ["<h2>Could not be diagnosed</h2>", _table(("Recording", "Date", "Why"), lines)]
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
    where = escape(row["balances"])
    if row["windows_s"]:
        where += f"<br><small>{escape(row['windows_s'])} s</small>"
    if row["regime"]:
        where += f"<br><small>{escape(row['regime'])}</small>"
    what = f"{escape(row['found'])}<br>" if row["found"] else ""
    what += f"<small>{escape(row['sentence'])}</small>"
    fit = ""
    if row["channel"]:
        fit = f"{row['fit_before']:.1f} → {row['fit_after']:.1f}"
        fit += f"<br><small>{escape(row['channel'])}</small>"
    verdict = escape(row["verdict"])
    return (
        f'<td class=narrow><a href="{quote(row["report"])}">{escape(row["recording"])}</a></td>'
        f"<td>{escape(row['ship'])}</td><td class=narrow>{row['date']}</td>"
        f'<td><span class="verdict {verdict}">{verdict.replace("-", " ")}</span></td>'
        f"<td>{where}</td><td>{what}</td><td class=number>{fit}</td>"
    )
