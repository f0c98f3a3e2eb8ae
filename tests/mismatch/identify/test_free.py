"""The numbers that may move, the ship at other values of them, and keys that are none."""

from __future__ import annotations

import pytest

from shaftline.mismatch.identify.free import Free, doubtful
from shaftline.plant import Ship, load_ship

MASS, WAKE = "hull.mass_kg", "hull.wake_fraction"
KQ, ETA_R = "propeller.torque_coefficient", "propeller.relative_rotative_efficiency"


def test_the_record_is_that_of_the_file_with_other_values(frigate: Ship) -> None:
    free = Free(frigate, (MASS, WAKE))
    assert free.values == (3.3e6, 0.05)
    assert free.record((3.0e6, 0.04)) == free.at((3.0e6, 0.04)).record()
    assert free.at((3.0e6, 0.04)).hull.mass_kg == 3.0e6


def test_a_number_that_the_record_holds_in_another_form_moves_too() -> None:
    tug = load_ship("tito-neri-sine")
    free = Free(tug, (KQ,))
    assert free.record((0.2,)) == tug.with_values({KQ: 0.2}).record()
    assert free.record((0.2,)) != tug.record()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ((), "no number is free"),
        ((MASS, WAKE, MASS), r"hull\.mass_kg is given twice"),
        (("hull.mas",), r"frigate: hull\.mas is no number .* of \[hull\]: hull\.mass_kg"),
        (("nothing.x",), r"nothing\.x is no number of this ship that can be free$"),
        (("propeller.blades",), r"propeller\.blades is no number"),
        (("propeller.model",), r"propeller\.model is no number"),
    ],
)
def test_what_cannot_be_free_is_named(frigate: Ship, keys: tuple[str, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Free(frigate, keys)


def test_a_step_stops_short_of_a_bound(frigate: Ship) -> None:
    free = Free(frigate, (MASS, "transmission.efficiency"))
    low = free.numbers[0].info.low
    found = free.towards((3e6, 0.95), (-1e6, 0.97))
    assert found == [pytest.approx(low + 0.1 * (3e6 - low)), 0.97]
    assert free.towards((3e6, 0.95), (2e6, 1.2))[1] == pytest.approx(0.995)


def test_a_file_may_be_wrong_about_what_it_states_and_has_a_tolerance_or_an_effect() -> None:
    keys = doubtful(load_ship("frigate"))
    assert {MASS, WAKE, "prime_mover.torque_per_rack_N_m_mm"} <= set(keys)
    assert "hull.thrust_deduction" in keys  # no tolerance speaks of it
    assert "transmission.gear_ratio" not in keys
    assert "hull.fouling_fraction" not in keys  # absent
    fouled = load_ship("frigate").with_values({"hull.fouling_fraction": 0.1})
    assert "hull.fouling_fraction" in doubtful(fouled)
    assert KQ in doubtful(load_ship("tito-neri-sine"))
