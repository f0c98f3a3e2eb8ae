"""Emissions: NOx map, CO2 factor, limits of the tiers, fit of a map, and the simulated signals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    fit_nox_map,
    load_ship,
    nox_limit,
    simulate,
    simulate_recording,
    write_ship,
)
from shaftline.plant.columns import signal_columns
from shaftline.plant.emissions import CO2_FACTORS, co2_rate, nox_rate, specific_nox
from shaftline.plant.fuel import fuel_rate

MAP = {
    "emissions.nox_base_g_kWh": 10.0,
    "emissions.nox_m0_s0": 0.9,
    "emissions.nox_m1_s0": 0.5,
    "emissions.nox_m0_s1": -0.7,
    "emissions.nox_m2_s0": 0.2,
    "emissions.nox_m1_s1": -0.15,
    "emissions.nox_m0_s2": 0.1,
}
EMITTING = load_ship("frigate").with_values(MAP | {"emissions.co2_factor": 3.206})
RATED = 3.979e6  # W
E2 = ([1.0] * 4, [1.0, 0.75, 0.5, 0.25])
E3 = ([1.0, 0.91, 0.8, 0.63], [1.0, 0.75, 0.5, 0.25])


def operating(speed: float, power: float) -> tuple[float, float]:
    """Return engine speed [rad/s] and torque [N m] at shares of rated speed and power."""
    engine_speed = speed * 1000.0 * math.pi / 30.0
    return engine_speed, power * RATED / engine_speed


@pytest.mark.parametrize(("speed", "power"), [(1.0, 1.0), (0.8, 0.6), (0.4, 0.2)])
def test_the_map_is_its_polynomial_in_torque_and_speed(speed: float, power: float) -> None:
    plant, m, s = EMITTING.record(), power / speed, speed
    share = 0.9 + 0.5 * m - 0.7 * s + 0.2 * m * m - 0.15 * m * s + 0.1 * s * s
    found = specific_nox(plant, *operating(speed, power))
    assert found == pytest.approx(10.0 * share, rel=1e-12)
    grams = 10.0 * share * power * RATED / 1e3 / 3600.0  # g/kWh times kW, over an hour
    assert nox_rate(plant, *operating(speed, power)) == pytest.approx(grams, rel=1e-12)


@pytest.mark.parametrize("fuel", [("MDO", 3.206), ("MGO", 3.206), ("HFO", 3.114)])
def test_co2_is_a_factor_times_fuel(fuel: tuple[str, float]) -> None:
    name, factor = fuel
    assert CO2_FACTORS[name] == factor
    ship = load_ship("ferry").with_values({"emissions.co2_factor": factor})
    plant, at = ship.record(), (200.0, 300.0)
    assert co2_rate(plant, *at) == pytest.approx(factor * fuel_rate(plant, *at), rel=1e-12)
    assert co2_rate(plant, *at) > 0.01
    assert co2_rate(load_ship("ferry").record(), *at) == 0.0
    assert nox_rate(plant, *at) == 0.0  # a factor is no NOx map


@pytest.mark.parametrize(
    ("speed", "torque"), [(80.0, 0.0), (80.0, -1e4), (0.0, 1e4), (-50.0, -1e4)]
)
def test_without_power_ahead_there_is_no_nox(speed: float, torque: float) -> None:
    assert nox_rate(EMITTING.record(), speed, torque) == 0.0
    assert nox_rate(EMITTING.record(), 80.0, 1.0) > 0.0


@given(st.floats(-150, 150), st.floats(-1e5, 1e5), st.floats(-5, 5), st.floats(-5, 5))
def test_nox_is_finite_and_never_negative(w: float, torque: float, a: float, b: float) -> None:
    plant = EMITTING.record()
    plant["nox_m1_s0"], plant["nox_m0_s1"] = a, b
    assert 0.0 <= nox_rate(plant, w, torque) < math.inf


@pytest.mark.parametrize(
    ("tier", "rpm", "limit"),
    [
        (1, 129.9, 17.0),
        (1, 720.0, 12.07),  # 45 n^-0.2
        (1, 1999.9, 9.84),
        (1, 2000.0, 9.8),
        (2, 100.0, 14.4),
        (2, 720.0, 9.69),  # 44 n^-0.23
        (2, 2000.0, 7.7),
        (3, 100.0, 3.4),
        (3, 720.0, 2.41),  # 9 n^-0.2
        (3, 2200.0, 2.0),
    ],
)
def test_limits_of_the_tiers(tier: int, rpm: float, limit: float) -> None:
    assert nox_limit(rpm, tier) == pytest.approx(limit, abs=0.006)


def test_unknown_tiers_and_speeds_are_refused() -> None:
    with pytest.raises(ValueError, match="tier = 4: must be 1, 2 or 3"):
        nox_limit(720.0, 4)
    with pytest.raises(ValueError, match=r"rated_speed_rpm = 0\.0 rpm: must be above 0"):
        nox_limit(0.0, 2)


def test_a_fit_returns_the_map_of_its_points() -> None:
    """Both cycles determine a plane, twelve points all six coefficients."""
    speed, power = np.array(E2[0] + E3[0][1:]), np.array(E2[1] + E3[1][1:])
    plane = fit_nox_map(speed, power, 12.0 + 3.0 * power / speed - 6.0 * speed)  # type: ignore[arg-type]
    assert plane == pytest.approx(
        {
            "emissions.nox_base_g_kWh": 12.0,
            "emissions.nox_m1_s0": 0.25,
            "emissions.nox_m0_s1": -0.5,
        }
    )
    s, p = (x.ravel() for x in np.meshgrid([1.0, 0.8, 0.6, 0.4], [0.3, 0.2, 0.1]))
    ship = load_ship("frigate").with_values(MAP)
    measured = [specific_nox(ship.record(), *operating(*at)) for at in zip(s, p, strict=True)]
    found = load_ship("frigate").with_values(fit_nox_map(s.tolist(), p.tolist(), measured))
    for at in ((0.5, 0.4), (0.95, 0.7)):
        expected = specific_nox(ship.record(), *operating(*at))
        assert specific_nox(found.record(), *operating(*at)) == pytest.approx(expected, rel=1e-8)


def test_a_single_curve_determines_a_line_and_a_few_points_a_constant() -> None:
    line = fit_nox_map(*E3, [9.0, 9.0, 9.0, 9.0])
    assert line["emissions.nox_base_g_kWh"] == pytest.approx(9.0)
    assert line["emissions.nox_m1_s0"] == pytest.approx(0.0, abs=1e-12)
    eight = fit_nox_map(E2[0] * 2, E2[1] * 2, [1.0 + p for p in E2[1] * 2])  # one speed only
    assert eight == pytest.approx({"emissions.nox_base_g_kWh": 1.0, "emissions.nox_m1_s0": 1.0})
    two = fit_nox_map([1.0, 0.5], [1.0, 0.2], [8.0, 10.0])
    assert two == pytest.approx({"emissions.nox_base_g_kWh": 9.0})
    # a line whose constant is negative has the mean as its base
    steep = fit_nox_map(*E2, [7.0, 5.0, 3.0, 1.0])
    assert steep == pytest.approx(
        {
            "emissions.nox_base_g_kWh": 4.0,
            "emissions.nox_m0_s0": -0.25,
            "emissions.nox_m1_s0": 2.0,
        }
    )


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        (([1.0], [1.0, 0.5], [9.0]), "lists of equal length"),
        (([], [], []), "at least 1"),
        (([1.0], [0.0], [9.0]), "power must have finite values above 0"),
        (([1.0], [1.0], [math.nan]), "nox_g_kWh must have finite values above 0"),
    ],
)
def test_unusable_points_are_refused(columns: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        fit_nox_map(*columns)


def run(ship: Ship) -> Any:
    start = equilibrium(ship, 20.0, 1.2).state
    return simulate(ship, Schedule(drive=24.0, pitch_command=1.2), 3.0, initial=start)


def test_simulated_emissions_are_those_of_all_engines() -> None:
    samples, plant = run(EMITTING), EMITTING.record()
    for row in samples[[0, -1]]:
        at = (7.38 * row["shaft_speed"], row["brake_torque"])
        assert row["nox"] == pytest.approx(2.0 * nox_rate(plant, *at), rel=1e-12)
        assert row["co2"] == pytest.approx(2.0 * 3.206 * fuel_rate(plant, *at), rel=1e-12)
    assert samples["nox"].min() > 1.0
    assert samples["co2"].min() > 0.1


def test_without_the_section_nothing_changes_and_no_column_appears() -> None:
    frigate = load_ship("frigate")
    plain, emitting = run(frigate), run(EMITTING)
    for name in plain.dtype.names or ():
        same = plain[name].tobytes() == emitting[name].tobytes()
        assert same == (name not in ("nox", "co2")), name
    assert not plain["nox"].any()
    assert not plain["co2"].any()
    assert not {"nox_g_s", "co2_kg_s"} & set(signal_columns(frigate))
    own = signal_columns(EMITTING)
    assert (own["nox_g_s"], own["co2_kg_s"]) == ("nox", "co2")
    only = signal_columns(frigate.with_values({"emissions.co2_factor": 3.114}))
    assert "co2_kg_s" in only
    assert "nox_g_s" not in only


def test_a_recording_is_simulated_with_its_emissions() -> None:
    samples = run(EMITTING)
    table = {column: samples[name] for column, name in signal_columns(EMITTING).items()}
    commands = {c: table[c] for c in ("time_s", "fuel_rack_mm", "pitch_ratio_command")}
    found = simulate_recording(EMITTING, pd.DataFrame(commands), every_signal=True)
    assert found["nox_g_s"].iloc[-1] > 1.0
    assert found["co2_kg_s"].iloc[-1] > 0.1


def test_a_ship_file_keeps_the_section(tmp_path: Path) -> None:
    again = load_ship(str(write_ship(EMITTING, tmp_path / "ship.toml")))
    assert again.emissions == EMITTING.emissions
    assert again.parameter("emissions.nox_m1_s0").value == 0.5


def test_emissions_that_have_no_effect_are_refused() -> None:
    tree = load_ship("frigate").model_dump(exclude_unset=True)
    tree["emissions"] = {"nox_base_g_kWh": 9.0}
    del tree["prime_mover"]["fuel_base_g_kWh"], tree["prime_mover"]["fuel_rated_power_W"]
    with pytest.raises(
        ValueError, match=r"prime_mover.fuel_rated_power_W is missing.*nox_base_g_kWh"
    ):
        Ship.model_validate(tree)
    tree["emissions"] = {"co2_factor": 3.206}
    with pytest.raises(ValueError, match=r"emissions: co2_factor = 3.206 .*fuel_base_g_kWh"):
        Ship.model_validate(tree)
    with pytest.raises(ShipError, match="emissions: the section needs a diesel; remove it"):
        load_ship("rov-thruster").with_values({"emissions.nox_base_g_kWh": 9.0})
    with pytest.raises(ShipError, match="nox_base_g_kWh"):
        load_ship("frigate").with_values({"emissions.nox_base_g_kWh": -1.0})
    with pytest.raises(ShipError, match=r"emissions.nox_m1_s0 has no effect: .* has no diesel"):
        load_ship("rov-thruster").parameter("emissions.nox_m1_s0")
