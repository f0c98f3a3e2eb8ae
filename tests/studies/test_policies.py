from __future__ import annotations

import functools
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.agents.evaluation.episodes import Setting
from shaftline.agents.policy.pilot_adapter import ANSWERS, FEATURES, Reach
from shaftline.agents.policy.policy import Network, Policy, PolicyError, layout
from shaftline.plant import load_ship
from shaftline.studies.policies import cards, command, frontier
from shaftline.studies.policies.comparison import (
    ALL,
    QUANTITIES,
    Difference,
    difference,
    with_even_fuel,
)
from shaftline.studies.policies.recipes import seconds
from shaftline.studies.policies.targets import TARGETS, Target, met, verdicts


def silent(path: Path, task: str) -> Path:
    """A policy that answers nothing, and so sails the combinator's curve."""
    n = len(FEATURES)
    network = Network(
        np.zeros(n), np.ones(n), 10.0, (np.zeros((len(ANSWERS), n), np.float32),),
        (np.zeros(len(ANSWERS), np.float32),), "tanh", False, np.zeros(len(ANSWERS), np.float32),
    )  # fmt: skip
    recipe = {"task": task, "algorithm": "ppo", "reach": asdict(Reach()), "env_kwargs": {}}
    about = {"layout": layout(load_ship("frigate")), "ship_source": "frigate", "seed": 7,
             "control_interval_s": 0.5, "recipe": recipe, "leg": 2}  # fmt: skip
    curve = {name: [1.0, 2.0] for name in (
        "steps", "reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "seconds",
        "environment_share")}  # fmt: skip
    Policy(network, about, curve=curve).save(path)
    return path


