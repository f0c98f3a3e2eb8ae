from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.combinator import Combinator
from shaftline.baselines.combinator_surface import OptimalSetting, combinator_surface, look_up
from shaftline.baselines.controller import measurements_of
from shaftline.baselines.cpp_optimiser import ADVANCE, INTEGRAL, THRUST, TRIM, TRUST, CppOptimiser
from shaftline.baselines.registry import make_controller
from shaftline.baselines.uncertainty import Uncertainty
from shaftline.plant import Ship, load_ship

from .voyage import run_voyage

SHIPS = [load_ship("frigate"), load_ship("ferry")]
LONG = {"frigate": 500.0, "ferry": 200.0}  # time to a steady ship speed [s]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


@by_ship
@pytest.mark.parametrize("share", [0.4, 0.65, 0.9])
def test_after_a_resistance_rise_no_more_fuel_than_the_combinator(ship: Ship, share: float) -> None:
    """Experiment of the paper: 15 % more resistance, thrust corrected to equal ship speed."""
    combinator, optimiser = Combinator(ship), CppOptimiser(ship)
    plain = combinator.steady_point(share * float(combinator.curve.ship_speed[-1]), 1.15)
    order = plain.ship_speed * 1.15**0.5  # with the thrust for this speed at the higher resistance
    before = (plain.fuel_rack, plain.pitch_ratio)
    log = run_voyage(optimiser, ship, order, LONG[ship.name], resistance=1.15, start=before)
    end = log[-1]
    assert end.ship_speed == pytest.approx(plain.ship_speed, rel=0.005)
    per_resistance = (end.ship_speed / plain.ship_speed) ** 3  # remaining difference
    assert end.fuel_flow <= plain.fuel_flow * per_resistance
    assert np.ptp([e.shaft_speed for e in log[-100:]]) < 1e-2 * end.shaft_speed  # no oscillation


@by_ship
@pytest.mark.parametrize("share", [0.25, 0.85])
def test_ordered_speed_is_held_in_calm_water(ship: Ship, share: float) -> None:
    optimiser = CppOptimiser(ship)
    order = share * float(optimiser.combinator.curve.ship_speed[-1])
    order = max(order, float(optimiser.combinator.curve.ship_speed[0]))
    faster = optimiser.combinator.steady_point(1.1 * order)
    log = run_voyage(
        optimiser, ship, order, LONG[ship.name], start=(faster.fuel_rack, faster.pitch_ratio)
    )
    assert log[0].ship_speed > 1.05 * order
    assert log[-1].ship_speed == pytest.approx(order, rel=0.01)


def test_without_a_valid_estimate_it_is_the_combinator() -> None:
    ferry = SHIPS[1]
    plain = run_voyage(Combinator(ferry), ferry, 5.0, 60.0)
    blind = run_voyage(CppOptimiser(ferry), ferry, 5.0, 60.0, valid=False)
    for one, other in zip(plain, blind, strict=True):
        np.testing.assert_array_equal(one.action, other.action)


def test_an_invalid_estimate_has_no_lasting_effect() -> None:
    optimiser = CppOptimiser(SHIPS[1])
    row = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 1.0])
    _, state = optimiser.predict(row)
    broken = row.copy()
    broken[6], broken[7] = np.nan, 0.0
    actions, state = optimiser.predict(broken, state)
    assert np.all(np.isfinite(actions))
    assert np.all(np.isfinite(state))


def test_thrust_estimate_is_the_thrust_of_the_plant() -> None:
    for ship in SHIPS:
        optimiser = CppOptimiser(ship)
        steady = optimiser.combinator.steady_point(
            0.7 * float(optimiser.combinator.curve.ship_speed[-1])
        )
        row = [
            6.0,
            steady.shaft_speed,
            0.0,
            steady.pitch_ratio,
            0.0,
            0.0,
            steady.advance_velocity,
            1,
        ]
        assert optimiser.thrust(measurements_of(row))[0] == pytest.approx(steady.thrust, rel=1e-3)


