from __future__ import annotations

import numpy as np
import pytest

from shaftline.baselines.combinator import (
    TORQUE_MARGIN,
    Combinator,
    Curve,
    combinator_curve,
    curve_through,
    full_pitch,
    full_speed,
    torque_share,
)
from shaftline.baselines.governor import Governor
from shaftline.baselines.steady_points import steady_point
from shaftline.envs import CLASSIC, FrigateVectorEnv
from shaftline.plant import Ship, ShipError, load_ship

from .voyage import run_voyage, with_blades_from

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


@by_ship
def test_curve_is_the_standard_one(ship: Ship) -> None:
    curve = combinator_curve(ship)
    early, late = curve.lever <= 0.45, curve.lever > 0.45
    assert np.ptp(curve.shaft_speed[early]) < 1e-12
    assert np.all(np.diff(curve.pitch_ratio[early]) > 0)
    assert np.ptp(curve.pitch_ratio[late]) < 1e-12
    assert np.all(np.diff(curve.shaft_speed[late]) > 0)
    shares = [
        steady_point(ship, n, p).torque_share
        for n, p in zip(curve.shaft_speed, curve.pitch_ratio, strict=True)
    ]
    assert max(shares) == pytest.approx(0.97, abs=1e-4)


@by_ship
def test_points_of_the_curve_by_hand(ship: Ship) -> None:
    curve = combinator_curve(ship)
    lowest, highest = ship.shaft_speeds
    floor, full = max(lowest, 0.5 * highest), full_pitch(ship)
    assert curve.lever == pytest.approx(np.linspace(0.0, 1.0, 41))
    low = ship.propeller.pitch_ratio_min  # both above 0.1
    # levers 0, 0.225, 0.45, 0.725, 1
    points = [0, 9, 18, 29, 40]
    assert curve.pitch_ratio[points] == pytest.approx([low, 0.5 * (low + full), full, full, full])
    middle = 0.5 * (floor + highest)
    assert curve.shaft_speed[points] == pytest.approx([floor, floor, floor, middle, highest])
    for i in points:
        steady = steady_point(ship, curve.shaft_speed[i], curve.pitch_ratio[i])
        assert (curve.ship_speed[i], curve.thrust[i]) == (steady.ship_speed, steady.thrust)


def test_the_floor_is_never_below_the_engines_lowest_speed() -> None:
    ferry = SHIPS[1]
    lowest, highest = ferry.shaft_speeds
    assert combinator_curve(ferry, floor_share=0.0).shaft_speed[0] == lowest
    assert combinator_curve(ferry, floor_share=0.6).shaft_speed[0] == pytest.approx(0.6 * highest)
    early = combinator_curve(ferry, full_pitch_lever=0.25)
    assert early.pitch_ratio[10] == pytest.approx(full_pitch(ferry))
    assert early.pitch_ratio[9] < full_pitch(ferry) - 0.01


def test_a_pitch_of_little_drive_is_left_out() -> None:
    wide = with_blades_from(SHIPS[1], -0.4)
    assert combinator_curve(wide).pitch_ratio[0] == pytest.approx(0.1)


def test_a_fixed_pitch_leaves_the_shaft_speed_to_the_lever() -> None:
    fixed = SHIPS[1].with_values(
        {"propeller.pitch_ratio_min": 0.6, "propeller.pitch_ratio_max": 0.6}
    )
    curve = combinator_curve(fixed)
    floor, highest = curve.shaft_speed[0], fixed.shaft_speeds[1]
    assert np.all(curve.pitch_ratio == 0.6)
    assert curve.shaft_speed == pytest.approx(np.linspace(floor, highest, 41))


def test_full_pitch_takes_its_share_of_the_torque() -> None:
    frigate, ferry = SHIPS
    top = ferry.shaft_speeds[1]
    for share in (0.97, 0.6):
        assert steady_point(ferry, top, full_pitch(ferry, share)).torque_share == pytest.approx(
            share, abs=1e-4
        )
    strong = frigate.with_values(
        {"prime_mover.torque_limit_N_m": 1e6, "prime_mover.torque_limit_slope_N_m_s_rad": 1e5}
    )
    assert full_pitch(strong) == 1.4


