"""A policy file: what is saved is loaded, and a policy that does not match is refused."""

from __future__ import annotations

import copy
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecFrameStack

from shaftline.agents import Policy, PolicyError, Setting, load_policy, run_episodes, train
from shaftline.agents.learning.checkpoints import Checkpoints
from shaftline.agents.learning.recipe import Recipe
from shaftline.agents.learning.training import build_model
from shaftline.agents.policy.policy import Network, layout, packaged_policies
from shaftline.envs import FrigateEnv, Sb3Frigates, Settings
from shaftline.envs.batch import Batch
from shaftline.plant import load_ship

from ..tiny import about, plain_policy, recipe

SEEN = 15


@pytest.fixture(scope="module", params=["ppo", "sac", "td3"])
def file(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    return train(recipe(request.param), 0, folder, device="cpu")


@pytest.fixture
def altered(file: Path, tmp_path: Path) -> Any:
    """Return a function that saves the file with another description."""

    def altered(**changes: Any) -> Path:
        policy = load_policy(file)
        described = copy.deepcopy(policy.about)
        for dotted, value in changes.items():
            *path, key = dotted.split("__")
            section: Any = described
            for part in path:
                section = section[part]
            section[key] = value
        policy.about = described
        policy.save(tmp_path / "other.npz")
        return tmp_path / "other.npz"

    return altered


def network(**changes: Any) -> Network:
    """Return a small network of known numbers, with two inputs that matter."""
    first = np.zeros((2, SEEN), np.float32)
    first[0, 0], first[1, 1] = 1.0, -2.0
    last = np.asarray([[0.5, 0.0], [0.0, 1.5]], np.float32)
    fields: dict[str, Any] = {
        "weights": (first, last),
        "biases": (np.asarray([0.25, 0.0], np.float32), np.asarray([0.0, 0.1], np.float32)),
        "activation": "tanh",
        "squashed": False,
    }
    return Network(**(fields | changes))


@pytest.mark.parametrize("squashed", [False, True])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_network_by_hand(activation: str, squashed: bool) -> None:
    act: Any = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}[activation]
    x = np.zeros((3, SEEN), np.float32)
    x[:, 0] = 0.5, 3.0, -3.0
    x[:, 1] = -0.5, 0.0, -3.0
    hidden = act(np.stack([x[:, 0] + 0.25, -2.0 * x[:, 1]], axis=1))
    raw = np.stack([0.5 * hidden[:, 0], 1.5 * hidden[:, 1] + 0.1], axis=1)
    assert np.abs(raw).max() > 1.0  # so that there is something to clip
    expected = np.tanh(raw) if squashed else np.clip(raw, -1.0, 1.0)
    found = network(activation=activation, squashed=squashed)(x)
    assert found == pytest.approx(expected, rel=1e-6)
    assert found.dtype == np.float32


def test_frames_are_stacked_as_stable_baselines3_stacks_them() -> None:
    """Oldest first, zeros before the first observation, and anew where an episode begins."""
    policy = plain_policy(frame_stack=3)
    plain = Sb3Frigates(2, task="transit", max_episode_steps=4, threads=1)
    envs: Any = VecFrameStack(plain, 3)
    envs.seed(1)
    stacked, state, starts = envs.reset(), None, np.ones(2, bool)
    for _ in range(7):
        _, state = policy.predict(stacked[:, -SEEN:], state, starts)
        assert np.array_equal(state, stacked)
        stacked, _, starts, _ = envs.step(np.zeros((2, 2), np.float32))


def test_a_policy_describes_itself() -> None:
    curve = {"reward": [9.0, 7.25], "failed": [0.0, 0.0]}
    policy = Policy(network(), about(), curve=curve)
    assert policy.summary().splitlines() == [
        "PPO on transit, ship frigate, seed 7, a command every 0.5 s",
        "reward 7.25, failed 0",
    ]
    assert Policy(network(), about()).summary() == policy.summary().splitlines()[0]
    assert policy.to_dict() == about() | {"curve": curve}
    assert json.loads(json.dumps(policy.to_dict())) == policy.to_dict()


