"""Simulate the CPP optimiser paper's experiment: five levers, a disturbance, combinator and optimiser.

The paper's section 5. A ship runs at five lever positions; then it meets more resistance, or floats
deeper; the combinator keeps pitch and shaft speed, the optimiser chooses them anew. Both are compared
at the same ship speed, which the paper calls thrust correction. The first part computes steady states,
the second simulates one lever in closed loop.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

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

from ..side_by_side import Tick, published

PAPERS = "cpp_ferry_tables"  # the paper's Tables 1 to 3, in ``reproductions/data``
TOP_SPEED_M_S = 13.0 * 1852.0 / 3600.0  # of the paper's ferry: 13 kn
RISE = 1.15
"""Resistance after the disturbance over that before it: the paper's text has "up to 15 %"."""

LEVERS = 5

WHOLE_ENVELOPE = 1.0  # share of the torque limit that the constraint N <= N_max(n) allows
COMBINATOR, HELD, CORRECTED = "combinator", "optimal", "optimal-thrust-corrected"
"""The paper's Tables 1 to 3: combinator; optimiser that holds its thrust; optimiser at equal speed."""

_AT_LIMIT = 5e-3  # as a share; nearer to it, a constraint counts as active


FERRIES = ("ferry", "ferry-printed")  # ships that stand for the paper's own
CALM, RAISED = "calm", "resistance +15 %"

CONDITIONS = {
    CALM: (False, 1.0),
    RAISED: (True, 1.0),
    "displacement +40 %": (False, 1.4),
    "both": (True, 1.4),
}
"""The paper's two disturbances, alone and together: more resistance; displacement over the design's."""


def printed_levers(control: str) -> pd.DataFrame:
    """Return one of the paper's Tables 1 to 3 by lever."""
    return published(PAPERS).loc[control].set_index("condition")


def lever_speeds(ship: Ship) -> list[float]:
    """Return the ship speeds [m/s] of the five levers: the paper's, or in proportion on other ships."""
    speeds = published(PAPERS).loc[COMBINATOR, "ship_speed_m_s_before"].to_numpy()
    if ship.name not in FERRIES:
        speeds = speeds / TOP_SPEED_M_S * combinator_curve(ship).ship_speed[-1]
    return [float(v) for v in speeds]


def load_ship_deeper(ship: Ship, displacement: float) -> Ship:
    """Return the ship at a multiple of its displacement.

    The mass grows in proportion, the resistance at equal speed by the power 2/3 (Admiralty formula).
    Wake, thrust deduction and the propeller's depth are left as they are.
    """
    powers = {"hull.mass_kg": 1.0, "hull.resistance_coefficient_N_s2_m2": 2.0 / 3.0}
    values = {k: displacement**power * ship.parameter(k).value for k, power in powers.items()}
    return ship.with_values(values)


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

    ``surface`` is that of the ship as designed, ``factor`` the resistance factor d_c1 [-]: the optimiser
    knows of no disturbance.
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
    best = [point for v in speeds if (point := optimal_state(ship, surface, v, 1.0))]
    design = curve_through(
        ship, numbers, [p.pitch_ratio for p in best], [p.shaft_speed for p in best]
    )
    found = {"standard": combinator_curve(ship), "design": design}
    if ship.name in FERRIES:
        engine = published(PAPERS).loc[COMBINATOR, "engine_speed_rpm_before"]
        shaft = engine.to_numpy() * math.pi / 30.0 / ship.transmission.gear_ratio
        pitches = [pitch_for(ship, float(n), v, 1.0) for n, v in zip(shaft, speeds, strict=True)]
        found["printed"] = curve_through(ship, numbers, pitches, shaft)
    return found


