"""Diagnose fouling beside a wrong torque meter, a turn, inflow and wind; write ``concealed-turn.md``.

Each diagnosis takes some minutes; finished ones are kept in the folder ``--kept``.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.core.files import read_json
from shaftline.core.sweep import sweep
from shaftline.mismatch import Options, diagnose
from shaftline.plant import Schedule, equilibrium, load_ship, simulate
from shaftline.plant.columns import RUDDER_COMMAND
from shaftline.plant.hull import resistance

from .pages import make_parser, print_dot
from .writing import interval, write_results

TITLE = "Fouling beside a wrong torque meter, a turn, slow inflow and wind"
SHIP = "frigate-turning"
TRUTH = {"hull-fouling": 0.09, "torque-sensor-gain": 1.03}
"""Concealed effects of the catalogue with their values."""

DURATION_S, INTERVAL_S = 1800.0, 0.5
INFLOW_M_S, INFLOW_S = 0.12, 120.0  # rms of the slow inflow, and its correlation time
TURN_S, RUDDER_DEG = 50.0, 15.0
NOISE = {
    "pitch_ratio": 0.002,
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 600.0,
    "ship_speed_m_s": 0.02,
    "rudder_rad": 0.002,
    "heading_rad": 0.003,
    "wind_speed_m_s": 0.3,
    "wind_angle_rad": 0.03,
}
"""Standard deviation of the noise of each channel."""

WIND_M_S, GUST_M_S, GUST_S = (10.0, 14.0), 1.0, 60.0
"""Range of the mean true wind, rms of its gusts, and their correlation time."""

AIR = 0.5 * 1.225 * 260.0
"""Half of the density of air times the frontal area of the frigate (assumed) [kg/m]."""

DRAG_ANGLES_DEG = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0)
DRAG = (0.7, 0.8, 0.45, 0.05, -0.35, -0.6, -0.55)
"""Drag coefficient from ahead by apparent angle (assumed); the catalogue has one for all angles."""


OPTIONS = Options(exclude=("current",))
"""The speed is that through the water, which no current changes; the names of loggers say so."""


def _steps(generator: np.random.Generator, time: Any, low: float, high: float, count: int) -> Any:
    """Return a command that moves to another value ``count`` times, within 8 s each time."""
    begins = np.sort(generator.uniform(60.0, DURATION_S - 60.0, count))
    values = generator.uniform(low, high, count + 1)
    corners = np.repeat(begins, 2) + np.tile([0.0, 8.0], count)
    return np.interp(time, np.concatenate([[0.0], corners, [DURATION_S]]), np.repeat(values, 2))


def _slow(generator: np.random.Generator, count: int, rms: float, time_s: float) -> Any:
    """Return a Gauss-Markov process at the rows, of a given rms and correlation time."""
    values, memory = np.zeros(count), np.exp(-INTERVAL_S / time_s)
    shocks = np.sqrt(1.0 - memory**2) * generator.standard_normal(count)
    for k in range(1, count):
        values[k] = memory * values[k - 1] + shocks[k]
    return values * rms / values.std()


def _apparent(wind: Any, comes_from: float, heading: Any, speed: Any) -> tuple[Any, Any]:
    """Return speed [m/s] and angle [rad] of the apparent wind of a ship that moves ahead."""
    angle = comes_from - heading
    ahead, across = wind * np.cos(angle) + speed, wind * np.sin(angle)
    return np.hypot(ahead, across), np.arctan2(across, ahead)


def make_recording(seed: int, windy: bool = False) -> pd.DataFrame:
    """Return a recording of half an hour with the effects of :data:`TRUTH`.

    The drag of the wind follows the heading. It is found by iteration, because the force on the ship is
    an input of the simulation.
    """
    generator, ship = np.random.default_rng(seed), load_ship(SHIP)
    time = np.arange(0.0, DURATION_S, INTERVAL_S)
    rack = _steps(generator, time, 14.0, 24.0, 9)
    pitch = _steps(generator, time, 0.95, 1.3, 7)
    begin, side = generator.uniform(500.0, 1300.0), generator.choice([-1.0, 1.0])
    turning = (time > begin) & (time < begin + TURN_S)
    rudder = np.where(turning, side * np.radians(RUDDER_DEG), 0.0)
    inflow = _slow(generator, len(time), INFLOW_M_S, INFLOW_S)
    weather = np.random.default_rng([seed, 1])
    wind = weather.uniform(*WIND_M_S) + _slow(weather, len(time), GUST_M_S, GUST_S)
    comes_from = weather.uniform(-np.pi, np.pi)
    over = functools.partial(np.interp, xp=time)
    fouled, blown, calm = 1.0 + TRUTH["hull-fouling"], np.zeros_like(time), ship.record()
    for _ in range(3 if windy else 1):
        schedule = Schedule(
            drive=functools.partial(over, fp=rack),
            pitch_command=functools.partial(over, fp=pitch),
            rudder_command=functools.partial(over, fp=rudder),
            inflow=functools.partial(over, fp=inflow),
            resistance_factor=functools.partial(over, fp=fouled + blown),
        )
        start = equilibrium(ship, rack[0], pitch[0], resistance_factor=fouled + blown[0]).state
        samples = simulate(ship, schedule, DURATION_S, initial=start)
        samples = samples[:: round(INTERVAL_S / ship.time_step_s)][: len(time)]
        speed, heading = samples["ship_speed"], samples["heading"]
        seen, angle = _apparent(wind, comes_from, heading, speed)
        if windy:
            drag = np.interp(np.abs(np.degrees(angle)), DRAG_ANGLES_DEG, DRAG)
            blown = AIR * drag * seen**2 / np.array([resistance(calm, v, 1.0) for v in speed])
    torque = TRUTH["torque-sensor-gain"] * samples["shaft_torque"]
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": rack,
            "pitch_ratio_command": pitch,
            RUDDER_COMMAND: rudder,
            "pitch_ratio": samples["pitch_ratio"],
            "shaft_speed_rad_s": samples["shaft_speed"],
            "shaft_torque_N_m": torque,
            "ship_speed_m_s": samples["ship_speed"],
            "rudder_rad": samples["rudder_angle"],
            "heading_rad": heading,
            "wind_speed_m_s": seen,
            "wind_angle_rad": angle,
        }
    )
    if not windy:
        table = table.drop(columns=["wind_speed_m_s", "wind_angle_rad"])
    for column, deviation in NOISE.items():
        if column in table:
            table[column] += deviation * generator.standard_normal(len(time))
    return table.drop(columns=RUDDER_COMMAND)  # as loggers do that record the measured angle only


def diagnose_recording(cell: tuple[int, bool]) -> dict[str, Any]:
    """Return the result of the diagnosis of a recording, as JSON allows."""
    seed, windy = cell
    found = diagnose(load_ship(SHIP), make_recording(seed, windy), options=OPTIONS)
    named = {finding.effect.id: finding.estimates[0] for finding in found.findings}
    concealed = {*TRUTH, *(["wind"] if windy else [])}
    return {
        "seed": seed,
        "wind": "yes" if windy else "no",
        "verdict": found.verdict,
        **{name: interval(named[name]) if name in named else "–" for name in TRUTH},
        "wind named": "yes" if "wind" in named else "no" if windy else "–",
        "others named": ", ".join(name for name in named if name not in concealed) or "–",
        "inside": all(
            name in named and named[name].ci95[0] <= value <= named[name].ci95[1]
            for name, value in TRUTH.items()
        ),
    }


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing diagnoses, and write the page."""
    folder = "out/concealed-turn"
    parser = make_parser("concealed_turn", __doc__, f"{folder}/page", kept=folder)
    parser.add_argument("--seeds", type=int, nargs="+", default=[21, 22], help="recordings")
    options = parser.parse_args(arguments)
    cells = {
        f"seed_{seed}{'_wind' * windy}": (seed, windy)
        for windy in (False, True)
        for seed in options.seeds
    }
    sweep(diagnose_recording, cells, options.kept, jobs=1, tick=print_dot)
    table = pd.DataFrame(read_json(options.kept / f"{name}.json") for name in cells)
    shown = table.assign(inside=table["inside"].map({True: "yes", False: "no"})).rename(
        columns={"inside": "both truths inside"}
    )
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {},
        f"--seeds {' '.join(map(str, options.seeds))}",
        shown=shown,
        right=int(table["inside"].sum()),
        count=len(table),
        wrong=int((table["others named"] != "–").sum()),
    )
