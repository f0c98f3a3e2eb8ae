"""Units of products and quotients."""

from __future__ import annotations

from shaftline.mismatch.search.blocks import divide_units, unit_powers


def test_factors_behind_a_stroke_divide() -> None:
    assert unit_powers("N m s/rad") == {"N": 1, "m": 1, "s": 1, "rad": -1}
    assert unit_powers("m/s2") == {"m": 1, "s": -2}
    assert unit_powers("-") == {}


def test_a_coefficient_has_the_unit_of_the_place_over_that_of_its_block() -> None:
    cubed = unit_powers("m3/s3")
    assert divide_units("N", cubed) == "N s3/m3"
    assert divide_units("m/s", unit_powers("m rad/s2")) == "s/rad"
    assert divide_units("m/s", unit_powers("m/s")) == "-"
    assert divide_units("1/s", unit_powers("rad")) == "1/s/rad"
