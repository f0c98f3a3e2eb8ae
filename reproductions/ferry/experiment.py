"""Simulate the CPP optimiser paper's experiment: five levers, a disturbance, combinator and optimiser.

The paper's section 5. A ship runs at five lever positions; then it meets more resistance, or floats
deeper; the combinator keeps pitch and shaft speed, the optimiser chooses them anew. Both are compared
at the same ship speed, which the paper calls thrust correction. The first part computes steady states,
the second simulates one lever in closed loop.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.baselines.combinator import Combinator, Curve, combinator_curve, curve_through
from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface, look_up
from shaftline.baselines.controller import measurements_of
from shaftline.baselines.cpp_optimiser import CppOptimiser
from shaftline.baselines.steady_points import SteadyPoint, steady_point
from shaftline.baselines.working_point import OpenWaterFit, fit_open_water, working_point
from shaftline.envs import CLASSIC
from shaftline.envs.frigate import FrigateEnv
from shaftline.envs.tasks import get_task
from shaftline.plant import Ship
from shaftline.plant.fuel import specific_consumption
from shaftline.plant.hull import resistance, wake_inflow

from ..side_by_side import published

PAPERS = "cpp_ferry_tables"
"""The paper's Tables 1 to 3, in ``reproductions/data``."""

TOP_SPEED_M_S = 13.0 * 1852.0 / 3600.0
"""The paper's ferry: 13 kn."""

WHOLE_ENVELOPE = 1.0
"""Share of the torque limit that the paper's constraint N <= N_max(n) allows."""

COMBINATOR, HELD, CORRECTED = "combinator", "optimal", "optimal-thrust-corrected"
"""The paper's Tables 1 to 3: combinator; optimiser that holds its thrust; optimiser at equal speed."""

_AT_LIMIT = 5e-3  # as a share; nearer to it, a constraint counts as active


@functools.cache
def resistance_rises() -> tuple[float, ...]:
    """Return the resistance after the paper's disturbance over that before it, by lever [-].

    The paper does not print the rise of the total resistance: its text says that the *wave* resistance
    rises by up to 15 %. Its Table 2 holds the thrust, so a resistance that follows the square of the
    speed rises by (speed before / speed after)^2: 1.100 to 1.123, less than 1.15 as it must be.
    """
    held = published(PAPERS).loc[HELD]
    share = held["ship_speed_m_s_before"] / held["ship_speed_m_s_after"]
    return tuple(float(value) ** 2 for value in share)


class Condition(NamedTuple):
    """A disturbance."""

    raised: bool  # resistance by :func:`resistance_rises`
    displacement: float  # over the design displacement [-]

    def factor(self, lever: int) -> float:
        """Return the factor on the resistance d_c1 [-] at a lever, counted from 1."""
        return resistance_rises()[lever - 1] if self.raised else 1.0


FERRIES = ("ferry", "ferry-printed")
"""Ships that stand for the paper's own."""

CALM, RAISED = "calm", "resistance +10 to 12 %"

CONDITIONS = {
    CALM: Condition(False, 1.0),
    RAISED: Condition(True, 1.0),
    "displacement +40 %": Condition(False, 1.4),
    "both": Condition(True, 1.4),
}
"""The paper's two disturbances, alone and together."""


def lever_speeds(ship: Ship) -> list[float]:
    """Return the ship speeds [m/s] of the five levers: the paper's, or in proportion on other ships."""
    printed = published(PAPERS).loc[COMBINATOR, "ship_speed_m_s_before"].to_numpy()
    if ship.name in FERRIES:
        return [float(v) for v in printed]
    top = combinator_curve(ship).ship_speed[-1]
    return [float(v) for v in printed / TOP_SPEED_M_S * top]


def load_ship_deeper(ship: Ship, displacement: float) -> Ship:
    """Return the ship at a multiple of its displacement.

    The mass grows in proportion, the resistance at equal speed by the power 2/3 (Admiralty formula).
    Wake, thrust deduction and the propeller's depth are left as they are.
    """
    hull = ship.hull
    return ship.with_values(
        {
            "hull.mass_kg": displacement * hull.mass_kg,
            "hull.resistance_coefficient_N_s2_m2": displacement ** (2.0 / 3.0)
            * hull.resistance_coefficient_N_s2_m2,
        }
    )


