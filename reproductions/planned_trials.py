"""Settle by planned trials what short recordings leave open; write ``planned-trials.md``.

The recordings come from the independent simulator of the validation. The result of each case is kept in
the folder ``--kept``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.sweep import sweep
from shaftline.mismatch import Diagnosis, Limits, catalogue, diagnose, plan_trial
from shaftline.mismatch.planning.plan import DECIDED
from shaftline.mismatch.report.plan import read_question
from shaftline.plant import load_ship
from shaftline.validation.cases import Case, draw_case, indices_of
from shaftline.validation.recording import Scenario, simulate_case, with_effect
from shaftline.validation.simulator.effects import CONFOUNDED
from shaftline.validation.simulator.voyage import StalledError

from .pages import make_parser, print_dot
from .writing import share, write_results

TITLE = "Trials planned to settle what a recording leaves open"
MINUTES = (2, 5, 15)
"""Lengths of a trial of which the shortest sufficient one is looked for; each begins like the next."""

LIMITS = Limits(drive=(14.0, 30.0), pitch_ratio=(0.95, 1.35))
"""Limits of the trial: commands that the frigate uses in service."""

PLANNED, RANDOM, ADVISED = "planned", "random", "catalogue"
POOLS = {PLANNED: 24, RANDOM: 1}
"""Random manoeuvres from which each one of a programme is chosen; with 1 the programme is random."""

NOTHING = "nothing"
"""Key of a cell without a concealed effect."""

STOPS = "engine stops"
"""Outcome of a programme at which the true engine stops: there is no recording."""

EVERY = 8
"""Of so many cells one conceals nothing."""

MORE_NOISE = 500_000
"""Difference of the noise seeds of both recordings of a case."""


class Cell(NamedTuple):
    """One case."""

    seed: int
    number: int
    key: str

    @property
    def name(self) -> str:
        """File name of the result."""
        return f"{self.seed}_{self.number}_{self.key.replace('/', '-')}"


def cells_of(seed: int, count: int) -> list[Cell]:
    """Return cases in a nearly steady cruise: each effect of the list in turn, or nothing."""
    keys = [
        NOTHING if k % EVERY == EVERY - 1 else CONFOUNDED[(k - k // EVERY) % len(CONFOUNDED)]
        for k in range(count)
    ]
    indices = indices_of(seed, count, lambda kind: kind == "confounded")
    return [Cell(seed, index, key) for index, key in zip(indices, keys, strict=True)]


def outcome_of(diagnosis: Diagnosis, true: str) -> str:
    """Return whether a diagnosis names the concealed effect, alone or among alternatives.

    Args:
        diagnosis: result.
        true: id of the concealed effect; :data:`NOTHING` if there is none.
    """
    named = [finding.effect.id for finding in diagnosis.findings]
    others = [label.split(" ")[0] for label in diagnosis.alternatives]
    if true == NOTHING:
        if named:
            return "wrong"
        return "right" if diagnosis.verdict == "nothing-missing" else "not named"
    if named == [true] and not others:
        return "right"
    if true in named or true in others:
        return "among alternatives"
    return "wrong" if named else "not named"


def _levels(*levels: tuple[float, float]) -> Callable[[int], np.ndarray]:
    """Return a programme that holds pairs of drive and pitch, as shares of their ranges, in turn."""

    def programme(rows: int) -> np.ndarray:
        return np.array(levels)[np.arange(rows) * len(levels) // rows]

    return programme


FOUR = (0.0, 1 / 3, 2 / 3, 1.0)
STAIRCASES = _levels(*((k, 1.0) for k in FOUR), *((0.5, k) for k in FOUR))
TWO_SPEEDS = _levels((0.1, 1.0), (0.9, 1.0))
PITCH_STEPS = _levels(*((0.5, k) for k in (0.5, 0.7, 0.5, 0.3, 0.5, 1.0, 0.5, 0.0)))
WORDS = {
    "a staircase of rack settings": STAIRCASES,
    "rack settings from idle": _levels(*((k, 1.0) for k in (0.0, 0.25, 0.5, 0.75, 1.0))),
    "steady runs at two shaft speeds and two pitches": _levels(
        (0.1, 0.2), (0.9, 0.2), (0.1, 1.0), (0.9, 1.0)
    ),
    "steady runs at two shaft speeds or more": TWO_SPEEDS,
    "a thrust meter, or a staircase of pitch": _levels(*((k, k) for k in FOUR)),
    "runs at two ship speeds with equal shaft speed": _levels((0.0, 0.0), (1.0, 1.0)),
    "runs below and above": TWO_SPEEDS,
    "at least two levels of shaft torque": TWO_SPEEDS,
    "runs at two speeds for a current": TWO_SPEEDS,
    "steps of pitch": PITCH_STEPS,
    "small pitch reversals": PITCH_STEPS,
}
"""Programme of each sentence of the catalogue on what distinguishes an effect, by the first words."""


def advised_programme(diagnosis: Diagnosis, minutes: float) -> pd.DataFrame:
    """Return the programme that the catalogue advises for the first effect of a diagnosis.

    Sentences that ask for an instrument or opposite courses, which the trial cannot have, and a
    diagnosis without any effect get two staircases.

    Args:
        diagnosis: diagnosis of the first recording.
        minutes: length [min].
    """
    labels = [finding.effect.label for finding in diagnosis.findings] or [*diagnosis.alternatives]
    advice = [e.split_by for e in catalogue() for label in labels[:1] if e.label == label]
    known = [way for words, way in WORDS.items() if advice and advice[0].startswith(words)]
    shares = (known or [STAIRCASES])[0](round(60 * minutes))
    assert LIMITS.drive is not None
    assert LIMITS.pitch_ratio is not None
    ends = np.array([LIMITS.drive, LIMITS.pitch_ratio])
    values = ends[:, 0] + shares * (ends[:, 1] - ends[:, 0])
    names = ["fuel_rack_mm", "pitch_ratio_command"]
    return pd.DataFrame(values, columns=names).assign(time_s=np.arange(len(values), dtype=float))


def second_recording(case: Case, sizes: dict[str, float], table: pd.DataFrame) -> pd.DataFrame:
    """Return the independent simulator's recording of a programme, by the ship of a case.

    Args:
        case: case.
        sizes: sizes of the concealed effects by key, with their sign.
        table: programme with a row a second.

    Raises:
        StalledError: the engine stops.
    """
    rows = round(1.0 / case.period)
    scenario = Scenario(replace(case, noise_seed=case.noise_seed + MORE_NOISE))
    scenario.drive = np.repeat(table["fuel_rack_mm"].to_numpy(), rows)
    scenario.pitch = np.repeat(table["pitch_ratio_command"].to_numpy(), rows)
    numbers = scenario.true
    for one in case.effects:
        numbers = with_effect(numbers, one, abs(sizes[one.key]))
    return scenario.noisy(scenario.simulate(numbers, waves=True))


def decide(cell: Cell) -> dict[str, Any]:
    """Diagnose, plan, record and diagnose again, with each kind of programme."""
    keys = () if cell.key == NOTHING else (cell.key,)
    case = draw_case(cell.seed, cell.number, keys=keys)
    simulated, ship = simulate_case(case), load_ship(case.ship)
    true, recording = cell.key.split("/")[0], simulated.recording
    first = diagnose(ship, recording)
    result: dict[str, Any] = {
        "effect": cell.key,
        "first": outcome_of(first, true),
        "open": "alternatives" if first.alternatives else "anything" if first.hidden else "",
    }
    if not result["open"]:
        return result
    with TemporaryDirectory() as folder:
        first.save(folder, page=False)
        question = read_question(Path(folder) / "report.json")

    def after(table: pd.DataFrame) -> str:
        try:
            again = second_recording(case, simulated.truth["sizes"], table)
        except StalledError:
            return STOPS
        both = diagnose(ship, recording, again[[c for c in again if c in recording]])
        return outcome_of(both, true)

    longest = MINUTES[-1]
    for name in (PLANNED,) if cell.key == NOTHING else (PLANNED, RANDOM):
        plan = plan_trial(
            question.models,
            question.noise,
            longest,
            LIMITS,
            uncertain=question.uncertain,
            seed=cell.number,
            pool=POOLS[name],
        )
        if name == PLANNED:
            result["expected"] = plan.least if len(plan.pairs) else None
        result[name] = after(plan.table)
        result[f"{name}_minutes"] = None
        for minutes in reversed(MINUTES):
            known = result[name] if minutes == longest else after(plan.table[: 60 * minutes])
            if known != "right":
                break
            result[f"{name}_minutes"] = float(minutes)
    if cell.key != NOTHING:
        result[ADVISED] = after(advised_programme(first, longest))
    return result


def asked_of(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the results of cases with a concealed effect that the first recording leaves open."""
    return [one for one in results if one["open"] and one["effect"] != NOTHING]