@pytest.mark.parametrize("task", ["transit", "storm"])
def test_page_tables_figures_and_card_are_written(
    tmp_path: Path, task: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = silent(tmp_path / "silent.npz", task)
    command.main(
        ["--out", str(tmp_path / "out"), "--policy", str(path), "--seeds", "4", "--episode-s", "20",
         "--jobs", "1", "--cards"]
    )  # fmt: skip
    page = (tmp_path / "out/policies.md").read_text()
    pictures = {"pareto", "profiles", "torque", "envelope", "training"}
    pictures |= {"storm"} if task == "storm" else set()
    assert {file.stem for file in (tmp_path / "out").glob("*.png")} == pictures
    for name in pictures:
        assert f"]({name}.png)" in page
    asked = [target for target in TARGETS if target.task == task]
    assert page.count("**met**") + page.count("**not met**") == len(asked)
    episodes = pd.read_csv(tmp_path / "out/episodes.csv")
    assert set(episodes["seed"]) == {900_000, 900_001, 900_002, 900_003}
    table = pd.read_csv(tmp_path / "out/policies.csv")
    assert set(QUANTITIES) <= set(table.columns)
    assert (table["failed"] == 0.0).all()
    found = pd.read_csv(tmp_path / "out/differences.csv")
    assert (found["low"] <= found["high"]).all()
    one = found[(found["sea"] == ALL) & (found["quantity"] == "fuel_kg_nmi")].iloc[0]
    own, other = (
        episodes[episodes["controller"] == name].groupby("seed")["fuel_kg_nmi"].mean()
        for name in ("policy", one["baseline"])
    )
    assert one["difference"] == pytest.approx(np.sort(own - other)[1:3].mean(), rel=1e-3)
    card = path.with_suffix(".md").read_text()
    assert f"shaftline train --task {task} --algorithm ppo --seed 7 --out" in card
    assert "## Where it is worse" in card
    assert "left out" in capsys.readouterr().out


def test_a_controller_differs_from_itself_by_nothing() -> None:
    fuel = np.random.default_rng(0).normal(30.0, 3.0, 20)
    for quantity in ("fuel_kg_nmi", "failed"):
        found = difference("transit", "combinator", ALL, quantity, fuel, fuel)
        assert (found.difference, found.low, found.high, found.percent) == (0.0, 0.0, 0.0, 0.0)
        assert not found.excludes_zero
        assert not cards.worse(found)


def test_pairing_finds_what_the_spread_of_the_episodes_hides() -> None:
    rng = np.random.default_rng(1)
    fuel = rng.normal(30.0, 5.0, 50)
    found = difference("transit", "combinator", ALL, "fuel_kg_nmi", fuel - 0.3, fuel)
    assert found.difference == pytest.approx(-0.3)
    assert found.excludes_zero
    assert found.percent == pytest.approx(-1.0, abs=0.1)


def test_rare_things_are_judged_by_the_mean() -> None:
    none, some = np.zeros(20), np.where(np.arange(20) < 3, 10.0, 0.0)
    assert difference("storm", "combinator", ALL, "overspeed_s", some, none).difference == 1.5
    assert difference("storm", "combinator", ALL, "ventilation_s", some, none).difference == 0.0


def made(quantity: str, low: float, high: float, task: str = "transit") -> Difference:
    """Of a baseline that has 100."""
    middle = 0.5 * (low + high)
    apart = low > 0.0 or high < 0.0
    return Difference(
        task, "combinator", ALL, quantity, "IQM", middle, low, high, middle, low, high, apart
    )


@pytest.mark.parametrize(
    ("relation", "bound", "low", "high", "expected"),
    [
        ("below", 0.0, -2.0, -1.0, True),
        ("below", 0.0, -2.0, 0.5, False),
        ("below", 0.0, -2.0, 0.0, False),
        ("below", 1.0, -0.5, 0.9, True),
        ("below", 1.0, -0.5, 1.1, False),
        ("below", -20.0, -30.0, -21.0, True),
        ("below", -20.0, -30.0, -19.0, False),
        ("no more", 0.0, -1.0, 0.5, True),
        ("no more", 0.0, 0.1, 0.5, False),
        ("no less", 0.0, -1.0, 0.5, True),
        ("no less", 0.0, -1.0, -0.5, False),
    ],
)
def test_targets_are_met_by_intervals(
    relation: str, bound: float, low: float, high: float, expected: bool
) -> None:
    target = Target("transit", "combinator", "fuel_kg_nmi", "", relation, bound)  # type: ignore[arg-type]
    assert met(target, made("fuel_kg_nmi", low, high)) is expected


def test_verdicts_tell_numbers_and_only_of_what_was_sailed() -> None:
    (line,) = verdicts([made("fuel_kg_nmi", -3.0, -1.0)])
    assert line.startswith("- **met**: transit against combinator, less fuel per mile")
    assert "-2 (-3 to -1), -2.0 % (-3.0 to -1.0)" in line
    (line,) = verdicts([made("overload_s", 1.0, 3.0)])
    assert line.startswith("- **not met**")
    assert verdicts([made("fuel_kg_nmi", -3.0, -1.0, "speed-keeping")]) == []


def test_worse_knows_which_way_is_bad() -> None:
    assert cards.worse(made("fuel_kg_nmi", 1.0, 2.0))
    assert not cards.worse(made("fuel_kg_nmi", -1.0, 2.0))
    assert cards.worse(made("reward", -2.0, -1.0))
    assert cards.worse(made("thrust_mean_kN", -2.0, -1.0, "storm"))
    assert not cards.worse(made("thrust_mean_kN", -2.0, -1.0))


def test_fuel_at_equal_speed_asks_more_of_who_sails_slower() -> None:
    kpis = pd.DataFrame({name: [1.0, 1.0] for name in QUANTITIES if name != "fuel_even_kg_nmi"})
    kpis = kpis.assign(
        fuel_kg_nmi=30.0, speed_mean_m_s=[8.0, 7.6], speed_short_m_s=[0.0, 0.4], power_mean_kW=1.0
    )
    even = with_even_fuel(kpis, 1.5)["fuel_even_kg_nmi"]
    assert even.to_list() == pytest.approx([30.0, 30.0 * (8.0 / 7.6) ** 1.5])


def test_seconds_of_an_interrupted_training_add_up() -> None:
    assert seconds([10.0, 20.0, 30.0]) == 30.0
    assert seconds([10.0, 20.0, 12.0, 22.0]) == 42.0


def test_a_file_that_is_no_policy_is_refused(tmp_path: Path) -> None:
    (tmp_path / "p.npz").write_text("nothing")
    with pytest.raises(PolicyError, match="not a policy file"):
        command.sources(["transit"], [tmp_path / "p.npz"])


def test_sailing_slower_saves_fuel_and_costs_speed_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frontier, "Setting", functools.partial(Setting, episode_s=100.0))
    table = frontier.frontier(tmp_path, 3, 1, gains=(2.0,), offsets=(-0.05, -0.4))
    row = table.set_index("controller").loc["combinator"]
    assert (row["fuel"], row["speed_error"]) == (0.0, 0.0)  # against itself
    near, slow = (part for _, part in table[table["controller"] == "speed-pilot"].iterrows())
    assert slow["fuel"] < near["fuel"] - 2.0
    assert slow["speed_error"] > near["speed_error"] + 20.0
    assert len(frontier.drawn(table).axes[0].texts) == 4  # the optimiser lies outside the picture
