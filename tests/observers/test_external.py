"""External observers run in the kernels of the package, single and batched."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
import pytest

import shaftline.envs  # noqa: F401
from shaftline.observers import (
    Measurement,
    Observer,
    ObserverError,
    follow,
    get_observer,
    observer_names,
    simulated_measurements,
)
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.plant import Schedule, Sea, Ship, equilibrium, realise, simulate

MINE = f"{__name__}:Lagging"
STEPS = 12


@dataclass(frozen=True)
class Lagging(Observer):
    """Return the shaft speed through a lag as the estimate."""

    name = "lagging"

    @staticmethod
    def update(observer: Any, estimate: Any, m: Measurement) -> tuple[float, bool]:
        """Update the lag and count the samples."""
        estimate.x[1] += 1.0
        estimate.x[0] += 0.1 * (m.shaft_speed - estimate.x[0])
        return estimate.x[0], estimate.x[1] > 5.0


@dataclass(frozen=True)
class Borrowed(ImmersionInvariance):
    """Observer of the package, defined outside the package."""

    name = "borrowed"


class Nothing:
    """Class that is no observer."""


@dataclass(frozen=True)
class Unfinished(Observer):
    """Observer without an update."""

    name = "unfinished"


@pytest.fixture(scope="module")
def run(frigate: Ship) -> Any:
    start = equilibrium(frigate, 22.0, 1.3).state
    sea = realise(Sea(hs_m=1.9, tp_s=8.8), depth_m=4.0, seed=1)
    return simulate(frigate, Schedule(22.0, 1.3), 20.0, initial=start, sea=sea)


def test_its_update_runs(run: Any, frigate: Ship) -> None:
    measurements = simulated_measurements(run)
    found, valid = follow(get_observer(MINE), frigate, measurements, frigate.time_step_s)
    x, expected = 0.0, []
    for speed in measurements[:, 0]:
        x += 0.1 * (speed - x)
        expected.append(x)
    np.testing.assert_array_equal(found, expected)
    assert not valid[:5].any()
    assert valid[6:].all()


def test_observers_of_the_package_give_the_same_bits_by_address(run: Any, frigate: Ship) -> None:
    assert Borrowed().address != 0
    assert ImmersionInvariance().address == 0
    measurements, dt = simulated_measurements(run), frigate.time_step_s
    ours, theirs = (
        follow(observer, frigate, measurements, dt)
        for observer in (ImmersionInvariance(), Borrowed())
    )
    np.testing.assert_array_equal(ours[0], theirs[0])
    np.testing.assert_array_equal(ours[1], theirs[1])


def make_environment(count: int, observer: str = MINE) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(
        "shaftline/Frigate-v0",
        num_envs=count,
        vectorization_mode="vector_entry_point",
        task="transit",
        observer=observer,
    )


def steps(env: Any, count: int) -> Any:
    for _ in range(count):
        seen, *_ = env.step(np.zeros(env.action_space.shape, np.float32))
    return seen


def test_single_and_batched_are_the_same() -> None:
    one, many = make_environment(1), make_environment(4)
    one.reset(seed=cast("Any", [7]))
    many.reset(seed=cast("Any", [5, 7, 8, 9]))
    np.testing.assert_array_equal(steps(one, STEPS)[0], steps(many, STEPS)[1])


GO_ON = """
import pickle, sys
import numpy as np
with open("env.pickle", "rb") as file:
    env = pickle.load(file)
for _ in range({steps}):
    seen, *_ = env.step(np.zeros(env.action_space.shape, np.float32))
np.save("there.npy", seen)
"""


def test_a_pickled_environment_continues_in_another_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Path(__file__).parents[2] / "examples" / "own_observer.py"
    (tmp_path / "observer_of_mine.py").write_text(source.read_text())
    monkeypatch.chdir(tmp_path)
    env = make_environment(2, "observer_of_mine:Slow")
    env.reset(seed=3)
    steps(env, 3)
    (tmp_path / "env.pickle").write_bytes(pickle.dumps(env))
    subprocess.run([sys.executable, "-c", GO_ON.format(steps=STEPS)], check=True, timeout=300)
    np.testing.assert_array_equal(np.load("there.npy"), steps(env, STEPS))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (f"{__name__}:Nothing", "expected a class that derives from shaftline.observers.Obs"),
        (f"{__name__}:Unfinished", "abstract"),
        (f"{__name__}:Nobody", "cannot be loaded"),
        ("no_such_module:Nobody", "cannot be loaded"),
        ("no-such-observer", "unknown observer 'no-such-observer'; known: "),
    ],
)
def test_other_classes_are_refused(name: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        get_observer(name)


def test_an_installed_package_gives_it_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = tmp_path / "theirs-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[shaftline.observers]\ntheir-own = {MINE}\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert observer_names()[-1] == "their-own"
    assert type(get_observer("their-own")).__name__ == "Lagging"


def test_an_update_that_cannot_be_compiled_is_refused(frigate: Ship) -> None:
    class Wrong(Lagging):
        @staticmethod
        def update(observer: Any, estimate: Any, m: Measurement) -> tuple[float, bool]:
            return eval("1.0"), True

    with pytest.raises(ObserverError, match="'lagging': numba cannot compile its update"):
        Wrong().discretise(frigate, 0.05)
