"""What a policy in training is shown, and what becomes of its answers, on a corrected ship."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents.learning.policy_env import PolicyEnv
from shaftline.agents.learning.privileged_critic import TOLD, told
from shaftline.agents.policy.residual import ANSWERS, Form, Residual
from shaftline.envs import CLASSIC, FrigateVectorEnv, Sb3Frigates, get_task
from shaftline.plant import load_ship

FORM = Form(pitch_reach=0.1, washout_s=2.0, history=2)
SEEN = len(FORM.features)
CORRECTED = load_ship("frigate").with_values(
    {"prime_mover.lag_s": 5.0, "propeller.inflow_lag_s": 5.0, "pitch_actuator.offset": 0.03}
)
SETTINGS: dict[str, Any] = {"task": "transit", "ship": CORRECTED, "max_episode_steps": 16}


def made(telling: bool = True, n: int = 4, **settings: Any) -> PolicyEnv:
    env = PolicyEnv(Sb3Frigates(n, **SETTINGS | CLASSIC | settings), FORM, telling)
    env.seed(3)
    return env


def test_features_and_commands_are_the_adapters() -> None:
    env, twin = made(), FrigateVectorEnv(4, **SETTINGS, **CLASSIC)
    adapter = Residual(CORRECTED, 0.5, FORM)
    shown = env.reset()
    seen, _ = twin.reset(seed=3)
    assert env.batch.elapsed.tolist() == [0, 4, 8, 12]  # of 16: each at another time
    twin.batch.elapsed[:] = [0, 4, 8, 12]
    features, memory = adapter.see(seen)
    answers = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 4, len(ANSWERS)))
    ended = 0
    for answer in answers:
        assert np.array_equal(shown[:, :SEEN], features)
        assert np.array_equal(shown[:, SEEN:], told(twin.batch))
        before = told(twin.batch)
        shown, reward, done, infos = env.step(answer)
        action = adapter.command(answer, seen, memory)
        seen, expected, terminated, truncated, info = twin.step(action)
        assert reward == pytest.approx(expected, rel=1e-6)
        assert np.array_equal(done, terminated | truncated)
        for i in np.flatnonzero(done):
            ended += 1
            last, _ = adapter.see(info["final_obs"][i], memory[i : i + 1])
            assert np.array_equal(infos[i]["terminal_observation"], [*last[0], *before[i]])
            assert infos[i]["TimeLimit.truncated"]
        features, memory = adapter.see(seen, memory, done)
    assert ended == 5
    assert 0.0 < env.acting_s < 60.0
    env.close()


def test_only_the_critic_is_told() -> None:
    silent = made(telling=False)
    assert silent.observation_space.shape == (SEEN,)
    assert np.shape(silent.reset()) == (4, SEEN)
    for _ in range(17):
        shown, _, done, infos = silent.step(np.zeros((4, len(ANSWERS))))
        assert np.asarray(shown).shape == (4, SEEN)
        for i in np.flatnonzero(done):
            assert infos[i]["terminal_observation"].shape == (SEEN,)
    telling = made()
    assert telling.observation_space.shape == (SEEN + len(TOLD),)
    assert telling.action_space.shape == (len(ANSWERS),)
    assert float(telling.action_space.high[0]) == 1.0  # type: ignore[attr-defined]


def test_a_ship_with_lags_begins_its_training_in_a_steady_state() -> None:
    """Lags that begin at 0 would show a gauge of 299 kN m and a shaft that slows down at once."""
    still = get_task("transit").model_dump() | {
        "seas": ("calm",), "resistance_rise": (0.0, 0.0), "resistance_swing": 0.0,
        "speed_order_m_s": (8.0, 8.0),
    }  # fmt: skip
    shown = []
    for ship in (CORRECTED, load_ship("frigate")):
        env = PolicyEnv(
            Sb3Frigates(
                2, ship=ship, task=still, sensor_noise=0.0, observer="oracle", **CLASSIC
            ),
            FORM, True,
        )  # fmt: skip
        env.seed(0)
        shown.append(dict(zip(FORM.features, env.reset()[0], strict=False)))
    corrected, plain = shown
    for name in ("shaft_torque", "fuel_rack", "shaft_speed", "advance_velocity"):
        assert corrected[f"mean {name}"] == pytest.approx(plain[f"mean {name}"], rel=0.1)
        assert corrected[f"{name} 0 ago"] == 0.0
    assert corrected["mean pitch_ratio"] == pytest.approx(plain["mean pitch_ratio"] + 0.03)
