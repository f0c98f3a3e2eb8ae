"""The identified ship, and parameters with which no simulation stays finite."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.identification.parameters import MethodResult
from shaftline.mismatch.identify import _refuse_diverged, identification_without_fit

from .benches import tug

KEY = "transmission.inertia_engine_side_kg_m2"


def found(value: float) -> MethodResult:
    return MethodResult((KEY,), (value,), np.array([[1e-12]]))


def test_steady_states_give_a_ship_and_how_well_it_is_known() -> None:
    one = identification_without_fit(
        "steady", tug(), found(3e-4), {"hull.mass_kg": "it moves nothing"}
    )
    assert one.identified.parameter(KEY).value == 3e-4
    assert one.identified.tolerances.numbers[KEY] == pytest.approx(1e-6)
    assert one.left_out == {"hull.mass_kg": "it moves nothing"}


def test_parameters_that_cannot_be_simulated_are_refused() -> None:
    good, bad = np.ones(3), np.array([1.0, np.nan, np.inf])
    one = identification_without_fit("ekf", tug(), found(1.0), {})
    _refuse_diverged(one, {"ship_speed_m_s": good})
    with pytest.raises(
        ValueError, match=r"ekf: .*inertia_engine_side_kg_m2 = 1.*ship_speed_m_s diverges"
    ):
        _refuse_diverged(one, {"shaft_speed_rad_s": good, "ship_speed_m_s": bad})
