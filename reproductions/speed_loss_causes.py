"""Name the concealed cause of a speed loss in generated logs; write ``speed-loss-causes.md``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.mismatch import load_recording
from shaftline.performance import (
    PhysicalCause,
    ReferenceShip,
    analyse_performance,
    canonical_log,
    explain_periods,
)
from shaftline.performance.monitoring import DAY_S
from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.equilibria import simulate_steady
from shaftline.plant.surroundings import KNOT

from .pages import make_parser, print_dot
from .writing import write_results

TITLE = "Physical causes of a speed loss in generated logs"
SHIP = "ferry"
HOURS = 720  # of each of the two periods
NOISE = {
    "pitch_ratio": 0.005,
    "shaft_speed_rad_s": 0.002,
    "shaft_torque_N_m": 0.01,
    "ship_speed_m_s": 0.01,
}
"""Rms noise of each channel, relative to its rms."""


class Cause(NamedTuple):
    """What changes between the two periods of a log."""

    key: str  # parameter of the ship file
    low: float  # smallest and largest size
    high: float
    effects: tuple[str, ...]  # effects of the catalogue that name it
    relative: bool = True  # whether the size is a factor on the value of the ship file, less 1


CAUSES = {
    "fouled hull": Cause(
        "hull.resistance_coefficient_N_s2_m2", 0.06, 0.2, ("hull-fouling", "resistance-episode")
    ),
    "rough propeller": Cause(
        "propeller.roughness_drag", 0.002, 0.006, ("propeller-roughness",), relative=False
    ),
    "weak engine": Cause("prime_mover.torque_per_rack_N_m_mm", -0.06, -0.02, ("engine-derating",)),
    "torque meter": Cause("sensors.torque_gain", 0.02, 0.06, ("torque-sensor-gain",)),
    "speed log": Cause("sensors.speed_log_gain", -0.04, -0.015, ("speed-log-gain",)),
}


def make_log(cause: Cause, seed: int) -> tuple[pd.DataFrame, float]:
    """Return an hourly log of two months with a cause in the second, and its size.

    Rack and pitch wander slowly about 75 % and 85 % of their largest values.
    """
    generator, ship = np.random.default_rng(seed), load_ship(SHIP)
    size = float(generator.uniform(cause.low, cause.high))
    own = float(ship.parameter(cause.key).value)
    changed = ship.with_values({cause.key: own * (1.0 + size) if cause.relative else own + size})
    top, pitch = 26.0, ship.propeller.pitch_ratio_max
    orders = pd.DataFrame(
        {
            "fuel_rack_mm": top * np.clip(0.75 + 0.12 * _wandering(generator), 0.4, 1.0),
            "pitch_ratio_command": pitch * np.clip(0.85 + 0.06 * _wandering(generator), None, 1.0),
        }
    )
    parts = []
    for model, first in ((ship, 0), (changed, HOURS)):
        rows = orders.iloc[first : first + HOURS].reset_index(drop=True)
        rows.insert(0, "time_s", 3600.0 * np.arange(HOURS))
        parts.append(simulate_steady(model, rows.assign(**dict.fromkeys(NOISE, 1.0))))
    log = pd.concat(parts, ignore_index=True)
    log["time_s"] = 3600.0 * np.arange(2 * HOURS)
    for column, share in NOISE.items():
        spread = share * math.sqrt(np.mean(log[column] ** 2))
        log[column] += spread * generator.standard_normal(len(log))
    return log, size


def _wandering(generator: np.random.Generator) -> np.ndarray:
    """Return a signal of unit rms that changes within two days, shape (2 HOURS,)."""
    noise = generator.standard_normal(2 * HOURS + 40)
    return np.asarray(np.convolve(noise, np.full(41, 41**-0.5), "valid"))


def reference_ship(ship: Ship, pitch: float) -> ReferenceShip:
    """Return the reference curve of the clean ship at a pitch ratio."""
    points = [equilibrium(ship, float(rack), pitch) for rack in np.linspace(8.0, 26.0, 10)]
    return ReferenceShip(
        name=ship.name,
        beam_m=25.0,
        draught_m=6.0,
        speed_kn=tuple(one.state.ship_speed / KNOT for one in points),
        power_kW=tuple(1e-3 * ship.hull.propellers * one.outputs.shaft_power for one in points),
    )


def explain(log: pd.DataFrame) -> tuple[float | None, list[PhysicalCause]]:
    """Return the speed loss of the last period [%], None without an event, and the results."""
    ship = load_ship(SHIP)
    power = 1e-3 * ship.hull.propellers * log["shaft_torque_N_m"] * log["shaft_speed_rad_s"]
    table = pd.DataFrame(
        {"time_d": log["time_s"] / DAY_S, "stw_kn": log["ship_speed_m_s"] / KNOT, "power_kW": power}
    )
    reference = reference_ship(ship, float(log["pitch_ratio_command"].median()))
    report = analyse_performance(reference, canonical_log(table))
    if len(report.periods) < 2:
        return None, []
    return report.periods[-1].mean, [*explain_periods(report, load_recording(log, ship), ship)]


def rows(count: int, seed: int) -> Iterator[dict[str, object]]:
    """Yield a row for each log: concealed cause, its size, speed loss, result, whether it is right."""
    for k, (name, cause) in enumerate(CAUSES.items()):
        for number in range(count):
            log, size = make_log(cause, seed + k * count + number)
            loss, results = explain(log)
            found = results[-1].diagnosis.findings if results and results[-1].diagnosis else ()
            first = found[0] if found else None
            named = first is not None and first.effect.id in cause.effects
            yield {
                "cause": name,
                "size": size,
                "loss": math.nan if loss is None else loss,
                "result": results[-1].headline if results else "no event found",
                "right": named and len(found) == 1,
            }
            print_dot()


def main(arguments: list[str] | None = None) -> None:
    """Write the page."""
    parser = make_parser("speed_loss_causes", __doc__, "out/speed-loss-causes")
    parser.add_argument("--logs", type=int, default=4, help="logs of each cause")
    parser.add_argument("--seed", type=int, default=8100, help="seed of the first log")
    options = parser.parse_args(arguments)
    table = pd.DataFrame(rows(options.logs, options.seed))
    right = table.groupby("cause", sort=False)["right"].agg(["sum", "size"])
    shown = table.assign(
        size=table["size"].map("{:+.3f}".format),
        loss=table["loss"].map("{:+.2f}".format, na_action="ignore").fillna("–"),
        right=table["right"].map({True: "yes", False: "no"}),
    ).rename(columns={"size": "concealed size", "loss": "speed loss [%]"})
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {},
        f"--logs {options.logs} --seed {options.seed}",
        shown=shown,
        right=", ".join(f"{c} {r['sum']} of {r['size']}" for c, r in right.iterrows()),
    )
