"""Unit errors of a channel, and the ranges of the commands of a ship."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.unit_errors import _possible, top_speed
from shaftline.plant import RecordingError, load_ship

from .conftest import Load


def test_demand_beyond_the_stop_is_refused(load: Load, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"fuel_rack_mm, row 1: 190 mm .* takes 0 to 40 mm"):
        load(calm.assign(fuel_rack_mm=190.0))


def test_no_shaft_turns_three_times_as_fast_as_it_can() -> None:
    frigate, rov = load_ship("frigate"), load_ship("rov-thruster")
    rated = frigate.diesel.speed_max_rpm * math.pi / 30.0 / frigate.transmission.gear_ratio
    assert top_speed(frigate) == pytest.approx(3.0 * rated)
    volt, constant = (
        rov.parameter(f"prime_mover.{key}").value
        for key in ("voltage_max_V", "motor_constant_V_s_rad")
    )
    assert top_speed(rov) == pytest.approx(3.0 * volt / constant / rov.transmission.gear_ratio)


def test_a_demand_is_possible_inside_its_stops_and_where_it_reaches_far_enough() -> None:
    assert _possible(np.full(50, 1.0), 0.0, 40.0)
    assert not _possible(np.full(50, 1.0), 0.0, 40.0, 0.1)
    assert _possible(np.full(50, 4.0), 0.0, 40.0, 0.1)
    assert not _possible(np.full(50, 41.0), 0.0, 40.0)
    assert not _possible(np.full(50, -1.0), 0.0, 40.0)
