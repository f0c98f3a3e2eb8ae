"""Simulate the frigate on the rounded table of the thesis, and its observers with this table.

The package has smooth open-water curves; the table (:mod:`.rounded_table`) is piecewise linear, which no
ship file describes. Equations 2-20 and 3-12 are therefore written here once more, for this table alone.

The observers that invert KQ use a fit of J over KQ and P/D: a polynomial of the degree 4 in KQ, 3 in P/D
and 4 in all, by least squares through the entries with KQ > 0. The thesis does not print its inverse. An
exact inverse of the table has no error in the row of the shaft acceleration observer of Table 4-1, which
chose the degrees. The immersion-and-invariance observers and the random-walk Kalman filter use the table
itself; the filter as printed is a power balance (Table 4-1), so M_m is inverted exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.compiled import compiled
from shaftline.observers import get_observer
from shaftline.observers.following import variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH, RACK

from . import rounded_table
from .rounded_table import LOWEST_PITCH, Floats, Table

STEP_S = 0.01
BEFORE_S, AFTER_S = 2.0, 52.0
"""Lengths of the records of both steps before and after the step [s]."""
HIGH_SINE_S, RAMP_S = 60.0, 180.0
"""Lengths of the records at 4 rad/s and of the ramp [s]; that of the ramp ends with the ramp."""
CHOSEN_BY = {
    ("random-walk-kalman", "rack_step"),
    ("random-walk-kalman", "pitch_step"),
    ("immersion-invariance-low", "inflow_sine_high"),
}
"""Scores of Table 4-1 that chose the lengths."""
DEGREES = (4, 3)  # of J in KQ and in P/D; the larger one is that of the whole polynomial

Inverse = Callable[[Floats, Floats], Floats]  # J by KQ and P/D, each of shape (n,)


class Samples(NamedTuple):
    """A record of the frigate at :data:`STEP_S`, each of shape (n,)."""

    shaft_speed: Floats  # [rad/s]
    shaft_torque: Floats  # M_m [N m]
    pitch_ratio: Floats
    acceleration: Floats  # [rad/s2]
    velocity: Floats  # v_a [m/s]


@compiled
def _between(nodes: Floats, steps: Floats, j: float, pitch_ratio: float) -> float:
    along, across = j / steps[0], (pitch_ratio - LOWEST_PITCH) / steps[1]
    i = min(max(math.floor(along + 1e-9), 0), nodes.shape[0] - 2)
    k = min(max(math.floor(across + 1e-9), 0), nodes.shape[1] - 2)
    f, g = along - i, across - k
    low = (1.0 - f) * nodes[i, k] + f * nodes[i + 1, k]
    high = (1.0 - f) * nodes[i, k + 1] + f * nodes[i + 1, k + 1]
    return float((1.0 - g) * low + g * high)


@compiled
def _rates(
    p: Floats, kt: Floats, kq: Floats, steps: Floats, state: Floats, given: Floats, out: Floats
) -> None:
    """Write the rates of P/D, omega and v_s, M_m and v_a; ``given`` are rack, P/D_d, d_c1 and u_x."""
    velocity = p[0] * state[2] + given[3]
    j = 2.0 * math.pi * velocity / (state[1] * p[11])
    square = state[1] * state[1]
    torque = p[1] * square * _between(kq, steps, j, state[0])
    thrust = p[2] * square * _between(kt, steps, j, state[0])
    engine = p[7] * state[1] + p[8] * given[0] + p[9]
    out[0] = (given[1] - state[0]) / p[12]
    out[1] = (engine - torque) / (p[5] + p[6])
    out[2] = (thrust - given[2] * p[3] * state[2] * state[2]) / p[4]
    out[3] = p[5] * out[1] + torque
    out[4] = velocity


@compiled
def _run(
    p: Floats,
    kt: Floats,
    kq: Floats,
    steps: Floats,
    state: Floats,
    given: Floats,
    dt: float,
    out: Floats,
) -> None:
    """Integrate by fourth-order Runge-Kutta; ``given`` has the inputs at every half step."""
    rate, total = np.empty(5), np.empty(3)
    for n in range(len(out)):
        _rates(p, kt, kq, steps, state, given[2 * n], rate)
        out[n, 0], out[n, 1], out[n, 2] = state[1], rate[3], state[0]
        out[n, 3], out[n, 4] = rate[1], rate[4]
        if n == len(out) - 1:
            break
        total[:] = rate[:3]
        for weight, share, row in ((2.0, 0.5, 1), (2.0, 0.5, 1), (1.0, 1.0, 2)):
            _rates(p, kt, kq, steps, state + share * dt * rate[:3], given[2 * n + row], rate)
            total += weight * rate[:3]
        state = state + dt / 6.0 * total


@compiled
def _follow_invariance(
    p: Floats, kq: Floats, steps: Floats, read: Floats, gamma: float, dt: float, out: Floats
) -> None:
    """Integrate eq. 3-13 by Heun's rule in quarter steps, with measurements linear between samples."""
    scaled, parts = out[0] - gamma * read[0, 0], 4
    for n in range(len(out) - 1):
        for part in range(parts):
            rate = np.zeros(2)
            for end in range(2):
                share = (part + end) / parts
                omega = read[n, 0] + share * (read[n + 1, 0] - read[n, 0])
                meter = read[n, 1] + share * (read[n + 1, 1] - read[n, 1])
                pitch = read[n, 2] + share * (read[n + 1, 2] - read[n, 2])
                velocity = scaled + end * dt / parts * rate[0] + gamma * omega
                j = 2.0 * math.pi * velocity / (omega * p[11])
                torque = p[1] * omega * omega * _between(kq, steps, j, pitch)
                rate[end] = gamma * (torque - meter) / p[5]
            scaled += 0.5 * dt / parts * (rate[0] + rate[1])
        out[n + 1] = scaled + gamma * read[n + 1, 0]


