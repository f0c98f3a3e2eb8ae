"""Tables of loggers: single texts and both decimal signs in columns of numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from shaftline.core.tables import TextCells, read_text_table

HEAD = "Schiff;MT Test\n\nZeit;Leistung;Zustand\n"


def logged(folder: Path, *powers: str) -> Path:
    path = folder / "log.csv"
    rows = (f"05.03.2026 08:56:{k:02d};{power};Fahrt\n" for k, power in enumerate(powers))
    path.write_text(HEAD + "".join(rows))
    return path


def test_a_text_in_a_column_of_decimal_commas_leaves_the_other_numbers(tmp_path: Path) -> None:
    table = read_text_table(logged(tmp_path, "1811,5", "1812", "Ausfall", "", "defekt", "1.8e3"))
    power = table["Leistung"]
    assert power.iloc[[0, 1, 5]].tolist() == [1811.5, 1812.0, 1800.0]
    assert power.iloc[2] == "Ausfall"
    assert table.attrs["text_cells"] == {"Leistung": TextCells(2, 6, "Ausfall")}
    assert table.attrs["text_cells"]["Leistung"].description("Leistung") == (
        "column 'Leistung', line 6: 'Ausfall' is not a number (nor is 1 further cell)"
    )


def test_the_line_of_a_text_counts_empty_lines(tmp_path: Path) -> None:
    path = logged(tmp_path, "1811,5", "1812,0", "1813,0", "Ausfall")
    path.write_text(path.read_text().replace("05.03.2026 08:56:02", "\n\n05.03.2026 08:56:02"))
    assert read_text_table(path).attrs["text_cells"]["Leistung"].line == 9


@pytest.mark.parametrize(
    ("powers", "sign"),
    [
        (("1811,5", "1812.0", "1813,5", "1814.0", "1815,5"), "point"),
        (("1811.5", "1812,0", "1813.5", "1814,0", "1815.5"), "comma"),
    ],
)
def test_both_decimal_signs_in_one_column_are_read_and_reported(
    powers: tuple[str, ...], sign: str, tmp_path: Path
) -> None:
    given = {"decimal": "," if sign == "point" else "."}
    table = read_text_table(logged(tmp_path, *powers), given)
    assert table["Leistung"].tolist() == [1811.5, 1812.0, 1813.5, 1814.0, 1815.5]
    assert table["Leistung"].dtype == float
    assert table.attrs["remarks"] == [
        f"2 numbers have a decimal {sign}, unlike the others of their columns (in column 'Leistung' 2 "
        "of 5); both signs are read as decimal signs"
    ]


def test_a_sign_that_may_separate_thousands_is_not_guessed(tmp_path: Path) -> None:
    table = read_text_table(logged(tmp_path, "998,5", "999,0", "999,5", "1.002"))
    assert table.attrs["text_cells"]["Leistung"].text == "1.002"
    assert table.attrs["remarks"] == []
