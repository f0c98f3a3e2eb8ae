"""A propeller in air whose ship file has no inflow in its torque; the recording uses no plant."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import diagnose
from shaftline.plant import Ship

DENSITY, DIAMETER_M, TORQUE_COEFFICIENT = 1.2, 0.2, 0.0173
LABEL = "inflow-torque (propeller)"
SLOPE = -5e-6  # N m s2/(rad m)


def _rig() -> Ship:
    return Ship.model_validate(
        {
            "name": "tunnel",
            "water": {"density_kg_m3": DENSITY},
            "hull": {"fixed": True},
            "propeller": {
                "model": "bollard",
                "diameter_m": DIAMETER_M,
                "pitch_ratio_min": 0.7,
                "pitch_ratio_max": 0.7,
                "thrust_coefficient": 0.1,
                "torque_coefficient": TORQUE_COEFFICIENT,
            },
            "prime_mover": {"type": "speed-command", "speed_max_rad_s": 1400.0},
            "transmission": {"inertia_propeller_side_kg_m2": 1e-9},
            "tolerances": {"torque_curve": 0.1},
        }
    )


def _run(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    speed = np.repeat(rng.uniform(300.0, 1200.0, 60), 20)
    inflow = np.repeat(rng.choice([0.0, 8.0, 15.0], 12), 100)
    turns = speed / (2.0 * np.pi)
    torque = TORQUE_COEFFICIENT * DENSITY * DIAMETER_M**5 * turns**2 + SLOPE * speed * inflow
    return pd.DataFrame(
        {
            "time_s": 0.1 * np.arange(len(speed)),
            "shaft_speed_rad_s": speed,
            "inflow_velocity_m_s": inflow,
            "shaft_torque_N_m": torque + 1e-3 * rng.standard_normal(len(speed)),
        }
    )


def test_the_torque_that_an_inflow_takes_off_is_identified() -> None:
    found = diagnose(_rig(), _run(1), hold_out=[_run(2)])
    assert found.verdict == "explained"
    assert [finding.effect.label for finding in found.findings] == [LABEL]
    (slope,) = found.findings[0].estimates
    assert slope.value == pytest.approx(SLOPE, rel=0.03)
    assert "the propeller torque falls more with the advance ratio" in found.sentence


def test_a_recording_without_an_inflow_does_not_try_it() -> None:
    table = _run(1).drop(columns="inflow_velocity_m_s")
    found = diagnose(_rig(), table, hold_out=[_run(2).drop(columns="inflow_velocity_m_s")])
    assert "inflow-torque" not in {candidate.effect.id for candidate, _ in found.ranking}
