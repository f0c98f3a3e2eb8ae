"""A real ROV thruster, diagnosed, and its numbers found: the page of :mod:`.runs` and :mod:`.numbers`.

Run ``python -m reproductions rov_thruster --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import page
from .numbers import refits, refusals
from .runs import CONSTANTS, load_runs, splits, table_of


def main() -> None:
    """Diagnose, judge, and write ``rov-thruster.md``, its tables and its figure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--recordings", type=Path, required=True, help="folder of the nine CSVs")
    parser.add_argument("--out", type=Path, default=Path("out/rov-thruster"), help="folder")
    options = parser.parse_args()
    runs = load_runs(options.recordings)
    found = splits(runs)
    table = table_of(found)
    page.write(options.out, table, found, runs, refits(runs), refusals(runs))
    for one in found[CONSTANTS]:
        print(f"{one.unseen} unseen: {one.diagnosis.sentence}")
    print(f"page: {options.out / 'rov-thruster.md'}")


if __name__ == "__main__":
    main()