def test_the_layout_is_everything_that_a_policy_rests_on() -> None:
    settings = {"ship": "ferry", "action_mode": "absolute", "command": "limited-rack"}
    batch = Batch(1, Settings.of(settings))
    found = layout(batch)
    assert found["ship"] == "ferry"
    assert found["format"] == 3
    assert found["ranges"]["gear_ratio"] == load_ship("ferry").transmission.gear_ratio
    assert set(found["ranges"]) == {
        "pitch_ratio_min",
        "pitch_ratio_max",
        "drive_min",
        "drive_max",
        "gear_ratio",
        "engine_speed_min",
        "engine_speed_max",
    }
    assert (found["action_mode"], found["command"]) == ("absolute", "limited-rack")
    assert (found["observed"], found["actions"]) == (list(batch.observed), 2)


def test_a_policy_of_the_storm_has_the_ship_of_the_storm() -> None:
    assert plain_policy("storm").ship.propeller.depth_m == 3.0
    assert Policy(network(), about(), load_ship("frigate")).ship == load_ship("frigate")


def test_a_policy_is_run_with_the_keywords_of_its_training() -> None:
    policy = plain_policy(action_mode="absolute", command="limited-rack")
    assert policy.interface == {
        "normalised": True,
        "action_mode": "absolute",
        "command": "limited-rack",
    }
    setting = Setting("policy", "transit", "calm", "none", 2, episode_s=5.0)
    _, trace = run_episodes(setting, policy)
    env = FrigateEnv(task="transit", sea="calm", observer="none", **policy.interface)
    env.reset(seed=0)
    for _ in range(10):
        *_, info = env.step([0.0, 0.0])
    assert trace[-1, 4:][list(info).index("shaft_speed")] == info["shaft_speed"]


@pytest.mark.parametrize("name", sorted(packaged_policies()))
def test_packaged_policies_load_by_name(name: str) -> None:
    policy = load_policy(name)
    assert policy.about["recipe"]["task"] == name
    assert name in policy.summary()
    action, _ = policy.predict(np.zeros(len(policy.about["layout"]["observed"]), np.float32))
    assert np.isfinite(action).all()


def traced(policy: Policy) -> Any:
    setting = Setting("policy", "transit", "state-5", "random-walk-kalman", 3, episode_s=10.0)
    return run_episodes(setting, policy)[1]


def test_what_is_saved_is_loaded(file: Path, tmp_path: Path) -> None:
    policy = load_policy(file)
    policy.save(tmp_path / "copy.npz")
    copied = load_policy(tmp_path / "copy.npz", load_ship("frigate"))
    assert copied.curve == policy.curve
    assert copied.about == policy.about
    assert np.array_equal(traced(copied), traced(policy), equal_nan=True)


def test_inference_is_that_of_stable_baselines3(file: Path) -> None:
    policy = load_policy(file)
    made = Recipe.model_validate(policy.about["recipe"])
    model, _, _ = build_model(made, 7, policy.about["ship_source"], "cpu", 1)
    Checkpoints(file.parent).resume(model)
    rows = np.random.default_rng(0).uniform(-3.0, 3.0, (50, SEEN)).astype(np.float32)
    expected, _ = model.predict(rows, deterministic=True)
    found, _ = policy.predict(rows)
    assert found == pytest.approx(expected, abs=1e-5)
    assert np.ptp(found, axis=0).min() > 1e-3


