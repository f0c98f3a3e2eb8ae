from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from pathlib import Path

import pandas as pd
import pytest

from shaftline.agents import load_policy
from shaftline.agents.learning.tuning import TuningResult

from .conftest import Command
from .test_bad_input import nothing_written, refused

RECIPE = """
transit:
  n_envs: 4
  n_timesteps: 128
  evaluations: 2
  n_steps: 16
  batch_size: 32
  n_epochs: 1
  env_kwargs: {max_episode_steps: 20}
"""
SEARCHED = """
transit:
  n_envs: 4
  n_timesteps: 64
  n_steps: 16
  batch_size: 32
  n_epochs: 1
  learning_rate: 1.0e-3
  evaluations: 1
  env_kwargs: {max_episode_steps: 20}
"""
QUICK = ("--seeds", 2, "--episode-s", 10, "--jobs", 1)


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "mine.yml"
    path.write_text(RECIPE)
    return path


def test_a_policy_is_trained_and_evaluated(
    shaftline: Command, tmp_path: Path, recipe: Path
) -> None:
    out = tmp_path / "out"
    arguments = (
        "train", "--task", "transit", "--recipe", recipe, "--out", out, "--seed", 2,
        "--observer", "luenberger", "--device", "cpu", "--sensor-noise", 0.5,
    )  # fmt: skip
    first = shaftline(*arguments)
    assert first.exit_code == 0, first.output
    assert "evaluations; the last policy is kept" in first.output
    assert "the policy " in first.output
    assert ", the tuned classic controller va-pitch" in first.output
    assert f"--controller policy:{out / 'policy.npz'} --controller combinator" in first.output
    assert "--observer luenberger" in first.output
    policy = load_policy(out / "policy.npz")
    assert policy.about["seed"] == 2
    assert policy.about["recipe"]["env_kwargs"] == {
        "max_episode_steps": 20,
        "observer": "luenberger",
        "sensor_noise": 0.5,
    }
    assert len(json.loads((out / "curve.json").read_text())) == 2

    again = shaftline(*arguments)
    assert again.exit_code == 0, again.output
    assert "the training is already complete" in again.output

    refused(shaftline(*arguments, "--timesteps", 640), "another recipe", "another")

    found = shaftline(
        "evaluate",
        "--controller",
        f"policy:{out / 'policy.npz'}",
        "--controller",
        "combinator",
        "--sea",
        "state-5",
        "--out",
        tmp_path / "evaluated",
        "--render",
        *QUICK,
    )
    assert found.exit_code == 0, found.output
    table = pd.read_csv(tmp_path / "evaluated" / "table.csv")
    assert table["controller"][0].startswith("policy:out/policy.npz ")
    assert table["fuel_kg_nmi"].gt(0.0).all()

    policy.about["control_interval_s"] = 1.0
    policy.save(out / "slow.npz")
    for name, words in (
        ("slow.npz", ("control_interval_s", "the policy has 1 s, the environment 0.5 s")),
        ("curve.json", ("not a policy file",)),
        ("nothing.npz", ("no such policy file",)),
    ):
        path = f"policy:{out / name}"
        refused(shaftline("evaluate", "--controller", path, "--out", tmp_path / "no"), *words)
    assert not (tmp_path / "no").exists()


