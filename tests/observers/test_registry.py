"""Registry of the observers, and the kernel that updates any of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.observers import (
    ESTIMATE,
    Measurement,
    ObserverError,
    get_observer,
    observer_names,
    update,
)

from .screw import DT, SHIP, Screw, sampled

NAMES = [
    "none", "oracle", "augmented-kalman", "augmented-kalman-fouling", "augmented-kalman-friction",
    "luenberger", "luenberger-low", "luenberger-moderate", "luenberger-high",
    "shaft-kalman", "power-balance", "shaft-acceleration", "shaft-acceleration-derived",
    "immersion-invariance", "immersion-invariance-low", "immersion-invariance-moderate",
    "immersion-invariance-high", "random-walk-kalman", "random-walk-kalman-extended",
    "random-walk-kalman-printed", "immersion-invariance-adaptive",
]  # fmt: skip
STEADY = (10.0, Screw().torque(7.5, 10.0, 1.3), 1.3, 0.0, 7.5)


def test_names_stand_in_the_order_of_their_sources() -> None:
    assert observer_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_full_name_means_the_observer_of_that_name(name: str) -> None:
    assert name.startswith(get_observer(name).name)


@pytest.mark.parametrize(
    ("name", "tuning"),
    [(n, t) for n in ("luenberger", "immersion-invariance") for t in ("low", "moderate", "high")]
    + [("random-walk-kalman", "extended"), ("random-walk-kalman", "printed")],
)
def test_tuning_may_stand_in_the_name_or_beside_it(name: str, tuning: str) -> None:
    assert get_observer(f"{name}-{tuning}") == get_observer(name, tuning)


@pytest.mark.parametrize(
    ("name", "default"),
    [
        ("luenberger", "moderate"),
        ("immersion-invariance", "moderate"),
        ("random-walk-kalman", "extended"),
    ],
)
def test_the_default_is_one_of_the_tunings(name: str, default: str) -> None:
    assert get_observer(name) == get_observer(name, default)
    tunings = get_observer(name).tunings
    assert len(set(tunings.values())) == len(tunings)


def test_unknown_observer_names_the_known_ones() -> None:
    with pytest.raises(
        ObserverError, match=r"unknown observer 'kalman'; known: none, oracle, augm"
    ):
        get_observer("kalman")


def test_unknown_tuning_names_the_known_ones() -> None:
    with pytest.raises(ObserverError, match=r"no tuning 'wild'; tunings: low, moderate, high"):
        get_observer("luenberger", "wild")
    with pytest.raises(ObserverError, match=r"no tuning 'low'; tunings: none"):
        get_observer("power-balance", "low")
    with pytest.raises(ObserverError, match="unknown observer 'luenberger-low'"):
        get_observer("luenberger-low", "high")
    with pytest.raises(ObserverError, match="unknown observer 'luenberger-wild'"):
        get_observer("luenberger-wild")


@pytest.mark.parametrize("name", [name for name in NAMES if name != "none"])
def test_each_record_is_served_by_its_own_kernel(name: str) -> None:
    """In a steady state all observers agree with the truth."""
    record = get_observer(name).discretise(SHIP, DT)
    (*_, last) = sampled(record, [STEADY] * 20)
    # The ship speed of the augmented filter drifts, because thrust and resistance differ.
    close = 2e-4 if name.startswith("augmented") else 1e-5
    assert last["advance_velocity"] == pytest.approx(7.5, rel=close)
    assert last["valid"] == 1


def test_a_record_with_an_unknown_code_is_never_valid() -> None:
    record = get_observer("power-balance").discretise(SHIP, DT)
    record["kind"] = 12345
    (last,) = sampled(record, [STEADY])
    assert (last["advance_velocity"], last["valid"]) == (0.0, 0)


@pytest.mark.parametrize("name", NAMES)
def test_an_implausible_measurement_keeps_the_estimate_and_restarts(name: str) -> None:
    record = get_observer(name).discretise(SHIP, DT)
    lost = (10.0, math.nan, 1.3, 0.0, 7.0)
    good, after, again = sampled(record, [STEADY, lost, STEADY])
    if name == "oracle":  # independent of measurements
        assert (after["advance_velocity"], after["valid"], after["started"]) == (7.0, 1, 1)
        return
    assert after["advance_velocity"] == good["advance_velocity"]
    assert (after["valid"], after["started"]) == (0, 0)
    for field in ("x", "covariance", "advance_velocity"):  # independent of the samples before
        assert again[field] == pytest.approx(good[field], rel=1e-12)
    assert (again["valid"], again["started"]) == (good["valid"], 1)
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["advance_velocity"] = 3.0
    assert update(record, estimate, Measurement(*lost)) == 3.0


def test_an_update_gives_the_estimate_that_it_leaves() -> None:
    record = get_observer("power-balance").discretise(SHIP, DT)
    estimate = np.zeros(1, ESTIMATE)[0]
    assert update(record, estimate, Measurement(*STEADY)) == estimate["advance_velocity"] > 1.0


@pytest.mark.parametrize(("pitch", "valid"), [(1.49, 1), (1.51, 0)])
def test_a_pitch_that_the_ship_does_not_have_is_not_trusted(pitch: float, valid: int) -> None:
    torque = Screw().torque(7.5, 10.0, pitch)
    record = get_observer("power-balance").discretise(SHIP, DT)
    (last,) = sampled(record, [(10.0, torque, pitch, 0.0, 7.5)])
    assert last["advance_velocity"] == pytest.approx(7.5)
    assert last["valid"] == valid
