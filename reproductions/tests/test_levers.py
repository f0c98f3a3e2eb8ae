"""The CPP optimiser paper's experiment: what its page claims."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from reproductions.cells import Cell, Kind, Verdict, repeated_keys
from reproductions.ferry.experiment import (
    COMBINATOR,
    CONDITIONS,
    CORRECTED,
    HELD,
    PAPERS,
    RAISED,
    RISE,
    compare_controls,
    load_ship_deeper,
    optimal_state,
    state_under_governor,
)
from reproductions.ferry.levers import (
    against_combinator,
    implied_rises,
    implied_savings,
    table_cells,
    table_in_paper_form,
)
from reproductions.side_by_side import published
from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.baselines.cpp_optimiser import CppOptimiser
from shaftline.plant import load_ship

KEYS = ["curve", "condition", "lever"]
EDGE = 0.2  # %: what the surface's interpolation may cost where the torque limit cuts it


@pytest.fixture(scope="module", params=["ferry", "frigate"])
def rows(request: pytest.FixtureRequest) -> pd.DataFrame:
    return compare_controls(load_ship(request.param))


def test_the_papers_tables_are_complete() -> None:
    table = published(PAPERS)
    assert table.shape == (15, 9)
    assert not table.isna().any(axis=None)
    for control in (COMBINATOR, HELD, CORRECTED):
        assert list(table.loc[control, "condition"]) == [1, 2, 3, 4, 5]
    corrected, plain = table.loc[CORRECTED], table.loc[COMBINATOR]
    speed = "ship_speed_m_s_after"
    assert list(corrected[speed]) == list(plain[speed])  # the paper's equal speed
    assert (corrected["sfoc_g_kwh_after"].to_numpy() < plain["sfoc_g_kwh_after"].to_numpy()).all()


def test_every_comparison_is_at_equal_speed_and_never_worse(rows: pd.DataFrame) -> None:
    optimiser = rows[rows["control"] == CORRECTED].set_index(KEYS)
    plain = rows[rows["control"] == COMBINATOR].set_index(KEYS)
    assert len(plain) == len(CONDITIONS) * 5 * (3 if rows["ship"].iloc[0] == "ferry" else 2)
    assert set(optimiser.index) == set(plain.index)  # with the whole envelope all are reached
    speeds = plain["ship_speed_m_s"].loc[optimiser.index]
    assert (optimiser["ship_speed_m_s"] - speeds).abs().max() < 1e-6
    fuel = optimiser["fuel_kg_nmi"] / plain["fuel_kg_nmi"].loc[optimiser.index]
    saving = optimiser["saving_percent"]
    assert 100.0 * (1.0 - fuel).to_numpy() == pytest.approx(saving.to_numpy(), abs=1e-6)
    assert not optimiser["active"].str.contains("gradient").any()
    assert saving.min() > -EDGE
    assert rows["torque_share"].max() < 1.0 + 2e-3
    assert rows["burrill"].max() < 1.0


def test_controls_that_start_alike(rows: pd.DataFrame) -> None:
    """The paper's premise, and on the ferry its claim: lower specific consumption at every lever."""
    table = rows[rows["curve"] == "design"].set_index(["control", "condition", "lever"])
    sfoc = table["sfoc_g_kwh"]
    for lever in range(1, 6):
        for name in ("pitch_ratio", "engine_speed_rpm"):
            both = [float(table.loc[(c, "calm", lever), name]) for c in (COMBINATOR, CORRECTED)]
            assert both[0] == pytest.approx(both[1], rel=1e-3)
        if table["ship"].iloc[0] == "ferry":
            for condition in list(CONDITIONS)[1:]:
                key = condition, lever
                assert sfoc[(CORRECTED, *key)] < sfoc[(COMBINATOR, *key)]


@pytest.fixture(scope="module")
def own_size() -> pd.DataFrame:
    return compare_controls(load_ship("ferry-printed"))


