"""An FMU as a controller equals the same controller in Python; other files are refused."""

from __future__ import annotations

import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from shaftline.agents.evaluation.episodes import (
    Setting,
    label,
    load_controller,
    run_episodes,
)
from shaftline.baselines import Controller, ControllerError, Measurements
from shaftline.baselines.controller import Commands
from shaftline.cli.main import app
from shaftline.envs import get_task
from shaftline.fmi.archive import FmuError, Model, write_fmu
from shaftline.fmi.controller import FmuController
from shaftline.fmi.description import INPUT, OUTPUT, Variable
from shaftline.plant import load_ship

fmpy = pytest.importorskip("fmpy")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler named cc")

CODE = """\
typedef struct { double trim; } model_memory;

static int model_begin(model_memory *memory, double *x)
{
    memory->trim = 0.0;
    x[3] = x[4] = 0.0;
    return 0;
}

static int model_advance(model_memory *memory, double *x, long steps)
{
    while (steps-- > 0) {
        double error = x[0] - x[1];
        memory->trim += 0.1 * error;
        x[3] = 14.0 + 3.0 * error + memory->trim + 0.2 * (9.0 - x[2]);
        x[4] = 1.1 + 0.01 * memory->trim;
    }
    return 0;
}
"""
ONCE = "canBeInstantiatedOnlyOncePerProcess"
VARIABLES = (
    Variable(0, "speed_order_m_s", INPUT, "m/s", "set-point"),
    Variable(1, "ship_speed_m_s", INPUT, "m/s", "log"),
    Variable(2, "shaft_speed_rad_s", INPUT, "rad/s", "encoder"),
    Variable(3, "fuel_rack_mm", OUTPUT, "mm", "command"),
    Variable(4, "pitch_ratio_command", OUTPUT, "-", "command"),
)


class SpeedKeeper(Controller):
    """The controller of CODE."""

    name = "speed-keeper"

    def initial_state(self, signals: Measurements) -> Any:
        return np.zeros((len(signals.speed_order), 1))

    def act(self, signals: Measurements, memory: Any) -> Commands:
        error = signals.speed_order - signals.ship_speed
        memory[:, 0] += 0.1 * error
        rack = 14.0 + 3.0 * error + memory[:, 0] + 0.2 * (9.0 - signals.shaft_speed)
        return 1.1 + 0.01 * memory[:, 0], rack


def write(file: Path, variables: Any = VARIABLES, code: str = CODE, step_s: float = 0.5) -> Path:
    write_fmu(file, Model("keeps a speed", variables, step_s, [0.0] * 5, 3, 3, code))
    return file


@pytest.fixture(scope="module")
def keeper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("fmu") / "keeper.fmu")


def test_it_equals_the_native_controller_over_whole_episodes(keeper: Path) -> None:
    ship = load_ship("frigate")
    cell = Setting("x", "transit", "hs=3,tp=9", "luenberger", seeds=3, episode_s=150.0)
    native = run_episodes(cell, SpeedKeeper(ship, 0.5))
    controller = load_controller(f"fmu:{keeper}", ship, 0.5, get_task("transit"))
    imported = run_episodes(cell, controller)
    assert imported[0].equals(native[0])
    assert np.array_equal(imported[1], native[1])
    assert native[0]["fuel_kg_nmi"].nunique() == 3
    # A second run with more episodes begins anew, in instances that are reset.
    again = run_episodes(Setting(**{**vars(cell), "seeds": 4}), controller)
    assert again[0].head(3).equals(native[0])


def test_a_copy_for_another_process_begins_anew(keeper: Path) -> None:
    controller = FmuController(keeper, load_ship("frigate"), 0.5)
    seen = np.array([[8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0]])
    first, state = controller.predict(seen)
    second, _ = controller.predict(seen, state)
    assert not np.array_equal(first, second)  # the trim has grown
    copy = pickle.loads(pickle.dumps(controller))
    assert np.array_equal(copy.predict(seen)[0], first)
    single, _ = copy.predict(seen[0])
    assert single.shape == (2,)
    assert np.array_equal(single, first[0])


def test_a_state_other_than_the_last_is_refused(keeper: Path) -> None:
    controller = FmuController(keeper, load_ship("frigate"), 0.5)
    seen = np.array([[8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0]])
    _, state = controller.predict(seen)
    controller.predict(seen, state)
    with pytest.raises(ValueError, match="continues only from its last step"):
        controller.predict(seen, state)


def test_an_episode_that_starts_resets_its_instance_alone(keeper: Path) -> None:
    controller = FmuController(keeper, load_ship("frigate"), 0.5)
    seen = np.tile([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0], (2, 1))
    first, state = controller.predict(seen)
    second, _ = controller.predict(seen, state, np.array([False, True]))
    assert np.array_equal(second[1], first[1])
    assert not np.array_equal(second[0], first[0])


def changed(slot: int, **values: Any) -> list[Variable]:
    return [v._replace(**values) if v.slot == slot else v for v in VARIABLES]


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        (changed(2, name="rpm"), "the input rpm is unknown. The inputs of a controller can be"),
        (changed(3, name="rack"), r"the output fuel_rack_mm \[mm\] is missing"),
        (changed(1, unit="N"), "ship_speed_m_s has the unit N, but must have m/s"),
        (changed(3, unit="m"), "fuel_rack_mm has the unit m, but must have mm"),
        (changed(2, unit="furlong"), "shaft_speed_rad_s has the unit furlong, but must have rad/s"),
    ],
)
def test_variables_that_do_not_suit_are_refused(tmp_path: Path, variables: Any, words: str) -> None:
    file = write(tmp_path / "other.fmu", variables)
    with pytest.raises(FmuError, match=words):
        FmuController(file, load_ship("frigate"), 0.5)


