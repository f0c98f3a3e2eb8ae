"""The study of standard learners: references, bounds, scores and trainings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reproductions.learners import bounds, page, references, trainings
from reproductions.learners.bounds import STARTS, STEPS
from reproductions.learners.references import (
    CONSTANT,
    CONTROLLERS,
    FIRST_SEED,
    HOLD,
    RANDOM,
    TUNED,
)
from reproductions.learners.trainings import Learner
from shaftline.agents import load_policy
from shaftline.envs import tasks

TASK = "flank"


@pytest.mark.parametrize("task", [TASK, "course-keeping"])
def test_references_are_the_classic_controllers_and_policies_that_look_at_nothing(
    task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(references, "_GRID", 2)
    monkeypatch.setattr(references, "_SEARCH_EPISODES", 1)
    names = references.names_of(task)
    assert names == (*CONTROLLERS, TUNED, HOLD, CONSTANT, RANDOM)
    for name in names:
        controller = references.reference(task, name)
        one = references.returns_of(controller, task, episodes=2, steps=20)
        assert len(one.values) == 2, name
        assert 0.0 < min(one.values) <= max(one.values) <= 20.0, name


def test_a_policy_that_holds_keeps_the_first_commands() -> None:
    hold = references.reference(TASK, HOLD)
    rows, _ = hold.predict(np.ones((3, 15)))
    assert rows.tolist() == [[0.0, 0.0]] * 3


def found_of(task: str, plans: dict[str, list[float]], **returns: list[list[float]]) -> Any:
    """Return results as a run keeps them: plans by start, and episodes by controller."""
    seeds = range(len(next(iter(plans.values()))))
    found: dict[str, Any] = {
        f"bound_{task}_{seed}_{start}": {"return": values[seed], "gradients": 9}
        for start, values in plans.items()
        for seed in seeds
    }
    found[f"same_{task}"] = {"combinator": 100.0, TUNED: 220.0}
    for name, rows in returns.items():
        for k, row in enumerate(rows):
            cell = {part: {"values": row, "failed": 0.0} for part in ("", ":held-out")}
            key = f"{name}_{task}_{k}_900" if name == "ppo" else f"reference_{task}_{name}"
            found[key] = cell | {"curve": [[0, 1.0, 0.0], [900, 2.0, 0.0]]}
    return found


PLANS = dict(
    zip(STARTS, ([300.0, 320.0], [310.0, 280.0], [290.0, 300.0], [300.0, 330.0]), strict=True)
)


@pytest.fixture(autouse=True)
def _small_budgets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "PLANNED", 2)
    monkeypatch.setitem(page.INTERVALS, "ppo", 900)


JUDGED = {"combinator": [[150.0, 160.0]], "tuned-controller": [[230.0, 250.0]]}
"""Episodes of 600 intervals; the tuned controller gets 220 of 400 in the planned ones."""


def test_the_bound_is_what_the_best_starts_gain_over_the_tuned_controller() -> None:
    bound = page.bound_of(TASK, found_of(TASK, PLANS, **JUDGED))
    assert bound is not None
    assert bound.combinator == pytest.approx(155.0 / 600.0)
    assert bound.tuned == pytest.approx(240.0 / 600.0)
    assert bound.best == pytest.approx(240.0 / 600.0 + (320.0 - 220.0) / STEPS)
    assert bound.spread == pytest.approx((20.0 + 50.0) / 2.0 / STEPS)
    assert bound.score(bound.best) == pytest.approx(1.0)
    assert bound.score(bound.combinator) == 0.0
    whole = found_of(TASK, PLANS, **JUDGED)
    for end in (STARTS[0], "tuned-controller"):
        lacking = {k: v for k, v in whole.items() if not k.endswith(end)}
        assert page.bound_of(TASK, lacking) is None


def test_scores_and_gains_are_against_the_combinator_in_the_same_episodes() -> None:
    found = found_of(
        TASK,
        PLANS,
        ppo=[[250.0, 260.0], [255.0, 265.0]],
        **{"va-pitch": [[200.0, 210.0]]},
        **JUDGED,
    )
    table = page.table_of([TASK], found).set_index(["task", "controller"])
    row = table.loc[TASK, "ppo"]
    assert row["trainings"] == 2
    assert row["return"] == pytest.approx(257.5)
    assert row["gain"] == pytest.approx(102.5)
    assert row["gain_low"] < 102.5 < row["gain_high"]
    gap = 240.0 / 600.0 + 100.0 / STEPS - 155.0 / 600.0
    assert row["score"] == pytest.approx(102.5 / 600.0 / gap)
    assert table.loc[TASK, "combinator"]["score"] == 0.0
    assert np.isnan(table.loc[f"{TASK}:held-out", "ppo"]["score"])


def test_the_page_says_who_beats_whom(tmp_path: Path) -> None:
    found = found_of(
        TASK,
        PLANS,
        combinator=[[150.0, 160.0, 155.0, 151.0]],
        ppo=[[250.0, 260.0, 254.0, 252.0], [255.0, 265.0, 250.0, 251.0]],
        **{"va-pitch": [[200.0, 210.0, 204.0, 202.0]]},
    )
    text = page.write(tmp_path, [TASK], found).read_text()
    assert "| flank | ppo | 2 | +101" in text
    assert "| yes | va-pitch 204 | yes |" in text
    assert "Control intervals: ppo 900." in text
    assert (tmp_path / "figures" / "learners.png").stat().st_size > 10_000


def test_shorter_trainings_are_listed_apart_and_do_not_count(tmp_path: Path) -> None:
    classic = {"va-pitch": [[200.0, 210.0]], **JUDGED}
    whole = found_of(TASK, PLANS, ppo=[[250.0, 260.0]], **classic)
    short = {key.replace("_900", "_300"): cell for key, cell in whole.items()}
    text = page.write(tmp_path, [TASK], short).read_text()
    assert "## Shorter trainings" in text
    assert "| flank | ppo | 300 | 1 | 255 | +100 (" in text
    assert "| flank | ppo | 1 |" not in text  # no row among the trainings with the whole budget
    assert "Shorter trainings" not in page.write(tmp_path, [TASK], whole).read_text()


def test_every_task_and_seed_is_trained() -> None:
    found = page.learners(["ppo", "sac"], list(tasks(None)), 2, Path("kept"))
    assert len(found) == 2 * 2 * len({**tasks(), **tasks(steered=True)})
    assert len({one.name for one in found}) == len(found)
    assert [one.seed for one in found] == sorted(one.seed for one in found)
    assert {one.steps for one in found} == {page.INTERVALS["ppo"], page.INTERVALS["sac"]}


@pytest.mark.parametrize("algorithm", ["ppo", "td3"])
def test_a_training_keeps_its_curve_and_its_policy(
    algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trainings, "POINTS", 1)
    monkeypatch.setattr(trainings, "CURVE_EPISODES", 1)
    plain = references.returns_of

    def short(controller: Any, task: str, episodes: int = 1, first_seed: int = FIRST_SEED) -> Any:
        return plain(controller, task, 1, first_seed, steps=10)

    monkeypatch.setattr(trainings, "returns_of", short)
    learner = Learner(TASK, algorithm, 1, 120, str(tmp_path))
    found = trainings.train_cell(learner)
    steps = 2048 if algorithm == "ppo" else 120
    assert [row[0] for row in found["curve"]] == [0, steps]
    assert len(found[""]["values"]) == len(found[":held-out"]["values"]) == 1
    policy = load_policy(tmp_path / f"{learner.name}.npz")
    assert policy.about["recipe"]["task"] == TASK
    again = plain(policy, TASK, 1, FIRST_SEED, steps=10)
    assert again.values == pytest.approx(found[""]["values"], rel=1e-4)


def test_a_plan_gains_on_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "STEPS", 20)
    monkeypatch.setattr(bounds, "ROUNDS", 10)
    monkeypatch.setattr(bounds, "EPISODES", 1)
    same = bounds.same_episodes(TASK)
    seed = FIRST_SEED
    plan = bounds.plan_cell((TASK, seed, "combinator"))
    assert plan["return"] > same["combinator"]
    assert len(bounds.cells(TASK)) == len(STARTS)
