"""Progress of long work on the error stream: a bar on a terminal, a line now and then in a log.

What the sub-commands share: the console, errors, progress, tables.
"""

from __future__ import annotations

import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..core.files import check_writable
from ..plant import Ship
from . import STOPPED
from .machine import told

errors = Console(stderr=True, emoji=False)

EVERY_S = 10.0
"""Between two lines of a log [s]."""


class Log:
    """Lines of work that is under way.

    Args:
        label: what is done.
        say: writes a line.
        clock: time [s].
    """

    def __init__(
        self,
        label: str,
        say: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.label, self._say, self._clock = label, say, clock
        self._begun = self._last = clock()
        self._stage = ""

    def at(self, done: int, total: int, stage: str = "") -> None:
        """Tell how far it is: at every new stage, else every :data:`EVERY_S` seconds and at the end.

        Args:
            done: parts of the work, or of its stage.
            total: all of them.
            stage: of the work.
        """
        now, new = self._clock(), stage != self._stage
        if not (new or done >= total or now - self._last >= EVERY_S):
            return
        self._last, self._stage = now, stage
        what = f"{self.label}: {stage}" if stage else self.label
        self._say(f"{what}, {done} of {total}, {now - self._begun:.0f} s")


def tell_compiling(say: Callable[[str], None] | None = None, patience_s: float = 1.0) -> None:
    """Say once, where kernels are compiled and not found compiled, what takes so long.

    Args:
        say: writes a line.
        patience_s: compiling that is too short to speak of [s].
    """
    from numba.core import event

    class Once(event.Listener):  # type: ignore[misc]
        begun: float | None = None
        told = False

        def on_start(self, event: object) -> None:
            now = time.monotonic()
            self.begun = now if self.begun is None else self.begun
            if not self.told and now - self.begun > patience_s:
                self.told = True
                (say or _line)(
                    "compiling the equations for this machine; once, about half a minute"
                )

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Once())  # type: ignore[no-untyped-call]


