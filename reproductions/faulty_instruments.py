"""Instruments that fail on the way: is a broken sensor taken for missing physics?

Run ``python -m reproductions faulty_instruments --out docs/results``; 20 minutes
on two cores. What is diagnosed is kept, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
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
from shaftline.display.tables import markdown, write_table
from shaftline.mismatch import Options, diagnose
from shaftline.plant import RecordingError, load_ship
from shaftline.validation.cases import draw_case
from shaftline.validation.reality.effects import FRIGATE
from shaftline.validation.recording import make
from shaftline.validation.scoring import score

CHANNELS = ("shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s", "pitch_ratio")
NULLS, SINGLES = 3, 5
SEED = 4300
"""Of recordings that no threshold was chosen on."""

Values = NDArray[np.float64]


def _stopped(share: float) -> Callable[[Values, Generator], Values]:
    def fault(values: Values, rng: Generator) -> Values:
        length = round(share * len(values))
        first = int(rng.integers(1, len(values) - length))
        broken = values.copy()
        broken[first : first + length] = broken[first]
        return broken

    return fault


def _struck(share: float, factor: float) -> Callable[[Values, Generator], Values]:
    def fault(values: Values, rng: Generator) -> Values:
        return np.where(rng.random(len(values)) < share, factor * values, values)

    return fault


def _cut_off(values: Values, _: Generator) -> Values:
    return np.minimum(values, np.percentile(values, 85.0))


SOUND = "is sound"
FAULTS: dict[str, Callable[[Values, Generator], Values]] = {
    SOUND: lambda values, _: values,
    "stops for a tenth": _stopped(0.1),
    "stops for half": _stopped(0.5),
    "drops to 0 in 0.2 % of the rows": _struck(0.002, 0.0),
    "drops to 0 in 2 %": _struck(0.02, 0.0),
    "shows twice as much in 2 %": _struck(0.02, 2.0),
    "cut off above its 85th percentile": _cut_off,
}
"""By name: what becomes of a channel."""


class Cell(NamedTuple):
    """A recording and what is broken in it."""

    case: int
    fault: str
    channel: str

    @property
    def name(self) -> str:
        """Of its result."""
        return digest_of(repr(self))


def diagnosed(cell: Cell) -> dict[str, Any]:
    """What the diagnosis makes of it: a row."""
    case = draw_case(SEED, cell.case)
    reality = make(case)
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


def _chosen() -> Iterator[Cell]:
    """Recordings of the frigate: some in which nothing is missing, some with one effect concealed."""

    def of_kind(begin: str) -> Iterator[int]:
        for index in count():
            case = draw_case(SEED, index)
            if case.ship == FRIGATE and case.kind.startswith(begin):
                yield index

    for index in [*islice(of_kind("null"), NULLS), *islice(of_kind("single"), SINGLES)]:
        yield Cell(index, SOUND, CHANNELS[0])
        for fault in list(FAULTS)[1:]:
            for channel in CHANNELS:
                yield Cell(index, fault, channel)


def _parted(rows: pd.DataFrame) -> dict[str, int]:
    """How many of some diagnoses ended in which way."""
    alone = ~rows["said"].str.contains(r" \+ ")
    told = {
        "refused": rows["outcome"] == "refused",
        "nothing missing": rows["outcome"] == "nothing-missing",
        "right": rows["outcome"].isin(["named", "class"]) & alone,
        "no known physics": rows["outcome"] == "unexplained",
    }
    counts = {name: int(of.sum()) for name, of in told.items()}
    return counts | {"wrong name": len(rows) - sum(counts.values())}


def counted(rows: pd.DataFrame) -> pd.DataFrame:
    """Of each fault, how often it was refused and what was made of it otherwise.

    Args:
        rows: as of :func:`diagnosed`.
    """
    null = rows["kind"].str.startswith("null")
    told = []
    for fault in FAULTS:
        for what, among in (("nothing", null), ("one effect", ~null)):
            of = rows[among & (rows["fault"] == fault)]
            told.append({"one channel": fault, "missing": what, "of": len(of)} | _parted(of))
    return pd.DataFrame(told)


BODY = """\
{nulls} recordings of the independent frigate of [the validation](validation/validation.md) in which
nothing is missing and {singles} in which one effect is concealed, of seed {seed}, on which nothing was
tuned. In each, one of shaft speed, torque, ship speed and pitch is broken in turn: it stops, drops out,
jumps or is cut off, at random times.

{table}

*Refused*: with the channel, the row and what to do. *No known physics*: the report says that
something differs, where, and that nothing of the catalogue explains it, which is true of a broken
instrument; where one stopped, it warns of that too. *Wrong name*: physics is named that is not
there, alone or beside what is, which is the one error that costs its reader something. A sound
recording is the bound: what is too weak to be named there is not named here either. The trap is the
column *nothing missing*: where a channel stops for a while and the verdict is that, it rests on
less than it seems to.
{before}"""

BEFORE = """
The release before did not look for dropouts, and only warned of a sensor that stops. By it, the same:

{table}"""


def main(arguments: list[str] | None = None) -> None:
    """Break, diagnose, and write ``faulty-instruments.md`` and its table."""
    parser = argparse.ArgumentParser(
        "python -m reproductions faulty_instruments", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/faulty-instruments"), help="folder")
    add("--kept", type=Path, default=Path("out/faulty-instruments/cells"), help="of results")
    add("--before", type=Path, help="table of an earlier release, to be shown beside")
    add("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args(arguments)
    source = source_digest("core", "plant", "mismatch", "validation")[:8]
    cells = {f"{cell.name}-{source}": cell for cell in _chosen()}
    found = sweep(diagnosed, cells, options.kept, jobs=options.jobs)
    rows = pd.DataFrame([found[name] for name in cells])
    before = ""
    if options.before is not None:
        before = BEFORE.format(
            table=markdown(counted(pd.read_csv(options.before, na_filter=False)))
        )
    body = BODY.format(
        nulls=NULLS, singles=SINGLES, seed=SEED, table=markdown(counted(rows)), before=before
    )
    command = "python -m reproductions faulty_instruments --out docs/results"
    if options.before is not None:
        command += f" --before {options.before}"
    write_table(
        options.out, "faulty-instruments", "Instruments that fail on the way", command, rows, body
    )
    print(f"page: {options.out / 'faulty-instruments.md'}")


if __name__ == "__main__":
    main()
