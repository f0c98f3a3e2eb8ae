"""``shaftline list``."""

from __future__ import annotations

import pandas as pd

from ..observers import observer_names
from ..plant import load_ship, ship_names
from ..plant.signals import SIGNALS
from ..plant.waves import presets
from ..studies.load_cases import CASES
from .console import clear_errors, console, print_table


def list_names() -> None:
    """List the ships, seas, observers, load cases and signals that come with shaftline."""
    with clear_errors():
        ships = [(name, load_ship(name).description) for name in ship_names()]
        print_table(pd.DataFrame(ships, columns=["ship", "description"]), "Ships")
        seas = [(n, s.hs_m, s.tp_s, s.gamma) for n, s in presets().items()]
        print_table(pd.DataFrame(seas, columns=["sea", "Hs [m]", "Tp [s]", "gamma [-]"]), "Seas")
        cases = [(case.name, case.description) for case in CASES.values()]
        print_table(pd.DataFrame(cases, columns=["load case", "description"]), "Load cases")
        signals = [(s.column, s.symbol, s.unit, s.source, s.description) for s in SIGNALS]
        print_table(
            pd.DataFrame(signals, columns=["column", "symbol", "unit", "source", "description"]),
            "Signals",
        )
        console.print("Observers: " + ", ".join(observer_names()), highlight=False)
