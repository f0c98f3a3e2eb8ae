"""Robust optimisers: drawn errors, the steady state of the controller, comparison, and the page."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions import robust_optimiser as study
from shaftline.baselines import combinator_curve
from shaftline.baselines.controller import measurements_of
from shaftline.baselines.cpp_optimiser import ADVANCE, INTEGRAL, THRUST, TRIM, TRUST, CppOptimiser
from shaftline.plant import load_ship

FERRY = load_ship("ferry")
ERRORS = study.Errors(kq=0.04, eta_r=-0.02, wake=0.03)


def test_errors_are_drawn_within_their_bounds_from_seeds_of_their_own() -> None:
    draws = np.array(study.draw_errors(400))
    assert (np.abs(draws) <= study.BOUNDS).all()
    assert np.abs(draws).max(axis=0) == pytest.approx(study.BOUNDS, rel=0.02)
    assert draws.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.003)
    assert np.abs(np.corrcoef(draws.T) - np.eye(3)).max() < 0.15
    assert study.draw_errors(3)[2] == study.draw_errors(1, study.FIRST_SEED + 2)[0]


def test_a_higher_kq_or_a_lower_eta_r_makes_the_true_propeller_heavier() -> None:
    actual = ERRORS.true_ship(FERRY)
    assert actual.propeller.relative_rotative_efficiency == pytest.approx(0.98 / 1.04)
    assert actual.hull.wake_fraction == pytest.approx(0.11)
    assert study.Errors().true_ship(FERRY).record() == FERRY.record()


def test_versions_know_the_bounds_that_their_estimate_leaves() -> None:
    made = {
        (version, estimate): study.make_optimiser(FERRY, version, estimate)
        for version in (study.NOMINAL, study.WORST, study.EXPECTED)
        for estimate in study.ESTIMATES
    }
    plain = CppOptimiser(FERRY).surface.pitch_ratio
    for estimate in study.ESTIMATES:
        assert np.array_equal(made[study.NOMINAL, estimate].surface.pitch_ratio, plain)
        assert (made[study.NOMINAL, estimate].schedule is None) == (estimate == study.BY_TORQUE)
    tops = {key: float(one.surface.most_thrust[9]) for key, one in made.items()}
    nominal = tops[study.NOMINAL, study.BY_WAKE]
    assert tops[study.EXPECTED, study.BY_WAKE] == nominal
    assert tops[study.WORST, study.BY_WAKE] < 0.98 * tops[study.WORST, study.BY_TORQUE]
    assert tops[study.WORST, study.BY_TORQUE] < 0.98 * nominal


@pytest.mark.parametrize("version", [study.NOMINAL, study.WORST])
@pytest.mark.parametrize("estimate", study.ESTIMATES)
def test_the_controller_stays_in_the_steady_state(version: str, estimate: str) -> None:
    """At its measurements the controller commands its pitch and does not trim any further."""
    optimiser, order = study.make_optimiser(FERRY, version, estimate), 4.9
    state = study.settle(ERRORS.true_ship(FERRY), optimiser, estimate, order)
    point = state.point
    assert state.estimated_thrust == pytest.approx(state.set_thrust, rel=1e-6)
    if estimate == study.BY_WAKE:
        assert state.estimate == pytest.approx(0.92 * point.ship_speed, rel=1e-9)
    row = [order, point.shaft_speed, 0.0, point.pitch_ratio, point.fuel_rack, point.ship_speed]
    measured = measurements_of([*row, state.estimate, 1.0])
    memory = optimiser.initial_state(measured)
    thrust = float(optimiser.thrust(measured)[0])
    assert thrust == pytest.approx(state.set_thrust, rel=1e-5)
    memory[0, [ADVANCE, THRUST, TRIM, TRUST]] = state.estimate, thrust, 0.5, 1.0
    memory[0, INTEGRAL] = 0.0
    pitch, _ = optimiser.act(measured, memory)
    assert float(pitch[0]) == pytest.approx(point.pitch_ratio, rel=1e-5)
    assert memory[0, TRIM] == pytest.approx(0.5, abs=1e-4)


def test_a_heavy_propeller_takes_the_engine_to_its_limit_and_no_further() -> None:
    optimiser = study.make_optimiser(FERRY, study.NOMINAL, study.BY_WAKE)
    top = float(combinator_curve(FERRY).ship_speed[-1])
    heavy = study.Errors(kq=0.05, eta_r=-0.03).true_ship(FERRY)
    known, wrong = (study.settle(s, optimiser, study.BY_WAKE, top) for s in (FERRY, heavy))
    assert known.demanded_share < 0.98
    assert known.shortfall == pytest.approx(0.0, abs=1e-5)
    assert wrong.demanded_share == pytest.approx(known.demanded_share * 1.05 / 0.97, rel=0.02)
    assert wrong.point.torque_share == pytest.approx(1.0, abs=1e-6)
    assert wrong.shortfall > 0.01
    slower = wrong.point.ship_speed / known.point.ship_speed
    exponent = FERRY.hull.resistance_exponent
    assert 1.0 - wrong.shortfall == pytest.approx(slower**exponent, rel=1e-4)
    robust = study.make_optimiser(FERRY, study.WORST, study.BY_WAKE)
    assert study.settle(heavy, robust, study.BY_WAKE, top).demanded_share < 0.98


def test_an_order_below_the_surface_is_refused() -> None:
    trawler = study.get_ship("trawler")
    optimiser = study.make_optimiser(trawler, study.NOMINAL, study.BY_WAKE)
    with pytest.raises(RuntimeError, match="the thrust for 3 m/s is below the surface"):
        study.settle(trawler, optimiser, study.BY_WAKE, 3.0)


def made_up() -> pd.DataFrame:
    """Return cases of four draws: the robust ship is 1 % slower and burns 3 % less per mile."""
    rows = []
    for draw, version in ((d, v) for d in range(5) for v in (study.NOMINAL, *ROBUST)):
        robust = version == study.WORST
        rows.append(
            {
                "ship": "ferry",
                "estimate": study.BY_WAKE,
                "order": "full",
                "version": version,
                "draw": draw,
                "fuel_kg_nmi": 10.0 * (0.97 if robust else 1.0),
                "ship_speed_m_s": 5.0 * (0.99 if robust else 1.0),
                "shortfall": 0.05 if robust else 0.01 * draw,
                "demanded_share": 0.9 if robust else 0.97 + 0.02 * draw,
                "exponent": 2.0,
            }
        )
    return pd.DataFrame(rows)


ROBUST = (study.WORST, study.EXPECTED)


def test_comparison_is_paired_at_equal_speed() -> None:
    table = study.compare(made_up()).set_index("version")
    worst, expected = (table.loc[version] for version in ROBUST)
    fuel = 100.0 * (0.97 / 0.99**2 - 1.0)
    for end in (*study.ENDS, "_without_errors"):
        assert worst[f"fuel_percent{end}"] == pytest.approx(fuel)
        assert worst[f"speed_loss_percent{end}"] == pytest.approx(1.0)
        assert expected[f"fuel_percent{end}"] == 0.0
    assert worst["shortfall_points"] == pytest.approx(np.mean([4.0, 3.0, 2.0, 1.0]))
    assert worst["shortfall_points_low"] < 2.5 < worst["shortfall_points_high"]
    assert worst["shortfall_points_without_errors"] == pytest.approx(5.0)
    # shares 0.99, 1.01, 1.03 and 1.05 in the draws
    assert (worst["nominal_violated"], worst["violated"]) == (0.75, 0.0)
    assert worst["nominal_shortfall_percent_where_violated"] == pytest.approx(3.0)
    assert worst["shortfall_percent_where_violated"] == pytest.approx(5.0)
    # in the first draw both keep the limit and the robust version burns less or more
    assert worst["better"] == (1.0 if fuel < 0.0 else 0.75)
    assert expected["better"] == 0.0


def test_a_row_of_the_page() -> None:
    page = study.page_table(study.compare(made_up()), study.BY_WAKE)
    assert page["version"].tolist() == list(ROBUST)
    assert page.loc[1, "fuel per mile %"] == "0"
    assert page.loc[0, "fuel per mile %"] == "-1.03"
    assert page.loc[0, "limit violated, nominal"].startswith("0.75 (0.30 to 0.95)")


def test_the_page_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "SHIPS", ("frigate", "ferry"))
    study.main(["--draws", "2", "--out", str(tmp_path)])
    table = pd.read_csv(tmp_path / "robust-optimiser.csv")
    assert len(table) == 2 * 2 * 2 * 2
    assert math.isfinite(table["fuel_percent"].sum())
    text = (tmp_path / "robust-optimiser.md").read_text()
    assert "in 2 draws with seeds 5000 to 5001" in text
    with pytest.raises(SystemExit):
        study.main(["--draws", "1"])
