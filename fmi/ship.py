"""A ship as an FMU: the compiled equations of :mod:`shaftline.plant` with the record of one ship.

The FMU contains the machine code of the kernels that every simulation calls, so it needs no Python.
"""

from __future__ import annotations

import functools
import platform
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from numba import carray  # type: ignore[attr-defined]
from numba.core import types as numba_types

from ..plant import Equilibrium, Ship
from ..plant.columns import TIME, drive_column, signal_columns
from ..plant.dynamics import settle_lags
from ..plant.expressions import MAX_SIGNALS
from ..plant.memory import MEMORY
from ..plant.record import PLANT
from ..plant.ship import refuse_sea
from ..plant.ship_files import ship_text
from ..plant.signals import SAMPLE, SIGNALS, get_signal
from ..plant.simulation import write_sample
from ..plant.state import STATE, get_state, inputs_without_sea, set_state, with_motion
from ..plant.stepping import LIMITS, Disturbance, constant_inputs, observe, prepare, step
from ..plant.waves import SEA, calm_sea
from .archive import Model, c_bytes, c_file, write_fmu
from .description import INPUT, OUTPUT, PARAMETER, Variable

types: Any = numba_types
_DRIVE, _PITCH, _RUDDER, _INFLOW, _ELEVATION, _RESISTANCE, _EXTERNAL = range(7)
_INITIAL = _EXTERNAL + MAX_SIGNALS  # slots of the initial pitch ratio, shaft speed and ship speed
_SAMPLE = _INITIAL + 3  # slots of the outputs, in the order of the signals
_SLOTS = _SAMPLE + len(SIGNALS)
_BEGIN = -1  # in place of a number of steps: prepare the simulation


def _run(
    plants: Any, states: Any, memories: Any, seas: Any, slots: Any, samples: Any, steps: int
) -> int:
    """Simulate some time steps with constant inputs and write the sample at their end.

    Return 0, or 1 + the slot of a value that is out of bounds.
    """
    plant, state, memory = carray(plants, 1)[0], carray(states, 1)[0], carray(memories, 1)[0]
    sea, sample, x = carray(seas, 1)[0], carray(samples, 1)[0], carray(slots, _SLOTS)
    outside = (x[6], x[7], x[8], x[9], x[10], x[11])
    acting = Disturbance(x[_INFLOW], x[_ELEVATION], x[_RESISTANCE], outside)
    drive, pitch, rudder, dt = x[_DRIVE], x[_PITCH], x[_RUDDER], plant.time_step
    if steps < 0:
        state.rudder_angle = rudder
        first = with_motion(get_state(state), x[_INITIAL], x[_INITIAL + 1], x[_INITIAL + 2])
        at_start = inputs_without_sea(
            drive,
            pitch,
            acting.inflow,
            acting.elevation,
            acting.resistance_factor,
            0.0,
            0.0,
            rudder,
            outside,
        )
        set_state(state, settle_lags(plant, first, at_start))
        prepare(plant, state, memory, sea, drive, acting, dt)
    inputs = constant_inputs(drive, pitch, rudder, acting)
    for _ in range(steps):
        step(plant, state, memory, sea, inputs, dt)
    outputs = observe(plant, state, memory, sea, pitch, rudder, acting, dt)
    time, log = memory.cursor * dt, memory.speed_log
    write_sample(plant, sample, time, inputs, get_state(state), memory, log, outputs)
    for k in range(_SAMPLE, _SLOTS):
        if not (abs(x[k]) <= LIMITS[k - _SAMPLE] and np.isfinite(x[k])):
            return k + 1
    return 0


def export_ship(ship: Ship, point: Equilibrium, path: Path, sea: Any = None) -> list[Variable]:
    """Write a ship as an FMU for co-simulation and return its variables.

    Args:
        ship: the ship; its time step is that of the FMU.
        point: steady state whose commands and speeds are the start values.
        path: file that ends in ``.fmu``.
        sea: SEA record from :func:`shaftline.plant.realise`, or None for calm water.

    Raises:
        FmuError: the name of the file is wrong, or no C compiler works here.
        ValueError: there are waves in a gas.
    """
    refuse_sea(ship, sea)
    starts = np.zeros(_SLOTS)
    starts[[_DRIVE, _PITCH, _RESISTANCE]] = point.inputs.drive, point.inputs.pitch_command, 1.0
    starts[_INITIAL:_SAMPLE] = point.state[:3]
    variables = list(_variables(ship, starts.tolist()))
    state = np.zeros(1, STATE)
    state[0] = tuple(map(float, point.state))
    sizes = {"STATE": STATE, "MEMORY": MEMORY, "SEA": SEA}
    records = {
        "record": ship.record(),
        "state": state[0],
        "sea": calm_sea() if sea is None else sea,
    }
    code = [f"#define SHIP_{name} {dtype.itemsize // 8}" for name, dtype in sizes.items()]
    code += [f"#define SHIP_SAMPLE {_SAMPLE}", f"#define SHIP_BEGIN {_BEGIN}"]
    code += [c_bytes(f"ship_{name}", record.tobytes()) for name, record in records.items()]
    code.append('#include "ship.c"')
    model = Model(
        f"propulsion and motion of the ship {ship.name}",
        variables,
        ship.time_step_s,
        starts.tolist(),
        _INITIAL,
        _SAMPLE,
        "\n".join(code),
        {"ship.c": c_file("ship.c")},
        _machine_code(),
        {"ship.toml": ship_text(ship)},
    )
    write_fmu(path, model)
    return variables


