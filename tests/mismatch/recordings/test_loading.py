"""What loads a propeller under constant orders."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.checks import insufficient_excitation
from shaftline.mismatch.recordings.excitation import load_varies, varies
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship

SWING = np.sin(np.linspace(0.0, 30.0, 400))


def steady(**more: object) -> pd.DataFrame:
    table = pd.DataFrame({"time_s": 0.1 * np.arange(400), "fuel_rack_mm": 20.0})
    table = table.assign(pitch_ratio_command=1.2, shaft_speed_rad_s=11.0, ship_speed_m_s=8.0)
    return table.assign(**more)


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("inflow_velocity_m_s", 7.0 + 0.5 * SWING),
        ("propeller_submergence_m", 3.0 + 2.0 * SWING),
        ("rudder_deg", 10.0 * SWING),
    ],
)
def test_what_loads_the_propeller_excites(frigate: Ship, column: str, values: object) -> None:
    table = steady(**{column: values})
    assert load_varies(frigate, table)
    assert JointReplay(frigate, table).excited
    assert insufficient_excitation(table, frigate, {}) == []


def test_constant_orders_and_loads_are_dull(frigate: Ship, held_frigate: Ship) -> None:
    deep = steady(propeller_submergence_m=30.0 + 3.0 * SWING)
    for table in (steady(), deep, steady(ship_speed_m_s=8.0 + SWING)):
        assert not load_varies(frigate, table)
        assert not JointReplay(frigate, table).excited
        assert len(insufficient_excitation(table, frigate, {})) == 2
    assert load_varies(held_frigate, steady(ship_speed_m_s=8.0 + SWING))


def test_a_signal_moves_over_more_than_a_twentieth_of_its_size() -> None:
    assert varies(1.0 + 0.03 * SWING)
    assert not varies(1.0 + 0.02 * SWING)
