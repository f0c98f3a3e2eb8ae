"""The page of the synthetic rig: its orders, Table 3, and the smallest changes that are detected.

Run ``python -m reproductions tito_neri.rig_page --out docs/results``; about five minutes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import ESTIMATE, TRUTH, new_figure, save
from shaftline.display.tables import markdown, write_table
from shaftline.mismatch.identification.frequency import SPEED

from . import rig, rig_results
from .experiments import staircase

NAME, TITLE = "tito-neri-rig", "Tito Neri: a synthetic rig, its methods and its watch"
FIGURE = "tito-neri-rig.png"
COMMAND = "python -m reproductions tito_neri.rig_page --out docs/results"


def picture(orders: pd.DataFrame) -> Figure:
    """Orders of the current (the paper's Figure 5), and three turns of the encoder (its Figure 8).

    Args:
        orders: from :func:`.rig.order_spectrum`.
    """
    figure, axes = new_figure(1, 2, (10.5, 3.6))
    left, right = axes[0]
    left.plot(orders["order"], orders["current_A"], color=TRUTH, linewidth=0.8)
    left.set_xlabel("order of the motor's turn")
    left.set_ylabel("current [A]")
    table = rig.measured(rig_results.truth(), staircase((5.89,), 1.5))
    last = table.iloc[-900:]
    ratio = rig_results.truth().transmission.gear_ratio
    right.plot(last["time_s"], ratio * last[SPEED], color=ESTIMATE, drawstyle="steps-post")
    right.set_xlabel("time [s]")
    right.set_ylabel("motor speed [rad/s]")
    return figure


def cogs_in_current() -> tuple[float, float]:
    """Amplitude [A] of order 6 in the current at point C by cogging alone, and by all the rig has."""
    own = rig.Instruments(current_noise_A=0.0)
    found = []
    for some in (replace(own, ripple_6=0.0, ripple_12=0.0), own):
        table = rig.measured(rig_results.truth(), staircase((5.89,), 4.0), some)
        ratio = rig_results.truth().transmission.gear_ratio
        orders = rig.order_spectrum(table, ratio).set_index("order")
        found.append(float(orders.loc[5.9:6.1, "current_A"].max()))
    return found[0], found[1]


def peaks(orders: pd.DataFrame, count: int = 2) -> list[float]:
    """Orders, to the whole, at which the current's spectrum is highest.

    Args:
        orders: from :func:`.rig.order_spectrum`.
        count: how many.
    """
    some = orders[orders["order"] >= 1.0]
    best = some.groupby(some["order"].round())["current_A"].max().nlargest(count)
    return sorted(float(order) for order in best.index)


def body(found: rig_results.Validation, watch: pd.DataFrame, orders: pd.DataFrame) -> str:
    """The page below its title.

    Args:
        found: Table 3.
        watch: condition monitoring.
        orders: of the current.
    """
    own = rig.Instruments()
    two = " and ".join(f"{order:g}" for order in peaks(orders))
    shown = watch.drop(columns=["bias_percent"])
    best = watch[watch["free"] == "together"]
    best = best.loc[best.groupby("number", sort=False)["smallest_percent"].idxmin()]
    said = "; ".join(
        f"{row.number} {row.smallest_percent:.2g} % ({row.method})" for row in best.itertuples()
    )
    cogs = f"{1e3 * own.cogging_6_N_m:g} and {1e3 * own.cogging_12_N_m:g} mN m"
    ripple = f"{100 * own.ripple_6:g} and {100 * own.ripple_12:g} %"
    supply = f"{100 * (1 - own.gain):.0f} % less and {1e6 * own.lag_s:g} us late"
    only, both = (f"{1e3 * size:.3g} mA" for size in cogs_in_current())
    records, trials = rig_results.RECORDS, rig_results.TRIALS
    return f"""\
The recordings of Vrijdag & Martelli 2021 were not published. This rig is the house's plant with the
numbers of Table 5's column IV behind the instruments that the paper describes: cogging of {cogs}, a
ripple of the back EMF of {ripple}, an encoder of {own.holes} holes that lie {own.uneven_deg:g}
degrees off (rms), an amplifier that gives {supply}, {own.current_noise_A:g} A rms of noise. These
sizes are assumed; the paper prints none.

A cogging torque alone would hardly be seen in the current, whose orders 6 and 12 the paper found
dominant: at point C the shaft's inertia keeps all of it out but {only}. The ripple of the back EMF
makes {both}. Highest orders of the rig's current from 220 to 1995 rpm: {two}.

![Orders of the current, and three turns of the encoder](figures/{FIGURE})

## Table 3 as a programme

Every method on its own test, begun at the numbers of column I; errors in percent. The encoder tells
a mean speed between two flanks and holds it until the next, and the delay that `sine` and `welch`
find is the time between two flanks, 1.95 ms.

{markdown(found.numbers)}

Their ships on every test, driven by the recorded voltage: FitPercent (eq. 20) and MSE (eq. 21) of
speed and current. *used*: the method's own test. The truth's row is what the instruments leave of a
perfect model.

{markdown(found.fits, 4)}

Of output error, one row in ten is read (1 kHz), which says little of an inductance that acts within
half a millisecond.

The inductance of `step` comes from two or three samples of each step, into which a ripple of ±0.12
A falls as the motor happens to stand.

## Condition monitoring

What a record of 30 s detects: the staircase with 6 s on a level, eight sines one after the other,
or noise. `scatter`: of the estimates over {records} records of the unchanged rig. `alarm`: beyond
it lie 5 % of the unchanged. `smallest`: a change that passes the alarm in 95 % of the records.
Tried on {trials} records each: the change that was made, what was found of it on average, and the
share of records that alarmed. *together*: all six numbers are free (and the delay); *alone*: this
one, all others known as they were.

{markdown(shown)}

With all numbers free, the smallest changes by the best method: {said}. The staircase reads means
over seconds, in which cogging and encoder average out, and drives the shaft from 3.9 to 7.9 V;
sines and noise of 5 % about one point must tell friction from load by a slope. What differs from
day to day on a real machine, such as the warmth of its winding and oil or the depth of its water,
is not in these scatters; it adds to them."""


def main() -> None:
    """Make the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/tito-neri"), help="folder")
    folder = parser.parse_args().out
    ratio = rig_results.truth().transmission.gear_ratio
    orders = rig.order_spectrum(rig.measured(rig_results.truth(), rig.order_ramp()), ratio)
    found = rig_results.validation()
    watch = rig_results.monitoring()
    save(picture(orders), folder / "figures" / FIGURE)
    write_table(folder, NAME, TITLE, COMMAND, watch, body(found, watch, orders))
    print(markdown(found.fits, 4), markdown(watch), sep="\n\n")


if __name__ == "__main__":
    main()
