"""A real positioning system, its numbers found: the page of :mod:`.runs` and its figure.

Run ``python -m reproductions emps --recordings FOLDER --out docs/results``; about four minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import page
from .diagnosed import diagnosed
from .runs import identified, load_runs, yardsticks


def main() -> None:
    """Identify, judge, and write ``emps.md``, its table and its figure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--recordings", type=Path, required=True, help="folder of estimation.csv and validation.csv"
    )
    parser.add_argument("--out", type=Path, default=Path("out/emps"), help="folder")
    options = parser.parse_args()
    runs = load_runs(options.recordings)

    def tick(stage: str, done: int, whole: int) -> None:
        print(f"{stage}: {done} of {whole}", flush=True)

    found, named = identified(runs, tick), diagnosed(runs, tick)
    page.write(options.out, found, yardsticks(runs), named, runs)
    print(f"page: {options.out / 'emps.md'}")


if __name__ == "__main__":
    main()
