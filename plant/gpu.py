"""Many ships on an NVIDIA GPU in calm water: the compiled step of the plant, one thread for each ship.

The kernels call the functions that also run on the CPU. The results differ by rounding errors, because
a GPU fuses products and sums and has its own elementary functions.

``pip install "numba-cuda[cu13]"`` (or ``[cu12]``, by the CUDA version of the driver) installs the
compiler; numba-cuda 0.30 needs NumPy below 2.5. The first step compiles the kernels in about 50 s.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import math
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.compiled import compiled
from . import expressions
from .dynamics import evaluate, evaluate_without_roll
from .memory import MEMORY
from .record import PLANT
from .ship import Ship
from .state import STATE
from .stepping import UNDISTURBED, constant_inputs, prepare, step
from .waves import SEA

cuda: Any = importlib.import_module("numba.cuda")  # has no types
_settings: Any = numba.config
_THREADS = 32  # of a block; a small batch is distributed over many processors of the GPU
_DRIVE, _PITCH, _RUDDER = range(3)  # rows of the commands


@compiled
def prepare_ship(
    i: int,
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    drive: NDArray[np.float64],
    dt: float,
) -> None:
    """Prepare ship ``i``; see :func:`advance_ship`."""
    plant = plants[i if len(plants) > 1 else 0]
    prepare(plant, states[i], memories[i], seas[0], drive[i], UNDISTURBED, dt)


@compiled
def advance_ship(
    i: int,
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    commands: NDArray[np.float64],
    steps: int,
    dt: float,
) -> None:
    """Advance ship ``i`` of a batch of n ships in calm water; states and memories change in place.

    Args:
        i: index of the ship.
        plants: PLANT array of shape (n,), or (1,) if all ships are equal.
        states: STATE array of shape (n,).
        memories: MEMORY array of shape (n,).
        seas: SEA array of shape (1,), a calm sea.
        commands: drive [mm | V | N m | rad/s], P/D [-] and rudder angle [rad], shape (3, n).
        steps: number of steps.
        dt: time step [s].
    """
    plant = plants[i if len(plants) > 1 else 0]
    drive, pitch, rudder = commands[_DRIVE, i], commands[_PITCH, i], commands[_RUDDER, i]
    acting = constant_inputs(drive, pitch, rudder, UNDISTURBED)
    for _ in range(steps):
        step(plant, states[i], memories[i], seas[0], acting, dt)


@cuda.jit
def _prepare_all(plants, states, memories, seas, drive, dt):  # type: ignore[no-untyped-def]
    i = cuda.grid(1)
    if i < len(states):
        prepare_ship(i, plants, states, memories, seas, drive, dt)


@cuda.jit
def _advance_all(plants, states, memories, seas, commands, steps, dt):  # type: ignore[no-untyped-def]
    i = cuda.grid(1)
    if i < len(states):
        advance_ship(i, plants, states, memories, seas, commands, steps, dt)


@functools.cache
def adapt_to_gpu() -> None:
    """Give the compiler of the GPU the few operations of the kernels that it does not have.

    Once in a process, before the kernels are compiled.
    """
    if _settings.ENABLE_CUDASIM:  # The simulator runs Python.
        return
    lower_builtin = importlib.import_module("numba.cuda.extending").lower_builtin

    def lower(ufunc: Any, function: Any) -> None:
        @lower_builtin(ufunc, numba.float64)  # type: ignore[untyped-decorator]
        def _(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return context.get_function(function, signature)(builder, arguments)

    lower(np.sqrt, math.sqrt)
    lower(np.exp, math.exp)
    lower(np.floor, math.floor)

    number: Any = numba.float64
    run, depth = expressions._run, expressions.MAX_DEPTH

    def on_a_stack(plant, signals, slot):  # type: ignore[no-untyped-def]
        stack = cuda.local.array(depth, number)  # A thread cannot allocate an array on the heap.
        constants = plant.term_constants[plant.term_owner[slot]]
        length = plant.term_length[slot]
        return run(stack, plant.term_code[slot], plant.term_index[slot], length, constants, signals)

    _replace(expressions._on_a_stack, on_a_stack)
    # Four inlined copies in a step take longer to compile than the calls take in a simulation.
    for kernel in (evaluate, evaluate_without_roll):
        _replace(kernel, kernel.py_func)  # type: ignore[attr-defined]


def _replace(kernel: Any, function: Any) -> None:
    """Use a function in place of a compiled one on the GPU, where numba-cuda keeps its own version."""
    kernel._CUDATypingContext__dispatcher = cuda.jit(device=True)(function)


def require_gpu() -> None:
    """Refuse to go on without an NVIDIA GPU and the compiler for it.

    Raises:
        RuntimeError: the message says which of them is missing.
    """
    if _settings.ENABLE_CUDASIM:
        return
    if importlib.util.find_spec("numba_cuda") is None:
        raise RuntimeError(
            'the compiler for the GPU is missing: pip install "numba-cuda[cu13]", or "numba-cuda[cu12]" '
            "for a driver of CUDA 12. On the CPU, shaftline.envs.FrigateVectorEnv simulates many ships"
        )
    if not cuda.is_available():
        raise RuntimeError(
            "no NVIDIA GPU with a driver is found (nvidia-smi lists them). Without a GPU, "
            "shaftline.envs.FrigateVectorEnv simulates many ships on all cores"
        )


class GpuBatch:
    """n ships on a GPU in calm water, each with its own state and commands.

    >>> import numpy as np
    >>> from shaftline.plant import equilibrium, load_ship
    >>> from shaftline.plant.gpu import GpuBatch
    >>> from shaftline.plant.state import STATE
    >>> frigate = load_ship("frigate")
    >>> states = np.zeros(10000, STATE)
    >>> states[:] = tuple(equilibrium(frigate, 22.0, 1.4).state)
    >>> pitch = np.random.default_rng(0).uniform(1.0, 1.5, 10000)
    >>> ships = GpuBatch(frigate, states, 22.0)  # doctest: +SKIP
    >>> ships.step(1200, 22.0, pitch)  # doctest: +SKIP
    >>> ships.states()["ship_speed"]  # doctest: +SKIP
    """

    def __init__(
        self, ship: Ship, states: NDArray[Any], drive: ArrayLike, plants: NDArray[Any] | None = None
    ) -> None:
        """Copy the ships to the GPU; their actuators and instruments start at rest.

        Args:
            ship: all ships, unless ``plants`` is given.
            states: initial states, STATE array of shape (n,).
            drive: drive command before the start [mm | V | N m | rad/s], a number or shape (n,).
            plants: parameters of each ship, PLANT array of shape (n,): changed copies of
                ``ship.record()``, with the same time step.

        Raises:
            RuntimeError: there is no GPU, or no compiler for it.
            ValueError: an argument has another dtype or shape, or a command is not finite.
            MemoryError: the ships do not fit into the memory of the GPU.
            ShipError: a term of the ship uses an external signal.
        """
        require_gpu()
        ship.require_external_signals(())
        self.n = _count("states", states, STATE)
        if plants is None:
            plants = np.full(1, ship.record(), PLANT)
        elif _count("plants", plants, PLANT) != self.n:
            raise ValueError(f"plants: {len(plants)} ships, but {self.n} states; give one for each")
        self._dt = ship.time_step_s
        need = plants.nbytes + self.n * (MEMORY.itemsize + STATE.itemsize + 32)
        free = cuda.current_context().get_memory_info().free
        if need > 0.95 * free:
            raise MemoryError(
                f"{self.n} ships need {need / 1e9:.3g} GB, but {free / 1e9:.3g} GB of the GPU's memory "
                "are free: simulate fewer ships at once"
            )
        adapt_to_gpu()
        command = cuda.to_device(self._per_ship("drive", drive))
        self._ships = (
            cuda.to_device(plants),
            cuda.to_device(np.ascontiguousarray(states)),
            cuda.device_array(self.n, MEMORY),
            cuda.to_device(np.zeros(1, SEA)),
        )
        _prepare_all[self._blocks, _THREADS](*self._ships, command, self._dt)

    @property
    def _blocks(self) -> int:
        return -(-self.n // _THREADS)

    def step(
        self, steps: int, drive: ArrayLike, pitch_ratio: ArrayLike, rudder: ArrayLike = 0.0
    ) -> None:
        """Advance all ships by a number of time steps of the ship, with constant commands.

        The call returns before the GPU has finished; :meth:`states` waits for it. A ship that diverges
        has states that are not finite.

        Args:
            steps: number of time steps, at least 1.
            drive: drive command [mm | V | N m | rad/s], a number or shape (n,).
            pitch_ratio: commanded P/D [-], a number or shape (n,).
            rudder: commanded rudder angle [rad], a number or shape (n,).

        Raises:
            ValueError: the number of steps is below 1, or a command has another shape or is not finite.
        """
        if steps < 1:
            raise ValueError(f"steps = {steps!r}: must be a whole number of at least 1")
        rows = {"drive": drive, "pitch_ratio": pitch_ratio, "rudder": rudder}
        commands = np.stack([self._per_ship(name, values) for name, values in rows.items()])
        _advance_all[self._blocks, _THREADS](
            *self._ships, cuda.to_device(commands), int(steps), self._dt
        )

    def states(self) -> NDArray[Any]:
        """Return a copy of the present states, STATE array of shape (n,)."""
        return np.asarray(self._ships[1].copy_to_host())

    def _per_ship(self, name: str, values: ArrayLike) -> NDArray[np.float64]:
        """Return a command of each ship, shape (n,)."""
        given = np.asarray(values, np.float64)
        if given.shape not in ((), (self.n,)):
            raise ValueError(
                f"{name}: shape {given.shape}; give a number, or {self.n} for the ships"
            )
        if not np.isfinite(given).all():
            raise ValueError(f"{name}: must be finite")
        return np.full(self.n, given)


def _count(name: str, records: NDArray[Any], dtype: np.dtype[Any]) -> int:
    """Return the number of records of an array with a given dtype."""
    if records.dtype != dtype or records.ndim != 1 or len(records) == 0:
        raise ValueError(
            f"{name}: must be a one-dimensional array of the plant's dtype with at least one record, "
            f"not {records.dtype.kind!r} of shape {records.shape}"
        )
    return len(records)
