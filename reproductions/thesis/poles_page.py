"""The page of the thesis's poles, zeros and gains."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shaftline.display.figures import save
from shaftline.display.tables import markdown, write_table
from shaftline.plant import Ship, linearise, load_ship

from ..reproduced import Reproduced, Tick
from ..side_by_side import reasons_text, verdicts
from . import (
    dead_beat,
    drawn,
    followed,
    observer_transfers,
    pole_cells,
    poles,
    printed_plant,
    verification,
)
from .figures import bode


def reproduce(folder: Path, tick: Tick) -> Reproduced:
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
    save(
        bode(poles.models(frigate), "Linear frigate at A to D (Figure 2-5)"),
        folder / "figures" / "bode.png",
    )
    for name, figure in (
        ("bode-shaft-observers", drawn.shaft_observers(frigate)),
        ("bode-immersion-invariance", drawn.invariance(frigate)),
        ("bode-random-walk-kalman", drawn.random_walk(frigate)),
    ):
        save(figure, folder / "figures" / f"{name}.png", dpi=80)
    at_point = {"ours": linearise(frigate, point, outputs=("shaft_speed", "ship_speed"))}
    at_point |= {name: verification.printed_model(name) for name in verification.SOURCES}
    save(
        bode(at_point, "Linear frigate at the mid-range point (Figure 2-6)"),
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
and their slopes to J (`reproductions.thesis.printed_plant` states the equations). KQ is that of
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
