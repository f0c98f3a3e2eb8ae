"""Shared parts of the sub-commands: console output, errors, progress, tables and options."""

from __future__ import annotations

import itertools
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..core.files import check_writable
from . import STOPPED
from .machine import captured_output

if TYPE_CHECKING:
    import pandas as pd
    from rich.progress import Progress, ProgressColumn

    from ..envs import Task
    from ..plant import Ship

errors = Console(stderr=True, emoji=False)

EVERY_S = 10.0
"""Time between two lines of a log [s]."""


LEAST_TIMED_S = 5.0
"""Time spent on a count before its end is estimated [s]."""


class TimeLeft:
    """Estimate of the time until a count ends, from the mean time of its parts so far.

    A new count begins where the total changes or the number of finished parts falls.

    Args:
        now: time at which the work begins [s].
    """

    def __init__(self, now: float) -> None:
        self._last = self._begun = now
        self._first, self._done, self._total = 0, 0, -1

    def text(self, now: float, done: int, total: int) -> str:
        """Return the time left as text, empty where it is not known yet or the count has ended."""
        if total != self._total or done < self._done:
            # The first part has taken the time since the last call; a resumed count begins here.
            self._begun, self._first = (self._last, 0) if done == 1 else (now, done)
        self._last, self._done, self._total = now, done, total
        spent, parts = now - self._begun, done - self._first
        if done >= total or parts < 1 or spent < LEAST_TIMED_S:
            return ""
        return f"about {_duration_text(spent / parts * (total - done))} left"


def _duration_text(seconds: float) -> str:
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


class Log:
    """Log lines of work in progress; ``clock`` returns the time [s]."""

    def __init__(
        self, label: str, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.label, self._say, self._clock = label, say, clock
        self._begun = self._last = clock()
        self._left = TimeLeft(self._begun)
        self._stage = ""

    def at(self, done: int, total: int, stage: str = "") -> None:
        """Write the progress at every new stage, every :data:`EVERY_S` seconds, and at the end."""
        now, new = self._clock(), stage != self._stage
        left = self._left.text(now, done, total)
        if not (new or done >= total or now - self._last >= EVERY_S):
            return
        self._last, self._stage = now, stage
        what = f"{self.label}: {stage}" if stage else self.label
        if left:
            left = f", {left} in this stage" if stage else f", {left}"
        self._say(f"{what}, {done} of {total}, {now - self._begun:.0f} s{left}")


def announce_compilation(say: Callable[[str], None] | None = None, patience_s: float = 1.0) -> None:
    """Print a line once if kernels are compiled for longer than ``patience_s`` [s]."""
    from numba.core import event

    class Once(event.Listener):  # type: ignore[misc]
        begun: float | None = None
        announced = False

        def on_start(self, event: object) -> None:
            now = time.monotonic()
            self.begun = now if self.begun is None else self.begun
            if not self.announced and now - self.begun > patience_s:
                self.announced = True
                words = (
                    "compiling the equations: each command does so at its first use on this machine, "
                    "in half a minute to a few minutes; shaftline prepare does so on all cores"
                )
                (say or _line)(words)

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Once())  # type: ignore[no-untyped-call]


