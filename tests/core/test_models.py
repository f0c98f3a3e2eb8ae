"""Every model of a file refuses numbers that are not finite, and truth values for numbers."""

from __future__ import annotations

import importlib
import math
import pkgutil

import pytest
from pydantic import BaseModel, ValidationError

import shaftline
from shaftline.core.models import FileModel, refuse_non_numbers
from shaftline.plant.keys import Section

pytest.importorskip("stable_baselines3")


def _models(base: type[BaseModel] = BaseModel) -> list[type[BaseModel]]:
    found = []
    for model in base.__subclasses__():
        found += [model, *_models(model)]
    return found


def test_every_model_of_the_package_has_one_of_the_two_bases() -> None:
    for module in pkgutil.walk_packages(shaftline.__path__, "shaftline."):
        if module.name.split(".")[1] in ("agents", "envs", "mismatch", "plant", "validation"):
            importlib.import_module(module.name)
    own = [m for m in _models() if m.__module__.startswith("shaftline.")]
    assert len(own) > 25
    for model in own:
        assert model.model_config["allow_inf_nan"] is False, model
        if model not in (Section, FileModel) and model.__name__ not in ("Sea", "Settings"):
            assert issubclass(model, Section | FileModel), model


class _Table(FileModel):
    number: float = 0.0
    many: dict[str, tuple[float, ...]] = {}  # noqa: RUF012
    either: float | str = ""
    switch: bool = False


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"number": math.nan}, "finite"),
        ({"number": math.inf}, "finite"),
        ({"number": True}, "True is a truth value"),
        ({"number": "5"}, "'5' is a text"),
        ({"many": {"a": [1.0, True]}}, "True is a truth value"),
        ({"many": {"a": [1.0, math.nan]}}, "finite"),
        ({"many": {"a": ["1"]}}, "'1' is a text"),
        ({"either": True}, "True is a truth value"),
        ({"either": math.nan}, "finite"),
    ],
)
def test_refuses(given: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words) as caught:
        _Table.model_validate(given)
    assert str(caught.value.errors()[0]["loc"][0]) in given


def test_takes_what_is_meant() -> None:
    table = _Table.model_validate(
        {"number": 3, "many": {"a": [1, 2.0]}, "either": "x", "switch": True}
    )
    assert table.number == 3.0
    assert table.many == {"a": (1.0, 2.0)}
    assert table.switch is True


def test_refuses_words_at_any_depth() -> None:
    refuse_non_numbers({"a": [1, {"b": 2.0}], "c": "text"})
    with pytest.raises(ValueError, match="False is a truth value"):
        refuse_non_numbers({"a": [1, {"b": False}]})
