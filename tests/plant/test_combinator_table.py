"""Combinator tables: in the ship file, as files of their own, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from shaftline.baselines import Combinator, combinator_curve
from shaftline.plant import ShipError, load_ship, write_ship
from shaftline.plant.order_tables import with_combinator_table

FRIGATE = load_ship("frigate")
TABLE = {
    "lever": (0.0, 0.5, 1.0),
    "shaft_speed_rpm": (70.0, 90.0, 130.0),
    "pitch_ratio": (0.7, 1.3, 1.35),
}


def test_a_table_by_lever_gives_its_settings_and_reaches_the_order_in_calm_water() -> None:
    ship = FRIGATE.with_values({"combinator": TABLE})
    curve = combinator_curve(ship)
    for lever, rpm, pitch in zip(*TABLE.values(), strict=True):
        row = int(np.flatnonzero(curve.lever == lever)[0])
        assert curve.shaft_speed[row] * 30.0 / math.pi == pytest.approx(rpm)
        assert curve.pitch_ratio[row] == pytest.approx(pitch)
    controller = Combinator(ship)
    usual = Combinator(FRIGATE).set_points(6.0)
    assert controller.set_points(6.0)[0] < usual[0] - 0.05  # less pitch than the standard curve
    for order in (4.0, 6.3, 8.9):
        assert controller.steady_point(order).ship_speed == pytest.approx(order, abs=2e-3)


def test_a_table_by_ordered_speed_holds_as_it_is() -> None:
    table = {
        "speed_order_m_s": (3.0, 7.0, 9.5),
        "shaft_speed_rpm": (60.0, 90.0, 130.0),
        "pitch_ratio": (0.8, 1.3, 1.4),
    }
    curve = combinator_curve(FRIGATE.with_values({"combinator": table}))
    points = curve.set_points([2.0, 5.0, 8.25])
    assert points.shaft_speed * 30.0 / math.pi == pytest.approx([60.0, 75.0, 110.0])
    assert points.pitch_ratio == pytest.approx([0.8, 1.05, 1.35])


def test_the_plant_does_not_depend_on_the_table() -> None:
    assert FRIGATE.with_values({"combinator": TABLE}).record() == FRIGATE.record()


def test_a_fixed_pitch_needs_no_pitch_column() -> None:
    fixed = FRIGATE.with_values({"propeller.pitch_ratio_min": 1.4})
    table = {key: TABLE[key] for key in ("lever", "shaft_speed_rpm")}
    curve = combinator_curve(fixed.with_values({"combinator": table}))
    assert set(curve.pitch_ratio) == {1.4}


@pytest.mark.parametrize(
    "text",
    [
        "lever_percent,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n50,90,1.3\n100,130,1.35\n",
        "lever;shaft_speed_rad_s;pitch_ratio;remark\n0;7,33038;0,7;idle\n"
        "0,5;9,42478;1,3;\n1;13,61357;1,35;full\n",
    ],
)
def test_csv_of_other_programs(tmp_path: Path, text: str) -> None:
    (tmp_path / "lever.csv").write_text(text)
    read = with_combinator_table(FRIGATE, tmp_path / "lever.csv").combinator
    for name, values in TABLE.items():
        assert getattr(read, name) == pytest.approx(values, rel=1e-5)


def test_toml_with_and_without_its_section_and_ship_files(tmp_path: Path) -> None:
    ship = FRIGATE.with_values({"combinator": TABLE})
    bare = "\n".join(f"{name} = {list(values)}" for name, values in TABLE.items())
    (tmp_path / "bare.toml").write_text(bare)
    (tmp_path / "section.toml").write_text(f"[combinator]\n{bare}\n")
    write_ship(ship, tmp_path / "ship.toml")
    assert load_ship(tmp_path / "ship.toml") == ship
    for name in ("bare", "section", "ship"):
        assert with_combinator_table(FRIGATE, tmp_path / f"{name}.toml") == ship


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"lever": (0.0, 0.5, 0.5)}, "lever, row 3: 0.5 does not exceed 0.5"),
        ({"lever": (0.0, 0.5, 1.5)}, "lever.2 = 1.5: input should be less than or equal to 1"),
        ({"shaft_speed_rpm": (70.0, 90.0, 150.0)}, "shaft_speed_rpm, row 3: 150 lies outside"),
        ({"pitch_ratio": (0.5, 1.3, 1.35)}, "pitch_ratio, row 1: 0.5 lies outside .* 0.6 to 1.4"),
        ({"pitch_ratio": (0.7, 1.3)}, "pitch_ratio has 2 rows and lever 3"),
        ({"pitch_ratio": ()}, "the column pitch_ratio is missing"),
        (
            {"speed_order_m_s": (3.0, 6.0, 9.0)},
            "lever or the column speed_order_m_s, one of the two",
        ),
        ({"lever": ()}, "lever or the column speed_order_m_s"),
        ({"rpm": (1.0,)}, "rpm is not a known key"),
    ],
)
def test_bad_tables(changes: dict[str, tuple[float, ...]], words: str) -> None:
    with pytest.raises(ShipError, match=f"combinator.*{words}"):
        FRIGATE.with_values({"combinator": TABLE | changes})


def test_a_lever_position_near_a_point_of_the_grid_is_one_point() -> None:
    """0.3 is 12 of 40 steps of the curve, but 0.30000000000000004 as a float."""
    table = TABLE | {"lever": (0.0, 0.3, 1.0)}
    lever = combinator_curve(FRIGATE.with_values({"combinator": table})).lever
    assert np.sum(np.abs(lever - 0.3) < 1e-6) == 1
    assert np.diff(lever).min() > 1e-3


def test_a_table_needs_a_diesel() -> None:
    with pytest.raises(ShipError, match="needs a ship with a diesel and a propeller"):
        load_ship("tito-neri-sine").with_values({"combinator": TABLE})


def test_the_ship_speed_must_rise_along_the_table() -> None:
    falling = TABLE | {"shaft_speed_rpm": (130.0, 90.0, 70.0), "pitch_ratio": (1.35, 1.3, 0.7)}
    with pytest.raises(ValueError, match=r"from lever 0 to 0\.025 the speed goes from"):
        combinator_curve(FRIGATE.with_values({"combinator": falling}))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "lever,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n1,,1.3\n", "rpm, row 2: nan"),
        ("a.csv", "lever,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n1,full,1.3\n", "row 2: 'full'"),
        ("a.csv", "lever,lever_percent,pitch_ratio\n0,0,1\n1,100,1\n", "are the same quantity"),
        ("a.csv", "position,rpm\n0,70\n1,130\n", "no column of a .*; found: position, rpm"),
        ("a.csv", "lever,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n100,130,1.3\n", "lever.1 = 100"),
        ("a.toml", "lever = [0, 1", "not valid TOML"),
        ("a.toml", "", "has no combinator table"),
        ("none.csv", None, "none.csv"),
    ],
)
def test_bad_files(tmp_path: Path, name: str, text: str | None, words: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ShipError, match=words) as refused:
        with_combinator_table(FRIGATE, tmp_path / name)
    assert name in str(refused.value)
