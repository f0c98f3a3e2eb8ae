"""How often the 95 % intervals of ``shaftline identify`` hold the truth.

The recordings are the concealed cases' own: an independent reality sails each programme, in calm water
and in waves, with instruments of its own noise. Nothing is concealed but the numbers: those that are
then freed are wrong in the file by up to :data:`WRONG`, the rest are right.

Run ``python -m shaftline.proof.coverage --out FOLDER``.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy

from ..core.sweep import source_digest, sweep
from ..display.tables import markdown, write_table
from ..mismatch import identify
from ..plant import load_ship
from .cases import Case, draw_case
from .reality.crew_demands import DULL
from .reality.effects import FRIGATE
from .recording import make

WRONG = 0.15
"""Most by which a freed number is wrong in the file, as a share of the truth."""

KEYS = {
    "resistance": "hull.resistance_coefficient_N_s2_m2",
    "inertia_front": "transmission.inertia_engine_side_kg_m2",
    "inertia_back": "transmission.inertia_propeller_side_kg_m2",
    "map_rack": "prime_mover.torque_per_rack_N_m_mm",
}
"""Freed numbers: the reality's name, and the key of the ship's file."""


def cases(count: int, seed: int) -> list[Case]:
    """Frigates with wrong numbers and nothing concealed, calm and in waves."""
    found: list[Case] = []
    index = 0
    while len(found) < count:
        case = draw_case(seed, index)
        if case.kind.startswith("null") and case.ship == FRIGATE and case.programme != DULL:
            rng = np.random.default_rng([seed, index, 77])
            factors = {name: float(rng.uniform(1.0 - WRONG, 1.0 + WRONG)) for name in KEYS}
            found.append(replace(case, factors=factors))
        index += 1
    return found


def judged(case: Case) -> dict[str, Any]:
    """One recording: value, standard error and truth of each number."""
    ship = load_ship(FRIGATE)
    waves = case.wave_height > 0.0
    try:
        found = identify(ship, make(case).recording, free=list(KEYS.values()))
    except ValueError as error:  # a recording that does not tell a number
        return {"waves": waves, "refused": str(error)}
    return {
        "waves": waves,
        "numbers": {
            e.key: [
                e.value,
                e.standard_error,
                *e.ci95,
                ship.number(e.key).value * case.factors[name],
            ]
            for name, e in zip(KEYS, found.estimates, strict=True)
        },
    }


def interval(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share (Clopper and Pearson 1934)."""
    low = float(scipy.stats.beta.ppf(0.025, hits, of - hits + 1)) if hits else 0.0
    high = float(scipy.stats.beta.ppf(0.975, hits + 1, of - hits)) if hits < of else 1.0
    return low, high


def coverage(found: list[dict[str, Any]]) -> pd.DataFrame:
    """Share of intervals that hold the truth, by number and water, and what the errors are like."""
    rows = []
    for waves in (False, True):
        for key in KEYS.values():
            own = np.array([one["numbers"][key] for one in found if one["waves"] == waves])
            value, error, low, high, truth = own.T
            inside = int(np.sum((low <= truth) & (truth <= high)))
            least, most = interval(inside, len(own))
            rows.append(
                {
                    "water": "waves" if waves else "calm", "number": key, "records": len(own),
                    "covered %": 100.0 * inside / len(own),
                    "from %": 100.0 * least, "to %": 100.0 * most,
                    "mean error / s.e.": float(np.mean((value - truth) / error)),
                    "sd of error / s.e.": float(np.std((value - truth) / error)),
                    "median s.e. %": 100.0 * float(np.median(error / truth)),
                    "median error %": 100.0 * float(np.median(np.abs(value / truth - 1.0))),
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def study(folder: Path, work: Path, count: int, seed: int, jobs: int | None) -> pd.DataFrame:
    """Judge recordings, resumably, and write ``coverage.csv`` and ``coverage.md``."""
    code = source_digest("core", "plant", "mismatch", "proof/reality")
    cells = {f"{seed}-{case.index}-{code}": case for case in cases(count, seed)}
    done = [0]

    def tick() -> None:
        done[0] += 1
        print(f"{done[0]} of {len(cells)} recordings", flush=True)

    everything = list(sweep(judged, cells, work, jobs=jobs, tick=tick).values())
    found = [one for one in everything if "numbers" in one]
    refused = [one["refused"] for one in everything if "refused" in one]
    table = coverage(found)
    inside = float(np.average(table["covered %"], weights=table["records"]))
    body = (
        f"{len(everything)} recordings of an independent reality, seed {seed}: nothing is concealed "
        f"but four numbers, wrong in the file by up to {WRONG:.0%}, all of them free. The others are "
        "right, and may move inside their tolerances. Of all intervals "
        f"**{inside:.1f} %** hold the truth.\n\n{markdown(table, 2)}\n\n"
        f"{len(refused)} of them were refused, because they do not tell a number"
        f"{''.join(f': {words}' for words in refused)}.\n\n"
        "A standard deviation of error / s.e. above 1 would mean intervals too narrow, below 1 too wide."
    )
    write_table(
        folder, "coverage", "Do the 95 % intervals of identify hold the truth?",
        f"python -m shaftline.proof.coverage --out docs/results/identify "
        f"--records {count} --seed {seed}",
        table, body,
    )  # fmt: skip
    return table


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/identify"))
    parser.add_argument("--work", type=Path, default=Path("out/coverage"))
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=None)
    asked = parser.parse_args()
    print(study(asked.out, asked.work, asked.records, asked.seed, asked.jobs).to_string())


if __name__ == "__main__":
    main()
