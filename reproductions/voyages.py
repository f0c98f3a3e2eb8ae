"""Compute what a forecast of the weather along the voyage saves; write ``voyages.md``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.baselines.working_point import fit_open_water, slack, working_point
from shaftline.display.figures import PALETTE
from shaftline.plant import Ship, get_sea, load_ship
from shaftline.plant.hull import resistance, wake_inflow, wave_resistance

from .pages import make_parser
from .writing import Line, Panel, draw, write_results

TITLE = "What the weather forecast of a voyage saves"

SHIP = "frigate-at-sea"
SEAS = ("calm", "state-3", "state-4", "state-5", "state-6")
SEGMENTS, SEGMENT_M = 8, 40e3
"""Segments of a voyage and the length of each [m]."""

MEAN_SPEEDS = (5.0, 6.0, 7.0, 8.0)
"""Mean speeds of the voyages [m/s]."""

LEAST_PERCENT = 2.0
"""Smallest saving that makes a task worthwhile [%]: assumed uncertainty of a fuel flow meter."""

_SPEEDS = np.arange(3.0, 11.05, 0.1)
_FINE = 0.01  # step of the interpolated speeds [m/s]
_PITCHES = 61


class Segment(NamedTuple):
    """Steady states of a ship in one sea, at the pitch of least fuel."""

    speed: NDArray[np.float64]  # [m/s], rising, shape (m,)
    fuel: NDArray[np.float64]  # fuel flow of all engines [kg/s], shape (m,)

    @property
    def fuel_per_m(self) -> NDArray[np.float64]:
        """Fuel per distance [kg/m], shape (m,)."""
        return self.fuel / self.speed


def steady_segment(ship: Ship, sea: str, speeds: NDArray[np.float64] = _SPEEDS) -> Segment:
    """Return the least fuel flow at each speed that engine and propeller reach in head seas."""
    plant, fit, preset = ship.record(), fit_open_water(ship), get_sea(sea)
    head_sea = preset.hs_m**2 if preset else 0.0
    low, high = ship.shaft_speeds
    pitches = np.linspace(plant["pitch_ratio_min"], plant["pitch_ratio_max"], _PITCHES)
    pitches = pitches[pitches > 0.0]
    push = float(plant["propellers"] * (1.0 - plant["thrust_deduction"]))
    reached, fuel = [], []
    for speed in speeds:
        force = resistance(plant, speed, 1.0) + wave_resistance(plant, head_sea, speed)
        inflow, needed = wake_inflow(plant, speed), force / push
        least = np.inf
        for pitch in pitches:

            def lacking(
                shaft_speed: float,
                inflow: float = inflow,
                needed: float = needed,
                pitch: float = pitch,
            ) -> float:
                point = working_point(plant, fit.thrust, fit.torque, inflow, shaft_speed, pitch)
                return point.thrust - needed

            if not lacking(low) < 0.0 < lacking(high):
                continue
            shaft_speed = scipy.optimize.brentq(lacking, low, high, xtol=1e-9)
            point = working_point(plant, fit.thrust, fit.torque, inflow, shaft_speed, pitch)
            if slack(point) >= 0.0:
                least = min(least, point.cost)
        if least < np.inf:
            reached.append(float(speed))
            fuel.append(float(plant["propellers"]) * least)
    fine = np.arange(reached[0], reached[-1] + 1e-9, _FINE)
    return Segment(fine, scipy.interpolate.CubicSpline(reached, fuel)(fine))


class Plan(NamedTuple):
    """Result of one way to distribute the speed over the segments."""

    fuel_kg: float
    time_s: float
    speeds: NDArray[np.float64]  # by segment [m/s]


def _plan(segments: Sequence[Segment], speeds: Iterable[float]) -> Plan:
    """Return fuel and time of segments at given speeds, each limited to what the ship reaches."""
    pairs = [
        (segment, float(np.clip(v, segment.speed[0], segment.speed[-1])))
        for segment, v in zip(segments, speeds, strict=True)
    ]
    fuel = sum(SEGMENT_M * np.interp(v, segment.speed, segment.fuel_per_m) for segment, v in pairs)
    limited = np.array([v for _, v in pairs])
    return Plan(float(fuel), float((SEGMENT_M / limited).sum()), limited)


def least_fuel(segments: Sequence[Segment], time_s: float) -> Plan:
    """Return the speeds of least fuel by segment that arrive in time; all weather is known.

    The Lagrange multiplier of the time is the value of a second in kg of fuel.
    """

    def at(value: float) -> Plan:
        return _plan(
            segments,
            [s.speed[np.argmin(s.fuel_per_m + value / s.speed)] for s in segments],
        )

    return at(_solve(lambda value: at(value).time_s - time_s, 0.0, 100.0))


def constant_speed(segments: Sequence[Segment], time_s: float) -> Plan:
    """Return the constant speed order that arrives in time."""

    def at(order: float) -> Plan:
        return _plan(segments, [order] * len(segments))

    return at(_solve(lambda order: at(order).time_s - time_s, 3.0, 11.0))


def constant_fuel(segments: Sequence[Segment], time_s: float) -> Plan:
    """Return the constant fuel flow that arrives in time, as with a lever left alone."""

    def at(flow: float) -> Plan:
        return _plan(segments, [float(np.interp(flow, s.fuel, s.speed)) for s in segments])

    most = max(segment.fuel[-1] for segment in segments)
    return at(_solve(lambda flow: at(flow).time_s - time_s, 0.0, most))


def _solve(function: Callable[[float], float], low: float, high: float) -> float:
    return float(scipy.optimize.brentq(function, low, high, xtol=1e-10))


PLANS = {"constant speed": constant_speed, "constant fuel flow": constant_fuel}
"""Plans that need no forecast, by name."""


def compare(segments: Mapping[str, Segment], count: int, seed: int) -> pd.DataFrame:
    """Return a row for each drawn voyage: least fuel, its speeds, and what the other plans add [%].

    Args:
        segments: steady states by sea.
        count: voyages for each mean speed; those that the ship cannot finish in time are left out.
        seed: of the draw.
    """
    generator = np.random.default_rng(seed)
    rows = []
    for mean in MEAN_SPEEDS:
        time = SEGMENTS * SEGMENT_M / mean
        for voyage in range(count):
            weather = [segments[sea] for sea in generator.choice(list(segments), SEGMENTS)]
            if sum(SEGMENT_M / segment.speed[-1] for segment in weather) > time:
                continue
            best = least_fuel(weather, time)
            extra = {
                name: 100.0 * (plan(weather, best.time_s).fuel_kg / best.fuel_kg - 1.0)
                for name, plan in PLANS.items()
            }
            rows.append(
                {
                    "mean speed [m/s]": mean,
                    "voyage": voyage,
                    "least fuel [kg]": best.fuel_kg,
                    "fastest [m/s]": best.speeds.max(),
                    "slowest [m/s]": best.speeds.min(),
                    **extra,
                }
            )
    return pd.DataFrame(rows)


def summarise(voyages: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each mean speed: mean and largest extra fuel of each plan, and the speeds."""
    rows = []
    for mean, some in voyages.groupby("mean speed [m/s]"):
        row = {"mean speed [m/s]": mean, "voyages": len(some)}
        for name in PLANS:
            row[f"{name}: extra fuel, mean [%]"] = some[name].mean()
            row[f"{name}: largest [%]"] = some[name].max()
        row["speeds of least fuel, mean of the slowest and fastest segment [m/s]"] = (
            f"{some['slowest [m/s]'].mean():.2f} to {some['fastest [m/s]'].mean():.2f}"
        )
        rows.append(row)
    return pd.DataFrame(rows)


