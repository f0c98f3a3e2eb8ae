"""Options take values from source files; they are those of the imported modules."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from shaftline.cli import source, task_options
from shaftline.envs import DEFAULTS, settings, tasks


def test_options_of_tasks_have_the_values_of_the_environments() -> None:
    assert DEFAULTS.observer == task_options.OBSERVER
    assert DEFAULTS.control_interval_s == task_options.INTERVAL_S
    assert settings.EPISODE_S == task_options.EPISODE_S
    assert settings.LONGEST_S == task_options.LONGEST_S
    assert list(tasks(None)) == task_options.task_names()


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("mismatch.identify", "DEFAULT"),
        ("mismatch.identification.free_parameters", "AUTO"),
        ("mismatch.monitor", "RISK"),
        ("validation.variants", "PLAIN"),
    ],
)
def test_a_constant_is_that_of_the_module(module: str, name: str) -> None:
    value = getattr(import_module(f"shaftline.{module}"), name)
    assert source.constant(f"{module.replace('.', '/')}.py", name) == value


def test_keys_are_those_of_the_dictionary() -> None:
    methods = import_module("shaftline.mismatch.identify").METHODS
    assert source.dictionary_keys("mismatch/identify.py", "METHODS") == list(methods)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(LookupError, match=r"envs/settings\.py: assigns nothing to EPISODE"):
        source.constant("envs/settings.py", "EPISODE")
    with pytest.raises(LookupError, match=r"cli/main\.py: no function solve"):
        source.summary("cli/main.py", "solve")


def test_an_option_of_another_package_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(source, "PACKAGE", tmp_path)
    text = "from ..plant.load_cases import CASES\ndef simulate(case=next(iter(CASES))): ...\n"
    (tmp_path / "command.py").write_text(text, encoding="utf-8")
    with pytest.raises(NameError, match="CASES"):
        source.load_outline("command.py", "simulate")