def _line(text: str) -> None:
    errors.print(text, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def announce_loading(what: str = "", patience_s: float = 0.1) -> Iterator[None]:
    """Show that libraries, or those that ``what`` names, load for longer than ``patience_s`` [s]."""
    text = f"loading {what}".rstrip()
    shown = errors.status(text) if errors.is_terminal else None
    late = threading.Timer(patience_s, shown.start if shown else lambda: _line(text))
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()
        late.join()  # A spinner that starts after this would never stop.
        if shown:
            shown.stop()


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Show the progress of work in equal parts; yield the function that counts one part."""
    if not errors.is_terminal:
        log, done = Log(label, _line), itertools.count(1)
        _line(f"{label}, {total} in total")
        yield lambda: log.at(next(done), total)
        return
    from rich.progress import MofNCompleteColumn

    with _bar(MofNCompleteColumn()) as bar:
        task, done = bar.add_task(label, total=total, left=""), itertools.count(1)
        left = TimeLeft(time.monotonic())

        def tick() -> None:
            count = next(done)
            text = left.text(time.monotonic(), count, total)
            bar.update(task, completed=count, left=text)

        yield tick


def _bar(*more: ProgressColumn) -> Progress:
    from rich import progress as rich_progress  # most first lines need none of it

    label, bar = rich_progress.TextColumn("{task.description}"), rich_progress.BarColumn()
    left = rich_progress.TextColumn("{task.fields[left]}")
    columns = (label, bar, *more, rich_progress.TimeElapsedColumn(), left)
    return rich_progress.Progress(*columns, console=errors, transient=True)


@contextmanager
def stages(label: str) -> Iterator[Callable[[str, int, int], None]]:
    """Show the progress of work with stages; yield the function ``(stage, done, total)`` for it."""
    if not errors.is_terminal:
        log = Log(label, _line)
        _line(label)
        yield lambda stage, done, total: log.at(done, total, stage)
        return
    with _bar() as bar:
        task, left = bar.add_task(label, total=None, left=""), TimeLeft(time.monotonic())

        def tick(stage: str, done: int, total: int) -> None:
            text, what = left.text(time.monotonic(), done, total), f"{label}: {stage}"
            bar.update(task, description=what, completed=done, total=total, left=text)

        yield tick


MOST_SEEDS = 10_000
"""Largest number of episodes of one cell: they are simulated together, with 80 kB for each."""

_LONGEST = 1000  # half of the longest line of an error message
_LARGE = 1e9  # smallest number that a table shows with an exponent
_PIPE_WIDTH = 180  # columns of the output if it is not a terminal

_ON_TERMINAL = sys.stdout is not None and sys.stdout.isatty()  # None: the shell closed the output
console = Console(width=None if _ON_TERMINAL else _PIPE_WIDTH, emoji=False)


class Backend(StrEnum):
    """Where the cells of a sweep are computed."""

    PROCESSES = "processes"
    DASK = "dask"


PresetShip = Annotated[
    str, typer.Option(help="Ship: a preset (see `shaftline list`) or a .toml file.")
]
"""``--ship`` of the commands that simulate or analyse one ship."""

Jobs = Annotated[
    int | None, typer.Option(min=1, help="Processes on this machine.", show_default="one a core")
]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of the dask cluster, such as tcp://10.0.0.1:8786.")
]

BelievedShip = Annotated[
    str,
    typer.Option(
        help="Ship to compare with: a preset (see `shaftline list`) or a ship file (.toml).",
        show_default=False,
    ),
]
"""``--ship`` of the commands that compare a ship with recordings."""

ColumnMap = Annotated[
    Path | None,
    typer.Option(
        help="Column map MAP.toml for recordings with other names, units or signs.",
        show_default=False,
    ),
]
"""``--columns`` of these commands."""

SteadyRows = Annotated[
    bool,
    typer.Option(
        "--steady",
        help="Treat each row as an equilibrium of the ship at the inputs of that row.",
        show_default="if rows are slower than the ship",
    ),
]
"""``--steady`` of these commands."""

OwnHeight = Annotated[
    float | None,
    typer.Option("--hs", help="Significant wave height [m] of a user-defined sea; needs --tp."),
]
OwnPeriod = Annotated[
    float | None, typer.Option("--tp", help="Peak period [s] of a user-defined sea; needs --hs.")
]


def read_own_sea(height: float | None, period: float | None) -> list[str]:
    """Return ``--hs`` and ``--tp`` in the form of ``--sea``; an empty list if neither is given."""
    if (height is None) != (period is None):
        raise ValueError(
            "--hs and --tp must be given together, such as --hs 3.2 --tp 9.1 (in m and s)"
        )
    return [] if height is None else [f"hs={height!r},tp={period!r}"]


def check_folder(out: Path, ship: str = "", *results: str) -> None:
    """Refuse a folder for results that is a file, is not writable, or contains the ship file itself.

    Args:
        out: folder.
        ship: ship that the command reads, where the command also writes some.
        results: file names of the written ships.
    """
    written = [(out / result).resolve() for result in results]
    if ship and Path(ship).is_file() and Path(ship).resolve() in written:
        raise ValueError(
            f"--out {out}: the result would replace --ship {ship}; give another folder"
        )
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file; give a folder")
    check_writable(out, folder=True)


def check_pitch(ship: Ship, pitch: float | None) -> None:
    """Refuse a pitch ratio that the propeller does not reach."""
    low, high = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max
    if pitch is not None and not low <= pitch <= high:
        raise ValueError(
            f"--pitch {pitch:g}: the P/D of {ship.name} must be from {low:g} to {high:g}"
        )


def say_scaled_orders(name: str, task: Task, ship: Ship) -> None:
    """Print the ordered speeds of a task for a ship that is too slow for those of the task."""
    scaled = task.scale_orders(ship)
    if scaled is not task:
        (low, high), (least, most) = task.speed_order_m_s, scaled.speed_order_m_s
        say(
            f"orders: {least:.2f} to {most:.2f} m/s. Those of {name}, {low:g} to {high:g} m/s for "
            f"{task.vessel}, are above what {ship.name} reaches in calm water, and are scaled in "
            "proportion of the highest speeds\n"
        )


def say(text: str) -> None:
    """Print a text without colours, line breaks or interpretation of brackets."""
    if (output := captured_output()) is not None:
        output.said += text.strip().splitlines()
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def _each_once() -> Callable[..., None]:
    """Return a printer of warnings: each warning once, in one line, without its place in the source."""
    printed: set[str] = set()

    def print_warning(message: Warning | str, *_: Any, **__: Any) -> None:
        text = " ".join(str(message).split())
        if text not in printed:
            printed.add(text)
            errors.print(f"[yellow]warning:[/] {escape(text)}", highlight=False, soft_wrap=True)

    return print_warning


@contextmanager
def report_errors(resumes: bool = False) -> Iterator[None]:
    """Turn invalid input and files that cannot be written into one message and exit code 2.

    Ctrl-C ends with one line too; it says whether the same command ``resumes`` from finished results.

    Only errors that the user can correct are caught: those that the package raises deliberately are
    ValueErrors with a message for the user.
    """
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _each_once()
            yield
    except (ValueError, OSError, MemoryError) as error:
        text = str(error) or "not enough memory"
        if isinstance(error, OSError) and error.strerror and error.filename is not None:
            text = f"{error.filename}: {error.strerror.lower()}"
        said = "\n".join(
            line if len(line) <= 2 * _LONGEST else f"{line[:_LONGEST]} ... {line[-_LONGEST:]}"
            for line in text.splitlines()
        )
        errors.print(f"[bold red]error:[/] {escape(said)}", highlight=False, soft_wrap=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        kept = "; finished results are kept, and the same command resumes" if resumes else ""
        errors.print(f"stopped{kept}", highlight=False)
        raise typer.Exit(STOPPED) from None


@contextmanager
def require_extra(extra: str, what: str) -> Iterator[None]:
    """Turn a missing library of an extra into a message that says how to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{what} needs {error.name}, which is not installed: pip install 'shaftline[{extra}]'"
        ) from None