def speed_at_held_thrust(ship: Ship, ship_speed: float, more: float) -> float:
    """Return the ship speed [m/s] at which a held thrust meets ``more`` times the resistance [-]."""
    return float(ship_speed * more ** (-1.0 / ship.hull.resistance_exponent))


def state_under_governor(
    ship: Ship, shaft_speed: float, pitch_ratio: float, factor: float
) -> SteadyPoint:
    """Return the state under a governor: at the set speed [rad/s], or slower at the torque limit."""
    point = steady_point(ship, shaft_speed, pitch_ratio, factor)
    if point.torque_share <= 1.0:
        return point

    def excess(speed: float) -> float:
        return steady_point(ship, speed, pitch_ratio, factor).torque_share - 1.0

    slower = float(scipy.optimize.brentq(excess, ship.shaft_speeds[0], shaft_speed, xtol=1e-10))
    return steady_point(ship, slower, pitch_ratio, factor)


def state_at_speed(ship: Ship, pitch_ratio: float, ship_speed: float, factor: float) -> SteadyPoint:
    """Return the steady state at a pitch [-] whose shaft speed gives a ship speed [m/s]."""
    top = ship.shaft_speeds[1]

    def missing(shaft_speed: float) -> float:
        return steady_point(ship, shaft_speed, pitch_ratio, factor).ship_speed - ship_speed

    found = float(scipy.optimize.brentq(missing, 0.2 * top, 1.5 * top, xtol=1e-12))
    return steady_point(ship, found, pitch_ratio, factor)


def optimal_state(
    ship: Ship, surface: CombinatorSurface, ship_speed: float, factor: float
) -> SteadyPoint | None:
    """Return the optimiser's state after its thrust controller has reached a ship speed [m/s].

    Args:
        ship: at its present displacement.
        surface: combinator surface of the ship as designed: the optimiser knows of no disturbance.
        ship_speed: [m/s].
        factor: resistance factor d_c1 [-].
    """
    plant = ship.record()
    push = float(plant["propellers"] * (1.0 - plant["thrust_deduction"]))
    thrust = resistance(plant, ship_speed, factor) / push
    setting = look_up(surface, np.array([thrust]), np.array([wake_inflow(plant, ship_speed)]))
    if setting.thrust[0] < thrust or setting.reach[0] < 1.0:
        return None
    return state_at_speed(ship, float(setting.pitch_ratio[0]), ship_speed, factor)


def combinator_curves(ship: Ship, surface: CombinatorSurface) -> dict[str, Curve]:
    """Return the combinators that the optimiser is compared with.

    ``standard`` is the package's own; ``design`` runs through the optimum of each lever in calm water,
    so that both controls start alike, as the paper's do; ``printed`` (ferries) has the paper's engine
    speeds, and the pitches at which our ferry then reaches the paper's ship speeds.
    """
    speeds = lever_speeds(ship)
    numbers = list(range(1, len(speeds) + 1))
    best = [optimal_state(ship, surface, v, 1.0) for v in speeds]
    found = {"standard": combinator_curve(ship)}
    found["design"] = curve_through(
        ship, numbers, [p.pitch_ratio for p in best if p], [p.shaft_speed for p in best if p]
    )
    if ship.name in FERRIES:
        engine = published(PAPERS).loc[COMBINATOR, "engine_speed_rpm_before"]
        shaft = engine.to_numpy() * math.pi / 30.0 / ship.transmission.gear_ratio
        pitches = [pitch_for(ship, float(n), v, 1.0) for n, v in zip(shaft, speeds, strict=True)]
        found["printed"] = curve_through(ship, numbers, pitches, shaft)
    return found


def pitch_for(ship: Ship, shaft_speed: float, ship_speed: float, factor: float) -> float:
    """Return the P/D [-] at which the ship runs at a speed [m/s] with a shaft speed [rad/s]."""
    screw = ship.propeller

    def missing(pitch: float) -> float:
        return steady_point(ship, shaft_speed, pitch, factor).ship_speed - ship_speed

    return float(
        scipy.optimize.brentq(missing, screw.pitch_ratio_min, screw.pitch_ratio_max, xtol=1e-9)
    )


