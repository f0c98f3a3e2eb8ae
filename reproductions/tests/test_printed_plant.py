"""The plant that the thesis's printed poles, zeros and gains imply."""

from __future__ import annotations

import numpy as np
import pytest

from reproductions import errata
from reproductions.thesis import printed_plant
from reproductions.thesis.poles import poles_zeros_gain, printed_line
from shaftline.plant import Ship
from shaftline.plant.open_water import open_water


@pytest.mark.parametrize("point", printed_plant.POINTS)
def test_it_has_the_numbers_it_was_not_made_from(frigate: Ship, point: str) -> None:
    """Gains from the rack and the inflow (Tables 2-6, 2-7, 2-12, 2-13) to 2 %, zeros to their "
    "rounding."""
    system = printed_plant.implied_plant(frigate, point).system
    for table, output, source in (
        ("2-6", "shaft_speed", "drive"),
        ("2-7", "ship_speed", "drive"),
        ("2-12", "shaft_speed", "inflow"),
        ("2-13", "ship_speed", "inflow"),
    ):
        _, zeros, gain = poles_zeros_gain(system[output, source])
        told = printed_line(table, point)
        assert gain == pytest.approx(told.gain, rel=0.025), table
        assert zeros == pytest.approx(told.zeros, rel=0.02), table


def test_point_a_s_row_gives_the_gauge_of_every_point(frigate: Ship) -> None:
    table = printed_plant.repeated_row(frigate)
    assert len(table) == 12
    by_a = table["gain, row of A"] / table["gain printed"]
    assert by_a.to_numpy() == pytest.approx(1.0, abs=0.04)
    own = table["gain, row of own"] / table["gain printed"]
    assert (own - 1.0).abs().min() > 0.5
    found = table[table["table"] == "2-8"]["zeros, row of A"].tolist()
    assert [float(text.split(", ")[1]) for text in found] == pytest.approx(
        [-0.6666, -0.8914, -1.8938], abs=2e-4
    )


def test_point_a_s_own_row_is_the_printed_one(frigate: Ship) -> None:
    system = printed_plant.implied_plant(frigate, "A").system
    for table, source in printed_plant.GAUGE.items():
        gain = poles_zeros_gain(system["shaft_torque", source])[2]
        assert gain == pytest.approx(printed_line(table, "A").gain, rel=2e-3)


def test_no_difference_of_the_curve_is_as_steep_as_the_print(frigate: Ship) -> None:
    found = printed_plant.slopes(frigate).set_index(["point", "coefficient"])
    assert found.loc[("A", "KQ"), "implied slope"] == pytest.approx(-0.0398, abs=1e-4)
    assert found.loc[("C", "KQ"), "implied slope"] == pytest.approx(-0.1117, abs=1e-4)
    curve = frigate.record()["kq"]
    for point, pitch in (("A", 0.6), ("B", 0.6), ("C", 1.4), ("D", 1.4)):
        line = found.loc[(point, "KQ")]
        assert line["implied"] == pytest.approx(line["B5-90"], rel=0.015)
        assert line["implied slope"] < 1.04 * line["steepest slope of B5-90 at this pitch"]
        j = line["J"]
        for step in (0.01, 0.05, 0.1, 0.2, 0.5):
            for ends in ((j - step, j), (j, j + step), (j - step, j + step)):
                low, high = (open_water(curve, end, pitch) for end in ends)
                if ends[0] >= 0.0 and high > 0.0:
                    assert (high - low) / (ends[1] - ends[0]) > line["implied slope"]


def test_no_other_propeller_of_the_series_has_the_slopes(frigate: Ship) -> None:
    table = printed_plant.other_propellers(frigate)
    slopes = table[[name for name in table if name.startswith("d")]].abs().max(axis=1)
    assert slopes.min() > 10.0
    assert table["rms [%]"].is_monotonic_increasing


def test_the_errata_contain_their_calculation() -> None:
    found = {one.where: one.shown for one in errata.errata()}
    assert "0.0236 1/s, as printed (-0.0236); c1 v_s^2 / m_s is 0.1395" in found["eq. 2-35, a33"]
    assert "0.0384" in found["eq. 3-7"]
    assert "0.0061" in found["eq. 3-7"]
    row = found["Tables 2-5, 2-8, 2-11 and 2-14 at B, C and D"]
    numbers = 4716 * 0.2548 - 7513 * 0.2117 + 2120  # as a reader repeats it
    assert numbers == pytest.approx(1731, abs=1.0)
    assert "= 1731 (printed 1730.5)" in row
    assert np.all([shown.strip() for shown in found.values()])
