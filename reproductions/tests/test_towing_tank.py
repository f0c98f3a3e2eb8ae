"""The rig's tests against the paper's Table 1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reproductions.cells import Kind, Verdict
from reproductions.towing_tank import page
from reproductions.towing_tank.experiment import Air, Programme
from shaftline.plant import load_ship


@pytest.fixture(scope="module")
def pair() -> page.Pair:
    return page.pair(Air().ship(load_ship("towing-tank")), Programme())


def test_levels_with_anti_spin_are_the_printed_ones(pair: page.Pair) -> None:
    assert pair.on[:3] == pytest.approx(page.PRINTED["anti-spin"], rel=0.005)


def test_ratios_of_table_1(pair: page.Pair) -> None:
    """The test without anti-spin is never calibrated."""
    thrust, power, efficiency = pair.ratios
    assert thrust == pytest.approx(79.2 / 89.1, abs=0.05)
    assert power == pytest.approx(290.0 / 378.0, abs=0.05)
    assert 1.10 < efficiency < 0.151 / 0.123  # a gain, smaller than the printed one
    assert thrust / power * pair.carriage == pytest.approx(efficiency, rel=1e-12)


@pytest.mark.slow
def test_calibration_is_what_the_file_and_the_programme_hold() -> None:
    programme, friction = page.calibrate(Air())
    held = Programme()
    assert programme.thrust_N == pytest.approx(held.thrust_N, rel=0.002)
    assert programme.carriage_m_s == pytest.approx(held.carriage_m_s, rel=0.002)
    assert friction == pytest.approx(
        load_ship("towing-tank").transmission.coulomb_friction_engine_side_N_m, abs=0.01
    )


def test_programme_turns_the_shaft_against_the_inflow() -> None:
    programme = Programme()
    times = np.arange(0.0, 60.0, 0.01)
    thrust, carriage = programme.thrust(times), programme.carriage(times)
    assert (thrust.max(), thrust.min()) == (programme.thrust_N, -programme.thrust_N)
    against = times[thrust * carriage < 0.0]
    assert 0.5 < np.ptp(against) < 2.0
    assert programme.submergence(times).min() == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
def test_page_has_every_row(tmp_path: Path) -> None:
    ticks: list[int] = []
    found = page.compute_results(lambda: ticks.append(1))
    assert len(ticks) == page.TICKS
    made = page.page(found)
    kinds = [cell.kind for cell in made.cells if cell.table == "Table 1"]
    assert kinds == [Kind.CALIBRATED] * 3 + [Kind.FREE] * 3
    assert {cell.kind for cell in made.cells if "highest" in cell.row} == {Kind.INPUT}
    near = next(cell for cell in made.cells if "h/R" in cell.row)
    assert near.ours == found.pair.near
    assert (near.verdict == Verdict.MET) == (0.95 <= found.pair.near <= 1.05)
    assert set(made.numbers["ratios"]) == {"thrust", "power", "eta_E"}
    assert len(made.figures) == 4
