"""Simulate four ships in storms without anti-spin, with it, and with limits against overspeed only.

Run ``python -m reproductions anti_spin_ships --out docs/results``; about five minutes on two cores.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, run_episodes
from shaftline.agents.evaluation.statistics import mean_with_interval
from shaftline.agents.evaluation.sweeps import version_of_cells
from shaftline.baselines import AntiSpin, combinator_curve
from shaftline.core.sweep import sweep
from shaftline.envs.tasks import Task, get_task
from shaftline.plant import Ship, load_ship, write_ship
from shaftline.plant.drives.diesel import torque_limit
from shaftline.plant.particulars import Particulars, ship_from_particulars
from shaftline.plant.shaft import shaft_inertia

from .pages import make_parser, print_dot
from .writing import write_results

FIRST_SEED = 100
PARTICULARS: dict[str, dict[str, Any]] = {
    "trawler": {
        "length_m": 38.0,
        "beam_m": 9.6,
        "draught_m": 4.0,
        "displacement_t": 820.0,
        "design_speed_kn": 12.0,
        "mcr_kW": 1200.0,
        "engine_speed_rpm": 900.0,
        "shaft_speed_rpm": 180.0,
        "propeller_diameter_m": 3.0,
        "controllable_pitch": True,
    },
    "harbour-tug": {
        "length_m": 24.0,
        "beam_m": 10.5,
        "draught_m": 3.6,
        "displacement_t": 480.0,
        "design_speed_kn": 11.5,
        "shafts": 2,
        "mcr_kW": 1000.0,
        "engine_speed_rpm": 1000.0,
        "shaft_speed_rpm": 250.0,
        "propeller_diameter_m": 2.4,
    },
}
"""Particulars of ships that the package does not contain, as ``shaftline new-ship`` takes them."""

SHIPS = ("frigate", "ferry", *PARTICULARS)
WITHOUT, PAPER, GUARD = "no-anti-spin", "anti-spin", "anti-spin-overspeed"
CONTROLLERS: dict[str, dict[str, Any]] = {
    WITHOUT: {"anti_spin": False},
    PAPER: {},
    GUARD: {"overspeed_only": 1.0},
}
WAVES = ((5.0, 12.4), (7.5, 15.0))  # significant height [m] and peak period [s] for the frigate
INTERVAL_S, SHORT_INTERVAL_S = 0.5, 0.1
INTERVENTION = "intervention_percent"
KPIS = (
    INTERVENTION,
    "overspeed_s",
    "tripped",
    "torque_sd_kN_m",
    "torque_peak_kN_m",
    "ventilation_s",
    "speed_mean_m_s",
    "fuel_kg_nmi",
    "reward",
)
SHOWN = {
    "overspeed_s": "overspeed s",
    "torque_sd_kN_m": "torque SD kN m",
    "torque_peak_kN_m": "torque peak kN m",
    "ventilation_s": "ventilation s",
    "reward": "reward",
}
"""Headings of the quantities whose paired change the page shows."""


class Load(NamedTuple):
    """Range of the orders as shares of the highest speed, and of the rise of the resistance."""

    order: tuple[float, float]
    rise: tuple[float, float]


LOADS = {"part": Load((0.3, 0.55), (0.2, 0.8)), "high": Load((0.7, 0.9), (0.2, 0.5))}


class Case(NamedTuple):
    """Episodes of one controller on one ship."""

    ship: str
    file: str  # of the ship
    load: str
    controller: str
    interval_s: float
    seeds: int

    @property
    def name(self) -> str:
        """File name of the case."""
        values = (self.ship, self.load, self.controller, self.interval_s, self.seeds)
        return f"{'_'.join(map(str, values))}_{version_of_cells(self.file)}"


def storm_of(ship: Ship, load: Load) -> Task:
    """Return the storm task in Froude's scale: submergence and waves by the propeller radius."""
    storm = get_task("storm")
    scale = ship.propeller.diameter_m / load_ship("frigate").propeller.diameter_m
    top = float(combinator_curve(ship).ship_speed[-1])
    depth = float(storm.ship["propeller.depth_m"]) * scale
    seas = [
        {"hs_m": height * scale, "tp_s": period * math.sqrt(scale), "heading_deg": 180.0}
        for height, period in WAVES
    ]
    changes = {
        "seas": seas,
        "speed_order_m_s": tuple(share * top for share in load.order),
        "resistance_rise": load.rise,
        "ship": {**storm.ship, "propeller.depth_m": depth},
        "held_out": None,
    }
    return Task.model_validate({**storm.model_dump(), **changes})


