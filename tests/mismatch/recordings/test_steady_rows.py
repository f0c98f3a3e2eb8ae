from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch import diagnose, load_recording
from shaftline.mismatch.recordings.steady_rows import rows_are_steady, surge_time_constant
from shaftline.plant import load_ship
from shaftline.plant.recording import RecordingError

from ..service_logs import service_log
from ..voyages import frigate_voyage


def test_rows_are_equilibria_from_two_surge_time_constants_on() -> None:
    ship, log = load_ship("frigate"), service_log("frigate", rows=60)
    surge = surge_time_constant(ship, log)
    speed = float(log["ship_speed_m_s"].median())
    assert surge == pytest.approx(3.3e6 / (2.0 * 3306.2 * speed), rel=1e-4)
    for seconds, steady in ((1.9, False), (2.1, True)):
        time = seconds * surge * np.arange(60.0)
        assert rows_are_steady(ship, log, time) is steady
        assert rows_are_steady(ship, log, time, asked=True)


def test_faster_rows_are_equilibria_on_request_only() -> None:
    ship, log = load_ship("frigate"), service_log("frigate", rows=60, interval_s=60.0)
    with pytest.raises(RecordingError, match=r"steps by 60 s .* use --steady"):
        load_recording(log, ship)
    recording = load_recording(log, ship, steady=True)
    assert recording.steady
    assert "as requested" in recording.warnings[0]


def test_rows_without_an_equilibrium_of_their_own_are_left_out() -> None:
    log = service_log("frigate", rows=80)
    log.loc[10:14, ["shaft_speed_rad_s", "ship_speed_m_s"]] = 0.0
    log.loc[20, "ship_speed_m_s"] = np.nan
    log.loc[30, "time_s"] = log.loc[29, "time_s"]
    log.loc[50:, "time_s"] += 60.0 * 3600.0
    kept = log.drop(index=[*range(10, 15), 20, 30])
    recording = load_recording(log, load_ship("frigate"))
    np.testing.assert_array_equal(recording["fuel_rack_mm"], kept["fuel_rack_mm"])
    np.testing.assert_allclose(recording.time_s, 3600.0 * np.arange(73.0))
    assert recording.interval_s == 3600.0
    said = "\n".join(recording.warnings)
    for words in (
        "5 of 78 rows were left out, first row 11",
        "a value is missing",
        "the time repeats another row's",
        "times in the report count rows",
    ):
        assert words in said


def test_noise_is_not_what_the_orders_move_from_row_to_row() -> None:
    log = service_log("ferry", {"hull.fouling_fraction": 0.12}, rows=400, over=1)
    noise = load_recording(log, load_ship("ferry")).noise["ship_speed_m_s"].white_rms
    rms = float(np.sqrt(np.mean(log["ship_speed_m_s"] ** 2)))
    assert log["ship_speed_m_s"].std() > 5.0 * 0.01 * rms
    assert noise == pytest.approx(0.01 * rms, rel=0.15)


def test_equilibria_and_motion_are_not_fitted_together() -> None:
    with pytest.raises(RecordingError, match="has rows that are equilibria"):
        diagnose(
            load_ship("frigate"), service_log("frigate", rows=60), frigate_voyage(seconds=60.0)
        )
