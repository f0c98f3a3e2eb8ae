"""``shaftline plan-trial``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.models import read_model
from ..mismatch.planning.manoeuvres import Limits, PlanError
from ..mismatch.planning.plan import plan_trial
from ..mismatch.report.plan import (
    DATA,
    FIGURE,
    TABLE,
    intervals_in_words,
    pairs_in_words,
    plan_as_dict,
    read_question,
    save_plan,
)
from .console import check_folder, print_table, report_errors, say, stages
from .machine import add_results


def plan(
    report: Annotated[
        Path,
        typer.Argument(help="report.json of a diagnosis.", show_default=False),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the programme.")] = Path("out/plan"),
    minutes: Annotated[
        float, typer.Option(min=1.0, max=1440.0, help="Length of the trial [min].")
    ] = 30.0,
    limits: Annotated[
        Path | None,
        typer.Option(
            help="TOML file with the limits of the trial.", show_default="those of the ship"
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random manoeuvres.")] = 0,
) -> None:
    """Plan the manoeuvres that settle what a diagnosis left open.

    A diagnosis may end with alternatives: models that its recording cannot distinguish. The programme is
    composed of manoeuvres in which their predictions differ most, under the noise that the recording
    showed, although each model may change its parameters within their tolerances. For each pair of
    models the expected time until it is decided is printed, and which further instrument would shorten
    it. A pair counts as decided at a difference of 6 in 2 log L.

    If the recording has too little excitation, the models are the effects that it may hide. If a single
    model is left, the programme narrows the 95 % intervals of its effects.

    A limits file may have the keys `drive` and `pitch_ratio` (ranges of the commands), `rudder_deg`,
    `shaft_speed_rad_s` and `ship_speed_m_s` (ranges that are not left), `sea_room_m` (distance run),
    `shortest_hold_s`:

        drive = [12.0, 24.0]        # fuel rack in mm, voltage or torque

        ship_speed_m_s = [3.0, 9.0]

    Written: `plan.csv` (commands at every second, for `shaftline simulate --inputs`), `plan.json`,
    `plan.png`. Make the trial, then diagnose both recordings together.

    Examples:
        shaftline plan-trial out/trial/report.json --minutes 30 --out out/plan

        shaftline plan-trial out/trial/report.json --limits limits.toml --out out/plan

        shaftline diagnose trial.csv new.csv --ship mine.toml --out out/both
    """
    with report_errors():
        check_folder(out)
        models, noise, uncertain, text = read_question(report)
        say(text)
        allowed = Limits() if limits is None else read_model(Limits, limits, PlanError)
        with stages("planning") as tick:
            found = plan_trial(
                models, noise, minutes, allowed, uncertain=uncertain, seed=seed, tick=tick
            )
        save_plan(found, out)
        add_results(plan_as_dict(found))
        print_table(found.steps, f"Programme of {minutes:g} minutes", 3)
        for line in (*pairs_in_words(found), *intervals_in_words(found)):
            say(line)
        say(f"\ncommands: {out / TABLE}   picture: {out / FIGURE}   results: {out / DATA}")
