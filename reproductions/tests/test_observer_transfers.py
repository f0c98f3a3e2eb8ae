"""Tables 3-1 to 3-10: the observers' own matrices, the closed forms and the print agree."""

from __future__ import annotations

import numpy as np
import pytest

from reproductions.thesis import observer_transfers as study
from shaftline.plant import Ship


def test_linear_observers_are_printed_and_follow(frigate: Ship) -> None:
    """Zeros to 0.1 %, gains to 1 %; rounding below 1e-6 stands for 0."""
    table = study.linear_transfers(frigate)
    assert len(table) == 16
    for cell in table.to_dict("records"):
        for kind, share in (("zero", 1e-3), ("gain", 1e-2)):
            printed = cell[f"{kind} printed"]
            printed = 0.0 if abs(printed) < 1e-6 else printed
            follows, ours = cell[f"{kind} follows"], cell[f"{kind} ours"]
            assert ours == pytest.approx(follows, rel=1e-6, abs=1e-12, nan_ok=True), cell
            assert ours == pytest.approx(printed, rel=share, abs=1e-12, nan_ok=True), cell


def test_gains_are_the_printed_two_digits(frigate: Ship) -> None:
    for name, printed in study.PRINTED_GAINS.items():
        found = study.gains(name, frigate)
        assert [float(f"{value:.1e}") for value in found] == pytest.approx(printed)


def test_a_wrong_inertia_would_show(frigate: Ship) -> None:
    """k2 goes with I_R, and so the printed -1.4e13 determines it."""
    wrong = frigate.with_values({"transmission.inertia_propeller_side_kg_m2": 2e4})
    assert study.gains("luenberger-high", wrong)[1] == pytest.approx(-2e13)


def test_the_pole_of_the_invariance_observer(frigate: Ship) -> None:
    """0 as eq. 3-13 is printed; gamma (dM_p/dv_a) / I_R of the observer, twenty times for gamma 20."""
    table = study.invariance_transfers(frigate)
    assert np.all(table["pole as eq. 3-13 is printed"] == table["pole printed"])
    own = table.set_index(["point", "gamma"])["pole of the observer"]
    for point in "AD":
        assert own[point, 20.0] == pytest.approx(20.0 * own[point, 1.0])
    assert own["A", 1.0] == pytest.approx(-0.6311, abs=1e-3)


def test_as_printed_it_has_the_zero_of_table_3_9(frigate: Ship) -> None:
    """-(dM_p/domega) / I_R: -0.1481 printed at A, from a coarse table; ours from the exact slope."""
    system = study.immersion_invariance(frigate, "A", 1.0, as_printed=True)
    (zero,) = system[0, 0].zeros().real
    assert -0.7 < zero < 0.0
    assert np.abs(system(1j * 1e-4, squeeze=False))[0, 0] > 100.0  # a pole at 0
