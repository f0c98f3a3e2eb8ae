"""``shaftline prepare``: compile the equations in advance, on all cores."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from tempfile import TemporaryDirectory

from .console import Jobs, progress, report_errors, say
from .machine import add_results

RUNS: dict[str, tuple[str, ...]] = {
    "evaluate": ("evaluate", "--task", "rough-sea", "--seeds", "1", "--controller", "combinator"),
    "diagnose": ("diagnose", "--example"),
    "manoeuvre": ("manoeuvre", "--ship", "frigate-turning", "--speed", "8"),
    "simulate": ("simulate", "--case", "jonswap"),
}
"""Small runs of the commands that compile most, the longest first."""


PROGRAM = "from shaftline.cli.main import main; main()"


def _run(arguments: tuple[str, ...], folder: Path) -> float:
    """Run a command of this program in another process, and return how long it took [s].

    Raises:
        ValueError: the command fails.
    """
    begun = time.monotonic()
    command = [sys.executable, "-c", PROGRAM, *arguments, "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"shaftline {' '.join(arguments)} fails: {done.stderr.strip()}")
    return time.monotonic() - begun


def prepare(jobs: Jobs = None) -> None:
    """Compile the equations in advance, so that the first use of a command is as fast as the next.

    Small runs of evaluate, diagnose, manoeuvre and simulate compile what these and most other commands
    need, on all cores. This takes a minute or two, once for each version of the package; otherwise each
    command compiles at its first use.

    Examples:
        shaftline prepare

        shaftline prepare --jobs 1
    """
    with report_errors(), TemporaryDirectory() as folder:
        times: dict[str, float] = {}
        with (
            progress("compiling the equations", len(RUNS)) as tick,
            ThreadPoolExecutor(jobs or os.cpu_count()) as pool,
        ):
            runs = {pool.submit(_run, RUNS[name], Path(folder) / name): name for name in RUNS}
            for done in as_completed(runs):
                times[runs[done]] = done.result()
                tick()
        say("\n".join(f"{name}: {seconds:.0f} s" for name, seconds in times.items()))
        add_results({"seconds": times})
