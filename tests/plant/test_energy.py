"""No power out of nothing: coasting, crash stop, start-up and reversal by pitch on every ship."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from shaftline.plant import Schedule, Ship, State, equilibrium, load_ship, ship_names, simulate
from shaftline.plant.dynamics import evaluate, loads
from shaftline.plant.shaft import friction_before_meter, load_torque, shaft_inertia
from shaftline.plant.state import Inputs

SHIPS = ship_names()
FREE = [name for name in SHIPS if load_ship(name).turns_freely]
"""Ships whose drive has a torque of its own; a rig that holds its speed gives whatever that takes."""
DIESELS = [name for name in SHIPS if load_ship(name).has_diesel]
MOVING = [name for name in SHIPS if load_ship(name).moves]
ROUNDING = 1e-9


def duration(ship: Ship) -> float:
    """Long enough for a ship to lose most of its way, or for a shaft on a bench to stop [s]."""
    if not ship.moves:
        return 20000.0 * ship.time_step_s
    return 3000.0 if ship.hull.mass_kg > 1e8 else 600.0


def settling(ship: Ship) -> float:
    """Time after which a drive has nothing left of an earlier command: ten of its lags [s]."""
    plant = ship.record()
    electric = 0.0
    if plant["armature_inductance"] > 0.0:
        electric = float(plant["armature_inductance"] / plant["armature_resistance"])
    return 10.0 * max(float(plant["engine_lag"]), electric)


@cache
def full_ahead(name: str) -> Any:
    """Steady state ahead under 60 % of the highest command."""
    ship = load_ship(name)
    plant = ship.record()
    return equilibrium(ship, 0.6 * float(plant["drive_max"]), ship.propeller.pitch_ratio_max)


class Powers(NamedTuple):
    """Energy of hull and shafts, and the powers that change it, of each sample."""

    energy: NDArray[np.float64]  # [J]
    drive: NDArray[np.float64]  # of all drives, at the propeller shafts [W]
    others: NDArray[np.float64]  # friction, propellers and resistance [W]


@numba.njit
def resisting_torque(plant: Any, torque: Any, omega: Any) -> Any:
    """Torque of propeller and friction at the shaft of each sample [N m]."""
    found = np.empty(len(omega))
    for k in range(len(omega)):
        found[k] = load_torque(plant, torque[k], omega[k]) + friction_before_meter(plant, omega[k])
    return found


def powers(ship: Ship, samples: NDArray[Any]) -> Powers:
    """Work out the energy balance; a shaft whose speed is held has no balance of its own."""
    plant = ship.record()
    shafts = float(plant["propellers"]) if ship.moves else 1.0
    omega, speed = samples["shaft_speed"], samples["ship_speed"]
    energy = np.zeros(len(samples))
    drive, others = np.zeros(len(samples)), np.zeros(len(samples))
    if ship.turns_freely:
        energy += 0.5 * shafts * shaft_inertia(plant) * omega**2
        down = plant["gear_ratio"] * plant["transmission_efficiency"]
        drive = shafts * down * samples["brake_torque"] * omega
        others -= shafts * resisting_torque(plant, samples["propeller_torque"], omega) * omega
    if ship.moves:
        energy += 0.5 * plant["mass"] * speed**2
        push = shafts * (1.0 - plant["thrust_deduction"]) * samples["thrust"]
        if ship.turns:  # a rudder amidships has a drag
            push = push + [
                loads(plant, State(p, w, v), Inputs(float(w), float(p)), p).surge_force
                for p, w, v in zip(samples["pitch_ratio"], omega, speed, strict=True)
            ]
        others += (push - samples["resistance"]) * speed
    return Powers(energy, drive, others)


def assert_balance(ship: Ship, samples: NDArray[Any], found: Powers, tolerance: float) -> None:
    """Energy gained is work done, to a share of the energy that moves; Simpson's rule over steps."""
    work = scipy.integrate.cumulative_simpson(
        found.drive + found.others, x=samples["time"], initial=0.0
    )
    size = float(np.ptp(found.energy)) + abs(float(found.energy[0]))
    np.testing.assert_allclose(
        found.energy - found.energy[0], work, rtol=0.0, atol=tolerance * size
    )


@cache
def coasted(name: str) -> NDArray[Any]:
    """Run from full ahead with no command."""
    ship = load_ship(name)
    pitch = ship.propeller.pitch_ratio_max
    begin = full_ahead(name).state
    return simulate(ship, Schedule(0.0, pitch), duration(ship), initial=begin)


