"""How often the 95 % intervals of ``shaftline identify`` contain the truth, and how wide they are.

The recordings come from the independent simulator of the concealed cases: a frigate in calm water and
in waves, and a DC-motor thruster on a bench, at 10 Hz, with instruments of their own noise. Nothing is
concealed except parameters. Free parameters are biased in the ship file by up to :data:`MOST_BIAS`.
Every other parameter is biased by a normal deviate of the tolerance that the ship file states, so that
the intervals must include the tolerances. The free parameters change between recordings
(:data:`CHOICES`).

Run ``python -m shaftline.validation.coverage --out FOLDER``.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy

from ..core.sweep import source_digest, sweep
from ..display.tables import markdown, write_table
from ..mismatch import identify
from ..plant import Ship, load_ship
from .cases import Case, draw_case
from .recording import simulate_case
from .simulator.bench import CALM_PROGRAMME
from .simulator.effects import BENCH, FRIGATE
from .simulator.instruments import DULL
from .simulator.parameters import Parameters
from .variants import file_parameters, file_text

MOST_BIAS = 0.15
"""Largest relative bias of a free parameter in the ship file."""

WATERS = ("calm", "waves", "bench")

KEYS = {
    "resistance": "hull.resistance_coefficient_N_s2_m2",
    "inertia_front": "transmission.inertia_engine_side_kg_m2",
    "inertia_back": "transmission.inertia_propeller_side_kg_m2",
    "map_rack": "prime_mover.torque_per_rack_N_m_mm",
    "inertia": "transmission.inertia_engine_side_kg_m2",
    "kq": "propeller.torque_coefficient",
    "ohm": "prime_mover.armature_resistance_ohm",
    "constant": "prime_mover.motor_constant_V_s_rad",
}
"""Keys of the ship file by the simulator's name, for parameters that may be free."""

CHOICES = {
    FRIGATE: (
        ("resistance", "inertia_front", "inertia_back", "map_rack"),
        ("resistance", "map_rack"),
        ("inertia_front", "inertia_back"),
        ("resistance",),
        ("inertia_front", "map_rack"),
    ),
    BENCH: (("inertia", "kq", "ohm"), ("kq", "ohm", "constant"), ("inertia",), ("inertia", "kq")),
}
"""Choices of free parameters, by ship."""

TOLERANCE_OF_KEY = {
    FRIGATE: {
        "resistance": "resistance",
        "mass": "mass",
        "kt_scale": "thrust_curve",
        "rotative": "torque_curve",
        "inertia_front": "inertia",
        "inertia_back": "inertia",
        "map_rack": "torque_per_rack",
        "pitch_time": "pitch_time_constant",
    },
    BENCH: {
        "inertia": "inertia",
        "kq": "torque_curve",
        "ohm": "armature_resistance",
        "constant": "motor_constant",
    },
}
"""Relative tolerances of the ship file by the simulator's name of the parameter."""

INERTIA_BEHIND = 0.010
"""Inertia of the bench on the propeller side [kg m2], which its simulator adds to that of the motor."""


def water_of(case: Case) -> str:
    """Return the water of a case, one of :data:`WATERS`."""
    return "bench" if case.ship == BENCH else "waves" if case.wave_height > 0.0 else "calm"


def ship_of(case: Case) -> Ship:
    """Return the ship of a case with the values of its file."""
    if (text := file_text(case)) is None:
        return load_ship(case.ship)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "ship.toml").write_text(text, encoding="utf-8")
        return load_ship(Path(folder) / "ship.toml")


def free_parameters(case: Case) -> tuple[str, ...]:
    """Return the simulator's names of the parameters that are free in a case."""
    choices = CHOICES[case.ship]
    return choices[np.random.default_rng([case.seed, case.index, 78]).integers(len(choices))]


def cases(count: int, seed: int) -> list[Case]:
    """Return cases with biased parameters and no concealed effect.

    Args:
        count: number of cases in each of :data:`WATERS`.
        seed: seed of the cases.
    """
    found: dict[str, list[Case]] = {water: [] for water in WATERS}
    index = 0
    while min(map(len, found.values())) < count:
        case = draw_case(seed, index)
        if case.kind.startswith("null") and case.programme not in (DULL, CALM_PROGRAMME):
            found[water_of(case)].append(replace(case, factors=_factors(case)))
        index += 1
    return [case for water in WATERS for case in found[water][:count]]


def _factors(case: Case) -> Parameters:
    """Return the true parameters as factors on those of the ship file."""
    rng, tolerances = np.random.default_rng([case.seed, case.index, 77]), ship_of(case).tolerances
    low, high = 1.0 - MOST_BIAS, 1.0 + MOST_BIAS
    return {
        name: float(1.0 + getattr(tolerances, own) * rng.standard_normal())
        for name, own in TOLERANCE_OF_KEY[case.ship].items()
    } | {name: float(rng.uniform(low, high)) for name in free_parameters(case)}


def truth_of(case: Case, name: str) -> float:
    """Return the true value of a free parameter, in the unit of its key."""
    value = file_parameters(case)[name] * case.factors[name]
    return value - INERTIA_BEHIND if name == "inertia" else value


