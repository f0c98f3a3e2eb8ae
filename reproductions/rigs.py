"""Diagnose real rigs by the first search alone and with the second search.

Run ``python -m reproductions rigs --recordings FOLDER --out docs/results``; takes about ten minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shaftline.core.files import parse_toml, read_text, write_text
from shaftline.display.tables import write_csv
from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.recordings.joint import Recorded
from shaftline.plant import Ship, load_ship

from .emps import runs as emps
from .pages import fill_template, make_parser
from .rov_thruster import runs as rov


@dataclass(frozen=True)
class Given:
    """Input of a diagnosis.

    Args:
        ship: ship of the file.
        fitted: fitted recordings.
        unseen: held-out recordings.
        columns: column map; None where the columns are canonical.
    """

    ship: Ship
    fitted: list[Recorded]
    unseen: list[Recorded]
    columns: Path | None = None


@dataclass(frozen=True)
class Rig:
    """A rig and what is known of it.

    Args:
        title: name in a few words.
        folder: folder below that of all recordings.
        load: function that loads the input of a diagnosis.
        missing: physics that the file lacks, by its owners or independent fits.
        bound: rms error of independent fits on the held-out runs in ``unit``, or words.
        unit: unit of the error.
        scale: factor from the unit of the channel to ``unit``.
        trap: misleading result.
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
    """Load the motor with a generator: the first half is fitted, the second is held out."""
    table = pd.read_csv(folder / "data.csv")
    test = table["is_test"].astype(bool)
    first = pd.DataFrame({"time_s": 0.1 * table["k"], "motor_voltage_V": table["u_volt"]})
    first["shaft_speed_rad_s"] = (table["speed_raw"] + 144.0) * np.pi / 30.0
    halves = [first[half].reset_index(drop=True) for half in (~test, test)]
    return Given(load_ship(folder / "ship.toml"), halves[:1], halves[1:])


def _pendulum(folder: Path) -> Given:
    """Load the servo; its gravity depends on the simulated instead of the measured angle."""
    text = read_text(folder / "ship.toml").replace('[signals]\npendulum_angle = "rad"\n', "")
    tree = parse_toml(text.replace("pendulum_angle", "shaft_angle"), "ship.toml")
    ship = Ship.model_validate(tree)
    names = ("kp200_sin_sin", "kp400_sin_sin", "kp400_up_and_down")
    unseen = ("kp400_sin_time_square", "kp200_up_and_down", "kp800_sin_sin")
    fitted, held = ([folder / f"{n}_v.csv" for n in some] for some in (names, unseen))
    return Given(ship, list(fitted), list(held), folder / "map.toml")


def _positioning(folder: Path) -> Given:
    """Load the positioning system without friction or offset in its file; its mass is a guess."""
    runs = emps.load_runs(folder)
    none = dict.fromkeys((emps.COULOMB, emps.VISCOUS, emps.OFFSET), 0.0)
    tables = [
        table.iloc[::5].reset_index(drop=True) for table in (runs.estimation, runs.validation)
    ]
    return Given(emps.rig().with_values(none), [tables[0]], [tables[1]])


def _thruster(folder: Path) -> Given:
    """Load the ROV thruster: two controllers are fitted; the third is held out with its reversals."""
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
    """Load the propeller in air: the wind-tunnel runs are fitted, the flight is held out.

    The ship file halves the speeds and scales the coefficients for water; here they are those of air.
    """
    tree = parse_toml(read_text(folder / "ship.toml"), "ship.toml")
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
        "an armature that is open at 0 V, dry friction, a lag of the speed sensor",
        "6.0", "rad/s", 1.0,
        "dry friction or the open armature alone does not help"),
    Rig("servo with a pendulum", "servo_pendulum", _pendulum,
        "friction that grows with the load", "0.083", "rad", 1.0,
        "constant Coulomb friction, the second best (0.19)"),
    Rig("motor, screw and carriage (EMPS)", "emps", _positioning,
        "viscous and Coulomb friction, an offset of the force; the mass is 80 kg for 95",
        "4.9 (all refitted), 9.0 (published parameters)", "mm", 1e3,
        "friction by direction fits the first run better (1.7) and the other worse (7.3)"),
    Rig("ROV thruster", "rov_thruster", _thruster,
        "a dead zone of the drive: 0.83 V astern, 0.86 V ahead by its owners",
        "unknown: the tachometer's sign is guessed in reversals", "rad/s", 1.0,
        "without the rows of the reversals the error is a few rad/s"),
    Rig("propeller in air", "propeller_inflow", _propeller,
        "inflow in the torque, then a loss in proportion to speed",
        "10.3 (11.3 with the inflow alone)", "W", 1.0,
        "a loss in proportion to speed without inflow: 17.0"),
)  # fmt: skip


