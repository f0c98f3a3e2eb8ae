"""The augmented filter's study: the falling body, the tanker and its twin, the frigate, the page."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shaftline.studies.augmented_filter import esso_osaka, falling_body, frigate, page, results
from shaftline.studies.augmented_filter.esso_osaka import COEFFICIENTS, TRUE

# -- the falling body --------------------------------------------------------------------------


def test_the_body_falls_as_scipy_says() -> None:
    """Gelb's equations written once more: g, and rho v^2 / (2 beta) with the density at its height."""

    def gelb(t: float, x: Any) -> list[float]:
        return [x[1], 3.4e-3 * math.exp(-x[0] / 22e3) * x[1] ** 2 / (2.0 * 3000.0) - 32.2]

    fall = falling_body.fallen(3000.0, 0, 0.05, 0.0)
    theirs = solve_ivp(
        gelb, (0.0, 16.0), [100_100.0, -5650.0], t_eval=fall["time_s"], rtol=1e-10, atol=1e-6
    )
    assert fall["height_ft"].to_numpy() == pytest.approx(theirs.y[0], rel=1e-5)


@pytest.mark.parametrize(
    ("beta", "printed"),
    [(3000.0, [1.432, 0.0154, 0.0286, 0.0122]), (2000.0, [1.294, 0.00453, 0.0094, 0.0103])],
)
def test_with_exact_readings_the_whole_story_holds(beta: float, printed: list[float]) -> None:
    """The first row of each truth in docs/results/augmented-filter.md."""
    fall = falling_body.fallen(beta, 0, 0.05, 0.0)
    told = falling_body.story(fall, beta)
    assert told == pytest.approx(printed, rel=0.01)
    assert np.all(told < [*falling_body.STORY.values()])
    deviation = fall.set_index("time_s")["beta_sd"]
    assert deviation.iloc[0] == pytest.approx(500.0, rel=1e-3)
    # dense air tells what thin air does not: 5 s and 16 s
    assert deviation.iloc[99] > 0.99 * 500.0
    assert deviation.iloc[-1] < 0.02 * beta


# -- the tanker --------------------------------------------------------------------------------


def test_a_steady_turn_is_the_balance_of_its_forces() -> None:
    """At rest of sway and yaw; positive rudder turns to starboard, the bow inside the turn."""
    v, r, diameter = esso_osaka.steady_turn(TRUE)
    assert v < 0.0 < r
    assert diameter == pytest.approx(12.05, abs=0.005)
    angle = math.radians(10.0)
    side = esso_osaka.rudder_force(1.0, v, r, angle)
    force = -0.0244 * v - 0.0138 * r + side
    moment = -1.4578e-3 * v - 8.093e-4 * r - 0.5 * side
    assert abs(force) < 1e-4 * abs(side)
    assert abs(moment) < 1e-4 * abs(side)
    # and to port as to starboard
    one = esso_osaka.rate(np.array([1.0, v, 2.0 * r, 1.0]), TRUE, angle)
    other = esso_osaka.rate(np.array([1.0, -v, -2.0 * r, 1.0]), TRUE, -angle)
    assert other == pytest.approx(-one)


def test_the_rudder_s_lift_and_drag_by_hand() -> None:
    """Straight ahead the side force is the lift alone, rho / 2 of it left out with the dimensions."""
    slope = 1.0 / (1.0 / (1.8 * math.pi) + 1.0 / (math.pi * 1.538) + 1.0 / (2 * math.pi * 1.538**2))
    area, angle = 119.8 / 325.0**2, 0.1
    assert esso_osaka.rudder_force(1.0, 0.0, 0.0, angle) == pytest.approx(-area * slope * angle)
    # the stern moves to port at r > 0: water from port, v - r / 2 across
    drift = math.atan(-0.05)
    lift, drag = slope * (angle + drift), 0.0085
    expected = -area * (1.0 + 0.05**2) * (lift * math.cos(drift) + drag * math.sin(drift))
    assert esso_osaka.rudder_force(1.0, 0.0, 0.1, angle) == pytest.approx(expected)


