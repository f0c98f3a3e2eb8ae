"""Power balance: each estimate inverts the torque curve at the measured torque."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.observers import get_observer
from shaftline.observers.power_balance import PowerBalance

from .screw import DT, SHIP, Screw, noisy_measurements, sampled


def test_each_estimate_is_the_inverse_of_its_own_sample() -> None:
    measurements = noisy_measurements(30)
    after = sampled(PowerBalance().discretise(SHIP, DT), measurements)
    expected = [Screw().velocity(torque, w, pitch) for w, torque, pitch, _, _ in measurements]
    assert [e["advance_velocity"] for e in after] == pytest.approx(expected, rel=1e-9)
    assert np.ptp(expected) > 0.5
    assert all(e["valid"] for e in after)


def test_power_balance_has_no_tuning() -> None:
    assert get_observer("power-balance") == PowerBalance()
    assert not PowerBalance.tunings


@pytest.mark.parametrize("torque", [9e5, -9e5])
def test_off_the_curve_it_is_not_valid(torque: float) -> None:
    record = get_observer("power-balance").discretise(SHIP, DT)
    assert sampled(record, [(10.0, torque, 1.3, 0.0, 8.0)])[0]["valid"] == 0
