"""The balances of a ship that turns, against equations written out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship

from ..turning import quick_tanker, swinging

RHO, L, D, X_G, M = 1000.0, 7.0, 0.455, 0.25, 3270.0
TIME = 0.2 * np.arange(200)
HEADING = 0.4 * np.sin(0.11 * TIME)
MOTION = {
    "ship_speed_m_s": 1.1 + 0.05 * np.sin(0.2 * TIME),
    "sway_speed_m_s": 0.1 * np.sin(0.13 * TIME),
    "yaw_rate_rad_s": 0.044 * np.cos(0.11 * TIME),
    "heading_rad": HEADING,
}
CURRENT, ACROSS = 0.08, -0.05


def plain() -> Ship:
    """Of drift and turn only linear terms, and X_vr; no rudder, two numbers for a propeller."""
    tree = quick_tanker().model_dump(exclude_unset=True)
    own = ("X_vv", "X_rr", "X_vvvv", "Y_vvv", "Y_vvr", "Y_vrr", "Y_rrr", "N_vvv", "N_vvr", "N_vrr",
           "N_rrr", "wake_drift_rate", "wake_drift_gain_port", "wake_drift_gain_starboard")  # fmt: skip
    for key in own:
        tree["manoeuvring"].pop(key, None)
    tree["manoeuvring"] |= {"X_vr": 0.1, "Y_rdot": -0.01, "N_vdot": -0.02}
    tree["manoeuvring"]["cross_current_m_s"] = ACROSS
    tree["hull"]["current_m_s"] = CURRENT
    tree.pop("rudder")
    tree["propeller"] = {
        "model": "bollard",
        "diameter_m": 0.204,
        "thrust_coefficient": 0.3,
        "torque_coefficient": 0.03,
        "depth_m": 0.3,
    }
    return Ship.model_validate(tree)


def table(**columns: Any) -> pd.DataFrame:
    return pd.DataFrame({"time_s": TIME, "shaft_speed_rad_s": 60.0, **MOTION, **columns})


def by_hand(r: Any) -> dict[str, Any]:
    """What hull, sway and yaw lack, equations 3 to 14 of Yasukawa & Yoshimura (2015)."""
    ship = plain()
    u = MOTION["ship_speed_m_s"] - CURRENT * np.cos(HEADING) - ACROSS * np.sin(HEADING)
    v = MOTION["sway_speed_m_s"] - ACROSS * np.cos(HEADING) + CURRENT * np.sin(HEADING)
    # accelerations through the water, whose current turns in the ship's axes
    du = np.gradient(MOTION["ship_speed_m_s"], 0.2) - r * (
        ACROSS * np.cos(HEADING) - CURRENT * np.sin(HEADING)
    )
    dv = np.gradient(MOTION["sway_speed_m_s"], 0.2) + r * (
        CURRENT * np.cos(HEADING) + ACROSS * np.sin(HEADING)
    )
    dr = np.gradient(r, 0.2)
    speed = np.hypot(u, v)
    force = 0.5 * RHO * L * D * speed**2
    one = 0.5 * RHO * L * L * D
    m_y, j_z = 0.223 * one, 0.011 * one * L**2
    thrust = 0.3 * RHO * (60.0 / (2.0 * np.pi)) ** 2 * 0.204**4
    v1, r1 = v / speed, r * L / speed
    x = force * 0.1 * v1 * r1 + (1.0 - 0.22) * thrust - 35.04 * u**2
    y = force * (-0.315 * v1 + 0.083 * r1)
    n = force * L * (-0.137 * v1 - 0.049 * r1)
    inertia = M * (1.75**2 + X_G**2)
    lacks = {
        "hull": ship.hull.mass_kg * du - (M + m_y) * v * r - M * X_G * r**2 - x,
        "sway": (M + m_y) * dv + (M * X_G + 0.01 * one * L) * dr + ship.hull.mass_kg * u * r - y,
        "yaw": (inertia + j_z) * dr + (M * X_G + 0.02 * one * L) * dv + M * X_G * u * r - n,
    }
    return lacks


def residuals(recording: pd.DataFrame) -> dict[str, Any]:
    balances = Balances(JointReplay(plain(), recording))
    rows = balances.residuals(balances.replay.recorded)
    assert dict(zip(balances.names, balances.units, strict=True)) == {
        "hull": "N",
        "sway": "N",
        "yaw": "N m",
    }
    return dict(zip(balances.names, rows, strict=True))


def test_hull_sway_and_yaw_lack_what_the_equations_leave() -> None:
    found, hand = residuals(table()), by_hand(MOTION["yaw_rate_rad_s"])
    for name, lacks in hand.items():
        assert found[name] == pytest.approx(lacks, abs=1e-6 * np.abs(lacks).max())
        assert np.abs(lacks).max() > 10.0


def test_without_a_rate_of_turn_it_is_the_heading_s_derivative() -> None:
    recording = table().drop(columns="yaw_rate_rad_s")
    found, hand = residuals(recording), by_hand(np.gradient(HEADING, 0.2))
    for name, lacks in hand.items():
        assert found[name] == pytest.approx(lacks, abs=1e-6 * np.abs(lacks).max())


def test_recordings_that_begin_on_other_headings_are_not_turned_at_their_joint() -> None:
    tables = [table().drop(columns="yaw_rate_rad_s") for _ in range(2)]
    tables[1]["heading_rad"] += 6.0
    balances = Balances(JointReplay(plain(), *tables))
    rows = balances.residuals(balances.replay.recorded)
    first, second = rows[2][:200], rows[2][200:]
    assert np.abs(second).max() < 3.0 * np.abs(first).max()  # a jump of 6 rad would be 1e5 N m


def test_of_a_ship_that_turns_the_balances_of_her_own_simulation_lack_nothing() -> None:
    """Of each a hundredth of the nominal inertia's share at most, for central differences."""
    balances = Balances(JointReplay(quick_tanker(), swinging(quick_tanker(), seed=2)))
    lacking = np.median(np.abs(balances.residuals(balances.nominal)), axis=1)
    r = balances.nominal["yaw_rate_rad_s"]
    assert lacking[1] < 0.01 * np.median(np.abs(3515.0 * r))
    assert lacking[2] < 0.02 * 20000.0 * float(np.abs(np.gradient(r, 0.2)).max())
    assert lacking[0] < 0.5


def test_the_rudder_that_was_measured_acts_whatever_was_ordered() -> None:
    swung = swinging(quick_tanker(), seed=2, seconds=60.0)
    angle = swung["rudder_command_rad"] * 0.9
    both = Balances(JointReplay(quick_tanker(), swung.assign(rudder_rad=angle)))
    alone = Balances(
        JointReplay(
            quick_tanker(),
            swung.assign(rudder_rad=angle).drop(columns="rudder_command_rad"),
        )
    )
    read = both.residuals(both.replay.recorded)
    assert both.names == alone.names == ["hull", "sway", "yaw"]
    ordered = Balances(JointReplay(quick_tanker(), swung))
    assert np.abs(read - ordered.residuals(ordered.replay.recorded)).max() > 1.0
    # but for a half time step, in which a measured angle is drawn on to the next
    still = np.abs(np.gradient(angle)) < 1e-9
    there = alone.residuals(alone.replay.recorded)
    assert read[:, still] == pytest.approx(there[:, still], abs=1e-6)
