"""The thesis's pages: ours beside the printed, written to a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from ...display import figures
from ...display.tables import markdown, write_table
from ...observers import follow, get_observer, readings_of
from ...observers.metrics import variance_accounted_for
from ...plant import Ship, linearise, load_ship
from ..cells import Cell
from ..reproduced import Make, Reproduced, Tick
from ..side_by_side import published, reasons_text, side_by_side, verdicts
from . import (
    dead_beat,
    drawn,
    followed,
    load_cases,
    observer_transfers,
    pole_cells,
    poles,
    printed_plant,
    rounded_table,
    sensitivity,
    snr,
    vaf,
    verification,
    working_points,
)
from .load_cases import CASES


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
        "Ours, with the thesis's number in parentheses; a star marks a difference without a calculated "
        f"reason.\n\n{markdown(shown)}\n\n{verdicts(name, cells)}{extra}"
    )
    write_table(folder, name, title, f"shaftline reproduce {name}", ours.reset_index(), body)
    return Reproduced(f"{title}: ours (thesis)", shown, reasons_text(cells), _numbers(ours), cells)


def reproduce_working_points(folder: Path, tick: Tick) -> Reproduced:
    """Table 2-1, Figures 2-4 and 4-1, and what the text says of the steps and gains."""
    ours = working_points.working_points()
    frigate = load_ship("frigate")
    for name, figure in (
        ("fuel-rack-map", drawn.fuel_rack_map(frigate)),
        ("load-cases", drawn.load_case_overview(frigate)),
    ):
        figures.save(figure, folder / "figures" / f"{name}.png", dpi=75)
    tick()
    extra = (
        "\n## What the text says besides\n\n"
        f"{markdown(working_points.said(frigate))}\n\n{working_points.SAID}\n\n"
        "![Torque lines of the fuel rack map, and the operating limits (Figure 2-4)]"
        "(figures/fuel-rack-map.png)\n\n"
        "![What changes in each load case (Figure 4-1)](figures/load-cases.png)\n"
    )
    title = "Working points (Table 2-1)"
    return _finished("working-points", title, ours, working_points.cells(ours), folder, 3, extra)


def reproduce_poles(folder: Path, tick: Tick) -> Reproduced:
    """Tables 2-2 to 2-23 and 3-1 to 3-14; Figures 2-5, 2-6, 3-2, 3-4, 3-8 and 3-10."""
    plant, observers = poles.compared()
    frigate = load_ship("frigate")
    point, middle = verification.mid_range_point(frigate), verification.mid_range(frigate)
    cells = pole_cells.cells(frigate)
    tick()
    title = "Poles, zeros and steady gains (Tables 2-2 to 2-23, 3-1 to 3-14)"
    body = (
        f"{markdown(plant, 4)}\n\n{_implied(frigate)}"
        f"{_linear_observers(frigate)}"
        f"## Two transfers with their zeros\n\n{markdown(observers)}\n\n"
        f"## The random-walk Kalman filter (Tables 3-11 to 3-14)\n\n{dead_beat.WHY}\n\n"
        f"{_dead_beat_table(frigate)}\n\n"
        "Figure 3-10 draws them with s in the place of z, which means nothing; as the discrete filter "
        "that it is:\n\n"
        "![Bode magnitude of the random-walk Kalman filter](figures/bode-random-walk-kalman.png)\n\n"
        "## The mid-range point (Tables 2-16 to 2-23)\n\n"
        f"The thesis does not print this point. Its two gains from the rack are met at X = "
        f"{point.inputs.drive:.2f} mm, P/D = {point.state.pitch_ratio:.3f} "
        f"({point.state.shaft_speed:.2f} rad/s, {point.state.ship_speed:.2f} m/s); everything else in "
        "this table is then a prediction. From the pitch to the shaft speed our gain is that of "
        "Vrijdag & Stapersma, not the thesis's; from the pitch to the ship speed it differs from both, "
        "even in sign.\n\n"
        f"{markdown(middle)}\n\n"
        f"{_followed(frigate)}"
        "![Bode plot at A to D](figures/bode.png)\n\n"
        "![Bode plot at the mid-range point](figures/bode-mid-range.png)\n\n"
        "The poles of a point stand in twelve tables and count once. Of the cells that are met, those "
        "of Tables 3-1 to 3-8 and of section 3-1-3 follow from the poles and covariances that the "
        "thesis prints, whatever the plant is.\n\n"
        f"{verdicts('poles', cells)}"
    )
    write_table(folder, "poles", title, "shaftline reproduce poles", plant, body)
    figures.save(
        figures.bode(poles.models(frigate), "Linear frigate at A to D (Figure 2-5)"),
        folder / "figures" / "bode.png",
    )
    for name, figure in (
        ("bode-shaft-observers", drawn.shaft_observers(frigate)),
        ("bode-immersion-invariance", drawn.invariance(frigate)),
        ("bode-random-walk-kalman", drawn.random_walk(frigate)),
    ):
        figures.save(figure, folder / "figures" / f"{name}.png", dpi=80)
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
    return Reproduced(title, plant, reasons_text(cells), numbers, cells)


IMPLIED = """\
## The open-water slopes that the print implies

