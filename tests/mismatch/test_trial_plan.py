"""Trials that decide between models: the evidence, the programme, what is refused."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import scipy

from shaftline.core.models import read_model
from shaftline.mismatch import Limits, Noise, plan_trial
from shaftline.mismatch.report.plan import pairs_in_words, read_models, save_plan
from shaftline.mismatch.trial_manoeuvres import PlanError, random_manoeuvre, table_of
from shaftline.mismatch.trial_plan import (
    DECIDED,
    Prediction,
    _whiten,
    evidence_of,
    own_effects,
    worst_of,
)
from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

WHITE = (Noise(0.5), Noise(2.0))
LOG = {"ship_speed_m_s": Noise(0.05)}
SPEED = "shaft_speed_rad_s"
FRICTION = {"transmission.coulomb_friction_engine_side_N_m": 0.01}


def prediction(seed: int, unknowns: int = 3, rows: int = 40) -> Prediction:
    rng = np.random.default_rng(seed)
    starts = np.arange(unknowns) == unknowns - 1
    return Prediction(
        rng.standard_normal((2, rows)), rng.standard_normal((unknowns, 2, rows)), starts
    )


def test_the_evidence_is_the_least_squares_that_a_rival_cannot_fit() -> None:
    """Another solver fits the rival's unknowns with their priors."""
    one, two = prediction(1), prediction(2)
    found = worst_of(evidence_of({"a": one, "b": two}, WHITE))[("a", "b")]
    least = []
    for true, rival in ((one, two), (two, one)):
        target = _whiten(true.own - rival.own, WHITE).ravel()
        slopes = _whiten(rival.slopes, WHITE).reshape(3, -1)
        fit = scipy.optimize.lsq_linear(
            np.vstack([slopes.T, np.eye(3)]), np.concatenate([target, np.zeros(3)])
        )
        least.append(2.0 * fit.cost)
    assert found == pytest.approx(min(least), rel=1e-9)


def test_a_first_state_is_fitted_in_each_manoeuvre_and_a_parameter_in_all() -> None:
    parts = [evidence_of({"a": prediction(k), "b": prediction(k + 9)}, WHITE) for k in (1, 2)]
    total = parts[0]["a", "b"].plus(parts[1]["a", "b"]).value()
    true, rival = zip(*((prediction(k), prediction(k + 9)) for k in (1, 2)), strict=True)
    target = np.concatenate(
        [_whiten(t.own - r.own, WHITE).ravel() for t, r in zip(true, rival, strict=True)]
    )
    shared = np.vstack([_whiten(r.slopes, WHITE).reshape(3, -1)[:2].T for r in rival])
    own = scipy.linalg.block_diag(*(_whiten(r.slopes, WHITE).reshape(3, -1)[2:].T for r in rival))
    matrix = np.vstack([np.hstack([shared, own]), np.eye(4)])
    fit = scipy.optimize.lsq_linear(matrix, np.concatenate([target, np.zeros(4)]))
    assert total == pytest.approx(2.0 * fit.cost, rel=1e-9)


def test_slow_noise_is_whitened() -> None:
    rng = np.random.default_rng(3)
    slow, keeps = np.zeros(20_000), np.exp(-1.0 / 15.0)
    for k in range(1, len(slow)):
        slow[k] = keeps * slow[k - 1] + np.sqrt(1.0 - keeps**2) * rng.standard_normal()
    white = _whiten(2.0 * slow[None], (Noise(2.0, 15.0),))[0]
    assert np.std(white) == pytest.approx(1.0, abs=0.02)
    assert np.mean(white[1:] * white[:-1]) == pytest.approx(0.0, abs=0.02)


@pytest.fixture(scope="module")
def models(frigate: Ship) -> dict[str, Ship]:
    quick = frigate.with_values({"integration.time_step_s": 0.25})
    return {
        "fouled": quick.with_values({"hull.fouling_fraction": 0.1}),
        "log": quick.with_values({"sensors.speed_log_gain": 0.96}),
    }


def test_a_model_may_fit_its_own_effects_and_not_those_of_its_rival(
    models: dict[str, Ship],
) -> None:
    found = own_effects(models)
    assert found["fouled"] == pytest.approx({"hull.fouling_fraction": 0.1})
    assert found["log"] == pytest.approx({"sensors.speed_log_gain": 0.04})


def test_a_programme_beats_random_ones_and_can_be_simulated(
    models: dict[str, Ship], tmp_path: Path
) -> None:
    limits = Limits(drive=(14.0, 26.0), pitch_ratio=(1.0, 1.35), ship_speed_m_s=(3.0, 10.0))
    noise = {**LOG, "shaft_speed_rad_s": Noise(0.02)}
    plan = plan_trial(models, noise, 15.0, limits, pool=6)
    (row,) = plan.pairs.to_dict("records")
    assert row["expected_2logL"] > row["random_2logL"] > 0.0
    assert plan.least == row["expected_2logL"]
    assert 0.0 < row["minutes"] <= 15.0
    assert row["minutes_with_shaft_torque_N_m"] <= row["minutes"]
    assert len(plan.table) == 900
    history = plan.history["fouled or log"]
    assert history.index.tolist() == [0.5 * k for k in range(1, 31)]
    assert history.iloc[-1] == pytest.approx(row["expected_2logL"])
    assert (history[history.index < row["minutes"] - 0.5] < DECIDED).all()
    assert plan.table["fuel_rack_mm"].between(14.0, 26.0).all()
    assert plan.table["pitch_ratio_command"].between(1.0, 1.35).all()
    for ship in models.values():
        speed = simulate_recording(ship, plan.table)["ship_speed_m_s"]
        assert speed.between(
            2.9, 10.5
        ).all()  # of whole programmes; each manoeuvre keeps the limits
    again = plan_trial(models, noise, 15.0, limits, pool=6)
    assert again.table.equals(plan.table)
    folder = save_plan(plan, tmp_path / "plan")
    assert json.loads((folder / "plan.json").read_text())["pairs"][0]["model"] == "fouled"
    assert (folder / "plan.png").stat().st_size > 10_000
    assert pairs_in_words(plan)[0].startswith("fouled or log: decided after")


