"""Monitor ships whose hull, engine or shaft line has changed; write ``monitored-changes.md``.

The recordings come from the independent simulator of the validation. The result of each ship is kept in
the folder ``--kept``.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.sweep import sweep
from shaftline.mismatch.monitor import RISK, monitor
from shaftline.plant import load_ship
from shaftline.validation.cases import Case, draw_case, indices_of
from shaftline.validation.recording import Scenario, with_effect
from shaftline.validation.simulator.effects import FRIGATE

from .pages import make_parser, print_dot
from .writing import share, write_results

TITLE = "Monitored ships: changes found and false alarms"

CHANGES = {
    "hull-fouling/hull": ("hull.fouling_fraction", 0.02, 0.3),
    "engine-derating/engine": ("prime_mover.derating_fraction", 0.01, 0.1),
    "coulomb-friction/propeller": (
        "transmission.coulomb_friction_propeller_side_N_m",
        1_500.0,
        25_000.0,
    ),
}
"""Monitored parameter, smallest and largest size of each change, in the unit of the parameter."""

KEYS = tuple(key for key, *_ in CHANGES.values())

REFERENCES = 5
"""Number of recordings in the normal condition."""

SECONDS = 600.0
"""Length of a recording."""

EDGES = (0.0, 0.5, 1.0, 2.0, np.inf)
"""Classes of the size of a change over its detection limit."""


class Cell(NamedTuple):
    """One ship."""

    seed: int
    number: int
    key: str  # change, a key of CHANGES
    size: float  # in the unit of the parameter

    @property
    def name(self) -> str:
        """File name of the result."""
        return f"{self.seed}_{self.number}_{self.key.replace('/', '-')}"


def cells_of(seed: int, count: int) -> list[Cell]:
    """Return ships with changes of sizes drawn with equal probability per octave."""
    rng, keys = np.random.default_rng(seed), [*CHANGES]
    cells = []
    for k, index in enumerate(indices_of(seed, count, lambda kind: kind == "single")):
        key = keys[k % len(keys)]
        _, low, high = CHANGES[key]
        cells.append(Cell(seed, index, key, float(low * (high / low) ** rng.random())))
    return cells


def record(case: Case, turn: int, size: float) -> pd.DataFrame:
    """Return a recording of the ship of a case, with its own programme, sea and noise.

    Args:
        case: case with the change as its only effect.
        turn: number of the recording.
        size: of the change, in the simulator's unit; 0 for none.
    """
    seeds = np.random.SeedSequence([case.seed, case.index, turn]).generate_state(2)
    own = replace(case, programme_seed=int(seeds[0]), noise_seed=int(seeds[1]), seconds=SECONDS)
    scenario = Scenario(own)
    numbers = scenario.true
    if size:
        numbers = with_effect(numbers, case.effects[0], size)
    return scenario.noisy(scenario.simulate(numbers, waves=True))


def monitor_ship(cell: Cell) -> dict[str, Any]:
    """Monitor a ship in one recording without and one with a change, after its references."""
    case = draw_case(cell.seed, cell.number, keys=(cell.key,))
    sizes = [0.0] * (REFERENCES + 1) + [cell.size]
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = [folder / f"{turn:02d}.csv" for turn in range(len(sizes))]
        for turn, (file, size) in enumerate(zip(files, sizes, strict=True)):
            record(case, turn, size).to_csv(file, index=False)
        found = monitor(
            load_ship(FRIGATE),
            files[:REFERENCES],
            files[REFERENCES:],
            folder / "out",
            free=KEYS,
            jobs=1,
        )
    rows = found.changes.set_index(["recording", "key"])
    key, *_ = CHANGES[cell.key]
    now = rows.loc[(files[-1].name, key)]
    alarms = [
        [one for one in KEYS if bool(rows.loc[(file.name, one), "alarm"])]
        for file in files[REFERENCES:]
    ]
    return {
        "change": cell.key,
        "waves": case.wave_height,
        "true": cell.size,
        "found": float(now["change"]),
        "half_95": float(now["half_95"]),
        "detection_limit": float(now["detection_limit"]),
        "alarm": key in alarms[1],
        "other alarms": len([one for one in alarms[1] if one != key]),
        "false alarm": bool(alarms[0]),
    }


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Return how often a change raises an alarm, by its size over the detection limit."""
    relative = table["true"] / table["detection_limit"]
    rows = []
    for low, high in itertools.pairwise(EDGES):
        part = table[(relative >= low) & (relative < high)]
        within = (part["found"] - part["true"]).abs() <= part["half_95"]
        rows.append(
            {
                "size over detection limit": f"{low:g} to {high:g}"
                if high < np.inf
                else f"> {low:g}",
                "ships": len(part),
                "alarm of this parameter": share(part["alarm"]),
                "alarm of another": share(part["other alarms"] > 0),
                "95 % interval holds": share(within),
            }
        )
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing ships, and write the page."""
    folder = "out/monitored-changes"
    parser = make_parser("monitored_changes", __doc__, f"{folder}/page", kept=folder, jobs=None)
    parser.add_argument("--ships", type=int, default=45, help="number of ships")
    parser.add_argument("--seed", type=int, default=6701, help="seed of the ships")
    options = parser.parse_args(arguments)
    wanted = {cell.name: cell for cell in cells_of(options.seed, options.ships)}
    found = sweep(monitor_ship, wanted, options.kept, jobs=options.jobs, tick=print_dot)
    table = pd.DataFrame([found[name] for name in wanted])
    by_change = table.groupby("change")["detection_limit"].median()
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {},
        f"--ships {options.ships} --seed {options.seed}",
        summary=summarise(table),
        limits={CHANGES[key][0]: value for key, value in by_change.items()},
        count=len(table),
        references=REFERENCES,
        minutes=SECONDS / 60.0,
        risk=RISK,
        false_alarms=share(table["false alarm"]),
        keys=KEYS,
    )


if __name__ == "__main__":
    main()
