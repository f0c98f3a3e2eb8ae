from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Equilibrium, Schedule, Ship, simulate
from shaftline.plant.actuators import blade_pitch, pitch_rate, rack_travel

STEP = 1e-30


def rate_slope(plant: Any, command: float, pitch: float) -> float:
    """d(rate)/d(pitch)."""
    return float(complex(pitch_rate(plant, command + 0j, pitch + STEP * 1j)).imag / STEP)


@pytest.mark.parametrize(
    ("command", "pitch", "rate"),
    [
        (1.0, 1.4, -0.2),
        (1.4, 1.0, 0.2),
        (0.2, 1.0, -0.2),  # below the lowest, 0.6
        (1.6, 1.0, 0.2),  # above the highest, 1.4
    ],
)
def test_pitch_goes_to_its_command_within_its_range(
    plant: Any, command: float, pitch: float, rate: float
) -> None:
    assert pitch_rate(plant, command, pitch) == pytest.approx(rate, rel=1e-14)


def test_offset_is_added_to_the_command_and_not_limited(plant: Any) -> None:
    plant["pitch_actuator_offset"] = 0.05
    assert pitch_rate(plant, 1.0, 1.05) == pytest.approx(0.0, abs=1e-15)
    assert pitch_rate(plant, 1.6, 1.4) == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("error", "left"), [(0.029, 0.0), (-0.029, 0.0), (0.1, 0.07), (-0.1, -0.07)]
)
def test_dead_band_is_taken_off_the_error(plant: Any, error: float, left: float) -> None:
    plant["pitch_dead_band"] = 0.03
    assert pitch_rate(plant, 1.0 + error, 1.0) == pytest.approx(left / 2.0, abs=1e-15)
    assert rate_slope(plant, 1.0 + error, 1.0) == (-0.5 if left else 0.0)


@pytest.mark.parametrize(
    ("command", "pitch", "rate"),
    [(1.1, 1.0, 0.05), (1.4, 0.6, 0.1), (0.9, 1.0, -0.05), (0.6, 1.4, -0.1)],
)
def test_rate_is_limited_both_ways(plant: Any, command: float, pitch: float, rate: float) -> None:
    plant["pitch_rate_limit"] = 0.1
    assert pitch_rate(plant, command, pitch) == pytest.approx(rate)
    assert rate_slope(plant, command, pitch) == (-0.5 if abs(rate) == 0.05 else 0.0)


@pytest.mark.parametrize(
    ("actuator", "before", "blade"),
    [
        (1.0, 1.0, 1.0),
        (1.019, 1.0, 1.0),
        (0.981, 1.0, 1.0),
        (1.1, 1.0, 1.08),
        (0.9, 1.0, 0.92),
    ],
)
def test_blade_follows_its_actuator_at_half_the_play(
    plant: Any, actuator: float, before: float, blade: float
) -> None:
    plant["pitch_backlash"] = 0.04
    assert blade_pitch(plant, actuator, before) == pytest.approx(blade, rel=1e-15)


def test_without_play_the_blade_is_at_the_actuator(plant: Any) -> None:
    assert blade_pitch(plant, 1.1, 0.7) == 1.1


@pytest.mark.parametrize(
    ("demand", "before", "limit", "after"),
    [
        (22.0, 10.0, np.inf, 22.0),
        (60.0, 10.0, np.inf, 40.0),
        (-5.0, 10.0, np.inf, 0.0),
        (30.0, 20.0, 2.0, 21.0),
        (10.0, 20.0, 2.0, 19.0),
        (20.5, 20.0, 2.0, 20.5),
        (50.0, 39.5, 2.0, 40.0),
        (-9.0, 0.5, 2.0, 0.0),
    ],
)
def test_rack_travels_at_its_rate_between_its_stops(
    plant: Any, demand: float, before: float, limit: float, after: float
) -> None:
    plant["rack_rate_limit"] = limit
    assert rack_travel(plant, demand, before, 0.5).end == after


@pytest.mark.parametrize(("before", "demand"), [(10.0, 30.0), (30.0, 12.0)])
@pytest.mark.parametrize("moves", [0.01, 0.25, 0.5, 0.8, 1.0, 3.0])
def test_a_step_weighs_the_travel_of_the_rack_exactly(
    plant: Any, before: float, demand: float, moves: float
) -> None:
    """Mean and first moment by Simpson's rule are those of the line, wherever in the step it ends."""
    plant["rack_rate_limit"] = abs(demand - before) / moves / 0.5
    start, middle, end = rack_travel(plant, demand, before, 0.5)
    share = np.linspace(0.0, 1.0, 200_001)
    line = before + (demand - before) * np.minimum(share / moves, 1.0)
    assert end == pytest.approx(line[-1], rel=1e-12)
    assert (start + 4.0 * middle + end) / 6.0 == pytest.approx(np.trapezoid(line, share), rel=1e-9)
    moment = np.trapezoid(line * share, share)
    assert (2.0 * middle + end) / 6.0 == pytest.approx(moment, rel=1e-9)


def test_a_rack_without_a_rate_limit_is_at_its_demand_throughout(plant: Any) -> None:
    assert rack_travel(plant, 30.0, 10.0, 0.5) == (30.0, 30.0, 30.0)


def test_a_rack_does_not_leave_its_stops_within_a_step(plant: Any) -> None:
    plant["rack_rate_limit"] = 4.0
    for demand in np.linspace(0.05, 2.0, 40):
        assert 0.0 <= rack_travel(plant, demand, 0.0, 0.5).start <= demand


def with_actuator(ship: Ship, **values: float) -> Ship:
    return ship.with_values({f"pitch_actuator.{key}": value for key, value in values.items()})


def pitch_step(ship: Ship, start: Equilibrium, commands: Any, duration: float) -> NDArray[Any]:
    return simulate(ship, Schedule(22.0, commands), duration, initial=start.state)


def test_pitch_follows_first_order(frigate: Ship, design_point: Equilibrium) -> None:
    samples = pitch_step(frigate, design_point, 1.0, 10.0)
    expected = 1.0 + 0.4 * np.exp(-samples["time"] / 2.0)
    np.testing.assert_allclose(samples["pitch_ratio"], expected, rtol=1e-8)


def test_dead_band_leaves_its_own_width(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_actuator(frigate, dead_band=0.03)
    samples = pitch_step(ship, design_point, 1.0, 60.0)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.03, abs=1e-9)
    rest = pitch_step(ship, design_point, 1.372, 20.0)
    assert np.all(rest["pitch_ratio"] == 1.4)


def test_backlash_leaves_half_its_width_on_either_side(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = with_actuator(frigate, backlash=0.04)
    samples = pitch_step(ship, design_point, lambda t: np.where(t < 40.0, 1.0, 1.2), 80.0)
    assert samples["pitch_ratio"][799] == pytest.approx(1.0 + 0.02, abs=1e-8)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.2 - 0.02, abs=1e-8)
    rest = pitch_step(ship, design_point, 1.39, 20.0)  # within half the play
    assert np.all(rest["pitch_ratio"] == 1.4)


def test_actuator_offset_moves_the_blades_and_what_is_read(
    frigate: Ship, design_point: Equilibrium
) -> None:
    samples = pitch_step(with_actuator(frigate, offset=0.05), design_point, 1.0, 60.0)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.05, abs=1e-9)
    assert samples["measured_pitch_ratio"][-1] == samples["pitch_ratio"][-1]
