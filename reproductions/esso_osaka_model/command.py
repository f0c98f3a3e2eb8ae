"""What the surge of a real tanker model leaves out: the page of :mod:`.runs` and its figure.

Run ``python -m reproductions esso_osaka_model --recordings FOLDER --out docs/results``; ten
minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import page
from .runs import FREE, Recordings, diagnosed, nominal, surge_ship
from .turning import sailed_by


def main() -> None:
    """Identify, diagnose, judge, and write ``esso-osaka-model.md``, its table and its figure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--recordings", type=Path, required=True, help="folder of the CSV files")
    parser.add_argument("--out", type=Path, default=Path("out/esso-osaka-model"), help="folder")
    options = parser.parse_args()

    def tick(stage: str, done: int, whole: int) -> None:
        print(f"{stage}: {done} of {whole}", flush=True)

    with Recordings(options.recordings) as runs:
        ships = {"as assumed": runs.found(surge_ship()), "numbers found": nominal(runs, tick)}
        plain, ships["diagnosed"] = diagnosed(runs, tick=tick)
        moved, ships["diagnosed, numbers free"] = diagnosed(runs, FREE, tick=tick)
        said = {"diagnosed": plain, "diagnosed, numbers free": moved}
        for what, free in (("five effects", ()), ("five effects, numbers free", FREE)):
            said[what], ships[what] = diagnosed(runs, free, tick=tick, most=5)
        with Recordings(options.recordings, across=True) as steered:
            turned = sailed_by(steered, tick)
            page.write(options.out, runs, ships, said, (steered, turned))
    print(f"page: {options.out / 'esso-osaka-model.md'}")


if __name__ == "__main__":
    main()