def errors(found: Diagnosis) -> tuple[float, float]:
    """Return the rms errors of the first channel on the held-out runs: ship file, corrected ship."""
    rows = np.zeros(len(found.time_s), dtype=bool)
    for start, end in found.held_out:
        rows |= (found.time_s >= start - 1e-9) & (found.time_s < end - 1e-9)
    channel = next(iter(found.measured))
    before, after = (
        float(np.sqrt(np.mean((found.measured[channel] - run[channel])[rows] ** 2)))
        for run in (found.before, found.after)
    )
    return before, after


def describe_findings(found: Diagnosis) -> str:
    """Return the identified effects with sizes and indistinguishable alternatives."""
    said = []
    for finding in found.findings:
        first = finding.estimates[0]
        rivals = dict.fromkeys(c.effect.id for c in finding.rivals)
        rivals.pop(finding.effect.id, None)
        words = f"{finding.effect.label} {first.value:.3g} {first.unit}"
        said.append(f"{words} (or {', '.join(rivals)})" if rivals else words)
    return "; ".join(said) or "nothing"


def diagnose_rig(rig: Rig, folder: Path) -> dict[str, object]:
    """Diagnose a rig by either search; return a row of the table."""
    given = rig.load(folder / rig.folder)
    found = {
        quick: diagnose(
            given.ship, *given.fitted, hold_out=given.unseen,
            options=Options(columns=given.columns, quick=quick),
        )
        for quick in (True, False)
    }  # fmt: skip
    before, after = errors(found[False])
    moved = [f"{n.key} {n.file:.3g} to {n.value:.3g}" for n in found[False].parameters]
    return {
        "rig": rig.title,
        "missing": rig.missing,
        "verdict": found[False].verdict,
        "named": describe_findings(found[False]),
        "parameters": "; ".join(moved) or "none",
        "unit": rig.unit,
        "file": rig.scale * before,
        "quick": rig.scale * errors(found[True])[1],
        "full": rig.scale * after,
        "bound": rig.bound,
        "quick_named": describe_findings(found[True]),
        "quick_verdict": found[True].verdict,
        "trap": rig.trap,
    }


def body(table: pd.DataFrame) -> str:
    """Return the page below its title."""
    named = table[["rig", "missing", "verdict", "named", "parameters"]]
    first = table[["rig", "quick_verdict", "quick_named"]]
    return fill_template(
        Path(__file__).with_name("rigs.md"), rigs=RIGS,
        errors=table[["rig", "unit", "file", "quick", "full", "bound"]],
        named=named.rename(columns={"named": "identified"}),
        first=first.rename(columns={"quick_verdict": "verdict", "quick_named": "identified"}),
    )  # fmt: skip


def main() -> None:
    """Diagnose all rigs, and write ``rigs.md`` and ``rigs.csv``."""
    parser = make_parser(
        "rigs", __doc__, "out/rigs", recordings="folder with one folder for each rig"
    )
    options = parser.parse_args()
    rows = []
    for rig in RIGS:
        print(f"{rig.title} ...", flush=True)
        rows.append(diagnose_rig(rig, options.recordings))
        print(f"  {rows[-1]['verdict']}: {rows[-1]['named']}", flush=True)
    table = pd.DataFrame(rows)
    write_csv(options.out, "rigs", table, digits=4)
    title, command = "Real rigs: effects and parameters together", "python -m reproductions rigs"
    head = f"# {title}\n\nMade by `{command} --recordings FOLDER --out docs/results`.\n\n"
    write_text(options.out / "rigs.md", f"{head}{body(table)}\n")
    print(f"page: {options.out / 'rigs.md'}")


if __name__ == "__main__":
    main()
