"""KVLCC2: wake and thrust deduction from the straight parts of zig-zag tests, judged on the zig-zags.

Run ``python -m reproductions kvlcc2 --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import page
from .numbers import found_by, found_in, refusals, sensitivity
from .oblique import own_terms
from .runs import BEFORE, SMALL, load_runs, ship_of
from .turning import sailed_by


def main() -> None:
    """Find the numbers, judge them, and write ``kvlcc2.md``, its table and its figure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--recordings", type=Path, required=True, help="folder of the CSVs")
    parser.add_argument("--out", type=Path, default=Path("out/kvlcc2"), help="folder")
    options = parser.parse_args()
    runs = load_runs(options.recordings)
    ship = ship_of(options.recordings)
    found = page.Findings(
        ship, runs, found_in(ship, runs, SMALL), found_in(ship, runs, BEFORE),
        refusals(ship, runs), sensitivity(ship, runs), found_by(ship, runs, SMALL),
        own_terms(ship, runs), sailed_by(options.recordings, runs),
    )  # fmt: skip
    page.write(options.out, found)
    print(found.small.summary())
    print(f"page: {options.out / 'kvlcc2.md'}")


if __name__ == "__main__":
    main()
