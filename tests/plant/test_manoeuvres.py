"""Manoeuvres: their measures by their definitions, what cannot be sailed, IMO's limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    approach,
    load_ship,
    simulate,
    spiral,
    turning_circle,
    zig_zag,
)
from shaftline.plant.manoeuvres import MANOEUVRES, SPIRAL_ANGLES, criteria, limits, trials

TEN, TWENTY, HARD = math.radians(10.0), math.radians(20.0), math.radians(35.0)
Sailing = tuple[Ship, Equilibrium]


def at_speed(name: str, speed: float, **values: float) -> Sailing:
    ship = load_ship(name).with_values({k.replace("__", "."): v for k, v in values.items()})
    return ship, approach(ship, speed)


@pytest.fixture(scope="module")
def tanker() -> Sailing:
    return at_speed("kvlcc2", 1.18)


@pytest.fixture(scope="module")
def destroyer() -> Sailing:
    return at_speed("ddg-51-surrogate", 11.0)


@pytest.mark.parametrize(
    ("name", "speed"), [("kvlcc2", 1.18), ("ddg-51-surrogate", 11.0), ("frigate", 8.0)]
)
def test_approach_finds_the_demand_that_sails_a_speed(name: str, speed: float) -> None:
    ship, point = at_speed(name, speed)
    assert point.state.ship_speed == pytest.approx(speed, rel=1e-9)
    orders = Schedule(point.inputs.drive, point.inputs.pitch_command)
    run = simulate(ship, orders, 60.0, initial=point.state)
    np.testing.assert_allclose(run["ship_speed"], speed, rtol=1e-8)


def test_approach_takes_the_pitch_that_is_asked_for() -> None:
    ship = load_ship("frigate")
    steep, flat = approach(ship, 6.0), approach(ship, 6.0, pitch_ratio=0.9)
    assert (steep.inputs.pitch_command, flat.inputs.pitch_command) == (1.4, 0.9)
    assert flat.state.shaft_speed > steep.state.shaft_speed
    assert flat.state.ship_speed == pytest.approx(6.0)


def test_approach_is_at_a_speed_through_the_water() -> None:
    still, carried = (
        approach(load_ship("kvlcc2").with_values({"hull.current_m_s": c}), 1.18) for c in (0.0, 0.3)
    )
    assert carried.state.ship_speed == pytest.approx(1.48)
    assert carried.inputs.drive == pytest.approx(still.inputs.drive, rel=1e-9)


def test_approach_names_the_speeds_that_she_sails() -> None:
    ship = load_ship("kvlcc2")
    words = r"a speed of 5 m/s \(unit m/s; allowed: >= .* and <= 2\.386, at a pitch ratio"
    with pytest.raises(ShipError, match=words):
        approach(ship, 5.0)
    for speed in (-1.0, math.nan):
        with pytest.raises(ShipError, match="no drive command holds a speed of"):
            approach(ship, speed)
    assert approach(ship, 0.03).state.ship_speed == pytest.approx(0.03)
    with pytest.raises(ShipError, match=r"tito-neri-sine: hull\.fixed = true"):
        approach(load_ship("tito-neri-sine"), 0.5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turning_circle_by_its_definitions(tanker: Sailing, side: float) -> None:
    """Against a simulation's track, the crossings by cubic splines of its own."""
    ship, point = tanker
    found = turning_circle(ship, point, side * HARD)
    orders = Schedule(point.inputs.drive, 0.721, rudder_command=side * HARD)
    run = simulate(ship, orders, 200.0, initial=point.state)
    turned = side * run["heading"]

    def at(angle: float, values: Any) -> float:
        return float(np.interp(angle, turned, values))

    quarter, half = 0.5 * math.pi, math.pi
    assert found.advance == pytest.approx(at(quarter, run["position"]) / 7.0, abs=1e-9)
    assert found.transfer == pytest.approx(at(quarter, side * run["cross_track"]) / 7.0, abs=1e-9)
    assert found.tactical_diameter == pytest.approx(at(half, side * run["cross_track"]) / 7.0)
    u, v, r = (at(3.0 * half, run[s]) for s in ("ship_speed", "sway_speed", "yaw_rate"))
    speed = math.hypot(u, v)
    assert found.speed_ratio == pytest.approx(speed / 1.18, rel=1e-6)
    assert found.rate_of_turn == pytest.approx(r * 7.0 / speed, rel=1e-6)
    assert found.steady_diameter == pytest.approx(2.0 * speed / abs(r) / 7.0, rel=1e-6)
    assert found.drift_rad == pytest.approx(-math.atan(v / u), rel=1e-6)
    assert side * found.drift_rad > 0.0  # the bow points into the circle
    assert found.shaft_speed_ratio == 1.0
    assert found.metres["advance"] == 7.0 * found.advance
    assert found.unsteadiness < 1e-3


