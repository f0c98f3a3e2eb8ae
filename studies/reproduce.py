"""The thesis's tables and figures, ours beside the printed ones, written to a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from ..display import figures
from ..display.tables import markdown, write_table
from ..observers import follow, get_observer, readings_of
from ..observers.metrics import variance_accounted_for
from ..plant import Ship, linearise, load_ship
from .augmented_filter import destroyer, destroyer_page, esso_osaka, esso_osaka_page
from .augmented_filter import page as filter_page
from .augmented_filter import results as filter_results
from .ferry import levers
from .ferry.lever_tables import against_combinator
from .reproduced import Reproduced, Tick
from .side_by_side import reasons_text, side_by_side
from .steering import page as steering_page
from .steering import results as steering_results
from .storms import page as storm_page
from .storms import results as storm_results
from .thesis import (
    dead_beat,
    load_cases,
    poles,
    rounded_table,
    sensitivity,
    snr,
    vaf,
    verification,
    working_points,
)
from .thesis.load_cases import CASES
from .tito_neri import identification_page


def _numbers(comparison: pd.DataFrame) -> dict[str, dict[str, float]]:
    wide = comparison.pivot(index="row", columns="column", values="ours")
    return {
        str(row): {str(c): float(v) for c, v in values.items() if pd.notna(v)}
        for row, values in wide.iterrows()
    }


def _finished(
    name: str, title: str, comparison: pd.DataFrame, folder: Path, digits: int, extra: str = ""
) -> Reproduced:
    shown = side_by_side(comparison, digits)
    reasons = reasons_text(comparison)
    body = (
        "Ours, with the thesis's number in parentheses.\n\n"
        f"{markdown(shown)}\n\nWhere they differ, and why:\n\n{reasons}\n{extra}"
    )
    write_table(folder, name, title, f"shaftline reproduce {name}", comparison, body)
    return Reproduced(f"{title}: ours (thesis)", shown, reasons, _numbers(comparison))


def reproduce_working_points(folder: Path, tick: Tick) -> Reproduced:
    """Table 2-1."""
    comparison = working_points.compared()
    tick()
    return _finished("working-points", "Working points (Table 2-1)", comparison, folder, 3)


def reproduce_poles(folder: Path, tick: Tick) -> Reproduced:
    """Tables 2-2 to 2-14, 3-5, 3-9 and 3-11 to 3-14; Figure 2-5."""
    plant, observers = poles.compared()
    frigate = load_ship("frigate")
    point, middle = verification.mid_range_point(frigate), verification.mid_range(frigate)
    tick()
    title = "Poles, zeros and steady gains (Tables 2-2 to 2-14, 3-5, 3-9, 3-11 to 3-14)"
    shown = plant.drop(columns="why")
    whys = plant[plant["why"] != ""].groupby("why", sort=False)["table"]
    reasons = "\n".join(
        f"- {why} (tables {', '.join(dict.fromkeys(tables))})" for why, tables in whys
    )
    body = (
        f"{markdown(shown, 4)}\n\nWhere gains differ by more than 2 %, and why:\n\n{reasons}\n\n"
        f"## Observers\n\n{markdown(observers)}\n\n"
        f"## The random-walk Kalman filter (Tables 3-11 to 3-14)\n\n{dead_beat.WHY}\n\n"
        f"{_told_filter(frigate)}\n\n"
        "## The mid-range point (Tables 2-16 to 2-23)\n\n"
        f"The thesis does not print this point. Its two gains from the rack are met at X = "
        f"{point.inputs.drive:.2f} mm, P/D = {point.state.pitch_ratio:.3f} "
        f"({point.state.shaft_speed:.2f} rad/s, {point.state.ship_speed:.2f} m/s); everything else in "
        "this table is then a prediction. From the pitch to the shaft speed our gain is that of "
        "Vrijdag & Stapersma, not the thesis's; from the pitch to the ship speed it differs from both, "
        "even in sign: a shaft that the pitch slows takes less power from an engine whose torque "
        "hardly changes.\n\n"
        f"{markdown(middle)}\n\n"
        "![Bode plot at A to D](figures/bode.png)\n\n"
        "![Bode plot at the mid-range point](figures/bode-mid-range.png)\n"
    )
    write_table(folder, "poles", title, "shaftline reproduce poles", plant, body)
    figures.save(
        figures.bode(poles.models(frigate), "Linear frigate at A to D (Figure 2-5)"),
        folder / "figures" / "bode.png",
    )
    at_point = {"ours": linearise(frigate, point, outputs=("shaft_speed", "ship_speed"))}
    at_point |= {name: verification.printed_model(name) for name in verification.SOURCES}
    figures.save(
        figures.bode(at_point, "Linear frigate at the mid-range point (Figure 2-6)"),
        folder / "figures" / "bode-mid-range.png",
    )
    numbers = {
        f"{r.table} {r.point}": {"gain": float(r.gain), "gain_thesis": float(r.gain_thesis)}
        for r in plant.itertuples()
    }
    return Reproduced(title, shown, reasons, numbers)


def _told_filter(frigate: Ship) -> str:
    table = dead_beat.compared(frigate)
    gains = {name: table[name].map("{:.3g}".format) for name in ("gain follows", "gain printed")}
    return markdown(table.assign(**gains), 4)


def reproduce_vaf(folder: Path, tick: Tick) -> Reproduced:
    """Table 4-1; Figures A-1 to A-11."""
    comparison = vaf.compared(tick)
    extra = (
        f"\nThe sea's column is the mean of {vaf.SEA_SEEDS} seeds. `random-walk-kalman` is the filter "
        "as printed; `random-walk-kalman-extended` is ours, which keeps its own shaft speed.\n\n"
        "The scores of the two steps hang on the record's length, which the thesis does not print; "
        f"ours are {load_cases.RACK_STEP_DURATION:g} s and {load_cases.PITCH_STEP_DURATION:g} s, "
        "chosen to meet three printed scores (rack step: Luenberger low; pitch step: I&I low and "
        "random-walk Kalman). The other scores of these columns follow without a choice. Likewise "
        "assumed: the resistance sine's amplitude, 0.25.\n\n"
        "## How much the thesis's inverse table may cost\n\n"
        f"{markdown(rounded_table.rounded_scores())}\n\n"
        "Here KQ is inverted by the nearest entry of a table with steps of "
        f"{rounded_table.PITCH_STEP:g} in P/D and {rounded_table.ADVANCE_STEP:g} in J, steps chosen to "
        "meet the scores of the shaft acceleration observer, which would be 100 with an exact inverse. "
        "It explains their size in every column, and not the power balance's 23.60 in the pitch step, "
        "for which we know no reason.\n\n"
        "Time traces: " + ", ".join(f"[{r}](figures/traces-{r}.png)" for r in vaf.ROWS) + "\n"
    )
    result = _finished("vaf", "Variance accounted for, % (Table 4-1)", comparison, folder, 2, extra)
    _draw_traces(folder / "figures")
    tick()
    return result


def _draw_traces(folder: Path) -> None:
    frigate = load_ship("frigate")
    dt = frigate.time_step_s
    runs = {name: CASES[name].run(frigate) for name in vaf.COLUMNS}
    for row, observer in vaf.ROWS.items():
        records: dict[str, Any] = {}
        for name, samples in runs.items():
            truth = samples["advance_velocity"]
            estimate, _ = follow(get_observer(observer), frigate, readings_of(samples), dt)
            score = variance_accounted_for(truth, estimate)
            end = samples["time"][-1]
            shown = samples["time"] >= (end - 60.0 if name == "jonswap" else 0.0)
            if name == "inflow_sine_high":
                shown = samples["time"] <= 10.0
            records[name] = (samples["time"][shown], truth[shown], estimate[shown], score)
        figure = figures.observer_traces(f"Advance velocity estimated by {row}", records)
        figures.save(figure, folder / f"traces-{row}.png", dpi=75)


def reproduce_snr(folder: Path, tick: Tick) -> Reproduced:
    """Table 4-2 and Figures 4-2 and 4-3."""
    comparison = snr.compared(tick)
    scan = snr.sample_time_scan(tick)
    sweep = snr.gain_sweep(tick)
    clean = vaf.vaf_table(tick)
    extra = (
        f"\nNoise sample time {snr.SAMPLE_TIME_S:g} s, {snr.SEEDS} seeds; noise on omega, M_m, "
        "omega' and P/D. Over other sample times (8 seeds):\n\n"
        f"{markdown(scan.reset_index(names='row'), 1)}\n\n"
        "The thesis must have used 0.01 s: the fast Luenberger observer, which differentiates, moves "
        "by 6 dB for every halving of the sample time and meets its 67.6 dB there only.\n\n"
        "![Trade-off](figures/trade-off.png)\n\n![Gain](figures/gain-sweep.png)\n"
    )
    figures.save(figures.trade_off(comparison, clean), folder / "figures" / "trade-off.png")
    figures.save(figures.gain_sweep(sweep), folder / "figures" / "gain-sweep.png")
    title = "Signal-to-noise ratio for 95 % of the noiseless VAF, dB (Table 4-2)"
    return _finished("snr", title, comparison, folder, 1, extra)


def reproduce_sensitivity(folder: Path, tick: Tick) -> Reproduced:
    """Table 5-1."""
    comparison = sensitivity.compared(tick)
    title = "Change of VAF with wrong knowledge of the ship, points (Table 5-1)"
    return _finished("sensitivity", title, comparison, folder, 2)


def reproduce_storms(folder: Path, tick: Tick) -> Reproduced:
    """Table 1 of the anti-spin paper, beside storms at sea."""
    found = storm_results.measured(tick)
    beside = storm_results.beside_table_1(found.numbers)
    title = "Storms: anti-spin over without"
    body = storm_page.body(found, beside)
    write_table(folder, "storms", title, "shaftline reproduce storms", found.numbers, body)
    picture = storm_page.figure(found.traces, load_ship("frigate").time_step_s)
    figures.save(picture, folder / "figures" / "storms.png")
    numbers = beside.set_index("storm").to_dict("index")
    return Reproduced(title, beside, storm_page.WHY, numbers)


def reproduce_levers(folder: Path, tick: Tick) -> Reproduced:
    """Tables 1 to 3 of the CPP optimiser paper."""
    whole = levers.whole_envelope(levers.write(folder, tick))
    keys = ["ship", "curve", "condition", "control", "lever"]
    numbers = {
        " / ".join(map(str, row[keys])): row.drop([*keys, "active"]).dropna().to_dict()
        for _, row in whole.iterrows()
    }
    return Reproduced(levers.CHANGE, against_combinator(whole), levers.FINDINGS, numbers)


def reproduce_tito_neri(folder: Path, tick: Tick) -> Reproduced:
    """Table 5 of the identification paper, its Bode figures, and its methods on known truth."""
    found = identification_page.gathered(tick)
    identification_page.write(folder, found)
    table = found.table_five
    numbers = {
        str(name): dict(zip(part["parameter"], map(float, part["ours"]), strict=True))
        for name, part in table.groupby("set", sort=False)
    }
    return Reproduced(
        "Drive train of Tito Neri (Table 5)",
        table.assign(ours=[f"{value:.4g}" for value in table["ours"]],
                     printed=[f"{value:.3g}" for value in table["printed"]]),
        "- see the page: rounding of Table 4, and poles read off a plot",
        {"table-5": numbers},
    )  # fmt: skip


def reproduce_augmented_filter(folder: Path, tick: Tick) -> Reproduced:
    """Falling body of Taylor 2000, and the same filter on the frigate."""
    found = filter_results.measured(tick)
    name, body = "augmented-filter", filter_page.body(found)
    write_table(folder, name, filter_page.TITLE, f"shaftline reproduce {name}", found.falls, body)
    figures.save(filter_page.figure(found), folder / "figures" / f"{name}.png")
    numbers: dict[str, dict[str, float]] = {}
    for row in found.falls.to_dict("records"):
        of = numbers.setdefault(f"falling body, beta {row['beta']:g}, {row['readings']}", {})
        of[str(row["quantity"])] = float(row["median"])
    shown = filter_page.story_table(found)
    return Reproduced(filter_page.TITLE, shown, filter_page.WHY, numbers)


def reproduce_esso_osaka(folder: Path, tick: Tick) -> Reproduced:
    """Section 2.3 of Taylor 2000, Figures 2-3 to 2-7."""
    return _page("esso-osaka", esso_osaka_page.TITLE, esso_osaka_page.page(tick), folder)


def reproduce_destroyer(folder: Path, tick: Tick) -> Reproduced:
    """Sections 4.2 and 4.3 of Taylor 2000, Table 4.1, Figures 4-4 to 4-11."""
    return _page("destroyer", destroyer_page.TITLE, destroyer_page.page(tick), folder)


def _page(name: str, title: str, page: steering_page.Page, folder: Path) -> Reproduced:
    shown = steering_page.table(page.rows)
    write_table(
        folder, name, title, f"shaftline reproduce {name}", pd.DataFrame(page.rows), page.body
    )
    for file, figure in page.figures.items():
        figures.save(figure, folder / "figures" / f"{file}.png")
    return Reproduced(title, shown, steering_page.reasons(page.rows), page.numbers)


def reproduce_autopilot(folder: Path, tick: Tick) -> Reproduced:
    """Section 5.2 of Taylor 2000, Figures 5-4 to 5-13."""
    found = steering_page.autopilot(tick)
    return _page("autopilot", steering_page.AUTOPILOT_TITLE, found, folder)


def reproduce_track(folder: Path, tick: Tick) -> Reproduced:
    """Section 5.3 of Taylor 2000, Figures 5-15 to 5-24."""
    return _page("track", steering_page.TRACK_TITLE, steering_page.track(tick), folder)


TABLES: dict[str, tuple[Callable[[Path, Tick], Reproduced], int]] = {
    "working-points": (reproduce_working_points, 1),
    "poles": (reproduce_poles, 1),
    "vaf": (reproduce_vaf, vaf.records() + 1),
    "snr": (
        reproduce_snr,
        (1 + len(snr.SAMPLE_TIMES_S)) * len(vaf.ROWS) + 10 + vaf.records(),
    ),
    "sensitivity": (reproduce_sensitivity, 7),
    "storms": (reproduce_storms, storm_results.TICKS),
    "levers": (reproduce_levers, levers.TICKS),
    "tito-neri": (reproduce_tito_neri, identification_page.TICKS),
    "augmented-filter": (reproduce_augmented_filter, filter_results.TICKS),
    "esso-osaka": (reproduce_esso_osaka, esso_osaka.TICKS),
    "destroyer": (reproduce_destroyer, destroyer.TICKS),
    "autopilot": (reproduce_autopilot, steering_results.AUTOPILOT_TICKS),
    "track": (reproduce_track, steering_results.TRACK_TICKS),
}
"""Every table by name, and how many ticks it makes."""
