"""Detection of ventilation: torque ratio, thresholds, hold time, sea margin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.baselines.ventilation import (
    DETECTION,
    DETECTOR,
    VentilationDetector,
    bollard_gain,
    excess_inflow,
    torque_ratio,
    update_detection,
)
from shaftline.observers.torque_curve import model_torque
from shaftline.plant import Ship


def test_torque_ratio_compares_with_the_nominal_torque(frigate: Ship) -> None:
    plant, detector = frigate.record(), VentilationDetector().discretise(0.5)
    nominal = model_torque(plant, 0.95 * 8.0, 9.6, 1.4)
    assert torque_ratio(detector, plant, nominal, 9.6, 1.4, 8.0) == pytest.approx(1.0)
    assert torque_ratio(detector, plant, 0.4 * nominal, 9.6, 1.4, 8.0) == pytest.approx(
        0.4, abs=1e-6
    )
    # The ratio is 1 near standstill and at an idling propeller.
    assert torque_ratio(detector, plant, 0.0, 0.1, 1.4, 0.0) > 0.99
    assert torque_ratio(detector, plant, -1e4, 6.0, 1.0, 8.0) == 1.0


def test_hysteresis_and_hold_time() -> None:
    detector = VentilationDetector(on_below=0.6, off_above=0.8, hold_s=1.5).discretise(0.5)
    detection = np.zeros(1, DETECTION)[0]
    states = []
    for ratio in (0.7, 0.59, 0.9, 0.9, 0.9, 0.7, 0.5, 0.7, 0.7, 0.7, 0.79, 0.81):
        update_detection(detector, detection, ratio, 1.0)
        states.append(int(detection["ventilating"]))
    assert states == [0, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 0]


def test_the_inflow_of_the_sea_is_estimated_from_torque_gains() -> None:
    rng = np.random.default_rng(3)
    detection = np.zeros(1, DETECTION)[0]
    detector = VentilationDetector(sea_margin=3.0).discretise(0.5)
    waves = rng.normal(0.0, 0.6, 4000)
    calls = []
    for inflow in waves:
        update_detection(detector, detection, 1.0 - 0.5 * inflow, inflow)
        calls.append(int(detection["ventilating"]))
    assert detection["sea_square"] == pytest.approx(0.36, rel=0.25)
    # The threshold of the paper alone detects every inflow above 0.7 m/s, an eighth of all.
    assert np.mean(waves > 0.7) > 0.1
    assert np.mean(calls) < 0.02
    update_detection(detector, detection, 0.3, 2.4)  # above the effect of this sea
    assert detection["ventilating"] == 1


def test_inflow_that_explains_a_torque(frigate: Ship) -> None:
    plant = frigate.record()
    torque = model_torque(plant, 0.95 * 8.0 + 0.7, 9.6, 1.4)
    assert excess_inflow(plant, torque, 9.6, 1.4, 8.0) == pytest.approx(0.7)
    assert excess_inflow(plant, torque, 0.0, 1.4, 8.0) == 0.0


def test_record_holds_the_tuning() -> None:
    record = VentilationDetector(0.03, 2.0, 0.5, 0.8, 2.0, 1.5, 90.0).discretise(0.25)
    assert record.tolist() == (0.25, 0.03, 2.0, 0.5, 0.8, 2.0, 1.5, 90.0)
    assert VentilationDetector() == VentilationDetector(0.02, 3.0, 0.65, 0.70, 1.0, 0.0, 120.0)
    assert DETECTOR.names == (
        "dt",
        "blend_gain",
        "blend_power",
        "on_below",
        "off_above",
        "hold_s",
        "sea_margin",
        "sea_memory_s",
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"blend_power": 0.0}, "k and p"),
        ({"on_below": 0.0}, "thresholds"),
        ({"on_below": 0.71}, "got 0.71 and 0.7"),
        ({"off_above": 1.0}, "thresholds"),
        ({"hold_s": -0.1}, "hold time"),
        ({"sea_margin": -0.1}, "sea margin"),
        ({"sea_memory_s": 0.0}, "sea memory"),
    ],
)
def test_bad_tuning_is_named(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        VentilationDetector(**change).discretise(0.5)


def test_tuning_at_its_limits_passes() -> None:
    VentilationDetector(on_below=0.7, hold_s=0.0, sea_margin=0.0).discretise(0.5)
    with pytest.raises(ValueError, match="time step"):
        VentilationDetector().discretise(0.0)


def test_blend_by_hand(frigate: Ship) -> None:
    plant, detector = frigate.record(), VentilationDetector(0.02, 3.0).discretise(0.5)
    for omega, blend in ((2.0, math.exp(-0.16)), (5.0, math.exp(-2.5))):
        nominal = model_torque(plant, 0.95 * 1.0, omega, 1.4)
        ratio = torque_ratio(detector, plant, 0.3 * nominal, omega, 1.4, 1.0)
        assert ratio == pytest.approx(blend + (1.0 - blend) * 0.3)
    assert math.exp(-0.16) == pytest.approx(0.85, abs=0.01)  # as in the docstring of the tuning
    assert math.exp(-2.5) == pytest.approx(0.08, abs=0.01)


def test_ratio_is_one_where_the_propeller_idles(frigate: Ship) -> None:
    """The ratio is 1 below a twentieth of the bollard torque."""
    plant, detector = frigate.record(), VentilationDetector().discretise(0.5)
    omega, pitch = 9.0, 1.0

    def nominal_share(speed: float) -> float:
        nominal = model_torque(plant, 0.95 * speed, omega, pitch)
        return float(nominal / (bollard_gain(plant, pitch) * omega**2))

    speeds = np.linspace(5.0, 9.0, 4001)
    shares = np.array([nominal_share(v) for v in speeds])
    last = int(np.flatnonzero(shares > 0.05)[-1])
    assert torque_ratio(detector, plant, 0.0, omega, pitch, float(speeds[last])) < 0.9
    assert torque_ratio(detector, plant, 0.0, omega, pitch, float(speeds[last + 1])) == 1.0


def called(detector: VentilationDetector, ratios: list[float], inflow: float = 1.0) -> list[int]:
    record, detection = detector.discretise(0.5), np.zeros(1, DETECTION)[0]
    states = []
    for ratio in ratios:
        update_detection(record, detection, ratio, inflow)
        states.append(int(detection["ventilating"]))
    return states


def test_thresholds_from_both_sides() -> None:
    plain = VentilationDetector(on_below=0.6, off_above=0.8, hold_s=0.0)
    assert called(plain, [0.6, 0.5999]) == [0, 1]
    assert called(plain, [0.5, 0.7999, 0.8]) == [1, 1, 0]


def test_hold_counts_from_the_detection() -> None:
    # The hold of 1 s is two intervals; a later low ratio does not restart it.
    slow = VentilationDetector(on_below=0.6, off_above=0.8, hold_s=1.0)
    assert called(slow, [0.5, 0.9, 0.9]) == [1, 1, 0]
    assert called(slow, [0.5, 0.5, 0.9]) == [1, 1, 0]
    assert called(slow, [0.5, 0.9, 0.9, 0.5, 0.9, 0.9]) == [1, 1, 0, 1, 1, 0]


def test_stored_values_of_a_sample() -> None:
    record, detection = VentilationDetector().discretise(0.5), np.zeros(1, DETECTION)[0]
    update_detection(record, detection, 0.9, -0.4)
    assert (detection["torque_ratio"], detection["excess_inflow"]) == (0.9, -0.4)
    assert (detection["since"], detection["samples"]) == (0.5, 1.0)


def test_the_seas_square_is_a_mean_at_first_and_a_memory_later() -> None:
    """It is twice the mean square of the inflow that increases the torque."""
    record = VentilationDetector(sea_margin=3.0, sea_memory_s=10.0).discretise(0.5)
    detection = np.zeros(1, DETECTION)[0]
    inflows = [-0.4, 0.9, -1.0, 0.2]
    for inflow in inflows:
        update_detection(record, detection, 1.0, inflow)
    assert detection["sea_square"] == pytest.approx(2.0 * (0.16 + 1.0) / 4.0)
    detection["samples"] = 1000.0
    before = float(detection["sea_square"])
    update_detection(record, detection, 1.0, -0.6)
    assert detection["sea_square"] == pytest.approx(before + 0.05 * (0.72 - before))


@pytest.mark.parametrize(("inflow", "call"), [(1.19, 0), (1.21, 1)])
def test_with_a_margin_the_inflow_must_exceed_the_seas(inflow: float, call: int) -> None:
    record = VentilationDetector(sea_margin=3.0).discretise(0.5)
    detection = np.zeros(1, DETECTION)[0]
    detection["sea_square"], detection["samples"] = 0.16, 1e6
    update_detection(record, detection, 0.3, inflow)
    assert detection["ventilating"] == call
    # It ends if the inflow is within the margin, at any ratio.
    detection["ventilating"], detection["since"] = 1, 99.0
    update_detection(record, detection, 0.3, 0.5)
    assert detection["ventilating"] == 0
