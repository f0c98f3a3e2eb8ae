"""Constants of a classic controller, searched for on a task: what learning has to beat.

CMA-ES (Hansen 2016, arXiv:1604.00772) draws candidates, all sail the same episodes of the task's own
seas, and the mean reward decides. Held-out seas are never drawn. The search is over the ranges that the
controller declares (:attr:`shaftline.baselines.Controller.tunable`), each scaled to 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import cma
import numpy as np
from numpy.typing import NDArray

from ...baselines.registry import ControllerError, joined_names, read_options, tunable
from ...envs.settings import DEFAULTS, EPISODE_S
from ...envs.tasks import Task, controller_for, get_task
from ..evaluation.episodes import Setting, run_episodes

FIRST_SEED = 700_000
"""Of the episodes on which candidates are compared; apart from those of training and judging."""

_SPREAD = 0.3  # of the first candidates, over the ranges
_DIGITS = 3  # constants are given with so many, and judged as they are given


class Tuned(NamedTuple):
    """What a search found."""

    controller: str
    """With its options, as :func:`tune` takes it."""
    reward: float
    """Mean over the episodes of the search, which flatters it."""
    fresh: float
    """The same over as many episodes that it has not seen, of the same seas."""
    untuned: float
    """What the controller gets there with the constants that it was given."""
    sailed: int
    """Candidates."""


class _Part(NamedTuple):
    """One controller of a text: the helmsman, or who sets pitch and rack."""

    name: str
    given: Mapping[str, float]


def _parts(text: str, task: Task) -> list[_Part]:
    """Return the parts of a controller for a task, the task's own helmsman first where it has none."""
    names = joined_names(text)
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
    """Return the ranges that are searched, by part and option."""
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
    task: str,
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    rounds: int = 40,
    episodes: int = 24,
    episode_s: float = EPISODE_S,
    seed: int = 0,
    observer: str = DEFAULTS.observer,
    ship: str | None = None,
    threads: int | None = None,
    tick: Callable[[int, int, str], None] = lambda done, total, said: None,
) -> Tuned:
    """Search a controller's constants.

    Args:
        controller: ``NAME`` or ``NAME:option=number,...``; what is given here stays. For a task with
            the rudder as an action ``HELMSMAN+NAME``, or the task's own helmsman is searched, too.
        task: name, on whose training's seas candidates sail.
        ranges: lowest and highest of each constant; those that the controller declares by default.
        rounds: generations.
        episodes: that each candidate sails.
        episode_s: their length [s].
        seed: of the search, and of its episodes.
        observer: name.
        ship: preset or path; the one that the task is made for by default.
        threads: that step the episodes; the machine's cores by default.
        tick: called after each round with its number, their sum, and the best reward so far in words.

    Raises:
        ControllerError: unknown name or option, or nothing that may be searched for.
        ValueError: a range that is none, or numbers below one.
    """
    model = get_task(task)
    parts = _parts(controller, model)
    free = _free(parts, ranges)
    if not free:
        raise ControllerError(f"{controller!r}: it has no constant that may be searched for")
    for (_, key), (low, high) in free.items():
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ValueError(f"range of {key}: {low!r} to {high!r} is none")
    if min(rounds, episodes) < 1:
        raise ValueError("rounds and episodes must be 1 or more")
    sailed = model.sailed(ship)
    first = FIRST_SEED + 2 * seed * episodes

    def sail(text: str, seeds_from: int) -> float:
        setting = Setting(
            text, task, "task", observer, episodes, ship, episode_s, first_seed=seeds_from
        )
        made = controller_for(model, text, sailed, DEFAULTS.control_interval_s, model.steered)
        kpis, _ = run_episodes(setting, made, threads=threads)
        return float(kpis["reward"].mean())

    untuned = sail(controller, first + episodes)  # which refuses what the controller does not take
    found = _searched(parts, free, lambda text: sail(text, first), rounds, seed, tick)
    return Tuned(
        found.text, found.reward, sail(found.text, first + episodes), untuned, found.sailed
    )


class _Searched(NamedTuple):
    """The best of a search."""

    text: str  # the controller with its options
    reward: float  # which flatters it
    sailed: int  # candidates


def _searched(
    parts: list[_Part],
    free: Mapping[tuple[int, str], tuple[float, float]],
    sail: Callable[[str], float],
    rounds: int,
    seed: int,
    tick: Callable[[int, int, str], None],
) -> _Searched:
    """Return the best controller of a search.

    Args:
        parts: controllers with the constants that stay.
        free: range of each constant that is searched for, by part and option.
        sail: reward of a controller.
        rounds: generations.
        seed: of the search.
        tick: as of :func:`tune`.
    """

    def text_of(point: NDArray[np.float64]) -> str:
        options = [dict(part.given) for part in parts]
        for ((k, key), (low, high)), share in zip(free.items(), point, strict=True):
            options[k][key] = low + (high - low) * float(share)
        return "+".join(_text_of(part.name, own) for part, own in zip(parts, options, strict=True))

    rng = np.random.default_rng(seed)
    search = cma.CMAEvolutionStrategy(
        np.full(len(free), 0.5),
        _SPREAD,
        {
            "bounds": [0.0, 1.0], "maxiter": rounds, "verbose": -9, "seed": np.nan,
            "randn": lambda *shape: rng.standard_normal(shape), "verb_log": 0,
            # cma 4.5 fails where it would limit the spread of a single constant
            "maxstd_boundrange": 1.0 / 3.0 if len(free) > 1 else np.inf,
        },
    )  # fmt: skip
    best, most, sailed = "", -np.inf, 0
    for k in range(rounds):
        points = search.ask()
        texts = [text_of(np.asarray(point)) for point in points]
        rewards = [sail(text) for text in texts]
        sailed += len(texts)
        search.tell(points, [-reward for reward in rewards])
        leader = int(np.argmax(rewards))
        if rewards[leader] > most:
            best, most = texts[leader], rewards[leader]
        tick(k + 1, rounds, f"reward {most:.5g}")
        if search.stop():
            break
    return _Searched(best, most, sailed)