def test_a_heavy_fixed_pitch_lowers_the_highest_shaft_speed() -> None:
    """A propeller that absorbs the rated power at the rated speed is an ordinary design."""
    ferry = SHIPS[1]
    top = ferry.shaft_speeds[1]
    rated = full_pitch(ferry, 1.0)
    keys = ("propeller.pitch_ratio_min", "propeller.pitch_ratio_max")
    fixed = ferry.with_values(dict.fromkeys(keys, rated))
    curve = combinator_curve(fixed)
    assert curve.shaft_speed[-1] == full_speed(fixed) == pytest.approx(0.98489 * top, rel=1e-4)
    assert steady_point(fixed, full_speed(fixed), rated).torque_share == pytest.approx(0.97)
    assert np.all(curve.pitch_ratio == full_pitch(fixed))
    heavy = ferry.with_values({keys[0]: 1.1})
    assert full_speed(heavy) == pytest.approx(0.62016 * top, rel=1e-4)
    assert full_pitch(heavy) == 1.1
    assert full_speed(ferry) == top
    stalled = heavy.with_values({"prime_mover.torque_limit_at_min_speed_N_m": 100.0})
    with pytest.raises(
        ValueError,
        match=r"P/D 1\.1 \(propeller\.pitch_ratio_min\) and the lowest engine speed .* needs an engine "
        r"torque of \d+ N m, above 97% of the limit of 100 N m",
    ):
        full_speed(stalled)


def test_set_points_are_interpolated_and_held_at_the_ends() -> None:
    curve = Curve(*(np.array(x) for x in ([0, 1], [0.5, 0.9], [4.0, 8.0], [2.0, 6.0], [1e3, 9e3])))
    found = curve.set_points(np.array([1.0, 2.0, 3.0, 6.0, 99.0]))
    assert found.pitch_ratio == pytest.approx([0.5, 0.5, 0.6, 0.9, 0.9])
    assert found.shaft_speed == pytest.approx([4.0, 4.0, 5.0, 8.0, 8.0])
    assert found.thrust == pytest.approx([1e3, 1e3, 3e3, 9e3, 9e3])


def test_commands_are_the_curves_pitch_and_the_governors_rack() -> None:
    frigate = SHIPS[0]
    combinator = Combinator(frigate, 0.25, response_s=3.0)
    middle = float(np.interp(0.5, combinator.curve.lever, combinator.curve.pitch_ratio))
    governor = Governor(frigate, 0.25, 3.0, middle)
    rows = [[8.0, 9.0, 1e5, 1.2, 15.0, 7.0, 6.6, 1.0], [9.0, 9.2, 1e5, 1.2, 14.0, 7.0, 6.6, 1.0]]
    action, memory = combinator.predict(rows[0])
    pitch, speed = (float(x) for x in combinator.set_points(8.0))
    assert action[0] == pytest.approx(2.0 * (pitch - 0.6) / 0.8 - 1.0, abs=1e-6)
    settled = governor.settle([9.0], [15.0], [speed])
    rack, integral = governor.command([speed], [9.0], settled)
    assert rack[0] == pytest.approx(15.0)  # bumpless start
    assert action[1] == pytest.approx(rack[0] / 20.0 - 1.0, abs=1e-6)
    assert memory[0, 0] == integral[0]
    action, memory = combinator.predict(rows[1], memory)
    rack, integral = governor.command(combinator.set_points([9.0])[1], [9.2], integral)
    assert action[1] == pytest.approx(rack[0] / 20.0 - 1.0, abs=1e-6)
    assert memory[0, 0] == integral[0]


@by_ship
@pytest.mark.parametrize("share", [0.45, 0.7, 0.95])
def test_ordered_speed_is_reached_in_calm_water(ship: Ship, share: float) -> None:
    combinator = Combinator(ship)
    order = share * combinator.curve.ship_speed[-1]
    end = run_voyage(combinator, ship, order, 900.0)[-1]
    assert end.ship_speed == pytest.approx(order, rel=0.01)
    assert end.shaft_speed == pytest.approx(float(combinator.set_points(order)[1]), rel=1e-3)


@by_ship
def test_resistance_reduces_the_speed_at_the_same_lever(ship: Ship) -> None:
    combinator = Combinator(ship)
    order = 0.8 * combinator.curve.ship_speed[-1]
    end = run_voyage(combinator, ship, order, 900.0, resistance=1.15)[-1]
    assert end.ship_speed == pytest.approx(
        combinator.steady_point(order, 1.15).ship_speed, rel=1e-3
    )
    assert 0.95 * order < end.ship_speed < 0.99 * order


def test_episodes_start_in_the_initial_state_and_batches_equal_singles() -> None:
    combinator = Combinator("frigate")
    rows = np.array(
        [[8.0, 9.0, 1e5, 1.2, 15.0, 7.0, 6.6, 1.0], [11.0, 12.0, 2e5, 1.3, 28.0, 9.0, 8.5, 0.0]]
    )
    actions, state = combinator.predict(rows)
    assert actions.dtype == np.float32
    assert actions.shape == (2, 2)
    assert state.shape == (2, 4)
    again, later = combinator.predict(rows, state + 5.0, np.array([True, False]))
    np.testing.assert_array_equal(again[0], actions[0])
    assert later[1, 0] != state[1, 0]
    single, _ = combinator.predict(rows[1])
    np.testing.assert_array_equal(single, actions[1])
    assert np.all(np.abs(actions) <= 1.0)