def evaluate_case(case: Case) -> dict[str, Any]:
    """Return value, standard error, interval and truth of each free parameter of one recording."""
    names = free_parameters(case)
    about = {"water": water_of(case), "free": ", ".join(names), "programme": case.programme}
    free = [KEYS[name] for name in names]
    try:
        found = identify(ship_of(case), simulate_case(case).recording, free=free)
    except ValueError as error:  # a parameter is not identifiable
        return about | {"refused": str(error)}
    numbers = {
        name: [e.value, e.standard_error, *e.ci95, truth_of(case, name)]
        for name, e in zip(names, found.estimates, strict=True)
    }
    return about | {"numbers": numbers}


def share_interval(hits: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Clopper and Pearson 1934)."""
    ends = scipy.stats.binomtest(hits, of).proportion_ci(0.95, "exact")
    return float(ends.low), float(ends.high)


def coverage_row(own: np.ndarray) -> dict[str, Any]:
    """Return the coverage and the widths of intervals.

    ``width / calibrated`` is the width of the intervals relative to the same intervals scaled in
    hindsight until exactly 95 % contain the truth. ``width / oracle`` is their median half-width
    relative to that of one fixed interval about the truth that contains 95 % of the estimates.

    Args:
        own: estimate, standard error, interval ends and truth, shape (intervals, 5).
    """
    value, error, low, high, truth = own.T
    inside = int(np.sum((low <= truth) & (truth <= high)))
    least, most = share_interval(inside, len(own))
    half, off = 0.5 * (high - low), value - truth
    return {
        "intervals": len(own),
        "covered %": 100.0 * inside / len(own),
        "from %": 100.0 * least,
        "to %": 100.0 * most,
        "mean error / s.e.": float(np.mean(off / error)),
        "sd of error / s.e.": float(np.std(off / error)),
        "median s.e. %": 100.0 * float(np.median(error / truth)),
        "median error %": 100.0 * float(np.median(np.abs(off / truth))),
        "width / calibrated": 1.0 / float(np.quantile(np.abs(off) / half, 0.95)),
        "width / oracle": float(np.median(half / truth) / np.quantile(np.abs(off / truth), 0.95)),
    }


def coverage(found: list[dict[str, Any]]) -> pd.DataFrame:
    """Return a row for each water and parameter, and one for all intervals together."""
    kept: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for one in found:
        for name, numbers in one["numbers"].items():
            kept[one["water"], name].append(numbers)
    rows = [
        {"water": water, "parameter": KEYS[name]} | coverage_row(np.array(kept[water, name]))
        for water in WATERS
        for name in KEYS
        if (water, name) in kept
    ]
    everything = coverage_row(np.concatenate([np.array(one) for one in kept.values()]))
    everything["width / oracle"] = np.nan  # a common width of all parameters has no meaning
    return pd.DataFrame([*rows, {"water": "all", "parameter": "all"} | everything])


def by_choice(found: list[dict[str, Any]]) -> pd.DataFrame:
    """Return the coverage for each choice of free parameters."""
    kept: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for one in found:
        kept[one["water"], one["free"]] += one["numbers"].values()
    rows = [
        {"water": water, "free": free} | coverage_row(np.array(own))
        for (water, free), own in sorted(kept.items())
    ]
    return pd.DataFrame(rows).iloc[:, :6]


def study(folder: Path, work: Path, count: int, seed: int, jobs: int | None) -> pd.DataFrame:
    """Evaluate recordings, resumably, and write ``coverage.csv`` and ``coverage.md``."""
    own = ("validation/simulator", "validation/coverage.py")
    code = source_digest("core", "plant", "mismatch", *own)
    cells = {f"{seed}-{case.index}-{code}": case for case in cases(count, seed)}
    done = itertools.count(1)

    def tick() -> None:
        print(f"{next(done)} of {len(cells)} recordings", flush=True)

    everything = list(sweep(evaluate_case, cells, work, jobs=jobs, tick=tick).values())
    found = [one for one in everything if "numbers" in one]
    refused = [one["refused"] for one in everything if "refused" in one]
    table = coverage(found)
    whole = table.iloc[-1]
    body = (
        f"{len(everything)} recordings of an independent simulator, seed {seed}, {count} each in calm "
        "water, in waves and of a DC-motor thruster on a bench. One to four parameters are free and "
        f"biased in the ship file by up to {MOST_BIAS:.0%}. Every other parameter is biased by a normal "
        "deviate of its tolerance. Of all intervals "
        f"**{whole['covered %']:.1f} %** contain the truth "
        f"({whole['from %']:.1f} to {whole['to %']:.1f} %, Clopper and Pearson).\n\n"
        f"{markdown(table, 2)}\n\n"
        "`width / calibrated` is the width of the intervals relative to the same intervals scaled in "
        "hindsight until exactly 95 % contain the truth: above 1 they are too wide, below 1 too narrow. "
        "`width / oracle` is the median half-width relative to that of one fixed interval that contains "
        "95 % of the estimates; such an interval needs the truth.\n\n"
        f"{markdown(by_choice(found), 1)}\n\n"
        f"{len(refused)} recordings were refused, because a parameter is not identifiable from them"
        f"{''.join(f'; {words}' for words in refused)}."
    )
    write_table(
        folder,
        "coverage",
        "Coverage of the 95 % intervals of identify",
        f"python -m shaftline.validation.coverage --out docs/results/identify "
        f"--records {count} --seed {seed}",
        table,
        body,
    )
    return table


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/identify"))
    parser.add_argument("--work", type=Path, default=Path("out/coverage"))
    parser.add_argument("--records", type=int, default=100, help="of each water")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=None)
    asked = parser.parse_args()
    print(study(asked.out, asked.work, asked.records, asked.seed, asked.jobs).to_string())


if __name__ == "__main__":
    main()