def test_thrust_estimate_is_held_where_the_fit_ends() -> None:
    optimiser = CppOptimiser(SHIPS[1])

    def thrust(advance: float, shaft_speed: float, pitch: float) -> float:
        row = [5.0, shaft_speed, 900.0, pitch, 18.0, 4.8, advance, 1.0]
        return float(optimiser.thrust(measurements_of(row))[0])

    n = 45.0 / (2.0 * math.pi)  # D = 1 m, pitch ratios 0.4 to 1.2
    assert thrust(-1.0, 45.0, 0.8) == thrust(0.0, 45.0, 0.8) > thrust(0.1, 45.0, 0.8)
    assert thrust(0.8 * n + 1.0, 45.0, 0.8) == pytest.approx(thrust(0.8 * n, 45.0, 0.8), rel=1e-9)
    assert thrust(0.79 * n, 45.0, 0.8) != pytest.approx(thrust(0.8 * n, 45.0, 0.8), rel=1e-3)
    assert thrust(2.0, 45.0, 1.5) == thrust(2.0, 45.0, 1.2)
    assert thrust(2.0, 45.0, 0.1) == thrust(2.0, 45.0, 0.4)
    slowest = 1e-3 * 2.0 * math.pi
    assert thrust(0.0, 0.5 * slowest, 0.8) == thrust(0.0, slowest, 0.8) < thrust(0.0, 0.01, 0.8)


def test_ordered_thrust_holds_the_speed_in_calm_water() -> None:
    frigate = SHIPS[0]
    optimiser = CppOptimiser(frigate)
    found = optimiser.ordered_thrust(np.array([5.0, 9.0, -2.0]))
    per_square = 3306.2 / (2.0 * (1.0 - 0.07))
    assert found == pytest.approx([25.0 * per_square, 81.0 * per_square, 0.0])


ROW = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 1.0])


def changed(**values: float) -> Any:
    places = {"order": 0, "shaft_speed": 1, "rack": 4, "advance": 6, "valid": 7}
    row = ROW.copy()
    for name, value in values.items():
        row[places[name]] = value
    return row


def remembered(optimiser: CppOptimiser, **columns: float) -> Any:
    """Return a controller state in the middle of a voyage."""
    memory = np.array([[12.0, 4.0, 3000.0, 1.0, 0.5]])
    places = {
        "integral": INTEGRAL,
        "advance": ADVANCE,
        "thrust": THRUST,
        "trim": TRIM,
        "trust": TRUST,
    }
    for name, value in columns.items():
        memory[0, places[name]] = value
    return memory


def test_filters_start_at_their_first_input() -> None:
    optimiser = CppOptimiser(SHIPS[1], 0.25)
    _, first = optimiser.predict(ROW)
    estimate = float(optimiser.thrust(measurements_of(ROW))[0])
    assert first[0, ADVANCE] == pytest.approx(4.4)
    assert first[0, THRUST] == pytest.approx(estimate)
    assert first[0, TRUST] == pytest.approx(1.0)
    _, second = optimiser.predict(changed(advance=3.0), first)
    keep = math.exp(-0.25 / 8.0)
    later = float(optimiser.thrust(measurements_of(changed(advance=3.0)))[0])
    assert second[0, ADVANCE] == pytest.approx(keep * 4.4 + (1.0 - keep) * 3.0)
    assert second[0, THRUST] == pytest.approx(keep * estimate + (1.0 - keep) * later)
    _, blind = optimiser.predict(changed(advance=3.0, valid=0.0), first)
    assert blind[0, [ADVANCE, THRUST]].tolist() == first[0, [ADVANCE, THRUST]].tolist()


def test_weight_changes_with_a_time_constant_of_five_seconds() -> None:
    optimiser = CppOptimiser(SHIPS[1], 0.25)
    keep = math.exp(-0.25 / 5.0)
    for valid in (1.0, 0.0):
        _, after = optimiser.predict(changed(valid=valid), remembered(optimiser, trust=0.4))
        assert after[0, TRUST] == pytest.approx(keep * 0.4 + (1.0 - keep) * valid)
    _, after = optimiser.predict(changed(valid=0.0))
    assert after[0, TRUST] == 0.0
    # just above and below one half
    for valid, trusted in ((0.51, 1.0), (0.5, 0.0)):
        assert optimiser.predict(changed(valid=valid))[1][0, TRUST] == pytest.approx(trusted)


