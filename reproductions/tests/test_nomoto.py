"""Nomoto's first order, fitted to recordings."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from reproductions.nomoto import Response, fit_response, simulate_response

LENGTH = 7.0


def a_run(speed: float, rudder: float = 0.2) -> pd.DataFrame:
    time = np.arange(0.0, 120.0, 0.1)
    return pd.DataFrame(
        {
            "time_s": time,
            "ship_speed_m_s": speed,
            "rudder_rad": rudder,
            "yaw_rate_rad_s": 0.0,
            "heading_rad": 0.5,
            "sway_speed_m_s": 0.0,
        }
    )


def test_a_rudder_that_is_held_turns_her_as_the_equation_says() -> None:
    """r = K' (U / L) (delta - delta_0) (1 - exp(-t U / (T' L))): faster ships answer sooner."""
    response = Response(1.4, 1.2, 0.02, 0.4)
    for speed in (1.0, 0.5):
        found, time = simulate_response(response, a_run(speed), LENGTH), a_run(speed)["time_s"]
        steady, lag = 1.4 * speed / LENGTH * 0.18, 1.2 * LENGTH / speed
        rate = steady * (1.0 - np.exp(-time / lag))
        np.testing.assert_allclose(found["yaw_rate_rad_s"], rate, atol=1e-12)
        turned = steady * (time - lag * (1.0 - np.exp(-time / lag)))
        np.testing.assert_allclose(found["heading_rad"], 0.5 + turned, atol=1e-4)
        np.testing.assert_allclose(found["sway_speed_m_s"], -0.4 * LENGTH * rate, atol=1e-12)


def test_its_own_numbers_are_found_again() -> None:
    own = Response(1.3, 1.6, -0.01, 0.38)
    tables = []
    for speed in (1.1, 0.8):
        table = a_run(speed)
        table["rudder_rad"] = 0.3 * np.sign(np.sin(table["time_s"] / 9.0))
        tables.append(table.assign(**dict(simulate_response(own, table, LENGTH))))
    assert fit_response(tables, LENGTH) == pytest.approx(own, rel=1e-4)