def pitch_for(ship: Ship, shaft_speed: float, ship_speed: float, factor: float) -> float:
    """Return the P/D [-] at which the ship runs at a speed [m/s] with a shaft speed [rad/s]."""
    ends = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max

    def missing(pitch: float) -> float:
        return steady_point(ship, shaft_speed, pitch, factor).ship_speed - ship_speed

    return float(scipy.optimize.brentq(missing, *ends, xtol=1e-9))


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

    ``fit`` is that of the propeller, ``allowed`` the usable share of the torque limit [-].
    """
    plant = ship.record()
    engine = float(plant["gear_ratio"]) * point.shaft_speed  # rad/s
    at = point.advance_velocity, point.shaft_speed, point.pitch_ratio
    slope = working_point(plant, fit.thrust, fit.torque, *at).efficiency_slope
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

    ``allowed`` is the share of the torque limit that the optimiser may use [-]; the combinator's
    governor always has all of it.
    """
    surface, fit = combinator_surface(ship, allowed), fit_open_water(ship)
    rows = []
    for (name, curve), (condition, (raised, load)), (lever, speed) in itertools.product(
        combinator_curves(ship, surface).items(),
        CONDITIONS.items(),
        enumerate(lever_speeds(ship), 1),
    ):
        afloat = load_ship_deeper(ship, load)
        factor = RISE if raised else 1.0
        shaft = float(np.interp(speed, curve.ship_speed, curve.shaft_speed))
        pitch = float(np.interp(speed, curve.ship_speed, curve.pitch_ratio))
        plain = state_under_governor(afloat, shaft, pitch, factor)
        held = speed_at_held_thrust(ship, speed, factor * load ** (2.0 / 3.0))
        points = {
            COMBINATOR: plain,
            HELD: optimal_state(afloat, surface, held, factor),
            CORRECTED: optimal_state(afloat, surface, plain.ship_speed, factor),
        }
        for control, point in points.items():
            if point is not None:
                saved = 100.0 * (1.0 - point.fuel_flow / plain.fuel_flow)
                rows.append(
                    {
                        "ship": ship.name,
                        "curve": name,
                        "condition": condition,
                        "lever": lever,
                        "control": control,
                        **describe_state(afloat, fit, point, allowed),
                        "saving_percent": saved if control == CORRECTED else math.nan,
                    }
                )
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
    """Simulate a ship in closed loop in head seas, with a step of the resistance.

    The set-point of the ship speed is ``speed``, from the step on ``corrected`` [m/s]. ``rise`` is the
    resistance factor from then on [-]; ``observer`` that of the advance
    velocity, ``noise`` the ``sensor_noise`` of the environment.

    Returns:
        One row per 0.5 s: time [s], ship speed [m/s], engine speed [rpm], P/D, SFOC [g/kWh], fuel
        flow [kg/s], thrust [N].
    """
    still = {"resistance_rise": (0.0, 0.0), "resistance_swing": 0.0, "seas": (sea,)}
    task = get_task("transit").model_dump() | still
    factor = RISE if rise is None else rise
    # only the sea knows of the step
    step = {"hull.episode_resistance_fraction": factor - 1.0, "hull.episode_start_s": STEP_AT}
    env = FrigateEnv(
        ship=ship.with_values(step),
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
        action, remembered = controller.predict(observation, remembered, np.array([k == 0]))
        observation, _, _, _, info = env.step(action)
        engine = float(plant["gear_ratio"]) * info["shaft_speed"]
        rows.append(
            {
                "time_s": 0.5 * k + 0.5,
                "ship_speed_m_s": info["ship_speed"],
                "engine_speed_rpm": engine * 30.0 / math.pi,
                "pitch_ratio": float(measurements_of(observation).pitch_ratio[0]),
                "sfoc_g_kwh": specific_consumption(plant, engine, info["brake_torque"]),
                "fuel_kg_s": info["fuel_flow"],
                "thrust_N": info["thrust"],
            }
        )
    return pd.DataFrame(rows)


def simulate_voyages(ship: Ship, tick: Tick = lambda: None) -> dict[str, pd.DataFrame]:
    """Simulate the three controls of the paper at the middle lever, all from the design curve."""
    curve = combinator_curves(ship, combinator_surface(ship))["design"]
    speed = lever_speeds(ship)[LEVER - 1]
    found = {COMBINATOR: simulate_voyage(ship, Combinator(ship, curve=curve), speed, speed)}
    tick()
    reached = float(found[COMBINATOR]["ship_speed_m_s"].iloc[-1])
    held = speed_at_held_thrust(ship, speed, RISE)
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
