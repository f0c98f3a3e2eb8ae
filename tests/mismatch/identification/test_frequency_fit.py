"""Numbers from frequency responses: of the model itself, and of the published measurement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from shaftline.mismatch.identification.drive_train import (
    CONSTANT,
    LOAD,
    RESISTANCE,
    SIX,
    drive_train,
)
from shaftline.mismatch.identification.free_parameters import parse_free
from shaftline.mismatch.identification.frequency import (
    FrequencyResponse,
    closed_form,
    fit,
    fit_response,
    modelled_response,
)
from shaftline.plant import Ship, load_ship

from .benches import shares_off, tug
from .test_frequency import about

DELAY = "sensors.speed_delay_s"


def exact(ship: Ship, error: float = np.nan, interval_s: float = 0.0) -> FrequencyResponse:
    """A ship's own response, with a known error or none."""
    empty = about(ship, interval_s)
    response = modelled_response(ship, empty)
    sizes = {column: np.full(len(values), error) for column, values in response.items()}
    return replace(empty, response=response, error=sizes)


@pytest.mark.parametrize("interval_s", [0.0, 2e-4])
@pytest.mark.parametrize("name", ["sine", "staircase"])
def test_a_ship_s_own_response_gives_its_numbers(name: str, interval_s: float) -> None:
    ship = tug(name)
    other = tug("staircase" if name == "sine" else "sine")
    start = other.with_values({"water.density_kg_m3": ship.water.density_kg_m3})
    found = fit(parse_free(start, None, SIX), exact(ship, interval_s=interval_s), "sine")
    values = parse_free(ship, SIX, ()).start
    assert_allclose(found.values, values, rtol=1e-5)
    assert found.misfit < 1e-5
    assert found.steps["cost"].iloc[-1] < found.steps["cost"].iloc[0]


def test_delay_is_found_beside_all_six() -> None:
    ship = tug().with_values({DELAY: 0.0016})
    found = fit(parse_free(tug("staircase"), (*SIX, DELAY), ()), exact(ship, 1e-3), "sine")
    assert found.values[-1] == pytest.approx(0.0016, rel=1e-3)


def test_standard_errors_are_those_of_repeated_noise() -> None:
    """Draws of known noise on every part of the response."""
    ship, rng, clean = tug(), np.random.default_rng(4), exact(tug(), 0.02)
    chosen = parse_free(ship, (CONSTANT, RESISTANCE, LOAD), ())
    values = []
    for _ in range(24):
        response = {
            c: v + 0.02 * (rng.standard_normal(len(v)) + 1j * rng.standard_normal(len(v)))
            for c, v in clean.response.items()
        }
        values.append(fit(chosen, replace(clean, response=response), "sine").values)
    stated = np.sqrt(np.diag(fit(chosen, clean, "sine").covariance))
    assert_allclose(np.std(values, axis=0), stated, rtol=0.3)


def test_where_no_error_is_known_what_is_left_tells_it() -> None:
    ship, rng, clean = tug(), np.random.default_rng(5), exact(tug())
    response = {c: v + 0.02 * rng.standard_normal(len(v)) for c, v in clean.response.items()}
    some = replace(clean, response=response)
    twice = {c: v + 2.0 * (response[c] - v) for c, v in clean.response.items()}
    chosen = parse_free(ship, (CONSTANT,), ())
    once = fit(chosen, some, "sine").covariance[0, 0]
    assert once > 0.0
    assert fit(chosen, replace(clean, response=twice), "sine").covariance[0, 0] > 2.0 * once


def test_closed_form_of_a_ship_s_own_response() -> None:
    """The armature is 280 times as fast as the shaft: approximate poles are good to 0.4 %."""
    closed = closed_form(
        tug("staircase").with_values({"water.density_kg_m3": 1000.0}), exact(tug())
    )
    assert closed is not None
    train, five = closed
    own = drive_train(tug())
    assert_allclose(list(vars(train).values())[:6], list(vars(own).values())[:6], rtol=0.01)
    assert five["s2"] == pytest.approx(-9.0, rel=0.01)


def test_closed_form_is_for_drive_trains_with_a_current() -> None:
    measured = exact(tug())
    speed_alone = replace(
        measured, response={"shaft_speed_rad_s": measured.response["shaft_speed_rad_s"]}
    )
    assert closed_form(tug(), speed_alone) is None
    assert closed_form(load_ship("frigate"), measured) is None


def test_found_tells_responses_search_and_closed_form() -> None:
    found = fit_response("sine", parse_free(tug(), None, SIX), exact(tug(), 1e-3))
    assert max(map(abs, shares_off(tug(), found).values())) < 1e-4
    table = found.tables["frequency-response"]
    assert_allclose(table["motor_current_gain_model"], table["motor_current_gain"], rtol=1e-4)
    assert {*found.tables} == {"frequency-response", "search", "closed-form"}
    assert found.remarks[0].startswith("5 frequencies from 0.3 to 3e+03 rad/s about 5.89 V")


def test_numbers_that_act_alike_are_refused() -> None:
    both = (LOAD, "transmission.quadratic_drag_N_m_s2_rad2")
    with pytest.raises(ValueError, match=r"sine: the recording does not distinguish .*"):
        fit(parse_free(tug(), both, ()), exact(tug(), 1e-3), "sine")
    with pytest.raises(
        ValueError, match=r"none of the compared values depends on hull\.wake_fraction"
    ):
        fit(parse_free(tug(), ("hull.wake_fraction",), ()), exact(tug(), 1e-3), "sine")
