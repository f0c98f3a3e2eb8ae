"""Ships on a GPU: in numba's simulator, and compiled for a GPU where numba-cuda is installed."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest
from numba import cuda

from shaftline.plant import load_ship
from shaftline.plant.gpu import GpuBatch
from shaftline.plant.state import STATE

# The simulator passes wrapped arrays, which compiled functions refuse: unwrap them.
SIMULATED = """
import numpy as np
from shaftline.plant import gpu, load_ship
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, constant_inputs, prepare, step
from shaftline.plant.waves import calm_sea


def bare(x):
    while type(x).__name__.startswith("Fake"):
        x = x._ary if hasattr(x, "_ary") else x._item
    return x


def unwrapped(kernel):
    return lambda i, *arguments: kernel(i, *map(bare, arguments))


gpu.prepare_ship, gpu.advance_ship = unwrapped(gpu.prepare_ship), unwrapped(gpu.advance_ship)
ship, n = load_ship("frigate-turning"), 35  # more than one block of threads, the last one not full
rng = np.random.default_rng(1)
states = np.zeros(n, STATE)
states["pitch_ratio"], states["shaft_speed"] = 1.3, 10.0
states["ship_speed"] = rng.uniform(7.0, 9.0, n)
drive, pitch, rudder = rng.uniform([[18.0], [1.0], [-0.3]], [[26.0], [1.5], [0.3]], (3, n))
plants = np.full(n, ship.record(), PLANT)
plants["mass"] *= rng.uniform(0.8, 1.2, n)
for own in (None, plants):
    batch = gpu.GpuBatch(ship, states, drive, own)
    batch.step(30, drive, pitch, rudder)
    batch.step(10, drive, 1.2)
    found = batch.states()
    for i in range(n):
        plant = ship.record() if own is None else own[i]
        state, memory, sea = states[i].copy(), np.zeros(1, MEMORY)[0], calm_sea()
        dt = ship.time_step_s
        prepare(plant, state, memory, sea, drive[i], UNDISTURBED, dt)
        for k in range(40):
            p, r = (pitch[i], rudder[i]) if k < 30 else (1.2, 0.0)
            acting = constant_inputs(drive[i], p, r, UNDISTURBED)
            step(plant, state, memory, sea, acting, dt)
        assert found[i] == state, (i, found[i], state)
    assert len(np.unique(found["ship_speed"])) == n
for arguments, reason in (
    ((ship, states, drive[:3]), "drive: shape (3,); give a number, or 35"),
    ((ship, states, np.nan), "drive: must be finite"),
    ((ship, np.zeros(3), 22.0), "states: must be a one-dimensional array"),
    ((ship, states, 22.0, plants[:2]), "plants: 2 ships, but 35 states"),
):
    try:
        gpu.GpuBatch(*arguments)
    except ValueError as error:
        assert reason in str(error), error
    else:
        raise AssertionError(reason)
print("equal")
"""


def test_simulated_gpu_gives_the_states_of_the_cpu() -> None:
    """Own commands and parameters of 35 ships, bit for bit; wrong arguments are refused."""
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", SIMULATED],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.stdout == "equal\n", done.stderr


COMPILED = """
import numba.cuda.dispatcher
from numba import cuda, float64, from_dtype, int64, types
from shaftline.plant import gpu
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE
from shaftline.plant.waves import SEA


class Device:
    compute_capability = 9, 0


numba.cuda.dispatcher.get_current_device = Device
gpu.adapt_to_gpu()
ships = [types.Array(from_dtype(d), 1, "C") for d in (PLANT, STATE, MEMORY, SEA)]
signature = (*ships, types.Array(float64, 2, "C"), int64, float64)
text, _ = cuda.compile(gpu._advance_all.py_func, signature, cc=(9, 0), device=False, abi="numba")
print(text.decode() if isinstance(text, bytes) else text)
"""


@pytest.mark.slow
def test_kernels_compile_for_a_gpu() -> None:
    """In float64, with fused operations, without memory that a thread would have to allocate."""
    if importlib.util.find_spec("numba_cuda") is None:
        pytest.skip("numba-cuda is not installed")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", COMPILED],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert ".target sm_90" in done.stdout
    assert "fma.rn.f64" in done.stdout
    assert "NRT_" not in done.stdout


@pytest.mark.skipif(cuda.is_available(), reason="there is a GPU")  # type: ignore[no-untyped-call]
def test_missing_gpu_is_refused() -> None:
    """The message names the compiler or the driver that is missing, and the way without a GPU."""
    missing = "numba-cuda" if importlib.util.find_spec("numba_cuda") is None else "nvidia-smi"
    with pytest.raises(RuntimeError, match=f"{missing}.*FrigateVectorEnv"):
        GpuBatch(load_ship("frigate"), np.zeros(2, STATE), 22.0)