@pytest.fixture(scope="module")
def cells(own_size: pd.DataFrame) -> list[Cell]:
    return table_cells(own_size[own_size["curve"] == "printed"])


def test_every_printed_number_of_the_three_tables_is_a_cell(cells: list[Cell]) -> None:
    """Four quantities before and after the disturbance and two variations, at five levers."""
    assert len(cells) == 3 * 5 * (4 * 2 + 2)
    assert not list(repeated_keys(cells))
    table = published(PAPERS)
    for cell in cells:
        control = {"Table 1": COMBINATOR, "Table 2": HELD, "Table 3": CORRECTED}[cell.table]
        lever, when = cell.row.removeprefix("lever ").split(", ")
        if when != "variation":
            line = table.loc[control].set_index("condition").loc[int(lever)]
            assert cell.printed == line[f"{cell.column}_{when}"]


def test_what_the_model_was_given_is_not_counted_as_predicted(cells: list[Cell]) -> None:
    """Of the 90 speeds and consumptions 25 are inputs; the map was fitted to all consumption."""
    kinds = {(cell.table, *cell.row.split(", "), cell.column): cell.kind for cell in cells}
    assert sum(cell.kind is Kind.INPUT for cell in cells) == 25
    assert not any(
        kind is Kind.FREE for (*_, column), kind in kinds.items() if column == "sfoc_g_kwh"
    )
    assert kinds["Table 3", "lever 2", "after", "engine_speed_rpm"] is Kind.CALIBRATED
    for table in ("Table 1", "Table 2", "Table 3"):
        for when in ("after", "variation"):
            speeds = [kinds[table, f"lever {k}", when, "ship_speed_m_s"] for k in range(1, 6)]
            assert speeds == [Kind.FREE, Kind.FREE, Kind.CALIBRATED, Kind.FREE, Kind.FREE]


def test_tolerances_are_narrower_than_the_loss_of_speed(cells: list[Cell]) -> None:
    """Our combinator loses speed as printed; our held thrust does not: no tolerance may hide this."""
    speeds = [cell for cell in cells if cell.column == "ship_speed_m_s" and cell.kind is Kind.FREE]
    assert len(speeds) == 24
    for cell in speeds:
        if cell.table != "Table 2":
            assert abs(cell.ours - cell.printed) < 0.007
            assert cell.verdict is Verdict.MET
    held = [cell for cell in speeds if cell.table == "Table 2"]
    assert sum(cell.verdict is Verdict.UNEXPLAINED for cell in held) == 6
    for cell in cells:
        widest = {
            "engine_speed_rpm": 5.0,
            "pitch_deg": 0.15,
            "ship_speed_m_s": 0.020,
            "sfoc_g_kwh": 0.5,
        }[cell.column]
        assert cell.high - cell.printed < widest


def test_a_reason_of_the_optimiser_is_the_printed_ship_speed(cells: list[Cell]) -> None:
    for cell in cells:
        if cell.reason is not None:
            assert cell.table in ("Table 2", "Table 3")
            assert cell.row.endswith("after")
            assert cell.column != "ship_speed_m_s"
            moved = cell.ours + cell.reason.shift - cell.printed
            assert abs(moved) < 0.5 * abs(cell.ours - cell.printed)
            assert "at the printed ship speed our optimiser has" in cell.reason.text


def test_the_loss_of_speed_in_table_1_is_that_of_the_rise_of_the_text() -> None:
    """15 % at every lever, of which only the third was used; Table 2 asks for 13.9 to 17.0 %."""
    assert RISE == 1.15
    ship = load_ship("ferry-printed")
    asked = implied_rises(ship)
    assert asked["rise by Table 1 [%]"].between(14.8, 15.6).all()
    assert asked["rise by Table 2 [%]"].tolist() == pytest.approx(
        [13.86, 15.0, 15.0, 16.04, 17.02], abs=0.01
    )
    change = asked["change of thrust at the speed of Table 2 [%]"]
    lost = (6.40 / 6.04) ** ship.hull.resistance_exponent  # lever 5, by hand
    assert change.iloc[4] == pytest.approx(100.0 * (1.15 / lost - 1.0), abs=1e-6)
    assert (change.iloc[0], change.iloc[4]) == pytest.approx((1.0, -1.7), abs=0.05)