def test_a_trimmed_lever_brings_the_ship_speed_to_the_order() -> None:
    """With a higher resistance the combinator stays below the order; the trim corrects it."""
    errors = {}
    for trim_s in (0.0, 30.0):
        env = FrigateVectorEnv(
            2, task="transit", sea="calm", sensor_noise=0.0, max_episode_steps=800, **CLASSIC
        )
        lever = Combinator("frigate", trim_s=trim_s)
        options = {"speed_order_m_s": 7.5, "resistance_rise": 0.3}
        (seen, _), state = env.reset(seed=1, options=options), None
        for _ in range(790):
            action, state = lever.predict(seen, state)
            seen, *_ = env.step(action)
        errors[trim_s] = float(np.abs(7.5 - seen[:, 5]).max())
    assert errors[0.0] > 0.25
    assert errors[30.0] < 0.12
    assert (state[:, 1] > 0.2).all()  # type: ignore[index]


def test_a_large_error_as_after_a_new_order_trims_no_faster() -> None:
    lever = Combinator("frigate", trim_s=30.0)
    for short, moves in ((0.4, 0.4), (-0.4, -0.4), (0.5, 0.5), (3.0, 0.5), (-3.0, -0.5)):
        row = np.array([8.0, 9.0, 1e5, 1.2, 15.0, 8.0 - short, 6.6, 1.0])
        assert lever.predict(row)[1][0, 1] == pytest.approx(0.5 / 30.0 * moves)
    with pytest.raises(ValueError, match=r"trim_s = -1\.0 s"):
        Combinator("frigate", trim_s=-1.0)


def test_the_scheduled_pitch_keeps_the_engine_within_its_torque() -> None:
    frigate = SHIPS[0]
    plain, plant = Combinator(frigate), frigate.record()
    order = float(plain.curve.ship_speed[-1])
    pitch, speed = (float(x) for x in plain.set_points(order))
    row = np.array([order, speed, 2e5, pitch, 30.0, order, 0.95 * order, 1.0])
    slow = row * [1, 1, 1, 1, 1, 0.8, 0.8, 1]
    fast = row * [1, 1, 1, 1, 1, 1.02, 1.02, 1]
    wrong_wake = row * [1, 1, 1, 1, 1, 1, 0.87, 1]
    for weight, rows in ((0.0, (slow,)), (1.0, (slow, wrong_wake))):
        for heavy in rows:
            action, _ = Combinator(frigate, va_weight=weight).predict(heavy)
            found = 0.6 + 0.4 * (float(action[0]) + 1.0)
            assert found < pitch - 0.01
            # The engine torque is at its limit there, from the velocity that the schedule gives.
            share = torque_share(plant, float(heavy[6]), speed, found)
            assert share == pytest.approx(TORQUE_MARGIN, abs=1e-4)
    for weight, light in ((0.0, fast), (1.0, fast), (0.0, wrong_wake)):
        action, _ = Combinator(frigate, va_weight=weight).predict(light)
        np.testing.assert_array_equal(action, plain.predict(light)[0])
    # The pitch is that of the curve where the speed log fails.
    lost = np.where(np.arange(8) == 5, np.nan, slow)
    np.testing.assert_array_equal(
        Combinator(frigate, va_weight=1.0).predict(lost)[0], plain.predict(lost)[0]
    )


def test_scheduled_batches_equal_singles_and_a_bad_weight_is_refused() -> None:
    lever = Combinator("frigate", va_weight=1.0)
    rng = np.random.default_rng(1)
    rows = np.array([11.0, 13.0, 2e5, 1.3, 28.0, 9.0, 8.5, 1.0]) * rng.uniform(0.8, 1.1, (3, 8))
    states: list[np.ndarray | None] = [None] * 3
    state = None
    for _ in range(5):
        actions, state = lever.predict(rows, state)
        for i in range(3):
            action, states[i] = lever.predict(rows[i], states[i])
            np.testing.assert_array_equal(action, actions[i])
            np.testing.assert_array_equal(states[i][0], state[i])  # type: ignore[index]
    with pytest.raises(ValueError, match=r"combinator: va_weight = 2\.0: must be from 0 to 1"):
        Combinator("frigate", va_weight=2.0)


def test_bad_curves_are_refused() -> None:
    ferry = SHIPS[1]
    with pytest.raises(ValueError, match="must rise"):
        curve_through(ferry, [0, 1], [0.8, 0.5], [50.0, 40.0])
    with pytest.raises(ValueError, match="must rise"):
        curve_through(ferry, [0, 0], [0.5, 0.8], [40.0, 50.0])
    for wrong in (
        {"full_pitch_lever": 1.0},
        {"full_pitch_lever": 0.0},
        {"floor_share": 1.0},
        {"floor_share": -0.1},
    ):
        with pytest.raises(ValueError, match=r"floor_share = .*, full_pitch_lever = "):
            combinator_curve(ferry, **wrong)
    with pytest.raises(ShipError, match="diesel"):
        full_pitch(load_ship("tito-neri-sine"))
