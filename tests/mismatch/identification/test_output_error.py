"""Numbers found again on voyages of known ships, and as sure as is claimed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.identification.free_parameters import Free
from shaftline.mismatch.identification.output_error import (
    OutputError,
    output_error,
    refuse_uncertain,
)
from shaftline.mismatch.identification.parameters import MethodResult
from shaftline.mismatch.judge.held_out import bands_of
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship

from ..voyages import bench_tug, frigate_voyage, tug_run

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
INERTIA = "transmission.inertia_engine_side_kg_m2"
RACK = "prime_mover.torque_per_rack_N_m_mm"
TRUTH = {RESISTANCE: 3306.2 * 1.15, INERTIA: 53697.0 * 0.8, RACK: 1428.6 * 1.06}


def fitter_of(ship: Ship, table: pd.DataFrame, keys: tuple[str, ...]) -> Fitter:
    balances = Balances(JointReplay(ship, table))
    return Fitter(balances, bands_of(balances, balances.replay.segments), free=keys)


def test_numbers_far_off_are_found_within_their_errors() -> None:
    ship, keys = load_ship("frigate"), tuple(TRUTH)
    fitter = fitter_of(ship, frigate_voyage(TRUTH, seed=3, seconds=400.0), keys)
    found = output_error(fitter, Free(ship, keys))
    for key, value, error in zip(found.keys, found.values, found.standard_errors, strict=True):
        assert abs(value - TRUTH[key]) < 3.0 * error, key
        assert error < 0.01 * value, key
    assert not found.remarks
    steps = found.tables["search"]
    assert steps["2logL"].is_monotonic_increasing
    assert steps[RESISTANCE].iloc[0] == 3306.2
    assert fitter.simulations < 60


def test_a_number_at_zero_is_found_from_nothing() -> None:
    key = "transmission.viscous_friction_engine_side_N_m_s_rad"
    ship = load_ship("frigate")
    fitter = fitter_of(ship, frigate_voyage({key: 1500.0}, seed=4, seconds=400.0), (key,))
    found = output_error(fitter, Free(ship, (key,)))
    assert found.values[0] == pytest.approx(1500.0, abs=3.0 * found.standard_errors[0])
    assert found.standard_errors[0] < 100.0


def test_what_physics_is_missing_is_said() -> None:
    ship = load_ship("frigate")
    table = frigate_voyage({"prime_mover.lag_s": 2.5}, seed=3, seconds=400.0)
    found = output_error(fitter_of(ship, table, (RESISTANCE,)), Free(ship, (RESISTANCE,)))
    (said,) = found.remarks
    assert said.startswith("the residual of the engine balance is not noise")


def test_a_ratio_is_refused_with_both_names() -> None:
    keys = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
    ship = bench_tug()
    with pytest.raises(
        ValueError, match=r"torque_coefficient and propeller\.relative_rotative_eff"
    ):
        output_error(fitter_of(ship, tug_run(), keys), Free(ship, keys))


def test_a_number_that_is_not_excited_is_refused() -> None:
    ship, key = load_ship("frigate"), "prime_mover.fuel_base_g_kWh"
    fitter = fitter_of(ship, frigate_voyage(seed=1, seconds=200.0), (key,))
    with pytest.raises(
        ValueError, match=r"fuel_base_g_kWh is not identifiable: no measured channel"
    ):
        output_error(fitter, Free(ship, (key,)))


def test_columns_are_derivatives() -> None:
    ship = load_ship("frigate")
    fitter = fitter_of(ship, frigate_voyage(seed=2, seconds=200.0), (RESISTANCE,))
    free = Free(ship, (RESISTANCE,))
    (column,) = OutputError(fitter, free).columns(free.values, fitter.null)
    small = 1e-3
    beside = fitter.predict(free.record((3306.2 + small,)))
    slope = (beside - fitter.predict(ship.record())) / small
    assert np.linalg.norm(column - slope) < 0.02 * np.linalg.norm(slope)


def test_a_number_whose_absence_is_found_is_not_refused(servo: Ship) -> None:
    """No offset acts: an interval about 0 says so; an inertia that sure would be no inertia."""
    free = Free(servo, ("prime_mover.torque_offset_N_m",))
    found = MethodResult(free.keys, (0.01,), np.array([[0.3**2]]))
    refuse_uncertain(found, free)
    unsure = Free(servo, (INERTIA,))
    with pytest.raises(
        ValueError, match=r"inertia.* not identifiable.*estimate 90, standard error 91"
    ):
        refuse_uncertain(MethodResult(unsure.keys, (90.0,), np.array([[91.0**2]])), unsure)

    # near 0, and far surer of it than the file's 95 kg m2 are large
    refuse_uncertain(MethodResult(unsure.keys, (10.0,), np.array([[20.0**2]])), unsure)
    with pytest.raises(ValueError, match="estimate 10, standard error 30"):
        refuse_uncertain(MethodResult(unsure.keys, (10.0,), np.array([[30.0**2]])), unsure)

    both = Free(servo, (INERTIA, "transmission.viscous_friction_engine_side_N_m_s_rad"))
    alike = np.array([[91.0**2, 0.99 * 91.0 * 180.0], [0.99 * 91.0 * 180.0, 180.0**2]])
    with pytest.raises(ValueError, match=r"does not distinguish it from transmission\.viscous"):
        refuse_uncertain(MethodResult(both.keys, (90.0, 190.0), alike), both)