def test_one_observation_is_a_batch_of_one(file: Path) -> None:
    policy = load_policy(file)
    row = np.linspace(-1.0, 1.0, SEEN, dtype=np.float32)
    single, _ = policy.predict(row)
    batch, _ = policy.predict(np.stack([row, row]))
    assert single.shape == (2,)
    assert batch[1] == pytest.approx(single, abs=1e-6)
    with pytest.raises(
        ValueError, match=r"observations of 8 signals: the policy needs 15; create the env"
    ):
        policy.predict(np.zeros(8))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"layout__format": 2}, "format: the policy has 2, the environment 3"),
        ({"layout__ship": "launch"}, "ship: the policy has 'launch', the environment 'frigate'"),
        ({"layout__ranges__drive_max": 1.0}, "drive_max: the policy has 1.0"),
        ({"layout__observed": ["torque"]}, r"observed: the policy has \['torque'\]"),
        ({"layout__actions": 3}, "actions: the policy has 3, the environment 2"),
        ({"layout__command": "fuel-rack"}, "observed: the policy has"),
    ],
)
def test_another_layout_is_refused(altered: Any, change: dict[str, Any], words: str) -> None:
    with pytest.raises(
        PolicyError, match=rf"other\.npz: this policy does not match the environment: .*{words}"
    ):
        load_policy(altered(**change))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"recipe__frame_stack": 2}, "15 inputs and 2 outputs; expected are 30 and 2"),
        ({"recipe__frame_stack": 65}, "frame_stack = 65: must be from 1 to 64"),
        ({"layout__action_mode": "by-ear"}, "unknown action_mode 'by-ear'"),
    ],
)
def test_a_description_that_cannot_be_is_refused(
    altered: Any, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(PolicyError, match=words):
        load_policy(altered(**change))


def test_another_ship_is_refused(file: Path) -> None:
    with pytest.raises(
        PolicyError, match="ship: the policy has 'frigate', the environment 'ferry'"
    ):
        load_policy(file, load_ship("ferry"))
    shifted = load_ship("frigate").with_values({"propeller.pitch_ratio_max": 1.35})
    with pytest.raises(PolicyError, match="pitch_ratio_max: the policy has"):
        load_policy(file, shifted)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a | {"weight_0": a["weight_0"] * np.nan}, "a weight is not finite"),
        (lambda a: a | {"weight_0": a["weight_0"][:, 0]}, "must have two dimensions"),
        (lambda a: a | {"bias_0": a["bias_0"][1:]}, "the shapes of the layers do not match"),
        (lambda a: a | {"weight_0": a["weight_0"].astype(complex)}, "must be real numbers"),
        (lambda a: a | {"weight_0": np.array(["a", "b"])}, "must be real numbers"),
        (
            lambda a: {k: v for k, v in a.items() if not k.startswith("weight")},
            "must be real numbers",
        ),
        (lambda a: {k: v for k, v in a.items() if k != "bias_0"}, "bias_0"),
    ],
)
def test_a_network_without_actions_is_refused(
    file: Path, tmp_path: Path, change: Any, words: str
) -> None:
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(tmp_path / "other.npz", **change(arrays))
    with pytest.raises(PolicyError, match=rf"other\.npz: not a policy file .*{words}"):
        load_policy(tmp_path / "other.npz")


def test_a_policy_without_a_description_is_refused(file: Path, tmp_path: Path) -> None:
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    described = json.loads(bytes(arrays["about"]).decode())
    for lost in ("recipe", "control_interval_s"):
        text = json.dumps({k: v for k, v in described.items() if k != lost}).encode()
        np.savez(tmp_path / "other.npz", **arrays | {"about": np.frombuffer(text, np.uint8)})
        with pytest.raises(PolicyError, match=f"not a policy file .*{lost}"):
            load_policy(tmp_path / "other.npz")


def test_what_is_no_policy_is_refused(file: Path, tmp_path: Path) -> None:
    text, empty, array, cut, bare = (tmp_path / f"{i}.npz" for i in range(5))
    text.write_text("speed 8, pitch 1.2")
    empty.write_bytes(b"")
    with array.open("wb") as stream:
        np.save(stream, np.zeros(3))
    cut.write_bytes(file.read_bytes()[:1000])
    np.savez(bare, weight_0=np.zeros((2, 2)))
    for path in (text, empty, array, cut, bare):
        with pytest.raises(PolicyError, match=f"{path.name}: not a policy file"):
            load_policy(path)
    with pytest.raises(
        PolicyError, match=r"nowhere: no such policy file; the package contains .*rough-sea"
    ):
        load_policy("nowhere")


def test_a_damaged_policy_is_refused_or_still_a_policy(tmp_path: Path) -> None:
    """A flipped bit or a cut anywhere in the file is refused."""
    content = packaged_policies()["rough-sea"].read_bytes()
    rng = np.random.default_rng(0)
    path = tmp_path / "damaged.npz"
    refused = 0
    for place in rng.integers(8 * len(content), size=400):
        damaged = bytearray(content)
        damaged[place // 8] ^= 1 << (place % 8)
        path.write_bytes(damaged)
        with suppress(PolicyError):  # any other error fails the test
            load_policy(path)
            continue
        refused += 1
    assert refused > 300  # members have checksums; names and times of the archive have none
    for end in rng.integers(len(content), size=40):
        path.write_bytes(content[:end])
        with pytest.raises(PolicyError, match=r"damaged\.npz: not a policy file .*archive"):
            load_policy(path)


@pytest.mark.parametrize("interval", [0, -0.5, float("nan"), float("inf"), 1e400])
def test_a_policy_with_an_impossible_control_interval_is_refused(
    altered: Any, interval: float
) -> None:
    with pytest.raises(PolicyError, match=r"other\.npz: not a policy file .*control_interval_s"):
        load_policy(altered(control_interval_s=interval))
