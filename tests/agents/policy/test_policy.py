"""A policy's file: what goes in comes out, and what does not belong here is refused."""

from __future__ import annotations

import copy
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents import Policy, PolicyError, Setting, load_policy, run_episodes, train
from shaftline.agents.learning.checkpoints import Checkpoints
from shaftline.agents.learning.recipe import Recipe
from shaftline.agents.learning.training import built
from shaftline.agents.policy.policy import Network, layout, trained, trained_on
from shaftline.agents.policy.residual import ANSWERS, Form, Residual
from shaftline.baselines.controller import OBSERVED
from shaftline.plant import load_ship

from ..tiny import recipe

FEATURES = Form().features


@pytest.fixture(scope="module", params=["ppo", "sac"])
def file(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    return train(recipe(request.param), 0, folder, device="cpu")


@pytest.fixture
def altered(file: Path, tmp_path: Path) -> Any:
    """The file with another ``about``."""

    def altered(**changes: Any) -> Path:
        policy = load_policy(file)
        about = copy.deepcopy(policy.about)
        for dotted, value in changes.items():
            *path, key = dotted.split("__")
            section: Any = about
            for part in path:
                section = section[part]
            section[key] = value
        policy.about = about
        policy.save(tmp_path / "other.npz")
        return tmp_path / "other.npz"

    return altered


def network(**changes: Any) -> Network:
    """A small network of known numbers: two features are heard, two answers given."""
    first = np.zeros((2, len(FEATURES)), np.float32)
    first[0, 0], first[1, 1] = 1.0, -2.0
    last = np.zeros((len(ANSWERS), 2), np.float32)
    last[0, 0], last[1, 1] = 0.5, 1.5
    fields: dict[str, Any] = {
        "mean": np.full(len(FEATURES), 1.0), "deviation": np.full(len(FEATURES), 2.0), "clip": 3.0,
        "weights": (first, last),
        "biases": tuple(
            np.asarray(own, np.float32) for own in ([0.25, 0.0], [0.0, 0.1])
        ),
        "activation": "tanh", "squashed": False,
        "log_deviation": np.asarray([-1.0, -2.0], np.float32),
    }  # fmt: skip
    return Network(**(fields | changes))


@pytest.mark.parametrize("squashed", [False, True])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_network_by_hand(activation: str, squashed: bool) -> None:
    act: Any = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}[activation]
    features = np.ones((3, len(FEATURES)), np.float32)
    features[:, 0] = 2.0, 99.0, -99.0  # (x - 1) / 2, at most 3 to either side
    features[:, 1] = 0.0, 1.0, -99.0
    heard = np.array([[0.5, -0.5], [3.0, 0.0], [-3.0, -3.0]])
    hidden = act(np.stack([heard[:, 0] + 0.25, -2.0 * heard[:, 1]], axis=1))
    raw = np.zeros((3, len(ANSWERS)))
    raw[:, 0], raw[:, 1] = 0.5 * hidden[:, 0], 1.5 * hidden[:, 1] + 0.1
    expected = np.tanh(raw) if squashed else np.clip(raw, -1.0, 1.0)
    assert np.abs(raw).max() > 1.0  # something is there to be held
    found = network(activation=activation, squashed=squashed)(features)
    assert found == pytest.approx(expected, rel=1e-6)


def test_a_feature_that_never_varied_is_not_heard() -> None:
    deviation = np.full(len(FEATURES), 2.0)
    deviation[0] = np.inf
    deaf = network(deviation=deviation)
    features = np.ones((2, len(FEATURES)), np.float32)
    features[1, 0] = 1e6
    assert np.array_equal(*deaf(features))


ABOUT = {
    "control_interval_s": 0.5, "ship_source": "frigate", "seed": 7,
    "layout": layout(load_ship("frigate"), Form()),
    "recipe": {"algorithm": "ppo", "task": "transit", "form": {"pitch_reach": 0.1}},
}  # fmt: skip


def test_a_policy_is_its_network_between_the_adapters_ears_and_hands() -> None:
    policy = Policy(network(), ABOUT)
    adapter = Residual(load_ship("frigate"), 0.5, Form(pitch_reach=0.1))
    rows = np.asarray([[8.0, 10.0, 1e5, 1.2, 20.0, 8.1, 7.0, 1.0]] * 2, np.float32)
    memory = other = None
    for k in range(6):
        rows[0, 1] = 10.0 + 0.1 * k
        starts = np.array([k == 3, False])
        action, memory = policy.predict(rows, memory, starts)
        features, other = adapter.see(rows, other, starts)
        expected = adapter.command(policy.network(features), rows, other)
        assert np.array_equal(action, expected)
        assert np.array_equal(memory, other)