def _line(text: str) -> None:
    errors.print(text, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def loading(patience_s: float = 0.4) -> Iterator[None]:
    """Say that libraries are loaded, where that takes long: on a terminal until it is done.

    Args:
        patience_s: loading that is too short to speak of [s].
    """
    shown = errors.status("loading") if errors.is_terminal else None
    late = threading.Timer(patience_s, shown.start if shown else lambda: _line("loading"))
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()
        late.join()  # a spinner that is about to begin would never end
        if shown:
            shown.stop()


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Progress of work in equal parts; gives the function that moves it by one.

    Args:
        label: what is done.
        total: how many parts.
    """
    if not errors.is_terminal:
        log, done = Log(label, _line), 0
        _line(f"{label}, {total} in all")

        def count() -> None:
            nonlocal done
            done += 1
            log.at(done, total)

        yield count
        return
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=errors, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(label, total=total)
        yield lambda: bar.advance(task)


@contextmanager
def stages(label: str) -> Iterator[Callable[[str, int, int], None]]:
    """Progress that begins anew with every stage; gives the function ``(stage, done, total)``.

    Args:
        label: what is done.
    """
    if not errors.is_terminal:
        log = Log(label, _line)
        _line(label)
        yield lambda stage, done, total: log.at(done, total, stage)
        return
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(),
        console=errors, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(label, total=None)

        def tick(stage: str, done: int, total: int) -> None:
            bar.update(task, description=f"{label}: {stage}", completed=done, total=total)

        yield tick


MOST_SEEDS = 10_000
"""Episodes of one cell or candidate: they are sailed at once, and take 100 kB each."""

_LONGEST = 1000  # half of an error's line
_LARGE = 1e9  # from which a number in a table is written with an exponent
_PIPE_WIDTH = 180  # columns where the output is no terminal, so that no table is folded

console = Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH, emoji=False)


class Backend(StrEnum):
    """Where the cells of a sweep are worked on."""

    PROCESSES = "processes"
    DASK = "dask"


BelievedShip = Annotated[
    str,
    typer.Option(
        help="The ship as you believe it to be: a preset (see `shaftline list`) or a .toml file.",
        show_default=False,
    ),
]
"""``--ship`` of the commands that hold a ship against recordings."""

ColumnMap = Annotated[
    Path | None,
    typer.Option(
        help="Column map MAP.toml, for recordings with other names, units or signs.",
        show_default=False,
    ),
]
"""``--columns`` of the same."""

SteadyRows = Annotated[
    bool,
    typer.Option(
        "--steady",
        help="Take each row as an equilibrium of the ship at the inputs of that row.",
        show_default="where rows are slower than the ship",
    ),
]
"""``--steady`` of the same."""

OwnHeight = Annotated[
    float | None,
    typer.Option("--hs", help="Significant height [m] of a sea of your own, with --tp."),
]
OwnPeriod = Annotated[float | None, typer.Option("--tp", help="Its peak period [s].")]


def own_sea(height: float | None, period: float | None) -> list[str]:
    """What ``--hs`` and ``--tp`` ask for, as ``--sea`` says it; nothing where neither is given.

    Raises:
        ValueError: one without the other.
    """
    if (height is None) != (period is None):
        raise ValueError("a sea of your own needs both --hs and --tp [m, s]: --hs 3.2 --tp 9.1")
    return [] if height is None else [f"hs={height!r},tp={period!r}"]


def check_folder(out: Path, ship: str = "", result: str = "") -> None:
    """Refuse a folder for results that is a file, that cannot be written to, or that holds the ship.

    Args:
        out: the folder.
        ship: that the command reads, where it writes one as well.
        result: name of the one that it writes.

    Raises:
        ValueError: names it.
    """
    if (
        ship
        and result
        and Path(ship).is_file()
        and Path(ship).resolve() == (out / result).resolve()
    ):
        raise ValueError(f"--out {out}: --ship {ship} would be replaced; give another folder")
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file; a folder is needed")
    check_writable(out, folder=True)


def check_pitch(ship: Ship, pitch: float | None) -> None:
    """Refuse a P/D that the ship's blades do not reach.

    Raises:
        ValueError: names the ship's range.
    """
    low, high = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max
    if pitch is not None and not low <= pitch <= high:
        raise ValueError(f"--pitch {pitch:g}: {ship.name} has P/D from {low:g} to {high:g}")


def say(text: str) -> None:
    """Print a text as it is: no colours, no folding, brackets left alone."""
    if (heard := told()) is not None:
        heard.said += text.strip().splitlines()
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def _each_once() -> Callable[..., None]:
    """Return a printer of warnings: one line each, without the place in the source, none repeated."""
    printed: set[str] = set()

    def in_one_line(message: Warning | str, *_: Any, **__: Any) -> None:
        text = " ".join(str(message).split())
        if text not in printed:
            printed.add(text)
            errors.print(f"[yellow]warning:[/] {escape(text)}", highlight=False, soft_wrap=True)

    return in_one_line


def _cut(line: str) -> str:
    """A line without the middle of what somebody gave at great length."""
    if len(line) <= 2 * _LONGEST:
        return line
    return f"{line[:_LONGEST]} ... {line[-_LONGEST:]}"


@contextmanager
def clear_errors() -> Iterator[None]:
    """Turn bad input and unwritable files into one message and exit code 2.

    Only what a user can mend is caught: errors that the package raises by intent are ValueErrors
    whose message was written for the reader.
    """
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _each_once()
            yield
    except (ValueError, OSError, MemoryError) as error:
        text = str(error) or "not enough memory"
        if isinstance(error, OSError) and error.strerror and error.filename is not None:
            text = f"{error.filename}: {error.strerror.lower()}"
        said = "\n".join(map(_cut, text.splitlines()))
        errors.print(f"[bold red]error:[/] {escape(said)}", highlight=False, soft_wrap=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        errors.print("stopped; what is finished is kept", highlight=False)
        raise typer.Exit(STOPPED) from None


@contextmanager
def needs(extra: str, what: str) -> Iterator[None]:
    """Say how to install what is missing; ``what`` needs an extra of the package."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{what} needs {error.name}, which is not installed: pip install 'shaftline[{extra}]'"
        ) from None


def print_table(frame: pd.DataFrame, title: str, digits: int = 2) -> None:
    """Print a table; floats rounded, missing ones as a dash; words stay whole where there is room."""
    if (heard := told()) is not None:
        heard.tables[title] = frame.to_dict(orient="records")  # type: ignore[assignment]

    def cell(value: Any) -> str:
        if isinstance(value, float):
            if pd.isna(value):
                return "–"
            return f"{value:.{digits}f}" if abs(value) < _LARGE else f"{value:.4g}"
        return str(value)

    texts = {str(name): [cell(value) for value in values] for name, values in frame.items()}
    words = [max(map(len, " ".join([name, *cells]).split())) for name, cells in texts.items()]
    spare = console.width - sum(words) - 3 * len(words) - 1  # beside the space between them
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
    console.print(table)