def test_turning_circles_of_the_ships() -> None:
    """7 m model of KVLCC2 at 1.18 m/s and 35 degrees, and the destroyer at 30, as they come out."""
    model = turning_circle(*at_speed("kvlcc2", 1.18), HARD)
    assert (model.advance, model.tactical_diameter) == pytest.approx((3.051, 3.091), abs=2e-3)
    ship, point = at_speed("ddg-51-surrogate", 22.0 * 1852.0 / 3600.0)
    found = turning_circle(ship, point, ship.rudder.angle_max_rad)
    assert (found.advance, found.transfer) == pytest.approx((2.892, 1.314), abs=2e-3)
    assert (found.speed_ratio, found.shaft_speed_ratio) == pytest.approx((0.489, 0.729), abs=1e-3)


def test_a_current_changes_no_manoeuvre() -> None:
    still = at_speed("kvlcc2", 1.18)
    current = {"hull__current_m_s": 0.4, "manoeuvring__cross_current_m_s": -0.3}
    carried = at_speed("kvlcc2", 1.18, **current)
    before, after = (turning_circle(*one, HARD) for one in (still, carried))
    for name in (
        "advance",
        "transfer",
        "tactical_diameter",
        "steady_diameter",
        "speed_ratio",
        "drift_rad",
        "rate_of_turn",
    ):
        assert getattr(after, name) == pytest.approx(getattr(before, name), rel=1e-5), name
    swung, drifted = (zig_zag(*one, TEN, TEN) for one in (still, carried))
    assert drifted.overshoots_deg == pytest.approx(swung.overshoots_deg, abs=1e-3)
    assert drifted.initial_turning == pytest.approx(swung.initial_turning, rel=1e-5)
    angles = (TWENTY, TEN, -TEN)
    there, again = (spiral(*one, angles).curve for one in (still, carried))
    for column in ("rate_of_turn", "speed_ratio"):
        np.testing.assert_allclose(again[column], there[column], rtol=2e-4)


@pytest.mark.parametrize("angle", [TEN, TWENTY])
def test_zig_zag_by_its_definitions(tanker: Sailing, angle: float) -> None:
    found = zig_zag(*tanker, angle, angle)
    time, heading = (found.track[c].to_numpy() for c in ("time_s", "heading_rad"))
    half_step = 0.5 * 0.05 * found.track["yaw_rate_rad_s"].abs().max()
    times = found.executes_s
    assert len(times) == 5
    assert len(found.overshoots_deg) == 4
    assert times[0] == 0.0
    for k, (begin, end) in enumerate(zip(times[1:], [*times[2:], time[-1]], strict=True)):
        side = (-1.0) ** k
        at = int(np.argmin(np.abs(time - begin)))
        assert side * heading[at] == pytest.approx(angle, abs=1.01 * half_step)
        within = side * heading[(time >= begin) & (time <= end)]
        assert found.overshoots_deg[k] == pytest.approx(
            math.degrees(within.max() - angle), abs=1e-3
        )
    assert found.period_s == times[4] - times[2]
    u = found.track["speed_m_s"].to_numpy()
    until = time < np.interp(
        angle, heading[: int(times[1] / 0.05) + 3], time[: int(times[1] / 0.05) + 3]
    )
    assert found.initial_turning == pytest.approx(u[until].sum() * 0.05 / 7.0, abs=0.01)
    last = found.track.iloc[-1]
    assert abs(last["heading_rad"]) < 0.01  # back on the first course


def test_zig_zag_to_port_mirrors_that_to_starboard(destroyer: Sailing) -> None:
    starboard, port = (zig_zag(*destroyer, side * TEN, TEN) for side in (1.0, -1.0))
    assert port[2:6] == starboard[2:6]
    np.testing.assert_array_equal(port.track["heading_rad"], -starboard.track["heading_rad"])
    assert starboard.track["heading_rad"].iloc[40] > 0.0


def test_zig_zag_has_as_many_overshoots_as_are_asked_for(destroyer: Sailing) -> None:
    few, many = (zig_zag(*destroyer, TWENTY, TEN, executes=n) for n in (4, 7))
    assert len(many.overshoots_deg) == 6
    assert many.overshoots_deg[:3] == few.overshoots_deg