def test_interrupted_says_so(
    shaftline: Command, tmp_path: Path, recipe: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("shaftline.agents.learning.training.train", stopped)
    result = shaftline("train", "--task", "transit", "--recipe", recipe, "--out", tmp_path / "out")
    assert result.exit_code == 130
    assert "the same command resumes there" in result.output


def test_without_the_extra(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import_module("shaftline.agents.learning.training")  # so that there is something to take away
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.delattr("shaftline.agents.learning.training")
    monkeypatch.delitem(sys.modules, "shaftline.agents.learning.training")
    refused(
        shaftline("train", "--out", tmp_path / "out"),
        "stable_baselines3",
        "pip install 'shaftline[train]'",
    )
    nothing_written(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--task", "race"), ("unknown task 'race'", "transit")),
        (("--algorithm", "dqn"), ("unknown algorithm 'dqn'", "ppo, sac, td3")),
        (("--observer", "eye"), ("unknown observer 'eye'", "luenberger")),
        (("--ship", "fregate"), ("unknown ship 'fregate'", "frigate")),
        (("--ship", "tito-neri-sine"), ("diesel",)),
        (("--envs", "0"), ("--envs", "greater than or equal to 1")),
        (("--timesteps", "0"), ("--timesteps", "greater than or equal to 1")),
        (("--sensor-noise", "-1"), ("--sensor-noise", "greater than")),
        (("--device", "tpu"), ("--device", "cuda")),
        (("--task", "storm"), ("mine.yml", "no section 'storm'", "transit")),
    ],
)
def test_bad_input(
    shaftline: Command,
    tmp_path: Path,
    recipe: Path,
    arguments: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    out = tmp_path / "out"
    refused(
        shaftline("train", "--task", "transit", "--recipe", recipe, "--out", out, *arguments),
        *words,
    )
    nothing_written(tmp_path, "mine.yml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("n_envs: 4", "n_envs: 9999", ("n_envs = 9999", "less than or equal to 4096")),
        ("n_steps: 16", "n_stepz: 16", ("unknown key 'n_stepz'", "n_steps")),
        (
            "{max_episode_steps: 20}",
            "{episode: 1}",
            ("env_kwargs.episode: cannot be set", "allowed are observer"),
        ),
        ("n_epochs: 1", "frame_stack: 0", ("frame_stack = 0", "greater than or equal to 1")),
        ("batch_size: 32", "batch_size: many", ("batch_size = 'many'", "must be a number")),
    ],
)
def test_bad_recipe(
    shaftline: Command, tmp_path: Path, recipe: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    recipe.write_text(RECIPE.replace(old, new))
    refused(
        shaftline("train", "--task", "transit", "--recipe", recipe, "--out", tmp_path / "out"),
        *words,
    )
    nothing_written(tmp_path, "mine.yml")


def test_constants_are_searched_for_and_sailed(shaftline: Command, tmp_path: Path) -> None:
    """What is printed is a controller that `evaluate` takes."""
    quick = ("--rounds", 1, "--seeds", 2, "--episode-s", 10)
    result = shaftline(
        "tune",
        "--controller",
        "speed-pilot:pitch_gain=0",
        "--task",
        "transit",
        "--vary",
        "speed_gain=1:9",
        *quick,
    )
    assert result.exit_code == 0, result.output
    (found,) = set(re.findall(r"speed-pilot:pitch_gain=0\.?0?,speed_gain=\S+", result.output))
    assert 1.0 <= float(found.rpartition("=")[2]) <= 9.0
    assert "unused episodes" in result.output
    result = shaftline(
        "evaluate", "--controller", found, "--task", "transit", "--out", tmp_path, *QUICK
    )
    assert result.exit_code == 0, result.output


def test_tuning_needs_one_small_library(
    shaftline: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "shaftline.agents.learning.tuning", raising=False)
    monkeypatch.setitem(sys.modules, "cma", None)
    words = "tuning needs cma, which is not installed: pip install 'shaftline[tune]'"
    refused(shaftline("tune"), words)


def test_a_search_in_which_every_episode_fails_says_so(
    shaftline: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = TuningResult("speed-pilot:speed_gain=3", 0.0, 0.0, 0.0, 8)
    monkeypatch.setattr("shaftline.agents.learning.tuning.tune", lambda *_, **__: found)
    result = shaftline("tune", "--ship", "ferry", "--task", "transit", "--sea", "state-6")
    assert result.exit_code == 0, result.output
    assert "orders: 3.95 to 5.08 m/s." in result.output
    assert (
        "the reward is 0 where the engine stalls or trips, here in every episode" in result.output
    )
    assert (
        "shaftline evaluate --controller speed-pilot --task transit --sea state-6 --ship ferry"
        in result.output
    )
    assert "not better" not in result.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--vary", "speed_gain=3"), "--vary 'speed_gain=3': must be OPTION=LOW:HIGH"),
        (("--vary", "speed_gain=3:1"), "range of speed_gain: 3.0 to 1.0: the ends must be finite"),
        (("--vary", "zeal=0:1"), "option 'zeal' is unknown"),
        (("--controller", "helm"), "unknown controller 'helm'"),
        (
            ("--controller", "examples.own_controller:Steady"),
            "no constant of this controller can be tuned",
        ),
        (("--task", "race"), "race"),
        (("--observer", "eye"), "eye"),
    ],
)
def test_searches_that_cannot_be_made_are_refused(
    shaftline: Command, arguments: tuple[str, ...], words: str
) -> None:
    refused(shaftline("tune", "--rounds", 1, "--seeds", 1, "--episode-s", 5, *arguments), words)


def test_a_recipe_is_searched_and_trained(shaftline: Command, tmp_path: Path) -> None:
    given, out = tmp_path / "given.yml", tmp_path / "out"
    given.write_text(SEARCHED)
    arguments = (
        "tune-recipe", "--task", "transit", "--recipe", given, "--trials", 3, "--fresh", 1, "--out", out,
        "--vary", "learning_rate=1e-4:1e-1", "--vary", "env_kwargs.observer=luenberger,none",
    )  # fmt: skip
    found = shaftline(*arguments)
    assert found.exit_code == 0, found.output
    assert "3 trials (0 is the given recipe)" in found.output
    assert "on unused seeds and seas" in found.output
    assert (out / "search.png").stat().st_size > 10_000
    kept = json.loads((out / "search.json").read_text())
    assert len(kept["trials"]) == 3
    assert shaftline(*arguments).output.count("reward") == found.output.count("reward")
    told = found.output.split("shaftline train ")[-1].split()
    trained = shaftline("train", *told, "--out", tmp_path / "trained")
    assert trained.exit_code == 0, trained.output