class _Recorder:
    """Anti-spin controller that counts the calls in which the limit changes the desired speed."""

    def __init__(self, controller: AntiSpin) -> None:
        self.controller = controller
        self.without = AntiSpin(controller.ship, controller.interval_s, anti_spin=False)
        self.running: NDArray[np.bool_] | None = None
        self.calls: Any = 0.0
        self.limited: Any = 0.0

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return action and state of the controller."""
        _, free = self.without.predict(observation, state, episode_start)
        action, state = self.controller.predict(observation, state, episode_start)
        # Episodes that have ended start again, and are not counted.
        began = np.asarray(episode_start, dtype=bool)
        self.running = np.ones_like(began) if self.running is None else self.running & ~began
        self.calls = self.calls + self.running
        self.limited = self.limited + (self.running & (free["reference"] != state["reference"]))
        return action, state


def simulate(case: Case) -> dict[str, list[float]]:
    """Return the KPIs of each episode of a case."""
    ship = load_ship(case.file)
    task = storm_of(ship, LOADS[case.load])
    controller = AntiSpin(task.load_ship(ship), case.interval_s, **CONTROLLERS[case.controller])
    recorder = _Recorder(controller)
    setting = Setting(
        case.controller,
        "storm",
        "task",
        "none",
        case.seeds,
        ship=case.file,
        task_model=task,
        first_seed=FIRST_SEED,
        interval_s=case.interval_s,
    )
    kpis, _ = run_episodes(setting, recorder, threads=1)
    kpis[INTERVENTION] = 100.0 * recorder.limited / recorder.calls
    kpis["reward"] *= case.interval_s / INTERVAL_S  # one scale for both intervals
    return {name: kpis[name].tolist() for name in KPIS}


def ship_files(folder: Path) -> dict[str, str]:
    """Return preset or path of each ship; files of the others are written into a folder."""
    files = {"frigate": "frigate", "ferry": "ferry"}
    for name, given in PARTICULARS.items():
        made = ship_from_particulars(Particulars(name=name, **given))
        files[name] = str(write_ship(made, folder / f"{name}.toml"))
    return files


def run_cases(folder: Path, seeds: int, jobs: int | None) -> dict[Case, pd.DataFrame]:
    """Return the KPIs of each episode by case."""
    files = ship_files(folder)
    intervals = [(name, INTERVAL_S) for name in SHIPS] + [("ferry", SHORT_INTERVAL_S)]
    cases = [
        Case(name, files[name], load, controller, interval, seeds)
        for (name, interval), load, controller in itertools.product(intervals, LOADS, CONTROLLERS)
    ]
    found = sweep(simulate, {c.name: c for c in cases}, folder, jobs=jobs, tick=print_dot)
    return {case: pd.DataFrame(one) for case, one in zip(cases, found.values(), strict=True)}


def table_of(found: dict[Case, pd.DataFrame]) -> pd.DataFrame:
    """Return means, and paired changes against no anti-spin with their 95 % intervals."""
    rows = []
    for case, own in found.items():
        base = found[case._replace(controller=WITHOUT)]
        row: dict[str, Any] = {
            "ship": case.ship,
            "interval_s": case.interval_s,
            "load": case.load,
            "controller": case.controller,
        }
        for name in KPIS:
            change = mean_with_interval(own[name] - base[name])
            row |= {name: float(own[name].mean())}
            ends = ("change", "change_low", "change_high")
            row |= {f"{name}_{end}": value for end, value in zip(ends, change, strict=True)}
        row["outcome"] = outcome(row)
        rows.append(row)
    return pd.DataFrame(rows)


def outcome(row: dict[str, Any]) -> str:
    """Return what a controller changes, as far as the intervals decide it."""
    if row["controller"] == WITHOUT:
        return "–"
    if row[INTERVENTION] == 0.0:
        return "stands down"
    words = {
        "tripped": ("fewer trips", "more trips"),
        "overspeed_s": ("less overspeed", "more overspeed"),
        "torque_peak_kN_m": ("lower torque peaks", "higher torque peaks"),
        "torque_sd_kN_m": ("less torque SD", "more torque SD"),
    }
    parts = [
        pair[0] if row[f"{name}_change_high"] < 0.0 else pair[1]
        for name, pair in words.items()
        if row[f"{name}_change_high"] < 0.0 or row[f"{name}_change_low"] > 0.0
    ]
    return ", ".join(parts) or "no difference"


def mean_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the means of every case."""
    names = {
        INTERVENTION: "intervention %",
        "overspeed_s": "overspeed s",
        "tripped": "tripped %",
        "torque_sd_kN_m": "torque SD kN m",
        "torque_peak_kN_m": "torque peak kN m",
        "ventilation_s": "ventilation s",
        "speed_mean_m_s": "ship speed m/s",
        "reward": "reward",
    }
    shown = table.assign(tripped=100.0 * table["tripped"], ship=_ship_labels(table))
    for name in names:
        shown[name] = [f"{value:.3g}" for value in shown[name]]
    return shown[["ship", "load", "controller", *names]].rename(columns=names)