def test_the_zig_zag_s_rudder_waits_for_the_heading() -> None:
    ten = math.radians(10.0)
    asked = [(0.0, 0.0), (0.17, ten), (0.18, ten), (-0.17, -ten), (-0.18, -ten), (0.18, -ten)]
    assert [esso_osaka.zig_zag(*one) for one in asked] == [ten, ten, -ten, -ten, ten, -ten]
    states, angles = esso_osaka.sailed(TRUE, 300.0, esso_osaka.zig_zag)
    (change,) = np.flatnonzero(np.diff(angles))
    step = esso_osaka.UPDATE_S / esso_osaka.SECONDS_PER_LENGTH
    heading = np.cumsum(0.5 * step * (states[1:, 2] + states[:-1, 2]))
    assert heading[change - 1] <= ten < heading[change]
    assert states[:, [0, 3]] == pytest.approx(1.0)


def test_the_twin_finds_its_four_coefficients() -> None:
    """Within three minutes, as the thesis says, if R is small enough."""
    names = [*COEFFICIENTS]
    exact = esso_osaka.identified(1e-8, 0.0, 240.0, 0)[names]
    # after a second it knows nothing yet
    assert exact.iloc[0].to_numpy() == pytest.approx([0.5] * 4, abs=0.05)
    assert exact.iloc[-1].to_numpy() == pytest.approx([1.0] * 4, abs=2e-4)
    noisy = esso_osaka.identified(1e-8, 1e-4, 300.0, 0)[names]
    assert noisy.iloc[179].to_numpy() == pytest.approx([1.0] * 4, abs=0.02)
    assert noisy.iloc[-1].to_numpy() == pytest.approx([1.0] * 4, abs=0.002)


def test_the_thesis_s_r_is_too_large_for_three_minutes() -> None:
    """R = 0.01 and exact readings: docs/results/augmented-filter.md."""
    found = esso_osaka.identified(1e-2, 0.0, 420.0, 0)[[*COEFFICIENTS]]
    assert found.iloc[179].to_numpy() == pytest.approx([0.429, 0.688, 0.423, 0.685], abs=1e-3)
    assert found.iloc[-1].to_numpy() == pytest.approx([0.815, 0.846, 0.791, 0.851], abs=1e-3)


# -- all of it, in small -----------------------------------------------------------------------


def as_wide_as_damped(theta: Any) -> tuple[float, float, float]:
    """A turn that needs no sailing: its diameter as the first coefficient over the truth."""
    return 0.0, 0.0, float(12.05 * np.asarray(theta)[0] / TRUE[0])


def test_results_and_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "FALLS", {"exact readings": (0.05, 0.0, 1)})
    monkeypatch.setattr(results, "TWINS", ((1e-8, 1e-4, 2), (1e-2, 0.0, 1)))
    monkeypatch.setattr(results, "MINUTES", (3, 5))
    monkeypatch.setattr(frigate, "SEEDS", (1,))
    monkeypatch.setattr(frigate, "SECONDS", 120.0)
    monkeypatch.setattr(frigate, "GROWTH", ([0.0, 300.0, 900.0, 1200.0], [0.0, 0.0, 0.2, 0.2]))
    grown = frigate.while_it_grows("calm", 1)
    monkeypatch.setattr(frigate, "while_it_grows", lambda sea, seed: grown)
    monkeypatch.setattr(frigate, "friction_on_line", lambda sea, seed: (6031.0, 551.0))
    monkeypatch.setattr(esso_osaka, "steady_turn", as_wide_as_damped)
    ticks: list[None] = []
    found = results.measured(lambda: ticks.append(None))
    assert len(ticks) == 2 * 1 + 2 + 2 * (1 + 1)
    told = found.told.set_index(["sea", "key"])
    for key, truth in frigate.CONCEALED.items():
        assert told.loc[("calm", key), "found"] == pytest.approx(truth, rel=0.02)
    growing = found.followed["calm"]
    settled = growing[growing["time_s"] > 900.0]
    assert settled["filter"].to_numpy() == pytest.approx(settled["truth"], abs=0.02)
    twins = found.twins.set_index(["R", "minutes"])
    assert twins.loc[(1e-8, 5), "worst error"] < 0.002
    text = page.body(found)
    assert "| 3000 | exact readings | 1 | 1.4 | 1.5 % | 2.9 % | 1.2 % |" in text
    assert "| 0.01 | 0 | 3 | 1 | 0.429 | 0.688 | 0.423 | 0.685 |" in text
    assert "12.05 (truth), 12.06 (R = 1e-08)" in text
    assert len(page.figure(found).axes) == 4
