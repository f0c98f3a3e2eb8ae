"""The engine map that the CPP optimiser paper's tables imply, and what the optimiser makes of it.

The paper prints no map, but the consumption at twenty states of engine speed and ship speed (thirty
entries of its Tables 1 to 3), and that fifteen of them are optima: :mod:`.inferred_map`.

Run ``python -m reproductions ferry.engine_map --out docs/results``; about a minute.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.display import figures
from shaftline.display.tables import markdown, write_table
from shaftline.plant import Ship, load_ship

from ..side_by_side import published
from .inferred_map import (
    RATED_RPM,
    SLOPE_WEIGHT,
    Floats,
    States,
    fitted,
    form,
    forms,
    keys,
    rms,
    states,
)
from .lever_cells import HALF_DIGIT, table_cells
from .lever_points import (
    COMBINATOR,
    CORRECTED,
    HELD,
    PAPERS,
    RAISED,
    WHOLE_ENVELOPE,
    compared,
    described_briefly,
    optimal,
    rises,
)
from .lever_tables import asked_rises, implied_savings

SHIP = "ferry-printed"
TRADED = (0.01, 0.02, 0.03, 0.06, 0.12)
"""Weights of the slopes that are tried."""


def chosen(ship: Ship) -> pd.DataFrame:
    """Where the optimiser, free to choose, settles at the printed ship speeds, beside the print.

    Args:
        ship: with the inferred map.
    """
    surface = combinator_surface(ship, WHOLE_ENVELOPE)
    printed = published(PAPERS).loc[CORRECTED].set_index("condition")
    rows = []
    for lever, row in printed.iterrows():
        for when, factor in (("before", 1.0), ("after", rises()[int(str(lever)) - 1])):
            point = optimal(ship, surface, float(row[f"ship_speed_m_s_{when}"]), factor)
            assert point is not None
            own = described_briefly(ship, point)
            rows.append(
                {"lever": str(lever), "when": when, "engine [rpm]": own["engine_speed_rpm"],
                 "printed [rpm]": float(row[f"engine_speed_rpm_{when}"]),
                 "SFOC [g/kWh]": own["sfoc_g_kwh"], "printed [g/kWh]": float(row[f"sfoc_g_kwh_{when}"])}
            )  # fmt: skip
    return pd.DataFrame(rows)


def traded(ship: Ship) -> pd.DataFrame:
    """What maps come to that are asked for their optima more or less.

    Args:
        ship: the ferry, with any map.
    """
    known, rows = states(ship), []
    for weight in TRADED:
        other = ship.with_values(keys(fitted(known, weight)))
        found = compared(other)
        found = found[found["curve"] == "printed"]
        off = {
            name: np.array(
                [
                    abs(cell.ours - cell.printed)
                    for cell in table_cells(found, other)
                    if cell.column == name and not re.search("lever 5|variation", cell.row)
                ]
            )
            for name in HALF_DIGIT
        }
        saved = found.loc[(found["condition"] == RAISED) & (found["lever"] < 5), "saving_percent"]
        rows.append(
            {
                "weight of the slopes": weight,
                "SFOC, rms [g/kWh]": rms(off["sfoc_g_kwh"]),
                "worst [g/kWh]": off["sfoc_g_kwh"].max(),
                "worst engine speed [rpm]": off["engine_speed_rpm"].max(),
                "fuel saved, least [%]": saved.min(),
                "most [%]": saved.max(),
            }
        )
    return pd.DataFrame(rows)


def drawn(known: States, coefficients: Floats) -> Figure:
    """The map over power and speed with the printed states on it (the paper's Figure 2)."""
    figure, axes = figures.new_figure(1, 1, (7.5, 5.0))
    axis = axes[0, 0]
    speed, power = np.meshgrid(np.linspace(0.55, 1.0, 80), np.linspace(0.3, 1.0, 80))
    level = (form(power.ravel(), speed.ravel()) @ coefficients).reshape(power.shape)
    lines = axis.contour(RATED_RPM * speed, 100.0 * power, level, levels=range(260, 421, 10),
                         colors=figures.THESIS, linewidths=0.8)  # fmt: skip
    axis.clabel(lines, fontsize=7, fmt="%d")
    for k, table in enumerate((COMBINATOR, HELD, CORRECTED)):
        own = np.array([name == table for name in known.table])
        axis.plot(RATED_RPM * known.speed[own], 100.0 * known.power[own], "os^"[k], markersize=4,
                  color=figures.PALETTE[k], label=f"Table {k + 1}")  # fmt: skip
    axis.set_xlabel("engine speed [rpm]")
    axis.set_ylabel("power of our ferry there [kW]")
    axis.set_title("Specific consumption [g/kWh] inferred from the printed states", fontsize=10)
    axis.legend(fontsize=8, frameon=False)
    return figure


BODY = """\
The CPP optimiser paper prints no engine map. Its Tables 1 to 3 print the consumption at twenty states of
engine speed and ship speed; with the power that our ferry takes there (all but its length, power and
speed is assumed), a surface of the paper's own form follows from them, here that of
[`ferry-printed`](../../plant/ships/ferry-printed.toml). **It is inferred from the tables that it
reproduces.** That the optimiser settles at the printed engine speeds is asked of it as well, weakly.

## How well a surface holds the entries

With a resistance that follows the square of the speed, and three rises of it by the disturbance: those
that Table 2's held thrust asks for, 10.0 to 12.3 % (`ferry-printed`); 15 %, which the paper names for
the *wave* resistance alone; and those that [Table 1's speeds](levers.md#counted-by-quantity) ask for:

{forms}

Twelve coefficients on twenty states leave eight free. On the strip where the states lie consumption
rises almost with the torque, unlike that of any modern engine. The consumption goes best with a rise of
15 % of the whole resistance, which neither the text nor Table 2 allows: what the tables say of the hull
and of the engine does not go together with our propeller.

*The ship's* is asked for more: that fifteen states be optima of our ferry, and that the map be one where
no state lies. With the entries alone the form is negative at low power, and the optimiser leaves the
strip.

## Where the optimiser goes

At the printed ship speeds, on `ferry-printed`, free to choose pitch and revolutions within the whole
envelope:

{chosen}

At levers 1 to 4 its revolutions are within {rpm:.0f} rpm and its consumption is within {sfoc:.1f} g/kWh
of the print, at lever 5, the strip's end, within {five_rpm:.0f} rpm and {five:.1f} g/kWh.

## What is traded

The paper's savings are not there: the more the printed states are made optima, the less is lost by
sailing beside them. The same experiment as on the page of the [levers](levers.md), curve `printed`,
levers 1 to 4, for several weights of the slopes; the ship has {weight:g}:

{traded}

No weight has the printed consumption, the printed revolutions and the printed saving of {saving} %
together.

![The inferred map with the printed states](figures/ferry-map.png)"""


def main() -> None:
    """Write ``ferry-map.md``, its table and its figure; print the map's keys."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/ferry-map"), help="folder")
    folder = parser.parse_args().out
    ship = load_ship(SHIP)
    known = states(ship)
    coefficients = fitted(known)
    for key, value in keys(coefficients).items():
        print(f"{key.split('.')[1]} = {value:.6f}")
    found = chosen(ship)
    off_rpm = found["engine [rpm]"] - found["printed [rpm]"]
    off = found["SFOC [g/kWh]"] - found["printed [g/kWh]"]
    four = found["lever"] != "5"
    by_table_1 = tuple(1.0 + 0.01 * asked_rises(ship)["rise by Table 1 [%]"])
    tried = {"10.0 to 12.3 %": rises(), "15 %": (1.15,) * 5, "by Table 1": by_table_1}
    whole = pd.concat([forms(states(ship, r)).assign(rise=name) for name, r in tried.items()])
    saved = -implied_savings(ship)["fuel per mile change [%]"].iloc[:4]
    body = BODY.format(
        traded=markdown(traded(ship), 2), weight=SLOPE_WEIGHT, forms=markdown(whole),
        chosen=markdown(found, 1), rpm=off_rpm[four].abs().max(), sfoc=off[four].abs().max(),
        five=off[~four].abs().max(), five_rpm=off_rpm[~four].abs().max(),
        saving=f"{saved.min():.1f} to {saved.max():.1f}",
    )  # fmt: skip
    figures.save(drawn(known, coefficients), folder / "figures" / "ferry-map.png")
    command = "python -m reproductions ferry.engine_map --out docs/results"
    write_table(folder, "ferry-map", "The ferry's engine map, inferred", command, found, body)


if __name__ == "__main__":
    main()
