"""Recordings of the published tug's drive train, whose numbers are known."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.mismatch.identification.drive_train import LinearDrive
from shaftline.mismatch.identification.free_parameters import number_of
from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

COLUMNS = ["time_s", "motor_voltage_V", "shaft_speed_rad_s", "motor_current_A"]


@functools.cache
def tug(name: str = "sine") -> Ship:
    return load_ship(f"tito-neri-{name}")


def recorded(ship: Ship, voltage: Any, interval_s: float = 1e-4) -> pd.DataFrame:
    """A voltage over rows on a drive train, from its first row's steady state on."""
    table = pd.DataFrame({"time_s": np.arange(len(voltage)) * interval_s})
    table["motor_voltage_V"], table["motor_current_A"] = np.asarray(voltage, dtype=float), 0.0
    return simulate_recording(ship, table)[COLUMNS]


def staircase(ship: Ship, levels: Any, hold_s: float = 2.0, interval_s: float = 1e-4) -> Any:
    return recorded(ship, np.repeat(levels, round(hold_s / interval_s)), interval_s)


def swing(
    ship: Ship, frequency: float, seconds: float, amplitude: float = 0.05, mean: float = 5.89
) -> pd.DataFrame:
    time = np.arange(round(seconds / 1e-4)) * 1e-4
    return recorded(ship, mean * (1.0 + amplitude * np.sin(frequency * time)))


def shares_off(ship: Ship, found: Any) -> dict[str, float]:
    """Relative error of each number found, by the last part of its key."""
    return {
        key.split(".")[1]: value / number_of(ship, key).value - 1.0
        for key, value in zip(found.keys, found.values, strict=True)
    }


def poles_approximate(model: LinearDrive) -> tuple[float, float]:
    """Return the poles of an armature that is much faster than the shaft (eqs. A33 and A34)."""
    return -1.0 / model.electric_s, -model.c / model.effective_s


def responses(model: LinearDrive, frequency: Any) -> tuple[Any, Any]:
    """Return the responses of speed (eq. 13) and current (eq. 12) at frequencies [rad/s]."""
    s = 1j * np.asarray(frequency, dtype=float)
    total = model.electric_s + model.effective_s
    characteristic = model.electric_s * model.effective_s * s * s + total * s + model.c
    speed = model.drive / model.damping / characteristic
    return speed, (model.effective_s * s + 1.0) * model.drive / characteristic


def step_responses(model: LinearDrive, time: Any) -> tuple[Any, Any]:
    """Return speed (eq. A38) and current (eq. A44) after a unit step of the voltage, at times [s]."""
    fast, slow = model.poles
    t = np.asarray(time, dtype=float)
    rising = 1.0 + (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (slow - fast)
    peak = model.drive / model.electric_s  # K_BP = U_0 / (L_a i_0)
    band = peak * ((np.exp(slow * t) - np.exp(fast * t)) / (slow - fast)).real
    speed = model.speed_gain * rising.real
    return speed, model.damping * speed + band
