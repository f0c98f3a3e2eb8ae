"""Real rigs of other people: the diagnosis by the first search, and with the second one.

Run ``python -m reproductions rigs --recordings FOLDER --out docs/results``; takes about ten minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shaftline.core.files import read_text, toml_of, write_atomically, write_text
from shaftline.display.tables import markdown
from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.recordings.joint import Recorded
from shaftline.plant import Ship, load_ship

from .emps import runs as emps
from .rov_thruster import runs as rov


@dataclass(frozen=True)
class Given:
    """What a diagnosis is given of a rig.

    Args:
        ship: as its file has it.
        fitted: recordings that are fitted.
        unseen: recordings that are judged on.
        columns: column map, or none.
    """

    ship: Ship
    fitted: list[Recorded]
    unseen: list[Recorded]
    columns: Path | None = None


@dataclass(frozen=True)
class Rig:
    """A rig and what is known of it.

    Args:
        title: in a few words.
        folder: below that of all recordings.
        load: reads what a diagnosis is given.
        missing: what the file lacks, as its owners or independent fits have it.
        bound: rms error on the unseen runs that independent fits reach, in ``unit``; or in words.
        unit: of the error.
        scale: of the error in the channel's unit to one in ``unit``.
        trap: what would have looked better, or right.
    """

    title: str
    folder: str
    load: Callable[[Path], Given]
    missing: str
    bound: str
    unit: str
    scale: float
    trap: str


def _generator(folder: Path) -> Given:
    """The motor with a generator: the first half is fitted, the second is unseen."""
    table = pd.read_csv(folder / "data.csv")
    test = table["is_test"].astype(bool)
    first = pd.DataFrame({"time_s": 0.1 * table["k"], "motor_voltage_V": table["u_volt"]})
    first["shaft_speed_rad_s"] = (table["speed_raw"] + 144.0) * np.pi / 30.0
    halves = [first[half].reset_index(drop=True) for half in (~test, test)]
    return Given(load_ship(folder / "ship.toml"), halves[:1], halves[1:])


def _pendulum(folder: Path) -> Given:
    """The servo; its gravity hears the simulated angle, not the measured one."""
    text = read_text(folder / "ship.toml").replace('[signals]\npendulum_angle = "rad"\n', "")
    tree = toml_of(text.replace("pendulum_angle", "shaft_angle"), "ship.toml")
    ship = Ship.model_validate(tree)
    names = ("kp200_sin_sin", "kp400_sin_sin", "kp400_up_and_down")
    unseen = ("kp400_sin_time_square", "kp200_up_and_down", "kp800_sin_sin")
    fitted, held = ([folder / f"{n}_v.csv" for n in some] for some in (names, unseen))
    return Given(ship, list(fitted), list(held), folder / "map.toml")


def _positioning(folder: Path) -> Given:
    """The positioning system without any friction or offset in its file, and its mass a guess."""
    runs = emps.load_runs(folder)
    none = dict.fromkeys((emps.COULOMB, emps.VISCOUS, emps.OFFSET), 0.0)
    tables = [
        table.iloc[::5].reset_index(drop=True) for table in (runs.estimation, runs.validation)
    ]
    return Given(emps.rig().with_values(none), [tables[0]], [tables[1]])


def _thruster(folder: Path) -> Given:
    """The ROV thruster's speed: two controllers are fitted, the third is unseen, reversals and all."""
    columns = ["time_s", "motor_voltage_V", rov.SPEED]
    runs = {key: table[columns] for key, table in rov.load_runs(folder).items()}
    unseen = "2statekf1"
    fitted = [
        part
        for (controller, _), table in runs.items()
        if controller != unseen
        for part in rov.without_reversals(table)
    ]
    held = [table for (controller, _), table in runs.items() if controller == unseen]
    return Given(load_ship("rov-thruster"), list(fitted), list(held))


def _propeller(folder: Path) -> Given:
    """The propeller in air: the wind tunnel's runs are fitted, the flight is unseen.

    The ship file halves speeds and scales the coefficients for water; here they are those of air.
    """
    tree = toml_of(read_text(folder / "ship.toml"), "ship.toml")
    tree["water"]["density_kg_m3"] = 1.2
    tree["propeller"] |= {"thrust_coefficient": 0.104, "torque_coefficient": 0.0173}
    tree["prime_mover"]["speed_max_rad_s"] = 1400.0
    tree["transmission"]["inertia_propeller_side_kg_m2"] = 1e-5
    tables = []
    for name in ("windtunnel", "flight"):
        table = pd.read_csv(folder / f"{name}_10Hz.csv")
        tables.append(
            pd.DataFrame(
                {
                    "time_s": table["t_s"],
                    "shaft_speed_rad_s": table["rpm"] * np.pi / 30.0,
                    "inflow_velocity_m_s": table["airspeed_mps"],
                    "electric_power_W": table["elec_power_W"],
                }
            )
        )
    return Given(Ship.model_validate(tree), tables[:1], tables[1:])


