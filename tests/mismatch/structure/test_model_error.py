"""Estimated parameters of a ship that lacks physics."""

from __future__ import annotations

import pytest

from shaftline.mismatch import identify

from .rigs import COULOMB, INERTIA, motor, run

OPEN = "prime_mover.open_circuit_fraction"
TRUE = {INERTIA: 1.25e-3}


def test_missing_physics_widens_the_interval_of_the_inertia_and_is_reported() -> None:
    lacking = TRUE | {COULOMB: 0.02, OPEN: 1.0}
    found = identify(
        motor(), run(lacking, 1), run(lacking, 3), hold_out=[run(lacking, 2)], free=[INERTIA]
    )
    (inertia,) = found.estimates
    assert abs(inertia.value / 1.25e-3 - 1.0) > 0.1  # biased by a motor that coasts
    low, high = inertia.ci95
    assert low < 1.25e-3 < high
    (said,) = [w for w in found.warnings if w.startswith("physics is missing from the ship")]
    assert "open-circuit (motor)" in said or "braking-loss (motor)" in said
    assert "Run `shaftline diagnose`" in said
    # the next diagnosis may move it as far
    assert found.identified.tolerances.numbers[INERTIA] == pytest.approx(inertia.standard_error)


def test_a_ship_that_lacks_nothing_has_no_model_error() -> None:
    found = identify(motor(), run(TRUE, 1), run(TRUE, 3), hold_out=[run(TRUE, 2)], free=[INERTIA])
    (inertia,) = found.estimates
    assert inertia.value == pytest.approx(1.25e-3, rel=0.01)
    assert inertia.standard_error < 0.01 * inertia.value
    assert not any("physics is missing" in w for w in found.warnings)
