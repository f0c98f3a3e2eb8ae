"""Formulas where no name fits: the page of :mod:`.bench` and its table.

Run ``python -m reproductions formulas --out docs/results``; about fifteen minutes on two cores.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from shaftline.core.sweep import sweep

from . import page
from .bench import diagnosed, searched
from .cases import cases


def main() -> None:
    """Search, judge, and write ``formulas.md`` and its table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/formulas"), help="folder")
    parser.add_argument("--kept", type=Path, default=Path("out/formulas/cases"), help="of results")
    parser.add_argument("--seed", type=int, default=300, help="of the first case")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args()
    every = cases(options.seed)
    named = {case.name: case for case in every}
    found = sweep(searched, named, options.kept / "searched", jobs=options.jobs)
    lacking = {case.name: case for case in every if case.truth is not None}
    whole = sweep(diagnosed, lacking, options.kept / "diagnosed", jobs=options.jobs)
    page.write(
        options.out,
        pd.DataFrame([found[name] for name in named]),
        pd.DataFrame([whole[name] for name in lacking]),
        options.seed,
    )
    print(f"page: {options.out / 'formulas.md'}")


if __name__ == "__main__":
    main()