def test_a_policy_that_is_not_deterministic_tries_about_its_answers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy, tried = Policy(network(), ABOUT), []
    command = policy.adapter.set_points

    def noting(answer: Any, *rest: Any) -> Any:
        tried.append(answer[0])
        return command(answer, *rest)

    monkeypatch.setattr(policy.adapter, "set_points", noting)
    row = np.asarray([[8.0, 10.0, 1e5, 1.2, 20.0, 8.1, 7.0, 1.0]], np.float32)
    for _ in range(400):
        policy.predict(row, deterministic=False)
    noise = np.array(tried) - policy.network(policy.adapter.see(row)[0])[0]
    assert np.std(noise, axis=0) == pytest.approx(np.exp([-1.0, -2.0]), rel=0.15)
    assert np.abs(np.mean(noise, axis=0) / np.exp([-1.0, -2.0])).max() < 0.2


def test_what_a_policy_says_of_itself() -> None:
    curve = {"reward": [-9.0, -7.25], "failed": [0.0, 0.0]}
    policy = Policy(network(), ABOUT, curve=curve)
    assert policy.summary().splitlines() == [
        "PPO on transit, ship frigate, seed 7, a command every 0.5 s",
        "reward -7.25, failed 0",
    ]
    assert Policy(network(), ABOUT).summary() == policy.summary().splitlines()[0]
    assert policy.to_dict() == ABOUT | {"curve": curve}
    assert json.loads(json.dumps(policy.to_dict())) == policy.to_dict()


def test_the_layout_is_all_that_a_policy_rests_on() -> None:
    ferry = load_ship("ferry")
    found = layout(ferry, Form(history=3))
    assert found["ship"] == "ferry"
    assert found["format"] == 2
    assert found["ranges"]["gear_ratio"] == ferry.transmission.gear_ratio
    assert set(found["ranges"]) == {
        "pitch_ratio_min", "pitch_ratio_max", "drive_min", "drive_max", "gear_ratio",
        "engine_speed_min", "engine_speed_max",
    }  # fmt: skip
    assert (found["observed"], found["features"], found["answers"]) == (
        list(OBSERVED), list(Form(history=3).features), list(ANSWERS),
    )  # fmt: skip


def test_a_policy_of_the_storm_belongs_to_the_storms_ship() -> None:
    about = ABOUT | {"recipe": {"algorithm": "ppo", "task": "storm", "form": {}}}
    assert trained_on(about).propeller.depth_m == 3.0
    assert trained_on(ABOUT) == load_ship("frigate")
    assert Policy(network(), about).adapter.ship == trained_on(about)
    assert Policy(network(), about, load_ship("frigate")).adapter.ship == load_ship("frigate")


@pytest.mark.parametrize("name", sorted(trained()))
def test_packaged_policies_load_by_name(name: str) -> None:
    policy = load_policy(name)
    assert policy.about["recipe"]["task"] == name
    assert name in policy.summary()
    action, _ = policy.predict([8.0, 10.0, 1e5, 1.2, 20.0, 8.0, 7.0, 1.0])
    assert np.isfinite(action).all()


def sailed(policy: Policy) -> Any:
    setting = Setting("policy", "transit", "state-5", "random-walk-kalman", 3, episode_s=10.0)
    return run_episodes(setting, policy)[1]


def test_what_is_saved_is_loaded(file: Path, tmp_path: Path) -> None:
    policy = load_policy(file)
    policy.save(tmp_path / "copy.npz")
    copied = load_policy(tmp_path / "copy.npz", load_ship("frigate"))
    assert copied.curve == policy.curve
    assert copied.about == policy.about
    assert np.array_equal(sailed(copied), sailed(policy), equal_nan=True)