def looked_up(optimiser: CppOptimiser, order: float, advance: float) -> OptimalSetting:
    return look_up(optimiser.surface, optimiser.ordered_thrust(order), np.array([advance]))


def test_trim_is_the_integral_of_the_thrust_error() -> None:
    optimiser = CppOptimiser(SHIPS[1], 0.25)
    _, after = optimiser.predict(ROW, remembered(optimiser))
    setting = looked_up(optimiser, 5.0, after[0, ADVANCE])
    assert setting.reach[0] == 1.0
    error = (setting.thrust[0] - after[0, THRUST]) / setting.thrust[0]
    assert 0.01 < abs(error) < 1.0
    rate = 0.5 * setting.shaft_speed[0] * error / 20.0
    assert after[0, TRIM] == pytest.approx(1.0 + 0.25 * rate)
    # The error is limited to the whole thrust.
    _, after = optimiser.predict(ROW, remembered(optimiser, thrust=1e6))
    setting = looked_up(optimiser, 5.0, after[0, ADVANCE])
    assert after[0, TRIM] == pytest.approx(1.0 - 0.25 * 0.5 * setting.shaft_speed[0] / 20.0)
    # The trim is constant without a valid estimate.
    _, after = optimiser.predict(changed(valid=0.0), remembered(optimiser))
    assert after[0, TRIM] == 1.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_trim_ends_at_a_fifth_of_the_highest_shaft_speed(side: float) -> None:
    optimiser = CppOptimiser(SHIPS[1])
    most = 0.2 * SHIPS[1].shaft_speeds[1]
    thrust = 0.0 if side > 0.0 else 1e6
    memory = remembered(optimiser, trim=side * 0.999 * most, thrust=thrust)
    assert optimiser.predict(ROW, memory)[1][0, TRIM] == pytest.approx(side * most)


@pytest.mark.parametrize("order", [5.0, 1.6])
def test_set_points_change_gradually(order: float) -> None:
    """The weights are the validity of the estimate and the reach of the surface."""
    ferry = SHIPS[1]
    optimiser = CppOptimiser(ferry, 0.25)
    row = changed(order=order, rack=14.0)
    action, after = optimiser.predict(row, remembered(optimiser, trust=0.6, integral=math.nan))
    setting = looked_up(optimiser, order, after[0, ADVANCE])
    assert (setting.reach[0] == 1.0) == (order == 5.0)
    share = after[0, TRUST] * setting.reach[0]
    plain_pitch, plain_speed = optimiser.combinator.set_points(order)
    pitch = share * setting.pitch_ratio[0] + (1.0 - share) * plain_pitch
    speed = share * (setting.shaft_speed[0] + after[0, TRIM]) + (1.0 - share) * plain_speed
    assert action[0] == pytest.approx((pitch - 0.4) / 0.4 - 1.0, abs=1e-6)
    # The governor starts bumpless and continues with its integral.
    governor = optimiser.combinator.governor
    settled = governor.settle([45.0], [14.0], [speed])
    rack, integral = governor.command([speed], [45.0], settled)
    assert action[1] == pytest.approx(rack[0] / 16.0 - 1.0, abs=1e-6)
    assert after[0, INTEGRAL] == pytest.approx(integral[0])
    action, after = optimiser.predict(row, remembered(optimiser, trust=0.6))
    rack, integral = governor.command([speed], [45.0], [12.0])
    assert action[1] == pytest.approx(rack[0] / 16.0 - 1.0, abs=1e-6)
    assert after[0, INTEGRAL] == pytest.approx(integral[0])


