"""The cause of a speed loss, from a log whose second part conceals a change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import load_recording
from shaftline.performance import (
    PerformanceReport,
    ReferenceShip,
    TableError,
    analyse_performance,
    canonical_log,
    explain_periods,
)
from shaftline.performance.monitoring import DAY_S
from shaftline.performance.physical_cause import rows_of
from shaftline.plant import load_ship
from shaftline.plant.surroundings import KNOT

from ..mismatch.service_logs import HOUR_S, fouled_log, service_log

ROWS = 480
REFERENCE = ReferenceShip(
    name="ferry", beam_m=25, draught_m=6, speed_kn=(2, 8, 16), power_kW=(0.375, 24.0, 192.0)
)


def report_of(log: pd.DataFrame) -> PerformanceReport:
    power = 2e-3 * log["shaft_torque_N_m"] * log["shaft_speed_rad_s"]
    columns = {
        "time_d": log["time_s"] / DAY_S,
        "stw_kn": log["ship_speed_m_s"] / KNOT,
        "power_kW": power,
    }
    return analyse_performance(REFERENCE, canonical_log(pd.DataFrame(columns)))


def test_a_concealed_fouling_is_named_with_its_size() -> None:
    ship, log = load_ship("ferry"), fouled_log()
    assert ship.hull.resistance_coefficient_N_s2_m2 == 203.5
    report = report_of(log)
    assert len(report.periods) == 2
    (cause,) = explain_periods(report, load_recording(log, ship), ship)
    assert cause.period == 1
    assert cause.headline == "Explained by hull fouling."
    assert cause.diagnosis is not None
    (finding,) = cause.diagnosis.findings
    low, high = finding.estimates[0].ci95
    assert low < 0.12 < high < 0.2


def test_rows_outside_the_reference_conditions_are_left_out() -> None:
    log = fouled_log()
    recording = load_recording(log, load_ship("ferry"))
    report = report_of(log)
    whole = rows_of(report.periods[0], report, recording)
    kept = report.rows.drop(index=[10, 11, 50])
    fewer = rows_of(report.periods[0], replace(report, rows=kept), recording)
    assert len(whole) == ROWS
    assert len(fewer) == ROWS - 3
    assert fewer["ship_speed_m_s"].tolist() == whole["ship_speed_m_s"].drop([10, 11, 50]).tolist()
    assert np.allclose(np.diff(fewer["time_s"]), HOUR_S)


def test_a_log_without_an_event_has_nothing_to_compare_with() -> None:
    log = service_log("ferry", rows=ROWS, seed=3)
    ship = load_ship("ferry")
    with pytest.raises(TableError, match=r"one period without an event.*--calibrate LOG"):
        next(explain_periods(report_of(log), load_recording(log, ship), ship))
