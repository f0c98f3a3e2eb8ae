"""Progress of long work on the error stream: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

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
