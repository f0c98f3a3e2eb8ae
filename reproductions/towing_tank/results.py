"""What the rig's tests come to: calibration, Table 1, and what its ratios hang on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.baselines.thrust_control import ThrustControl
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load
from shaftline.plant.ventilation import suction_head, ventilation_rate

from .experiment import Air, Instruments, Programme, TankRun, sail

RIG = "towing-tank"
PRINTED = {"anti-spin": (79.2, 290.0, 0.151), "no anti-spin": (89.1, 378.0, 0.123)}
"""Table 1: mean thrust [N], mean power [W], eta_E [-]."""
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
NEAR = 0.5
"""h/R up to which the propeller is called near the surface."""
CALM = Programme(mean_submergence=3.2, motion=0.0)

AIRS = {
    "as above": Air(),
    "thrust loss 0.95, torque loss 0.91": Air(thrust_loss=0.95, torque_loss=0.91),
    "thrust loss 0.6, torque loss 0.52": Air(thrust_loss=0.6, torque_loss=0.52),
    "suction gain 0.35": Air(suction_gain=0.35),
    "suction gain 0.7": Air(suction_gain=0.7),
    "onset 0.3": Air(onset_submergence=0.3),
    "no loss of disc area": Air(surface_loss=0.0),
    "times of a propeller of 4.2 m": Air(growth_s=0.5, washout_s=1.5),
}
LIMITS_RAD_S = (25.0, 30.0, 38.0, 45.0, 52.0, 60.0, 75.0)

SPEEDS_RAD_S = (20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0)
SUBMERGENCES = (0.25, 0.5, 0.8, 1.0, 1.5)
"""h/R at which the steady thrust is shown over the shaft speed."""


class Numbers(NamedTuple):
    """A test in numbers."""

    thrust: float  # mean of |T| [N]
    power: float  # mean [W]
    efficiency: float  # eta_E, eq. 27 [-]
    thrust_near: float  # mean of |T| near the surface [N]
    highest_speed: float  # [rad/s]
    highest_power: float  # [W]
    tracking: float  # rms of T - T_pd [N]


def numbers_of(test: TankRun, programme: Programme) -> Numbers:
    """Means over the whole test; thrust counts in the direction of its order."""
    thrust = test.samples["thrust"] * np.sign(test.thrust_order)
    power = float(test.motor_power.mean())
    near = programme.submergence(test.times) < NEAR
    useful = float(np.mean(test.samples["thrust"] * test.samples["advance_velocity"]))
    return Numbers(
        float(thrust.mean()),
        power,
        useful / power,
        float(thrust[near].mean()) if near.any() else float("nan"),
        float(np.abs(test.samples["shaft_speed"]).max()),
        float(test.motor_power.max()),
        float(np.sqrt(np.mean((test.samples["thrust"] - test.thrust_order) ** 2))),
    )


def calibrated(air: Air) -> tuple[Programme, float]:
    """Order of thrust, carriage's speed and Coulomb friction that give the anti-spin test's levels.

    Thrust, power and eta_E of Table 1's first row alone: three numbers for three. The other test is not
    looked at.
    """
    begin = np.array([120.0, 0.58, 0.1])

    def off(scales: Any) -> Any:
        thrust, carriage, friction = begin * scales
        programme = Programme(thrust_N=thrust, carriage_m_s=carriage)
        ship = air.ship(load_ship(RIG).with_values({FRICTION: max(friction, 0.0)}))
        found = numbers_of(sail(ship, ThrustControl(ship), programme), programme)
        return np.array(found[:3]) / PRINTED["anti-spin"] - 1.0

    best = scipy.optimize.least_squares(
        off, np.ones(3), diff_step=[0.01, 0.01, 0.01], x_scale=[0.1, 0.1, 1.0], max_nfev=15,
        bounds=([0.5, 0.5, 0.0], [2.0, 2.0, 9.0]),
    )  # fmt: skip
    thrust, carriage, friction = begin * best.x
    return Programme(thrust_N=float(thrust), carriage_m_s=float(carriage)), float(friction)


class Pair(NamedTuple):
    """The same test with and without anti-spin."""

    on: Numbers
    off: Numbers

    @property
    def ratios(self) -> tuple[float, float, float]:
        """Thrust, power and eta_E with over without anti-spin [-]."""
        thrust, power, efficiency = (a / b for a, b in zip(self.on[:3], self.off[:3], strict=True))
        return thrust, power, efficiency

    @property
    def carriage(self) -> float:
        """Carriage speed weighted by thrust, eta_E P / T, with over without [-]."""
        on, off = (n.efficiency * n.power / n.thrust for n in self)
        return on / off

    @property
    def near(self) -> float:
        """Thrust near the surface, with over without [-]."""
        return self.on.thrust_near / self.off.thrust_near


def pair(
    ship: Ship,
    programme: Programme,
    *,
    believed: Ship | None = None,
    instruments: Instruments | None = None,
    **tuning: Any,
) -> Pair:
    """Both tests of one rig.

    Args:
        ship: the rig as it is.
        programme: what is done to it.
        believed: the rig as the controller believes it to be; as it is by default.
        instruments: what is wrong with them; nothing by default.
        tuning: numbers of the controller by name.
    """
    believed = ship if believed is None else believed
    on, off = (
        numbers_of(
            sail(ship, ThrustControl(believed, anti_spin=switch, **tuning), programme, instruments),
            programme,
        )
        for switch in (True, False)
    )
    return Pair(on, off)


@dataclass(frozen=True)
class Results:
    """All that the page shows."""

    calm: TankRun
    on: TankRun
    off: TankRun
    programme: Programme
    calm_numbers: Numbers
    pair: Pair
    oracle: Numbers
    detection: tuple[float, float]
    """Shares of the time in air that is called air, and of the time called air that is."""
    steady: pd.DataFrame
    limits: pd.DataFrame
    airs: pd.DataFrame
    others: pd.DataFrame


def over_shaft_speed(ship: Ship) -> pd.DataFrame:
    """Return the steady thrust [N] at bollard pull, a row a shaft speed, a column an h/R.

    Each shaft speed is reached from the one below, with the air that came there.
    """
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_max
    found: dict[str, Any] = {"shaft speed [rad/s]": SPEEDS_RAD_S}
    for relative in SUBMERGENCES:
        depth, degree, column = 0.5 * relative * ship.propeller.diameter_m, 0.0, []
        for speed in SPEEDS_RAD_S:
            wetted = propeller_load(plant, 0.0, speed, pitch, depth, 0.0)
            suction = suction_head(plant, wetted.thrust_coefficient, speed)
            for _ in range(2000):  # 20 s
                degree += 0.01 * ventilation_rate(plant, degree, relative, suction)
            column.append(propeller_load(plant, 0.0, speed, pitch, depth, degree).thrust)
        found[f"h/R {relative:g}"] = column
    return pd.DataFrame(found)


def _row(name: str, found: Pair) -> dict[str, Any]:
    thrust, power, efficiency = found.ratios
    return {
        "what": name, "thrust": thrust, "power": power, "eta_E": efficiency,
        "thrust near the surface": found.near, "carriage by thrust": found.carriage,
    }  # fmt: skip


def _changes(ship: Ship, programme: Programme) -> dict[str, Callable[[], Pair]]:
    """Everything that is tried without calibrating anew."""

    def moved(**changes: float) -> Callable[[], Pair]:
        return lambda: pair(ship, replace(programme, **changes))

    def believes(key: str, value: float) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, believed=ship.with_values({key: value}))

    def reads(**wrong: Any) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, instruments=Instruments(**wrong))

    return {
        "as above": moved(),
        "motion's period 4 s": moved(motion_period_s=4.0),
        "motion's period 8 s": moved(motion_period_s=8.0),
        "motion half a period later": moved(phase=np.pi),
        "motion 0.3 R deeper": moved(mean_submergence=1.55),
        "motion 0.3 R higher": moved(mean_submergence=0.95),
        "ahead and astern 15 s each": moved(half_s=15.0),
        "thrust order 20 % lower": moved(thrust_N=0.8 * programme.thrust_N),
        "carriage 1 m/s": moved(carriage_m_s=1.0),
        "KQ believed 3 % low": believes("propeller.relative_rotative_efficiency", 1.03),
        "KQ believed 3 % high": believes("propeller.relative_rotative_efficiency", 0.97),
        "viscous friction believed half": believes(
            "transmission.viscous_friction_engine_side_N_m_s_rad", 0.004
        ),
        "motor gives 2 % less than ordered": reads(torque_gain=0.98),
        "motor gives 2 % more": reads(torque_gain=1.02),
        "speed read with 0.05 rad/s of noise": reads(shaft_speed=0.05),
    }


TICKS = 3 + 1 + len(LIMITS_RAD_S) + len(AIRS) + 15


def measured(tick: Callable[[], None]) -> Results:
    """Every test of the page.

    Args:
        tick: called :data:`TICKS` times.
    """
    programme, air, rig = Programme(), Air(), load_ship(RIG)
    calm = sail(rig, ThrustControl(rig), CALM)
    tick()
    ship = air.ship(rig)
    on = sail(ship, ThrustControl(ship), programme)
    tick()
    off = sail(ship, ThrustControl(ship, anti_spin=False), programme)
    tick()
    oracle = sail(ship, ThrustControl(ship), programme, Instruments(tell_air=True))
    tick()
    limits = []
    for limit in LIMITS_RAD_S:
        astern = limit * 54.0 / 45.0
        found = pair(ship, programme, ventilated_ahead_rad_s=limit, ventilated_astern_rad_s=astern)
        limits.append({"ahead [rad/s]": limit, "astern [rad/s]": astern, **_row("", found)})
        tick()
    airs = []
    for name, other in AIRS.items():
        fitted, friction = calibrated(other)
        found = pair(other.ship(rig.with_values({FRICTION: friction})), fitted)
        airs.append(
            _row(name, found)
            | {"T_pd [N]": fitted.thrust_N, "carriage [m/s]": fitted.carriage_m_s,
               "k_f1 [N m]": friction, "T with [N]": found.on.thrust, "P with [W]": found.on.power,
               "T without [N]": found.off.thrust, "P without [W]": found.off.power}
        )  # fmt: skip
        tick()
    others = []
    for name, tried in _changes(ship, programme).items():
        others.append(_row(name, tried()))
        tick()
    air_is = on.samples["ventilation"] > 0.5
    both = float(np.sum(air_is & on.detected))
    return Results(
        calm, on, off, programme, numbers_of(calm, CALM),
        Pair(numbers_of(on, programme), numbers_of(off, programme)),
        numbers_of(oracle, programme),
        (both / float(air_is.sum()), both / float(on.detected.sum())),
        over_shaft_speed(ship), pd.DataFrame(limits).drop(columns="what"),
        pd.DataFrame(airs), pd.DataFrame(others),
    )  # fmt: skip
