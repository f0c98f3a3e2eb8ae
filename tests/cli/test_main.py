"""The command begins without importing what it does not run."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from types import ModuleType

import pytest
from typer.testing import CliRunner

from shaftline.cli import main
from shaftline.plant.ship_files import template_names
from shaftline.validation.variants import VARIANTS

SLOW = {"numpy", "pandas", "numba", "scipy", "control", "gymnasium", "matplotlib", "torch",
        "shaftline.plant", "shaftline.mismatch", "shaftline.envs"}  # fmt: skip
HELP = f"""
import sys
from shaftline.cli import main
for name in ("", *main.COMMANDS):
    try:
        main.app([*filter(None, [name]), "--help"])
    except SystemExit as end:
        assert not end.code, name
    if name:
        main.LazyCommand(name).make_context(name, [], resilient_parsing=True)  # the completion
    print("imported", name, sorted({SLOW} & set(sys.modules)))
"""


def test_neither_help_nor_completion_imports_what_takes_time() -> None:
    told = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    said = [line for line in told.stdout.splitlines() if line.startswith("imported ")]
    assert said == [f"imported {name} []" for name in ("", *main.COMMANDS)]


def test_the_completion_of_the_shell_knows_the_options() -> None:
    code = "import sys\nsys.argv = ['shaftline']\nfrom shaftline.cli.main import main\nmain()"
    words = {"COMP_WORDS": "shaftline evaluate --co", "COMP_CWORD": "2"}
    told = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | words | {"_SHAFTLINE_COMPLETE": "complete_bash"},
    )
    assert told.stdout.split() == ["--controller"], told.stderr


def test_the_package_runs_as_the_command() -> None:
    told = subprocess.run(
        [sys.executable, "-m", "shaftline", "--version"], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == version("shaftline")


def test_a_value_that_reads_help_reaches_the_command() -> None:
    result = CliRunner().invoke(main.app, ["list", "--controllers", "--", "--help"])
    assert result.exit_code == 2
    assert "unknown controller '--help'" in " ".join(result.output.split())


@pytest.mark.parametrize(
    "module",
    ["baselines", "envs", "cli.simulate_command", "cli.evaluate_command", "cli.tour_command"],
)
def test_what_is_slow_is_imported_when_it_is_used(module: str) -> None:
    slow = {"control.statesp", "matplotlib.figure", "scipy.optimize", "scipy.signal", "scipy.stats"}
    code = f"import sys, shaftline.{module}\nprint(sorted({slow} & set(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "work",
    [
        "import shaftline.cli.train_command, shaftline.cli.simulate_command",
        "import shaftline.cli.evaluate_command, shaftline.cli.manoeuvre_command",
        "from shaftline.envs import FrigateEnv\nFrigateEnv().reset(seed=0)",
    ],
)
def test_neither_a_command_nor_an_environment_begins_with_tables_or_linear_models(
    work: str,
) -> None:
    slow = {"pandas.core.frame", "control.statesp", "matplotlib.figure", "scipy.signal", "torch"}
    code = (
        "import sys\nfrom shaftline.cli import main\nmain.defer('pandas')\n"
        f"{work}\nprint(sorted({slow} & set(sys.modules)))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_a_deferred_library_is_loaded_at_its_first_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    main.defer("colorsys")
    import colorsys

    assert "hls_to_rgb" not in ModuleType.__getattribute__(colorsys, "__dict__")
    assert colorsys.hls_to_rgb(0.0, 0.5, 0.0) == (0.5, 0.5, 0.5)
    assert type(colorsys) is ModuleType
    main.defer("colorsys")  # A loaded library stays.
    assert sys.modules["colorsys"] is colorsys
    assert type(colorsys) is ModuleType


@pytest.mark.parametrize(("arguments", "spoken"), [(["--help"], False), ([], True)])
def test_help_is_not_preceded_by_a_word_on_loading(
    monkeypatch: pytest.MonkeyPatch, arguments: list[str], spoken: bool
) -> None:
    heard: list[str] = []

    @contextmanager
    def loading() -> Iterator[None]:
        heard.append("loading")
        yield

    monkeypatch.setattr(main, "announce_loading", loading)
    CliRunner().invoke(main.app, ["list", *arguments])
    assert bool(heard) is spoken


def test_every_file_is_a_command() -> None:
    files = {path.stem for path in main.HERE.glob("*_command.py")}
    assert files == {name.replace("-", "_") + "_command" for name in main.COMMANDS}


@pytest.mark.parametrize("name", main.COMMANDS)
def test_the_list_says_what_the_command_says(name: str) -> None:
    itself = main.LazyCommand(name).itself()
    assert itself.name == name
    assert main.command_summary(name)
    assert (itself.help or "").replace("\n", " ").startswith(main.command_summary(name))


@pytest.mark.parametrize("name", main.COMMANDS)
def test_help_shows_the_options_of_the_command(name: str) -> None:
    outline, itself = main.LazyCommand(name).outline(), main.LazyCommand(name).itself()
    assert outline.help == itself.help
    shown, real = (
        [(option.opts, option.secondary_opts, option.required, option.default, option.help)
         for option in command.params] for command in (outline, itself)
    )  # fmt: skip
    assert shown == real


@pytest.mark.parametrize(
    ("name", "known"), [("validate", VARIANTS), ("new-ship", template_names())]
)
def test_help_names_what_an_option_accepts(name: str, known: Iterable[str]) -> None:
    words = main.LazyCommand(name).itself().help
    assert all(re.search(rf"\b{value}\b", words) for value in known)


def test_a_slip_is_answered_with_the_right_name() -> None:
    result = CliRunner().invoke(main.app, ["diagnos"])
    assert result.exit_code == 2
    assert "diagnose" in result.output


@pytest.mark.parametrize(
    ("shell", "environment"),
    [
        ("{} list --effects", {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}),
        ("{} list --effects", {"COLUMNS": "1"}),
        ("{} list --effects", {"MPLBACKEND": "nonsense"}),
        ("{} list --effects >&-", {}),
        ("{} list --effects 2>&-", {}),
        ("{} list --effects | head -1", {}),
    ],
    ids=["ascii", "narrow", "backend", "no-output", "no-errors", "cut-off"],
)
def test_it_runs_in_odd_shells(shell: str, environment: dict[str, str]) -> None:
    command = f"{sys.executable} -c 'from shaftline.cli.main import main; main()'"
    told = subprocess.run(
        ["bash", "-c", shell.format(command)],
        capture_output=True,
        text=True,
        errors="replace",
        env=os.environ | environment,
        check=False,
    )
    assert "Traceback" not in told.stderr
    assert told.returncode == 0, told.stderr
