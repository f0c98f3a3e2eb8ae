"""Search formulas of concealed physics on simulated ships: cases, recordings, searches."""

from __future__ import annotations

import functools
import importlib.resources
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from shaftline.mismatch.judge.held_out import HeldOut
from shaftline.mismatch.options import Options
from shaftline.mismatch.pipeline import diagnose
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.search.catalogue import applicable_effects
from shaftline.mismatch.search.formulas import FormulaSearch, HeldOutData, choose_formula
from shaftline.mismatch.setting import Settings
from shaftline.plant.expressions import names_in
from shaftline.plant.replay import simulate_recording
from shaftline.plant.ship import Ship
from shaftline.plant.ship_files import load_ship
from shaftline.plant.terms import TERM_SIGNALS, Term

NULLS = {"frigate": 30, "motor": 20}
"""Number of null cases (nothing missing) by rig."""

WRONG = 0.01
"""Relative standard deviation of the parameters in every fourth case; tolerances are 0.15 to 0.5 %."""

NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.014,
    "shaft_torque_N_m": 1400.0,
    "ship_speed_m_s": 0.05,
}
"""Rms noise of the frigate's instruments."""

MOTOR_NOISE = 0.3
"""Rms noise of the motor's shaft speed [rad/s]."""

OUTSIDE = {
    "frigate": {
        "drift_angle": ("rad", 0.0, 0.15), "yaw_rate": ("rad/s", 0.0, 0.015),
        "rudder_angle": ("rad", 0.0, 0.4), "relative_wind": ("m/s", 4.0, 10.0),
        "draught": ("m", 4.5, 0.5), "air_temperature": ("K", 15.0, 10.0),
    },
    "motor": {"side_force": ("N", 40.0, 30.0), "temperature": ("K", 30.0, 25.0)},
}  # fmt: skip
"""Signals in every recording of a rig: unit, mean, largest deviation."""

BIASED = {
    "frigate": (
        "hull.resistance_coefficient_N_s2_m2", "hull.mass_kg",
        "prime_mover.torque_per_rack_N_m_mm", "propeller.relative_rotative_efficiency",
        "transmission.inertia_engine_side_kg_m2",
    ),
    "motor": (
        "prime_mover.motor_constant_V_s_rad", "prime_mover.armature_resistance_ohm",
        "propeller.torque_coefficient", "transmission.inertia_engine_side_kg_m2",
    ),
}  # fmt: skip
"""Parameters of the ship file that are wrong in every fourth case."""


@dataclass(frozen=True)
class Case:
    """One recording.

    Args:
        rig: ``frigate`` or ``motor``.
        truth: missing term; None in a null case.
        seed: of commands, noise, signals and biased parameters.
        wrong: whether the parameters are off by :data:`WRONG`.
    """

    rig: str
    truth: Term | None
    seed: int
    wrong: bool

    @property
    def name(self) -> str:
        """Unique name."""
        return f"{self.rig}-{self.truth.id if self.truth else 'null'}-{self.seed}"


def cases(seed: int) -> list[Case]:
    """Return a case for each truth, and the null cases; every fourth has biased parameters."""
    text = importlib.resources.files(__package__).joinpath("truths.toml").read_text("utf-8")
    found: list[Case] = []
    for entry in tomllib.loads(text)["truth"]:
        term = Term.model_validate(entry["term"])
        found.append(Case(entry["rig"], term, seed + len(found), len(found) % 4 == 3))
    for rig, count in NULLS.items():
        for number in range(count):
            found.append(Case(rig, None, seed + len(found), number % 4 == 3))
    return found


@functools.cache
def nominal_ship(rig: str) -> Ship:
    """Return the ship of the file with the longest time step that its recording allows."""
    units = {name: unit for name, (unit, _, _) in OUTSIDE[rig].items()}
    if rig == "frigate":
        return (
            load_ship("frigate").with_values({"integration.time_step_s": 0.2}).with_signals(units)
        )
    bench = {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.005}
    return load_ship("tito-neri-sine").with_values(bench).with_signals(units)