def test_savings_have_the_printed_size(own_size: pd.DataFrame) -> None:
    saved = own_size[(own_size["curve"] == "printed") & (own_size["condition"] == RAISED)]
    saved = saved.dropna().set_index("lever")["saving_percent"]
    implied = -implied_savings(load_ship("ferry-printed"))["fuel per mile change [%]"]
    assert implied.tolist() == pytest.approx([3.8, 3.5, 2.9, 2.7, 3.0], abs=0.05)
    assert saved.tolist() == pytest.approx(implied.tolist(), abs=1.1)
    assert saved.mean() == pytest.approx(implied.mean(), abs=0.2)


def test_held_thrust_loses_speed_with_the_root_of_the_resistance(rows: pd.DataFrame) -> None:
    held = rows[(rows["control"] == HELD) & (rows["curve"] == "design")]
    speed = held.set_index(["condition", "lever"])["ship_speed_m_s"]
    for lever in range(1, 6):
        lost = speed[RAISED, lever] / speed["calm", lever]
        assert lost == pytest.approx(RISE**-0.5, rel=1e-9)


def test_our_ferry_needs_the_papers_pitch_changes() -> None:
    table = implied_savings(load_ship("ferry"))
    for cell in table["pitch change [deg]"]:
        ours, printed = (float(part.strip("()")) for part in cell.split())
        assert ours == pytest.approx(printed, abs=0.1)
    assert (table["fuel per mile change [%]"] < -1.5).all()
    assert (table["power, Table 3 [kW]"] > table["power, Table 1 [kW]"]).all()


def test_a_loaded_ship_is_heavier_and_resists_more() -> None:
    ferry = load_ship("ferry")
    heavy = load_ship_deeper(ferry, 1.4)
    assert heavy.hull.mass_kg == pytest.approx(1.4 * ferry.hull.mass_kg)
    coefficient = "resistance_coefficient_N_s2_m2"
    more = getattr(heavy.hull, coefficient) / getattr(ferry.hull, coefficient)
    assert more == pytest.approx(1.2515, rel=1e-4)


def test_the_governor_slows_an_overloaded_shaft_and_the_surface_says_where_it_ends() -> None:
    ferry = load_ship("ferry")
    free = state_under_governor(ferry, 50.0, 0.7, 1.0)
    assert free.shaft_speed == 50.0
    slowed = state_under_governor(ferry, 63.0, 0.8, 1.4)
    assert slowed.shaft_speed < 63.0
    assert slowed.torque_share == pytest.approx(1.0, abs=1e-9)
    assert optimal_state(ferry, combinator_surface(ferry), 6.6, 2.0) is None


def test_more_than_the_calm_water_top_can_be_ordered() -> None:
    """Or the optimiser could not reach the combinator's speed near full power after a rise."""
    optimiser = CppOptimiser("ferry")
    top = float(optimiser.combinator.curve.ship_speed[-1])
    calm, more = optimiser.ordered_thrust([top, 1.05 * top])
    assert more == pytest.approx(1.05**2 * calm)


def test_tables_have_the_papers_form(rows: pd.DataFrame) -> None:
    part = rows[rows["curve"] == "standard"]
    table = table_in_paper_form(part, COMBINATOR)
    assert list(table["lever"]) == [1, 2, 3, 4, 5]
    assert table["SFOC [g/kWh]"].iloc[0].endswith("(294.1)")
    assert table["variation"].iloc[4].endswith("(+19.6)")
    missing = rows[~((rows["control"] == CORRECTED) & (rows["lever"] == 5))]
    assert (against_combinator(missing)["5"] == "not reached").all()
    assert not any(math.isnan(v) for v in rows["fuel_kg_nmi"])
