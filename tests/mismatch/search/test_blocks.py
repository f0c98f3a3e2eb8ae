"""The grammar of formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.search.blocks import Block, Factor, join_blocks, make_blocks, unit_powers
from shaftline.plant.terms import Term

BETA, SPEED = Factor("beta"), Factor("speed")
SIZE = Factor("beta", "size")


def values() -> dict[str, Any]:
    rng = np.random.default_rng(2)
    return {"beta": rng.uniform(-0.3, 0.5, 400), "speed": rng.uniform(5.0, 9.0, 400)}


def test_what_blocks_share_is_taken_out_of_their_sum() -> None:
    linear, squared = Block.of(BETA), Block.of(BETA, SIZE)
    assert join_blocks([linear, squared], ["a", "b"]) == "(a + b * abs(beta)) * beta"
    assert join_blocks([linear, squared], ["a", "b"], words=True) == "(a + b |beta|) beta"
    apart = [Block.of(SPEED, SPEED, SPEED), Block(())]
    assert join_blocks(apart, ["a", "b"]) == "a * speed ** 3 + b"
    assert join_blocks([Block.of(SPEED, SPEED)], ["a"]) == "a * speed ** 2"


@pytest.mark.parametrize("block", make_blocks(values()), ids=lambda b: join_blocks([b], ["a"]))
def test_a_block_s_trace_is_what_its_expression_says(block: Block) -> None:
    signals = values()
    expression = join_blocks([block], ["a"])
    scope = {
        "a": 2.0,
        "abs": np.abs,
        "tanh": np.tanh,
        "max": np.maximum,
        "__builtins__": {},
        **signals,
    }
    told = eval(expression, scope) * np.ones(400)
    assert 2.0 * block.trace(signals) == pytest.approx(told, rel=1e-9, abs=1e-12)
    Term.model_validate(
        {"id": "t", "acts_on": "thrust", "expression": expression, "parameters": {"a": 0.0}}
    )


def test_of_blocks_that_are_alike_the_shortest_stays() -> None:
    signals = values()
    signals["thrust"] = 3.0 * signals["speed"]  # one that follows from another
    found = make_blocks(signals)
    assert Block.of(SPEED) in found
    assert Block.of(Factor("thrust")) not in found
    assert Block.of(Factor("thrust"), Factor("thrust")) not in found
    assert Block.of(Factor("speed", "size")) not in found  # it never turns
    assert Block.of(SIZE) in found


def test_a_signal_that_stands_still_is_left_out() -> None:
    signals = values() | {"draught": np.full(400, 4.5)}
    assert not [b for b in make_blocks(signals) if "draught" in b.signals]


def test_a_sign_has_no_unit_and_a_bend_has_its_signal_s() -> None:
    units = {"beta": "rad", "speed": "m/s"}
    assert Block.of(Factor("beta", "sign", 0.02), SPEED).unit(units) == unit_powers("m/s")
    assert Block.of(Factor("speed", "over", 6.0), SPEED).unit(units) == unit_powers("m2/s2")


def test_two_signals_and_numbers_make_a_block_longer() -> None:
    assert Block.of(SPEED, SPEED).length < Block.of(SPEED, BETA).length
    assert Block.of(SPEED).length < Block.of(Factor("speed", "over", 6.0)).length
    assert Block.of(SPEED, SPEED).length < Block.of(Factor("resistance")).length + 1
