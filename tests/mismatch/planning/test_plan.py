"""Trials that decide between models: the evidence, the programme, what is refused."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy

from shaftline.core.models import read_model
from shaftline.mismatch import Limits, Noise, plan_trial
from shaftline.mismatch.planning.evidence import (
    Predictions,
    Predictor,
    evidence_of,
    evidence_over_time,
    whiten,
)
from shaftline.mismatch.planning.manoeuvres import (
    PlanError,
    is_inside,
    random_manoeuvre,
    table_of,
)
from shaftline.mismatch.planning.plan import DECIDED, _minutes_until, _Search, own_effects
from shaftline.mismatch.report.plan import (
    intervals_in_words,
    pairs_in_words,
    read_question,
    save_plan,
)
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship, write_ship
from shaftline.plant.drives.diesel import torque_limit
from shaftline.plant.replay import simulate_recording

WHITE = (Noise(0.5), Noise(2.0))
LOG = {"ship_speed_m_s": Noise(0.05)}
SPEED = "shaft_speed_rad_s"
FRICTION = {"transmission.coulomb_friction_engine_side_N_m": 0.01}


def predictions(seed: int, models: int = 2, rows: int = 40) -> Predictions:
    """Return random predictions: two tolerances, one shift of the first state, one effect a model."""
    rng = np.random.default_rng(seed)
    return Predictions(
        own=rng.standard_normal((models, 2, rows)),
        shared=rng.standard_normal((3, 2, rows)),
        starts=np.array([False, False, True]),
        effects=rng.standard_normal((models, 2, rows)),
        owners=np.arange(models),
    )


def least_squares(parts: list[Predictions], true: int, rival: int) -> float:
    """Return lambda by another solver, which fits the rival's unknowns with their priors."""
    target = np.concatenate([whiten(p.own[true] - p.own[rival], WHITE).ravel() for p in parts])

    def columns(values: np.ndarray) -> np.ndarray:
        return np.asarray(whiten(values, WHITE).reshape(len(values), -1).T)

    kept = np.vstack([columns(np.vstack([p.shared[:2], p.effects[[rival]]])) for p in parts])
    own = scipy.linalg.block_diag(*(columns(p.shared[2:]) for p in parts))
    matrix = np.vstack([np.hstack([kept, own]), np.eye(3 + len(parts))])
    fit = scipy.optimize.lsq_linear(matrix, np.concatenate([target, np.zeros(3 + len(parts))]))
    return 2.0 * float(fit.cost)


def test_the_evidence_is_the_least_squares_that_a_rival_cannot_fit() -> None:
    given = predictions(1, models=3)
    against = evidence_of(given, WHITE).against()
    for true, rival in itertools.permutations(range(3), 2):
        assert against[true, rival] == pytest.approx(least_squares([given], true, rival), rel=1e-9)
    either = np.minimum(against, against.T)
    np.testing.assert_allclose(
        evidence_of(given, WHITE).pairs(), [either[0, 1], either[0, 2], either[1, 2]]
    )


def test_a_first_state_is_fitted_in_each_manoeuvre_and_a_parameter_in_all() -> None:
    parts = [predictions(1), predictions(2)]
    first, second = (evidence_of(one, WHITE) for one in parts)
    total = first.plus(second).against()
    assert total[0, 1] == pytest.approx(least_squares(parts, 0, 1), rel=1e-9)


def test_evidence_over_time_ends_with_that_of_the_whole() -> None:
    given = predictions(4)
    blocks = [*evidence_over_time(given, WHITE, 7)]
    assert len(blocks) == 6  # 39 whitened rows
    np.testing.assert_allclose(blocks[-1].products, evidence_of(given, WHITE).products)
    values = [one.pairs()[0] for one in blocks]
    assert values == sorted(values)


def test_the_covariance_is_that_of_a_linear_fit_with_priors() -> None:
    given = predictions(3, models=1)
    rows = np.vstack([given.shared, given.effects])
    columns = whiten(rows, WHITE).reshape(4, -1)
    expected = np.linalg.inv(columns @ columns.T + np.eye(4))[3, 3]
    evidence = evidence_of(given, WHITE)
    assert evidence.covariance()[0, 0] == pytest.approx(expected, rel=1e-9)
    assert evidence.merit() == pytest.approx(-np.log(expected), rel=1e-9)


def test_the_merit_is_a_bound_of_a_wrong_choice() -> None:
    evidence = evidence_of(predictions(5, models=3), WHITE)
    wrong = scipy.stats.norm.cdf(-0.5 * np.sqrt(evidence.pairs())).sum()
    assert evidence.merit() == pytest.approx(-np.log(wrong), rel=1e-9)


def test_slow_noise_is_whitened() -> None:
    rng = np.random.default_rng(3)
    slow, keeps = np.zeros(20_000), np.exp(-1.0 / 15.0)
    for k in range(1, len(slow)):
        slow[k] = keeps * slow[k - 1] + np.sqrt(1.0 - keeps**2) * rng.standard_normal()
    white = whiten(2.0 * slow[None], (Noise(2.0, 15.0),))[0]
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
    assert history.index[[0, -1]].tolist() == pytest.approx([1.0 / 6.0, 15.0])
    assert history.iloc[-1] == pytest.approx(row["expected_2logL"])
    assert (history[history.index >= row["minutes"]] >= DECIDED).all()
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


