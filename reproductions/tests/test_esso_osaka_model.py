"""The real tanker model: its recordings, where they are, and how they are read everywhere."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions import nomoto
from reproductions.esso_osaka_model import page, turning
from reproductions.esso_osaka_model.runs import (
    HELD_OUT,
    Found,
    Recordings,
    canonical,
    surge_ship,
)
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

FOLDER = Path(os.environ.get("SHAFTLINE_DATA", "nowhere")) / "recordings" / "esso_osaka"
needs_recordings = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="needs recordings/esso_osaka under SHAFTLINE_DATA"
)

TERMS = [
    {
        "id": "turning",
        "acts_on": "resistance",
        "expression": "-k * sway_speed * yaw_rate",
        "parameters": {"k": 390.0},
    },
    {
        "id": "wind",
        "acts_on": "resistance",
        "expression": "k * head_wind * abs(head_wind)",
        "parameters": {"k": 0.084},
    },
]
SIGNALS = {"sway_speed": "m/s", "yaw_rate": "rad/s", "head_wind": "m/s"}


def with_what_is_named() -> Ship:
    """The ship with the three effects of docs/results/esso-osaka-model.md."""
    return (
        surge_ship()
        .with_signals(SIGNALS)
        .with_values({"propeller.astern_load_fraction": 0.602, "term": TERMS})
    )


def test_a_recording_is_read_in_the_tools_own_units_and_signs() -> None:
    raw = pd.DataFrame(
        {
            "t [s]": [1894.0, 1894.1],
            "u_velo [m/s]": [0.1, 0.2],
            "vm_velo [m/s]": [-0.01, 0.0],
            "psi_hat [rad]": [3.1, -3.1],
            "r_angvelo [rad/s]": [0.02, 0.03],
            "n_prop [rps]": [10.0, -10.0],
            "delta_rudder [rad]": [0.1, 0.2],
            "wind_velo_relative_mid [m/s]": [4.0, 4.0],
            "wind_dir_relative_mid [rad]": [0.0, math.pi],
        }
    )
    found = canonical(raw)
    np.testing.assert_allclose(found["time_s"], [0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(found["shaft_speed_rad_s"], [20.0 * math.pi, -20.0 * math.pi])
    np.testing.assert_allclose(found["head_wind"], [4.0, -4.0])  # from ahead, from astern
    assert np.diff(found["heading_rad"]) == pytest.approx(2.0 * math.pi - 6.2)  # counted on


def test_a_folder_without_the_runs_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=HELD_OUT[0]):
        Recordings(tmp_path)


def test_the_table_tells_what_was_held_out() -> None:
    errors = {"one": 0.03, "two": 0.04, HELD_OUT[0]: 0.1, HELD_OUT[1]: 0.2}
    table = page.table_of({"before": Found(surge_ship(), errors)}).set_index("run")
    assert list(table["held out"]) == ["", "", "yes", "yes", "", ""]
    assert table.loc["seven fitted", "before"] == pytest.approx(math.sqrt(0.00125))
    assert table.loc["two held out", "before"] == pytest.approx(math.sqrt(0.025))


@needs_recordings
def test_what_is_named_carries_on_the_runs_held_out() -> None:
    """0.145 m/s before, 0.033 after; without any one of the three it is worse."""
    named = with_what_is_named()
    with Recordings(FOLDER) as runs:
        assert runs.evaluate(surge_ship()).over(HELD_OUT) == pytest.approx(0.1447, rel=0.02)
        whole = runs.evaluate(named).over(HELD_OUT)
        assert whole == pytest.approx(0.0327, rel=0.03)
        for less in (
            {"propeller.astern_load_fraction": 1.0},
            {"term.turning.k": 0.0},
            {"term.wind.k": 0.0},
        ):
            assert runs.evaluate(named.with_values(less)).over(HELD_OUT) > 1.2 * whole


def test_the_wind_across_blows_to_starboard_where_it_comes_from_port() -> None:
    raw = pd.DataFrame(
        {
            "t [s]": [0.0, 0.1],
            "u_velo [m/s]": 0.1,
            "vm_velo [m/s]": 0.0,
            "psi_hat [rad]": 0.0,
            "r_angvelo [rad/s]": 0.0,
            "n_prop [rps]": 10.0,
            "delta_rudder [rad]": 0.0,
            "wind_velo_relative_mid [m/s]": 4.0,
            "wind_dir_relative_mid [rad]": [0.5 * math.pi, 1.5 * math.pi],
        }
    )
    np.testing.assert_allclose(canonical(raw, across=True)["side_wind"], [-4.0, 4.0])
    assert "side_wind" not in canonical(raw)


def test_surge_at_the_measured_sway_is_the_ship_s_own_where_she_made_the_recording() -> None:
    """Heun's rule over 0.4 s beside the plant's own steps; another drift gives another speed."""
    ship = turning.turning_ship()
    time = np.arange(0.0, 200.0, 0.4)
    given = pd.DataFrame(
        {
            "time_s": time,
            "shaft_speed_rad_s": 63.0,
            "rudder_rad": 0.4 * np.sin(time / 15.0),
            "ship_speed_m_s": 0.3,
            "sway_speed_m_s": 0.0,
            "yaw_rate_rad_s": 0.0,
            "heading_rad": 0.0,
        }
    )
    sailed = given.assign(**simulate_recording(ship, given)[[*nomoto.CHANNELS]])
    speed = sailed["ship_speed_m_s"].to_numpy()
    np.testing.assert_allclose(turning.surge_at_measured(ship, sailed), speed, atol=2e-4)
    own = turning.errors_of(ship, {"run": sailed}).loc["run"]
    assert own["ship_speed_m_s"] < 1e-9
    assert own[turning.SURGE] < 1e-4
    more = sailed.assign(sway_speed_m_s=2.0 * sailed["sway_speed_m_s"])
    assert np.abs(turning.surge_at_measured(ship, more) - speed).max() > 0.01


@needs_recordings
def test_captive_tests_alone_turn_her_as_nomoto_does_that_was_fitted() -> None:
    """0.0111 rad/s on the runs held out, nothing fitted; Nomoto's is 0.0129."""
    ship = turning.turning_ship()
    with Recordings(FOLDER, across=True) as runs:
        tables = runs.tables(ship)
        own = nomoto.mean_errors(turning.errors_of(ship, tables), HELD_OUT)
        response = nomoto.fit_response([tables[name] for name in runs.fitted], 3.0)
        other = nomoto.mean_errors(nomoto.response_errors(response, tables, 3.0), HELD_OUT)
    assert own["yaw_rate_rad_s"] == pytest.approx(0.0111, abs=3e-4)
    assert other["yaw_rate_rad_s"] == pytest.approx(0.0129, abs=3e-4)
    assert own["sway_speed_m_s"] == pytest.approx(0.0413, abs=1e-3)
