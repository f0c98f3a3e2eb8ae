"""``shaftline monitor``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..mismatch.identification.free_parameters import read_free_keys
from ..mismatch.monitor import monitor, recordings_in
from ..mismatch.report.monitor import (
    DATA,
    FIGURE,
    TABLE,
    monitoring_as_dict,
    monitoring_in_words,
    parameters_table,
    save_monitoring,
)
from ..plant import load_ship
from .console import BelievedShip, ColumnMap, Jobs, check_folder, progress, report_errors, say
from .machine import add_results
from .method_options import AUTO, DEFAULT, Method
from .source import constant

_RISK: float = constant("mismatch/monitor.py", "RISK")


def condition(
    references: Annotated[list[Path], typer.Argument(
        help="Recordings (CSV or Parquet) in the normal condition, or folders of them.",
        metavar="REFERENCE...", show_default=False)],
    against: Annotated[list[Path], typer.Option(
        help="Later recording, or a folder of them; repeatable.", show_default=False)],
    ship: BelievedShip,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/monitor"),
    free: Annotated[str, typer.Option(
        help="Keys of the ship file to monitor, separated by commas; or `auto`: those that the first "
        "reference identifies.")] = AUTO,
    method: Method = DEFAULT,
    columns: ColumnMap = None,
    risk: Annotated[float, typer.Option(
        help="Probability of a false alarm in a recording.")] = _RISK,
    jobs: Jobs = None,
) -> None:  # fmt: skip
    """Say which parameters of a ship have changed since its reference recordings, and by how much.

    The same parameters are identified in every recording by itself, with any method of `shaftline
    identify` and any ship or rig. The references give the normal value of each parameter and its scatter
    between recordings. A later estimate beyond the threshold is an alarm; without a change, a recording
    raises one with the probability `--risk`. The detection limit is the change that raises an alarm in
    90 % of the recordings. Three later recordings or more also give a trend.

    Three references or more are needed for honest thresholds. They and the later recordings should
    excite the ship alike, as by the same programme.

    Written: `monitor.csv` (each estimate with its change), `monitor.json`, `monitor.png`. A stopped run
    resumes. A recording that cannot be used is named; the others are compared all the same.

    Examples:
        shaftline monitor january.csv february.csv march.csv --against june.csv --ship mine.toml

        shaftline monitor reference/ --against 2026/ --ship mine.toml --out out/monitor
            --free hull.resistance_coefficient_N_s2_m2,prime_mover.efficiency
    """
    with report_errors(resumes=True):
        check_folder(out)
        vessel = load_ship(ship)
        keys = read_free_keys(free, vessel)
        count = len(recordings_in(references)) + len(recordings_in(against))
        with progress("identifying", count) as tick:
            found = monitor(
                vessel,
                references,
                against,
                out,
                free=keys,
                method=method,
                columns=columns,
                risk=risk,
                jobs=jobs,
                tick=tick,
            )
        save_monitoring(found, out)
        add_results(monitoring_as_dict(found))
        for row in parameters_table(found).to_dict("records"):
            limit = row.get("detection_limit", float("nan"))
            say(
                f"{row['key']} [{row['unit']}]: normal {row['normal']:.4g}, scatter between recordings "
                f"{row['scatter']:.2g}, detection limit {limit:.2g}"
            )
        for text in monitoring_in_words(found):
            say(text)
        say(f"\nchanges: {out / TABLE}   picture: {out / FIGURE}   results: {out / DATA}")