def _parameters(ship: Ship) -> Floats:
    lag = float(ship.record()["pitch_time_constant"])
    return np.array([*rounded_table.parameters(ship), lag], np.float64)


def _inputs(case: str, seed: int) -> tuple[tuple[float, float], Floats]:
    """Return rack and pitch of the initial steady state, and the inputs at every half step."""
    half, own = 0.5 * STEP_S, CASES[case]
    seconds = {"rack_step": BEFORE_S + AFTER_S, "pitch_step": BEFORE_S + AFTER_S}
    seconds |= {"inflow_sine_high": HIGH_SINE_S, "resistance_ramp": RAMP_S}
    count = 2 * round(seconds.get(case, own.duration_s) / STEP_S) + 1
    time = half * np.arange(count)
    given = np.tile([RACK, PITCH, 1.0, 0.0], (count, 1))
    schedule = own.schedule
    if own.sea:
        frigate = load_ship("frigate")
        smooth = own.run(frigate, seed=seed, dt=half)
        kept = 1.0 - float(frigate.record()["wake_fraction"])
        given[:, 3] = (smooth["advance_velocity"] - kept * smooth["ship_speed"])[:count]
    elif case.endswith("_step"):
        shifted = time + 10.0 - BEFORE_S  # the step of the case comes after 10 s
        column, signal = (0, schedule.drive) if case == "rack_step" else (1, schedule.pitch_command)
        given[:, column] = signal(shifted)  # type: ignore[operator]
    elif case.startswith("inflow"):
        given[:, 3] = schedule.inflow(time)  # type: ignore[operator]
    else:
        given[:, 2] = schedule.resistance_factor(time)  # type: ignore[operator]
    return own.start, given


