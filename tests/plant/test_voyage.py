"""A voyage step by step is a simulation, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import Schedule, Sea, Voyage, approach, load_ship, realise, simulate
from shaftline.plant.stepping import Disturbance

SEA = Sea(hs_m=2.0, tp_s=8.0, heading_deg=120.0)


@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize(("name", "speed"), [("ddg-51-surrogate", 11.0), ("frigate", 8.0)])
def test_samples_are_those_of_a_simulation_to_the_bit(name: str, speed: float, waves: bool) -> None:
    ship = load_ship(name)
    point = approach(ship, speed)
    drive, pitch = point.inputs.drive, point.inputs.pitch_command
    sea = realise(SEA, ship.propeller.depth_m, 3) if waves else None
    orders = Schedule(
        lambda t: np.where(t < 9.99, drive, 1.1 * drive),
        lambda t: np.where(t < 19.99, pitch, 1.2),
        rudder_command=lambda t: np.where(t < 4.99, 0.0, 0.3),
    )
    expected = simulate(ship, orders, 30.0, initial=point.state, sea=sea)
    voyage = Voyage(ship, point.state, drive, sea)
    voyage.run(drive, pitch, 0.0, 100)
    voyage.run(drive, pitch, 0.3, 100)
    for _ in range(200):
        voyage.run(1.1 * drive, pitch, 0.3)
    end = voyage.run(1.1 * drive, 1.2, 0.3, 200)
    assert voyage.samples.tobytes() == expected[:-1].tobytes()
    assert voyage.time_s == pytest.approx(30.0)
    for signal in ("position", "heading", "ship_speed", "shaft_speed"):
        assert getattr(end, signal) == expected[signal][-1]
    assert voyage.state == end


def test_samples_have_room_for_a_long_voyage() -> None:
    ship = load_ship("kvlcc2")
    point = approach(ship, 1.18)
    voyage = Voyage(ship, point.state, point.inputs.drive)
    for steps in (4000, 200, 20_000):
        voyage.run(point.inputs.drive, 0.721, 0.1, steps)
    time = voyage.samples["time"]
    np.testing.assert_array_equal(time, np.arange(24_200) * 0.05)
    assert np.all(voyage.samples["ship_speed"] > 0.0)


def test_a_disturbance_acts_while_it_is_held() -> None:
    ship = load_ship("kvlcc2")
    point = approach(ship, 1.18)
    voyage = Voyage(ship, point.state, point.inputs.drive)
    voyage.run(point.inputs.drive, 0.721, steps=10, acting=Disturbance(0.2, 0.0, 2.0))
    voyage.run(point.inputs.drive, 0.721, steps=10)
    kept = point.outputs
    s = voyage.samples
    assert s["advance_velocity"][0] == pytest.approx(kept.advance_velocity + 0.2)
    assert s["resistance"][0] == pytest.approx(2.0 * kept.resistance)
    assert s["resistance"][10] == pytest.approx(kept.resistance, rel=0.02)


def test_the_sea_that_is_given_stays_as_it_is() -> None:
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 11.0)
    sea = realise(SEA, ship.propeller.depth_m, 3)
    before = sea.tobytes()
    Voyage(ship, point.state, point.inputs.drive, sea).run(point.inputs.drive, 1.4, 0.3, 50)
    assert sea.tobytes() == before
