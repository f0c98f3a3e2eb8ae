"""The page of :mod:`.identification`: tables, Bode figure and what they come to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.cli import tour_command
from shaftline.display.figures import PALETTE, THESIS, new_figure, save
from shaftline.display.tables import markdown, write_table
from shaftline.mismatch.identification.frequency import SPEED, modelled
from shaftline.mismatch.identification.steady import CURRENT
from shaftline.plant import Ship, load_ship

from ..cells import Cell
from ..side_by_side import verdicts
from . import histories, least_squares
from . import identification as study
from .identification_cells import cells_of

NAME, TITLE = "tito-neri-identification", "Tito Neri: its numbers found again"
BODE, HISTORIES = "tito-neri-bode.png", "tito-neri-histories.png"


@dataclass(frozen=True)
class Findings:
    """Everything that the page tells."""

    table_five: pd.DataFrame
    rounding: pd.DataFrame
    density: pd.DataFrame
    fits: pd.DataFrame
    best: Ship
    five: dict[str, float]
    dead_time: pd.DataFrame
    delays: dict[str, tuple[float, float]]
    known: pd.DataFrame
    stairs: pd.DataFrame
    in_time: Figure

    @property
    def cells(self) -> list[Cell]:
        """Every printed number that the page compares."""
        return cells_of(self.rounding, self.stairs)


def gathered(tick: study.Tick = lambda: None) -> Findings:
    """All of it.

    Args:
        tick: called :data:`TICKS` times.
    """
    fits, best = study.fits_of_table_two()
    tick()
    return Findings(
        study.table_five(), study.rounding_of_column_one(), densities(), fits, best,
        study.five_numbers(), study.dead_time(), study.fitted_dead_time(), study.on_known_truth(tick),
        *histories.gathered(),
    )  # fmt: skip


TICKS = study.TICKS + 1


def densities() -> pd.DataFrame:
    """What the two likely densities of the water make of either set."""
    rows = []
    for density in (1000.0, 1025.0):
        first = study.column_one(density_kg_m3=density)
        row = {"density_kg_m3": density, "I_KQ_over_K_e": first["KQ0_over_eta_R"] / first["K_e"]}
        for name, file in study.SETS.items():
            ship = load_ship(file).with_values({"water.density_kg_m3": density})
            errors = tour_command.speed_errors_percent(ship)
            row[f"{name}_worst_speed_percent"] = float(np.abs(errors).max())
        ship = load_ship(study.SETS["IV"]).with_values({"water.density_kg_m3": density})
        row["IV_KQ_closed_form"] = study.column_four(ship)["KQ0_over_eta_R"]
        rows.append(row)
    return pd.DataFrame(rows)


def bode(best: Ship) -> Figure:
    """Measured points beside both printed sets and ours (the paper's Figures 15 and 16), with phases.

    Args:
        best: the ship that was fitted to the points.
    """
    figure, axes = new_figure(2, 2, (10.5, 7.0))
    measured = study.table_two(kept=False)
    fine = replace(measured, frequency=np.geomspace(0.2, 7000.0, 300))
    lines = {f"set {name}": load_ship(file) for name, file in study.SETS.items()}
    lines["ours, speed late"] = best
    for column, name in enumerate((SPEED, CURRENT)):
        gain, phase = axes[0, column], axes[1, column]
        points = measured.response[name]
        seen = np.abs(points) > 0.0  # the table rounds the last gain of the speed to 0
        gain.loglog(measured.frequency[seen], np.abs(points[seen]), "k*", label="measured")
        phase.semilogx(measured.frequency[seen], np.degrees(_unwound(points[seen])), "k*")
        for i, (label, ship) in enumerate(lines.items()):
            answer = modelled(ship, fine)[name]
            gain.loglog(fine.frequency, np.abs(answer), color=PALETTE[i], label=label)
            phase.semilogx(fine.frequency, np.degrees(_unwound(answer)), color=PALETTE[i])
        gain.set_ylim(3e-3 if name == SPEED else 0.4, 2.0 if name == SPEED else 5.0)
        phase.set_ylim(-400.0 if name == SPEED else -100.0, 60.0)
        gain.set_ylabel(f"{'speed' if name == SPEED else 'current'} gain [-]")
        phase.set_ylabel("phase [deg]")
        phase.set_xlabel("frequency [rad/s]")
        for axis in (gain, phase):
            axis.axvspan(700.0, 7000.0, color=THESIS, alpha=0.15, linewidth=0)
    axes[0, 0].legend(fontsize=8, frameon=False)
    figure.suptitle(
        "Response to the voltage about point C, relative; grey: discarded by the authors"
    )
    return figure


def _unwound(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.unwrap(np.angle(values)))


def write(folder: Path, found: Findings) -> None:
    """Write the page, its CSV and the figure.

    Args:
        folder: of the results.
        found: from :func:`gathered`.
    """
    save(bode(found.best), folder / "figures" / BODE)
    save(found.in_time, folder / "figures" / HISTORIES)
    write_table(folder, NAME, TITLE, "shaftline reproduce tito-neri", found.table_five, body(found))


def body(found: Findings) -> str:
    """The page below its title.

    Args:
        found: from :func:`gathered`.
    """
    shown = found.table_five.assign(
        ours=[f"{v:.4g}" for v in found.table_five["ours"]],
        printed=[f"{v:.3g}" for v in found.table_five["printed"]],
    )
    known = found.known.rename(columns=lambda c: c.split(".")[-1])
    rounding = found.rounding.reset_index(names="of 300 draws")
    first = found.table_five[found.table_five["set"] == "I"].set_index("parameter")
    ratio, printed_ratio = (first.loc["M_f", c] / first.loc["K_e", c] for c in ("ours", "printed"))
    pairs = least_squares.tried()
    nearest = pairs.head(4).assign(K_e=pairs["K_e"].map("{:.5f}".format))
    kq = abs(
        first.loc["KQ0_over_eta_R", "difference_percent"] - first.loc["K_e", "difference_percent"]
    )
    return f"""\
Vrijdag & Martelli, "Parameter Identification of a Model Scale Ship Drive Train", 2021. Their
recordings were not published; five steady states (Table 4) and a response at nine frequencies
(Table 2) were, and are what the first sections rest on.

## Table 5

Column I: least squares on the five steady states (eqs. 22 to 28); inertia and inductance would need
the step's recording. Column IV: in closed form from the poles -2500 and -9 rad/s, the zero -2 rad/s
and the steady gains 1.24 and 0.71 that section 5.2 prints, with U_0 = K_e omega_0 + R_a i_0 at
point C as the sixth equation.

{markdown(shown)}

What the rounding of Table 4 leaves open of column I (each entry anywhere within half of its last
digit): the printed R_a lies inside, K_e, M_f and KQ lie beyond. The torque balance fixes the ratios to
K_e: M_f / K_e is {ratio:.4f} A in ours and {printed_ratio:.4f} A in print, and KQ / K_e agrees within
{kq:.1f} %. So one number is off, the printed K_e. Of {len(pairs)} ways to solve U = K_e w + R_a i on
these points, the nearest to the printed pair of K_e and R_a are these; the printed digits would be
0.4 %:

{markdown(nearest, 3)}

The reason of the difference is not known.

{markdown(rounding, 4)}

The paper's eq. 31 prints tau_omega = -C eta / s_2; its eqs. A26 and A34 ask for twice that, and the
printed form would find half the inertia.

## Density

Only the product of density and KQ acts, and the paper prints no density. The two sets ask for
different ones: column I and its speeds (within 3 %, the paper says) for 1025 kg/m3, column IV's KQ
for 1000 (printed: KQ / K_e of I 7.45, KQ of IV 0.136). Each ship file has its own.

{markdown(found.density, 3)}

## In time

Both sets on the staircase and on a mix (Figures 9 to 14, whose recordings were not published). Steady
motor speed less the measured one at the five points, and the peak of the current after C to D:

{markdown(found.stairs, 1)}

As the paper says, set I is within 3 % everywhere, set IV is good near C, about which it was found, and
off by 80 to 90 rpm far from it; its peak is the higher one, which the paper finds nearer to the
measured.
The bias of around 50 rpm that the paper names belongs to the mix, whose voltage is a picture; it cannot
be computed again.

![Staircase and mix with both sets](figures/{HISTORIES})

{_bode_section(found)}

## Each method on a known drive train

Recordings without noise of each printed set, found from the other's numbers; errors in percent.

{markdown(known, 3)}

`steady` and `step` work on a staircase of the five voltages, 5 s each; `sine` on the nine sines of
5 %; `welch` on 120 s of noise of 5 % rms, flat to 1000 rad/s.

{verdicts("tito-neri", found.cells)}"""


def _bode_section(found: Findings) -> str:
    fits = found.fits.assign(
        **{
            c: [f"{v:.3g}" for v in found.fits[c]]
            for c in ("L_a", "K_e", "R_a", "I_p", "M_f", "KQ0_over_eta_R", "L_a_error")
        }
    )
    five = ", ".join(f"{name} {value:.4g}" for name, value in found.five.items())
    delays = ", ".join(
        f"set {name}: {value:.2f} ± {error:.2f} ms" for name, (value, error) in found.delays.items()
    )
    ways = found.fits.set_index("errors weigh")
    plain, late = ways.loc["by size"], ways.loc["by size, speed late"]
    alike, discarded, sized, freed_ = (
        f"{1e4 * value:.2f}e-4"
        for value in (*found.fits["L_a"].iloc[:2], plain["L_a"], late["L_a"])
    )
    own = f"{late['delay_ms']:.2f} ± {late['delay_error_ms']:.2f} ms"
    return f"""\
## Bode figure

![Measured points, both sets and ours](figures/{BODE})

Five numbers fitted to the points that the authors kept, all alike: {five}.

{markdown(fits)}

*all alike*: every complex error weighs the same, as in the paper's eqs. 18 and 19. *by size*:
errors in proportion to the response (5 %, and the rounding of the table), which lets the small
gains of the speed at high frequency count. *speed late*: the reading of the speed may come late
(`sensors.speed_delay_s`), and is free.

**The speed's reading is late.** Its measured phase falls short of either model by a time that
hardly depends on the frequency, a dead time of 1.5 ms:

{markdown(found.dead_time)}

Fitted beside each set as printed, {delays}; fitted with all six numbers, {own}, and
the misfit falls from {plain["misfit"]:.2f} to {late["misfit"]:.2f}. At point C the encoder's 15
pulses per turn are 1.95 ms apart, and a speed that is the angle between two pulses over their time,
held until the next, is late by half to one interval.

**The inductance of set IV is not in its data.** A pole at -2500 rad/s would bring the current's
gain down to 2.1 there; the table has 2.90 at 1000 and 2.11 at 5000 rad/s. All alike, the kept
points ask for {alike} H, with the discarded ones {discarded} H (printed: 6.03e-4 H). Weighed by
size, without a delay, the fit gives {sized} H, the printed number, and with the delay
{freed_} ± {1e4 * late["L_a_error"]:.2f}e-4 H: where the speed may not be late, the armature has
to be."""
