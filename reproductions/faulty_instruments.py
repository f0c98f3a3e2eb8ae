"""Diagnose recordings with a failing sensor, and count how often it is taken for missing physics.

Run ``python -m reproductions faulty_instruments --out docs/results``; 20 minutes on two cores.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from shaftline.core.sweep import digest_of, source_digest, sweep
from shaftline.mismatch import Options, diagnose
from shaftline.plant import RecordingError, load_ship
from shaftline.validation.cases import draw_case
from shaftline.validation.recording import simulate_case
from shaftline.validation.scoring import score
from shaftline.validation.simulator.effects import FRIGATE

from .pages import make_parser
from .writing import write_results

CHANNELS = ("shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s", "pitch_ratio")
NULLS, SINGLES = 3, 5
SEED = 4300  # seed of the recordings; no threshold was chosen on them
Values = NDArray[np.float64]


def _stop(share: float) -> Callable[[Values, Generator], Values]:
    def fault(values: Values, rng: Generator) -> Values:
        length = round(share * len(values))
        first = int(rng.integers(1, len(values) - length))
        broken = values.copy()
        broken[first : first + length] = broken[first]
        return broken

    return fault


def _strike(share: float, factor: float) -> Callable[[Values, Generator], Values]:
    def fault(values: Values, rng: Generator) -> Values:
        return np.where(rng.random(len(values)) < share, factor * values, values)

    return fault


def _clip(values: Values, _: Generator) -> Values:
    return np.minimum(values, np.percentile(values, 85.0))


SOUND = "is sound"
FAULTS: dict[str, Callable[[Values, Generator], Values]] = {
    SOUND: lambda values, _: values,
    "stops for a tenth": _stop(0.1),
    "stops for half": _stop(0.5),
    "drops to 0 in 0.2 % of the rows": _strike(0.002, 0.0),
    "drops to 0 in 2 %": _strike(0.02, 0.0),
    "shows twice as much in 2 %": _strike(0.02, 2.0),
    "cut off above its 85th percentile": _clip,
}
"""Faults of a channel by name."""


class Cell(NamedTuple):
    """A recording and its fault."""

    case: int
    fault: str
    channel: str


def diagnose_fault(cell: Cell) -> dict[str, Any]:
    """Diagnose a recording with a fault; return a row of the table."""
    case = draw_case(SEED, cell.case)
    reality = simulate_case(case)
    table = reality.recording.copy()
    rng = np.random.default_rng([SEED, cell.case, CHANNELS.index(cell.channel)])
    table[cell.channel] = FAULTS[cell.fault](table[cell.channel].to_numpy(), rng)
    about = {"case": cell.case, "kind": case.kind, "fault": cell.fault, "channel": cell.channel}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "recording.csv"
        table.to_csv(file, index=False)
        try:
            options = Options(exclude=case.exclude, quick=True)
            found = diagnose(load_ship(case.ship), file, options=options)
        except RecordingError as error:
            return about | {"outcome": "refused", "said": str(error).removeprefix(f"{file}: ")}
    row = score("shaftline", found.to_dict(), reality.truth, reality)
    return about | {"outcome": row["outcome"], "said": row["named"]}


def _cells() -> Iterator[Cell]:
    """Yield null cases and cases with one concealed effect, each with every fault on every channel."""
    for begin, most in (("null", NULLS), ("single", SINGLES)):
        cases = ((index, draw_case(SEED, index)) for index in count())
        fits = (k for k, case in cases if case.ship == FRIGATE and case.kind.startswith(begin))
        for index in islice(fits, most):
            yield Cell(index, SOUND, CHANNELS[0])
            yield from (Cell(index, f, channel) for f in [*FAULTS][1:] for channel in CHANNELS)


def _count(rows: pd.DataFrame) -> dict[str, int]:
    """Return the number of diagnoses by outcome."""
    outcome, alone = rows["outcome"], ~rows["said"].str.contains(r" \+ ")
    counts = {
        "refused": int((outcome == "refused").sum()),
        "nothing missing": int((outcome == "nothing-missing").sum()),
        "right": int((outcome.isin(["named", "class"]) & alone).sum()),
        "no known physics": int((outcome == "unexplained").sum()),
    }
    return counts | {"wrong name": len(rows) - sum(counts.values())}


def outcome_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the number of diagnoses by fault and outcome."""
    null = rows["kind"].str.startswith("null")
    table = []
    for fault in FAULTS:
        for what, among in (("nothing", null), ("one effect", ~null)):
            of = rows[among & (rows["fault"] == fault)]
            table.append({"one channel": fault, "missing": what, "of": len(of)} | _count(of))
    return pd.DataFrame(table)


def main(arguments: list[str] | None = None) -> None:
    """Diagnose, and write ``faulty-instruments.md`` and its table."""
    folder = "out/faulty-instruments"
    parser = make_parser("faulty_instruments", __doc__, folder, kept=f"{folder}/cells", jobs=2)
    parser.add_argument("--before", type=Path, help="table of an earlier release for comparison")
    options = parser.parse_args(arguments)
    source = source_digest("core", "plant", "mismatch", "validation")[:8]
    cells = {f"{digest_of(repr(cell))}-{source}": cell for cell in _cells()}
    found = sweep(diagnose_fault, cells, options.kept, jobs=options.jobs)
    rows = pd.DataFrame([found[name] for name in cells])
    before, more = None, ""
    if options.before is not None:
        before = outcome_table(pd.read_csv(options.before, na_filter=False))
        more = f"--before {options.before}"
    write_results(
        __file__,
        options.out,
        "Diagnosis with failing sensors",
        rows,
        {},
        more,
        null_cases=NULLS,
        singles=SINGLES,
        seed=SEED,
        table=outcome_table(rows),
        before=before,
    )


if __name__ == "__main__":
    main()
