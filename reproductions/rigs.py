"""Diagnose real rigs by the first search alone and with the second search.

Run ``python -m reproductions rigs --recordings FOLDER --out docs/results``; takes about ten minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.files import parse_toml, read_text
from shaftline.display.tables import write_csv
from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.recordings.joint import Recorded
from shaftline.plant import Ship, load_ship

from .emps import runs as emps
from .pages import make_parser
from .rov_thruster import runs as rov
from .writing import rms, write_results


class Given(NamedTuple):
    """Input of a diagnosis."""

    ship: Ship  # of the file
    fitted: list[Recorded]
    unseen: list[Recorded]  # held-out recordings
    columns: Path | None = None  # column map; None where the columns are canonical


class Rig(NamedTuple):
    """A rig and what is known of it."""

    title: str  # name in a few words
    folder: str  # below that of all recordings
    load: Callable[[Path], Given]
    missing: str  # physics that the file lacks, by its owners or independent fits
    bound: str  # rms error of independent fits on the held-out runs in `unit`, or words
    unit: str  # of the error
    scale: float  # factor from the unit of the channel to `unit`
    trap: str  # misleading result


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
    none = dict.fromkeys((emps.COULOMB, emps.VISCOUS, emps.OFFSET), 0.0)
    fitted, held = (table.iloc[::5].reset_index(drop=True) for table in emps.load_runs(folder))
    return Given(emps.rig().with_values(none), [fitted], [held])


def _thruster(folder: Path) -> Given:
    """Load the ROV thruster: two controllers are fitted; the third is held out with its reversals."""
    columns = ["time_s", "motor_voltage_V", rov.SPEED]
    fitted: list[Recorded] = []
    held: list[Recorded] = []
    for (controller, _), run in rov.load_runs(folder).items():
        if controller == "2statekf1":
            held.append(run[columns])
        else:
            fitted += rov.without_reversals(run[columns])
    return Given(load_ship("rov-thruster"), fitted, held)


def _propeller(folder: Path) -> Given:
    """Load the propeller in air: the wind-tunnel runs are fitted, the flight is held out.

    The ship file halves the speeds and scales the coefficients for water; here they are those of air.
    """
    tree = parse_toml(read_text(folder / "ship.toml"), "ship.toml")
    tree["water"]["density_kg_m3"] = 1.2
    tree["propeller"] |= {"thrust_coefficient": 0.104, "torque_coefficient": 0.0173}
    tree["prime_mover"]["speed_max_rad_s"] = 1400.0
    tree["transmission"]["inertia_propeller_side_kg_m2"] = 1e-5
    names = {
        "t_s": "time_s",
        "rpm": "shaft_speed_rad_s",
        "airspeed_mps": "inflow_velocity_m_s",
        "elec_power_W": "electric_power_W",
    }
    tunnel, flight = (
        pd.read_csv(folder / f"{name}_10Hz.csv")[[*names]].rename(columns=names)
        for name in ("windtunnel", "flight")
    )
    for table in (tunnel, flight):
        table["shaft_speed_rad_s"] *= np.pi / 30.0
    return Given(Ship.model_validate(tree), [tunnel], [flight])


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
    measured = found.measured[channel]
    before, after = (rms((measured - run[channel])[rows]) for run in (found.before, found.after))
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
    quick, full = (
        diagnose(
            given.ship,
            *given.fitted,
            hold_out=given.unseen,
            options=Options(columns=given.columns, quick=quick),
        )
        for quick in (True, False)
    )
    before, after = errors(full)
    moved = [f"{n.key} {n.file:.3g} to {n.value:.3g}" for n in full.parameters]
    return {
        "rig": rig.title,
        "missing": rig.missing,
        "verdict": full.verdict,
        "named": describe_findings(full),
        "parameters": "; ".join(moved) or "none",
        "unit": rig.unit,
        "file": rig.scale * before,
        "quick": rig.scale * errors(quick)[1],
        "full": rig.scale * after,
        "bound": rig.bound,
        "quick_named": describe_findings(quick),
        "quick_verdict": quick.verdict,
        "trap": rig.trap,
    }


def write(folder: Path, table: pd.DataFrame) -> Path:
    """Write ``rigs.md`` and ``rigs.csv``."""
    named = table[["rig", "missing", "verdict", "named", "parameters"]]
    first = table[["rig", "quick_verdict", "quick_named"]]
    page = write_results(
        __file__,
        folder,
        "Real rigs: effects and parameters together",
        table,
        {},
        "--recordings FOLDER",
        rigs=RIGS,
        errors=table[["rig", "unit", "file", "quick", "full", "bound"]],
        named=named.rename(columns={"named": "identified"}),
        first=first.rename(columns={"quick_verdict": "verdict", "quick_named": "identified"}),
    )
    write_csv(folder, "rigs", table, digits=4)
    return page


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
    write(options.out, pd.DataFrame(rows))


if __name__ == "__main__":
    main()
