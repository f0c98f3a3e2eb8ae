"""Sweeps: many independent cells, distributed over the cores of a machine or a cluster, and resumable.

Evaluations, validations, trainings over seeds and folders of recordings all use it. A result depends on
its cell only, never on the number or place of the processes.
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

from .files import read_json, write_text

BACKENDS = ("processes", "dask")

_WATCH, _WATCH_S = "shaftline watches its parent", 1.0  # name and interval of a worker's thread

_PATIENCE_S = 10.0  # timeout for a scheduler and for its first worker [s]

Cell = TypeVar("Cell")
CellResult: TypeAlias = tuple[str, str, str | None]
"""Name of a cell, its result as JSON, and the traceback if it failed."""


class SweepError(ValueError):
    """A sweep that cannot be distributed as requested, or failed cells; the message says which."""


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
    """Compute every cell whose result is not yet in the folder; return all results by name.

    This process writes each result as soon as it arrives. So workers need no shared disk, and a sweep
    that was stopped (Ctrl-C, a failed cell) continues from its finished cells.

    Args:
        work: function from a cell to its result, which must be JSON data; sent to other processes by
            cloudpickle.
        cells: cells by name, which is also the file name; it must include everything that changes the
            result.
        folder: folder of the files ``NAME.json``, from which the results are read.
        jobs: processes on this machine, by default one for each core; 1 computes in this process.
        backend: one of :data:`BACKENDS`.
        scheduler: address of a dask scheduler, such as ``tcp://10.0.0.1:8786``.
        tick: called for each cell that is finished, now or before.

    Raises:
        SweepError: an unavailable backend, or failed cells; all other cells are finished first, and the
            traceback of each failed cell is in ``NAME.error.txt``.
    """
    check_backend(jobs, backend, scheduler)
    paths = {name: folder / f"{name}.json" for name in cells}
    missing = {name: cell for name, cell in cells.items() if not paths[name].is_file()}
    for _ in range(len(cells) - len(missing)):
        tick()
    failed = {}
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
            f"{len(failed)} of {len(cells)} cells failed; the others are stored in {folder}; {first}"
        )
    return {name: read_json(path) for name, path in paths.items()}


def _watch_parent(home: int) -> None:
    """Make a worker ignore Ctrl-C and exit when its parent process has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == home:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, name=_WATCH, daemon=True).start()


def _attempt(work: Callable[[Cell], Any], name: str, cell: Cell) -> CellResult:
    """Compute one cell; return an error instead of raising it, so that the other cells continue."""
    try:
        return name, json.dumps(work(cell), allow_nan=False), None
    except Exception as error:
        return name, "", "".join(traceback.format_exception(error))


def check_backend(jobs: int | None, backend: str, scheduler: str | None) -> None:
    """Refuse contradictory options of :func:`sweep` with a SweepError, before any computation."""
    if backend not in BACKENDS:
        raise SweepError(f"--backend {backend} is unknown; known backends: {', '.join(BACKENDS)}")
    if jobs is not None and jobs < 1:
        raise SweepError(f"--jobs {jobs}: must be at least 1")
    if backend == "dask" and scheduler is None:
        raise SweepError(
            "--backend dask: give the cluster's address as --scheduler, such as tcp://10.0.0.1:8786 "
            "(`dask scheduler` prints it when it starts)"
        )
    if backend != "dask" and scheduler is not None:
        raise SweepError(f"--scheduler {scheduler}: requires --backend dask")
    if backend == "dask" and jobs is not None:
        raise SweepError(
            f"--jobs {jobs}: applies to processes on this machine; --backend dask uses every worker of "
            "the scheduler, so leave --jobs out"
        )


def _machine(
    work: Callable[[Cell], Any], cells: Mapping[str, Cell], jobs: int | None
) -> Iterator[CellResult]:
    """Yield the results of processes on this machine, in the order of their completion."""
    import joblib  # Many commands import this module and distribute nothing.
    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.process_executor import BrokenProcessPool

    jobs = min(jobs or joblib.cpu_count(), len(cells))
    # A batch size above 1 would hold finished cells back.
    parallel = joblib.Parallel(
        jobs,
        return_as="generator_unordered",
        batch_size=1,
        initializer=_watch_parent,
        initargs=(os.getpid(),),
    )
    try:
        with warnings.catch_warnings():
            # loky replaces a process whose memory has grown; no cell is lost.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            tasks = (joblib.delayed(_attempt)(work, *item) for item in cells.items())
            yield from parallel(tasks)
    except KeyboardInterrupt:
        get_reusable_executor(kill_workers=True).shutdown(wait=False, kill_workers=True)
        raise
    except BrokenProcessPool as error:
        why = f"({str(error).split('. ')[0].strip()}); finished cells are kept; try --jobs 1"
        raise SweepError(f"the worker processes stopped {why}") from None


def _cluster(
    work: Callable[[Cell], Any], cells: Mapping[str, Cell], scheduler: str
) -> Iterator[CellResult]:
    """Yield the results of a dask cluster, in the order of their completion.

    dask is used directly: joblib's dask backend waits for ever for a cell whose worker died or lacks
    this package (joblib 1.6).
    """
    with _client(scheduler) as (client, as_completed):
        names = {
            client.submit(_attempt, work, name, cell, pure=False): name
            for name, cell in cells.items()
        }
        for future in as_completed(names):
            error = future.exception()  # of the cluster; errors of the work are part of the result
            lost = f"on the cluster, {type(error).__name__}: {' '.join(str(error).split())}"
            name = names.pop(future)  # The cluster can then release the result.
            yield (name, "", lost) if error else future.result()


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """Connect to a dask scheduler with workers; yield the client and distributed's ``as_completed``."""
    try:
        import distributed
    except ImportError:
        needed = "requires an extra, `pip install 'shaftline[cluster]'`"
        raise SweepError(f"--backend dask: {needed}") from None
    try:
        client: Any = distributed.Client(address, timeout=_PATIENCE_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        silent = f"no dask scheduler responds ({error}); check the address"
        raise SweepError(f"--scheduler {address}: {silent}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError:
            empty = f"has no workers; start some with `dask worker {address}`"
            raise SweepError(f"--scheduler {address}: {empty}") from None
        yield client, distributed.as_completed


def digest_of(text: str) -> str:
    """Return eight characters that change with a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:8]


@functools.cache
def source_digest(*places: str) -> str:
    """Return eight characters that change with the source and data of the package in folders or files.

    Names of cells include them, so that no result outlives the equations that produced it.
    """
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for place in places:
        root = package / place
        files = [root] if root.is_file() else sorted(root.rglob("*"))
        for file in files:
            if file.suffix in (".py", ".toml", ".csv"):
                digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:8]


def refuse_other_plan(folder: Path, note: Path, plan: Mapping[str, Any], what: str) -> None:
    """Refuse to mix the results of two plans in one folder.

    ``note`` is the file with the plan of the existing results, if there are any; ``plan`` is the new
    plan by key, as JSON data; ``what`` names a result. The ValueError gives the first key in which they
    differ.
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
    """Return the first values that differ between two plans, with their key if they are nested."""
    if isinstance(kept, dict) and isinstance(now, dict):
        key = next(key for key in {**kept, **now} if kept.get(key) != now.get(key))
        return f"{key}: {_difference(kept.get(key), now.get(key))}"
    return f"{kept}, now {now}"