@pytest.mark.parametrize("name", SHIPS)
def test_coasting_ship_loses_energy_and_never_makes_way_astern(name: str) -> None:
    ship, samples = load_ship(name), coasted(name)
    found = powers(ship, samples)
    settled = samples["time"] > settling(ship)
    assert np.all(np.diff(found.energy[settled]) <= ROUNDING * found.energy[0])
    assert np.all(samples["ship_speed"] >= 0.0)
    assert samples["ship_speed"][-1] < 0.5 * samples["ship_speed"][0] or not ship.moves
    assert samples["shaft_speed"].min() >= -1e-6 * samples["shaft_speed"][0]


@pytest.mark.parametrize("name", FREE)
def test_drive_without_command_gives_no_power(name: str) -> None:
    ship, samples = load_ship(name), coasted(name)
    found = powers(ship, samples)
    # the fuel, or the current, that was on its way when the command ended
    given = np.clip(found.drive, 0.0, None).sum() * ship.time_step_s
    assert given <= 0.11 * settling(ship) * max(found.drive[0], 0.0)
    settled = samples["time"] > settling(ship)
    assert np.all(found.drive[settled] <= ROUNDING * abs(found.drive).max())


@pytest.mark.parametrize("name", SHIPS)
def test_work_and_energy_of_a_coasting_ship_balance(name: str) -> None:
    ship, samples = load_ship(name), coasted(name)
    found = powers(ship, samples)
    if not ship.turns_freely:  # the rig stops the shaft within a step, which no rule integrates
        samples, found = samples[2:], Powers(*(value[2:] for value in found))
    assert_balance(ship, samples, found, 2e-5)


@pytest.mark.parametrize("name", FREE)
def test_propeller_of_a_coasting_ship_takes_from_the_flow_what_it_gives_the_shaft(
    name: str,
) -> None:
    samples = coasted(name)
    taken = samples["propeller_torque"] * samples["shaft_speed"]
    given = samples["thrust"] * samples["advance_velocity"]
    assert np.all(taken - given >= -ROUNDING * abs(taken).max())


@pytest.mark.parametrize("name", SHIPS)
def test_nothing_moves_from_rest_without_command(name: str) -> None:
    ship = load_ship(name)
    pitch = ship.propeller.pitch_ratio_max
    samples = simulate(
        ship, Schedule(0.0, pitch), 2000.0 * ship.time_step_s, initial=State(pitch, 0.0, 0.0)
    )
    for signal in ("shaft_speed", "ship_speed", "brake_torque", "thrust"):
        assert np.all(samples[signal] == 0.0)


@pytest.mark.parametrize("name", DIESELS)
def test_diesel_at_rest_does_not_start_by_fuel_alone(name: str) -> None:
    ship = load_ship(name)
    pitch = ship.propeller.pitch_ratio_max
    samples = simulate(
        ship, Schedule(ship.diesel.rack_max_mm, pitch), 100.0, initial=State(pitch, 0.0, 0.0)
    )
    assert np.all(samples["shaft_speed"] == 0.0)
    assert np.all(samples["ship_speed"] == 0.0)


@pytest.mark.parametrize("name", DIESELS)
def test_diesel_starts_by_air_and_goes_on_by_fuel(name: str) -> None:
    ship = load_ship(name)
    plant = ship.record()
    friction = -plant["torque_offset"] - plant["torque_per_speed"] * plant["engine_speed_min"]
    ship = ship.with_values({"prime_mover.starting_air_torque_N_m": 3.0 * float(friction)})
    pitch, rack = ship.propeller.pitch_ratio_min, 0.5 * ship.diesel.rack_max_mm
    samples = simulate(ship, Schedule(rack, pitch), 300.0, initial=State(pitch, 0.0, 0.0))
    assert samples["shaft_speed"][-1] > ship.shaft_speeds[0]
    assert samples["ship_speed"][-1] > 1.0
    assert samples["shaft_speed"].min() == 0.0
    assert_balance(ship, samples, powers(ship, samples), 2e-4)


