"""Controllers by name, classic ones and policies, and what they are called in tables."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shaftline.agents import PolicyError, load_controller, load_policy
from shaftline.agents.evaluation import episodes
from shaftline.agents.evaluation.episodes import known_controllers, label, version_of
from shaftline.agents.policy.policy import Policy, packaged_policies
from shaftline.baselines import SteeringController
from shaftline.baselines.registry import ControllerError
from shaftline.envs import get_task
from shaftline.plant import load_ship

SHIP = load_ship("frigate-at-sea")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A copy of a packaged policy."""
    path = tmp_path / "runs" / "mine.npz"
    path.parent.mkdir()
    path.write_bytes(packaged_policies()["rough-sea"].read_bytes())
    return path


def test_controllers_by_name(file: Path) -> None:
    assert isinstance(load_controller(f"policy:{file}", SHIP, 0.5), Policy)
    assert isinstance(load_controller("policy:rough-sea", SHIP, 0.5), Policy)
    assert not isinstance(load_controller("combinator", SHIP, 0.5), Policy)
    assert not isinstance(load_controller("combinator:response_s=3", SHIP, 0.5), Policy)


@pytest.mark.parametrize(
    ("text", "helmsman", "propulsion"),
    [
        ("va-pitch", "autopilot", "va-pitch"),
        ("autopilot:gain=2+combinator:response_s=1e+1", "autopilot", "combinator"),
        ("track-keeper+speed-pilot", "track-keeper", "speed-pilot"),
    ],
)
def test_a_task_with_a_rudder_gets_a_helmsman(text: str, helmsman: str, propulsion: str) -> None:
    task = get_task("course-keeping")
    found = load_controller(text, task.load_ship(), 0.5, task)
    assert isinstance(found, SteeringController)
    assert (found.helmsman.name, found.propulsion.name) == (helmsman, propulsion)
    assert label(text) == text
    with pytest.raises(ControllerError, match="unknown controller"):
        load_controller("autopilot+va-pitch", SHIP, 0.5, get_task("transit"))


@pytest.mark.parametrize("text", ["autopilot", "autopilot:gain=1", "policy", "policy:"])
def test_unknown_controllers_are_told_with_the_known(text: str) -> None:
    with pytest.raises(
        ControllerError, match=f"{text!r}; known: combinator, .*policy:FILE.npz, policy:"
    ):
        load_controller(text, SHIP, 0.5)


def test_a_policy_is_of_one_ship_and_one_interval(file: Path) -> None:
    with pytest.raises(
        PolicyError,
        match=r"mine.npz: .* control_interval_s: the policy has 0\.5 s, the environment 1 s",
    ):
        load_controller(f"policy:{file}", SHIP, 1.0)
    with pytest.raises(PolicyError, match="control_interval_s"):
        load_controller(f"policy:{file}", SHIP, 0.5 + 1e-6)
    assert load_controller(f"policy:{file}", SHIP, 0.5 + 1e-12)
    with pytest.raises(
        PolicyError, match="ship: the policy has 'frigate-at-sea', the environment 'ferry'"
    ):
        load_controller(f"policy:{file}", load_ship("ferry"), 0.5)


def test_what_is_known_names_the_packaged_policies() -> None:
    assert known_controllers().startswith("combinator, ")
    assert known_controllers().endswith(
        "policy:FILE.npz" + "".join(f", policy:{name}" for name in sorted(packaged_policies()))
    )
    assert {"rough-sea", "speed-keeping"} <= set(packaged_policies())


def test_a_policys_label_changes_with_its_file_and_with_what_sails_it(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = label(f"policy:{file}")
    assert first == f"policy:runs/mine.npz {version_of(file)}"
    assert label("policy:rough-sea") == f"policy:rough-sea {version_of(file)}"  # the same content
    assert label("combinator:response_s=3") == "combinator:response_s=3"
    policy = load_policy(file)
    policy.about = json.loads(json.dumps(policy.about)) | {"seed": 99}
    policy.save(file)
    assert label(f"policy:{file}") != first
    second = version_of(file)
    monkeypatch.setattr(
        episodes, "source_digest", lambda *places: "new" if places == ("agents/policy",) else ""
    )
    assert version_of(file) != second
