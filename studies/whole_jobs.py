"""Whole jobs as a user meets them, each a command in a process of its own, timed from outside."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..core.files import write_atomically
from ..plant import Schedule, equilibrium, load_ship, simulate
from ..plant.signals import SIGNALS

Numbers: TypeAlias = NDArray[np.float64]

MINUTES, INTERVAL_S = 20, 0.1
"""Of the recording that is diagnosed."""

COMMAND = (sys.executable, "-c", "from shaftline.cli.main import main; main()")
_SHORT_REPEATS = 3


def fouled_recording(file: Path) -> None:
    """A frigate whose hull is fouled by a tenth, with steps of rack and pitch, as a recording.

    Args:
        file: CSV to write.
    """
    ship = load_ship("frigate").with_values({"hull.fouling_fraction": 0.1})
    rng = np.random.default_rng(0)
    racks, pitches = rng.uniform(18.0, 26.0, MINUTES), rng.uniform(1.15, 1.4, MINUTES)

    def stepped(levels: Numbers, shift: float) -> Callable[[Numbers], Numbers]:
        return lambda t: levels[np.clip(((t + shift) / 60.0).astype(int), 0, MINUTES - 1)]

    start = equilibrium(ship, float(racks[0]), float(pitches[0])).state
    run = simulate(
        ship, Schedule(stepped(racks, 0.0), stepped(pitches, 30.0)), 60.0 * MINUTES, initial=start
    )
    kept = run[:: round(INTERVAL_S / ship.time_step_s)]
    table = {s.column: kept[s.name] for s in SIGNALS if s.source != "truth"}
    wanted = (
        "time_s", "fuel_rack_mm", "pitch_ratio_command", "pitch_ratio", "shaft_speed_rad_s",
        "shaft_torque_N_m", "ship_speed_m_s",
    )  # fmt: skip
    columns = np.column_stack([table[name] for name in wanted])
    noise = rng.standard_normal(columns.shape) * [0.0, 0.0, 0.0, 2e-3, 5e-3, 600.0, 0.01]
    write_atomically(
        file,
        lambda f: np.savetxt(
            f, columns + noise, delimiter=",", header=",".join(wanted), comments=""
        ),
    )


def timed(command: tuple[str, ...], repeats: int = 1) -> float:
    """Median time of a command [s].

    Args:
        command: with its arguments.
        repeats: how often it is run.

    Raises:
        subprocess.CalledProcessError: the command failed.
    """
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def measure() -> list[tuple[str, float]]:
    """Seconds of every job, by its label; kernels are compiled before."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording = folder / "recording.csv"
        fouled_recording(recording)
        sail = (*COMMAND, "simulate", "--case", "jonswap", "--out", str(folder / "run.csv"))
        asked = ("--ship", "frigate", "--out", str(folder / "diagnosis"))
        learn = (
            "--task", "rough-sea", "--timesteps", "20000", "--envs", "32", "--plans", "0", "--out",
        )  # fmt: skip
        timed(sail)
        return [
            ("`shaftline --help`", timed((*COMMAND, "--help"), _SHORT_REPEATS)),
            ("`import shaftline.plant`",
             timed((sys.executable, "-c", "import shaftline.plant"), _SHORT_REPEATS)),
            ("`shaftline simulate --case jonswap`, 300 s at sea", timed(sail, _SHORT_REPEATS)),
            (f"`shaftline diagnose`, {MINUTES} minutes at {1 / INTERVAL_S:g} Hz, a fouled hull",
             timed((*COMMAND, "diagnose", str(recording), *asked))),
            ("`shaftline train`, 20,000 intervals",
             timed((*COMMAND, "train", *learn, str(folder / "training")))),
        ]  # fmt: skip
