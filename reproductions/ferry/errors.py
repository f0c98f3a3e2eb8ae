"""What errors cost the CPP optimiser, and its pitch at the actual thrust (the paper, sections 4 to 6).

The paper's thrust and advance speed are estimates: from torque, by a KQ curve, with a relative rotative
efficiency that is not known. It names these errors and prints no numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.baselines.combinator_surface import combinator_surface, look_up
from shaftline.baselines.cpp_optimiser import FILTER_S, CppOptimiser
from shaftline.baselines.steady_points import SteadyPoint, steady_point
from shaftline.baselines.working_point import fit_open_water, surface
from shaftline.observers.torque_curve import velocity_from_torque
from shaftline.plant import Ship, load_ship
from shaftline.plant.hull import resistance
from shaftline.plant.open_water import REVOLUTIONS_PER_RADIAN
from shaftline.plant.shaft import drive_torque

from .lever_points import WHOLE_ENVELOPE, lever_speeds, optimal, rises
from .lever_voyage import STEP_AT, voyage

SHIPS = ("ferry-printed", "ferry")
ETA_R = "propeller.relative_rotative_efficiency"
NOISE, OBSERVER = 0.01, "immersion-invariance"
SEA = "hs=1.0,tp=5.0"


class Error(NamedTuple):
    """What the optimiser has wrong."""

    ship_eta_r: float = 1.0  # of the ship
    believed_eta_r: float = 1.0  # of the optimiser's ship; KQ goes with its inverse
    gain: float = 1.0  # torque read / torque
    bias: float = 0.0  # torque read at no torque / the engine's limit


ERRORS = {
    "none": Error(),
    "eta_R 0.97, believed 1": Error(ship_eta_r=0.97),
    "eta_R 1.03, believed 1": Error(ship_eta_r=1.03),
    "torque read 2 % high": Error(gain=1.02),
    "torque read 2 % low": Error(gain=0.98),
    "torque bias +1 % of the limit": Error(bias=0.01),
    "torque bias -1 % of the limit": Error(bias=-0.01),
    "KQ believed 3 % high": Error(believed_eta_r=1.0 / 1.03),
    "KQ believed 3 % low": Error(believed_eta_r=1.0 / 0.97),
}
TICKS = len(SHIPS) * (len(ERRORS) + 1 + 2)


class Settled(NamedTuple):
    """A steady state under an error."""

    point: SteadyPoint
    thrust: float  # estimated [N]
    advance_velocity: float  # estimated [m/s]


def settled(ship: Ship, error: Error, speed_order: float, factor: float) -> Settled:
    """Where the optimiser settles: its estimated thrust is the ordered one.

    Args:
        ship: without the error.
        error: what is wrong.
        speed_order: ordered ship speed [m/s].
        factor: resistance factor d_c1 [-].

    Raises:
        RuntimeError: no such state was found.
    """
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    believed = ship.with_values({ETA_R: error.believed_eta_r})
    table, fit = combinator_surface(believed, WHOLE_ENVELOPE), fit_open_water(believed)
    plant, model = actual.record(), believed.record()
    push = float(model["propellers"] * (1.0 - model["thrust_deduction"]))
    ordered = float(resistance(model, speed_order, 1.0)) / push
    whole = float(plant["torque_limit"] * plant["gear_ratio"])
    force = believed.water.density_kg_m3 * believed.propeller.diameter_m**4

    def seen(speed: float, pitch: float) -> Settled:
        point = steady_point(actual, speed, pitch, factor)
        torque = drive_torque(plant, point.brake_torque, speed)
        read = error.gain * torque + error.bias * whole
        velocity, _ = velocity_from_torque(model, read, speed, pitch, point.advance_velocity)
        n = speed * REVOLUTIONS_PER_RADIAN
        j = velocity / (n * believed.propeller.diameter_m)
        return Settled(point, float(surface(fit.thrust, j, pitch)) * force * n * n, velocity)

    start = optimal(
        ship, table, speed_order * factor ** (-1.0 / ship.hull.resistance_exponent), factor
    )
    if start is None:
        raise RuntimeError(f"{ship.name}: no setting for {speed_order:g} m/s")
    scale = np.array([start.shaft_speed, start.pitch_ratio])

    def off(x: NDArray[np.float64]) -> list[float]:
        state = seen(float(x[0] * scale[0]), float(x[1] * scale[1]))
        setting = look_up(table, np.array([ordered]), np.array([state.advance_velocity]))
        return [
            state.thrust / float(setting.thrust[0]) - 1.0,
            float(x[1] * scale[1] / setting.pitch_ratio[0]) - 1.0,
        ]

    found = scipy.optimize.root(off, np.ones(2), tol=1e-9)
    if not found.success:
        raise RuntimeError(f"{ship.name}, {error}: no steady state ({found.message})")
    return seen(*(float(v) for v in found.x * scale))


def error_row(ship: Ship, error: Error) -> dict[str, float]:
    """Errors of the estimates and the fuel lost, the middle lever, with the worst of levers 1 to 4."""
    actual = ship.with_values({ETA_R: error.ship_eta_r})
    known = combinator_surface(actual, WHOLE_ENVELOPE)
    rows = []
    for order, rise in list(zip(lever_speeds(ship), rises(), strict=True))[:4]:
        state = settled(ship, error, order, rise)
        point = state.point
        best = optimal(actual, known, point.ship_speed, rise)
        reference = settled(ship, Error(), order, rise).point.ship_speed
        assert best is not None
        rows.append(
            (
                100.0 * (state.thrust / point.thrust - 1.0),
                100.0 * (state.advance_velocity / point.advance_velocity - 1.0),
                100.0 * (point.ship_speed / reference - 1.0),
                100.0 * (point.fuel_flow / best.fuel_flow - 1.0),
            )
        )
    table = np.array(rows)
    return {
        "thrust estimate [%]": table[2, 0], "v_a estimate [%]": table[2, 1],
        "ship speed [%]": table[2, 2], "fuel lost [%]": table[2, 3],
        "most fuel lost, levers 1 to 4 [%]": float(table[:, 3].max()),
    }  # fmt: skip


def noise_row(ship: Ship) -> dict[str, float]:
    """The same for white noise of the torque, the middle lever sailed in closed loop."""
    order = lever_speeds(ship)[2]
    whole = float(ship.record()["torque_limit"] * ship.record()["gear_ratio"])
    means = []
    for noise in ({}, {"shaft_torque": NOISE * whole}):
        log = voyage(ship, CppOptimiser(ship), order, order, observer=OBSERVER, noise=noise)
        means.append(log[log["time_s"] > STEP_AT + 150.0].mean())
    clean, noisy = means
    speed = noisy["ship_speed_m_s"] / clean["ship_speed_m_s"]
    # fuel at equal speed: it goes about with the speed's power of the resistance and one more
    fuel = noisy["fuel_kg_s"] / clean["fuel_kg_s"] / speed ** (1.0 + ship.hull.resistance_exponent)
    return {
        "thrust estimate [%]": math.nan, "v_a estimate [%]": math.nan,
        "ship speed [%]": 100.0 * (speed - 1.0), "fuel lost [%]": 100.0 * (fuel - 1.0),
        "most fuel lost, levers 1 to 4 [%]": math.nan,
    }  # fmt: skip


def error_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Every error on every ferry."""
    rows = []
    for name in SHIPS:
        ship = load_ship(name)
        for what, error in ERRORS.items():
            rows.append({"ship": name, "wrong": what, **error_row(ship, error)})
            tick()
        noise = f"torque noise {100.0 * NOISE:g} % of the limit, {OBSERVER}"
        rows.append({"ship": name, "wrong": noise, **noise_row(ship)})
        tick()
    return pd.DataFrame(rows)


