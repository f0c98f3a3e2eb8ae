"""Propellers in air, water and mercury, and effects of water that another fluid does not have."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Schedule, Ship, ShipError, State, get_sea, load_ship, realise, simulate
from shaftline.plant.ship import validate_tables

FAN: dict[str, Any] = {
    "name": "fan",
    "water": {"density_kg_m3": 1.2},
    "hull": {"fixed": True},
    "propeller": {
        "model": "bollard",
        "diameter_m": 0.2,
        "pitch_ratio_min": 0.7,
        "pitch_ratio_max": 0.7,
        "depth_m": 1.0,
        "thrust_coefficient": 0.1,
        "torque_coefficient": 0.017,
    },
    "prime_mover": {"type": "speed-command", "speed_max_rad_s": 1300.0},
}


def fan(**sections: Any) -> Ship:
    return validate_tables(Ship, FAN | sections, "fan")


@pytest.mark.parametrize("density", [0.9, 1.2, 870.0, 13600.0])
def test_thrust_and_torque_are_those_of_any_fluid(density: float) -> None:
    """T = rho n^2 D^4 KT and Q = rho n^2 D^5 KQ, at 12 000 rpm."""
    speed = 400.0 * math.pi
    ship = fan(water={"density_kg_m3": density})
    found = simulate(ship, Schedule(speed, 0.7), 0.5, initial=State(0.7, speed, 0.0))[-1]
    assert found["thrust"] == pytest.approx(density * 200.0**2 * 0.2**4 * 0.1, rel=1e-12)
    assert found["propeller_torque"] == pytest.approx(
        density * 200.0**2 * 0.2**5 * 0.017, rel=1e-12
    )


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"ventilation": {"thrust_loss": 0.3}}, r"ventilation draws air .* 1\.2 kg/m3 is a gas"),
        (
            {"propeller": FAN["propeller"] | {"cavitation_breakdown": 0.5}},
            r"vapour pressure of water.*950 to 1100.*remove propeller\.cavitation_breakdown",
        ),
        ({"cavitation_bucket": {"suction_deg": 3.0}}, r"remove \[cavitation_bucket\]"),
        (
            {"water": {"density_kg_m3": 13600.0}, "cavitation_bucket": {"suction_deg": 3.0}},
            r"13600 kg/m3 is another fluid",
        ),
        (
            {"hull": {"mass_kg": 10.0, "resistance_coefficient_N_s2_m2": 1.0}},
            r"a gas, in which no hull floats.*hull\.fixed = true.*inflow_velocity_m_s",
        ),
        ({"water": {"density_kg_m3": 0.3}}, r"density_kg_m3 = 0\.3.*>= 0\.5 and <= 14000"),
    ],
)
def test_what_the_fluid_does_not_have_is_refused(sections: dict[str, Any], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        fan(**sections)


def test_numbers_of_cavitation_and_ventilation_act_on_nothing_in_air() -> None:
    ship = fan()
    assert not ship.has_key("propeller.cavitation_breakdown")
    assert not ship.has_key("ventilation.thrust_loss")
    assert ship.has_key("propeller.torque_coefficient")
    in_oil = ship.with_values({"water.density_kg_m3": 870.0})
    assert in_oil.has_key("ventilation.thrust_loss")
    assert not in_oil.has_key("cavitation_bucket.suction_deg")
    with pytest.raises(ShipError, match="turns in a fluid that is not water"):
        ship.parameter("propeller.cavitation_breakdown")


def test_waves_need_a_liquid() -> None:
    sea = get_sea("state-4")
    assert sea is not None
    waves = realise(sea, depth_m=1.0, seed=1)
    with pytest.raises(ValueError, match=r"waves require a liquid.*simulate without a sea"):
        simulate(fan(), Schedule(100.0, 0.7), 1.0, initial=State(0.7, 100.0, 0.0), sea=waves)


def test_a_shaft_turns_at_up_to_ten_thousand_radians_a_second() -> None:
    fast = fan(prime_mover={"type": "speed-command", "speed_max_rad_s": 1e4})
    assert fast.record()["drive_max"] == 1e4
    with pytest.raises(ShipError, match=r"speed_max_rad_s = 20000\.0.*<= 10000"):
        fan(prime_mover={"type": "speed-command", "speed_max_rad_s": 2e4})


def test_a_ship_is_in_water() -> None:
    ship = load_ship("frigate")
    assert ship.in_water
    assert ship.in_liquid
    assert np.isfinite(ship.parameter("propeller.cavitation_breakdown").value)
