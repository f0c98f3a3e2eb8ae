"""Decide between the alternatives of diagnoses by planned trials; write ``planned-trials.md``.

The recordings come from the independent simulator of the validation. The result of each case is kept in
the folder ``--kept``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.sweep import sweep
from shaftline.mismatch import Diagnosis, Limits, Noise, diagnose, plan_trial
from shaftline.plant import load_ship
from shaftline.validation.cases import Case, case_kind, draw_case
from shaftline.validation.recording import Scenario, simulate_case, with_effect
from shaftline.validation.scoring import wilson
from shaftline.validation.simulator.effects import CONFOUNDED

from .pages import make_parser, print_dot
from .writing import write_results

TITLE = "Trials planned to decide between alternatives"
MINUTES = 15.0
LIMITS = Limits(drive=(14.0, 30.0), pitch_ratio=(0.95, 1.35))
"""Limits of the planned trial: commands that the frigate uses in service."""

PLANNED, RANDOM = "planned", "random"
POOLS = {PLANNED: 24, RANDOM: 1}
"""Random manoeuvres from which each one of a programme is chosen; with 1 the programme is random."""

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
    """Return cases in a nearly steady cruise, each with the next effect of the list."""
    found: list[Cell] = []
    index = 0
    while len(found) < count:
        if case_kind(seed, index)[0] == "confounded":
            found.append(Cell(seed, index, CONFOUNDED[len(found) % len(CONFOUNDED)]))
        index += 1
    return found


def outcome_of(diagnosis: Diagnosis, true: str) -> str:
    """Return whether a diagnosis names the concealed effect, alone or among alternatives.

    Args:
        diagnosis: result.
        true: id of the concealed effect.
    """
    named = [finding.effect.id for finding in diagnosis.findings]
    others = [label.split(" ")[0] for label in diagnosis.alternatives]
    if named == [true] and not others:
        return "right"
    if true in named or true in others:
        return "among alternatives"
    return "wrong" if named else "not named"


def second_recording(case: Case, sizes: dict[str, float], table: pd.DataFrame) -> pd.DataFrame:
    """Return the independent simulator's recording of a programme, by the ship of a case.

    Args:
        case: case.
        sizes: sizes of the concealed effects by key, with their sign.
        table: programme with a row a second.
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
    """Diagnose, plan, record and diagnose again, with a planned and with a random programme."""
    case = draw_case(cell.seed, cell.number, keys=(cell.key,))
    simulated, ship = simulate_case(case), load_ship(case.ship)
    true = cell.key.split("/")[0]
    recording = simulated.recording
    first = diagnose(ship, recording)
    result: dict[str, Any] = {
        "effect": cell.key,
        "first": outcome_of(first, true),
        "alternatives": len(first.alternatives),
    }
    if not first.alternatives:
        return result
    models = {"corrected ship": first.corrected, **first.alternatives}
    noise = {column: Noise(*one) for column, one in first.noise.items() if one[0] > 0.0}
    for name, pool in POOLS.items():
        plan = plan_trial(models, noise, MINUTES, LIMITS, seed=cell.number, pool=pool)
        again = second_recording(case, simulated.truth["sizes"], plan.table)
        both = diagnose(ship, recording, again[[c for c in again if c in recording]])
        result[name] = outcome_of(both, true)
        result[f"{name}_expected"] = plan.least
        result[f"{name}_minutes"] = float(plan.pairs["minutes"].max(skipna=False))
    return result


def summarise(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return how often each kind of programme ends with the right effect alone."""
    asked = [one for one in results if one["alternatives"]]
    rows = []
    for name in POOLS:
        right = sum(one[name] == "right" for one in asked)
        wrong = sum(one[name] == "wrong" for one in asked)
        low, high = wilson(right, len(asked))
        minutes = [one[f"{name}_minutes"] for one in asked]
        known = [np.inf if m is None or np.isnan(m) else m for m in minutes]
        rows.append(
            {
                "programme": name,
                "cases": len(asked),
                "right alone": right,
                "share (95 %)": f"{right / len(asked):.2f} ({low:.2f} to {high:.2f})",
                "a wrong name": wrong,
                "expected minutes, median": float(np.median(known)),
            }
        )
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing cases, and write the page."""
    folder = "out/planned-trials"
    parser = make_parser("planned_trials", __doc__, f"{folder}/page", kept=folder, jobs=None)
    parser.add_argument("--cases", type=int, default=28, help="number of cases")
    parser.add_argument("--seed", type=int, default=6301, help="seed of the cases")
    options = parser.parse_args(arguments)
    wanted = {cell.name: cell for cell in cells_of(options.seed, options.cases)}
    found = sweep(decide, wanted, options.kept, jobs=options.jobs, tick=print_dot)
    results = [found[name] for name in wanted]
    table = pd.DataFrame(results)
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {},
        f"--cases {options.cases} --seed {options.seed}",
        summary=summarise(results),
        table=table.fillna("–"),
        minutes=MINUTES,
        count=len(results),
        decided=sum(not one["alternatives"] for one in results),
        right=sum(one["first"] == "right" for one in results),
    )


if __name__ == "__main__":
    main()
