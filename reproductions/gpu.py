"""Measure plant steps per second on an NVIDIA GPU beside the CPU, and the difference of the states.

Run ``python -m reproductions gpu --out DIR``. All rates are of one run on one machine.
"""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numba import cuda
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.plant import Ship, load_ship
from shaftline.plant.gpu import GpuBatch, advance_ship, prepare_ship, require_gpu
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE
from shaftline.plant.waves import SEA

from .pages import make_parser, write_page

VESSEL, DRIVE, PITCH = "frigate", (16.0, 26.0), (1.0, 1.5)
"""Ship, and the ranges of its commands: fuel rack [mm] and P/D [-]."""

START = {"pitch_ratio": 1.3, "shaft_speed": 10.0, "ship_speed": 8.0}
"""Initial states [-], [rad/s], [m/s] of all ships; all other states are 0."""

SIZES, OWN = (1_000, 10_000, 100_000, 1_000_000), 100_000
"""Ships on the GPU, and the number of them in the batch where each has its own parameters."""

STEPS, REPEATS = 200, 3
CPU_SHIPS = 1024  # of each core
COMPARED = 1000  # ships whose states are compared
COLUMNS = {
    "program": "program",
    "ships": "ships",
    "steps/s": "steps/s",
    "ratio": "per step on one core",
    "to_gpu_s": "begin, s",
    "from_gpu_s": "read the states, s",
    "difference": "difference",
}


@compiled
def _advance_range(
    first: int,
    last: int,
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    commands: NDArray[np.float64],
    steps: int,
    dt: float,
) -> None:
    """Advance ships ``first`` to ``last`` on the CPU; see :func:`advance_ship`."""
    for i in range(first, last):
        advance_ship(i, plants, states, memories, seas, commands, steps, dt)


@compiled
def _prepare_range(
    plants: Any, states: Any, memories: Any, seas: Any, drive: NDArray[np.float64], dt: float
) -> None:
    """Prepare all ships on the CPU; see :func:`prepare_ship`."""
    for i in range(len(states)):
        prepare_ship(i, plants, states, memories, seas, drive, dt)


class CpuBatch:
    """The ships of a GpuBatch on the CPU, shared by threads."""

    def __init__(self, ship: Ship, states: NDArray[Any], drive: NDArray[np.float64]) -> None:
        n = len(states)
        self._dt = ship.time_step_s
        self._ships = (
            np.full(1, ship.record(), PLANT),
            states.copy(),
            np.zeros(n, MEMORY),
            np.zeros(1, SEA),
        )
        _prepare_range(*self._ships, drive, self._dt)

    def step(self, steps: int, commands: NDArray[np.float64], threads: int = 1) -> None:
        """Advance all ships by a number of steps; ``commands`` has shape (3, n)."""
        bounds = np.linspace(0, commands.shape[1], threads + 1).astype(int)

        def share(first: int, last: int) -> None:
            _advance_range(int(first), int(last), *self._ships, commands, steps, self._dt)

        if threads == 1:
            share(0, commands.shape[1])
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(share, bounds[:-1], bounds[1:]))

    def states(self) -> NDArray[Any]:
        """Return the present states, STATE array of shape (n,)."""
        return self._ships[1]


def draw(n: int) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return equal initial states and the commands of n ships, shape (3, n).

    The commands of ship i are the same in a batch of any size.
    """
    states = np.zeros(n, STATE)
    for name, value in START.items():
        states[name] = value
    uniform = np.random.default_rng(0).random((n, 2))
    commands = np.zeros((3, n))
    for row, (low, high) in enumerate((DRIVE, PITCH)):
        commands[row] = low + (high - low) * uniform[:, row]
    return states, commands


def difference(ours: NDArray[Any], reference: NDArray[Any]) -> float:
    """Return the largest difference of any state, relative to the largest size of that state."""
    worst = 0.0
    for name in STATE.names or ():
        size = float(np.abs(reference[name]).max())
        if size > 0.0 or ours[name].any():
            apart = float(np.abs(ours[name] - reference[name]).max())
            worst = max(worst, apart / size if size > 0.0 else np.inf)
    return worst


def seconds(work: Callable[[], object]) -> float:
    """Return the seconds that a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure_cpu(ship: Ship, threads: int) -> dict[str, object]:
    """Return the rate of the CPU with a number of threads."""
    n = CPU_SHIPS * threads
    states, commands = draw(n)
    ships = CpuBatch(ship, states, commands[0])
    ships.step(1, commands, threads)
    best = min(seconds(lambda: ships.step(STEPS, commands, threads)) for _ in range(REPEATS))
    name = "CPU, 1 core" if threads == 1 else f"CPU, {threads} cores"
    return {"program": name, "ships": n, "steps/s": n * STEPS / best}


