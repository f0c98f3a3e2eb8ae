"""A policy's file: what goes in comes out, and what does not belong here is refused."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import VecNormalize

import shaftline.agents
from shaftline.agents import run_episodes
from shaftline.agents.evaluation.controllers import label, load_controller
from shaftline.agents.evaluation.episodes import Setting
from shaftline.agents.learning.training import train
from shaftline.agents.policy.pilot_adapter import FEATURES
from shaftline.agents.policy.policy import Policy, PolicyError, load_policy
from shaftline.baselines.registry import ControllerError
from shaftline.plant import load_ship

from .tiny import recipe


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


def sailed(policy: Policy) -> Any:
    setting = Setting("policy", "transit", "state-5", "random-walk-kalman", 3, episode_s=10.0)
    return run_episodes(setting, policy)[1]


def test_what_is_saved_is_loaded(file: Path, tmp_path: Path) -> None:
    policy = shaftline.agents.load_policy(file)
    policy.save(tmp_path / "copy.npz")
    copied = load_policy(tmp_path / "copy.npz", load_ship("frigate"))
    assert copied.curve == policy.curve
    assert copied.about == policy.about
    assert np.array_equal(sailed(copied), sailed(policy), equal_nan=True)


def test_inference_is_that_of_stable_baselines3(file: Path) -> None:
    """On normalised features, mean answers agree to the float's last digits."""
    policy = load_policy(file)
    kind: Any = PPO if policy.about["recipe"]["algorithm"] == "ppo" else SAC
    stem = f"{policy.about['leg']:02d}"
    model = kind.load(file.parent / "checkpoints" / f"model-{stem}.zip", device="cpu")
    width = model.observation_space.shape[0]
    rng = np.random.default_rng(0)
    rows = np.zeros((50, width))
    spread = 2.0 * rng.standard_normal((50, len(FEATURES)))
    rows[:, : len(FEATURES)] = policy.network.mean + policy.network.deviation * spread
    normaliser = pickled(file.parent / "checkpoints" / f"normaliser-{stem}.pkl")
    expected, _ = model.predict(normaliser.normalize_obs(rows), deterministic=True)
    found = policy.network(rows[:, : len(FEATURES)].astype(np.float32))
    assert found == pytest.approx(expected, abs=1e-5)
    assert np.ptp(found, axis=0).min() > 1e-3


def pickled(path: Path) -> VecNormalize:
    with path.open("rb") as stream:
        found: VecNormalize = pickle.load(stream)
    return found


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
        ({"layout__format": 0}, "format: the policy has 0, here it is 1"),
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
    with pytest.raises(PolicyError, match="nowhere: no such policy file"):
        load_policy("nowhere")


def test_controllers_by_name(file: Path, altered: Any) -> None:
    ship = load_ship("frigate")
    assert isinstance(load_controller(f"policy:{file}", ship, 0.5), Policy)
    assert not isinstance(load_controller("combinator:response_s=3", ship, 0.5), Policy)
    with pytest.raises(ControllerError, match=r"'autopilot'; known: combinator, .*policy:FILE"):
        load_controller("autopilot", ship, 0.5)
    with pytest.raises(ControllerError, match="policy"):
        load_controller("policy:", ship, 0.5)
    with pytest.raises(PolicyError, match=r"control_interval_s: the policy has 0\.5 s, .* 1 s"):
        load_controller(f"policy:{file}", ship, 1.0)


def test_a_policy_in_a_known_file_has_another_label(file: Path, altered: Any) -> None:
    first = label(f"policy:{altered(seed=1)}")
    assert first.startswith("policy:")
    assert "/other.npz " in first
    assert label(f"policy:{altered(seed=1)}") == first
    assert label(f"policy:{altered(seed=2)}") != first
    assert label("combinator:response_s=3") == "combinator:response_s=3"


def test_policies_sail_without_torch(file: Path) -> None:
    lines = (
        "import sys",
        "from shaftline.agents import load_policy as load",
        f"load_policy({str(file)!r}).predict([8.0, 10.0, 1e5, 1.2, 20.0, 8.0, 7.0, 1.0])",
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True)