def blade_angle(pitch_ratio: float) -> float:
    """Return the pitch angle [deg] of the blade section at 0.7 R for a P/D [-]."""
    return math.degrees(math.atan(pitch_ratio / (0.7 * math.pi)))


def in_units_of_paper(ship: Ship, point: SteadyPoint) -> dict[str, float]:
    """Return a steady state in the units of the paper."""
    engine = ship.transmission.gear_ratio * point.shaft_speed  # rad/s
    power = ship.hull.propellers * point.brake_torque * engine  # W
    return {
        "engine_speed_rpm": engine * 30.0 / math.pi,
        "pitch_ratio": point.pitch_ratio,
        "pitch_deg": blade_angle(point.pitch_ratio),
        "ship_speed_m_s": point.ship_speed,
        "brake_power_kW": 1e-3 * power,
        "sfoc_g_kwh": 3.6e9 * point.fuel_flow / power,
    }


def describe_state(
    ship: Ship, fit: OpenWaterFit, point: SteadyPoint, allowed: float
) -> dict[str, float | str]:
    """Return a steady state in the paper's units, fuel per mile, and the active constraints.

    Args:
        ship: a ship with a diesel.
        fit: of its propeller.
        point: the steady state.
        allowed: share of the torque limit that the control may use [-].
    """
    plant = ship.record()
    engine = float(plant["gear_ratio"]) * point.shaft_speed  # rad/s
    slope = working_point(
        plant, fit.thrust, fit.torque, point.advance_velocity, point.shaft_speed, point.pitch_ratio
    ).efficiency_slope
    active = {
        "torque": point.torque_share > allowed - _AT_LIMIT,
        "engine speed": engine > (1.0 - _AT_LIMIT) * float(plant["engine_speed_max"]),
        "pitch": point.pitch_ratio > float(plant["pitch_ratio_max"]) - _AT_LIMIT,
        "gradient": slope < _AT_LIMIT,
        "cavitation": point.burrill > 1.0 - _AT_LIMIT,
    }
    return {
        **in_units_of_paper(ship, point),
        "fuel_kg_nmi": 1852.0 * point.fuel_flow / point.ship_speed,
        "torque_share": point.torque_share,
        "burrill": point.burrill,
        "active": ", ".join(name for name, is_active in active.items() if is_active),
    }


def compare_controls(ship: Ship, allowed: float = WHOLE_ENVELOPE) -> pd.DataFrame:
    """Return the experiment on one ship: a row for each curve, condition, lever and control.

    Args:
        ship: a ship with a diesel and a propeller of controllable pitch.
        allowed: share of the torque limit that the optimiser may use [-]; the combinator's governor
            always has all of it.
    """
    surface, fit = combinator_surface(ship, allowed), fit_open_water(ship)
    rows = []
    for name, curve in combinator_curves(ship, surface).items():
        for condition, met in CONDITIONS.items():
            afloat = load_ship_deeper(ship, met.displacement)
            for lever, speed in enumerate(lever_speeds(ship), 1):
                factor = met.factor(lever)
                more = factor * met.displacement ** (2.0 / 3.0)
                shaft = float(np.interp(speed, curve.ship_speed, curve.shaft_speed))
                pitch = float(np.interp(speed, curve.ship_speed, curve.pitch_ratio))
                plain = state_under_governor(afloat, shaft, pitch, factor)
                points = {
                    COMBINATOR: plain,
                    HELD: optimal_state(
                        afloat, surface, speed_at_held_thrust(ship, speed, more), factor
                    ),
                    CORRECTED: optimal_state(afloat, surface, plain.ship_speed, factor),
                }
                for control, point in points.items():
                    if point is None:
                        continue
                    row = {"ship": ship.name, "curve": name, "condition": condition,
                           "lever": lever, "control": control}  # fmt: skip
                    row |= describe_state(afloat, fit, point, allowed)
                    fuel = 1.0 - point.fuel_flow / plain.fuel_flow
                    row["saving_percent"] = 100.0 * fuel if control == CORRECTED else math.nan
                    rows.append(row)
    return pd.DataFrame(rows)