def pitch_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Pitch at the ordered and at the actual thrust: through an order's step, and in waves.

    Each with the filter of the estimates as it is, and with one that is eight times faster.
    """
    rows = []
    for name in SHIPS:
        ship = load_ship(name)
        slow, fast = (lever_speeds(ship)[i] for i in (0, 3))
        for at in ("ordered", "actual"):
            for filter_s in (FILTER_S, FILTER_S / 8.0):
                pilot = CppOptimiser(ship, pitch_at=at, filter_s=filter_s)
                step = voyage(ship, pilot, slow, fast, rise=1.0)
                after = step[step["time_s"] > STEP_AT]
                end = after["ship_speed_m_s"].iloc[-1]
                gone = np.abs(after["ship_speed_m_s"] - end) > 0.02 * (fast - slow)
                waves = voyage(ship, pilot, fast, fast, sea=SEA, rise=1.0)
                swing = [
                    float(waves["pitch_ratio"][waves["time_s"].between(*span)].std())
                    for span in ((100.0, 350.0), (350.0, 600.0))
                ]
                kept = waves[waves["time_s"] > 100.0]
                rows.append(
                    {
                        "ship": name, "pitch at": at, "filter [s]": filter_s,
                        "step: settled after [s]": float(after["time_s"][gone].max() - STEP_AT),
                        "step: pitch overshoot [-]": _beyond(after["pitch_ratio"].to_numpy()),
                        "waves: swing of P/D, first half": swing[0],
                        "second half": swing[1],
                        "swing of thrust [%]": 100.0
                        * float(kept["thrust_N"].std() / kept["thrust_N"].mean()),
                        "fuel [kg/nmi]": 1852.0
                        * float(kept["fuel_kg_s"].mean() / kept["ship_speed_m_s"].mean()),
                    }
                )  # fmt: skip
            tick()
    return pd.DataFrame(rows)


def _beyond(values: NDArray[np.float64]) -> float:
    """How far values go beyond the range between their first and their last."""
    low, high = sorted((float(values[0]), float(values[-1])))
    return max(float(values.max()) - high, low - float(values.min()), 0.0)
