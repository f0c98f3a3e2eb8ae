from __future__ import annotations

import numpy as np
import pytest

from shaftline.observers import ObserverError, get_observer, observer_names
from shaftline.plant import Ship

PUBLISHED = [
    "none", "oracle", "luenberger", "shaft-kalman", "power-balance", "shaft-acceleration",
    "shaft-acceleration-derived", "immersion-invariance", "random-walk-kalman",
]  # fmt: skip


def test_all_published_observers_are_there() -> None:
    assert set(PUBLISHED) <= set(observer_names())


def test_no_name_is_given_twice() -> None:
    assert len(observer_names()) == len(set(observer_names()))


@pytest.mark.parametrize("name", observer_names())
def test_every_name_resolves_and_discretises(frigate: Ship, name: str) -> None:
    observer = get_observer(name)
    record = observer.discretise(frigate, 0.05)
    assert record["kind"] == observer.kind
    assert record["dt"] == 0.05
    assert record["ship"]["inertia_propeller_side"] == 14411.0


@pytest.mark.parametrize("name", observer_names())
def test_full_name_means_the_observer_of_that_name(name: str) -> None:
    assert name.startswith(getattr(get_observer(name), "name"))  # noqa: B009


@pytest.mark.parametrize("tuning", ["low", "moderate", "high"])
@pytest.mark.parametrize("name", ["luenberger", "immersion-invariance"])
def test_tuning_may_stand_in_the_name_or_beside_it(name: str, tuning: str) -> None:
    assert get_observer(f"{name}-{tuning}") == get_observer(name, tuning)


@pytest.mark.parametrize("name", ["luenberger", "immersion-invariance"])
def test_tunings_differ(name: str) -> None:
    assert len({get_observer(name, tuning) for tuning in ("low", "moderate", "high")}) == 3


def test_unknown_observer_names_the_known_ones() -> None:
    with pytest.raises(
        ObserverError, match=r"unknown observer 'kalman'; known: none, oracle, luen"
    ):
        get_observer("kalman")


def test_unknown_tuning_names_the_known_ones() -> None:
    with pytest.raises(ObserverError, match=r"no tuning 'wild'; tunings: low, moderate, high"):
        get_observer("luenberger", "wild")


def test_observer_without_tunings_says_so() -> None:
    with pytest.raises(ObserverError, match=r"no tuning 'low'; tunings: none"):
        get_observer("power-balance", "low")


def test_full_name_takes_no_second_tuning() -> None:
    with pytest.raises(ObserverError, match="unknown observer 'luenberger-low'"):
        get_observer("luenberger-low", "high")


def test_belief_is_the_observers_own(frigate: Ship) -> None:
    one, other = (get_observer("power-balance").discretise(frigate, 0.05) for _ in range(2))
    one["ship"]["density"] = 1.0
    assert np.all(other["ship"]["density"] == 1025.0)
