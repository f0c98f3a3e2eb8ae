"""Trainings repeat, go on where they were stopped, and say what they cannot use."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shaftline.agents import Setting, load_policy, run_episodes, train
from shaftline.agents.evaluation.statistics import interquartile_mean
from shaftline.agents.learning import training
from shaftline.agents.learning.recipe import tuned_controller
from shaftline.agents.learning.training import (
    LinearDecay,
    _build,
    _Watch,
    build_model,
    evaluation_schedule,
    extract_network,
    weights_digest,
)
from shaftline.baselines import make_controller, make_steering
from shaftline.core import sweep
from shaftline.envs import Sb3Frigates, get_task
from shaftline.plant import load_ship

from ..tiny import PPO, SAC, interrupted_after_an_evaluation, recipe

SEEN = 15
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
    return [
        weights_digest(file)
        for file in sorted((policy.parent / "checkpoints").glob("policy-*.npz"))
    ]


def test_equal_seeds_give_equal_policies(whole: Any, tmp_path: Path) -> None:
    again = train(recipe(), 3, tmp_path / "again", device="cpu", threads=1)
    other = train(recipe(), 4, tmp_path / "other", device="cpu")
    assert checkpoints(again) == checkpoints(whole("ppo"))
    assert not set(checkpoints(other)) & set(checkpoints(again))


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
def test_an_interruption_changes_nothing(whole: Any, tmp_path: Path, algorithm: str) -> None:
    interrupted_after_an_evaluation(recipe(algorithm), 3, tmp_path)
    assert len(json.loads((tmp_path / "curve.json").read_text())) == 1
    resumed = train(recipe(algorithm), 3, tmp_path, device="cpu")
    assert checkpoints(resumed) == checkpoints(whole(algorithm))
    before, after = (load_policy(path).curve for path in (whole(algorithm), resumed))
    assert before["reward"] == after["reward"]
    assert before["steps"] == after["steps"]
    assert after["seconds"] == sorted(after["seconds"])
    assert len(list((tmp_path / "log").glob("progress-*.csv"))) == 2


def test_evaluations_have_seeds_of_their_own_and_the_last_policy_is_kept(whole: Any) -> None:
    policy = load_policy(whole("ppo"))
    assert policy.curve["steps"] == [64, 128]
    last = load_policy(whole("ppo").parent / "checkpoints/policy-02.npz")
    assert weights_digest(whole("ppo")) == weights_digest(
        whole("ppo").parent / "checkpoints/policy-02.npz"
    )
    assert last.curve == policy.curve
    assert policy.about["seed"] == 3
    assert policy.about["recipe"]["hyperparameters"]["n_steps"] == 16
    assert policy.about["torch"] == torch.__version__.split("+")[0]
    cell = Setting(
        "policy", "transit", "task", "random-walk-kalman", 24, episode_s=10.0, first_seed=500_000
    )
    for part in (1, 2):
        kept = load_policy(whole("ppo").parent / f"checkpoints/policy-{part:02d}.npz")
        kpis, _ = run_episodes(cell, kept)
        for name in ("reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m"):
            expected = interquartile_mean(kpis[name])
            assert policy.curve[name][part - 1] == pytest.approx(expected), name
        assert policy.curve["failed"][part - 1] == kpis["failed"].mean()


def test_every_part_begins_with_seeds_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below those of evaluations and of comparisons."""
    seeds: list[Any] = []
    plain = Sb3Frigates.seed

    def noting(env: Sb3Frigates, seed: int | None = None) -> Any:
        seeds.append(seed)
        return plain(env, seed)

    monkeypatch.setattr(Sb3Frigates, "seed", noting)
    train(recipe(), 3, tmp_path, device="cpu")
    expected = [
        int(np.random.SeedSequence([3, part]).generate_state(1)[0] % 2**31) for part in (0, 1)
    ]
    assert seeds[-1] == expected[1] % 400_000
    assert expected[0] % 400_000 in seeds


def test_evaluations_have_the_environment_of_the_recipe(tmp_path: Path) -> None:
    """With its observer, noise and length of an episode."""
    keywords = {"observer": "none", "sensor_noise": 0.0, "max_episode_steps": 12}
    plan = recipe(n_timesteps=64, evaluations=1, env_kwargs=keywords)
    policy = load_policy(train(plan, 0, tmp_path, device="cpu"))
    cell = Setting(
        "policy", "transit", "task", "none", 24, episode_s=6.0, sensor_noise=0.0, first_seed=500_000
    )
    kpis, _ = run_episodes(cell, policy)
    assert policy.curve["reward"] == [pytest.approx(interquartile_mean(kpis["reward"]))]


@pytest.mark.parametrize(
    "keywords",
    [{"action_mode": "absolute", "command": "limited-rack"}, {"action_mode": "residual:va-pitch"}],
)
def test_a_policy_keeps_the_action_mode_of_its_recipe(
    tmp_path: Path, keywords: dict[str, str]
) -> None:
    plan = recipe(n_timesteps=64, evaluations=1, env_kwargs={"max_episode_steps": 12} | keywords)
    policy = load_policy(train(plan, 0, tmp_path, device="cpu"))
    assert policy.interface["action_mode"] == keywords["action_mode"]
    assert policy.interface["command"] == "limited-rack"


def test_a_steered_task_is_trained_with_its_rudder(tmp_path: Path) -> None:
    plan = recipe(task="course-keeping", n_timesteps=64, evaluations=1)
    policy = load_policy(train(plan, 0, tmp_path, device="cpu"))
    assert policy.network.shape == (SEEN + 8, 3)
    assert policy.curve["reward"][0] > 0.0