def test_the_expected_evidence_is_what_simulated_recordings_show(models: dict[str, Ship]) -> None:
    """The truth is the fouled ship; the rival fits its gain and the resistance to the recording."""
    plan = plan_trial(
        models, LOG, 10.0, Limits(drive=(14.0, 26.0), pitch_ratio=(1.0, 1.35)), pool=4
    )
    true, rival = models["fouled"], models["log"]
    measured = simulate_recording(true, plan.table)["ship_speed_m_s"].to_numpy()
    tolerance = true.tolerances.resistance
    coefficient = rival.parameter("hull.resistance_coefficient_N_s2_m2").value

    def residuals(x: np.ndarray) -> np.ndarray:
        ship = rival.with_values(
            {
                "sensors.speed_log_gain": 0.96 + 0.04 * x[0],
                "hull.resistance_coefficient_N_s2_m2": coefficient * (1.0 + tolerance * x[1]),
            }
        )
        found = simulate_recording(ship, plan.table)["ship_speed_m_s"].to_numpy()
        return np.concatenate([(measured - found)[1:] / LOG["ship_speed_m_s"].sd, x])

    fit = scipy.optimize.least_squares(residuals, [0.1, 0.1], diff_step=[0.02, 0.02])
    # the plan lets the rival change further parameters, so it expects less
    assert plan.least < 1.1 * 2.0 * fit.cost


def test_every_kind_of_manoeuvre_stays_within_the_limits() -> None:
    ship = load_ship("frigate-turning")
    limits = Limits(drive=(12.0, 24.0), pitch_ratio=(0.9, 1.3), rudder_deg=12.0)
    rng = np.random.default_rng(0)
    kinds = set()
    for _ in range(200):
        made = random_manoeuvre(ship, limits, 240, rng)
        kinds.add(made.text)
        table = table_of(ship, [made])
        assert table["fuel_rack_mm"].between(12.0, 24.0).all()
        assert table["pitch_ratio_command"].between(0.9, 1.3).all()
        assert table["rudder_command_rad"].abs().max() <= np.radians(12.0) + 1e-12
        moves = np.flatnonzero(np.diff(table["pitch_ratio_command"]))
        assert all(b - a >= 20 for a, b in itertools.pairwise(moves))
    assert len(kinds) == 7


def test_what_cannot_be_planned_is_refused(models: dict[str, Ship], tmp_path: Path) -> None:
    one = {"fouled": models["fouled"]}
    rig = load_ship("tito-neri-sine")
    term = {"id": "wind", "acts_on": "resistance", "expression": "50.0 * head_wind"}
    windy = models["fouled"].with_values({"signals": {"head_wind": "m/s"}, "term": [term]})
    for given, noise, limits, words in (
        (one, LOG, Limits(), "at least two are needed"),
        ({**one, "same": models["fouled"]}, LOG, Limits(), "do not differ"),
        (models, {}, Limits(), "no measured channel"),
        (models, {"motor_current_A": Noise(1.0)}, Limits(), "motor_current_A: no channel that"),
        (models, {"ship_speed_m_s": Noise(0.0)}, Limits(), "ship_speed_m_s: noise 0"),
        (models, LOG, Limits(drive=(5.0, 500.0)), r"drive = .* leaves what frigate can do"),
        (models, LOG, Limits(rudder_deg=5.0), "frigate has no rudder"),
        (models, LOG, Limits(ship_speed_m_s=(30.0, 31.0)), "stays within the limits; widen"),
        ({**one, "windy": windy}, LOG, Limits(), "windy: uses head_wind from the recording"),
        ({**one, "rig": load_ship("towing-tank")}, LOG, Limits(), "rig: is not the same kind"),
        (
            {"a": rig, "b": rig.with_values(FRICTION)},
            {SPEED: Noise(1.0)},
            Limits(),
            "a: its time step",
        ),
    ):
        with pytest.raises(PlanError, match=words):
            plan_trial(given, noise, 5.0, limits, pool=1)
    with pytest.raises(PlanError, match="minutes = 0: must be 1 to 1440"):
        plan_trial(models, LOG, 0.0)
    file = tmp_path / "limits.toml"
    for text, words in (
        ("drive = [20, 10]", "the lower value must come first"),
        ("drive = 5", r"drive = 5: a list is required"),
        ("rudder = 5", r"rudder is not a known key; known keys of the file: drive"),
    ):
        file.write_text(text)
        with pytest.raises(PlanError, match=words):
            read_model(Limits, file, PlanError)


def test_a_report_without_alternatives_needs_no_trial(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    report.write_text('{"verdict": "explained", "alternatives": {}, "noise": {}}')
    with pytest.raises(PlanError, match=r"has no alternatives \(verdict explained\)"):
        read_models(report)
    report.write_text("no json")
    with pytest.raises(PlanError, match=r"is no report.json of `shaftline diagnose`"):
        read_models(report)
    report.write_text('{"verdict": "explained"}')
    with pytest.raises(PlanError, match="diagnose again"):
        read_models(report)


def test_the_limit_is_a_ratio_of_twenty() -> None:
    assert np.exp(DECIDED / 2.0) == pytest.approx(20.0, rel=0.01)
