"""Trainings repeat, go on where they were stopped, and say what they cannot use."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecNormalize

from shaftline.agents import Setting, load_policy, run_episodes, train
from shaftline.agents.evaluation.statistics import interquartile_mean
from shaftline.agents.learning import training
from shaftline.agents.learning.policy_env import PolicyEnv
from shaftline.agents.learning.privileged_critic import TOLD
from shaftline.agents.learning.training import (
    Falling,
    _built,
    _Watch,
    digest,
    legs_of,
    network_of,
)
from shaftline.agents.policy.residual import ANSWERS, Form
from shaftline.core import sweep
from shaftline.core.archives import read_archive, unpacked
from shaftline.envs import CLASSIC, Sb3Frigates

from ..tiny import PPO, SAC, interrupted_after_a_leg, recipe

SEEN = len(Form().features)
FRIGATE = Path(__file__).parents[3] / "plant/ships/frigate.toml"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A training that nothing interrupted, by algorithm."""
    made: dict[str, Path] = {}

    def policy(algorithm: str) -> Path:
        if algorithm not in made:
            folder = tmp_path_factory.mktemp(algorithm)
            made[algorithm] = train(recipe(algorithm), 3, folder, device="cpu")
        return made[algorithm]

    return policy


def checkpoints(policy: Path) -> list[str]:
    return [digest(file) for file in sorted((policy.parent / "checkpoints").glob("policy-*.npz"))]


def test_equal_seeds_give_equal_policies(whole: Any, tmp_path: Path) -> None:
    again = train(recipe(), 3, tmp_path / "again", device="cpu", threads=1)
    other = train(recipe(), 4, tmp_path / "other", device="cpu")
    assert checkpoints(again) == checkpoints(whole("ppo"))
    assert not set(checkpoints(other)) & set(checkpoints(again))


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_an_interruption_changes_nothing(whole: Any, tmp_path: Path, algorithm: str) -> None:
    interrupted_after_a_leg(recipe(algorithm), 3, tmp_path)
    assert len(json.loads((tmp_path / "curve.json").read_text())) == 1
    resumed = train(recipe(algorithm), 3, tmp_path, device="cpu")
    assert checkpoints(resumed) == checkpoints(whole(algorithm))
    before, after = (load_policy(path).curve for path in (whole(algorithm), resumed))
    assert before["reward"] == after["reward"]
    assert before["steps"] == after["steps"]
    assert after["seconds"] == sorted(after["seconds"])
    assert len(list((tmp_path / "log").glob("progress-*.csv"))) == 2


def test_legs_are_judged_on_seas_of_their_own_and_the_last_is_kept(whole: Any) -> None:
    policy = load_policy(whole("ppo"))
    assert policy.curve["steps"] == [64, 128]
    last = load_policy(whole("ppo").parent / "checkpoints/policy-02.npz")
    assert digest(whole("ppo")) == digest(whole("ppo").parent / "checkpoints/policy-02.npz")
    assert last.curve == policy.curve
    assert 0.0 < policy.curve["environment_share"][0] < 1.0
    assert policy.about["seed"] == 3
    assert policy.about["recipe"]["hyperparameters"]["n_steps"] == 16
    assert policy.about["torch"] == torch.__version__.split("+")[0]
    cell = Setting("policy", "transit", "task", "random-walk-kalman", 24, episode_s=10.0,
                   first_seed=500_000)  # fmt: skip
    for leg in (1, 2):
        kept = load_policy(whole("ppo").parent / f"checkpoints/policy-{leg:02d}.npz")
        kpis, _ = run_episodes(cell, kept)
        for name in ("reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m"):
            expected = interquartile_mean(kpis[name])
            assert policy.curve[name][leg - 1] == pytest.approx(expected), name
        assert policy.curve["failed"][leg - 1] == kpis["failed"].mean()


