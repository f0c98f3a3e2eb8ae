"""Holtrop and Mennen's method against the examples that its papers print."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from shaftline.plant.holtrop import HullForm, interaction, resistance

KNOT = 1852.0 / 3600.0

SHIP_1982: dict[str, float] = {
    "length_m": 205.0,
    "beam_m": 32.0,
    "draught_m": 10.0,
    "displacement_m3": 37500.0,
    "midship_coefficient": 0.98,
    "waterplane_coefficient": 0.75,
    "lcb_percent": -0.75,
    "transom_area_m2": 16.0,
    "bulb_area_m2": 20.0,
    "bulb_centre_m": 4.0,
    "appendage_area_m2": 50.0,
    "appendage_factor": 1.5,
    "stern_shape": 10.0,
}
SHIP_1984: dict[str, float] = {
    "length_m": 50.0,
    "beam_m": 12.0,
    "draught_m": 3.2,
    "draught_forward_m": 3.1,
    "draught_aft_m": 3.3,
    "displacement_m3": 900.0,
    "midship_coefficient": 0.78,
    "waterplane_coefficient": 0.8,
    "lcb_percent": -4.5,
    "transom_area_m2": 10.0,
    "appendage_area_m2": 50.0,
    "appendage_factor": 3.0,
    "entrance_angle_deg": 25.0,
    "wetted_surface_m2": 584.9,
}


@pytest.mark.parametrize(
    ("name", "printed", "digits"),
    [
        ("prismatic_coefficient", 0.5833, 4),
        ("length_of_run", 81.385, 3),
        ("wetted_surface", 7381.45, 2),
        ("entrance_angle", 12.08, 2),
        ("bulb_factor", 0.7595, 4),
        ("correlation_allowance", 0.000352, 6),
    ],
)
def test_values_that_both_papers_share_equal_the_example_of_1982(
    name: str, printed: float, digits: int
) -> None:
    assert round(getattr(HullForm(**SHIP_1982), name), digits) == printed


def test_components_that_both_papers_share_equal_the_example_of_1982() -> None:
    parts = resistance(HullForm(**SHIP_1982), 25.0 * KNOT)
    assert parts.appendages == pytest.approx(8830.0, rel=1e-3)
    assert parts.bulb == pytest.approx(49.0, rel=0.01)
    assert parts.correlation == pytest.approx(221_980.0, rel=1e-3)
    assert parts.transom == 0.0
    assert interaction(HullForm(**SHIP_1982), 8.0, 25.0 * KNOT, 1, 0.7393)[2] == pytest.approx(
        0.9931, abs=5e-5
    )


@pytest.mark.parametrize(
    ("knots", "printed_kN"), [(25, 662), (27, 715), (29, 756), (31, 807), (33, 864), (35, 925)]
)
def test_total_resistance_equals_the_example_of_1984(knots: float, printed_kN: float) -> None:
    # within 1 kN: the paper rounds to 1 kN, and its g and viscosity have fewer digits
    total = resistance(HullForm(**SHIP_1984), knots * KNOT).total
    assert total / 1e3 == pytest.approx(printed_kN, abs=1.0)


def test_the_wave_resistance_is_continuous_where_the_formulas_change() -> None:
    hull = HullForm(**SHIP_1984)
    for froude in (0.4, 0.55):
        speed = froude * (9.81 * hull.length_m) ** 0.5
        below, above = (resistance(hull, speed * f).waves for f in (0.9999, 1.0001))
        assert above == pytest.approx(below, rel=2e-3)


def test_two_propellers_have_a_regression_of_their_own_and_three_are_refused() -> None:
    hull = HullForm(**SHIP_1984)
    with pytest.raises(ValueError, match="screws = 3: the regression has ships with 1 or 2"):
        interaction(hull, 2.5, 15.0, 3)
    wake, deduction, rotative = interaction(hull, 2.5, 15.0, 2, pitch_ratio=1.1)
    block = hull.block_coefficient
    assert deduction == pytest.approx(0.325 * block - 0.1885 * 2.5 / (12.0 * 3.2) ** 0.5)
    assert 0.0 < wake < 0.1
    assert 0.95 < rotative < 1.05


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"displacement_m3": 70000.0}, "block coefficient of 1.07"),
        ({"midship_coefficient": 0.5}, "prismatic coefficient is 1.14"),
        ({"bulb_centre_m": 8.0}, "bulb_centre_m = 8 must be at most 0.6 of the draught forward"),
        ({"length": 3.0}, "Extra inputs are not permitted"),
    ],
)
def test_dimensions_that_fit_no_ship_are_refused(change: dict[str, float], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        HullForm(**(SHIP_1982 | change))


def test_a_speed_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="speed_m_s = 0 must be above 0"):
        resistance(HullForm(**SHIP_1982), 0.0)