def _variables(ship: Ship, starts: list[float]) -> Iterator[Variable]:
    """Yield the variables of a ship: commands, disturbances, initial values, and signals."""
    plant, demand = ship.record(), ship.prime_mover.demand
    commands = {
        _DRIVE: (
            drive_column(ship),
            demand.unit,
            demand.description,
            float(plant["drive_min"]),
            float(plant["drive_max"]),
        )
    }
    if ship.has_variable_pitch:
        signal = get_signal("pitch_command")
        ends = float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])
        commands[_PITCH] = (signal.column, signal.unit, signal.description, *ends)
    if ship.turns:
        signal, most = get_signal("rudder_command"), float(plant["rudder_max"])
        commands[_RUDDER] = (signal.column, signal.unit, signal.description, -most, most)
    for slot, (name, unit, text, low, high) in commands.items():
        yield Variable(slot, name, INPUT, unit, text, starts[slot], low, high)
    disturbances = {
        _INFLOW: ("inflow_disturbance_m_s", "m/s", "added to the advance velocity, beside the sea"),
        _ELEVATION: (
            "surface_elevation_m",
            "m",
            "of the surface above the propeller, beside the sea",
        ),
        _RESISTANCE: ("resistance_factor", "-", "factor on the resistance of the hull"),
    }
    for k, name in enumerate(sorted(ship.signals)):
        disturbances[_EXTERNAL + k] = (
            name,
            ship.signals[name],
            "external signal of the ship's terms",
        )
    for slot, (name, unit, text) in disturbances.items():
        yield Variable(slot, name, INPUT, unit, text, starts[slot])
    initial = {
        _INITIAL: ("initial_pitch_ratio", "pitch_ratio", ship.has_variable_pitch),
        _INITIAL + 1: ("initial_shaft_speed_rad_s", "shaft_speed", ship.turns_freely),
        _INITIAL + 2: ("initial_ship_speed_m_s", "ship_speed", ship.moves),
    }
    for slot, (name, of, exists) in initial.items():
        if exists:
            signal = get_signal(of)
            text = f"{signal.description} at the start"
            yield Variable(slot, name, PARAMETER, signal.unit, text, starts[slot])
    taken = {TIME, *(name for name, *_ in (*commands.values(), *disturbances.values()))}
    order = SAMPLE.names or ()
    for column, of in signal_columns(ship).items():
        if column not in taken:
            signal = get_signal(of)
            slot = _SAMPLE + order.index(of)
            yield Variable(slot, column, OUTPUT, signal.unit, signal.description)


@functools.cache
def _machine_code() -> bytes:
    """Return an object file with ``shaftline_run``, which is :func:`_run` and all that it calls."""
    records = [types.CPointer(numba.from_dtype(dtype)) for dtype in (PLANT, STATE, MEMORY, SEA)]
    slots, sample = types.CPointer(types.float64), types.CPointer(numba.from_dtype(SAMPLE))
    signature = types.int64(*records, slots, sample, types.int64)
    compiler: Callable[..., Any] = numba.cfunc(signature, error_model="numpy")
    kernel = compiler(_run)
    module = llvm.parse_assembly(kernel.inspect_llvm())
    for function in module.functions:
        if function.name == kernel.native_name:
            function.name = "shaftline_run"
        elif not function.is_declaration:
            function.linkage = "internal"  # so that two FMUs in one program do not share functions
    # Fused operations give the same bits as in a simulation; processors have them since 2013.
    usual = "x86-64-v3" if platform.machine().lower() in ("x86_64", "amd64") else ""
    target = llvm.Target.from_triple(llvm.get_process_triple())
    machine = target.create_target_machine(cpu=usual, opt=3, reloc="pic", codemodel="default")
    code: bytes = machine.emit_object(module)
    return code
