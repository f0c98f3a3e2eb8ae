"""What errors cost the CPP optimiser, and the pitch at the actual thrust."""

from __future__ import annotations

import numpy as np
import pytest

from reproductions.cells import Kind, Verdict
from reproductions.ferry import optimiser
from reproductions.ferry.experiment import (
    RISE,
    STEP_AT,
    WHOLE_ENVELOPE,
    lever_speeds,
    simulate_voyage,
)
from reproductions.ferry.optimiser import ERRORS, Error, error_row, settle
from shaftline.baselines import CppOptimiser
from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.baselines.working_point import fit_open_water
from shaftline.plant import load_ship

FERRY = load_ship("ferry")


def test_without_an_error_nothing_is_lost() -> None:
    row = error_row(FERRY, Error())
    assert np.allclose(list(row.values()), 0.0, atol=0.02)


def test_steady_state_under_an_error_is_what_the_closed_loop_settles_at() -> None:
    """A torque read 2 % high, simulated with an observer that takes the curve for the torque."""
    order = lever_speeds(FERRY)[2]
    told = settle(FERRY, ERRORS["torque read 2 % high"], order, RISE)
    ship = FERRY.with_values({"sensors.torque_gain": 1.02})
    log = simulate_voyage(ship, CppOptimiser(FERRY), order, order, observer="shaft-acceleration")
    end = log[log["time_s"] > STEP_AT + 200.0].mean()
    assert end["ship_speed_m_s"] == pytest.approx(told.point.ship_speed, rel=1e-3)
    assert end["pitch_ratio"] == pytest.approx(told.point.pitch_ratio, rel=3e-3)


def test_errors_turn_with_their_sign() -> None:
    """Torque read high, or KQ believed low, means more thrust believed and a slower ship."""
    order = lever_speeds(FERRY)[2]
    plain = settle(FERRY, Error(), order, RISE).point.ship_speed
    for name, sign in (
        ("torque read 2 % high", 1.0),
        ("torque read 2 % low", -1.0),
        ("KQ believed 3 % low", 1.0),
        ("KQ believed 3 % high", -1.0),
        ("eta_R 0.97, believed 1", 1.0),
        ("torque bias +1 % of the limit", 1.0),
    ):
        state = settle(FERRY, ERRORS[name], order, RISE)
        assert sign * (state.thrust / state.point.thrust - 1.0) > 0.01, name
        assert sign * (state.advance_velocity / state.point.advance_velocity - 1.0) < -0.005, name
        assert sign * (state.point.ship_speed / plain - 1.0) < -0.005, name


def test_fuel_is_lost_to_second_order() -> None:
    small, large = (error_row(FERRY, Error(gain=1.0 + e))["fuel lost [%]"] for e in (0.02, 0.08))
    assert 0.0 < 8.0 * small < large


def test_pitch_at_the_actual_thrust_ends_in_the_same_state_and_swings_more() -> None:
    order = lever_speeds(FERRY)[2]
    ends, swings = [], []
    for at in ("ordered", "actual"):
        pilot = CppOptimiser(FERRY, pitch_at=at)
        log = simulate_voyage(FERRY, pilot, order, order)
        ends.append(log[log["time_s"] > STEP_AT + 250.0].mean())
        waves = simulate_voyage(FERRY, pilot, order, order, sea="hs=1.0,tp=5.0", rise=1.0)
        swings.append(waves["pitch_ratio"][waves["time_s"] > 100.0].std())
    assert ends[0]["pitch_ratio"] == pytest.approx(ends[1]["pitch_ratio"], rel=2e-3)
    assert ends[0]["ship_speed_m_s"] == pytest.approx(ends[1]["ship_speed_m_s"], rel=1e-3)
    assert swings[1] > 1.5 * swings[0]


def test_bad_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="pitch_at"):
        CppOptimiser(FERRY, pitch_at="somewhere")
    with pytest.raises(ValueError, match="filter_s"):
        CppOptimiser(FERRY, filter_s=0.0)


def test_constraints_on_the_surface() -> None:
    table, fit = combinator_surface(FERRY, WHOLE_ENVELOPE), fit_open_water(FERRY)
    held = optimiser.active(FERRY, fit, table)
    assert held.shape == table.shaft_speed.shape
    top = np.isclose(table.shaft_speed, FERRY.shaft_speeds[1], rtol=1e-4)
    torque = optimiser.NAMES.index("torque")
    speed = optimiser.NAMES.index("engine speed")
    assert set(held[top].tolist()) <= {torque, speed}
    assert len(set(held.ravel().tolist())) >= 3


def test_the_papers_one_number_on_the_fit_is_a_cell() -> None:
    cells = optimiser.cells_of(fit_open_water(FERRY))
    assert [cell.verdict for cell in cells] == [Verdict.MET, Verdict.MET]
    assert {cell.kind for cell in cells} == {Kind.CALIBRATED}
