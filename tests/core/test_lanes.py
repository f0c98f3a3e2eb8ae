"""Numbers of several ships at once: same bits as one ship, and errors where the ships disagree."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.core.compiled import compiled
from shaftline.core.lanes import (
    LANES,
    DisagreementError,
    are_alike,
    block_shape,
    box_shape,
    everywhere,
    fill_block,
    of_kind,
    one_by_one,
    put_lane,
    put_lanes,
    ships_of,
    take_lane,
    take_lanes,
    where,
)

RECORD = np.dtype(
    [
        ("gain", np.float64),
        ("kind", np.int64),
        ("curve", np.float64, (2, 3)),
        ("offset", np.float64),
        ("table", np.float64, (50,)),
        ("limit", np.float64),
    ],
    align=True,
)
BLOCK = block_shape(RECORD)
PAIR = (0.0, (0.0, 0.0))
BOX = box_shape(PAIR)


def ships(**fields: Any) -> Any:
    """Return records with random numbers above 0, some of them given."""
    rng = np.random.default_rng(5)
    made = np.zeros(LANES, RECORD)
    for name in ("gain", "curve", "offset", "table", "limit"):
        made[name] = rng.uniform(0.5, 2.0, made[name].shape)
    made["kind"] = 2
    for name, value in fields.items():
        made[name] = value
    return made


@one_by_one
@compiled
def looked_up(ship: Any, x: Any) -> Any:
    """Return a value whose index depends on the ship."""
    k = 0
    while k < 49 and ship.table[k] < 1.0 + 0.1 * x:
        k += 1
    return ship.table[k] + x, k * 1.0


@compiled
def equations(ship: Any, x: Any, y: Any) -> Any:
    """Return numbers from all operations of the lanes."""
    value = of_kind(0.0, x)
    if ship.kind == 2 and ship.gain > 0.0:
        value = ship.gain * x + ship.curve[1, 2] * y**3 - x / (2 + y * y)
    value += 1.5
    value -= ship.offset
    value = np.sqrt(abs(value)) + np.tanh(x) * np.arctan(y) + np.exp(-y * y)
    value = value + math.copysign(2.0, x) + np.floor(3.0 * y) + (1.0 + y * y) ** 0.7
    value = value + min(x, y) - max(ship.limit, y) + (-x) ** 2 + x**-2
    value = where(x.real < 0.1, value, 3.0 * value)
    found, steps = looked_up(ship, where(y > 0.0, x, y))
    return value, found, steps


@compiled
def all_at_once(records: Any, given: Any, block: Any, results: Any) -> bool:
    """Compute all ships at once; return whether they are alike."""
    fill_block(block, records, 0)
    x, y = take_lanes(given, (0.0, 0.0))
    put_lanes(results, equations(ships_of(block, records), x, y))
    return bool(are_alike(block, records))


@compiled
def alone(record: Any, x: float, y: float) -> Any:
    """Compute one ship."""
    return equations(record, x, y)


def test_results_are_equal_to_those_of_one_ship_to_the_bit() -> None:
    rng = np.random.default_rng(1)
    records, results = ships(), np.zeros(box_shape((0.0,) * 3))
    for _ in range(50):
        given = np.zeros(box_shape((0.0,) * 2))
        given[:, :2] = rng.uniform(-3.0, 3.0, (LANES, 2))
        assert all_at_once(records, given, np.zeros(BLOCK), results)
        one = [alone(records[i], *given[i, :2]) for i in range(LANES)]
        assert np.array_equal(results[:, :3], one)


@compiled
def branched(given: Any) -> float:
    """Take a branch that depends on the ship."""
    x, _ = take_lanes(given, (0.0, 0.0))
    return 1.0 if x > 0.0 else 2.0


def test_a_branch_on_which_the_ships_disagree_is_an_error() -> None:
    given = np.ones(box_shape((0.0,) * 2))
    assert branched(given) == 1.0
    given[:, 0] = -1.0
    assert branched(given) == 2.0
    given[-1, 0] = 1.0
    with pytest.raises(DisagreementError):
        branched(given)


@compiled
def _covers(given: Any) -> bool:
    x, _ = take_lanes(given, (0.0, 0.0))
    return everywhere(x > 0.0)


def test_everywhere_is_the_truth_of_all_ships() -> None:
    given = np.ones(box_shape((0.0,) * 2))
    assert _covers(given)
    given[2, 0] = -1.0
    assert not _covers(given)
    assert everywhere(True)
    assert not everywhere(False)


@compiled
def _alike(records: Any, block: Any) -> bool:
    fill_block(block, records, 0)
    return bool(are_alike(block, records))


@pytest.mark.parametrize(
    ("fields", "alike"),
    [
        ({}, True),
        ({"gain": [1.0, 2.0, 3.0, 4.0]}, True),
        ({"table": 0.0}, True),
        ({"kind": [2, 2, 2, 1]}, False),  # another equation
        ({"offset": [1.0, 1.0, 0.0, 1.0]}, False),  # one without the effect
        ({"offset": [1.0, -1.0, 1.0, 1.0]}, False),
        ({"offset": [0.0, 1.0, 1.0, 1.0]}, False),
    ],
)
def test_ships_are_alike_if_they_have_the_same_equations(
    fields: dict[str, Any], alike: bool
) -> None:
    assert _alike(ships(**fields), np.zeros(BLOCK)) == alike


@compiled
def _exceeds(records: Any, block: Any) -> bool:
    fill_block(block, records, 0)
    return bool(ships_of(block, records).limit > 1.0)


def test_a_parameter_is_compared_with_a_number_for_every_ship() -> None:
    assert _exceeds(ships(limit=1.5), np.zeros(BLOCK))
    assert not _exceeds(ships(limit=0.5), np.zeros(BLOCK))
    with pytest.raises(DisagreementError):
        _exceeds(ships(limit=[1.5, 0.5, 1.5, 1.5]), np.zeros(BLOCK))


@compiled
def _through(box: Any, out: Any) -> Any:
    for lane in range(LANES):
        put_lane(box, lane, (lane + 0.5, (lane * 10.0, 7.0)))
    first, (second, third) = take_lanes(box, PAIR)
    put_lanes(out, (third, (first, second)))
    return take_lane(out, 2, PAIR)


def test_boxes_keep_the_numbers_of_each_ship_apart() -> None:
    out = np.zeros(BOX)
    assert _through(np.zeros(BOX), out) == (7.0, (2.5, 20.0))
    assert out[:, 1].tolist() == [0.5, 1.5, 2.5, 3.5]


def test_functions_of_one_ship_are_called_from_python_too() -> None:
    ship = ships()[1]
    assert looked_up(ship, -50.0) == (ship["table"][0] - 50.0, 0.0)
    assert where(False, 1.0, 2.0) == 2.0
    assert of_kind(3.0, 1.0) == 3.0
