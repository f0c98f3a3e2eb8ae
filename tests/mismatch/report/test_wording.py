"""Words and numbers as an engineer reads them."""

from __future__ import annotations

import math

import pytest

from shaftline.mismatch.report.wording import (
    axis_label,
    breakable_key,
    capitalise,
    channel_name,
    effect_words,
    number,
    parameter_words,
    scale_unit,
    superscript,
    time_span,
    value_with_unit,
    windows_in_words,
)

from ..toy import entry


def test_numbers_are_readable() -> None:
    assert number(0.0) == "0"
    assert number(8.0) == "8.00"
    assert number(-1541.28) == "−1540"
    assert number(23956.0) == "24 000"
    assert number(5.34e-5) == "5.34·10⁻⁵"
    assert number(float("inf")) == "∞"
    assert number(0.09996) == "0.100"
    assert value_with_unit(13900.0, "N m") == "13.9 kN m"
    assert value_with_unit(571.0, "kg m2") == "571 kg m²"
    assert value_with_unit(0.03, "-") == "0.0300"
    assert scale_unit(3.4e6, "N") == (1e6, "MN")
    assert (
        parameter_words("coulomb_friction_engine_side_N_m", "N m") == "coulomb friction engine side"
    )
    assert parameter_words("dead_band", "-") == "dead band"
    assert windows_in_words([(0.0, 1200.0)], 1200.0).startswith("the whole recording")


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (math.nan, 3, "?"),
        (-math.inf, 3, "−∞"),
        (0.00123, 3, "0.00123"),
        (0.0009996, 3, "0.00100"),
        (0.000996, 3, "9.96·10⁻⁴"),
        (0.0000996, 3, "9.96·10⁻⁵"),
        (999_400.0, 3, "999 000"),
        (999_600.0, 3, "1.00·10⁶"),
        (9_994.0, 3, "9990"),
        (9_996.0, 3, "10 000"),
        (-1.2345, 5, "−1.2345"),
        (12.0, 1, "10"),
        (-2.5e7, 2, "−2.5·10⁷"),
    ],
)
def test_numbers_keep_their_digits(value: float, digits: int, text: str) -> None:
    assert number(value, digits) == text


def test_large_forces_have_prefixes() -> None:
    assert scale_unit(999.0, "N m") == (1.0, "N m")
    assert scale_unit(1000.0, "N m") == (1e3, "kN m")
    assert scale_unit(999_999.0, "N") == (1e3, "kN")
    assert scale_unit(1e6, "N m") == (1e6, "MN m")
    assert scale_unit(1e9, "kg m2") == (1.0, "kg m²")
    assert value_with_unit(-13900.0, "N m") == "−13.9 kN m"
    assert value_with_unit(math.inf, "N m") == "∞ N m"
    assert superscript("N m s2/rad2") == "N m s²/rad²"
    assert (superscript("-"), axis_label("pitch", ""), axis_label("speed", "m/s")) == (
        "",
        "pitch",
        "speed [m/s]",
    )


def test_channels_have_names_for_people() -> None:
    assert channel_name("shaft_torque_N_m") == ("shaft torque", "N m")
    assert channel_name("pitch_ratio") == ("pitch ratio", "")
    assert channel_name("motor_voltage_V") == ("motor voltage demand", "V")
    assert channel_name("fuel_rack_mm") == ("fuel rack demand", "mm")
    assert channel_name("extra") == ("extra", "")
    assert capitalise(effect_words(entry("hull-fouling (hull)"))) == "Hull fouling"
    assert effect_words(entry("coulomb-friction (engine)")) == "Coulomb friction"
    assert breakable_key("a_b.c<d") == "a_<wbr>b.<wbr>c&lt;d"


def test_stretches_of_time_are_whole_seconds_unless_short() -> None:
    assert time_span(0.04, 20.04) == "0 to 20 s"
    assert time_span(0.04, 20.0) == "0.0 to 20.0 s"
    assert windows_in_words([], 100.0) == "not located"
    assert windows_in_words([(0.0, 98.0)], 100.0) == "the whole recording, 0 to 100 s"
    assert windows_in_words([(0.0, 97.9)], 100.0) == "0 to 98 s"
    assert windows_in_words([(1.0, 100.0)], 100.0) == "1 to 100 s"
    six = [(100.0 * i, 100.0 * i + 50.0) for i in range(6)]
    assert windows_in_words(six, 9e9).count(" to ") == 6
    assert "more" not in windows_in_words(six, 9e9)
    assert windows_in_words([*six, (900.0, 950.0)], 9e9).endswith("500 to 550 s and 1 more")
