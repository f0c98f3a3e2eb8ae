"""Anti-spin on four ships: scaled storms, intervention, and outcomes."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd
import pytest

from reproductions import anti_spin_ships as study
from shaftline.baselines import combinator_curve
from shaftline.plant import load_ship


def test_the_storm_is_scaled_by_the_radius_of_the_propeller() -> None:
    ferry = load_ship("ferry")
    task = study.storm_of(ferry, study.LOADS["high"])
    assert task.load_ship(ferry).propeller.depth_m == pytest.approx(3.0 / 4.2)
    low = task.seas[0]
    assert isinstance(low, dict)
    assert low["hs_m"] == pytest.approx(5.0 / 4.2)
    assert low["tp_s"] == pytest.approx(12.4 / math.sqrt(4.2))
    top = float(combinator_curve(ferry).ship_speed[-1])
    assert task.speed_order_m_s == pytest.approx((0.7 * top, 0.9 * top))
    assert task.scale_orders(task.load_ship(ferry)).speed_order_m_s == task.speed_order_m_s


def test_a_limit_against_overspeed_stands_down_at_part_load(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "SHIPS", ("trawler",))
    monkeypatch.setattr(study, "SHORT_INTERVAL_S", study.INTERVAL_S)
    monkeypatch.setattr(study, "LOADS", {"part": study.LOADS["part"]})
    found = study.run_cases(tmp_path, 2, 1)
    trawler = {case.controller: kpis for case, kpis in found.items() if case.ship == "trawler"}
    assert trawler[study.GUARD].equals(trawler[study.WITHOUT])
    assert (trawler[study.GUARD][study.INTERVENTION] == 0.0).all()
    assert (trawler[study.PAPER][study.INTERVENTION] > 0.0).any()
    table = study.table_of({case: one for case, one in found.items() if case.ship == "trawler"})
    assert table["outcome"].tolist()[0] == "–"
    assert table["outcome"].tolist()[2] == "stands down"
    assert study.change_table(table)["overspeed s"].tolist()[1] == "0"


def test_an_outcome_names_what_the_intervals_decide() -> None:
    zero = {f"{n}_change_{end}": 0.0 for n in study.KPIS for end in ("low", "high")}
    row = {"controller": study.PAPER, study.INTERVENTION: 3.0} | zero
    assert study.outcome(row) == "no difference"
    less = row | {"overspeed_s_change_low": -2.0, "overspeed_s_change_high": -1.0}
    assert study.outcome(less) == "less overspeed"
    more = less | {"torque_sd_kN_m_change_low": 0.1, "torque_sd_kN_m_change_high": 0.3}
    assert study.outcome(more) == "less overspeed, more torque SD"


@pytest.mark.parametrize(("value", "digits"), [(123.4, 0), (12.3, 0), (1.23, 1), (-0.0123, 3)])
def test_numbers_keep_two_significant_digits(value: float, digits: int) -> None:
    assert study._digits(value) == digits


def test_tables_of_the_page(tmp_path: Path) -> None:
    properties = study.property_table(study.ship_files(tmp_path))
    assert properties["ship"].tolist() == list(study.SHIPS)
    assert properties["run-up time s"].to_numpy() == pytest.approx(
        [3.45, 0.82, 3.17, 3.13], abs=0.01
    )
    assert (properties["lowest limit rad/s"] < properties["highest shaft speed rad/s"]).all()
    assert isinstance(study.particulars_table(), pd.DataFrame)
    assert "needs a diesel" in study.refusal_of_an_electric_ship()
