"""Every number of every kind of file: nan, infinity, a truth value and a text are refused by its key."""

from __future__ import annotations

import copy
import functools
import math
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w
import yaml

from shaftline.agents.learning.recipe import read_recipe
from shaftline.envs import get_task
from shaftline.mismatch.recordings.columns import load_map
from shaftline.mismatch.search.catalogue import parse_entries
from shaftline.plant import load_ship
from shaftline.plant.seas import get_sea, presets

pytest.importorskip("stable_baselines3")

ROOT = Path(__file__).parents[2]
TASK = "transit"
UNLIMITED = (
    "rate_limit",
    "torque_limit",
    "smoke_limit_N",
    "loading_limit_N",
    "supply_",
    "suction",
    "pressure_deg",
    "episode_end",
)
"""Parts of the names of keys whose own default is infinity."""

TEXTS = ("hull.mass_kg", "gamma", "gae_lambda", "ent_coef", "clip_range", "max_grad_norm")
"""Keys of which a text may be meant: a scale of the recording, and a number as YAML 1.1 reads 1e-3."""

Tree = dict[str, Any]


def _ship(tree: Tree, folder: Path) -> None:
    path = folder / "ship.toml"
    path.write_text(tomli_w.dumps(tree), encoding="utf-8")
    load_ship(path)


def _map(tree: Tree, folder: Path) -> None:
    path = folder / "map.toml"
    path.write_text(tomli_w.dumps(tree), encoding="utf-8")
    load_map(path)


def _effects(tree: Tree, folder: Path) -> None:
    parse_entries(tomli_w.dumps(tree), "mine.toml")


def _task(tree: Tree, folder: Path) -> None:
    get_task(tree)


def _recipe(tree: Tree, folder: Path) -> None:
    path = folder / "recipe.yml"
    path.write_text(yaml.safe_dump({TASK: tree}), encoding="utf-8")
    read_recipe("ppo", TASK, path)


def _toml(path: str) -> Tree:
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


def _task_tree() -> Tree:
    return {
        k: v
        for k, v in get_task(TASK).model_dump(mode="json", exclude_unset=True).items()
        if k != "ship"
    }


def _recipe_tree() -> Tree:
    tree: Tree = yaml.safe_load((ROOT / "agents/learning/recipes/ppo.yml").read_text())[TASK]
    numbers = {"ent_coef": 0.01, "gamma": 0.99, "frame_stack": 4}
    return tree | numbers | {"policy_kwargs": {}}


TERM = """
[[term]]
id = "mine"
acts_on = "resistance"
expression = "k * u"
state = "u"
rate = "(ship_speed - u) / tau"
[term.parameters]
k = 3.0
tau = { value = 2.0, unit = "s", low = 0.5, high = 9.0 }
"""
MAP = """
[columns]
"X" = { column = "fuel_rack_mm", unit = "mm", scale = 2.0, offset = 1.0, sign = -1 }
"Q" = { column = "motor_torque_N_m", unit = "N", radius_m = 1.0 }
[signals]
"B" = { signal = "drift", unit = "deg", scale = 1.0, offset = 0.5 }
[file]
header_row = 1
unit_row = 2
"""
EFFECTS = """
[[effect]]
id = "lag"
balance = "engine"
parameters = [{ key = "prime_mover.lag_s", probes = [0.3, 1.0], least = 0.1 }]
fixed = { "hull.mass_kg" = 3.0 }
[[term]]
id = "mine"
balance = "hull"
acts_on = "resistance"
expression = "k * ship_speed"
parameters = { k = { unit = "N", probes = [1.0], low = 0.0, high = 9.0, neutral = 0.0, least = 0.0 } }
"""


def _files() -> Iterator[tuple[str, Tree, Callable[[Tree, Path], None]]]:
    for path in sorted((ROOT / "plant/ships").glob("*.toml")):
        tree = _toml(f"plant/ships/{path.name}")
        if "term" not in tree:
            tree |= tomllib.loads(TERM)
        yield path.stem, tree, _ship
    yield "column map", tomllib.loads(MAP), _map
    yield "effects", tomllib.loads(EFFECTS), _effects
    yield "task", _task_tree(), _task
    yield "recipe", _recipe_tree(), _recipe


def _numbers(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(tree, bool):
        return
    if isinstance(tree, int | float):
        yield path
    elif isinstance(tree, dict | list | tuple):
        items = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, part in items:
            yield from _numbers(part, (*path, key))


def _with(tree: Tree, path: tuple[Any, ...], value: Any) -> Tree:
    changed = copy.deepcopy(tree)
    table = functools.reduce(lambda part, key: part[key], path[:-1], changed)
    table[path[-1]] = value
    return changed


def _refusal(read: Callable[[Tree, Path], None], tree: Tree, folder: Path) -> str:
    try:
        read(tree, folder)
    except ValueError as error:
        return str(error)
    return "accepted"


FILES = list(_files())


@pytest.mark.parametrize(("name", "tree", "read"), FILES, ids=[name for name, *_ in FILES])
def test_every_number_is_a_finite_one(
    name: str, tree: Tree, read: Callable[[Tree, Path], None], tmp_path: Path
) -> None:
    read(tree, tmp_path)
    paths = list(_numbers(tree))
    assert len(paths) > 5
    for path in paths:
        key = next(str(part) for part in reversed(path) if isinstance(part, str))
        for value in (math.nan, math.inf, -math.inf, True, "5"):
            if value == math.inf and any(part in key for part in UNLIMITED):
                continue
            if value == "5" and key in TEXTS:
                continue
            said = _refusal(read, _with(tree, path, value), tmp_path)
            assert key.split(".")[0] in said, (name, path, value, said)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "true"])
@pytest.mark.parametrize("key", ["hs", "tp", "gamma", "heading"])
def test_a_sea_by_its_numbers(key: str, value: str) -> None:
    numbers = {"hs": "3", "tp": "9"} | {key: value}
    with pytest.raises(ValueError, match="sea"):
        get_sea(",".join(f"{name}={number}" for name, number in numbers.items()))


def test_the_presets_are_seas() -> None:
    assert len(presets()) > 3
