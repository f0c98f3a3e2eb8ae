"""The frigate and its observers on the rounded table of the thesis."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from reproductions.cells import Kind, Verdict
from reproductions.side_by_side import published
from reproductions.thesis import rounded_table, sensitivity, table_plant, vaf
from shaftline.observers.following import variance_accounted_for
from shaftline.plant import Ship

SCORES = published("advance_velocity_thesis_vaf")
CHANGES = published("advance_velocity_thesis_sensitivity")
INVARIANCE = [f"immersion-invariance-{tuning}" for tuning in table_plant.GAMMAS]


@pytest.fixture(scope="module")
def fast(frigate: Ship) -> table_plant.Samples:
    table = rounded_table.rounded_table(frigate)
    return table_plant.simulate_case(frigate, table, "inflow_sine_high")


@pytest.fixture(scope="module")
def right(frigate: Ship, fast: table_plant.Samples) -> pd.Series:
    table = rounded_table.rounded_table(frigate)
    return table_plant.scores(fast, table_plant.estimates(frigate, fast, table))


def test_it_starts_in_its_steady_state(frigate: Ship) -> None:
    table = rounded_table.rounded_table(frigate)
    samples = table_plant.simulate_case(frigate, table, "rack_step")
    before = round(table_plant.BEFORE_S / table_plant.STEP_S)
    assert np.ptp(samples.shaft_speed[: before - 1]) < 1e-6
    assert 100.0 * (samples.shaft_speed[-1] / samples.shaft_speed[0] - 1.0) > 15.0
    # M_m = I_R omega' + M_p, and I_L carries the rest of the engine's torque
    j = 2.0 * np.pi * samples.velocity / (samples.shaft_speed * 4.2)
    last = table.interpolate(table.torque, float(j[-1]), 1.4)
    torque = 1025.0 * 4.2**5 * (samples.shaft_speed[-1] / (2.0 * np.pi)) ** 2 * last
    meter = 14411.0 * samples.acceleration[-1] + torque
    assert samples.shaft_torque[-1] == pytest.approx(meter, rel=1e-9)


def test_an_exact_inverse_has_no_error(frigate: Ship, fast: table_plant.Samples) -> None:
    """So the thesis's inverse is not that of its table: it scores 99.96."""
    table = rounded_table.rounded_table(frigate)
    torque = fast.shaft_torque - 14411.0 * fast.acceleration
    kq = torque / (1025.0 * 4.2**5 * (fast.shaft_speed / (2.0 * np.pi)) ** 2)
    found = table_plant.exact_inverse(table)(kq, fast.pitch_ratio)
    found *= fast.shaft_speed * 4.2 / (2.0 * np.pi)
    assert variance_accounted_for(fast.velocity, found) == pytest.approx(100.0, abs=1e-6)
    fitted = table_plant.polynomial_inverse(table)(kq, fast.pitch_ratio)
    fitted *= fast.shaft_speed * 4.2 / (2.0 * np.pi)
    assert variance_accounted_for(fast.velocity, fitted) == pytest.approx(99.96, abs=0.01)


def test_scaling_the_curve_scales_what_a_fit_is_given(frigate: Ship) -> None:
    table, kq = rounded_table.rounded_table(frigate), np.array([0.035, 0.04])
    pitch = np.full(2, 1.4)
    right, low = (table_plant.polynomial_inverse(table, factor) for factor in (1.0, 0.9))
    assert low(kq, pitch) == pytest.approx(right(kq / 0.9, pitch), rel=1e-6)


def test_scores_at_four_rad_s(right: pd.Series) -> None:
    """Within 0.06 points of the print, where the smooth curves are up to 0.5 off."""
    off = (right - SCORES["inflow_sine_high"].astype(float)[right.index]).abs()
    assert off.max() < 0.06
    assert off.drop(["shaft-kalman", "power-balance"]).max() < 0.03


def test_changes_of_the_observers_with_the_table_itself(
    frigate: Ship, fast: table_plant.Samples, right: pd.Series
) -> None:
    """I&I and the random-walk filter with a curve 10 % off; misprinted signs are turned."""
    table = rounded_table.rounded_table(frigate)
    turned = dict(sensitivity.find_sign_misprints(CHANGES))
    for factor, column in ((0.9, "open_water_minus_10pct"), (1.1, "open_water_plus_10pct")):
        found = table_plant.scores(fast, table_plant.estimates(frigate, fast, table, factor))
        for row in (*INVARIANCE, "random-walk-kalman"):
            printed = float(CHANGES.loc[row, column]) * (-1.0 if turned.get(row) == column else 1.0)
            assert found[row] - right[row] == pytest.approx(printed, abs=0.04), (row, column)


def test_the_entry_that_one_change_chose(
    frigate: Ship, fast: table_plant.Samples, right: pd.Series
) -> None:
    """With 0.057 at J 1.0 the changes with a low curve are half a point off."""
    table = rounded_table.rounded_table(frigate)
    assert table.torque[20, -1] == pytest.approx(0.058)
    lower = table._replace(torque=table.torque.copy())
    lower.torque[20, -1] = 0.057
    samples = table_plant.simulate_case(frigate, lower, "inflow_sine_high")
    both = [
        table_plant.scores(samples, table_plant.estimates(frigate, samples, lower, factor))
        for factor in (0.9, 1.0)
    ]
    row = "immersion-invariance-high"
    assert both[0][row] - both[1][row] == pytest.approx(-1.15, abs=0.05)


def test_what_chose_the_table_has_no_reason() -> None:
    smooth = pd.DataFrame(100.0, index=list(vaf.ROWS)[:-1], columns=vaf.COLUMNS)
    rounded = smooth - 1.0
    reasons = vaf.table_reasons(smooth, rounded)
    assert not any(row == "shaft-acceleration" for row, _ in reasons)
    assert not reasons.keys() & (vaf.CHOSEN_BY | table_plant.CHOSEN_BY)
    assert sensitivity.CHOSEN_BY not in sensitivity.table_reasons(
        CHANGES.iloc[:, 1:7].astype(float) + 1.0, CHANGES.iloc[:, 1:7].astype(float)
    )


def test_derived_numbers_are_the_arithmetic_of_the_print() -> None:
    averages, changes = vaf.derived_cells(), sensitivity.derived_cells()
    assert {cell.kind for cell in (*averages, *changes)} == {Kind.DERIVED}
    assert all(cell.verdict is Verdict.MET for cell in averages)
    off = [cell for cell in changes if cell.verdict is not Verdict.MET]
    assert {cell.row for cell in off} == dict(sensitivity.find_sign_misprints(CHANGES)).keys()
    assert all(cell.column == "sd" and cell.verdict is Verdict.EXPLAINED for cell in off)
