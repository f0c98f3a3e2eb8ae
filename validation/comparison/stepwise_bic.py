"""Rival method: stepwise regression by BIC on equation errors of the measured signals.

The equation error of each balance of the ship file follows from measured signals and their numerical
derivatives. Terms of a vocabulary are added one by one as long as the Bayesian information criterion
decreases. The method treats all samples as independent and regresses on noisy signals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy

from ..simulator.bench import bench_parameters
from ..simulator.motion import _curve
from ..simulator.parameters import Floats, Parameters, frigate_parameters, open_water_curve
from .rival import RECORDING, ChallengeCase, Rival, entry_of

Terms = dict[str, Floats]
Chosen = tuple[float, str, float, float]
"""Chosen term: score, name, coefficient, and standard error of the coefficient."""
MOST_EFFECTS = 3
SMOOTHED_ROWS = 11  # samples of the quadratic through which signals are differentiated
HELD_OUT_SHARE = 0.25  # last share of the record; fitted on the rest


def _rate(values: Floats, period: float) -> Floats:
    return np.asarray(scipy.signal.savgol_filter(values, SMOOTHED_ROWS, 2, deriv=1, delta=period))


def _lagged(values: Floats, period: float, lag: float) -> Floats:
    shift = max(round(lag / period), 1)
    return np.concatenate([np.full(shift, values[0]), values[:-shift]])


def _curves(j: Floats, p: Floats, n: Parameters) -> tuple[Floats, Floats]:
    tables = (open_water_curve(c, round(n["blades"]), n["area_ratio"]) for c in ("KT", "KQ"))
    kt, kq = (np.array([_curve(t, a, b) for a, b in zip(j, p, strict=True)]) for t in tables)
    return kt, kq


def frigate_errors(table: pd.DataFrame) -> dict[str, tuple[Floats, Terms]]:
    """Return the equation error of each balance of the frigate, and its candidate terms."""
    n = frigate_parameters()
    period = float(table["time_s"].iloc[1] - table["time_s"].iloc[0])
    rack, order = (table[c].to_numpy() for c in ("fuel_rack_mm", "pitch_ratio_command"))
    pitch, omega, torque, v = (
        table[c].to_numpy()
        for c in ("pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s")
    )
    gain = n["gear"] * n["efficiency"]
    engine_speed = n["gear"] * omega
    brake = n["map_speed"] * engine_speed + n["map_rack"] * rack + n["map_zero"]
    spin, jerk = _rate(omega, period), _rate(v, period)
    turns = omega / (2.0 * math.pi)
    arriving = (1.0 - n["wake"]) * v
    j = np.clip(arriving / (turns * n["diameter"]), -0.25, 1.6)
    kt, kq = _curves(j, pitch, n)
    kq_up = _curves(j, pitch + 0.01, n)[1]
    kt_j, kq_j = _curves(j + 0.01, pitch, n)
    force = n["density"] * turns**2 * n["diameter"] ** 4
    load = force * n["diameter"] * kq
    push = n["screws"] * (1.0 - n["deduction"]) * force
    half = np.arange(len(table)) > len(table) // 2
    ones = np.ones(len(table))
    middle = float(omega.mean())
    loading = np.maximum(turns / turns.mean() - 1.0, 0.0)
    error = pitch - _relaxed(np.clip(order, n["pitch_low"], n["pitch_high"]), n, period)
    fuel, unit = gain * n["map_rack"], force * n["diameter"]
    return {
        "engine": (torque - (gain * brake - n["inertia_front"] * spin), {
            "coulomb-friction": -ones, "viscous-friction": -omega, "engine-derating": -gain * brake,
            "engine-torque-curvature": (engine_speed - n["gear"] * middle) ** 2,
            "engine-torque-lag": -fuel * (rack - _lagged(rack, period, 2.0)),
            "engine-dead-time": -fuel * (rack - _lagged(rack, period, 0.5)),
            "torque-sensor-gain": torque, "torque-sensor-delay": -_rate(torque, period),
        }),
        "propeller": (torque - (load + n["inertia_back"] * spin), {
            "coulomb-friction": ones, "viscous-friction": omega, "propeller-roughness": unit,
            "entrained-water-inertia": spin, "pitch-sensor-offset": -unit * (kq_up - kq) / 0.01,
            "inflow-lag": -unit * (kq_j - kq) * jerk,
            "wake-speed-dependence": unit * (kq_j - kq) * v**2,
            "cavitation-breakdown": -load * loading, "torque-sensor-bias": half - 0.5,
        }),
        "hull": (n["mass"] * jerk - (push * kt - n["resistance"] * v * np.abs(v)), {
            "hull-fouling": -n["resistance"] * v * np.abs(v),
            "current": 2.0 * n["resistance"] * np.abs(v),
            "resistance-episode": -(half * 1.0) * v * np.abs(v),
            "wake-speed-dependence": push * (kt_j - kt) * v**2, "propeller-roughness": -push * pitch,
        }),
        "pitch-actuator": (error, {
            "pitch-actuator-offset": ones, "pitch-dead-band": -np.sign(_rate(order, period)),
            "pitch-backlash": -np.sign(_rate(pitch, period)),
            "pitch-rate-limit": -_rate(pitch, period),
        }),
    }  # fmt: skip


def _relaxed(order: Floats, n: Parameters, period: float) -> Floats:
    share = -math.expm1(-period / n["pitch_time"])
    here, track = float(order[0]), np.empty(len(order))
    for k, goal in enumerate(order.tolist()):
        track[k] = here
        here += share * (goal - here)
    return track


def bench_errors(table: pd.DataFrame) -> dict[str, tuple[Floats, Terms]]:
    """Return equation errors and candidate terms of the thruster's shaft and armature circuit."""
    n = bench_parameters()
    period = float(table["time_s"].iloc[1] - table["time_s"].iloc[0])
    volt, omega, current = (
        table[c].to_numpy() for c in ("motor_voltage_V", "shaft_speed_rad_s", "motor_current_A")
    )
    drag = n["density"] * n["diameter"] ** 5 * n["kq"] / (2.0 * math.pi) ** 2
    torque = n["constant"] * n["gear"] * current - drag * omega * np.abs(omega)
    spin = _rate(omega, period)
    missing = torque - n["rub"] * np.tanh(omega / 0.1) - n["inertia"] * spin
    electric = volt - n["constant"] * n["gear"] * omega - n["ohm"] * current
    return {
        "motor": (
            missing,
            {
                "coulomb-friction": np.sign(omega),
                "viscous-friction": omega,
                "quadratic-drag": omega * np.abs(omega),
                "inflow-lag": spin * np.abs(omega),
                "direction-asymmetry": omega**2 * (omega < 0.0),
            },
        ),
        "motor ": (
            electric,
            {
                "command-dead-zone": np.sign(volt),
                "supply-limit": current * np.abs(current),
            },
        ),
    }