def make_recording(case: Case) -> pd.DataFrame:
    """Return the recording of a case: steps of the commands at random times, and random signals."""
    rng = np.random.default_rng(case.seed)
    ship = nominal_ship(case.rig)
    if case.wrong:
        ship = ship.with_values(
            {
                k: ship.parameter(k).value * (1.0 + WRONG * rng.standard_normal())
                for k in BIASED[case.rig]
            }
        )
    if case.truth is not None:
        ship = ship.with_term(case.truth)
    frigate = case.rig == "frigate"
    rows, interval = (3001, 0.2) if frigate else (1500, 0.02)
    table = pd.DataFrame({"time_s": np.arange(rows) * interval})
    if frigate:
        table["fuel_rack_mm"] = _steps(rng, rows, 12.0, 26.0, (100, 450))
        table["pitch_ratio_command"] = _steps(rng, rows, 0.9, 1.35, (100, 450))
    else:
        table["motor_voltage_V"] = _steps(rng, rows, -9.0, 9.0, (25, 90))
        table["shaft_speed_rad_s"] = 0.0
    for name, (_, middle, most) in OUTSIDE[case.rig].items():
        table[name] = middle + most * _random_signal(rng, rows)
    signals = table[list(OUTSIDE[case.rig])]
    simulated = simulate_recording(ship, table)
    noise = NOISE if frigate else {"shaft_speed_rad_s": MOTOR_NOISE}
    kept = list(NOISE) if frigate else ["shaft_speed_rad_s"]
    demands = [c for c in ("fuel_rack_mm", "pitch_ratio_command", "motor_voltage_V") if c in table]
    found = simulated[["time_s", *demands, *kept]].copy()
    for column, rms in noise.items():
        found[column] += rms * rng.standard_normal(rows)
    return pd.concat([found, signals], axis=1)


def _steps(
    rng: np.random.Generator, rows: int, low: float, high: float, hold: Sequence[int]
) -> NDArray[np.float64]:
    values = np.empty(rows)
    at = 0
    while at < rows:
        length = int(rng.uniform(*hold))
        values[at : at + length] = rng.uniform(low, high)
        at += length
    return values


def _random_signal(rng: np.random.Generator, rows: int) -> NDArray[np.float64]:
    """Return the sum of eight sines with random slow periods, scaled to a largest value of 1."""
    at: Any = np.arange(rows) / rows
    periods, phases = rng.uniform(1.5, 15.0, 8), rng.uniform(0.0, 2.0 * np.pi, 8)
    waves = rng.standard_normal(8) @ np.sin(2.0 * np.pi * np.outer(periods, at) + phases[:, None])
    return np.asarray(waves / np.abs(waves).max())


def search_case(case: Case) -> dict[str, Any]:
    """Search formulas in every balance, without the catalogue.

    For null cases this is harder than a diagnosis, which first tests whether the residual is noise.
    """
    with threadpool_limits(1, "blas"):
        return _search(case)


def _search(case: Case) -> dict[str, Any]:
    ship, options = nominal_ship(case.rig), Options()
    together = load_jointly(ship, [make_recording(case)], signals=options.signals)
    effects = applicable_effects(ship, set(together.tables[0].columns))
    setting = Settings(ship, together, effects, 1.0).best
    fitter = setting.fitter
    begin = time.perf_counter()
    search = FormulaSearch(fitter, fitter.null, fitter.balances.names)
    rows = np.concatenate([np.arange(a, b) for a, b in setting.held])
    aside = HeldOutData(HeldOut(fitter, setting.held), rows)
    formula = choose_formula(search, aside)
    found: dict[str, Any] = {
        "case": case.name, "rig": case.rig, "seed": case.seed, "wrong_numbers": case.wrong,
        "tried": search.count, "seconds": time.perf_counter() - begin,
        "coloured": ", ".join(setting.whiteness.coloured_balances(fitter.null)),
        "formula": "" if formula is None else f"{formula.term.acts_on}: {formula.term.expression}",
        "signals": [] if formula is None else sorted(formula.signals),
        "gain": 0.0 if formula is None else formula.gain,
        "held_out": 0.0 if formula is None else formula.held_out,
        "threshold": search.threshold(1) if formula is None else formula.threshold,
        "rivals": [] if formula is None else list(formula.rivals),
    }  # fmt: skip
    if case.truth is None:
        return found
    signals = sorted(
        {n for n in names_in(case.truth.expression) if n in TERM_SIGNALS or n in ship.signals}
    )
    start = [p.value for p in case.truth.parameters.values()]
    true = search.fit_term(case.truth.model_copy(update={"id": "truth"}), (), start)
    assert true is not None
    record = fitter.trial_ship.record
    possible = aside.judge(record(true.fit.effects)) - aside.judge(record(()))
    return found | {
        "truth": f"{case.truth.acts_on}: {case.truth.expression}",
        "true_signals": signals,
        "right_signals": found["signals"] == signals,
        "possible": true.gain,
        "possible_held_out": possible,
    }


def diagnose_case(case: Case) -> dict[str, Any]:
    """Diagnose a case, with the catalogue before the formulas."""
    begin = time.perf_counter()
    found = diagnose(nominal_ship(case.rig), make_recording(case), options=Options(quick=True))
    return {
        "case": case.name,
        "verdict": found.verdict,
        "named": [f.effect.label for f in found.findings],
        "formula": None if found.formula is None else found.to_dict()["formula"],
        "held_out": found.held_out_gain,
        "seconds": time.perf_counter() - begin,
    }