def test_the_scheduled_velocity_replaces_the_estimate() -> None:
    ferry = SHIPS[1]
    row = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 1.0])

    def advance(weight: float | None, observation: Any) -> float:
        _, state = CppOptimiser(ferry, va_weight=weight).predict(observation)
        return float(state[0, ADVANCE])

    nominal = 0.92 * 4.8
    for velocity, valid in ((0.9 * nominal, 1.0), (2.0 * nominal, 1.0), (0.9 * nominal, 0.0)):
        now = np.array([*row[:6], velocity, valid])
        assert advance(0.0, now) == pytest.approx(nominal)  # nominal wake
        used = 0.9 if velocity < nominal and valid else 1.0  # fallback outside the band
        assert advance(1.0, now) == pytest.approx(used * nominal)
    assert advance(None, row) == 4.4


def test_a_scheduled_optimiser_needs_no_valid_estimate() -> None:
    row = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 0.0])
    _, blind = CppOptimiser(SHIPS[1]).predict(row)
    _, scheduled = CppOptimiser(SHIPS[1], va_weight=1.0).predict(row)
    assert (blind[0, TRUST], scheduled[0, TRUST]) == (0.0, 1.0)
    # With a failed speed log as well the combinator takes over.
    lost = np.where(np.arange(8) == 5, np.nan, row)
    action, state = CppOptimiser(SHIPS[1], va_weight=1.0).predict(lost)
    assert state[0, TRUST] == 0.0
    np.testing.assert_array_equal(action, CppOptimiser(SHIPS[1]).predict(lost)[0])


def test_scheduled_batches_equal_singles() -> None:
    optimiser = CppOptimiser(SHIPS[1], va_weight=1.0)
    rng = np.random.default_rng(1)
    rows = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 1.0]) * rng.uniform(0.8, 1.1, (3, 8))
    states: list[Any] = [None] * 3
    state: Any = None
    for _ in range(5):
        actions, state = optimiser.predict(rows, state)
        for i in range(3):
            action, states[i] = optimiser.predict(rows[i], states[i])
            np.testing.assert_array_equal(action, actions[i])
            np.testing.assert_array_equal(states[i][0], state[i])
    with pytest.raises(ValueError, match="cpp-optimiser: va_weight = -1"):
        CppOptimiser(SHIPS[1], va_weight=-1.0)


def test_options_choose_the_surface() -> None:
    ferry = SHIPS[1].with_values({"emissions.nox_base_g_kWh": 9.0, "emissions.nox_m1_s0": 0.8})
    clean = make_controller("cpp-optimiser:nox_weight=0.3", ferry, 0.5)
    assert isinstance(clean, CppOptimiser)
    own = combinator_surface(ferry, nox_weight=0.3)
    np.testing.assert_array_equal(clean.surface.pitch_ratio, own.pitch_ratio)
    assert np.any(own.pitch_ratio != CppOptimiser(ferry).surface.pitch_ratio)
    errors = "kq_error=0.05,eta_r_error=0.03,wake_error=0.04"
    for more, expected in (("", False), (",expected=1", True)):
        robust = make_controller(f"cpp-optimiser:{errors}{more}", ferry, 0.5)
        assert isinstance(robust, CppOptimiser)
        own = combinator_surface(ferry, uncertainty=Uncertainty(0.05, 0.03, 0.04, expected))
        np.testing.assert_array_equal(robust.surface.pitch_ratio, own.pitch_ratio)
        assert np.any(own.pitch_ratio != CppOptimiser(ferry).surface.pitch_ratio)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"nox_weight": 0.3}, r"nox_weight = 0.3 needs a NOx map; add the section \[emissions\]"),
        ({"nox_weight": -1.0}, "nox_weight = -1.0: must be 0 to 10"),
        ({"kq_error": 0.5}, "kq_error = 0.5: must be 0 to 0.3"),
        ({"kq_error": 0.05, "expected": 0.5}, r"expected = 0.5: must be 1 \(expected fuel\)"),
        ({"expected": 1.0}, "expected = 1: needs a kq_error, eta_r_error or wake_error above 0"),
    ],
)
def test_unusable_options_are_refused(options: dict[str, float], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        CppOptimiser(SHIPS[1], **options)  # type: ignore[arg-type]
