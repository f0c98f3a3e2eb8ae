"""Search formulas of concealed physics on simulated ships: cases, recordings, searches."""

from __future__ import annotations

import functools
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
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

NULLS = {"frigate": 30, "motor": 20}  # number of null cases (nothing missing) by rig
WRONG = 0.01
"""Relative standard deviation of the parameters in every fourth case; tolerances are 0.15 to 0.5 %."""

NOISE = {
    "frigate": {
        "pitch_ratio": 0.004,
        "shaft_speed_rad_s": 0.014,
        "shaft_torque_N_m": 1400.0,
        "ship_speed_m_s": 0.05,
    },
    "motor": {"shaft_speed_rad_s": 0.3},
}
"""Rms noise of the instruments by rig."""

OUTSIDE = {
    "frigate": {
        "drift_angle": ("rad", 0.0, 0.15),
        "yaw_rate": ("rad/s", 0.0, 0.015),
        "rudder_angle": ("rad", 0.0, 0.4),
        "relative_wind": ("m/s", 4.0, 10.0),
        "draught": ("m", 4.5, 0.5),
        "air_temperature": ("K", 15.0, 10.0),
    },
    "motor": {"side_force": ("N", 40.0, 30.0), "temperature": ("K", 30.0, 25.0)},
}
"""Signals in every recording of a rig: unit, mean, largest deviation."""

BIASED = {
    "frigate": (
        "hull.resistance_coefficient_N_s2_m2",
        "hull.mass_kg",
        "prime_mover.torque_per_rack_N_m_mm",
        "propeller.relative_rotative_efficiency",
        "transmission.inertia_engine_side_kg_m2",
    ),
    "motor": (
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "propeller.torque_coefficient",
        "transmission.inertia_engine_side_kg_m2",
    ),
}
"""Parameters of the ship file that are wrong in every fourth case."""


@dataclass(frozen=True)
class Case:
    """One recording."""

    rig: str  # ``frigate`` or ``motor``
    truth: Term | None  # missing term; None in a null case
    seed: int  # of commands, noise, signals and biased parameters
    wrong: bool  # whether the parameters are off by :data:`WRONG`

    @property
    def name(self) -> str:
        """Unique name."""
        return f"{self.rig}-{self.truth.id if self.truth else 'null'}-{self.seed}"


def cases(seed: int) -> list[Case]:
    """Return a case for each truth, and the null cases; every fourth has biased parameters."""
    text = Path(__file__).with_name("truths.toml").read_text("utf-8")
    found: list[Case] = []
    for i, entry in enumerate(tomllib.loads(text)["truth"]):
        found.append(Case(entry["rig"], Term.model_validate(entry["term"]), seed + i, i % 4 == 3))
    for rig, count in NULLS.items():
        found += [Case(rig, None, seed + len(found) + i, i % 4 == 3) for i in range(count)]
    return found


@functools.cache
def nominal_ship(rig: str) -> Ship:
    """Return the ship of the file with the longest time step that its recording allows."""
    units = {name: unit for name, (unit, _, _) in OUTSIDE[rig].items()}
    if rig == "frigate":
        file, values = "frigate", {"integration.time_step_s": 0.2}
    else:
        file = "tito-neri-sine"
        values = {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.005}
    return load_ship(file).with_values(values).with_signals(units)


def make_recording(case: Case) -> pd.DataFrame:
    """Return the recording of a case: steps of the commands at random times, and random signals."""
    rng = np.random.default_rng(case.seed)
    ship, noise, outside = nominal_ship(case.rig), NOISE[case.rig], OUTSIDE[case.rig]
    if case.wrong:
        values = {
            k: ship.parameter(k).value * (1.0 + WRONG * rng.standard_normal())
            for k in BIASED[case.rig]
        }
        ship = ship.with_values(values)
    if case.truth is not None:
        ship = ship.with_term(case.truth)
    rows, interval = (3001, 0.2) if case.rig == "frigate" else (1500, 0.02)
    table = pd.DataFrame({"time_s": np.arange(rows) * interval})
    if case.rig == "frigate":
        table["fuel_rack_mm"] = _steps(rng, rows, 12.0, 26.0, (100, 450))
        table["pitch_ratio_command"] = _steps(rng, rows, 0.9, 1.35, (100, 450))
    else:
        table["motor_voltage_V"] = _steps(rng, rows, -9.0, 9.0, (25, 90))
    commands = [*table]
    if case.rig == "motor":
        table["shaft_speed_rad_s"] = 0.0
    for name, (_, middle, most) in outside.items():
        table[name] = middle + most * _random_signal(rng, rows)
    found = simulate_recording(ship, table)[[*commands, *noise]].copy()
    for column, rms in noise.items():
        found[column] += rms * rng.standard_normal(rows)
    return pd.concat([found, table[list(outside)]], axis=1)


def _steps(
    rng: np.random.Generator, rows: int, low: float, high: float, hold: Sequence[int]
) -> NDArray[np.float64]:
    values, at = np.empty(rows), 0
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


@threadpool_limits.wrap(limits=1, user_api="blas")  # type: ignore[untyped-decorator]
def search_case(case: Case) -> dict[str, Any]:
    """Search formulas in every balance, without the catalogue.

    For null cases this is harder than a diagnosis, which first tests whether the residual is noise.
    """
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
        "case": case.name,
        "rig": case.rig,
        "seed": case.seed,
        "wrong_numbers": case.wrong,
        "tried": search.count,
        "seconds": time.perf_counter() - begin,
        "coloured": ", ".join(setting.whiteness.coloured_balances(fitter.null)),
        "formula": "",
        "signals": [],
        "gain": 0.0,
        "held_out": 0.0,
        "threshold": search.threshold(1),
        "rivals": [],
    }
    if formula is not None:
        found |= {
            "formula": f"{formula.term.acts_on}: {formula.term.expression}",
            "signals": sorted(formula.signals),
            "gain": formula.gain,
            "held_out": formula.held_out,
            "threshold": formula.threshold,
            "rivals": list(formula.rivals),
        }
    if case.truth is None:
        return found
    truth = case.truth
    signals = [n for n in names_in(truth.expression) if n in TERM_SIGNALS or n in ship.signals]
    start = [p.value for p in truth.parameters.values()]
    true = search.fit_term(truth.model_copy(update={"id": "truth"}), (), start)
    assert true is not None
    record = fitter.trial_ship.record
    return found | {
        "truth": f"{truth.acts_on}: {truth.expression}",
        "true_signals": sorted(signals),
        "right_signals": found["signals"] == sorted(signals),
        "possible": true.gain,
        "possible_held_out": aside.judge(record(true.fit.effects)) - aside.judge(record(())),
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
