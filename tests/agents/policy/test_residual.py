"""What a policy sees of an observation, and how its answers become commands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents.policy.residual import ANSWERS, MEAN_S, RECENT, SLOWLY, Form, Residual
from shaftline.baselines.actions import actions
from shaftline.baselines.controller import OBSERVED, readings
from shaftline.baselines.registry import ControllerError, make_controller
from shaftline.envs import CLASSIC, FrigateVectorEnv
from shaftline.plant import load_ship

INTERVAL_S = 0.5
SHIP = load_ship("frigate")
FORM = Form(pitch_reach=0.2, rack_reach=0.1, history=3, washout_s=5.0)


@pytest.fixture(scope="module")
def observed() -> Any:
    """Return what controllers read in three episodes, shape (20, 3, 8)."""
    env = FrigateVectorEnv(
        3, task="transit", sea="state-6", observer="random-walk-kalman", **CLASSIC
    )  # fmt: skip
    seen, _ = env.reset(seed=1)
    rows = [seen]
    for _ in range(19):
        rows.append(env.step(np.tile(np.array([0.5, 0.1], np.float32), (3, 1)))[0])
    env.close()
    return np.array(rows)[:, :, : len(OBSERVED)]


def test_features_and_commands_by_hand(observed: Any) -> None:
    """The slow ones, then the last three readings less their means; commands beside the base's."""
    adapter, base = Residual(SHIP, INTERVAL_S, FORM), make_controller(FORM.base, SHIP, INTERVAL_S)
    rng = np.random.default_rng(2)
    keep, slow = np.exp(-INTERVAL_S / MEAN_S), np.exp(-INTERVAL_S / 5.0)
    plant = SHIP.record()
    spans = np.array(
        [0.2 * (plant["pitch_ratio_max"] - plant["pitch_ratio_min"]), 0.1 * plant["drive_max"]]
    )
    memory, own = None, base.fresh(readings(observed[0]))
    means: Any = None
    answered, past = np.zeros((3, 2)), [np.zeros((3, 5))] * 3
    for rows in observed:
        features, memory = adapter.see(rows, memory)
        order, omega, torque, pitch, rack, _, estimate, valid = np.asarray(rows, np.float64).T
        assert (valid > 0.5).all()
        now = np.stack([omega, torque, pitch, rack, estimate], axis=1)
        means = now if means is None else keep * means + (1.0 - keep) * now
        past = [now - means, *past[:2]]
        wanted = np.stack(base.act(readings(rows), own), axis=1)
        expected = [order, own[:, 0], own[:, 3], *means.T, *wanted.T, *answered.T, valid,
                    *np.hstack(past).T]  # fmt: skip
        assert features.dtype == np.float32
        assert pytest.approx(np.asarray(expected, np.float32), rel=1e-5, abs=1e-3) == features.T
        answer = rng.uniform(-1.4, 1.4, (3, 2))
        said = np.clip(answer, -1.0, 1.0)
        answered = slow * answered + (1.0 - slow) * said
        asked = wanted + spans * (said - answered)
        limits = base.limits(omega)  # type: ignore[attr-defined]
        asked[:, 1] = np.clip(asked[:, 1], *limits)
        action = adapter.command(answer, rows, memory)
        assert action == pytest.approx(actions(plant, *asked.T), abs=1e-6)


