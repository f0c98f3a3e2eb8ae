"""The rounded open-water table of the thesis, and the frigate linearised on it."""

from __future__ import annotations

import numpy as np
import pytest

from reproductions.cells import Kind, Verdict
from reproductions.thesis import poles_page, rounded_table, working_points
from reproductions.thesis.rounded_table import Coefficient
from shaftline.plant import Ship


def near(found: Coefficient, value: float, over_j: float, over_p: float) -> bool:
    return tuple(found) == pytest.approx((value, over_j, over_p), rel=5e-3)


def test_entries_around_the_printed_points(frigate: Ship) -> None:
    """The entries from which a reader repeats the slopes of the page."""
    table = rounded_table.rounded_table(frigate)
    at = {
        (j, p): (round(j / 0.05), round((p - 0.6) / 0.1)) for j in (0.55, 0.6) for p in (0.6, 0.7)
    }
    assert [table.thrust[at[key]] for key in at] == pytest.approx([0.04, 0.09, 0.02, 0.07])
    assert [table.torque[at[key]] for key in at] == pytest.approx([0.009, 0.015, 0.007, 0.013])
    assert table.torque[22:25, -1] == pytest.approx([0.047, 0.042, 0.036])
    plain = rounded_table.rounded_table(frigate, change=(1.0, 0.0))
    raised = np.argwhere(np.round(table.torque - plain.torque, 6) == 0.001).tolist()
    for entry in ([20, 8], [23, 8], [26, 8], [20, 6], [17, 0]):
        assert entry in raised


@pytest.mark.parametrize("change", [(1.0, 0.000203), (1.0, 0.000222), (1.009, 0.0)])
def test_changes_that_give_the_slopes_at_a_and_c(
    frigate: Ship, change: tuple[float, float]
) -> None:
    table = rounded_table.rounded_table(frigate, change=change)
    for point, slope in (("A", -0.04), ("C", -0.112)):
        torque, _ = table.coefficients(rounded_table.printed_point(frigate, point))
        assert torque.by_advance_ratio == pytest.approx(slope, rel=2e-3)


@pytest.mark.parametrize(("offset", "point"), [(0.000201, "C"), (0.000225, "A")])
def test_changes_beyond_do_not(frigate: Ship, offset: float, point: str) -> None:
    table = rounded_table.rounded_table(frigate, change=(1.0, offset))
    right = rounded_table.rounded_table(frigate)
    at = rounded_table.printed_point(frigate, point)
    slopes = [one.coefficients(at)[0].by_advance_ratio for one in (table, right)]
    assert abs(slopes[0] / slopes[1] - 1.0) > 0.02


@pytest.mark.parametrize("point", "AD")
def test_the_fit_to_the_print_is_the_table(frigate: Ship, point: str) -> None:
    """Six coefficients meet every printed number, and are those of the table, not those of B5-90."""
    fit = rounded_table.fit_coefficients(frigate, point)
    assert fit.worst < 1.1
    torque, thrust = rounded_table.rounded_table(frigate).coefficients(fit.at)
    assert near(fit.torque, *torque)
    assert near(fit.thrust, *thrust)
    smooth = rounded_table.smooth_coefficient(frigate, "kt", fit.at)
    assert abs(smooth.by_advance_ratio / fit.thrust.by_advance_ratio - 1.0) > 0.025


def test_slopes_are_differences_from_the_entry_below(frigate: Ship) -> None:
    table = rounded_table.rounded_table(frigate)
    at_node = table.coefficient(table.thrust, 1.15, 1.4)
    assert at_node.by_advance_ratio == pytest.approx((0.17 - 0.19) / 0.05)
    assert at_node.by_pitch_ratio == pytest.approx((0.17 - 0.11) / 0.1)


def test_steady_state_is_that_of_the_text(frigate: Ship) -> None:
    """Section 4-1: 10.51 rad/s and 8.73 m/s; section 4-1-2: 23.23 % from P/D 1.25 to 1.0."""
    table = rounded_table.rounded_table(frigate)
    base = rounded_table.steady_state(frigate, table, 22.0, 1.4)
    assert base.shaft_speed == pytest.approx(10.51, abs=5e-3)
    assert base.ship_speed == pytest.approx(8.73, abs=5e-3)
    high, low = (
        rounded_table.steady_state(frigate, table, 22.0, pitch).shaft_speed for pitch in (1.25, 1.0)
    )
    assert 100.0 * (low / high - 1.0) == pytest.approx(23.23, abs=5e-3)
    model = rounded_table.linear_model(frigate, base, *table.coefficients(base))
    assert np.real(model["ship_speed", "resistance_factor"].dcgain()) < 0.0


def test_most_predicted_numbers_of_the_plant_follow(frigate: Ship) -> None:
    """B5-90 alone met 10 of these numbers; the cells that chose the table have no reason."""
    cells = [c for c in poles_page.plant_cells(frigate) if c.kind is not Kind.INPUT]
    chosen = [c for c in cells if c.kind is Kind.CALIBRATED]
    assert len(chosen) == len(poles_page.CHOSEN_BY) == 12
    assert all(cell.reason is None for cell in chosen)
    free = [c for c in cells if c.kind is Kind.FREE]
    assert len(free) == 96
    assert sum(c.verdict is Verdict.UNEXPLAINED for c in free) == 5


def test_other_tables_meet_fewer(frigate: Ship) -> None:
    found = poles_page.other_tables(frigate)
    counts = found[[name for name in found if name.startswith("met of")]]
    assert counts.iloc[0].tolist() == [85, 67]
    assert counts.iloc[1:, 0].max() <= 68


def test_the_pitch_of_the_mid_range_point_is_a_round_number(frigate: Ship) -> None:
    table = rounded_table.rounded_table(frigate)
    at = rounded_table.mid_range_state(frigate, table)
    model = rounded_table.linear_model(frigate, at, *table.coefficients(at))
    assert np.real(model["ship_speed", "drive"].dcgain()) == pytest.approx(0.3613, abs=5e-5)
    assert np.real(model["ship_speed", "pitch_command"].dcgain()) == pytest.approx(1.0597, rel=2e-3)


@pytest.mark.parametrize(("point", "zero"), [("B", -0.1239), ("C", -0.6648)])
def test_observers_have_the_table_at_one_advance_ratio(
    frigate: Ship, point: str, zero: float
) -> None:
    table = rounded_table.rounded_table(frigate)
    a11, _ = rounded_table.observer_slopes(frigate, table, point)
    assert a11 == pytest.approx(zero, rel=1e-3)
    assert rounded_table.observer_slopes(frigate, table, "D")[1] == pytest.approx(-8.6677, rel=1e-4)


def test_one_number_of_the_working_points_is_left(frigate: Ship) -> None:
    ours = working_points.working_points()
    cells = working_points.cells(ours, working_points.table_reasons(ours))
    left = [cell.key for cell in cells if cell.verdict is Verdict.UNEXPLAINED]
    assert left == [("2-1", "C", "engine_torque_N_m")]