def _bic(left: Floats, terms: int) -> float:
    return len(left) * math.log(float(np.mean(left**2)) + 1e-30) + terms * math.log(len(left))


def _stepwise(error: Floats, terms: Terms) -> list[Chosen]:
    """Return terms in the order of selection, scored by the decrease of the BIC."""
    taken: list[str] = []
    falls: list[float] = []
    score = _bic(error, 0)

    def regress(names: list[str]) -> tuple[Floats, Any]:
        matrix = np.column_stack([terms[name] for name in names])
        return matrix, np.linalg.lstsq(matrix, error, rcond=None)[0]

    while len(taken) < min(MOST_EFFECTS, len(terms)):
        trials = {}
        for name in set(terms) - set(taken):
            matrix, fit = regress([*taken, name])
            trials[name] = _bic(error - matrix @ fit, len(taken) + 1)
        best = min(sorted(trials), key=lambda name: trials[name])
        if trials[best] >= score:
            break
        falls.append(score - trials[best])
        score = trials[best]
        taken.append(best)
    if not taken:
        return []
    matrix, fit = regress(taken)
    noise = float(np.mean((error - matrix @ fit) ** 2))
    spread = np.sqrt(np.diag(noise * np.linalg.pinv(matrix.T @ matrix)))
    return [(falls[i], taken[i], float(fit[i]), float(spread[i])) for i in range(len(taken))]


def diagnose(recording: Path, ship: str, out: Path, exclude: tuple[str, ...]) -> dict[str, Any]:
    """Return a report like ``report.json``.

    Args:
        recording: CSV file with the canonical columns.
        ship: name of the frigate, or path of the thruster's ship file.
        out: unused.
        exclude: ids that may not be reported.
    """
    return report_by(_stepwise, recording, ship, exclude)


def report_by(
    choose: Callable[[Floats, Terms], list[Chosen]],
    recording: Path,
    ship: str,
    exclude: tuple[str, ...],
) -> dict[str, Any]:
    """Return a report with the effects that a method chooses for the equation error of each balance."""
    table = pd.read_csv(recording)
    errors = frigate_errors if "fuel_rack_mm" in table else bench_errors
    fitted = table.iloc[: int(len(table) * (1.0 - HELD_OUT_SHARE))]
    found = []
    for balance, (error, terms) in errors(fitted).items():
        allowed = {name: term for name, term in terms.items() if name not in exclude}
        found += [(*one, balance.strip()) for one in choose(error, allowed)]
    found = sorted(found, reverse=True)[:MOST_EFFECTS]
    seconds = float(table["time_s"].iloc[-1])
    return {
        "verdict": "explained" if found else "nothing-missing",
        "ship": ship,
        "recording": {"rows": len(table), "seconds": seconds,
                      "held_out": [[seconds * (1.0 - HELD_OUT_SHARE), seconds]]},
        "location": {"balances": list(dict.fromkeys(balance for *_, balance in found)),
                     "windows_s": [[0.0, seconds]]},
        "effects": [
            {"id": name, "balance": balance, "equivalent_ids": [],
             "parameters": {"coefficient": {
                 "value": value, "ci95": [value - 1.96 * spread, value + 1.96 * spread]}},
             "evidence": {"score": fall, "threshold": 0.0}}
            for fall, name, value, spread, balance in found
        ],
        "fit": {"held_out": {"before": {}, "after": {}}},
    }  # fmt: skip


class StepwiseBic(Rival):
    """Stepwise regression by BIC; it makes no predictions."""

    name = "stepwise-bic"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the selected terms."""
        return entry_of(report_by(_stepwise, case.folder / RECORDING, str(case.ship), ()))
