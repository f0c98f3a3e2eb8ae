"""Units of products and quotients."""

from __future__ import annotations

from shaftline.mismatch.search.blocks import powers, quotient


def test_factors_behind_a_stroke_divide() -> None:
    assert powers("N m s/rad") == {"N": 1, "m": 1, "s": 1, "rad": -1}
    assert powers("m/s2") == {"m": 1, "s": -2}
    assert powers("-") == {}


def test_a_coefficient_has_the_unit_of_the_place_over_that_of_its_block() -> None:
    cubed = powers("m3/s3")
    assert quotient("N", cubed) == "N s3/m3"
    assert quotient("m/s", powers("m rad/s2")) == "s/rad"
    assert quotient("m/s", powers("m/s")) == "-"
    assert quotient("1/s", powers("rad")) == "1/s/rad"
