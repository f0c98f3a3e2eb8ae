"""Luenberger observer: given poles, printed gains."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.observers.linear import shaft_model
from shaftline.observers.luenberger import Luenberger
from shaftline.plant import Ship

from .screw import INERTIA, SHIP

POLES = {"low": (-10.0, -1.0), "moderate": (-100.0, -10.0), "high": (-1e5, -1e4)}


@pytest.mark.parametrize("tuning", POLES)
def test_gain_places_the_poles(tuning: str) -> None:
    observer = Luenberger.tunings[tuning]
    assert observer.poles == POLES[tuning]
    a, _, c = shaft_model(INERTIA)
    found = np.linalg.eigvals(a - observer.gain(SHIP) @ c)
    np.testing.assert_allclose(np.sort(found), POLES[tuning], rtol=1e-9)


@pytest.mark.parametrize(
    ("tuning", "k1", "k2"),
    [("high", 1.1e5, -1.4e13), ("low", 11.0, -1.4e5), ("moderate", 110.0, -1.4e7)],
)
def test_gains_are_the_printed_ones(frigate: Ship, tuning: str, k1: float, k2: float) -> None:
    gain = Luenberger.tunings[tuning].gain(frigate)
    assert gain.shape == (2, 1)
    assert gain[0, 0] == pytest.approx(k1, rel=1e-12)
    assert gain[1, 0] == pytest.approx(k2, rel=0.04)  # printed with two digits


@pytest.mark.parametrize("tuning", ["low", "moderate"])
def test_poles_survive_discretisation(frigate: Ship, tuning: str) -> None:
    transition = Luenberger.tunings[tuning].discretise(frigate, 0.05)["transition"]
    found = np.log(np.sort(np.linalg.eigvals(transition))) / 0.05
    np.testing.assert_allclose(found, POLES[tuning], rtol=1e-6)
