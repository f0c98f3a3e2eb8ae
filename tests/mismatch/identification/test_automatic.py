"""The part of a ship's numbers that a recording tells."""

from __future__ import annotations

from shaftline.mismatch.identification.frequency import identifiable_keys
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import load_ship

from ..voyages import bench_tug, frigate_voyage, tug_run

KQ, ETA_R = "propeller.torque_coefficient", "propeller.relative_rotative_efficiency"


def test_a_rich_voyage_tells_all_but_what_it_does_not_measure() -> None:
    balances = Balances(JointReplay(load_ship("frigate"), frigate_voyage(seed=3, seconds=400.0)))
    keys, left = identifiable_keys(balances, balances.replay.segments)
    hull = ("hull.mass_kg", "hull.resistance_coefficient_N_s2_m2")
    assert left == {
        "prime_mover.fuel_base_g_kWh": "no measured channel depends on it here",
        "hull.thrust_deduction": f"only its combination with {hull[0]} and {hull[1]} is identifiable",
    }
    assert {*hull, "pitch_actuator.time_constant_s"} <= set(keys)


def test_without_gauge_and_log_less_is_told() -> None:
    table = frigate_voyage(seed=3, seconds=400.0).drop(
        columns=["shaft_torque_N_m", "ship_speed_m_s"]
    )
    balances = Balances(JointReplay(load_ship("frigate"), table))
    keys, left = identifiable_keys(balances, balances.replay.segments)
    assert len(keys) < 8
    assert "transmission.inertia_propeller_side_kg_m2" in left or (
        "transmission.inertia_engine_side_kg_m2" in left
    )


def test_of_a_ratio_one_is_left_as_it_is() -> None:
    """KQ and eta_R act as their product; and no speed alone tells the torques' common factor."""
    tug = bench_tug().with_values({ETA_R: 0.98})
    balances = Balances(JointReplay(tug, tug_run()))
    keys, left = identifiable_keys(balances, balances.replay.segments)
    assert len(keys) == 4
    assert left.keys() >= {ETA_R}
    assert left[ETA_R] == f"only its combination with {KQ} is identifiable"
    (other,) = left.keys() - {ETA_R}
    assert "only its combination" in left[other]
