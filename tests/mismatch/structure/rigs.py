"""A small drive whose file is wrong, and recordings of it."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.mismatch.judge.held_out import split_held_out
from shaftline.mismatch.search.catalogue import Effect, applicable_effects
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.output_error import OutputError
from shaftline.mismatch.structure.search import StructureSearch
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

INERTIA = "transmission.inertia_engine_side_kg_m2"
VISCOUS = "transmission.viscous_friction_engine_side_N_m_s_rad"
COULOMB = "transmission.coulomb_friction_engine_side_N_m"
OFFSET = "prime_mover.torque_offset_N_m"
ROWS, INTERVAL_S = 900, 0.02


@functools.cache
def motor() -> Ship:
    """A motor that switches between 12 V, none and 6 V, with a load on its shaft."""
    return Ship.model_validate(
        {
            "name": "motor",
            "hull": {"fixed": True},
            "propeller": {"model": "none"},
            "prime_mover": {
                "type": "dc-motor",
                "motor_constant_V_s_rad": 0.05,
                "armature_resistance_ohm": 1.0,
                "voltage_max_V": 12.0,
            },
            "transmission": {
                "gear_ratio": 1.0,
                "efficiency": 1.0,
                "inertia_engine_side_kg_m2": 1e-3,
                "inertia_propeller_side_kg_m2": 0.0,
                "viscous_friction_engine_side_N_m_s_rad": 1e-4,
            },
            "integration": {"time_step_s": 0.01},
        }
    )


def run(values: dict[str, Any] | None = None, seed: int = 0, noise: float = 0.3) -> pd.DataFrame:
    """A recording of the motor with some values of its own: shaft speed and voltage."""
    rng = np.random.default_rng(seed)
    levels = rng.choice([0.0, 6.0, 12.0], ROWS)
    table = pd.DataFrame({"time_s": INTERVAL_S * np.arange(ROWS)})
    table["motor_voltage_V"] = np.repeat(levels, 25)[:ROWS]
    table["shaft_speed_rad_s"] = 0.0
    true = simulate_recording(motor().with_values(values or {}), table)
    return table.assign(
        shaft_speed_rad_s=true["shaft_speed_rad_s"] + noise * rng.standard_normal(ROWS)
    )


def problem(ship: Ship, *tables: pd.DataFrame, held: int = 1) -> OutputError:
    """Return a fit of some recordings, the last of which are held out."""
    balances = Balances(JointReplay(ship, *tables))
    fitted, aside = split_held_out(balances.replay, held)[0]
    return OutputError(balances, fitted, aside)


def effects(ship: Ship, *ids: str) -> list[Effect]:
    """Entries of the catalogue that the ship can have; of these ids where some are given."""
    found = applicable_effects(ship, {"shaft_speed_rad_s", "motor_voltage_V", "time_s"})
    return [e for e in found if not ids or e.id in ids]


def searched(ship: Ship, *tables: pd.DataFrame, ids: tuple[str, ...] = ()) -> Any:
    """Return a search over recordings of which the last is held out, and its ranking."""
    search = StructureSearch(problem(ship, *tables), effects(ship, *ids))
    return search, search.search()
