"""Both ships at service speed: power, fuel and speed against states that are solved one by one."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import Diagnosis, Estimate
from shaftline.mismatch.identification.parameters import ParameterChange
from shaftline.mismatch.judge.verdict import Detectable, Finding
from shaftline.mismatch.report.service import (
    ENGINE_POWER,
    EQUAL_COMMAND,
    EQUAL_POWER,
    FUEL,
    SHAFT_POWER,
    SHAFT_SPEED,
    SHAFT_TORQUE,
    Quantity,
    changed_numbers,
    interval_ships,
    most_frequent_speed,
    service_of,
    steady_curve,
)
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.plant import Ship, approach, equilibrium, load_ship
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.surroundings import KNOT

from ..diagnoses import ROWS, channels, diagnosis_of, entry

FOULING, PITCH, SPEED = 0.09, 1.2, 8.0


def finding(label: str, key: str, ship: Ship, value: float, error: float) -> Finding:
    estimate = Estimate.of(ship, key, value, error)
    return Finding(entry(label), (estimate,), 200.0, 20.0, (), np.ones(ROWS), 0, [(0.0, 240.0)], "")


def sea_trial(key: str, label: str, value: float, error: float, **changes: Any) -> Diagnosis:
    """A diagnosis whose ship spends most of the time at 8 m/s with a pitch ratio of 1.2."""
    ship = load_ship("frigate")
    speed = np.linspace(0.0, 9.0, ROWS)
    speed[300:900] = SPEED
    pitch = np.where((np.arange(ROWS) >= 300) & (np.arange(ROWS) < 900), PITCH, 0.8)
    fields: dict[str, Any] = {
        "findings": [finding(label, key, ship, value, error)],
        "corrected": ship.with_values({key: value}),
        **{n: channels(0.0) | {"ship_speed_m_s": speed} for n in ("measured", "before", "after")},
        "inputs": {"pitch_ratio_command": pitch},
    }
    fields |= changes
    return diagnosis_of(fields.pop("verdict", "explained"), **fields)


def fouled(**changes: Any) -> Diagnosis:
    return sea_trial("hull.fouling_fraction", "hull-fouling (hull)", FOULING, 0.005, **changes)


def engine_power(ship: Ship, speed: float) -> float:
    """Power of both engines [kW] at a speed [m/s]."""
    point = approach(ship, speed, PITCH)
    turns = float(ship.record()["gear_ratio"]) * point.state.shaft_speed
    return 2e-3 * float(point.outputs.brake_torque) * turns  # type: ignore[no-any-return]


def test_fouling_costs_what_the_steady_states_say(frigate: Ship) -> None:
    diagnosis = fouled()
    service = service_of(diagnosis)
    assert service.speed_m_s == SPEED
    assert service.condition == (
        "Steady in calm water at 15.6 kn (8.00 m/s), the most frequent speed of the recording, with "
        "pitch ratio 1.20."
    )
    found, foul = service.quantities, diagnosis.corrected
    power = found[ENGINE_POWER]
    assert power.before == pytest.approx(engine_power(frigate, SPEED), rel=1e-6)
    assert power.after == pytest.approx(engine_power(foul, SPEED), rel=1e-6)
    assert 0.08 < power.change / power.before < 0.10  # about the share of the resistance
    assert found[SHAFT_POWER].before == pytest.approx(0.95 * power.before, rel=1e-6)
    point = approach(foul, SPEED, PITCH)
    turns = 7.38 * point.state.shaft_speed
    flow = 2.0 * fuel_rate(foul.record(), turns, point.outputs.brake_torque)
    assert found[FUEL].after == pytest.approx(86.4 * flow, rel=1e-5)
    assert found[FUEL].unit == "t/d"
    assert found[SHAFT_SPEED].after == pytest.approx(
        point.state.shaft_speed * 30.0 / math.pi, rel=1e-6
    )
    assert found["fuel_rack_mm"].after == pytest.approx(point.inputs.drive, rel=1e-5)


def test_speed_loss_is_at_equal_power_and_at_equal_command(frigate: Ship) -> None:
    diagnosis = fouled()
    found = service_of(diagnosis).quantities
    slower = found[EQUAL_POWER]
    assert slower.before == pytest.approx(SPEED / KNOT)
    assert slower.after < slower.before
    assert engine_power(diagnosis.corrected, slower.after * KNOT) == pytest.approx(
        found[ENGINE_POWER].before, rel=1e-6
    )
    rack = found["fuel_rack_mm"].before
    same = equilibrium(diagnosis.corrected, rack, PITCH).state.ship_speed
    assert found[EQUAL_COMMAND].after * KNOT == pytest.approx(same, rel=1e-5)


def test_the_interval_of_one_parameter_ends_at_the_ships_with_its_ends(frigate: Ship) -> None:
    diagnosis = fouled()
    ends = diagnosis.findings[0].estimates[0].ci95
    power = service_of(diagnosis).quantities[ENGINE_POWER]
    assert power.ci95 == pytest.approx(
        [
            engine_power(frigate.with_values({"hull.fouling_fraction": end}), SPEED) - power.before
            for end in ends
        ],
        rel=1e-6,
    )


def test_intervals_of_several_parameters_add_in_quadrature(frigate: Ship) -> None:
    one = fouled()
    key, value = "propeller.roughness_drag", 0.002
    rough = finding("propeller-roughness (propeller)", key, frigate, value, 2e-4)
    both = replace(
        one, findings=[*one.findings, rough], corrected=one.corrected.with_values({key: value})
    )
    alone = [replace(both, findings=[f], parameters=[]) for f in both.findings]
    widths = []
    for only in alone:
        # The other effect counts as given: it is part of both ships.
        given = only.corrected.with_values({only.findings[0].estimates[0].key: 0.0})
        interval = service_of(replace(only, ship=given)).quantities[ENGINE_POWER].ci95
        assert interval is not None
        widths.append(interval[1] - interval[0])
    interval = service_of(both).quantities[ENGINE_POWER].ci95
    assert interval is not None
    assert interval[1] - interval[0] == pytest.approx(math.hypot(*widths), rel=0.02)


def test_an_instrument_changes_no_power() -> None:
    service = service_of(
        sea_trial("sensors.torque_gain", "torque-sensor-gain (sensor)", 1.05, 0.005)
    )
    assert not service.changes
    assert service.quantities[ENGINE_POWER].change == pytest.approx(0.0, abs=1e-6)


def test_a_derated_engine_needs_more_rack_and_no_more_power() -> None:
    found = service_of(
        sea_trial("prime_mover.derating_fraction", "engine-derating (engine)", 0.08, 0.005)
    )
    assert found.sure(ENGINE_POWER) is None
    rack = found.quantities["fuel_rack_mm"]
    ship = load_ship("frigate").prime_mover
    # The map is linear in the rack: (1 - d) (a n + b X + c) stays.
    point = approach(load_ship("frigate"), SPEED, PITCH)
    torque = float(point.outputs.brake_torque)
    assert rack.change == pytest.approx(
        (torque / 0.92 - torque) / ship.torque_per_rack_N_m_mm,  # type: ignore[union-attr]
        rel=1e-3,
    )
    assert found.quantities[EQUAL_COMMAND].change < 0.0


def test_a_parameter_inside_its_tolerance_widens_the_interval_to_no_change(frigate: Ship) -> None:
    key = "propeller.relative_rotative_efficiency"
    both = frigate.with_values({"hull.fouling_fraction": FOULING, key: 1.01})
    plain, moved = fouled(), fouled(corrected=both)
    assert changed_numbers(frigate, both)[key] == (1.0, 1.01)
    narrow, wide = (
        q.ci95 for q in (service_of(d).quantities[ENGINE_POWER] for d in (plain, moved))
    )
    assert narrow is not None
    assert wide is not None
    assert wide[1] - wide[0] > 1.2 * (narrow[1] - narrow[0])
    known = ParameterChange(key, "-", 1.0, 1.01, 0.0, 1.0, "tolerance", 1.01)
    exact = service_of(replace(moved, parameters=[known])).quantities[ENGINE_POWER].ci95
    assert exact is not None
    assert exact[1] - exact[0] == pytest.approx(narrow[1] - narrow[0], rel=0.02)


def test_without_a_measured_size_there_is_no_interval() -> None:
    diagnosis = fouled()
    vague = [replace(diagnosis.findings[0], unmeasured="no speed log")]
    service = service_of(replace(diagnosis, findings=vague))
    assert service.quantities[ENGINE_POWER].ci95 is None
    assert service.note == "no intervals: the size of hull-fouling is not measured"
    assert service.band is None
    shape = service_of(diagnosis_of("unexplained"))
    assert shape.note == "no intervals: the shape of the residual has none"


def test_no_numbers_where_nothing_is_decided_or_corrected() -> None:
    assert "does not decide" in service_of(fouled(), undecided=True).note
    same = fouled(corrected=load_ship("frigate"))
    assert service_of(same).quantities == {}
    assert "corrected ship is the nominal ship" in service_of(same).note


def test_a_speed_that_a_ship_does_not_reach_is_named() -> None:
    fast = np.full(ROWS, 14.0)
    service = service_of(fouled(measured={"ship_speed_m_s": fast}))
    assert service.quantities == {}
    assert service.note.startswith("the uncorrected ship has steady speeds from ")
    assert "kn only, not 27.2 kn, the most frequent speed of the recording" in service.note


def test_without_a_speed_log_the_median_command_gives_the_speed(frigate: Ship) -> None:
    service = service_of(fouled(measured=channels(0.0), drive=np.full(ROWS, 20.0)))
    expected = equilibrium(frigate, 20.0, 0.8).state.ship_speed  # the median pitch command
    pitch = np.full(ROWS, 0.8)
    service = service_of(
        fouled(
            measured=channels(0.0), drive=np.full(ROWS, 20.0), inputs={"pitch_ratio_command": pitch}
        )
    )
    assert service.speed_m_s == pytest.approx(expected)
    assert "because no speed was recorded" in service.condition


def test_where_nothing_is_missing_the_smallest_visible_loss_is_computed(frigate: Ship) -> None:
    size = 0.02
    diagnosis = fouled(
        findings=[],
        corrected=frigate,
        detectable=[
            Detectable(SizedEffect(entry("hull-fouling (hull)"), (size,)), size, "-"),
            Detectable(SizedEffect(entry("torque-sensor-gain (sensor)"), (0.01,)), 0.01, "-"),
        ],
    )
    service = service_of(diagnosis)
    ((words, extra),) = service.hidden
    assert words == "hull fouling"
    other = frigate.with_values({"hull.fouling_fraction": size})
    expected = engine_power(other, SPEED) - engine_power(frigate, SPEED)
    assert extra == pytest.approx(expected, rel=1e-5)
    assert not service.changes


def test_a_rig_is_compared_at_its_median_command() -> None:
    rig, key = load_ship("rov-thruster"), "transmission.coulomb_friction_engine_side_N_m"
    slow = rig.with_values({key: 0.005})
    drive = np.full(ROWS, 2.0)
    drive[:300] = -3.0
    service = service_of(
        diagnosis_of(
            "explained",
            ship=rig,
            corrected=slow,
            drive=drive,
            measured={},
            findings=[finding("coulomb-friction (motor)", key, rig, 0.005, 0.0005)],
        )
    )
    assert service.speed_m_s is None
    assert service.curves is None
    before, after = (equilibrium(s, 2.0, 1.0) for s in (rig, slow))
    speed = service.quantities[SHAFT_SPEED]
    assert speed.before == pytest.approx(before.state.shaft_speed * 30.0 / math.pi)
    assert speed.after == pytest.approx(after.state.shaft_speed * 30.0 / math.pi)
    assert speed.is_sure
    assert service.quantities[SHAFT_TORQUE].after == pytest.approx(after.outputs.shaft_torque)
    still = service_of(
        diagnosis_of("nothing-missing", ship=rig, corrected=rig, drive=-drive.clip(0))
    )
    assert "never above 0" in still.note


def test_only_the_rows_under_way_count_for_the_speed() -> None:
    speed = np.r_[np.zeros(500), np.full(100, 7.0), np.full(60, 9.0)]
    found, rows = most_frequent_speed(speed)
    assert found == 7.0
    assert rows.sum() == 100


def test_a_second_branch_of_steady_states_is_left_out(frigate: Ship) -> None:
    curve = steady_curve(frigate.with_values({"hull.fouling_fraction": 0.133}), 0.951, (), 2.4, 5.3)
    assert (np.diff(curve.speed) > 0.0).all()
    assert (np.diff(curve.power) > 0.0).all()
    assert np.max(curve.speed[1:] / curve.speed[:-1]) < 1.0 / 0.7
    assert math.isnan(curve.at("power", 20.0))


def test_a_ship_that_needs_no_engine_has_a_curve_above_that_speed(frigate: Ship) -> None:
    tow = {"id": "tow", "acts_on": "resistance", "expression": "-150000.0"}
    curve = steady_curve(frigate.with_values({"term": [tow]}), 1.2, (), 3.0, 9.0)
    assert (curve.power > 0.0).all()
    assert 6.0 < curve.speed_at("power", 5e5) < 8.0


def test_a_change_is_sure_if_its_interval_excludes_no_change() -> None:
    power = Quantity("power", "kW", 100.0, 103.0, (-1.0, 7.0))
    assert power.differs
    assert not power.is_sure
    assert replace(power, ci95=(1.0, 5.0)).is_sure
    assert replace(power, ci95=(-5.0, -1.0)).is_sure
    assert replace(power, ci95=None).is_sure
    assert not replace(power, after=100.0, ci95=None).is_sure
    assert power.to_dict() == {"before": 100.0, "after": 103.0, "change": 3.0, "ci95": [-1.0, 7.0]}


def test_tied_keys_move_with_their_parameter(frigate: Ship) -> None:
    effect = entry("ventilation (propeller)")
    ((tied, key, factor),) = effect.ties
    corrected = frigate.with_values({key: 0.2, tied: factor * 0.2})
    air = finding(effect.label, key, corrected, 0.2, 0.02)
    ((low, high),) = interval_ships(fouled(findings=[air], corrected=corrected))
    for ship, end in zip((low, high), air.estimates[0].ci95, strict=True):
        assert ship.parameter(key).value == pytest.approx(end)
        assert ship.parameter(tied).value == pytest.approx(factor * end)