def test_every_leg_begins_with_seeds_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below those on which legs are judged and controllers compared."""
    seeds: list[Any] = []
    plain = Sb3Frigates.seed

    def noting(env: Sb3Frigates, seed: int | None = None) -> Any:
        seeds.append(seed)
        return plain(env, seed)

    monkeypatch.setattr(Sb3Frigates, "seed", noting)
    train(recipe(), 3, tmp_path, device="cpu")
    expected = [
        int(np.random.SeedSequence([3, leg]).generate_state(1)[0] % 2**31) for leg in (0, 1)
    ]
    assert seeds[-1] == expected[1] % 400_000
    assert expected[0] % 400_000 in seeds


def test_legs_are_judged_as_the_recipe_sails(tmp_path: Path) -> None:
    """With its observer, noise and length of an episode."""
    kwargs = {"observer": "none", "sensor_noise": 0.0, "max_episode_steps": 12}
    plan = recipe(n_timesteps=64, legs=1, env_kwargs=kwargs)
    policy = load_policy(train(plan, 0, tmp_path, device="cpu"))
    cell = Setting("policy", "transit", "task", "none", 24, episode_s=6.0, sensor_noise=0.0,
                   first_seed=500_000)  # fmt: skip
    kpis, _ = run_episodes(cell, policy)
    assert policy.curve["reward"] == [pytest.approx(interquartile_mean(kpis["reward"]))]


def test_a_finished_training_is_left_alone(whole: Any) -> None:
    before = checkpoints(whole("ppo"))
    ticks: list[int] = []
    train(recipe(), 3, whole("ppo").parent, tick=lambda done, total, said: ticks.append(done))
    assert not ticks
    assert checkpoints(whole("ppo")) == before


def test_few_steps_are_few_legs(tmp_path: Path) -> None:
    said: list[tuple[int, int, str]] = []
    policy = load_policy(
        train(recipe(n_timesteps=70, legs=10), 0, tmp_path, device="cpu",
              tick=lambda *told: said.append(told))
    )  # fmt: skip
    assert policy.curve["steps"] == [64]
    assert said[0] == (4, 70, "not judged yet")
    assert said[-1] == (70, 70, f"reward {policy.curve['reward'][0]:.1f}")
    assert (tmp_path / "log/progress-00.csv").is_file()


@pytest.mark.parametrize(
    ("algorithm", "changes", "expected"),
    [
        ("ppo", {}, (2, 64)),
        ("ppo", {"n_timesteps": 70, "legs": 10}, (1, 64)),
        ("ppo", {"n_timesteps": 300, "legs": 3}, (3, 128)),
        ("ppo", {"n_timesteps": 1}, (1, 64)),
        ("ppo", {"n_timesteps": 9000, "legs": 1, "hyperparameters": {}}, (1, 8192)),
        ("sac", {}, (2, 64)),
        ("sac", {"n_timesteps": 30, "legs": 7}, (7, 4)),
    ],
)
def test_legs_are_whole_rollouts(
    algorithm: str, changes: dict[str, Any], expected: tuple[int, int]
) -> None:
    assert legs_of(recipe(algorithm, **changes)) == expected


def test_falling_values_follow_the_whole_training() -> None:
    falling, told = Falling(3.0), []
    watch = _Watch(recipe(n_timesteps=2000), [falling], lambda *said: told.append(said), ["good"])
    assert falling(0.1) == 3.0
    for steps, left in (
        (0, 1.0),
        (9, 0.9955),
        (10, 0.995),
        (500, 0.75),
        (509, 0.7455),
        (2001, 0.0),
    ):
        watch.num_timesteps = steps
        assert watch._on_step()
        assert falling(1.0) == pytest.approx(3.0 * left)
    assert told == [(steps, 2000, "good") for steps in (0, 10, 500, 2001)]  # 200 times in all


def piloted(**settings: Any) -> VecNormalize:
    frigates = Sb3Frigates(4, task="transit", max_episode_steps=20, **CLASSIC, **settings)
    return VecNormalize(PolicyEnv(frigates, Form(), telling=True))


def test_texts_become_numbers_and_falling_values() -> None:
    plan = recipe(hyperparameters=PPO | {"clip_range": "0.3", "ent_coef": "1e-2"})
    model, falling = _built(plan, piloted(), 7, "cpu")
    assert [value.value for value in falling] == [1e-3]
    assert model.clip_range(1.0) == 0.3
    assert model.ent_coef == 0.01
    assert (model.seed, model.n_steps, model.use_sde) == (7, 16, True)
    assert plan.hyperparameters["learning_rate"] == "lin_1e-3"  # what is given stays
    assert plan.hyperparameters["policy_kwargs"] == {"net_arch": [8, 8]}


@pytest.mark.parametrize("sde", [True, False])
def test_a_networks_numbers_are_the_models(sde: bool) -> None:
    venv = piloted()
    model, _ = _built(recipe(hyperparameters=PPO | {"use_sde": sde}), venv, 0, "cpu")
    rms: Any = venv.obs_rms
    width = SEEN + len(TOLD)
    rms.mean = np.arange(float(width))
    rms.var = np.linspace(0.0, 26.0, width)
    rms.var[3] = 1e-9
    with torch.no_grad():
        model.policy.log_std[...] = torch.linspace(
            -3.0, -1.0, model.policy.log_std.numel()
        ).reshape(model.policy.log_std.shape)
    network = network_of(model, venv, SEEN)
    assert network.mean.tolist() == list(range(SEEN))
    expected = np.sqrt(rms.var[:SEEN] + 1e-8)
    expected[[0, 3]] = np.inf  # they never varied
    assert network.deviation == pytest.approx(expected)
    assert (network.clip, network.activation, network.squashed) == (10.0, "tanh", False)
    assert [w.shape for w in network.weights] == [(8, SEEN), (8, 8), (2, 8)]
    assert np.array_equal(network.biases[2], model.policy.action_net.bias.detach().numpy())
    scale = np.exp(model.policy.log_std.detach().numpy())
    if sde:  # what the last hidden layer's units make together
        scale = np.sqrt(np.mean(scale**2, axis=0))
    assert network.log_deviation == pytest.approx(np.log(scale), rel=1e-5)
    assert network.log_deviation.shape == (len(ANSWERS),)
    with torch.no_grad():  # a copy: the model learns on
        model.policy.action_net.bias += 1.0
    assert not np.array_equal(network.biases[2], model.policy.action_net.bias.detach().numpy())


def test_sac_is_squashed_and_of_relus() -> None:
    frigates = Sb3Frigates(4, task="transit", max_episode_steps=20, **CLASSIC)
    venv = VecNormalize(PolicyEnv(frigates, Form(), telling=False))
    model, _ = _built(recipe("sac"), venv, 0, "cpu")
    network = network_of(model, venv, SEEN)
    assert (network.activation, network.squashed) == ("relu", True)
    assert network.log_deviation.tolist() == [-3.0] * len(ANSWERS)


@pytest.mark.parametrize(
    ("change", "seed", "word"), [({"n_timesteps": 256}, 3, "recipe"), ({}, 4, "seed")]
)
def test_another_training_needs_another_folder(
    whole: Any, change: dict[str, Any], seed: int, word: str
) -> None:
    with pytest.raises(ValueError, match=f"holds a training of another {word}"):
        train(recipe(**change), seed, whole("ppo").parent)


SOURCES = ("core", "plant", "observers", "baselines", "envs", "agents/learning", "agents/policy")


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a training that was stopped."""
    folder = tmp_path_factory.mktemp("begun")
    interrupted_after_a_leg(recipe(), 3, folder)
    return folder