LEVER, SECONDS, STEP_AT = 3, 600.0, 300.0
MEANS_OVER = 100.0  # last seconds


def simulate_voyage(
    ship: Ship,
    controller: Any,
    speed: float,
    corrected: float,
    *,
    sea: str = "calm",
    rise: float | None = None,
    observer: str = "oracle",
    noise: float | Mapping[str, float] = 0.0,
) -> pd.DataFrame:
    """Simulate a ship in closed loop, with a step of the resistance.

    Args:
        ship: a ship with a diesel.
        controller: with ``predict``.
        speed: set-point of the ship speed [m/s].
        corrected: set-point [m/s] from the step on.
        sea: name of the head seas; calm water by default.
        rise: resistance factor from the step on [-]; that of the middle lever by default.
        observer: of the advance velocity; the truth by default.
        noise: of the instruments, as ``sensor_noise`` of the environment; none by default.

    Returns:
        One row per 0.5 s: time [s], ship speed [m/s], engine speed [rpm], P/D, SFOC [g/kWh], fuel
        flow [kg/s], thrust [N].
    """
    still = {"resistance_rise": (0.0, 0.0), "resistance_swing": 0.0, "seas": (sea,)}
    task = get_task("transit").model_dump() | still
    factor = resistance_rises()[LEVER - 1] if rise is None else rise
    # only the sea knows of the step
    heavier = ship.with_values(
        {"hull.episode_resistance_fraction": factor - 1.0, "hull.episode_start_s": STEP_AT}
    )
    env = FrigateEnv(
        ship=heavier,
        task=task,
        observer=observer,
        sensor_noise=noise,
        max_episode_steps=None,
        **CLASSIC,
    )
    plant = ship.record()
    orders = {"speed_order_m_s": (speed, corrected), "order_interval_s": STEP_AT}
    observation, _ = env.reset(seed=0, options=orders)
    remembered, rows = None, []
    for k in range(round(SECONDS / env.batch.interval_s)):
        time = 0.5 * k
        action, remembered = controller.predict(observation, remembered, np.array([k == 0]))
        observation, _, _, _, info = env.step(action)
        engine = float(plant["gear_ratio"]) * info["shaft_speed"]
        sfoc = specific_consumption(plant, engine, info["brake_torque"])
        pitch = float(measurements_of(observation).pitch_ratio[0])
        rpm = engine * 30.0 / math.pi
        rows.append(
            (time + 0.5, info["ship_speed"], rpm, pitch, sfoc, info["fuel_flow"], info["thrust"])
        )
    names = [
        "time_s",
        "ship_speed_m_s",
        "engine_speed_rpm",
        "pitch_ratio",
        "sfoc_g_kwh",
        "fuel_kg_s",
        "thrust_N",
    ]
    return pd.DataFrame(rows, columns=names)


def simulate_voyages(
    ship: Ship, tick: Callable[[], None] = lambda: None
) -> dict[str, pd.DataFrame]:
    """Simulate the three controls of the paper at the middle lever, all from the design curve."""
    curve = combinator_curves(ship, combinator_surface(ship))["design"]
    speed = lever_speeds(ship)[LEVER - 1]
    found = {COMBINATOR: simulate_voyage(ship, Combinator(ship, curve=curve), speed, speed)}
    tick()
    reached = float(found[COMBINATOR]["ship_speed_m_s"].iloc[-1])
    held = speed_at_held_thrust(ship, speed, resistance_rises()[LEVER - 1])
    for control, order in ((HELD, speed), (CORRECTED, reached * speed / held)):
        found[control] = simulate_voyage(ship, CppOptimiser(ship), speed, order)
        tick()
    return found


def settled_means(found: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return means over the last :data:`MEANS_OVER` seconds, with fuel per nautical mile."""
    means = {name: log[log["time_s"] > SECONDS - MEANS_OVER].mean() for name, log in found.items()}
    frame = pd.DataFrame(means).T.drop(columns=["time_s", "thrust_N"])
    frame["fuel_kg_nmi"] = 1852.0 * frame.pop("fuel_kg_s") / frame["ship_speed_m_s"]
    return frame.rename_axis("control").reset_index()
