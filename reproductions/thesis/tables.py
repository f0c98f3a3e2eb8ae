"""The thesis's pages: ours beside the printed, written to a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.display.figures import save
from shaftline.display.tables import markdown, write_table
from shaftline.observers import follow, get_observer, readings_of
from shaftline.observers.following import variance_accounted_for
from shaftline.plant import load_ship
from shaftline.plant.load_cases import CASES, PITCH_STEP_DURATION, RACK_STEP_DURATION

from ..cells import Cell
from ..reproduced import Make, Reproduced, Tick
from ..side_by_side import published, reasons_text, side_by_side, verdicts
from . import drawn, poles_page, rounded_table, sensitivity, snr, vaf, working_points
from .figures import gain_sweep, observer_traces, trade_off


def _numbers(ours: pd.DataFrame) -> dict[str, dict[str, float]]:
    return {
        str(row): {str(c): float(v) for c, v in values.items() if pd.notna(v)}
        for row, values in ours.iterrows()
    }


def _finished(
    name: str,
    title: str,
    ours: pd.DataFrame,
    cells: list[Cell],
    folder: Path,
    digits: int,
    extra: str = "",
) -> Reproduced:
    shown = side_by_side(ours, cells, digits)
    body = (
        "Ours, with the thesis's number in parentheses; a star marks a difference without a "
        "calculated "
        f"reason.\n\n{markdown(shown)}\n\n{verdicts(name, cells)}{extra}"
    )
    write_table(folder, name, title, f"shaftline reproduce {name}", ours.reset_index(), body)
    return Reproduced(f"{title}: ours (thesis)", shown, reasons_text(cells), _numbers(ours), cells)


def reproduce_working_points(folder: Path, tick: Tick) -> Reproduced:
    """Table 2-1, Figures 2-4 and 4-1, and what the text says of the steps and gains."""
    ours, frigate = working_points.working_points(), load_ship("frigate")
    said = working_points.said(frigate)
    for name, figure in (
        ("fuel-rack-map", drawn.fuel_rack_map(frigate)),
        ("load-cases", drawn.load_case_overview(frigate)),
    ):
        save(figure, folder / "figures" / f"{name}.png", dpi=75)
    tick()
    extra = (
        "\n## What the text says besides\n\n"
        f"{markdown(said)}\n\n{working_points.SAID}\n\n"
        "![Torque lines of the fuel rack map, and the operating limits (Figure 2-4)]"
        "(figures/fuel-rack-map.png)\n\n"
        "![What changes in each load case (Figure 4-1)](figures/load-cases.png)\n"
    )
    title = "Working points (Table 2-1)"
    cells = [*working_points.cells(ours), *working_points.said_cells(said)]
    return _finished("working-points", title, ours, cells, folder, 3, extra)


def reproduce_vaf(folder: Path, tick: Tick) -> Reproduced:
    """Table 4-1; Figures A-1 to A-11."""
    table, spread = vaf.vaf_table(tick)
    ours = vaf.whole_table(table)
    exact, rounded = rounded_table.table_scores()
    extra = (
        f"\nThe sea's column is the mean of {vaf.SEA_SEEDS} seeds. `random-walk-kalman` is the filter "
        "as printed; `random-walk-kalman-extended` is ours, which keeps its own shaft speed.\n\n"
        "The scores of the two steps depend on the record's length, which the thesis does not print; "
        f"ours are {RACK_STEP_DURATION:g} s and {PITCH_STEP_DURATION:g} s, "
        "chosen by three printed scores (rack step: Luenberger low; pitch step: I&I low and "
        "random-walk Kalman), which count as calibrated. Likewise assumed: the resistance sine's "
        "amplitude, 0.25.\n\n"
        "## The thesis's inverse table\n\n"
        "The thesis inverts KQ by a table that it does not print. Scores of the observers that invert "
        "KQ, once the exact inverse is replaced by a table with steps of "
        f"{rounded_table.PITCH_STEP:g} in P/D and {rounded_table.ADVANCE_STEP:g} in J, read without "
        "interpolation at the pitch node at or below the measured pitch and at the nearest KQ:\n\n"
        f"{markdown(_beside(rounded, 'advance_velocity_thesis_vaf'))}\n\n"
        "Steps and rule were chosen by the rows of the shaft acceleration observer and of the power "
        "balance, so it is no reason for theirs; the other rows follow. Other tables in the pitch "
        "step:\n\n"
        f"{markdown(rounded_table.other_tables(), 4)}\n\n"
        "Time traces: " + ", ".join(f"[{r}](figures/traces-{r}.png)" for r in vaf.ROWS) + "\n"
    )
    title = "Variance accounted for, % (Table 4-1)"
    cells = vaf.cells(ours, spread, rounded_table.reasons(exact, rounded))
    result = _finished("vaf", title, ours, cells, folder, 2, extra)
    _draw_traces(folder / "figures")
    tick()
    return result


def _beside(ours: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return our numbers with the printed ones in parentheses."""
    theirs = published(name)
    return pd.DataFrame(
        {
            column: [
                f"{ours.loc[row, column]:.2f} ({theirs.loc[row, column]:.2f})" for row in ours.index
            ]
            for column in ours.columns
        },
        index=ours.index,
    ).reset_index(names="")


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
        figure = observer_traces(f"Advance velocity estimated by {row}", records)
        save(figure, folder / f"traces-{row}.png", dpi=75)


