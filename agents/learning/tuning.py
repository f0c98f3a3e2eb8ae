"""Tuning of the constants of a classic controller on a task, as the reference for learned policies.

CMA-ES (Hansen 2016, arXiv:1604.00772) draws candidates. All of them are simulated in the same episodes
of the seas of the task, and the mean reward decides. A candidate with the best reward so far is refused
if its commands oscillate in calm water. Held-out seas are never drawn. The search space is the product
of the ranges that the controller declares (:attr:`shaftline.baselines.Controller.tunable`), each scaled
to 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import cma
import numpy as np
from numpy.typing import NDArray

from ...baselines.controller import Predictor
from ...baselines.registry import ControllerError, read_options, split_steering_name, tunable
from ...envs.settings import DEFAULTS, EPISODE_S
from ...envs.tasks import Task, controller_for, get_task
from ..evaluation.episodes import Setting, run_episodes
from ..evaluation.stability import find_oscillation

FIRST_SEED = 700_000
"""First seed of the episodes of the search; training and evaluation use other seeds."""

_SPREAD = 0.3  # initial standard deviation of the candidates, over the ranges
_DIGITS = 3  # significant digits of the constants


class TuningResult(NamedTuple):
    """Result of a tuning; rewards are means over episodes of the same seas."""

    controller: str  # best controller with its options, as :func:`tune` accepts it
    reward: float  # reward in the episodes of the search, which is biased upwards
    fresh: float  # reward in as many unused episodes
    untuned: float  # reward of the given controller in these unused episodes
    candidates: int  # number of candidates


class _Part(NamedTuple):
    """One controller of a text: the helmsman, or the controller of pitch and rack."""

    name: str
    given: Mapping[str, float]


def _parts(text: str, task: Task) -> list[_Part]:
    """Return the parts of a controller, with the helmsman of the task where the text has none."""
    names = split_steering_name(text)
    if task.steered and len(names) == 1:
        names = [task.helmsman, *names]
    return [_Part(*read_options(name)) for name in names]


def _text_of(name: str, options: Mapping[str, float]) -> str:
    """Return a controller as ``NAME:option=number,...``; the name alone without options."""
    listed = ",".join(f"{key}={value:.{_DIGITS}g}" for key, value in options.items())
    return f"{name}:{listed}" if listed else name


def _free(
    parts: list[_Part], ranges: Mapping[str, tuple[float, float]] | None
) -> dict[tuple[int, str], tuple[float, float]]:
    """Return the ranges of the free constants, by part and option."""
    declared = [tunable(part.name) for part in parts]
    last = len(parts) - 1
    if ranges is None:
        every = [(k, *item) for k, own in enumerate(declared) for item in own.items()]
    else:
        owner = {key: k for k, own in enumerate(declared) for key in own}
        every = [(owner.get(key, last), key, ends) for key, ends in ranges.items()]
    return {(k, key): ends for k, key, ends in every if key not in parts[k].given}


def tune(
    controller: str,
    task: str | Task | dict[str, Any],
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    rounds: int = 40,
    episodes: int = 24,
    episode_s: float = EPISODE_S,
    seed: int = 0,
    observer: str = DEFAULTS.observer,
    ship: str | None = None,
    sea: str = "task",
    threads: int | None = None,
    tick: Callable[[int, int, str], None] = lambda done, total, said: None,
) -> TuningResult:
    """Tune the constants of a controller on a task.

    Args:
        controller: ``NAME`` or ``NAME:option=number,...``; the given options are fixed. For a task with
            the rudder as an action ``HELMSMAN+NAME``; by default the helmsman of the task is tuned too.
        task: name, or the task itself.
        ranges: lowest and highest value of each constant; by default those that the controller declares.
        rounds: number of generations.
        episodes: number of episodes for each candidate.
        episode_s: length of an episode [s].
        seed: seed of the search and of its episodes.
        observer: name of the observer.
        ship: preset or path; by default the ship of the task.
        sea: preset or parameters of the sea in which candidates are simulated; ``task``: the seas of the
            task.
        threads: number of threads that step the episodes; one for each core by default.
        tick: function called after each generation with its number, the number of generations, and the
            best reward so far as text.

    Raises:
        ControllerError: unknown name or option, no constant that can be tuned, or all best candidates
            oscillate in calm water.
        ValueError: an empty range, or a count below one.
    """
    model = get_task(task)
    parts = _parts(controller, model)
    free = _free(parts, ranges)
    if not free:
        raise ControllerError(f"{controller!r}: no constant of this controller can be tuned")
    for (_, key), (low, high) in free.items():
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ValueError(
                f"range of {key}: {low!r} to {high!r}: the ends must be finite and the first the lower"
            )
    if min(rounds, episodes) < 1:
        raise ValueError("rounds and episodes must each be at least 1")
    vessel = model.load_ship(ship)
    first = FIRST_SEED + 2 * seed * episodes

    def make(text: str) -> Predictor:
        return controller_for(model, text, vessel, DEFAULTS.control_interval_s, model.steered)

    def cell(text: str, seed: int) -> Setting:
        return Setting(
            text,
            task if isinstance(task, str) else "own task",
            sea,
            observer,
            episodes,
            ship,
            episode_s,
            task_model=model,
            first_seed=seed,
        )

    def simulate(text: str, seed: int) -> float:
        kpis, _ = run_episodes(cell(text, seed), make(text), threads=threads)
        return float(kpis["reward"].mean())

    def oscillates(text: str) -> bool:
        return find_oscillation(cell(text, first), make(text)) is not None

    untuned = simulate(controller, first + episodes)  # This also checks the options.
    best, reward, count = _search(
        parts, free, lambda text: simulate(text, first), oscillates, rounds, seed, tick
    )
    if not best:
        raise ControllerError(
            f"{controller!r}: the best candidates of all {rounds} generations oscillate in calm water; "
            "give ranges with smaller gains"
        )
    return TuningResult(best, reward, simulate(best, first + episodes), untuned, count)


def _search(
    parts: list[_Part],
    free: Mapping[tuple[int, str], tuple[float, float]],
    simulate: Callable[[str], float],
    oscillates: Callable[[str], bool],
    rounds: int,
    seed: int,
    tick: Callable[[int, int, str], None],
) -> tuple[str, float, int]:
    """Return the best controller of a search, its reward, and the number of candidates.

    The controller is an empty text if all best candidates oscillate. ``free`` has the range of each free
    constant, by part and option.
    """

    def text_of(point: NDArray[np.float64]) -> str:
        options = [dict(part.given) for part in parts]
        for ((k, key), (low, high)), share in zip(free.items(), point, strict=True):
            options[k][key] = low + (high - low) * float(share)
        return "+".join(_text_of(part.name, own) for part, own in zip(parts, options, strict=True))

    rng = np.random.default_rng(seed)
    settings = {
        "bounds": [0.0, 1.0],
        "maxiter": rounds,
        "verbose": -9,
        "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
        "verb_log": 0,
        # cma 4.5 fails if it limits the standard deviation of a single constant.
        "maxstd_boundrange": 1.0 / 3.0 if len(free) > 1 else np.inf,
    }
    search = cma.CMAEvolutionStrategy(np.full(len(free), 0.5), _SPREAD, settings)
    best, most, candidates = "", -np.inf, 0
    for k in range(rounds):
        points = search.ask()
        texts = [text_of(np.asarray(point)) for point in points]
        rewards = [simulate(text) for text in texts]
        candidates += len(texts)
        lowest = min(rewards)
        for leader in sorted(range(len(texts)), key=lambda k: -rewards[k]):
            if rewards[leader] <= most:
                break
            if not oscillates(texts[leader]):
                best, most = texts[leader], rewards[leader]
                break
            rewards[leader] = lowest  # The search leaves the region of unstable gains.
        search.tell(points, [-reward for reward in rewards])
        tick(k + 1, rounds, f"reward {most:.5g}")
        if search.stop():
            break
    return best, most, candidates
