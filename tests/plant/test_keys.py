"""How a number is declared, and what its declaration says."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
import pytest
from pydantic import BaseModel, Field, TypeAdapter

from shaftline.core.models import allowed_range
from shaftline.plant import load_ship, ship_names
from shaftline.plant.keys import (
    KeyInfo,
    MissingKeyError,
    Section,
    ShipParameter,
    effect,
    info_of,
    parameter,
    record_field,
    require,
    unit_of,
)


class Part(Section):
    plain: float = parameter("a length", "m", record="length", gt=0, le=15)
    upper: float = parameter("a share", record="share", ge=-0.2, lt=0.6, default=0.1)
    free: float = parameter("anything", record="free", default=2.0)
    absent: float = effect(math.inf, "a limit", "1/s", record="limit", gt=0)
    outside: int = Field(default=4, ge=2, le=7)
    bare: str = "word"


FIELDS = Part.model_fields


@pytest.mark.parametrize(
    ("key", "info"),
    [
        ("plain", ("m", 0.0, 15.0, None, True, False)),
        ("upper", ("-", -0.2, 0.6, None, False, True)),
        ("free", ("-", -math.inf, math.inf, None, False, False)),
        ("absent", ("1/s", 0.0, math.inf, math.inf, True, False)),
        ("outside", ("-", 2.0, 7.0, None, False, False)),
        ("bare", ("-", -math.inf, math.inf, None, False, False)),
    ],
)
def test_a_key_has_unit_range_and_neutral_value(key: str, info: tuple[Any, ...]) -> None:
    assert info_of(FIELDS[key])[:6] == info
    assert unit_of(FIELDS[key]) == info[0]


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("plain", "> 0 and <= 15"),
        ("upper", ">= -0.2 and < 0.6"),
        ("free", "any number"),
        ("absent", "> 0"),
        ("outside", ">= 2 and <= 7"),
    ],
)
def test_a_range_in_words(key: str, words: str) -> None:
    assert allowed_range(FIELDS[key]) == words


def test_a_number_has_a_field_in_the_record() -> None:
    found = {key: record_field(info) for key, info in FIELDS.items()}
    assert found == {
        "plain": "length",
        "upper": "share",
        "free": "free",
        "absent": "limit",
        "outside": None,
        "bare": None,
    }


def test_an_effect_is_neutral_unless_said_otherwise() -> None:
    part = Part(plain=3.0)
    assert (part.absent, part.upper) == (math.inf, 0.1)
    assert FIELDS["plain"].is_required()


def test_a_section_fills_its_fields_and_no_others() -> None:
    record: dict[str, float] = {}
    Part(plain=3.0, absent=0.5).fill(record)
    assert record == {"length": 3.0, "share": 0.1, "free": 2.0, "limit": 0.5}


@pytest.mark.parametrize("wrong", [{"plain": "3"}, {"plain": 3.0, "more": 1}, {}, {"plain": True}])
def test_a_section_takes_only_its_keys_and_only_numbers(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"plain|more"):
        Part(**wrong)


def test_a_section_stays_as_it_is() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Part(plain=3.0).plain = 4.0


def test_the_first_key_that_is_left_out_is_named() -> None:
    class Pair(BaseModel):
        a: float = 0.0
        b: float = 0.0
        c: float = 0.0

    require(Pair(a=0.0, b=0.0), ("a", "b"), "always")
    with pytest.raises(ValueError, match=r"^b is missing; it is required with a \(unit -"):
        require(Pair(a=1.0), ("a", "b", "c"), "with a")
    with pytest.raises(MissingKeyError, match=r"^pair\.c is missing; .* allowed: any number\)$"):
        require(Pair(a=1.0), ("c",), "with a", "pair.")


@pytest.mark.parametrize("place", [(), (1, 2)])
def test_a_number_is_written_to_its_place_and_read_from_it(place: tuple[int, ...]) -> None:
    record = {"length": np.zeros((2, 3)) if place else np.zeros(())}
    number = ShipParameter("part.plain", 3.0, KeyInfo("m", 0.0, 15.0, None), "length", place)
    number.write(record, 4.0)
    assert number.read(record) == np.sum(record["length"]) == 4.0


@pytest.mark.parametrize("value", [1e-6, 3.0, 15.0])
def test_a_search_keeps_off_an_excluded_bound_only(value: float) -> None:
    low, high = ShipParameter("part.plain", value, info_of(FIELDS["plain"]), "length").search_range
    assert 0.0 < low <= 0.01 * value
    assert high == 15.0
    assert Part(plain=low).plain == low
    low, high = ShipParameter("part.upper", 0.1, info_of(FIELDS["upper"]), "share").search_range
    assert low == -0.2
    assert 0.59 < high < 0.6


def test_a_search_from_an_absent_limit_has_a_finite_end() -> None:
    low, high = ShipParameter(
        "part.absent", math.inf, info_of(FIELDS["absent"]), "limit"
    ).search_range
    assert 0.0 < low < 0.01
    assert high == math.inf


@pytest.mark.parametrize("name", ship_names())
def test_every_end_of_every_key_that_a_search_may_try_is_allowed(name: str) -> None:
    """Each by its own declaration: what two keys must have in common is not asked here."""
    ship, tried = load_ship(name), 0
    for section in type(ship).model_fields:
        table = getattr(ship, section)
        if not isinstance(table, Section):
            continue
        for key, field in type(table).model_fields.items():
            value = getattr(table, key)
            if not isinstance(value, float) or not ship.has_key(f"{section}.{key}"):
                continue
            own = TypeAdapter(Annotated[float, key, *field.metadata])
            for end in ship.parameter(f"{section}.{key}").search_range:
                if math.isfinite(end):
                    assert own.validate_python(end) == end, f"{section}.{key}"
                    tried += 1
    assert tried > 40