def test_inference_is_that_of_stable_baselines3(file: Path) -> None:
    """On normalised features, mean answers agree to the float's last digits."""
    policy = load_policy(file)
    progress = Checkpoints(file.parent)
    made = Recipe.model_validate(policy.about["recipe"])
    model, venv, _ = built(made, 7, policy.about["ship_source"], "cpu", 1)
    progress.go_on(model, venv)
    width = model.observation_space.shape[0]
    rng = np.random.default_rng(0)
    rows = np.zeros((50, width))
    spread = 2.0 * rng.standard_normal((50, len(FEATURES)))
    rows[:, : len(FEATURES)] = policy.network.mean + policy.network.deviation * spread
    expected, _ = model.predict(venv.normalize_obs(rows), deterministic=True)
    found = policy.network(rows[:, : len(FEATURES)].astype(np.float32))
    assert found == pytest.approx(expected, abs=1e-5)
    assert np.ptp(found, axis=0).min() > 1e-3


def test_one_observation_and_noise(file: Path) -> None:
    policy = load_policy(file)
    row = np.array([8.0, 10.0, 1e5, 1.2, 20.0, 8.0, 7.0, 1.0], np.float32)
    single, _ = policy.predict(row)
    batch, _ = policy.predict(np.stack([row, row]))
    noisy, _ = policy.predict(row, deterministic=False)
    assert single.shape == (2,)
    assert batch[1] == pytest.approx(single, abs=1e-6)
    assert not np.array_equal(noisy, single)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"layout__format": 0}, "format: the policy has 0, here it is 2"),
        ({"layout__ship": "launch"}, "ship: the policy has 'launch', here it is 'frigate'"),
        ({"layout__ranges__drive_max": 1.0}, "drive_max: the policy has 1.0"),
        ({"layout__observed": ["torque"]}, r"observed: the policy has \['torque'\]"),
        ({"layout__features": []}, r"features: the policy has \[\]"),
    ],
)
def test_another_layout_is_refused(altered: Any, change: dict[str, Any], words: str) -> None:
    with pytest.raises(PolicyError, match=rf"other\.npz: this policy does not fit: .*{words}"):
        load_policy(altered(**change))


def test_another_ship_is_refused(file: Path) -> None:
    with pytest.raises(PolicyError, match="ship: the policy has 'frigate', here it is 'ferry'"):
        load_policy(file, load_ship("ferry"))
    shifted = load_ship("frigate").with_values({"propeller.pitch_ratio_max": 1.35})
    with pytest.raises(PolicyError, match="pitch_ratio_max: the policy has"):
        load_policy(file, shifted)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a | {"weight_0": a["weight_0"] * np.nan}, "a weight is not finite"),
        (lambda a: a | {"deviation": a["deviation"] * 0.0}, "a weight is not finite"),
        (lambda a: a | {"weight_0": a["weight_0"][:, 1:]}, "its layers do not fit together"),
        (lambda a: a | {"weight_0": a["weight_0"].astype(complex)}, "real numbers are needed"),
        (lambda a: a | {"weight_0": np.array(["a", "b"])}, "real numbers are needed"),
        (lambda a: a | {"mean": a["mean"][:, None]}, "its normalisation does not fit"),
        (
            lambda a: a | {"log_deviation": np.zeros(3, np.float32)},
            "its normalisation does not fit",
        ),
        (lambda a: {k: v for k, v in a.items() if not k.startswith("weight")}, "real numbers"),
        (lambda a: {k: v for k, v in a.items() if k != "bias_0"}, "bias_0"),
    ],
)
def test_a_network_that_cannot_answer_is_refused(
    file: Path, tmp_path: Path, change: Any, words: str
) -> None:
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(tmp_path / "other.npz", **change(arrays))
    with pytest.raises(PolicyError, match=rf"other\.npz: not a policy file .*{words}"):
        load_policy(tmp_path / "other.npz")


def test_a_policy_that_does_not_say_what_it_was_made_for_is_refused(
    file: Path, tmp_path: Path
) -> None:
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    about = json.loads(bytes(arrays["about"]).decode())
    for lost in ("recipe", "control_interval_s"):
        text = json.dumps({k: v for k, v in about.items() if k != lost}).encode()
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
        PolicyError, match=r"nowhere: no such policy file; with .* come .*rough-sea"
    ):
        load_policy("nowhere")


def test_a_damaged_policy_is_refused_or_still_a_policy(tmp_path: Path) -> None:
    """Whatever bit of the file has flipped, wherever it ends."""
    content = trained()["rough-sea"].read_bytes()
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
    with pytest.raises(
        PolicyError, match=r"other\.npz: not a policy file .*control_interval_s = \S+ s: must be"
    ):
        load_policy(altered(control_interval_s=interval))
