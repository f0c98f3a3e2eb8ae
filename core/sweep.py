"""Many independent cells, spread over the cores of a machine or a cluster; finished ones are kept.

The one way in which evaluations, proofs, trainings over seeds and folders of recordings are spread. A
result depends on its cell alone, never on how many were worked on at once, or where.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import joblib
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import BrokenProcessPool

from .files import read_json, write_text

BACKENDS = ("processes", "dask")

_WATCH, _WATCH_S = "shaftline watches its parent", 1.0  # name and pace of a worker's watch

_PATIENCE_S = 10.0  # for a scheduler to answer and for its first worker

Cell = TypeVar("Cell")
Found: TypeAlias = tuple[str, str, str | None]
"""Name of a cell, its result as JSON and, where there is none, why: a traceback."""


class SweepError(ValueError):
    """A sweep that cannot be spread as asked, or cells that failed; the message says which."""


def sweep(
    work: Callable[[Cell], Any],
    cells: Mapping[str, Cell],
    folder: Path,
    *,
    jobs: int | None = None,
    backend: str = "processes",
    scheduler: str | None = None,
    tick: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Work on every cell whose result does not stand in the folder.

    Results are written by this process, each as soon as it arrives: workers need no shared disk, and
    whatever stops the sweep (Ctrl-C, a cell that fails), what is finished is found by the next one.

    Args:
        work: from a cell to its result, which must be fit for JSON; carried to other processes by
            cloudpickle.
        cells: by name, which is the result's file name; whatever changes the result belongs into it.
        folder: where ``NAME.json`` of each cell is kept.
        jobs: processes on this machine, by default as many as its cores; 1 works in this process.
        backend: one of :data:`BACKENDS`.
        scheduler: address of a dask scheduler, such as ``tcp://10.0.0.1:8786``.
        tick: called for each cell that is finished or found finished.

    Returns:
        Results by name in the order of the cells, as read from their files.

    Raises:
        SweepError: a backend that is not there, or cells whose work raised; all others are finished
            first, and the traceback of each stands in ``NAME.error.txt``.
    """
    check_backend(jobs, backend, scheduler)
    paths = {name: folder / f"{name}.json" for name in cells}
    missing = {name: cell for name, cell in cells.items() if not paths[name].is_file()}
    for _ in range(len(cells) - len(missing)):
        tick()
    failed = {}
    jobs = min(jobs or joblib.cpu_count(), len(missing))
    finished = _cluster(work, missing, scheduler) if scheduler else _machine(work, missing, jobs)
    for name, result, error in finished if missing else ():
        note = folder / f"{name}.error.txt"
        if error is None:
            write_text(paths[name], result)
            note.unlink(missing_ok=True)
        else:
            write_text(note, error)
            failed[name] = f"{error.splitlines()[-1]} (traceback: {note})"
        tick()
    if failed:
        first = "\n".join(f"{name}: {error}" for name, error in list(failed.items())[:3])
        raise SweepError(
            f"{len(failed)} of {len(cells)} cells failed, the others are kept in {folder}; {first}"
        )
    return {name: read_json(path) for name, path in paths.items()}