@pytest.mark.parametrize("name", FREE)
def test_started_drive_gives_the_energy_that_ship_and_water_take(name: str) -> None:
    """Electric ones from rest, a diesel from idle speed."""
    ship = load_ship(name)
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_min
    pushed = ship.shaft_speeds[0] if ship.has_diesel else 0.0
    drive = 0.5 * float(plant["drive_max"])
    begin = State(pitch, pushed, 0.0)
    samples = simulate(ship, Schedule(drive, pitch), 2000.0 * ship.time_step_s, initial=begin)
    found = powers(ship, samples)
    assert samples["shaft_speed"][-1] > pushed
    assert np.all(found.drive[samples["time"] > 0.0] > 0.0)
    assert_balance(ship, samples, found, 2e-3)


@pytest.mark.parametrize("name", DIESELS)
def test_crash_stop_by_fuel_never_turns_a_diesel_astern(name: str) -> None:
    """Fuel off, blades at the least pitch, and full fuel again on the engine that has stalled."""
    ship = load_ship(name)
    low, high = ship.propeller.pitch_ratio_min, ship.diesel.rack_max_mm
    schedule = Schedule(lambda t: np.where(t < 300.0, 0.0, high), low)
    samples = simulate(ship, schedule, 600.0, initial=full_ahead(name).state)
    found = powers(ship, samples)
    stalled = samples["shaft_speed"] < 0.4 * ship.shaft_speeds[0]
    assert stalled[samples["time"] == 300.0]
    assert np.all(found.drive[stalled] <= 0.0)
    assert samples["shaft_speed"].min() >= -1e-6 * samples["shaft_speed"][0]
    assert np.all(samples["ship_speed"] >= 0.0)
    assert_balance(ship, samples, found, 2e-5)


@pytest.mark.parametrize("name", [name for name in MOVING if name not in DIESELS])
def test_crash_stop_by_reversed_command_stops_the_ship_by_the_work_it_does(name: str) -> None:
    ship = load_ship(name)
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_max
    back = -0.3 * float(plant["drive_max"])
    samples = simulate(ship, Schedule(back, pitch), duration(ship), initial=full_ahead(name).state)
    found = powers(ship, samples)
    assert samples["ship_speed"][-1] < 0.1 * samples["ship_speed"][0]
    against = samples["shaft_speed"] > 0.0
    assert np.all(found.drive[against] <= 0.0)  # as long as the shaft turns ahead, the drive brakes
    if not ship.turns_freely:
        samples, found = samples[2:], Powers(*(value[2:] for value in found))
    assert_balance(ship, samples, found, 2e-5)


@pytest.mark.parametrize("name", [name for name in DIESELS if load_ship(name).has_variable_pitch])
def test_blades_that_reverse_brake_ship_and_engine(name: str) -> None:
    """Packaged blades turn to no less than P/D 0.4: pitch alone drives no ship astern without fuel."""
    ship = load_ship(name)
    low, high = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max
    assert low > 0.0
    schedule = Schedule(0.0, lambda t: np.where((t // 40.0) % 2.0 == 0.0, low, high))
    samples = simulate(ship, schedule, 600.0, initial=full_ahead(name).state)
    found = powers(ship, samples)
    settled = samples["time"] > settling(ship)
    assert np.all(np.diff(found.energy[settled]) <= ROUNDING * found.energy[0])
    assert np.all(found.drive[settled] <= 0.0)
    assert np.all(samples["ship_speed"] >= 0.0)
    assert_balance(ship, samples, found, 2e-5)


@pytest.mark.parametrize("name", ["frigate", "ferry"])
def test_coasting_agrees_with_an_independent_integrator(name: str) -> None:
    ship = load_ship(name)
    plant, begin = ship.record(), full_ahead(name).state
    pitch = ship.propeller.pitch_ratio_max

    def rates(_: float, y: NDArray[np.float64]) -> list[float]:
        rate, _outputs = evaluate(plant, State(*map(float, y)), Inputs(0.0, pitch), pitch)
        return [float(value) for value in rate]

    exact = scipy.integrate.solve_ivp(
        rates,
        (0.0, 600.0),
        list(map(float, begin)),
        method="DOP853",
        rtol=1e-10,
        atol=1e-10,
        t_eval=np.arange(0.0, 600.1, 20.0),
        max_step=0.5,
    )
    rows = coasted(name)[:: round(20.0 / ship.time_step_s)]
    names = list(State._fields)
    for signal in ("shaft_speed", "ship_speed", "position"):
        np.testing.assert_allclose(rows[signal], exact.y[names.index(signal)], rtol=1e-6, atol=1e-6)
