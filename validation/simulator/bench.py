"""Direct-current thruster on a bench: fixed hull, propeller at bollard pull, command in volts.

The states are shaft speed, flow through the propeller and winding temperature; inductance is neglected.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .motion import compiled
from .parameters import NEUTRAL, Floats, Parameters

PROGRAMMES = ("steps", "staircase", "sines", "reversals")
CALM_PROGRAMME = "steady"

SUBSTEPS = 50
"""Integration steps in each sample: 2 ms for samples of 0.1 s."""

SETTLING = 600
"""Duration of the first command before the recording starts [0.1 s]."""

SHIP_FILE = """\
# A small electric thruster on a bench, assumed: the size of a work-class underwater vehicle's.
name = "bench-thruster"
description = "direct-current thruster at bollard pull"

[water]
density_kg_m3 = 1000.0

[hull]
fixed = true

[propeller]
model = "bollard"
diameter_m = 0.20
thrust_coefficient = 0.40
torque_coefficient = 0.050
pitch_ratio_min = 1.0
pitch_ratio_max = 1.0
depth_m = 1.0

[prime_mover]
type = "dc-motor"
motor_constant_V_s_rad = 0.12
armature_resistance_ohm = 0.6
voltage_max_V = 48.0

[transmission]
gear_ratio = 3.0
efficiency = 1.0
inertia_engine_side_kg_m2 = 0.060
inertia_propeller_side_kg_m2 = 0.010
coulomb_friction_engine_side_N_m = 0.05