def change_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the paired changes against no anti-spin and the outcome."""
    rows = []
    for label, (_, line) in zip(_ship_labels(table), table.iterrows(), strict=True):
        if line["controller"] == WITHOUT:
            continue
        row = {"ship": label, "load": line["load"], "controller": line["controller"]}
        for name, heading in SHOWN.items():
            values = (line[f"{name}_{end}"] for end in ("change", "change_low", "change_high"))
            change, low, high = (
                f"{value:+.{_digits(value)}f}" if value else "0" for value in values
            )
            row[heading] = "0" if change == low == high == "0" else f"{change} ({low} to {high})"
        rows.append(row | {"outcome": line["outcome"]})
    return pd.DataFrame(rows)


def _digits(value: float) -> int:
    """Return the decimals with which a number has at least two significant digits."""
    return max(0, 1 - math.floor(math.log10(abs(value))))


def _ship_labels(table: pd.DataFrame) -> list[str]:
    return [
        name if interval == INTERVAL_S else f"{name}, {interval:g} s"
        for name, interval in zip(table["ship"], table["interval_s"], strict=True)
    ]


def property_table(files: dict[str, str]) -> pd.DataFrame:
    """Return what decides the limit on each ship."""
    rows = []
    for name, file in files.items():
        ship = load_ship(file)
        plant, top = ship.record(), ship.shaft_speeds[1]
        ratio = float(plant["gear_ratio"])
        torque = ratio * torque_limit(plant, ratio * top)
        least = float(AntiSpin(ship, overspeed_only=1.0).settings["least_limit"])
        curve = combinator_curve(ship)
        row = {
            "ship": name,
            "highest shaft speed rad/s": top,
            "lowest limit rad/s": least,
            "run-up time s": top * float(shaft_inertia(plant)) / torque,
        }
        for load, values in LOADS.items():
            speeds = curve.set_points(np.array(values.order) * curve.ship_speed[-1]).shaft_speed
            row[f"calm-water speed, {load} load rad/s"] = f"{speeds[0]:.1f} to {speeds[1]:.1f}"
        rows.append(row)
    return pd.DataFrame(rows)


def particulars_table() -> pd.DataFrame:
    """Return the particulars of the ships that the package does not contain."""
    keys = list(dict.fromkeys(key for given in PARTICULARS.values() for key in given))
    rows = [
        {"key": key} | {name: f"{given.get(key, 'default')}" for name, given in PARTICULARS.items()}
        for key in keys
    ]
    return pd.DataFrame(rows)


def refusal_of_an_electric_ship() -> str:
    """Return the message with which anti-spin refuses the tug with electric motors."""
    given = PARTICULARS["harbour-tug"] | {"prime_mover": "electric"}
    try:
        AntiSpin(ship_from_particulars(Particulars(name="electric-tug", **given)))
    except ValueError as error:
        return str(error)
    raise ValueError("anti-spin did not refuse an electric ship")


def main(arguments: list[str] | None = None) -> None:
    """Simulate, compare and write ``anti-spin-ships.md`` and its table."""
    folder = "out/anti-spin-ships"
    parser = make_parser("anti_spin_ships", __doc__, folder, kept=folder, jobs=None)
    parser.add_argument("--seeds", type=int, default=32, help="number of episodes")
    options = parser.parse_args(arguments)
    if options.seeds < 2:
        parser.error("--seeds must be at least 2")
    table = table_of(run_cases(options.kept, options.seeds, options.jobs))
    print()
    write_results(
        __file__,
        options.out,
        "Anti-spin on four ships",
        table,
        seeds=options.seeds,
        first=FIRST_SEED,
        last=FIRST_SEED + options.seeds - 1,
        loads=LOADS,
        means=mean_table(table),
        changes=change_table(table),
        particulars=particulars_table(),
        properties=property_table(ship_files(options.kept)),
        refusal=refusal_of_an_electric_ship(),
    )


if __name__ == "__main__":
    main()