@pytest.mark.parametrize(
    ("task", "mode", "words"),
    [
        ("transit", "increment", f"the tuned classic controller {tuned_controller('transit')}"),
        ("transit", "residual:va-pitch", "the base controller va-pitch"),
        (
            "course-keeping",
            "absolute",
            f"the tuned classic controller {tuned_controller('course-keeping')}",
        ),
    ],
)
def test_learning_is_compared_with_a_controller_in_the_same_episodes(
    task: str, mode: str, words: str
) -> None:
    keywords = {"max_episode_steps": 10, "action_mode": mode}
    plan = recipe(task=task, env_kwargs=keywords)
    vessel = get_task(task).vessel
    said, reward = training.reference(plan, vessel)
    assert said == words
    name = words.split()[-1]
    controller: Any = (
        make_steering(name, load_ship(vessel), 0.5)
        if task == "course-keeping"
        else make_controller(name, load_ship(vessel), 0.5)
    )
    cell = Setting("one", task, "task", "random-walk-kalman", 24, episode_s=5.0, first_seed=500_000)
    kpis, _ = run_episodes(cell, controller)
    assert reward == pytest.approx(interquartile_mean(kpis["reward"]))


def test_episodes_of_a_training_do_not_end_in_step() -> None:
    _, venv, _ = build_model(recipe(n_envs=4), 0, "frigate", "cpu", 1)
    venv.reset()
    assert venv.get_attr("vector", [0])[0].batch.elapsed.tolist() == [0, 5, 10, 15]


def test_a_finished_training_is_left_alone(whole: Any) -> None:
    before = checkpoints(whole("ppo"))
    ticks: list[int] = []
    train(recipe(), 3, whole("ppo").parent, tick=lambda done, total, said: ticks.append(done))
    assert not ticks
    assert checkpoints(whole("ppo")) == before


def test_few_steps_are_few_evaluations(tmp_path: Path) -> None:
    said: list[tuple[int, int, str]] = []
    policy = load_policy(
        train(
            recipe(n_timesteps=70, evaluations=10),
            0,
            tmp_path,
            device="cpu",
            tick=lambda *told: said.append(told),
        )
    )
    assert policy.curve["steps"] == [64]
    assert said[0] == (4, 70, "not evaluated yet")
    assert said[-1] == (70, 70, f"reward {policy.curve['reward'][0]:.1f}")
    assert (tmp_path / "log/progress-00.csv").is_file()


@pytest.mark.parametrize(
    ("algorithm", "changes", "expected"),
    [
        ("ppo", {}, (2, 64)),
        ("ppo", {"n_timesteps": 70, "evaluations": 10}, (1, 64)),
        ("ppo", {"n_timesteps": 300, "evaluations": 3}, (3, 128)),
        ("ppo", {"n_timesteps": 1}, (1, 64)),
        ("ppo", {"n_timesteps": 9000, "evaluations": 1, "hyperparameters": {}}, (1, 8192)),
        ("sac", {}, (2, 64)),
        ("sac", {"n_timesteps": 30, "evaluations": 7}, (7, 4)),
    ],
)
def test_parts_are_whole_rollouts(
    algorithm: str, changes: dict[str, Any], expected: tuple[int, int]
) -> None:
    assert evaluation_schedule(recipe(algorithm, **changes)) == expected


def test_falling_values_follow_the_whole_training() -> None:
    falling, told = LinearDecay(3.0), []
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


def frigates() -> Sb3Frigates:
    """Return four environments without a monitor."""
    return Sb3Frigates(4, task="transit", max_episode_steps=20)


def test_texts_become_numbers_and_falling_values() -> None:
    plan = recipe(hyperparameters=PPO | {"clip_range": "0.3", "ent_coef": "1e-2"})
    model, falling = _build(plan, frigates(), 7, "cpu")
    assert [value.value for value in falling] == [1e-3]
    assert model.clip_range(1.0) == 0.3
    assert model.ent_coef == 0.01
    assert (model.seed, model.n_steps, model.use_sde) == (7, 16, True)
    assert plan.hyperparameters["learning_rate"] == "lin_1e-3"  # what is given stays
    assert plan.hyperparameters["policy_kwargs"] == {"net_arch": [8, 8]}


@pytest.mark.parametrize(
    ("algorithm", "activation", "squashed", "last"),
    [
        ("ppo", "tanh", False, lambda model: model.policy.action_net),
        ("sac", "relu", True, lambda model: model.policy.actor.mu),
        ("td3", "relu", True, lambda model: model.policy.actor.mu[-2]),
    ],
)
def test_a_network_is_a_copy_of_the_model(
    algorithm: str, activation: str, squashed: bool, last: Any
) -> None:
    model, _ = _build(recipe(algorithm), frigates(), 0, "cpu")
    network = extract_network(model)
    assert (network.activation, network.squashed) == (activation, squashed)
    assert [w.shape for w in network.weights] == [(8, SEEN), (8, 8), (2, 8)]
    assert np.array_equal(network.biases[2], last(model).bias.detach().numpy())
    with torch.no_grad():  # the model learns on
        last(model).bias += 1.0
    assert not np.array_equal(network.biases[2], last(model).bias.detach().numpy())


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
    interrupted_after_an_evaluation(recipe(), 3, folder)
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
    with pytest.raises((TypeError, ValueError), match=word):
        train(recipe(**change), 0, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_commit_is_the_checkouts(monkeypatch: pytest.MonkeyPatch) -> None:
    here = Path(training.__file__).parent
    found = subprocess.run(["git", "rev-parse", "HEAD"], cwd=here, capture_output=True, text=True)
    assert training.git_commit() == (found.stdout.strip() if found.returncode == 0 else None)

    def nowhere(*_: Any, **__: Any) -> Any:
        raise OSError

    monkeypatch.setattr(subprocess, "run", nowhere)
    assert training.git_commit() is None
