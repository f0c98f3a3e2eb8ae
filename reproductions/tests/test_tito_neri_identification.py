"""The identification paper's Table 5 and Bode figures again, and its methods on known truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions.cells import Kind, Verdict
from reproductions.tito_neri import experiments, identification, identification_page
from reproductions.tito_neri import identification as study
from reproductions.tito_neri.identification import given_cells, left_open, table_five_cells
from shaftline.display.figures import save
from shaftline.mismatch.identification.frequency import SPEED
from shaftline.plant import load_ship


def test_table_five() -> None:
    """Column IV within 2 % of the printed numbers; I within 4 %, its KQ within 7 %."""
    table = study.table_five().set_index(["set", "parameter"])
    assert table.loc["IV", "difference_percent"].abs().max() < 2.0
    assert len(table.loc["IV"]) == 6
    first = table.loc["I", "difference_percent"].abs()
    assert first.drop("KQ0_over_eta_R").max() < 4.0
    assert first["KQ0_over_eta_R"] < 7.0
    assert table.loc[("I", "K_e"), "ours"] == pytest.approx(0.01421, abs=5e-6)


def test_both_sets_in_time() -> None:
    """The paper: set I within 3 % everywhere, IV good about C and worse away; its peak is higher."""
    table, figure = identification_page.simulate_in_time()
    by = table.set_index("set")
    assert by.loc["I", "largest [%]"] < 3.0 < by.loc["IV", "largest [%]"] < 8.5
    assert by.loc["I", "B [rpm]"] == pytest.approx(44.4, abs=0.5)
    assert abs(by.loc["IV", "C [rpm]"]) < 5.0 < 80.0 < by.loc["IV", "A [rpm]"]
    assert by.loc["I", "peak C to D [A]"] == pytest.approx(1.705, abs=0.005)
    assert by.loc["IV", "peak C to D [A]"] == pytest.approx(1.948, abs=0.005)
    assert len(figure.axes) == 6


def test_rounding_of_table_four() -> None:
    """The page of remaining systems: standard deviations of 4000 draws."""
    spread = study.rounding_of_column_one(60).loc["std"]
    expected = {"K_e": 0.00013, "R_a": 0.022, "M_f": 0.00014, "KQ0_over_eta_R": 0.0008}
    for name, size in expected.items():
        assert spread[name] == pytest.approx(size, rel=0.25), name


def test_density_by_the_sets() -> None:
    table = identification_page.densities().set_index("density_kg_m3")
    assert table.loc[1025.0, "I_worst_speed_percent"] == pytest.approx(2.85, abs=0.01)
    assert table.loc[1000.0, "I_worst_speed_percent"] == pytest.approx(3.25, abs=0.01)
    assert table.loc[1025.0, "I_KQ_over_K_e"] == pytest.approx(0.102 / 0.0137, rel=0.01)
    assert table.loc[1000.0, "I_KQ_over_K_e"] > 1.02 * 0.102 / 0.0137
    assert load_ship(study.SETS["I"]).water.density_kg_m3 == 1025.0


def test_inductance_and_dead_time_of_table_two() -> None:
    fits, best = study.fits_of_table_two()
    ways = fits.set_index("errors weigh")
    plain = ways.loc["all alike, as printed"]
    expected = {
        "K_e": 0.01854,
        "R_a": 1.475,
        "I_p": 3.21e-5,
        "M_f": 0.01685,
        "L_a": 2.8e-4,
        "KQ0_over_eta_R": 0.141,
    }
    for name, value in expected.items():
        assert plain[name] == pytest.approx(value, rel=0.01), name
    late, prompt = ways.loc["by size, speed late"], ways.loc["by size"]
    assert late["delay_ms"] == pytest.approx(1.5, abs=2.0 * late["delay_error_ms"])
    assert late["delay_error_ms"] < 0.4
    assert prompt["L_a"] == pytest.approx(6.0e-4, rel=0.02)
    assert late["L_a"] < 3.2e-4
    assert late["misfit"] < 0.6 * prompt["misfit"]
    assert best.sensors.speed_delay_s == pytest.approx(1e-3 * late["delay_ms"])
    five = study.five_numbers()
    assert (five["s1"], five["s2"], five["z1"]) == pytest.approx((-5310, -9.34, -2.14), rel=2e-3)


def test_dead_time_of_the_speed_s_phase() -> None:
    table = study.dead_time().set_index("frequency_rad_s")
    assert table.loc[100.0, "IV_deg"] == pytest.approx(-8.3, abs=0.1)
    assert table.loc[500.0, "IV_deg"] == pytest.approx(-44.6, abs=0.1)
    assert table["IV_ms"].tolist() == pytest.approx([1.46, 1.56], abs=0.01)
    assert study.fitted_dead_time()["IV"][0] == pytest.approx(1.5, abs=0.1)


def test_kinds_and_tolerances_of_table_five() -> None:
    rounding = study.rounding_of_column_one(60)
    cells = {(cell.row, cell.column): cell for cell in table_five_cells(rounding)}
    assert len(cells) == 12
    assert {cell.kind for cell in cells.values()} == {Kind.FREE}
    assert all(cell.kind is Kind.INPUT for cell in given_cells())
    # the torque balance fixes M_f and KQ to K_e, which itself is off
    assert cells["K_e", "set I"].verdict is Verdict.UNEXPLAINED
    assert cells["M_f", "set I"].verdict is Verdict.EXPLAINED
    assert cells["KQ0_over_eta_R", "set I"].verdict is Verdict.EXPLAINED
    assert cells["L_a", "set I"].verdict is Verdict.UNEXPLAINED  # the step was not published
    slack = left_open(rounding)
    assert slack["IV", "K_e"] < 0.02 * 0.0183


def test_no_other_least_squares_gives_the_printed_pair() -> None:
    """The whole table gives 0.01421 and 2.256; points B, C and E come nearest, 0.7 % off."""
    table = identification.least_squares_variants().set_index("way")
    assert table.loc["points ABCDE", "K_e"] == pytest.approx(0.014207, abs=1e-6)
    assert table["off [%]"].min() == pytest.approx(0.68, abs=0.01)
    assert table.index[0] == "points BCE"


def test_page_and_figures(tmp_path: Path) -> None:
    fits, best = study.fits_of_table_two()
    known = pd.DataFrame([{"set": "I", "method": "steady", "worst_percent": 0.1}])
    found = identification_page.Findings(
        study.table_five(),
        study.rounding_of_column_one(5),
        identification_page.densities(),
        fits,
        best,
        study.five_numbers(),
        study.dead_time(),
        study.fitted_dead_time(),
        known,
        *identification_page.simulate_in_time(),
    )
    page = identification_page.page(found)
    assert page.file == "tito-neri-identification"
    assert "| IV | L_a | H |" in page.body
    assert "dead time of 1.5 ms" in page.body
    for name in ("tito-neri-bode", "tito-neri-histories"):
        save(page.figures[name], tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


def test_experiments_are_the_paper_s() -> None:
    stairs = experiments.staircase()
    assert np.unique(stairs.voltage).tolist() == [3.91, 4.91, 5.89, 6.88, 7.87]
    assert len(experiments.sines()) == 9
    noise = experiments.noise(10.0).voltage
    assert noise.mean() == pytest.approx(5.89)
    assert noise.std() == pytest.approx(0.05 * 5.89)
    power = np.abs(np.fft.rfft(noise - 5.89)) ** 2
    turn = 2.0 * np.pi * np.fft.rfftfreq(len(noise), experiments.USUAL_S)
    assert power[turn > 1001.0].sum() < 1e-9 * power.sum()
    assert np.ptp(experiments.mix().voltage) > 3.0


def test_a_recorded_experiment_has_what_the_methods_need() -> None:
    table = experiments.simulate_test(
        load_ship(study.SETS["IV"]), experiments.staircase((5.0, 6.0), 0.1)
    )
    assert list(table) == ["time_s", "motor_voltage_V", SPEED, "motor_current_A"]
    assert table["motor_current_A"].max() > 1.2


@pytest.mark.slow
def test_each_method_on_known_truth() -> None:
    table = study.on_known_truth()
    assert (table["worst_percent"] < table["allowed_percent"]).all()