def measure_gpu(
    ship: Ship, n: int, reference: NDArray[Any], own: bool = False
) -> dict[str, object]:
    """Return rate, seconds of the transfers and difference of the states of a batch on the GPU.

    ``reference`` holds the states of the first ships after all steps, on the CPU; ``own`` gives each
    ship a copy of the parameters.
    """
    states, commands = draw(n)
    plants = np.full(n, ship.record(), PLANT) if own else None
    start = time.perf_counter()
    ships = GpuBatch(ship, states, commands[0], plants)
    cuda.synchronize()  # type: ignore[no-untyped-call]
    begin = time.perf_counter() - start

    def work() -> None:
        ships.step(STEPS, *commands)
        cuda.synchronize()  # type: ignore[no-untyped-call]

    work()
    best = min(seconds(work) for _ in range(REPEATS))
    start = time.perf_counter()
    found = ships.states()
    read = time.perf_counter() - start
    if not all(np.isfinite(found[name]).all() for name in STATE.names or ()):
        raise SystemExit(f"GPU, {n} ships: a state is not finite")
    k = min(n, len(reference))
    return {
        "program": "GPU, own parameters of each ship" if own else "GPU",
        "ships": n,
        "steps/s": n * STEPS / best,
        "to_gpu_s": begin,
        "from_gpu_s": read,
        "difference": difference(found[:k], reference[:k]),
    }


def simulate_reference(ship: Ship) -> NDArray[Any]:
    """Return the states of the compared ships after the steps of :func:`measure_gpu`, on the CPU."""
    states, commands = draw(COMPARED)
    ships = CpuBatch(ship, states, commands[0])
    for _ in range(1 + REPEATS):
        ships.step(STEPS, commands)
    return ships.states()


def _warm_gpu(ship: Ship) -> float:
    """Compile the kernels of the GPU; return the seconds."""
    states, commands = draw(1)

    def work() -> None:
        GpuBatch(ship, states, commands[0]).step(1, *commands)
        cuda.synchronize()  # type: ignore[no-untyped-call]

    return seconds(work)


def measure(sizes: Sequence[int] = SIZES, own: int = OWN) -> tuple[pd.DataFrame, dict[str, float]]:
    """Return the table of the page, and the seconds of the parts of the measurement.

    Another process compiles for the CPU, into the cache on disk, while this one compiles for the GPU.
    """
    ship = load_ship(VESSEL)
    start = time.perf_counter()
    with ProcessPoolExecutor(1, get_context("spawn")) as other:
        reference = other.submit(simulate_reference, ship)
        gpu_compiled = _warm_gpu(ship)
        print(f"compiled for the GPU in {gpu_compiled:.1f} s", flush=True)
        states = reference.result()
        print(f"compiled for both in {time.perf_counter() - start:.1f} s", flush=True)
    rows: list[dict[str, object]] = []
    jobs: list[Callable[[], dict[str, object]]] = [
        lambda: measure_cpu(ship, 1),
        lambda: measure_cpu(ship, os.cpu_count() or 1),
        *(functools.partial(measure_gpu, ship, n, states) for n in sizes),
        functools.partial(measure_gpu, ship, own, states, own=True),
    ]
    for job in jobs:
        try:
            rows.append(job())
        except MemoryError as error:
            print(f"left out: {error}", flush=True)
        else:
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    table["ratio"] = table["steps/s"] / table["steps/s"].iloc[0]
    times = {"compile_s": gpu_compiled, "total_s": time.perf_counter() - start}
    return table[list(COLUMNS)], times


def machine() -> str:
    """Return the names of GPU and compiler."""
    try:
        name = cuda.get_current_device().name  # type: ignore[no-untyped-call]
    except AttributeError:
        name = "numba's simulator of a GPU"
    name = name.decode() if isinstance(name, bytes) else str(name)
    compiler = [f"{p} {metadata.version(p)}" for p in ("numba", "numba-cuda") if _is_installed(p)]
    return f"{name}, {os.cpu_count()} CPU cores, {', '.join(compiler)}, NumPy {np.__version__}"


def _is_installed(package: str) -> bool:
    return any(metadata.distributions(name=package))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, and write ``gpu.md`` and ``gpu.csv``."""
    parser = make_parser("gpu", __doc__, "out/gpu")
    parser.add_argument(
        "--ships", type=int, nargs="+", default=SIZES, help="numbers of ships on the GPU"
    )
    options = parser.parse_args(arguments)
    if min(options.ships) < 1:
        parser.error("--ships: each number must be at least 1")
    try:
        require_gpu()
    except RuntimeError as error:
        parser.error(str(error))
    print(machine(), flush=True)
    seconds_per_call = STEPS * load_ship(VESSEL).time_step_s
    table, times = measure(options.ships, min(OWN, max(options.ships)))
    shown = table.rename(columns=COLUMNS)
    shown["steps/s"] = shown["steps/s"].map("{:,.0f}".format)
    shown["ships"] = shown["ships"].map("{:,}".format)
    shown["difference"] = table["difference"].map(lambda x: "" if np.isnan(x) else f"{x:.1e}")
    write_page(
        options.out, "gpu", "Plant steps on a GPU", "gpu --out docs/results", table,
        Path(__file__).with_name("gpu.md"), rates=shown, machine=machine(), vessel=VESSEL,
        drive=DRIVE, pitch=PITCH, start=START, steps=STEPS, compared=COMPARED,
        seconds=seconds_per_call, all_seconds=(1 + REPEATS) * seconds_per_call, **times,
    )  # fmt: skip
    print((options.out / "gpu.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