def test_an_overshoot_does_not_hang_on_the_time_step(destroyer: Sailing) -> None:
    ship, point = destroyer
    fine = zig_zag(ship.with_values({"integration.time_step_s": 0.005}), point, TEN, TEN)
    coarse = zig_zag(ship, point, TEN, TEN)
    assert coarse.overshoots_deg == pytest.approx(fine.overshoots_deg, abs=0.03)


def test_a_spiral_of_a_ship_that_holds_her_course_has_no_loop(destroyer: Sailing) -> None:
    found = spiral(*destroyer)
    assert abs(found.width_deg) < 0.01
    assert abs(found.height) < 1e-3
    there, back = (part for _, part in found.curve.groupby("leg", sort=False))
    np.testing.assert_allclose(there["rudder_rad"], SPIRAL_ANGLES)
    np.testing.assert_allclose(back["rudder_rad"], SPIRAL_ANGLES[::-1])
    np.testing.assert_allclose(there["rate_of_turn"][::-1], back["rate_of_turn"], atol=1e-3)
    turn = turning_circle(*destroyer, TEN, heading_rad=6.0 * math.pi)
    row = there[np.isclose(there["rudder_rad"], TEN)].iloc[0]
    assert row["rate_of_turn"] == pytest.approx(turn.rate_of_turn, abs=1e-3)
    assert row["speed_ratio"] == pytest.approx(turn.speed_ratio, abs=2e-3)


def test_a_spiral_of_an_unstable_ship_has_a_loop() -> None:
    """Less damping of the yaw: within the loop she turns to starboard there and to port back."""
    ship, point = at_speed("esso-osaka", 3.6, manoeuvring__N_v=-0.006, manoeuvring__N_rrr=-0.02)
    found = spiral(ship, point)
    there, back = (
        part.set_index("rudder_rad") for _, part in found.curve.groupby("leg", sort=False)
    )
    middle = there.index[np.isclose(there.index, 0.0)][0]
    assert there.loc[middle, "rate_of_turn"] > 0.1
    assert back.loc[middle, "rate_of_turn"] == pytest.approx(
        -there.loc[middle, "rate_of_turn"], 1e-3
    )
    assert found.height == pytest.approx(2.0 * there.loc[middle, "rate_of_turn"], rel=1e-3)
    inside = math.radians(0.3 * found.width_deg)
    assert found.width_deg > 1.0
    for one, sign in ((there, 1.0), (back, -1.0)):
        near = one[np.abs(one.index) < inside]
        assert np.all(sign * near["rate_of_turn"] > 0.05)


ASKED: list[tuple[Callable[..., Any], tuple[Any, ...], str]] = [
    (
        turning_circle,
        (0.7,),
        r"rudder angle of 0\.7 .*unit rad; allowed: >= -0\.61.* not 0, by rudder",
    ),
    (turning_circle, (0.0,), "rudder angle of 0 is not possible"),
    (turning_circle, (HARD, 1.0), r"heading_rad = 1 .*unit rad; allowed: >= 3\.14159"),
    (zig_zag, (math.nan, TEN), "rudder angle of nan"),
    (zig_zag, (TEN, -TEN), r"heading_rad = -0\.17.*unit rad; allowed: > 0"),
    (zig_zag, (TEN, TEN, 3), r"executes = 3 .*allowed: >= 4 and <= 50"),
    (spiral, ((0.1, 0.2, -0.1),), r"must fall .*unit rad"),
    (spiral, ((0.9, -0.9),), r"rudder angle of 0\.9 .*unit rad"),
    (spiral, ((0.2, 0.1),), "must fall"),
]


@pytest.mark.parametrize(("manoeuvre", "asked", "words"), ASKED)
def test_what_is_asked_for_has_its_range(
    tanker: Sailing, manoeuvre: Callable[..., Any], asked: tuple[Any, ...], words: str
) -> None:
    with pytest.raises(ShipError, match=words):
        manoeuvre(*tanker, *asked)


@pytest.mark.parametrize(
    ("name", "values", "lacking"),
    [
        ("frigate", {}, r"manoeuvring\.length_m \(unit m; allowed: > 0"),
        ("kvlcc2", {"rudder__area_m2": 0.0}, r"rudder\.area_m2 \(unit m2; allowed: > 0"),
    ],
)
def test_a_ship_that_cannot_be_steered_says_why(
    name: str, values: dict[str, float], lacking: str
) -> None:
    sailing = at_speed(name, 1.18 if name == "kvlcc2" else 8.0, **values)
    calls: list[Callable[[], Any]] = [
        lambda: turning_circle(*sailing, HARD),
        lambda: zig_zag(*sailing, TEN, TEN),
        lambda: spiral(*sailing),
        lambda: trials(*sailing),
    ]
    for call in calls:
        with pytest.raises(
            ShipError, match=f"{name} cannot be steered: the ship file has no {lacking}"
        ):
            call()