def test_with_a_lag_the_answers_arrive_slowly(observed: Any) -> None:
    """A step of the answer of 1 is 1 - exp(-t / lag) of its reach after t, on top of the base."""
    form = Form(base=FORM.base, pitch_reach=0.05, rack_reach=0.0, lag_s=4.0)
    adapter, base = Residual(SHIP, INTERVAL_S, form), make_controller(form.base, SHIP, INTERVAL_S)
    plant = SHIP.record()
    span = 0.05 * (plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
    memory, own = None, base.fresh(readings(observed[0]))
    for k, rows in enumerate(observed, start=1):
        _, memory = adapter.see(rows, memory)
        wanted, _ = base.act(readings(rows), own)
        pitch, _ = adapter.set_points(np.tile([-1.0, 0.0], (3, 1)), readings(rows), memory)
        assert pitch == pytest.approx(wanted - span * (1.0 - np.exp(-k * INTERVAL_S / 4.0)))
    with pytest.raises(ValueError, match=r"form: washout_s and lag_s: one of them must be 0"):
        Form(washout_s=5.0, lag_s=4.0)
    with pytest.raises(ValueError, match=r"form.lag_s = -1.0 s: must be from 0"):
        Form(lag_s=-1.0)


def test_features_are_named_in_their_order() -> None:
    names = FORM.features
    assert names[: len(SLOWLY)] == SLOWLY
    assert names[len(SLOWLY) :] == tuple(f"{name} {k} ago" for k in range(3) for name in RECENT)
    assert names.index("mean answer fuel_rack") == 11
    assert len(Form().features) == len(SLOWLY) + 8 * len(RECENT) == 53


def test_a_policy_that_says_nothing_sails_as_its_base(observed: Any) -> None:
    for name in ("speed-pilot:torque_gain=0.5", "va-pitch:ahead_s=0.3"):
        adapter = Residual(SHIP, INTERVAL_S, Form(base=name, washout_s=10.0))
        base = make_controller(name, SHIP, INTERVAL_S)
        memory, state = None, None
        for rows in observed:
            _, memory = adapter.see(rows, memory)
            expected, state = base.predict(rows, state)
            assert np.array_equal(adapter.command(np.zeros((3, 2)), rows, memory), expected)


def test_without_a_washout_an_answer_that_stands_is_felt_for_ever(observed: Any) -> None:
    felt = {}
    for washout_s in (0.0, 2.0):
        adapter = Residual(SHIP, INTERVAL_S, Form(washout_s=washout_s))
        _, memory = adapter.see(observed[0])
        still = np.zeros((3, 2))
        base = adapter.command(still, observed[0], memory.copy())[:, 0]
        raised = np.tile([-0.5, 0.0], (3, 1))
        for _ in range(20):
            pitch = adapter.command(raised, observed[0], memory)[:, 0]
        felt[washout_s] = float((pitch - base)[0])
    assert felt[0.0] == pytest.approx(-0.5 * 0.4 * 2.0)  # of a range of 2 in actions
    assert felt[2.0] == pytest.approx(felt[0.0] * np.exp(-20 * INTERVAL_S / 2.0), rel=1e-3)


def test_an_estimate_that_is_not_valid_is_not_shown(observed: Any) -> None:
    adapter = Residual(SHIP, INTERVAL_S, FORM)
    _, memory = adapter.see(observed[0])
    row = observed[1].copy()
    row[:, OBSERVED.index("estimate_valid")] = 0.0, 1.0, 1.0
    row[:, OBSERVED.index("estimated_advance_velocity")] = 1e6, 1e6, np.nan
    features, _ = adapter.see(row, memory)
    now = FORM.features.index("advance_velocity 0 ago")
    assert features[0, now] == features[2, now] == 0.0
    assert features[1, now] > 1e5
    assert features[:, FORM.features.index("estimate_valid")].tolist() == [0.0, 1.0, 1.0]
    assert np.isfinite(features).all()


def test_seeing_leaves_the_memory_as_it_was(observed: Any) -> None:
    adapter = Residual(SHIP, INTERVAL_S, FORM)
    _, memory = adapter.see(observed[0])
    before = memory.copy()
    _, after = adapter.see(observed[1], memory, np.array([True, False, False]))
    assert np.array_equal(memory, before)
    assert not np.array_equal(after, before)


def test_an_episode_that_begins_forgets(observed: Any) -> None:
    adapter = Residual(SHIP, INTERVAL_S, FORM)
    _, memory = adapter.see(observed[0])
    adapter.command(np.ones((3, 2)), observed[0], memory)
    features, after = adapter.see(observed[1], memory, np.array([True, False, False]))
    fresh, _ = adapter.see(observed[1])
    assert np.array_equal(features[0], fresh[0])
    assert not np.array_equal(features[1], fresh[1])
    answered = [FORM.features.index(f"mean answer {name}") for name in ANSWERS]
    assert (features[0, answered] == 0.0).all()
    assert (features[1, answered] > 0.0).all()
    assert after.shape == memory.shape


def test_one_observation_is_a_batch_of_one(observed: Any) -> None:
    adapter = Residual(SHIP, INTERVAL_S, FORM)
    memory, alone = None, None
    answer = np.tile([-0.6, 0.3], (3, 1))
    for row in observed:
        features, memory = adapter.see(row, memory)
        single, alone = adapter.see(row[1], alone)
        assert np.array_equal(single[0], features[1])
        every = adapter.command(answer, row, memory)
        assert np.array_equal(adapter.command(answer[:1], row[1], alone)[0], every[1])


def test_the_rack_stays_within_the_pilot_s_limits(observed: Any) -> None:
    adapter = Residual(SHIP, INTERVAL_S, Form(rack_reach=2.0))
    _, memory = adapter.see(observed[0])
    low, high = adapter.base.limits(observed[0][:, OBSERVED.index("shaft_speed")])
    for said, limit in ((1.0, high), (-1.0, low)):
        _, rack = adapter.set_points(np.full((3, 2), said), readings(observed[0]), memory)
        assert rack == pytest.approx(limit)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"pitch_reach": -0.1}, "from 0 to 2"), ({"rack_reach": 2.1}, "from 0 to 2"),
        ({"rack_reach": float("nan")}, "from 0 to 2"), ({"history": 0}, "1 to 64 readings"),
        ({"history": 65}, "1 to 64 readings"), ({"washout_s": -1.0}, "from 0 to 10 000"),
    ],
)  # fmt: skip
def test_a_form_out_of_range_is_refused(values: dict[str, Any], words: str) -> None:
    (name,) = values
    with pytest.raises(ValueError, match=rf"form\.{name} = .*{words}"):
        Form(**values)


def test_a_base_must_be_a_speed_pilot() -> None:
    with pytest.raises(ControllerError, match="built on it"):
        Residual(SHIP, INTERVAL_S, Form(base="combinator"))
    with pytest.raises(ControllerError, match="unknown controller"):
        Residual(SHIP, INTERVAL_S, Form(base="captain"))
