"""Diagnoses of recordings whose rows are slower than the ship."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Options, diagnose, identify
from shaftline.plant import load_ship

from .service_logs import DAY_S, service_log

FOULING = {"hull.fouling_fraction": 0.12}
GAIN = {"sensors.torque_gain": 1.04}
TRANSIENT = {
    "engine-torque-lag",
    "engine-dead-time",
    "rack-rate-limit",
    "entrained-water-inertia",
    "inflow-lag",
    "pitch-dead-band",
    "pitch-backlash",
    "pitch-rate-limit",
    "torque-sensor-delay",
    "torque-sensor-lag",
    "speed-sensor-delay",
    "speed-log-lag",
}


@pytest.mark.parametrize(
    ("name", "concealed", "log", "effect", "size", "within"),
    [
        ("frigate", FOULING, {}, "hull-fouling", 0.12, 0.02),
        ("ferry", GAIN, {}, "torque-sensor-gain", 1.04, 0.008),
        (
            "ferry",
            FOULING,
            {"rows": 60, "interval_s": DAY_S, "over": 5},
            "hull-fouling",
            0.12,
            0.025,
        ),
        ("frigate", GAIN, {"interval_s": 600.0}, "torque-sensor-gain", 1.04, 0.008),
    ],
)
def test_a_concealed_effect_is_named_with_its_size(
    name: str, concealed: Any, log: Any, effect: str, size: float, within: float
) -> None:
    ship = load_ship(name)
    found = diagnose(ship, service_log(name, concealed, **log).drop(columns="shaft_power_W"))
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert finding.effect.id == effect
    (estimate,) = finding.estimates
    assert estimate.value == pytest.approx(size, abs=within)
    assert estimate.ci95[0] < size < estimate.ci95[1]
    assert any("each row is treated as an equilibrium" in said for said in found.warnings)
    tried = {candidate.effect.id for candidate, _ in found.ranking}
    assert not tried & TRANSIENT
    # the corrected ship is the file's, the effect apart
    (key,) = concealed
    assert found.corrected.parameter(key).value == pytest.approx(size, abs=within)
    assert found.corrected.with_values({key: ship.parameter(key).value}) == ship


@pytest.mark.parametrize(
    ("name", "log"),
    [
        ("frigate", {}),
        ("ferry", {"rows": 60, "interval_s": DAY_S, "over": 5}),
        ("ferry", {"over": 1}),
    ],
)
def test_nothing_is_missing_where_nothing_was_concealed(name: str, log: Any) -> None:
    found = diagnose(load_ship(name), service_log(name, seed=1, **log))
    assert found.verdict == "nothing-missing"
    assert not found.undecidable


def test_a_log_without_the_fuel_rack_is_judged_behind_the_prime_mover(tmp_path: Path) -> None:
    log = service_log("frigate", FOULING)
    log = log.drop(columns=["fuel_rack_mm", "pitch_ratio", "shaft_torque_N_m"])
    log.loc[300:330, ["shaft_speed_rad_s", "ship_speed_m_s", "shaft_power_W"]] = 0.0  # in harbour
    log.loc[700, "shaft_power_W"] *= 3.0
    log = log.drop(index=range(900, 960))  # a weekend
    log["Time"] = (pd.Timestamp("2024-05-03") + pd.to_timedelta(log.pop("time_s"), "s")).astype(str)
    log["RPM"] = log.pop("shaft_speed_rad_s") * 30.0 / np.pi
    log["kW"] = log.pop("shaft_power_W") / 1e3
    log.to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "map.toml").write_text(
        '[columns]\n"Time" = { column = "time_s", unit = "datetime" }\n'
        '"RPM" = { column = "shaft_speed_rad_s", unit = "rpm" }\n'
        '"kW" = { column = "shaft_power_W", unit = "kW" }\n'
    )
    ship = load_ship("frigate")
    found = diagnose(ship, tmp_path / "log.csv", options=Options(columns=tmp_path / "map.toml"))
    assert [finding.effect.id for finding in found.findings] == ["hull-fouling"]
    assert found.findings[0].estimates[0].value == pytest.approx(0.12, abs=0.02)
    assert [name for name, _ in found.balances] == ["propeller", "hull"]
    assert found.corrected.prime_mover == ship.prime_mover
    assert len(found.time_s) * found.rows_averaged == pytest.approx(1500 - 31 - 60 - 1, abs=4)
    found.save(tmp_path / "out")
    assert "days" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_power_meters_gain_is_named_without_a_torque() -> None:
    log = service_log("ferry", GAIN).drop(columns="shaft_torque_N_m")
    found = diagnose(load_ship("ferry"), log)
    assert [finding.effect.id for finding in found.findings] == ["torque-sensor-gain"]
    assert found.findings[0].estimates[0].value == pytest.approx(1.04, abs=0.008)


def test_parameters_are_identified_and_those_of_transients_refused() -> None:
    key, ship = "hull.resistance_coefficient_N_s2_m2", load_ship("ferry")
    log = service_log("ferry", {key: 1.05 * 203.5}, rows=400).drop(columns="shaft_power_W")
    for method in ("output-error", "steady"):
        (estimate,) = identify(ship, log, free=[key], method=method).estimates
        assert estimate.value == pytest.approx(1.05 * 203.5, rel=0.01)
    with pytest.raises(ValueError, match=r"hull\.mass_kg acts in transients only"):
        diagnose(ship, log, options=Options(free=("hull.mass_kg",)))
    with pytest.raises(ValueError, match="welch needs the ship's response in time"):
        identify(ship, log, free=[key], method="welch")