[integration]
time_step_s = 0.01
"""


def bench_parameters(**changes: float) -> Parameters:
    """Return the parameters of the thruster; ``changes`` are factors as for the frigate."""
    numbers = {
        "density": 1000.0,
        "diameter": 0.20,
        "kt": 0.40,
        "kq": 0.050,
        "constant": 0.12,
        "ohm": 0.6,
        "volt_high": 48.0,
        "gear": 3.0,
        "inertia": 0.070,
        "rub": 0.05,
    }
    for name, factor in changes.items():
        numbers[name] *= factor
    return numbers | NEUTRAL


THRUSTER = np.dtype([(name, np.float64) for name in bench_parameters()], align=True)


def voltage_programme(kind: str, seconds: float, period: float, rng: Generator) -> Floats:
    """Return the voltage command [V] at each sample; ``kind`` from ``PROGRAMMES`` or ``"steady"``."""
    count = round(seconds / period) + 1
    time: Floats = np.arange(count, dtype=np.float64) * period
    if kind == CALM_PROGRAMME:
        touched = np.cumsum(rng.random(count) < period / 100.0) % 3
        return np.asarray(rng.uniform(12.0, 26.0) + 0.1 * touched, dtype=np.float64)
    if kind == "sines":
        tones = zip(
            (rng.uniform(20, 60), rng.uniform(5, 15), rng.uniform(2, 4)),
            (18.0, 7.0, 3.0),
            strict=True,
        )
        waves = sum(a * np.sin(2.0 * math.pi * time / p + rng.uniform(0, 6.28)) for p, a in tones)
        return np.asarray(waves + rng.uniform(-3.0, 12.0))
    edges = np.cumsum(rng.uniform(5.0, 25.0, count // 40 + 20))
    place = np.searchsorted(edges, time)
    if kind == "staircase":
        return np.linspace(-36.0, 36.0, 13)[np.abs((place + 6) % 24 - 12)]
    low = -32.0 if kind == "reversals" else 6.0
    return np.asarray(rng.uniform(low, 36.0, place.max() + 1)[place])


@compiled
def _motor(volt: float, y: Any, n: Any, rate: Any) -> Any:
    """Write the rates of shaft speed, flow and heat; return the current [A]."""
    omega = y[0]
    gap = n.command_gap
    if gap > 0.0:  # a demand inside the gap passes as nothing, with a soft edge
        soft = n.command_gap_round * gap
        beyond = (abs(volt) - gap) / soft
        passed = max(beyond, 0.0) + math.log1p(math.exp(-abs(beyond)))
        volt = math.copysign(soft * passed, volt)
    ohm = n.ohm * (1.0 + n.winding_heat * y[2])
    back = n.constant * n.gear * omega
    current = (volt - back) / ohm
    if n.supply_sag > 0.0:  # the supply gives way softly as the current rises
        current = current / (1.0 + (n.supply_sag * abs(current) / 20.0) ** 3) ** (1.0 / 3.0)
    speed = abs(omega)
    turns = omega / (2.0 * math.pi)
    drag = n.density * n.diameter**5 * n.kq * turns * abs(turns)
    rate[1] = 0.0
    if n.flow_memory > 0.0:  # the water through the propeller follows its speed late
        rate[1] = (omega - y[1]) / n.flow_memory * (0.3 + abs(y[1]) / 40.0)
        drag += (
            n.flow_share
            * n.density
            * n.diameter**5
            * n.kq
            * abs(turns)
            * ((omega - y[1]) / (2.0 * math.pi))
        )
    if n.astern_change != 0.0:
        drag *= 1.0 + n.astern_change * 0.5 * (1.0 - math.tanh(omega / n.astern_width))
    drag += n.turning_drag * speed**n.turning_power * (1.0 if omega >= 0.0 else -1.0)
    side = math.tanh(omega / 0.1)
    stribeck = n.stribeck_rise * math.exp(-((speed / n.stribeck_speed) ** 2))
    rub = n.rub + n.dry_front * (1.0 + stribeck)
    rub += n.wet_front * speed**n.wet_power * 30.0 ** (1.0 - n.wet_power)
    torque = n.constant * n.gear * current
    torque += n.cogging * math.sin(y[3])
    rate[0] = (torque - drag - rub * side) / n.inertia
    rate[2] = ((current / 10.0) ** 2 - y[2]) / n.winding_time
    rate[3] = 0.05 * omega
    return current


@compiled
def step_held(volt: float, y: Any, n: Any, period: float, k: Any) -> None:
    """Advance the states over a sample at a held command, in place, in :data:`SUBSTEPS` steps."""
    h = period / SUBSTEPS
    for _ in range(SUBSTEPS):
        _motor(volt, y, n, k[0])
        _motor(volt, y + 0.5 * h * k[0], n, k[1])
        _motor(volt, y + 0.5 * h * k[1], n, k[2])
        _motor(volt, y + h * k[2], n, k[3])
        y += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])


@compiled
def _held(volts: Floats, start: Any, ship: Any, period: float, states: Any, currents: Any) -> None:
    """Write states and currents at the samples."""
    y, k = start.copy(), np.zeros((4, len(start)))
    for sample in range(len(volts)):
        states[sample] = y
        currents[sample] = _motor(volts[sample], y, ship[0], k[0])
        step_held(volts[sample], y, ship[0], period, k)


def run_bench(numbers: Parameters, volts: Floats, period: float) -> pd.DataFrame:
    """Integrate the thruster from the steady state of the first command; return true signals.

    Args:
        numbers: from :func:`bench_parameters`, with effects.
        volts: command [V] at each sample, held until the next.
        period: sampling interval [s].
    """
    record = thruster_record(numbers)
    demand = np.clip(volts, -numbers["volt_high"], numbers["volt_high"])
    still = np.full(SETTLING, demand[0])
    settled = np.zeros((SETTLING, 4))
    _held(still, np.zeros(4), record, 0.1, settled, np.zeros(SETTLING))
    start = settled[-1] * np.array([1.0, 1.0, 0.0, 0.0])  # the winding cold
    states, currents = np.zeros((len(volts), 4)), np.zeros(len(volts))
    _held(demand, start, record, period, states, currents)
    return bench_table(numbers, period, volts, states, currents)


def thruster_record(numbers: Parameters) -> NDArray[Any]:
    """Return the parameters for the compiled equations: an array of one THRUSTER record."""
    return np.array([tuple(numbers[name] for name in THRUSTER.names or ())], THRUSTER)


def bench_table(
    numbers: Parameters, period: float, volts: Floats, states: Floats, currents: Floats
) -> pd.DataFrame:
    """Return the true signals at the samples in the canonical columns of a recording."""
    turns = states[:, 0] / (2.0 * math.pi)
    thrust = numbers["density"] * numbers["diameter"] ** 4 * numbers["kt"] * turns * np.abs(turns)
    return pd.DataFrame(
        {
            "time_s": np.arange(len(volts)) * period,
            "motor_voltage_V": volts,
            "shaft_speed_rad_s": states[:, 0],
            "motor_current_A": currents,
            "thrust_N": thrust,
        }
    )
