"""The thesis's load cases on the frigate, for which they are printed, and on every other ship."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import Ship, load_ship, ship_names
from shaftline.plant.load_cases import CASES, LoadCase, get_case

SHORT = ("rack_step", "inflow_sine_high")


def test_the_frigate_meets_what_is_printed(frigate: Ship) -> None:
    run = CASES["rack_step"].run(frigate)
    assert (run["drive"][0], run["drive"][-1]) == (20.0, 27.5)
    assert np.all(run["pitch_command"] == 1.4)
    run = CASES["inflow_sine_high"].run(frigate)
    swing = run["advance_velocity"] - run["ship_speed"] * (1.0 - frigate.hull.wake_fraction)
    assert np.abs(swing).max() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("case", SHORT)
@pytest.mark.parametrize("name", [n for n in ship_names() if not n.startswith("tito-neri")])
def test_every_ship_meets_it_in_her_own_size(name: str, case: str) -> None:
    """Demands as shares of the drive's range: 0.5 to 0.6875, or 0.55; the pitch the highest."""
    ship = load_ship(name)
    run = CASES[case].run(ship)
    top = float(ship.record()["drive_max"])
    shares = (0.5, 0.6875) if case == "rack_step" else (0.55, 0.55)
    assert (run["drive"][0] / top, run["drive"][-1] / top) == pytest.approx(shares)
    assert run["pitch_command"][0] == pytest.approx(ship.propeller.pitch_ratio_max)
    assert np.all(np.isfinite(run["shaft_speed"]))
    if case == "inflow_sine_high":
        swing = np.ptp(run["advance_velocity"]) / 2.0
        turns = run["shaft_speed"][0] / (2.0 * np.pi) * ship.propeller.diameter_m
        # of the frigate 1 m/s over 7.03 m/s; the lesser where the hull's speed or an inflow's lag counts
        assert swing / turns == pytest.approx(1.0 / 7.03, rel=0.05)


@pytest.mark.parametrize(
    ("name", "case", "told"),
    [
        ("rov-thruster", "pitch_step", "needs a variable pitch; rov-thruster has a fixed pitch"),
        ("rov-thruster", "resistance_ramp", "needs a hull that moves; rov-thruster's is fixed"),
    ],
)
def test_a_case_that_would_move_nothing_is_refused(name: str, case: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        CASES[case].run(load_ship(name))


def test_an_unknown_case_is_told_with_the_known() -> None:
    assert isinstance(get_case("jonswap"), LoadCase)
    with pytest.raises(ValueError, match="unknown load case 'storm'; known: rack_step"):
        get_case("storm")