def edited(keeper: Path, file: Path, edit: Callable[[str], str], drop: str = "nothing") -> Path:
    """Copy an FMU with another description, without the members that begin with ``drop``."""
    with zipfile.ZipFile(keeper) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = edit(data.decode()).encode()
            if not name.startswith(drop):
                new.writestr(name, data)
    return file


@pytest.mark.parametrize(
    ("edit", "drop", "words"),
    [
        (lambda t: t, "binaries", "has no binary for linux64, only for c-code"),
        (lambda t: t.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), "x", "not a valid FMU"),
        (
            lambda t: t.replace("CoSimulation", "ModelExchange").replace(
                'canHandleVariableCommunicationStepSize="true"', ""
            ),
            "x",
            "for model exchange",
        ),
        (lambda t: t[:400], "x", "not a valid FMU"),
        (lambda t: t, "modelDescription", "not a valid FMU"),
        (
            lambda t: t.replace("<CoSimulation", f'<CoSimulation {ONCE}="true"'),
            "x",
            "only once in a process",
        ),
        (lambda t: t.replace('guid="', 'guid="a'), "x", "cannot be loaded: not instantiated"),
    ],
)
def test_other_fmus_are_refused(
    keeper: Path, tmp_path: Path, edit: Callable[[str], str], drop: str, words: str
) -> None:
    file = edited(keeper, tmp_path / "edited.fmu", edit, drop)
    seen = np.tile([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0], (2, 1))
    with pytest.raises(FmuError, match=words):
        FmuController(file, load_ship("frigate"), 0.5).predict(seen)


def test_an_interval_that_the_fmu_refuses_is_reported_in_its_words(tmp_path: Path) -> None:
    file = write(tmp_path / "slow.fmu", step_s=0.2)
    controller = FmuController(file, load_ship("frigate"), 0.5)
    with pytest.raises(
        FmuError, match=r"reports an error: communication step 0.5 s: must be a whole"
    ):
        controller.predict(np.array([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0]))


def test_a_command_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "bad.fmu", code=CODE.replace("14.0 +", "x[3] / x[3] +"))
    controller = FmuController(file, load_ship("frigate"), 0.5)
    with pytest.raises(FmuError, match="a command of the FMU is not finite"):
        controller.predict(np.array([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0]))


def test_files_that_are_no_fmus_are_refused(tmp_path: Path) -> None:
    ship = load_ship("frigate")
    (tmp_path / "text.fmu").write_text("no archive")
    with zipfile.ZipFile(tmp_path / "large.fmu", "w", zipfile.ZIP_DEFLATED) as large:
        large.writestr("zeros", bytes(501_000_000))
    for name, words in {
        "none.fmu": "no such FMU",
        "text.fmu": "not a valid FMU",
        ".": "is a folder",
        "large.fmu": "unpacks to 501 MB; at most 500 MB are read",
    }.items():
        with pytest.raises(ValueError, match=words):
            FmuController(tmp_path / name, ship, 0.5)


def test_no_code_runs_before_the_first_prediction(tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    code = CODE + (
        "__attribute__((constructor)) static void ran(void)"
        f' {{ FILE *f = fopen("{mark}", "w"); if (f) fclose(f); }}'
    )
    controller = FmuController(write(tmp_path / "x.fmu", code=code), load_ship("frigate"), 0.5)
    assert not mark.exists()
    controller.predict(np.array([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.0, 6.0, 1.0]))
    assert mark.exists()


def test_only_the_prefix_loads_an_fmu(keeper: Path) -> None:
    with pytest.raises(ValueError, match=r"unknown controller|cannot be loaded"):
        load_controller(str(keeper), load_ship("frigate"), 0.5)
    with pytest.raises(ControllerError, match="unknown controller 'fmu:'"):
        load_controller("fmu:", load_ship("frigate"), 0.5)
    steered = get_task("course-keeping")
    with pytest.raises(ControllerError, match="but this task steers"):
        load_controller(f"fmu:{keeper}", load_ship("frigate-turning"), 0.5, steered)


def test_its_label_changes_with_its_content(keeper: Path, tmp_path: Path) -> None:
    file = tmp_path / "runs" / "a.fmu"
    file.parent.mkdir()
    shutil.copy(keeper, file)
    first = label(f"fmu:{file}")
    assert first.startswith("fmu:runs/a.fmu ")
    write(file, code=CODE.replace("14.0", "15.0"))
    assert label(f"fmu:{file}") != first


def test_evaluate_takes_it_and_its_help_warns(keeper: Path, tmp_path: Path) -> None:
    ask = (
        "evaluate",
        "--controller",
        f"fmu:{keeper}",
        "--controller",
        "combinator",
        "--seeds",
        2,
        "--episode-s",
        20,
        "--out",
        tmp_path / "ev",
    )
    result = CliRunner().invoke(app, list(map(str, ask)))
    assert result.exit_code == 0, result.output
    assert "keeper.fmu" in (tmp_path / "ev" / "table.csv").read_text()
    text = " ".join(CliRunner().invoke(app, ["evaluate", "--help"]).output.split())
    assert "machine code" in text