def test_an_exchange_of_commands_increases_the_evidence_and_holds_them_long_enough(
    frigate: Ship,
) -> None:
    """Changes of rack and pitch that no single manoeuvre has separate a derating from friction."""
    quick = frigate.with_values({"integration.time_step_s": 0.25})
    models = {
        "derated": quick.with_values({"prime_mover.derating_fraction": 0.02}),
        "dry": quick.with_values({"transmission.coulomb_friction_engine_side_N_m": 4000.0}),
    }
    noise = {**LOG, SPEED: Noise(0.03, 2.0), "shaft_torque_N_m": Noise(2500.0, 1.0)}
    limits = Limits(drive=(14.0, 30.0), pitch_ratio=(0.95, 1.35), shortest_hold_s=75.0)
    predictor = Predictor(models, own_effects(models), tuple(noise))
    search = _Search(quick, predictor, tuple(noise.values()), limits, 200)
    chosen = search.programme(3, 4, np.random.default_rng(2))
    better = search.exchange_commands(chosen, math.inf)
    before, after = (search.mean_merit(table_of(quick, one)) for one in (chosen, better))
    assert after > 1.2 * before
    assert {m.text for m in better} == {"held commands"}
    assert sum(len(m.drive) for m in better) == 600
    assert all(len(m.drive) >= 75 for m in better)
    fixed = replace(search, limits=limits.model_copy(update={"drive": (20.0, 20.0)}))
    flat = fixed.exchange_commands(fixed.programme(3, 4, np.random.default_rng(2)), math.inf)
    assert all((m.drive == 20.0).all() for m in flat)
    assert len({m.pitch[0] for m in flat}) > 1
    assert search.exchange_commands(chosen, 1.0) == chosen, "no programme stays in a room of 1 m"


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


def test_a_pair_counts_as_decided_once_it_stays_decided() -> None:
    minutes = [1.0, 2.0, 3.0, 4.0]
    for values, decided in (
        ([7.0, 5.9, 6.0, 9.0], 3.0),
        ([6.0, 6.0, 7.0, 8.0], 1.0),
        ([7.0, 8.0, 9.0, 5.0], math.nan),
    ):
        found = _minutes_until(pd.Series(values, index=minutes))
        assert found == pytest.approx(decided, nan_ok=True)


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
    assert len(kinds) == 8


def test_a_ship_turns_to_the_opposite_course_and_says_if_it_cannot() -> None:
    ship = load_ship("ddg-51-surrogate")
    rng = np.random.default_rng(1)
    turns: list[str] = []
    while len(turns) < 4:
        made = random_manoeuvre(ship, Limits(rudder_deg=20.0), 300, rng)
        if made.text not in ("reciprocal courses", "turn"):
            continue
        heading = simulate_recording(ship, table_of(ship, [made]))["heading_rad"].to_numpy()
        turned = abs(math.degrees(heading[-1] - heading[0]))
        straight = np.ptp(heading[:100])
        assert straight < 1e-6, "the first part runs on the first course"
        assert (abs(turned - 180.0) <= 20.5) == (made.text == "reciprocal courses")
        turns.append(made.text)
    assert "reciprocal courses" in turns


def test_reciprocal_courses_separate_a_current_from_fouling() -> None:
    clean = load_ship("ddg-51-surrogate")
    most = float(clean.record()["drive_max"])
    models = {
        "fouled": clean.with_values({"hull.fouling_fraction": 0.1}),
        "current": clean.with_values({"hull.current_m_s": -0.35}),
    }
    noise = {
        "ship_speed_m_s": Noise(0.05, 20.0),
        SPEED: Noise(0.02, 5.0),
        "heading_rad": Noise(0.005),
    }
    steady = Limits(drive=(0.6 * most, 0.62 * most), rudder_deg=25.0)
    plan = plan_trial(models, noise, 10.0, steady, pool=12)
    assert [*plan.steps["manoeuvre"]] == ["reciprocal courses"] * 2
    straight = plan_trial(
        models, noise, 10.0, steady.model_copy(update={"rudder_deg": 0.0}), pool=12
    )
    assert plan.least > 1.5 * straight.least