def simulate_case(ship: Ship, table: Table, case: str, seed: int = 0) -> Samples:
    """Simulate a load case of the thesis on the table."""
    start, given = _inputs(case, seed)
    at = rounded_table.steady_state(ship, table, *start)
    state = np.array([at.pitch_ratio, at.shaft_speed, at.ship_speed])
    out, steps = np.empty((len(given) // 2 + 1, 5)), np.array([*table[2:]])
    _run(_parameters(ship), table.thrust, table.torque, steps, state, given, STEP_S, out)
    return Samples(*out.T.copy())


def polynomial_inverse(table: Table, factor: float = 1.0) -> Inverse:
    """Return the fit of J over KQ and P/D to the entries with KQ > 0; ``factor`` is on KQ."""
    j = table.advance_step * np.arange(table.torque.shape[0])
    p = LOWEST_PITCH + table.pitch_step * np.arange(table.torque.shape[1])
    ratios, pitches = np.meshgrid(j, p, indexing="ij")
    kept = table.torque > 0.0
    powers = [
        (a, b)
        for a in range(DEGREES[0] + 1)
        for b in range(DEGREES[1] + 1)
        if a + b <= max(DEGREES)
    ]

    def design(kq: Floats, pitch: Floats) -> Floats:
        return np.column_stack([(20.0 * kq) ** a * pitch**b for a, b in powers])

    matrix = design(factor * table.torque[kept], pitches[kept])
    fitted = np.linalg.lstsq(matrix, ratios[kept], rcond=None)[0]
    return lambda kq, pitch: np.asarray(design(kq, pitch) @ fitted)


def exact_inverse(table: Table, factor: float = 1.0) -> Inverse:
    """Return the inverse of the table itself, whose KQ falls with J."""
    j = table.advance_step * np.arange(table.torque.shape[0])

    def invert(kq: Floats, pitch: Floats) -> Floats:
        across = (pitch - LOWEST_PITCH) / table.pitch_step
        k = np.clip(np.floor(across + 1e-9).astype(int), 0, table.torque.shape[1] - 2)
        found = np.empty(len(kq))
        for n, (one, low, g) in enumerate(zip(kq, k, across - k, strict=True)):
            column = (1.0 - g) * table.torque[:, low] + g * table.torque[:, low + 1]
            found[n] = np.interp(-one, -factor * column, j)
        return found

    return invert


def _velocity(ship: Ship, invert: Inverse, torque: Floats, omega: Floats, pitch: Floats) -> Floats:
    p = _parameters(ship)
    ratio = invert(torque / (p[1] * omega**2), pitch)
    return np.asarray(ratio * omega * float(p[11]) / (2.0 * math.pi))


def _shaft_estimate(name: str, ship: Ship, samples: Samples) -> tuple[Floats, Floats]:
    """Return M_p and omega by a Luenberger observer or the shaft Kalman filter of the package."""
    record = get_observer(name).discretise(ship, STEP_S)
    f, before, now = (record[key][:2, :2] for key in ("transition", "before", "now"))
    read = np.column_stack([samples.shaft_speed, samples.shaft_torque])
    found = np.empty_like(read)
    found[0] = read[0]
    for n in range(1, len(read)):
        found[n] = f @ found[n - 1] + before @ read[n - 1] + now @ read[n]
    return found[:, 1], found[:, 0]


def _derived_acceleration(ship: Ship, samples: Samples) -> Floats:
    """Return omega' by s / (T s + 1)."""
    record = get_observer("shaft-acceleration-derived").discretise(ship, STEP_S)
    f, before, now = (float(record[key][0, 0]) for key in ("transition", "before", "now"))
    omega, low = samples.shaft_speed, np.empty(len(samples.shaft_speed))
    low[0] = omega[0]
    for n in range(1, len(omega)):
        low[n] = f * low[n - 1] + before * omega[n - 1] + now * omega[n]
    return np.asarray(float(record["gain"]) * (omega - low))


GAMMAS = {"low": 1.0, "moderate": 4.0, "high": 20.0}


def estimates(ship: Ship, samples: Samples, table: Table, factor: float = 1.0) -> dict[str, Floats]:
    """Return v_a [m/s] by each observer of Table 4-1.

    ``ship`` and ``table`` are those that the observers believe, ``factor`` is on KQ of the table.
    """
    fitted, behind = polynomial_inverse(table, factor), float(_parameters(ship)[5])
    omega, pitch, meter = samples.shaft_speed, samples.pitch_ratio, samples.shaft_torque
    derived = _derived_acceleration(ship, samples)
    torques = {
        name: _shaft_estimate(name, ship, samples)
        for name in ("luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman")
    } | {
        "power-balance": (meter, omega),
        "shaft-acceleration": (meter - behind * samples.acceleration, omega),
        "shaft-acceleration-derived": (meter - behind * derived, omega),
    }
    found = {
        name: _velocity(ship, fitted, torque, speed, pitch)
        for name, (torque, speed) in torques.items()
    }
    read, steps = np.column_stack([omega, meter, pitch]), np.array([*table[2:]])
    start = _velocity(ship, exact_inverse(table, factor), meter[:1], omega[:1], pitch[:1])
    for tuning, gamma in GAMMAS.items():
        out = np.full(len(omega), start[0])
        _follow_invariance(
            _parameters(ship), factor * table.torque, steps, read, gamma, STEP_S, out
        )
        found[f"immersion-invariance-{tuning}"] = out
    invert = exact_inverse(table, factor)
    found["random-walk-kalman"] = _velocity(ship, invert, meter, omega, pitch)
    return found


def scores(samples: Samples, found: dict[str, Floats]) -> pd.Series:
    """Return the VAF [%] of estimates."""
    return pd.Series(
        {row: variance_accounted_for(samples.velocity, one) for row, one in found.items()}
    )


def score_table(
    seeds: int, columns: list[str], tick: Callable[[], Any] = lambda: None
) -> pd.DataFrame:
    """Return Table 4-1 on the rounded table: VAF [%], that of the sea as the mean of the seeds."""
    ship = load_ship("frigate")
    table, found = rounded_table.rounded_table(ship), {}
    for case in columns:
        lines = []
        for seed in range(seeds if CASES[case].sea else 1):
            samples = simulate_case(ship, table, case, seed)
            lines.append(scores(samples, estimates(ship, samples, table)))
            tick()
        found[case] = pd.concat(lines, axis=1).mean(axis=1)
    return pd.DataFrame(found)