def print_table(frame: pd.DataFrame, title: str, digits: int = 2, width: int | None = None) -> None:
    """Print a table with a title and whole words if possible.

    Args:
        frame: table; a dash is printed for a missing value.
        title: title above the table.
        digits: digits after the decimal point.
        width: largest width in columns; that of the console by default.
    """
    import pandas as pd  # It takes a quarter of a second, and --help does not need it.

    if (output := captured_output()) is not None:
        output.tables[title] = frame.to_dict(orient="records")  # type: ignore[assignment]

    def cell(value: Any) -> str:
        if isinstance(value, float):
            if pd.isna(value):
                return "–"
            return f"{value:.{digits}f}" if abs(value) < _LARGE else f"{value:.4g}"
        return str(value)

    texts = {str(name): [cell(value) for value in values] for name, values in frame.items()}
    words = [max(map(len, " ".join([name, *cells]).split())) for name, cells in texts.items()]
    most = min(console.width, width or console.width)
    spare = most - sum(words) - 3 * len(words) - 1  # beside the space between them
    fits = spare >= 0
    console.print(escape(title), style="italic", highlight=False)
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    for i, (name, longest) in enumerate(zip(texts, words, strict=True)):
        more = min(max(map(len, [name, *texts[name]])) - longest, max(spare, 0))
        table.add_column(
            escape(name),
            justify="right" if pd.api.types.is_numeric_dtype(frame.iloc[:, i]) else "left",
            no_wrap=i == 0 and not fits,
            width=longest + more if fits else None,
            overflow="fold",
        )
        spare -= more
    for row in zip(*texts.values(), strict=True):
        table.add_row(*map(escape, row))
    console.print(table, width=most)