def test_what_cannot_be_planned_is_refused(models: dict[str, Ship], tmp_path: Path) -> None:
    one = {"fouled": models["fouled"]}
    rig = load_ship("tito-neri-sine")
    term = {"id": "wind", "acts_on": "resistance", "expression": "50.0 * head_wind"}
    windy = models["fouled"].with_values({"signals": {"head_wind": "m/s"}, "term": [term]})
    for given, noise, limits, words in (
        (one, LOG, Limits(), "1 model given and no uncertain parameter"),
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


def test_a_diesel_stays_within_its_envelope_and_speed(frigate: Ship) -> None:
    commands = {"time_s": np.arange(60.0), "fuel_rack_mm": 20.0, "pitch_ratio_command": 1.2}
    samples = JointReplay(frigate, pd.DataFrame(commands)).simulate(frigate.record())
    assert is_inside(frigate, samples, Limits())
    limit = torque_limit(frigate.record(), float(frigate.record()["gear_ratio"]) * 8.0)
    for signal, value in (
        ("brake_torque", 1.01 * limit),
        ("brake_torque", math.nan),
        ("shaft_speed", 1.01 * frigate.shaft_speeds[1]),
    ):
        other = samples.copy()
        other["shaft_speed"][30] = 8.0
        assert is_inside(frigate, other, Limits())
        other[signal][30] = value
        assert not is_inside(frigate, other, Limits()), signal


def test_a_trial_stays_within_the_sea_room(models: dict[str, Ship]) -> None:
    room = 3900.0  # 10 min at 6.5 m/s, which the usual programme exceeds
    for limits, inside in ((Limits(), False), (Limits(sea_room_m=room), True)):
        plan = plan_trial(models, LOG, 10.0, limits, pool=2)
        for ship in models.values():
            distance = simulate_recording(ship, plan.table)["ship_speed_m_s"].sum()
            assert (distance < 1.02 * room) == inside


def test_uncertain_parameters_are_checked(models: dict[str, Ship]) -> None:
    one = {"fouled": models["fouled"]}
    for uncertain, words in (
        ({"hull.slime": 0.1}, "hull.slime is no parameter of frigate"),
        ({"hull.fouling_fraction": 0.0}, "fouling_fraction = 0: must be above 0"),
    ):
        with pytest.raises(PlanError, match=words):
            plan_trial(one, LOG, 5.0, uncertain=uncertain, pool=1)


def test_a_trial_for_one_model_narrows_its_interval(models: dict[str, Ship]) -> None:
    """Noise of a tenth gives a narrower interval, and the prior is the present standard error."""
    one, fouling = {"fouled": models["fouled"]}, {"hull.fouling_fraction": 0.05}
    half = {}
    for sd in (0.05, 0.5):
        plan = plan_trial(one, {"ship_speed_m_s": Noise(sd)}, 10.0, uncertain=fouling, pool=6)
        (row,) = plan.intervals.to_dict("records")
        assert row["half_95_before"] == pytest.approx(1.96 * 0.05)
        assert math.isnan(plan.least)
        assert plan.pairs.empty
        half[sd] = row["half_95_after"]
    assert 0.0 < half[0.05] < half[0.5] < 1.96 * 0.05
    (said,) = intervals_in_words(plan)
    assert said.startswith(
        "hull.fouling_fraction = 0.1: 95 % interval from noise +- 0.098 now, +- 0.0"
    )


def write_report(folder: Path, models: dict[str, Ship], **changes: object) -> Path:
    """Write a report with the ships of its models."""
    content = {
        "verdict": "explained",
        "alternatives": {},
        "hidden": {},
        "noise": {"ship_speed_m_s": {"sd": 0.05, "correlation_s": 2.0}},
        "effects": [],
    }
    folder.mkdir(exist_ok=True)
    write_ship(models["fouled"], folder / "corrected_ship.toml")
    write_ship(models["log"], folder / "log.toml")
    (folder / "report.json").write_text(json.dumps(content | changes))
    return folder / "report.json"


def test_a_report_is_a_question(models: dict[str, Ship], tmp_path: Path) -> None:
    fouling = {"key": "hull.fouling_fraction", "value": 0.1, "ci95": [0.08, 0.12], "se": 0.01}
    effects = [{"parameters": {"fouling_fraction": fouling}}]
    others = {"speed-log-gain (sensor)": "log.toml"}
    report = write_report(tmp_path, models, alternatives=others, effects=effects)
    found = read_question(report)
    assert [*found.models] == ["corrected ship", "speed-log-gain (sensor)"]
    assert found.models["speed-log-gain (sensor)"].sensors.speed_log_gain == 0.96
    assert found.noise == {"ship_speed_m_s": Noise(0.05, 2.0)}
    assert found.uncertain == {"hull.fouling_fraction": 0.01}
    assert "between 2 models" in found.text
    report = write_report(tmp_path, models, hidden=others)
    assert "1 effects that it may hide" in read_question(report).text
    report = write_report(tmp_path, models, effects=effects)
    found = read_question(report)
    assert [*found.models] == ["corrected ship"]
    assert "narrow the intervals" in found.text
    unknown = [{"parameters": {"fouling_fraction": fouling | {"ci95": None}}}]
    report = write_report(tmp_path, models, effects=unknown)
    with pytest.raises(PlanError, match=r"left nothing open \(verdict explained\)"):
        read_question(report)
    report.write_text("no json")
    with pytest.raises(PlanError, match=r"is no report.json of `shaftline diagnose`"):
        read_question(report)
    report.write_text('{"verdict": "explained"}')
    with pytest.raises(PlanError, match="diagnose again"):
        read_question(report)


def test_the_limit_is_a_ratio_of_twenty() -> None:
    assert np.exp(DECIDED / 2.0) == pytest.approx(20.0, rel=0.01)
