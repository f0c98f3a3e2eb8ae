"""The study of policies: what is sailed, said and drawn, and whether what was asked for is met."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.agents.policy.policy import PolicyError
from shaftline.agents.policy.residual import Form
from shaftline.envs import get_task
from shaftline.studies.policies import command, page
from shaftline.studies.policies.bound import BOUND, bound
from shaftline.studies.policies.comparison import (
    BASELINES,
    HELD,
    POLICY,
    SHOWN,
    TUNED,
    Difference,
    compare,
)
from shaftline.studies.policies.targets import TARGETS, Target, met, rows

from ..agents.tiny import plain_policy

CURVE = {"steps": [1.0, 2.0], "reward": [-3.0, -2.0], "seconds": [5.0, 9.0]}


def files(folder: Path, task: str = "rough-sea", count: int = 2) -> list[Path]:
    """Trainings that say nothing, and so sail as their base does."""
    paths = [folder / task / f"seed-{k}" / "policy.npz" for k in range(9, 9 + count)]
    for path in paths:
        policy = plain_policy(task)
        policy.curve = CURVE
        policy.save(path)
    return paths


def test_trainings_are_found_by_task_in_the_order_of_their_seeds(tmp_path: Path) -> None:
    paths = files(tmp_path)
    assert [p.parent.name for p in paths] == ["seed-9", "seed-10"]
    assert command.sources(tmp_path) == {"rough-sea": paths}
    (tmp_path / "flank").symlink_to(tmp_path / "rough-sea")
    with pytest.raises(PolicyError, match="made for 'rough-sea', not for 'flank'"):
        command.sources(tmp_path)
    paths[0].write_text("nothing")
    with pytest.raises(PolicyError, match="not a policy file"):
        command.sources(tmp_path)


def test_policies_whose_answers_are_zero_are_their_base(tmp_path: Path) -> None:
    """Every episode of either training, figure by figure, and none of it differs from itself."""
    one = compare("rough-sea", files(tmp_path), tmp_path / "kept", seeds=3, episode_s=20.0, jobs=1)
    assert list(one.kpis) == [POLICY, *BASELINES, TUNED]
    assert np.array_equal(one.kpis[TUNED]["reward"][0], one.kpis[POLICY]["reward"][0])
    assert {one.kpis[POLICY][name].shape for name in SHOWN} == {(2, 3)}
    assert {one.kpis[HELD][name].shape for name in SHOWN} == {(1, 3)}
    other = plain_policy("rough-sea", Form(base="va-pitch"))
    other.save(tmp_path / "other.npz")
    with pytest.raises(PolicyError, match=r"different bases: speed-pilot.* and va-pitch"):
        compare("rough-sea", [*files(tmp_path), tmp_path / "other.npz"], tmp_path, seeds=1)
    for name in SHOWN:
        assert np.array_equal(*one.kpis[POLICY][name])
    table = one.table.set_index("controller")
    assert table["wave_torque_kN_m"][POLICY] == pytest.approx(
        np.mean(one.kpis[POLICY]["wave_torque_kN_m"])
    )
    against = {d.baseline: d for d in one.differences if d.quantity == "wave_engine_torque_kN_m"}
    assert against[HELD].percent < -30.0  # the base leaves the waves to the shaft's inertia
    assert against[HELD].percent_low <= against[HELD].percent <= against[HELD].percent_high


def test_page_tables_figures_and_cards_are_written(tmp_path: Path) -> None:
    paths = files(tmp_path)
    one = compare("rough-sea", paths, tmp_path / "kept", seeds=3, episode_s=110.0, jobs=1)
    shares = pd.DataFrame({"controller": [BOUND, POLICY], "share": [100.0, 61.0]})
    shares = shares.assign(**dict.fromkeys(SHOWN, 1.5))
    page.write(tmp_path / "page", [one], {"rough-sea": shares})
    text = (tmp_path / "page/policies.md").read_text()
    for name in ("changes.png", "curves.png", "rough-sea.png"):
        assert f"]({name})" in text
        assert (tmp_path / "page" / name).is_file()
    asked = [target for target in TARGETS if target.task == "rough-sea"]
    assert text.count("| met |") + text.count("| **short** |") == len(asked) == 6
    assert "61.00" in text
    for name in ("policies", "differences", "bound-rough-sea"):
        assert (tmp_path / "page" / f"{name}.csv").is_file()
    card = page.card(one, paths[1])
    assert "shaftline train --task rough-sea --algorithm ppo --seed 0" in card
    assert f"Goals of the reward: {', '.join(get_task('rough-sea').goals.used)}." in card


def test_a_target_is_met_where_the_whole_interval_is() -> None:
    target = Target("rough-sea", HELD, "wave_torque_kN_m", -100.0, -30.0)
    for low, high, expected in (
        (-40.0, -31.0, True),
        (-40.0, -29.0, False),
        (-101.0, -31.0, False),
    ):
        found = Difference("rough-sea", HELD, "wave_torque_kN_m", -35.0, low, high)
        assert met(target, found) is expected
        (row,) = rows([found])
        assert row[""] == ("met" if expected else "**short**")
        assert row["asked for"] == "-30 %"
    assert not met(target, Difference("", "", "", *[float("nan")] * 3))


@pytest.mark.slow
def test_a_plan_is_the_bound_and_shares_are_of_its_gap(tmp_path: Path) -> None:
    table = bound("rough-sea", files(tmp_path)[0], tmp_path / "plans", seeds=1, jobs=1)
    by = table.set_index("controller")
    assert by["share"][BOUND] == pytest.approx(100.0)
    assert by["share"][HELD] == pytest.approx(0.0)
    assert (by["reward"][BOUND] > by["reward"].drop(BOUND)).all()
    assert by["wave_torque_kN_m"][BOUND] < 0.7 * by["wave_torque_kN_m"][HELD]