RIGS = (
    Rig("motor with a generator", "dc_motor_generator", _generator,
        "an armature that is open at 0 V, dry friction, a lag of the reading",
        "6.0", "rad/s", 1.0,
        "dry friction or the open armature alone: neither helps without the other"),
    Rig("servo with a pendulum", "servo_pendulum", _pendulum,
        "friction that grows with the load", "0.083", "rad", 1.0,
        "constant Coulomb friction, the second best (0.19)"),
    Rig("motor, screw and carriage (EMPS)", "emps", _positioning,
        "viscous and Coulomb friction, an offset of the force; the mass is 80 kg for 95",
        "4.9 (all refitted), 9.0 (published numbers)", "mm", 1e3,
        "friction by direction fits the first run better (1.7) and the other worse (7.3)"),
    Rig("ROV thruster", "rov_thruster", _thruster,
        "a dead zone of the drive: 0.83 V astern, 0.86 V ahead by its owners",
        "unknown: the tachometer's sign is guessed in reversals", "rad/s", 1.0,
        "the same without the rows of the reversals: a few rad/s"),
    Rig("propeller in air", "propeller_inflow", _propeller,
        "inflow in the torque, then a loss in proportion to speed",
        "10.3 (11.3 with the inflow alone)", "W", 1.0,
        "a loss in proportion to speed without inflow: 17.0"),
)  # fmt: skip


def errors(found: Diagnosis) -> tuple[float, float]:
    """Rms error of the first channel on the unseen runs: file's ship, corrected ship."""
    rows = np.zeros(len(found.time_s), dtype=bool)
    for start, end in found.held_out:
        rows |= (found.time_s >= start - 1e-9) & (found.time_s < end - 1e-9)
    channel = next(iter(found.measured))
    before, after = (
        float(np.sqrt(np.mean((found.measured[channel] - run[channel])[rows] ** 2)))
        for run in (found.before, found.after)
    )
    return before, after


def names(found: Diagnosis) -> str:
    """What was named, with sizes, and what cannot be told from it."""
    said = []
    for finding in found.findings:
        first = finding.estimates[0]
        others = dict.fromkeys(c.effect.id for c in finding.rivals)
        others.pop(finding.effect.id, None)
        words = f"{finding.effect.label} {first.value:.3g} {first.unit}"
        said.append(f"{words} (or {', '.join(others)})" if others else words)
    return "; ".join(said) or "nothing"


def row(rig: Rig, folder: Path) -> dict[str, object]:
    """One rig, diagnosed by either search and judged on its unseen runs."""
    given = rig.load(folder / rig.folder)
    found = {
        quick: diagnose(
            given.ship, *given.fitted, hold_out=given.unseen,
            options=Options(columns=given.columns, quick=quick),
        )
        for quick in (True, False)
    }  # fmt: skip
    before, after = errors(found[False])
    moved = [f"{n.key} {n.file:.3g} to {n.value:.3g}" for n in found[False].numbers]
    return {
        "rig": rig.title,
        "missing": rig.missing,
        "verdict": found[False].verdict,
        "named": names(found[False]),
        "parameters": "; ".join(moved) or "none",
        "unit": rig.unit,
        "file": rig.scale * before,
        "quick": rig.scale * errors(found[True])[1],
        "full": rig.scale * after,
        "bound": rig.bound,
        "quick_named": names(found[True]),
        "quick_verdict": found[True].verdict,
        "trap": rig.trap,
    }


def body(table: pd.DataFrame) -> str:
    """The page."""
    errors_of = table[["rig", "unit", "file", "quick", "full", "bound"]]
    said = table[["rig", "missing", "verdict", "named", "parameters"]]
    before = table[["rig", "quick_verdict", "quick_named"]]
    return "\n\n".join(
        [
            "# Real rigs: effects and parameters together",
            "Made by `python -m reproductions rigs --recordings FOLDER --out docs/results`. The "
            "ship files contain guesses; `studies/rigs.py` defines which runs are fitted and which are "
            "held out. All errors are rms of a free-running simulation on held-out runs. In *full*, the "
            "initial state of such a run is estimated from its first rows; otherwise it is the mean "
            "over 40 time steps.",
            "The second search was developed on these rigs. The table therefore shows what it can "
            "identify, not how often it is right on other rigs.",
            "## Errors on held-out runs",
            "*file*: the ship as given. *quick*: `shaftline diagnose --quick`, the first search alone. "
            "*full*: `shaftline diagnose`. *bound*: what independent fits of the same data reach.",
            markdown(errors_of, 3),
            "## Identified effects, and the missing ones",
            markdown(said, 3),
            "## Result of the first search alone",
            markdown(before, 3),
            "## Traps",
            "\n".join(f"- {one.title}: {one.trap}." for one in RIGS),
        ]
    )


def main() -> None:
    """Diagnose every rig that is there, and write ``rigs.md`` and ``rigs.csv``."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--recordings", type=Path, required=True, help="folder with one a rig")
    parser.add_argument("--out", type=Path, default=Path("out/rigs"), help="folder")
    options = parser.parse_args()
    rows = []
    for rig in RIGS:
        print(f"{rig.title} ...", flush=True)
        rows.append(row(rig, options.recordings))
        print(f"  {rows[-1]['verdict']}: {rows[-1]['named']}", flush=True)
    table = pd.DataFrame(rows)
    options.out.mkdir(parents=True, exist_ok=True)
    write_atomically(
        options.out / "rigs.csv", lambda file: table.to_csv(file, index=False, float_format="%.4g")
    )
    write_text(options.out / "rigs.md", body(table) + "\n")
    print(f"page: {options.out / 'rigs.md'}")


if __name__ == "__main__":
    main()