def summarise(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return how often each kind of programme ends with the right effect alone."""
    asked = asked_of(results)
    rows = []
    for name in (PLANNED, RANDOM, ADVISED):
        right = [one[name] == "right" for one in asked]
        minutes = [one.get(f"{name}_minutes") or math.inf for one in asked]
        measured = name != ADVISED
        rows.append(
            {
                "programme": name,
                "cases": len(asked),
                "right alone": sum(right),
                "share (95 %)": share(right),
                "among alternatives": sum(one[name] == "among alternatives" for one in asked),
                "a wrong name": sum(one[name] == "wrong" for one in asked),
                STOPS: sum(one[name] == STOPS for one in asked),
                **{
                    f"right from {most} min on": sum(m <= most for m in minutes)
                    if measured
                    else "–"
                    for most in MINUTES[:-1]
                },
                "minutes until right, median": float(np.median(minutes)) if measured else math.nan,
                "mean": float(np.minimum(minutes, MINUTES[-1]).mean()) if measured else math.nan,
            }
        )
    return pd.DataFrame(rows)


def discordant(results: Sequence[dict[str, Any]], other: str) -> tuple[int, int]:
    """Return in how many cases only the planned trial, and only another one, ends right.

    Args:
        results: results of cases.
        other: name of the other kind of programme.
    """
    asked = asked_of(results)
    pairs = [(one[PLANNED] == "right", one[other] == "right") for one in asked]
    return pairs.count((True, False)), pairs.count((False, True))


def sooner(results: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return in how many cases the planned trial, and the random one, needs fewer minutes."""
    asked = asked_of(results)
    pairs = [[one[f"{name}_minutes"] or math.inf for name in (PLANNED, RANDOM)] for one in asked]
    return sum(a < b for a, b in pairs), sum(a > b for a, b in pairs)


def undecided(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return the cases in which the planned trial does not end right, with the evidence it expected."""
    rows = [
        {
            "effect": one["effect"],
            "after the planned trial": one[PLANNED],
            "expected 2 log L of the closest pair": one["expected"],
        }
        for one in results
        if one["open"] and one[PLANNED] != "right"
    ]
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing cases, and write the page."""
    folder = "out/planned-trials"
    parser = make_parser("planned_trials", __doc__, f"{folder}/page", kept=folder, jobs=None)
    parser.add_argument("--cases", type=int, default=56, help="number of cases")
    parser.add_argument("--seed", type=int, default=6404, help="seed of the cases")
    options = parser.parse_args(arguments)
    wanted = {cell.name: cell for cell in cells_of(options.seed, options.cases)}
    found = sweep(decide, wanted, options.kept, jobs=options.jobs, tick=print_dot)
    results = [found[name] for name in wanted]
    table = pd.DataFrame(results)
    without = [one for one in results if one["effect"] == NOTHING]
    asked = [one for one in without if one["open"]]
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {},
        f"--cases {options.cases} --seed {options.seed}",
        summary=summarise(results),
        table=table.drop(columns="expected").fillna("–"),
        minutes=MINUTES[-1],
        lengths=", ".join(map(str, MINUTES)),
        count=len(results),
        without=len(without),
        asked_without=len(asked),
        stayed=sum(one[PLANNED] == "right" for one in asked),
        named_without=sum(one[PLANNED] == "wrong" for one in asked),
        against={name: discordant(results, name) for name in (RANDOM, ADVISED)},
        sooner=sooner(results),
        undecided=undecided(results),
        decided=DECIDED,
        settled=sum(not one["open"] for one in results),
        right=sum(one["first"] == "right" and not one["open"] for one in results),
    )


if __name__ == "__main__":
    main()