def reproduce_snr(folder: Path, tick: Tick) -> Reproduced:
    """Table 4-2, Figures 4-2, 4-3 and A-12 to A-22."""
    ours = snr.snr_at(snr.SAMPLE_TIME_S, tick=tick)
    at_edge, no_pitch = (
        snr.snr_at(snr.SAMPLE_TIME_S, tick=tick, change=change)
        for change in (snr.within_table, snr.without_pitch_noise)
    )
    scan = snr.sample_time_scan(tick)
    sweep = snr.gain_sweep(tick)
    clean, _ = vaf.vaf_table(tick)
    extra = (
        f"\nNoise sample time {snr.SAMPLE_TIME_S:g} s, {snr.SEEDS} seeds; noise on omega, M_m, "
        "omega' and P/D. Over other sample times (8 seeds):\n\n"
        f"{markdown(scan.reset_index(names='row'), 1)}\n\n"
        "The thesis must have used 0.01 s: the fast Luenberger observer, which differentiates, moves "
        "by 6 dB for every halving of the sample time and meets its 67.6 dB there only.\n\n"
        "## The edge of the inverse table\n\n"
        "The load case has P/D 1.4, the highest pitch that the thesis can invert (section 3-1-1). "
        "Required SNR [dB] of our observers, and with the measured pitch limited to 1.4, as a table "
        "that ends there does:\n\n"
        f"{markdown(_at_edge(ours, at_edge, no_pitch), 1)}\n\n"
        "The limit brings the observers that invert KQ near the printed SNR. The random-walk Kalman "
        "filter has no inverse table; its printed SNR is below that of the power balance, and below "
        "ours with "
        "the limit as well.\n\n"
        "![Trade-off](figures/trade-off.png)\n\n![Gain](figures/gain-sweep.png)\n\n"
        "## VAF over the noise (Figures A-12 to A-22)\n\n"
        "![VAF over the SNR, a panel an observer](figures/noise.png)\n"
    )
    frigate = load_ship("frigate")
    printed = published("advance_velocity_thesis_vaf")["snr_db_for_95pct"]
    curves = drawn.snr_curves(frigate, tick)
    save(drawn.noise_figure(curves, printed), folder / "figures" / "noise.png", dpi=60)
    save(trade_off(ours, clean), folder / "figures" / "trade-off.png")
    save(gain_sweep(sweep), folder / "figures" / "gain-sweep.png")
    title = "Signal-to-noise ratio for 95 % of the noiseless VAF, dB (Table 4-2)"
    cells = snr.cells(ours, snr.edge_reasons(ours, at_edge))
    return _finished("snr", title, ours.to_frame(snr.COLUMN), cells, folder, 1, extra)


def _at_edge(ours: pd.Series, at_edge: pd.Series, no_pitch: pd.Series) -> pd.DataFrame:
    printed = published("advance_velocity_thesis_vaf")["snr_db_for_95pct"].reindex(ours.index)
    columns = {
        "ours": ours, "pitch limited to 1.4": at_edge, "no noise on the pitch": no_pitch,
        "printed": printed,
    }  # fmt: skip
    return pd.DataFrame(columns).reset_index(names="")


def reproduce_sensitivity(folder: Path, tick: Tick) -> Reproduced:
    """Table 5-1 and Figures A-23 to A-33."""
    ours = sensitivity.sensitivity_table(tick)
    picture = drawn.belief_figure(load_ship("frigate"))
    save(picture, folder / "figures" / "beliefs.png", dpi=60)
    curves = rounded_table.wrong_curve_changes()
    extra = (
        "\n## A wrong torque curve and the inverse table\n\n"
        "Change of the shaft acceleration observer's VAF [points] when its KQ is 10 % off, with the "
        "exact "
        "inverse and with the [table of KQ](vaf.md#the-thesiss-inverse-table). An exact inverse of a "
        "KQ "
        "that is f times the right one turns every change of J by 1 / f, about: 1 - (1 - 1 / f)^2 is "
        "98.8 % for 0.9 and 99.2 % for 1.1. The printed changes are smaller and larger than that, and "
        "the table hardly moves ours:\n\n"
        f"{markdown(curves)}\n\n"
        "## Estimates with wrong knowledge (Figures A-23 to A-33)\n\n"
        "![Estimates over 10 s, a panel an observer](figures/beliefs.png)\n"
    )
    title = "Change of VAF with wrong knowledge of the ship, points (Table 5-1)"
    cells = sensitivity.cells(ours)
    return _finished("sensitivity", title, ours, cells, folder, 2, extra)


TABLES: dict[str, tuple[Make, int]] = {
    "working-points": (reproduce_working_points, 1),
    "poles": (poles_page.reproduce, 1),
    "vaf": (reproduce_vaf, vaf.records() + 1),
    "snr": (reproduce_snr, (4 + len(snr.SAMPLE_TIMES_S)) * len(vaf.ROWS) + 10 + vaf.records()),
    "sensitivity": (reproduce_sensitivity, 7),
}
"""The thesis's by name, and how many ticks each makes."""