def test_a_manoeuvre_that_does_not_come_to_its_end_is_given_up(tanker: Sailing) -> None:
    ship, point = tanker
    sluggish = ship.with_values({"rudder.area_m2": 1e-7, "manoeuvring.N_r": -0.5})
    words = r"with the rudder at 35 deg the ship has not reached a change of heading of 540 deg"
    with pytest.raises(ShipError, match=words):
        turning_circle(sluggish, point, HARD)
    with pytest.raises(ShipError, match="a change of heading of 10 deg within 200 ship lengths"):
        zig_zag(sluggish, point, TEN, TEN)


def test_a_ship_that_stops_is_told_of(tanker: Sailing) -> None:
    ship, point = tanker
    drifting = point._replace(inputs=point.inputs._replace(drive=1e-6))
    with pytest.raises(ShipError, match=r"stops before .*allowed: > 0\.0236 m/s"):
        turning_circle(ship, drifting, HARD)
    astern = point._replace(state=point.state._replace(ship_speed=-1.0))
    with pytest.raises(
        ShipError, match=r"must begin with headway, not at -1 m/s through the water"
    ):
        turning_circle(ship, astern, HARD)


@pytest.mark.parametrize(
    ("time", "first", "second"),
    [
        (5.0, 10.0, 25.0),
        (10.0, 10.0, 25.0),
        (20.0, 15.0, 32.5),
        (30.0, 20.0, 40.0),
        (60.0, 20.0, 40.0),
    ],
)
def test_limits_are_imos(time: float, first: float, second: float) -> None:
    """MSC.137(76): 10, 5 + L/2V, 20 degrees; 25, 17.5 + 0.75 L/V, 40 degrees."""
    found = limits(time)
    assert found["first overshoot, 10/10"] == pytest.approx(first)
    assert found["second overshoot, 10/10"] == pytest.approx(second)
    assert (found["advance"], found["tactical diameter"]) == (4.5, 5.0)
    assert (found["initial turning, 10/10"], found["first overshoot, 20/20"]) == (2.5, 25.0)


def test_criteria_hold_what_was_measured_beside_the_limits(tanker: Sailing) -> None:
    ticks: list[int] = []
    sailed = trials(*tanker, lambda: ticks.append(1))
    assert len(ticks) == MANOEUVRES
    assert not sailed.not_completed
    model, ship = (criteria(sailed, scale).set_index("criterion") for scale in (1.0, 16.0))
    turn, swing = sailed.turns["port"], sailed.zig_zags[10, "starboard"]
    assert model.loc["advance", "port"] == turn.advance
    assert model.loc["tactical diameter", "port"] == turn.tactical_diameter
    assert model.loc["initial turning, 10/10", "starboard"] == swing.initial_turning
    first, second = "first overshoot, 10/10", "second overshoot, 10/10"
    assert (model.loc[first, "starboard"], model.loc[second, "starboard"]) == swing.overshoots_deg[
        :2
    ]
    twenty = sailed.zig_zags[20, "port"].overshoots_deg[0]
    assert model.loc["first overshoot, 20/20", "port"] == twenty
    # 7 m at 1.18 m/s: 5.93 s; four times that at 16 times the length
    assert (model.loc[first, "limit"], model.loc[second, "limit"]) == (10.0, 25.0)
    assert ship.loc[first, "limit"] == pytest.approx(5.0 + 0.5 * 4.0 * 7.0 / 1.18)
    assert set(model["met"]) == {"yes"}
    with pytest.raises(ShipError, match=r"scale = 0 is out of range \(unit -; allowed: > 0\)"):
        criteria(sailed, 0.0)


def test_what_is_not_sailed_is_left_out_with_its_reason(tanker: Sailing) -> None:
    ship, point = tanker
    narrow = ship.with_values({"rudder.angle_max_rad": math.radians(15.0)})
    sailed = trials(narrow, point)
    assert sorted(sailed.not_completed) == ["20/20 zig-zag to port", "20/20 zig-zag to starboard"]
    assert sailed.turns["port"].rudder_rad == pytest.approx(-math.radians(15.0))
    found = criteria(sailed).set_index("criterion")["met"]
    assert found["first overshoot, 20/20"] == "not completed"
    assert found["first overshoot, 10/10"] == "yes"
    wide = ship.with_values({"manoeuvring.N_r": -0.2})
    assert criteria(trials(wide, point)).set_index("criterion")["met"]["advance"] == "no"
