"""The thesis's tables as cells: random numbers in place of our results are not explained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from reproductions.cells import Cell, Kind, Reason, Verdict
from reproductions.side_by_side import published
from reproductions.thesis import poles_page, sensitivity, snr, vaf, working_points
from shaftline.plant import Ship

VAF = "advance_velocity_thesis_vaf"
SENSITIVITY = "advance_velocity_thesis_sensitivity"


def shares(cells: list[Cell]) -> tuple[float, float]:
    """Shares of the free cells that are met and explained."""
    verdicts = [cell.verdict for cell in cells if cell.kind is not Kind.INPUT]
    return tuple(
        float(np.mean([verdict is one for verdict in verdicts]))
        for one in (Verdict.MET, Verdict.EXPLAINED)
    )  # type: ignore[return-value]


def random(table: pd.DataFrame, generator: np.random.Generator) -> pd.DataFrame:
    values = table.to_numpy(float)
    drawn = generator.uniform(np.nanmin(values), np.nanmax(values), values.shape)
    return pd.DataFrame(drawn, table.index, table.columns)


def vaf_cells(ours: pd.DataFrame) -> list[Cell]:
    smooth = pd.DataFrame(100.0, index=list(vaf.INVERTING_ROWS), columns=vaf.COLUMNS)
    smooth.loc["power-balance", "pitch_step"] = 73.73
    rounded = published(VAF).loc[list(vaf.INVERTING_ROWS), vaf.COLUMNS].astype(float)
    spread = pd.Series(0.3, index=list(vaf.ROWS))
    return vaf.cells(ours, spread, vaf.table_reasons(smooth, rounded))


def sensitivity_cells(ours: pd.DataFrame) -> list[Cell]:
    rounded = published(SENSITIVITY).iloc[:, 1:7].astype(float)
    return sensitivity.cells(ours, sensitivity.table_reasons(1.5 * rounded + 0.3, rounded))


def snr_cells(ours: pd.DataFrame) -> list[Cell]:
    model = published(VAF)[snr.COLUMN] + 2.0
    return snr.cells(ours[snr.COLUMN], snr.edge_reasons(model, model - 2.0))


TABLES = {
    "vaf": (published(VAF)[vaf.COLUMNS], vaf_cells),
    "sensitivity": (published(SENSITIVITY).iloc[:, 1:7], sensitivity_cells),
    "snr": (published(VAF)[[snr.COLUMN]], snr_cells),
    "working-points": (
        published(working_points.TABLE)[working_points.COLUMNS],
        working_points.cells,
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_random_numbers_for_our_results_are_unexplained(name: str) -> None:
    printed, cells = TABLES[name]
    generator = np.random.default_rng(7)
    found = np.mean([shares(cells(random(printed, generator))) for _ in range(20)], axis=0)
    assert found[0] <= 0.05
    assert found[1] <= 0.02


@pytest.mark.parametrize("name", TABLES)
def test_the_print_times_one_and_a_half_is_unexplained(name: str) -> None:
    printed, cells = TABLES[name]
    zeros = float((printed == 0.0).sum().sum()) / float(printed.notna().sum().sum())
    # a change of VAF in the second digit is within its rounding
    small = float((printed.abs() <= 0.06).sum().sum()) / float(printed.notna().sum().sum()) - zeros
    met, explained = shares(cells(1.5 * printed))
    assert met <= zeros + small + 1e-9
    assert explained == 0.0


def test_random_poles_zeros_and_gains_are_unexplained(frigate: Ship) -> None:
    cells = [cell for cell in poles_page.cells(frigate) if cell.kind is Kind.FREE]
    ours, generator = np.array([cell.ours for cell in cells]), np.random.default_rng(7)
    for draw in (
        lambda: generator.uniform(-2.0, 2.0, len(cells)) * ours,
        lambda: generator.permutation(ours),
    ):  # type: Callable[[], np.ndarray]
        values = draw()
        found = [replace(cell, ours=float(v)) for cell, v in zip(cells, values, strict=True)]
        met, explained = shares(found)
        # a sixth of the printed numbers is 0, another sixteenth 1
        assert met <= 0.2
        assert explained <= 0.03


def test_every_reason_is_bound_to_one_cell(frigate: Ship) -> None:
    """The shift of one cell's reason does not explain another cell of the same table."""
    cells = [c for c in poles_page.plant_cells(frigate) if c.verdict is Verdict.EXPLAINED]
    assert len(cells) >= 10
    for one, other in zip(cells, cells[1:] + cells[:1], strict=True):
        if one.printed != other.printed:
            moved = replace(one, reason=replace(other.reason, within=None))  # type: ignore[type-var]
            assert moved.verdict is Verdict.UNEXPLAINED


def test_the_edge_of_the_table_is_a_reason_of_the_inverting_observers_alone() -> None:
    model = published(VAF)[snr.COLUMN] + 2.0
    reasons = snr.edge_reasons(model, model - 2.0)
    assert ("power-balance", snr.COLUMN) in reasons
    assert ("random-walk-kalman", snr.COLUMN) not in reasons
    assert all(isinstance(one, Reason) and one.within == 0.4 for one in reasons.values())


def test_noise_above_the_highest_pitch_is_lost_at_the_edge(frigate: Ship) -> None:
    readings = np.tile([10.0, 1e5, 1.4, 0.2, 8.0], (4, 1))
    readings[:, 2] += [0.1, -0.1, 0.02, 0.0]
    limited = snr.within_table(readings, frigate)
    assert limited[:, 2] == pytest.approx([1.4, 1.3, 1.4, 1.4])
    assert np.array_equal(np.delete(limited, 2, axis=1), np.delete(readings, 2, axis=1))
    assert readings[0, 2] == pytest.approx(1.5)  # a copy is limited


def test_kinds_of_table_2_1(frigate: Ship) -> None:
    cells = working_points.cells(working_points.working_points())
    kinds = {cell.column: cell.kind for cell in cells}
    assert kinds["fuel_rack_mm"] is kinds["pitch_ratio"] is Kind.INPUT
    assert {kinds[column] for column in working_points.COLUMNS} == {Kind.CALIBRATED}
    assert all(cell.verdict is Verdict.MET for cell in cells if cell.kind is Kind.INPUT)