@pytest.mark.parametrize("place", SOURCES)
def test_a_training_does_not_go_on_with_other_source(
    begun: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    source, kept = sweep.source_digest, json.loads((begun / "training.json").read_text())

    def edited(*places: str) -> str:
        return "edited" if place in places else source(*places)

    monkeypatch.setattr(training, "source_digest", edited)
    with pytest.raises(ValueError, match=f"another source \\({kept['source']}, now edited\\)"):
        train(recipe(), 3, begun, device="cpu")


def test_a_training_does_not_go_on_with_another_ship_of_the_same_file(tmp_path: Path) -> None:
    mine, folder = tmp_path / "mine.toml", tmp_path / "training"
    text = FRIGATE.read_text(encoding="utf-8").replace('name = "frigate"', 'name = "mine"')
    mine.write_text(text, encoding="utf-8")
    plan = recipe(n_timesteps=128)
    done = train(plan, 3, folder, device="cpu", ship=str(mine))
    assert load_policy(done).about["ship_source"] == str(mine)
    assert load_policy(done).about["layout"]["ship"] == "mine"
    mine.write_text(
        mine.read_text(encoding="utf-8").replace("diameter_m = 4.2", "diameter_m = 4.1"),
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match="holds a training of another ship"):
        train(plan, 3, folder, device="cpu", ship=str(mine))
    with pytest.raises(ValueError, match="holds a training of another ship"):
        train(plan, 3, folder, device="cpu", ship="frigate")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"env_kwargs": {"observer": "eye"}}, "unknown observer 'eye'"),
        ({"env_kwargs": {"fog": 1}}, "'fog'; known"),
        ({"hyperparameters": {"batch_size": "many"}}, "batch_size = 'many': must be a number"),
        (
            {"hyperparameters": {"learning_rate": "lin_fast"}},
            "learning_rate = 'lin_fast': must be a number, or lin_NUMBER",
        ),
        (
            {"algorithm": "sac", "hyperparameters": SAC | {"use_sde": True}},
            "SAC refuses.*clip_mean",
        ),
    ],
)
def test_what_cannot_begin_leaves_nothing(
    tmp_path: Path, change: dict[str, Any], word: str
) -> None:
    with pytest.raises(ValueError, match=word):
        train(recipe(**change), 0, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_normaliser_keeps_its_numbers_between_legs(whole: Any) -> None:
    folder = whole("ppo").parent / "checkpoints"
    rms = []
    for leg in (1, 2):
        state = unpacked(read_archive(folder / f"model-{leg:02d}.npz"))
        rms.append(state["normaliser"]["obs_rms"])
    assert rms[1]["count"] == pytest.approx(2.0 * rms[0]["count"], rel=0.1)
    network = load_policy(folder / "policy-02.npz").network
    assert network.mean == pytest.approx(rms[1]["mean"][:SEEN])


def test_the_commit_is_the_checkouts(monkeypatch: pytest.MonkeyPatch) -> None:
    here = Path(training.__file__).parent
    found = subprocess.run(["git", "rev-parse", "HEAD"], cwd=here, capture_output=True, text=True)
    assert training.commit() == (found.stdout.strip() if found.returncode == 0 else None)

    def nowhere(*_: Any, **__: Any) -> Any:
        raise OSError

    monkeypatch.setattr(subprocess, "run", nowhere)
    assert training.commit() is None


def test_exploration_is_the_recipes(whole: Any) -> None:
    """The noise of a saved policy is a scale of its own for each answer."""
    found = load_policy(whole("ppo")).network.log_deviation
    assert found.shape == (len(ANSWERS),)
    assert all(-3.0 < value < 3.0 and math.isfinite(value) for value in found.tolist())
