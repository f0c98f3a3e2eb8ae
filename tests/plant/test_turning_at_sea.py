"""A ship that turns in a sea: what meets her propeller is the field's part along her heading."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Schedule, Sea, approach, load_ship, realise, simulate
from shaftline.plant.waves import SYNC_STEPS, wave_field

DEPTH = 4.5  # of the destroyer's propellers [m]


def turn_in(heading_deg: float, hs_m: float = 2.5) -> tuple[Any, NDArray[Any]]:
    """The destroyer at 11 m/s, 20 degrees of rudder, in waves to a heading of her first course."""
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 11.0)
    sea = realise(Sea(hs_m=hs_m, tp_s=8.0, heading_deg=heading_deg), DEPTH, 5)
    orders = Schedule(
        point.inputs.drive, point.inputs.pitch_command, rudder_command=math.radians(20.0)
    )
    return sea, simulate(ship, orders, 150.0, initial=point.state, sea=sea)


@pytest.mark.parametrize("heading_deg", [180.0, 60.0, 90.0, -135.0])
def test_the_advance_velocity_holds_the_fields_part_along_the_ship(heading_deg: float) -> None:
    sea, run = turn_in(heading_deg)
    assert run["heading"][-1] > math.pi  # she has met it from every side
    felt = run["advance_velocity"] - 0.98 * run["ship_speed"]
    for k in range(0, len(run), 7):
        s = run[k]
        # what meets her is that of her heading at the last synchronisation
        held = run["heading"][k - k % SYNC_STEPS]
        inflow, elevation = wave_field(sea, s["time"], s["position"], s["cross_track"], held)
        assert felt[k] == pytest.approx(inflow, abs=2e-5)
        assert s["submergence"] == pytest.approx(DEPTH + elevation, abs=6e-3)
    whole = [
        wave_field(sea, *s)[0] for s in run[["time", "position", "cross_track", "heading"]].tolist()
    ]
    assert np.std(felt - whole) < 0.02 * np.std(felt)


def test_waves_abeam_give_no_inflow_until_she_turns() -> None:
    _, run = turn_in(90.0)
    felt = run["advance_velocity"] - 0.98 * run["ship_speed"]
    assert np.abs(felt[:SYNC_STEPS]).max() < 1e-12
    quarter = int(np.argmax(run["heading"] > 0.5 * math.pi))
    assert np.ptp(felt[quarter : quarter + 400]) > 0.5


def test_a_sea_that_is_turned_with_the_ship_is_the_same_sea() -> None:
    """The first course is no special one: turn sea and ship alike, and she feels the same."""
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 11.0)
    orders = Schedule(point.inputs.drive, point.inputs.pitch_command, rudder_command=0.2)
    turned = math.radians(50.0)
    runs = []
    for heading, to in ((0.0, 150.0), (turned, 200.0)):
        sea = realise(Sea(hs_m=2.5, tp_s=8.0, heading_deg=to), DEPTH, 5)
        start = point.state._replace(heading=heading)
        runs.append(simulate(ship, orders, 60.0, initial=start, sea=sea))
    for signal in ("advance_velocity", "thrust", "ship_speed", "yaw_rate"):
        np.testing.assert_allclose(runs[1][signal], runs[0][signal], rtol=1e-7)
    np.testing.assert_allclose(runs[1]["heading"] - turned, runs[0]["heading"], atol=1e-9)


def test_waves_from_the_two_sides_are_mirror_images() -> None:
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 11.0)
    runs = []
    for side in (1.0, -1.0):
        sea = realise(Sea(hs_m=2.5, tp_s=8.0, heading_deg=side * 130.0), DEPTH, 5)
        orders = Schedule(point.inputs.drive, 1.4, rudder_command=side * 0.3)
        runs.append(simulate(ship, orders, 60.0, initial=point.state, sea=sea))
    np.testing.assert_array_equal(runs[0]["advance_velocity"], runs[1]["advance_velocity"])
    np.testing.assert_array_equal(runs[0]["heading"], -runs[1]["heading"])


def test_bow_waves_add_resistance_while_she_faces_them() -> None:
    ship = load_ship("ddg-51-surrogate").with_values(
        {"hull.beam_m": 18.0, "hull.bow_length_m": 50.0}
    )
    point = approach(ship, 11.0)
    sea = realise(Sea(hs_m=2.5, tp_s=8.0, heading_deg=180.0), DEPTH, 5)
    orders = Schedule(point.inputs.drive, 1.4, rudder_command=0.35)
    run = simulate(ship, orders, 100.0, initial=point.state, sea=sea)
    added = run["resistance"] - 6870.0 * run["ship_speed"] ** 2
    steps = np.arange(len(run)) // SYNC_STEPS * SYNC_STEPS
    faces = np.abs(run["heading"][steps]) < 0.25 * math.pi
    expected = 1025.0 * 9.81 * 2.5**2 * 18.0 * math.sqrt(18.0 / 50.0) / 16.0
    assert faces[:-1].any()
    assert not faces[:-1].all()
    np.testing.assert_allclose(added[:-1], np.where(faces, expected, 0.0)[:-1], atol=1e-3)