def kinetic_percent(ship: Ship, voyages: pd.DataFrame, heat_MJ_kg: float = 42.7) -> float:
    """Return the kinetic energy between slowest and fastest segment over the energy of the fuel [%]."""
    squares = voyages["fastest [m/s]"] ** 2 - voyages["slowest [m/s]"] ** 2
    energy = 0.5e-6 * float(ship.record()["mass"]) * squares
    return 100.0 * float((energy / (heat_MJ_kg * voyages["least fuel [kg]"])).max())


def main(arguments: list[str] | None = None) -> None:
    """Write the page."""
    parser = make_parser("voyages", __doc__, "out/voyages")
    parser.add_argument("--voyages", type=int, default=500, help="voyages for each mean speed")
    parser.add_argument("--seed", type=int, default=3401, help="seed of the voyages")
    options = parser.parse_args(arguments)
    ship = load_ship(SHIP)
    segments = {sea: steady_segment(ship, sea) for sea in SEAS}
    voyages = compare(segments, options.voyages, options.seed)
    curves = [
        Line(segment.speed, segment.fuel_per_m, sea, color)
        for (sea, segment), color in zip(segments.items(), PALETTE, strict=False)
    ]
    settings = {"ylabel": "fuel per distance [kg/m]", "xlabel": "ship speed [m/s]"}
    write_results(
        __file__,
        options.out,
        TITLE,
        voyages,
        {"": draw([Panel(curves, settings, 2)], (6.4, 3.6))},
        f"--voyages {options.voyages} --seed {options.seed}",
        table=summarise(voyages),
        worst=voyages["constant speed"].max(),
        least=LEAST_PERCENT,
        segments=SEGMENTS,
        segment_km=SEGMENT_M / 1e3,
        kinetic=kinetic_percent(ship, voyages),
        ship=SHIP,
    )


if __name__ == "__main__":
    main()