def _watched(home: int) -> None:
    """In a worker, from its birth: leave Ctrl-C to the process that began it, and go when that has gone.

    Args:
        home: number of that process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == home:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, name=_WATCH, daemon=True).start()


def _attempt(work: Callable[[Cell], Any], name: str, cell: Cell) -> Found:
    """One bad cell does not stop the rest."""
    try:
        return name, json.dumps(work(cell), allow_nan=False), None
    except Exception as error:
        return name, "", "".join(traceback.format_exception(error))


def check_backend(jobs: int | None, backend: str, scheduler: str | None) -> None:
    """Refuse options of :func:`sweep` that contradict each other, before anything is worked on.

    Raises:
        SweepError: names the option.
    """
    if backend not in BACKENDS:
        raise SweepError(f"--backend {backend}: known are {', '.join(BACKENDS)}")
    if jobs is not None and jobs < 1:
        raise SweepError(f"--jobs {jobs}: at least one process is needed")
    if backend == "dask" and scheduler is None:
        raise SweepError(
            "--backend dask: give the cluster's address as --scheduler, such as tcp://10.0.0.1:8786 "
            "(`dask scheduler` prints it when it starts)"
        )
    if backend != "dask" and scheduler is not None:
        raise SweepError(f"--scheduler {scheduler}: needs --backend dask")
    if backend == "dask" and jobs is not None:
        raise SweepError(
            f"--jobs {jobs}: counts processes on this machine; with --backend dask every worker of the "
            "scheduler is used"
        )


def _machine(work: Callable[[Cell], Any], cells: Mapping[str, Cell], jobs: int) -> Iterator[Found]:
    """Findings of the processes of this machine, in the order in which they are finished."""
    # one cell at a time for each process: a batch would hold finished cells back
    parallel = joblib.Parallel(
        jobs,
        return_as="generator_unordered",
        batch_size=1,
        initializer=_watched,
        initargs=(os.getpid(),),
    )
    try:
        with warnings.catch_warnings():
            # loky replaces a process whose memory has grown; no cell is lost by it
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            tasks = (joblib.delayed(_attempt)(work, *item) for item in cells.items())
            yield from parallel(tasks)
    except KeyboardInterrupt:
        get_reusable_executor(kill_workers=True).shutdown(wait=False, kill_workers=True)
        raise
    except BrokenProcessPool as error:
        why = str(error).split(". ")[0].strip()
        raise SweepError(
            f"the processes broke down ({why}); finished cells are kept, and --jobs 1 needs no others"
        ) from None


def _cluster(
    work: Callable[[Cell], Any], cells: Mapping[str, Cell], scheduler: str
) -> Iterator[Found]:
    """Findings of a dask cluster, in the order in which they are finished.

    Spoken to directly: joblib's own dask backend waits for ever for a cell whose worker died or lacks
    this package (joblib 1.6).
    """
    with _client(scheduler) as (client, as_completed):
        names = {
            client.submit(_attempt, work, name, cell, pure=False): name
            for name, cell in cells.items()
        }
        for future in as_completed(names):
            error = future.exception()  # of the cluster; the work's own is among the findings
            lost = f"on the cluster, {type(error).__name__}: {' '.join(str(error).split())}"
            name = names.pop(future)  # lets the cluster forget the result
            yield (name, "", lost) if error else future.result()


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """A connection to a dask scheduler that has workers, and distributed's ``as_completed``."""
    try:
        import distributed
    except ImportError:
        raise SweepError(
            "--backend dask: needs an extra, `pip install 'shaftline[cluster]'`"
        ) from None
    try:
        client: Any = distributed.Client(address, timeout=_PATIENCE_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise SweepError(f"--scheduler {address}: no dask scheduler answers ({error})") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError:
            raise SweepError(
                f"--scheduler {address}: has no workers; start some with `dask worker {address}`"
            ) from None
        yield client, distributed.as_completed


def digest_of(text: str) -> str:
    """Eight letters that change with a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:8]


@functools.cache
def source_digest(*places: str) -> str:
    """Eight letters that change with the package's source and data in some folders or files.

    Cells carry them in their name, so that none outlives the equations that made it.
    """
    house = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for place in places:
        root = house / place
        files = [root] if root.is_file() else sorted(root.rglob("*"))
        for file in files:
            if file.suffix in (".py", ".toml", ".csv"):
                digest.update(file.relative_to(house).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:8]


def refuse_another(folder: Path, note: Path, plan: Mapping[str, Any], what: str) -> None:
    """Refuse to mix the results of two plans in one folder.

    Args:
        folder: that would hold both, for the message.
        note: where the plan of what is there was written, if anything is.
        plan: by key, fit for JSON.
        what: a result is called.

    Raises:
        ValueError: the first key in which the plans differ.
    """
    if not note.is_file():
        return
    kept = read_json(note)
    for key, value in json.loads(json.dumps(plan)).items():
        if kept.get(key) != value:
            raise ValueError(
                f"{folder}: holds a {what} of another {key} ({_difference(kept.get(key), value)}); "
                "remove it or give another folder"
            )


def _difference(kept: Any, now: Any) -> str:
    """Return the first values that differ between two plans, with their key where they are nested."""
    if isinstance(kept, dict) and isinstance(now, dict):
        key = next(key for key in {**kept, **now} if kept.get(key) != now.get(key))
        return f"{key}: {_difference(kept.get(key), now.get(key))}"
    return f"{kept}, now {now}"
