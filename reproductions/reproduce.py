"""Every source's tables and figures by name, ours beside the printed ones, written to a folder."""

from __future__ import annotations

from pathlib import Path

from shaftline.display import figures
from shaftline.display.tables import write_table
from shaftline.plant import load_ship

from .augmented_filter import destroyer, destroyer_page, esso_osaka, esso_osaka_page
from .augmented_filter import page as filter_page
from .augmented_filter import results as filter_results
from .ferry import levers, optimiser_page
from .ferry.lever_tables import against_combinator
from .reproduced import Make, Reproduced, Tick
from .side_by_side import Page, cell_table, reasons_text, verdicts
from .steering import page as steering_page
from .steering import results as steering_results
from .storms import page as storm_page
from .storms import results as storm_results
from .thesis import tables as thesis_tables
from .tito_neri import identification_page
from .towing_tank import page as towing_tank_page
from .towing_tank import results as towing_tank_results


def reproduce_storms(folder: Path, tick: Tick) -> Reproduced:
    """Table 1 of the anti-spin paper, beside storms at sea."""
    found = storm_results.measured(tick)
    beside = storm_results.beside_table_1(found.numbers)
    title = "Storms: anti-spin over without"
    cells = storm_page.cells(beside)
    body = f"{storm_page.body(found, beside)}\n\n{verdicts('storms', cells)}"
    write_table(folder, "storms", title, "shaftline reproduce storms", found.numbers, body)
    picture = storm_page.figure(found.traces, load_ship("frigate").time_step_s)
    figures.save(picture, folder / "figures" / "storms.png")
    numbers = beside.set_index("storm").to_dict("index")
    return Reproduced(title, beside, storm_page.why(found), numbers, cells)


def reproduce_levers(folder: Path, tick: Tick) -> Reproduced:
    """Tables 1 to 3 of the CPP optimiser paper."""
    rows, cells, words = levers.write(folder, tick)
    whole = levers.whole_envelope(rows)
    keys = ["ship", "curve", "condition", "control", "lever"]
    numbers = {
        " / ".join(map(str, row[keys])): row.drop([*keys, "active"]).dropna().to_dict()
        for _, row in whole.iterrows()
    }
    return Reproduced(levers.CHANGE, against_combinator(whole), words, numbers, cells)


def reproduce_tito_neri(folder: Path, tick: Tick) -> Reproduced:
    """Table 5 of the identification paper, its Bode figures, and its methods on known truth."""
    found = identification_page.gathered(tick)
    identification_page.write(folder, found)
    five = found.table_five
    numbers = {
        str(name): dict(zip(part["parameter"], map(float, part["ours"]), strict=True))
        for name, part in five.groupby("set", sort=False)
    }
    return Reproduced(
        "Drive train of Tito Neri (Table 5)",
        five.assign(ours=[f"{value:.4g}" for value in five["ours"]],
                    printed=[f"{value:.3g}" for value in five["printed"]]),
        reasons_text(found.cells),
        {"table-5": numbers},
        found.cells,
    )  # fmt: skip


def reproduce_augmented_filter(folder: Path, tick: Tick) -> Reproduced:
    """Falling body of Taylor 2000, and the same filter on the frigate."""
    found = filter_results.measured(tick)
    cells = filter_page.cells_of(found)
    name = "augmented-filter"
    body = f"{filter_page.body(found)}\n\n{verdicts(name, cells)}"
    write_table(folder, name, filter_page.TITLE, f"shaftline reproduce {name}", found.falls, body)
    figures.save(filter_page.figure(found), folder / "figures" / f"{name}.png")
    numbers: dict[str, dict[str, float]] = {}
    for row in found.falls.to_dict("records"):
        of = numbers.setdefault(f"falling body, beta {row['beta']:g}, {row['readings']}", {})
        of[str(row["quantity"])] = float(row["median"])
    shown = filter_page.story_table(found)
    return Reproduced(filter_page.TITLE, shown, reasons_text(cells), numbers, cells)


def reproduce_esso_osaka(folder: Path, tick: Tick) -> Reproduced:
    """Section 2.3 of Taylor 2000, Figures 2-3 to 2-7."""
    return _page("esso-osaka", esso_osaka_page.TITLE, esso_osaka_page.page(tick), folder)


def reproduce_destroyer(folder: Path, tick: Tick) -> Reproduced:
    """Sections 4.2 and 4.3 of Taylor 2000, Table 4.1, Figures 4-4 to 4-11."""
    return _page("destroyer", destroyer_page.TITLE, destroyer_page.page(tick), folder)


def _page(name: str, title: str, page: Page, folder: Path) -> Reproduced:
    shown = cell_table(page.cells)
    body = f"{page.body}\n\n{verdicts(name, page.cells)}"
    write_table(folder, name, title, f"shaftline reproduce {name}", shown, body)
    for file, figure in page.figures.items():
        figures.save(figure, folder / "figures" / f"{file}.png")
    return Reproduced(title, shown, reasons_text(page.cells), page.numbers, page.cells)


def reproduce_autopilot(folder: Path, tick: Tick) -> Reproduced:
    """Section 5.2 of Taylor 2000, Figures 5-4 to 5-13."""
    found = steering_page.autopilot(tick)
    return _page("autopilot", steering_page.AUTOPILOT_TITLE, found, folder)


def reproduce_track(folder: Path, tick: Tick) -> Reproduced:
    """Section 5.3 of Taylor 2000, Figures 5-15 to 5-24."""
    return _page("track", steering_page.TRACK_TITLE, steering_page.track(tick), folder)


def reproduce_towing_tank(folder: Path, tick: Tick) -> Reproduced:
    """Table 1 of the anti-spin paper on its own rig, Figures 3 to 6."""
    found = towing_tank_page.page(towing_tank_results.measured(tick))
    return _page("towing-tank", towing_tank_page.TITLE, found, folder)


TABLES: dict[str, tuple[Make, int]] = {
    **thesis_tables.TABLES,
    "storms": (reproduce_storms, storm_results.TICKS),
    "towing-tank": (reproduce_towing_tank, towing_tank_results.TICKS),
    "levers": (reproduce_levers, levers.TICKS),
    "optimiser": (optimiser_page.reproduce, optimiser_page.TICKS),
    "tito-neri": (reproduce_tito_neri, identification_page.TICKS),
    "augmented-filter": (reproduce_augmented_filter, filter_results.TICKS),
    "esso-osaka": (reproduce_esso_osaka, esso_osaka.TICKS),
    "destroyer": (reproduce_destroyer, destroyer.TICKS),
    "autopilot": (reproduce_autopilot, steering_results.AUTOPILOT_TICKS),
    "track": (reproduce_track, steering_results.TRACK_TICKS),
}
"""Every table by name, and how many ticks it makes."""