Poles, zeros and gains of one point give the four elements of its linear model, and these give KQ, KT
and their slopes to J (`shaftline.studies.thesis.printed_plant` states the equations). KQ is that of
B5-90 within {torque:.1f} %. Its slope is steeper than that of B5-90 at any J of that pitch. A difference
of the curve over any step lies between its least and largest slope, so neither a coarse table nor a
one-sided difference at the edge of the table gives it. KT is steeper in B5-90 than in the print. No
other propeller of the B-series has these slopes: of 2 to 7 blades and area ratios of 0.3 to 1.05 the
closest at A and C, {blades:.0f} blades and {area:.2f}, leaves {kq:.0f} % in dKQ/dJ and {kt:.0f} % in
dKT/dJ at A.
The reason is unknown, and the gains that rest on the slopes count as unexplained.

"""

REPEATED = """\
## Gains and zeros to M_m at B, C and D

On the plant that the print implies, point A's row of M_m gives the printed numbers of B, C and D; the
point's own row (eq. 2-31, equal to eq. 2-17 at rest) does not.

"""


def _implied(ship: Ship) -> str:
    slopes, row = printed_plant.slopes(ship), printed_plant.repeated_row(ship)
    torque = slopes[slopes["coefficient"] == "KQ"]
    closest = printed_plant.other_propellers(ship).iloc[0]
    words = IMPLIED.format(
        torque=100.0 * (torque["implied"] / torque["B5-90"] - 1.0).abs().max(),
        blades=closest["blades"], area=closest["area ratio"],
        kq=closest["dKQ/dJ at A [%]"], kt=closest["dKT/dJ at A [%]"],
    )  # fmt: skip
    return f"{words}{markdown(slopes, 5)}\n\n{REPEATED}{markdown(row, 1)}\n\n"


def _linear_observers(ship: Ship) -> str:
    told = observer_transfers.linear_transfers(ship)
    for column in ("zero printed", "gain printed"):
        told[column] = told[column].map("{:.4g}".format).replace("nan", "–")
    gains = "; ".join(
        f"`{name}` K = ({k1:.4g}, {k2:.4g}), printed ({printed[0]:.2g}, {printed[1]:.2g})"
        for name, printed in observer_transfers.PRINTED_GAINS.items()
        for k1, k2 in [observer_transfers.gains(name, ship)]
    )
    return (
        "## Luenberger and shaft Kalman (Tables 3-1 to 3-8)\n\n"
        "Zero [rad/s] and steady gain as printed, as they follow from the gains by eqs. 3-3 to 3-5, and "
        "of our observers' own matrices. Where something stands with 1e-7 and less the thesis prints "
        "rounding; it is 0.\n\n"
        f"{markdown(told, 4)}\n\nGains (section 3-1-3): {gains}.\n\n"
        "![Bode magnitude of Luenberger and shaft Kalman](figures/bode-shaft-observers.png)\n\n"
        "## Immersion and invariance (Table 3-10)\n\n"
        f"{markdown(observer_transfers.invariance_transfers(ship), 4)}\n\n"
        "A pole at 0 is that of eq. 3-13 with a torque that does not depend on the estimate; the "
        "observer's own pole is gamma (dM_p/dv_a) / I_R, and is why it converges.\n\n"
        "![Bode magnitude of I&I](figures/bode-immersion-invariance.png)\n\n"
    )


def _followed(ship: Ship) -> str:
    return (
        "## The linear model along a run\n\n"
        "The thesis names two uses of the linear model (end of section 2-7-2): fixed at one point, or "
        "taken anew at every instant (`shaftline.plant.along`). Rms errors over each load case: of the "
        "next 0.05 s by the model of the instant, as a share of the state's mean and of its standard "
        "deviation; and of the whole run by the first model alone, given what acts on the ship. In "
        "waves all of the first is the inflow that is held meanwhile.\n\n"
        f"{markdown(followed.compared(ship).map(_short))}\n\n"
    )


def _short(value: Any) -> Any:
    return f"{value:.2g}" if isinstance(value, float) else value


def _dead_beat_table(frigate: Ship) -> str:
    table = dead_beat.compared(frigate)
    gains = {name: table[name].map("{:.3g}".format) for name in ("gain follows", "gain printed")}
    return markdown(table.assign(**gains), 4)


def reproduce_vaf(folder: Path, tick: Tick) -> Reproduced:
    """Table 4-1; Figures A-1 to A-11."""
    ours = vaf.whole_table(vaf.vaf_table(tick))
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
    title = "Variance accounted for, % (Table 4-1)"
    result = _finished("vaf", title, ours, vaf.cells(ours), folder, 2, extra)
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
    """Table 4-2, Figures 4-2, 4-3 and A-12 to A-22."""
    ours = snr.snr_at(snr.SAMPLE_TIME_S, tick=tick)
    scan = snr.sample_time_scan(tick)
    sweep = snr.gain_sweep(tick)
    clean = vaf.vaf_table(tick)
    extra = (
        f"\nNoise sample time {snr.SAMPLE_TIME_S:g} s, {snr.SEEDS} seeds; noise on omega, M_m, "
        "omega' and P/D. Over other sample times (8 seeds):\n\n"
        f"{markdown(scan.reset_index(names='row'), 1)}\n\n"
        "The thesis must have used 0.01 s: the fast Luenberger observer, which differentiates, moves "
        "by 6 dB for every halving of the sample time and meets its 67.6 dB there only.\n\n"
        "![Trade-off](figures/trade-off.png)\n\n![Gain](figures/gain-sweep.png)\n\n"
        "## VAF over the noise (Figures A-12 to A-22)\n\n"
        "![VAF over the SNR, a panel an observer](figures/noise.png)\n"
    )
    frigate = load_ship("frigate")
    printed = published("advance_velocity_thesis_vaf")["snr_db_for_95pct"]
    curves = drawn.snr_curves(frigate, tick)
    figures.save(drawn.noise_figure(curves, printed), folder / "figures" / "noise.png", dpi=60)
    figures.save(figures.trade_off(ours, clean), folder / "figures" / "trade-off.png")
    figures.save(figures.gain_sweep(sweep), folder / "figures" / "gain-sweep.png")
    title = "Signal-to-noise ratio for 95 % of the noiseless VAF, dB (Table 4-2)"
    return _finished("snr", title, ours.to_frame(snr.COLUMN), snr.cells(ours), folder, 1, extra)


def reproduce_sensitivity(folder: Path, tick: Tick) -> Reproduced:
    """Table 5-1 and Figures A-23 to A-33."""
    ours = sensitivity.sensitivity_table(tick)
    picture = drawn.belief_figure(load_ship("frigate"))
    figures.save(picture, folder / "figures" / "beliefs.png", dpi=60)
    extra = (
        "\n## Estimates with wrong knowledge (Figures A-23 to A-33)\n\n"
        "![Estimates over 10 s, a panel an observer](figures/beliefs.png)\n"
    )
    title = "Change of VAF with wrong knowledge of the ship, points (Table 5-1)"
    return _finished("sensitivity", title, ours, sensitivity.cells(ours), folder, 2, extra)


TABLES: dict[str, tuple[Make, int]] = {
    "working-points": (reproduce_working_points, 1),
    "poles": (reproduce_poles, 1),
    "vaf": (reproduce_vaf, vaf.records() + 1),
    "snr": (reproduce_snr, (2 + len(snr.SAMPLE_TIMES_S)) * len(vaf.ROWS) + 10 + vaf.records()),
    "sensitivity": (reproduce_sensitivity, 7),
}
"""The thesis's by name, and how many ticks each makes."""
