"""The balances of a plant that measured signals can check in isolation.

Each residual is what its balance lacks: the torque, force or pitch that must be added to the nominal
model's so that the measured signals of its neighbours and its own agree. A fault in one balance does not
smear over the others, as it does in the channels of an open-loop simulation.

    engine      I_L dw/dt + M_m - M_drive(X, w)            [N m]
    propeller   I_R dw/dt + M_p(w, P/D, v_a) + M_f - M_m   [N m]
    load        the same on a shaft without a propeller    [N m]
    hull        m dv/dt - k_p (1 - t) T + R(v)             [N]
    sway, yaw   of a ship that turns, see below            [N, N m]
    pitch       P/D - its answer to the command            [-]
    thrust      T - T(w, P/D, v_a), where it is measured   [N]
    current     i - (U - K w) / R, where it is measured    [A]
    electric-power   P - P(U, w, load), where it is measured, of a drive whose torque is known; load is
                     the measured torque where the drive holds its speed [W]
    shaft-power      P - (I_R dw/dt + M_p + M_f) w, where it is measured without a shaft speed [W]

Where a recording has the shaft's angle and not its speed, the speed is the angle's derivative at the
recording's interval. The residual is a coordinate, not the model: it is formed alike from measured and
from simulated signals, and what is compared is their difference; so lags and Coulomb friction may be
left out of it. Without a torque gauge, engine and propeller are one balance. A drive that holds its
speed has no balance.

Where a power is measured and no torque, power over shaft speed stands for the torque: the shaft's power,
or of a drive that holds its speed what its electric power delivers by its nominal efficiency. About
standstill both sides of the balance fade by w^2 / (w^2 + w_0^2), for a power tells no torque there.

On a ship that turns, hull, sway and yaw are her mass matrix times what the measured accelerations have
more than the plant's own at the measured velocities: centripetal forces, drift and rudder are in it. The
rate of turn is the measured one, or the heading's derivative.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import Record, compiled
from ...plant.columns import (
    ELECTRIC_POWER,
    HEADING,
    RUDDER,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    SWAY_SPEED,
    YAW_RATE,
)
from ...plant.drives.prime_mover import delivered_power, supplied_power
from ...plant.dynamics import loads
from ...plant.expressions import NO_SIGNALS
from ...plant.manoeuvring import planar_acceleration, planar_inertia
from ...plant.shaft import inertia_behind_gauge
from ...plant.state import STATE, Inputs, get_state, without_lags
from .joint_replay import JointReplay

Channels = dict[str, NDArray[np.float64]]


RATES = ("surge_rate", "sway_rate", "yaw_rate_rate")
ACTING = np.dtype(
    [(name, np.float64) for name in (
        "drive", "load", "thrust", "push", "drag", "current", "electric", *RATES
    )]
)  # fmt: skip
"""The plant's loads at a sample [N m, N, A, W]; of a ship that turns, its accelerations
[m/s2, rad/s2]."""


@compiled
def _loads_at(
    plant: Record,
    demand: NDArray[np.float64],
    states: Any,
    rudder: NDArray[np.float64],
    inflow: NDArray[np.float64],
    elevation: NDArray[np.float64],
    found: Any,
) -> None:
    """The plant's loads at each sample of STATE records; ``found``, ACTING records, is filled."""
    for k in range(len(demand)):
        rack = min(max(demand[k], plant.drive_min), plant.drive_max)
        state = get_state(states[k])
        acts = Inputs(
            rack, state.pitch_ratio, inflow[k], 0.0, 0.0, 0.0, 0.0, elevation[k], 1.0, 0.0, 0.0, 0.0,
            rudder[k], 0.0, NO_SIGNALS,
        )  # fmt: skip
        acting = loads(plant, state, acts, state.pitch_ratio)
        found[k].drive = acting.drive_torque
        found[k].load = acting.load_torque
        found[k].thrust = acting.thrust
        found[k].push = acting.push
        found[k].drag = acting.resistance
        found[k].current = acting.motor_current
        found[k].electric = acting.electric_power
        if plant.turns != 0:
            surge, sway, yaw = planar_acceleration(
                plant, acting.ahead, acting.across, state.yaw_rate, state.heading,
                acting.push - acting.resistance + acting.surge_force, acting.side_force,
                acting.yaw_moment,
            )  # fmt: skip
            found[k].surge_rate, found[k].sway_rate, found[k].yaw_rate_rate = surge, sway, yaw


PART_OF = {
    "thrust": "propeller", "current": "motor", "load": "motor", "electric-power": "motor",
    "shaft-power": "propeller",
}  # fmt: skip
"""The plant's balance to which a residual belongs that has a name of its own."""


STANDSTILL = 0.05
"""Share of the shaft speed's rms at which a power tells half of the torque."""


@compiled
def _delivered(plant: Record, electric: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mechanical power [W] of a drive at each electric power [W]."""
    found = np.empty_like(electric)
    for k in range(len(electric)):
        found[k] = delivered_power(plant, electric[k])
    return found


@compiled
def _supplied(plant: Record, mechanical: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the electric power [W] of a drive at each mechanical power [W]."""
    found = np.empty_like(mechanical)
    for k in range(len(mechanical)):
        found[k] = supplied_power(plant, mechanical[k])
    return found


def rate(values: NDArray[np.float64], interval_s: float) -> NDArray[np.float64]:
    """Time derivative by central differences; alike for measured and simulated signals."""
    return np.asarray(np.gradient(values, interval_s))


class Balances:
    """The balances that a ship and the channels of a recording allow.

    Args:
        replay: the recording.

    Raises:
        ValueError: the nominal ship runs away under the recorded demands.

    Attributes:
        names: of the residuals' rows: ``engine``, ``propeller`` and so on.
        units: of each.
    """

    def __init__(self, replay: JointReplay) -> None:
        self.replay = replay
        self.plant = replay.ship.record()
        self._prompt = without_lags(self.plant)
        # a jump at standstill makes a torque of one sign of a noisy speed's wander about 0
        self._prompt["coulomb_engine_side"] = self._prompt["coulomb_propeller_side"] = 0.0
        self.moving = replay.ship.moves and "ship_speed_m_s" in replay.channels
        held = not replay.ship.turns_freely
        turning = held or SHAFT_SPEED in replay.channels or SHAFT_ANGLE in replay.channels
        self.gauge = self._gauge_of(turning, held)
        self.gauged = bool(self.gauge)
        self.prime_mover = replay.ship.drive_balance
        rows = []
        # what never moves is known no better than its unknown resolution
        if replay.controllable and self._moved("pitch_ratio"):
            rows.append(("pitch-actuator", "-"))
        if turning:
            if not held:
                rows.append((self.prime_mover, "N m"))
            if self.gauged:
                rows.append(("propeller" if replay.ship.has_propeller else "load", "N m"))
        if self.moving:
            rows.append(("hull", "N"))
        self.turning = replay.ship.turns and replay.ship.moves
        if self.turning and self._moved(SWAY_SPEED):
            rows.append(("sway", "N"))
        if self.turning and self._moved(YAW_RATE, HEADING):
            rows.append(("yaw", "N m"))
        if self._moved("thrust_N"):
            rows.append(("thrust", "N"))
        if self._moved("motor_current_A") and replay.ship.has_voltage:
            rows.append(("current", "A"))
        if self._moved(ELECTRIC_POWER) and self.gauge != ELECTRIC_POWER:
            rows.append(("electric-power", "W"))
        if self._moved(SHAFT_POWER) and not turning:
            rows.append(("shaft-power", "W"))
        self.names = [name for name, _ in rows]
        self.units = [unit for _, unit in rows]
        nominal = replay.simulate(self.plant)
        self.nominal = replay.simulated(nominal)
        self._refuse_runaway()
        self.nominal_samples = nominal
        # where a neighbour is not measured, its nominal simulation stands in
        self._pitch = np.ascontiguousarray(nominal["pitch_ratio"])
        self._speed = np.ascontiguousarray(nominal["ship_speed"])

    def _gauge_of(self, turning: bool, held: bool) -> str:
        """Return the column that tells the torque at the gauge; empty where none does.

        Args:
            turning: whether the shaft's speed is known.
            held: whether the drive holds it.
        """
        known = ["shaft_torque_N_m"]
        if turning:
            known += [SHAFT_POWER, *([ELECTRIC_POWER] if held else [])]
        return next((c for c in known if c in self.replay.channels and self._moved(c)), "")

    def _moved(self, *columns: str) -> bool:
        """Whether any of these was recorded and did not stand still."""
        return any(np.ptp(self.replay.recorded.get(column, 0.0)) > 0.0 for column in columns)

    def _refuse_runaway(self) -> None:
        for column, values in self.nominal.items():
            if not np.isfinite(values).all():
                when = float(self.replay.time_s[np.argmin(np.isfinite(values))])
                raise ValueError(
                    f"{self.replay.ship.name}: its simulated {column} is not finite from {when:g} s "
                    "on, under the recorded demands; is it this ship's recording?"
                )

    def residuals(self, channels: Channels) -> NDArray[np.float64]:
        """What each balance lacks, of measured or simulated channels; shape (balances, rows)."""
        replay, plant, dt = self.replay, self.plant, self.replay.rate_interval_s
        omega = self._shaft_speed(channels)
        acting = np.zeros(replay.rows, ACTING)
        states = self._states(channels, omega)
        _loads_at(
            self._prompt, replay.drive_rows, states, self._rudder(channels), replay.inflow_rows,
            replay.elevation_rows, acting,
        )  # fmt: skip
        acceleration, speed = rate(omega, dt), states["ship_speed"]
        gauge, share = self._gauge_torque(channels, omega)
        planar = self._planar_forces(states, acting) if self.turning else {}
        left = float(plant["inertia_engine_side"])
        right = inertia_behind_gauge(plant)
        found = []
        for name in self.names:
            if name == "pitch-actuator":
                found.append(channels["pitch_ratio"] - self.nominal["pitch_ratio"])
            elif name == self.prime_mover:
                if self.gauged:
                    found.append(share * (left * acceleration - acting["drive"]) + gauge)
                else:
                    found.append((left + right) * acceleration + acting["load"] - acting["drive"])
            elif name in ("propeller", "load"):
                found.append(share * (right * acceleration + acting["load"]) - gauge)
            elif name in planar:
                found.append(planar[name])
            elif name == "hull":
                found.append(
                    float(plant["mass"]) * rate(speed, dt) - acting["push"] + acting["drag"]
                )
            elif name == "thrust":
                found.append(channels["thrust_N"] - acting["thrust"])
            elif name == "electric-power":
                taken = acting["electric"]
                # where the speed is held the torque is measured, whatever the propeller does
                if not replay.ship.turns_freely:
                    taken = _supplied(self.plant, (gauge + left * acceleration) * omega)
                found.append(channels[ELECTRIC_POWER] - taken)
            elif name == "shaft-power":
                found.append(
                    channels[SHAFT_POWER] - (right * acceleration + acting["load"]) * omega
                )
            else:
                found.append(channels["motor_current_A"] - acting["current"])
        return np.array(found)

    def _gauge_torque(
        self, channels: Channels, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], Any]:
        """Torque [N m] at the gauge, shape (rows,), and the share of it that its instrument tells."""
        if self.gauge in ("", "shaft_torque_N_m"):
            return channels.get(self.gauge, np.zeros_like(omega)), 1.0
        power = channels[self.gauge]
        if self.gauge == ELECTRIC_POWER:
            power = _delivered(self.plant, power)
        usual = float(np.sqrt(np.mean(np.square(self.nominal_samples["shaft_speed"]))))
        slow = STANDSTILL * max(usual, 1e-9)
        below = omega**2 + slow**2
        return power * omega / below, omega**2 / below

    def _states(self, channels: Channels, omega: NDArray[np.float64]) -> Any:
        """Measured states, the nominal ones where a channel is not there; STATE records (rows,)."""
        states = np.zeros(self.replay.rows, STATE)
        offset = float(self.plant["pitch_sensor_offset"])
        states["pitch_ratio"] = channels.get("pitch_ratio", self._pitch) - offset
        states["ship_speed"] = channels.get("ship_speed_m_s", self._speed)
        states["shaft_speed"] = omega
        if self.turning:
            nominal = self.nominal_samples
            states["sway_speed"] = channels.get(SWAY_SPEED, nominal["sway_speed"])
            states["heading"] = channels.get(HEADING, nominal["heading"])
            if YAW_RATE in channels or HEADING not in channels:
                states["yaw_rate"] = channels.get(YAW_RATE, nominal["yaw_rate"])
            else:
                states["yaw_rate"] = self._run_rate(channels[HEADING])
        return states

    def _rudder(self, channels: Channels) -> NDArray[np.float64]:
        """The rudder's angle [rad]: the measured one, or what the nominal ship's gear makes of it."""
        return np.ascontiguousarray(channels.get(RUDDER, self.nominal_samples["rudder_angle"]))

    def _run_rate(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time derivative of each recording for itself: they begin on headings of their own."""
        dt, segments = self.replay.rate_interval_s, self.replay.segments
        return np.concatenate([rate(values[a:b], dt) for a, b in segments])

    def _planar_forces(self, states: Any, acting: Any) -> Channels:
        """Forces [N] and moment [N m] that hull, sway and yaw lack, each of shape (rows,)."""
        sway, sway_yaw, yaw_sway, yaw = map(float, planar_inertia(self.plant))
        ahead, across, turn = (
            self._run_rate(states[name]) - acting[own]
            for name, own in zip(("ship_speed", "sway_speed", "yaw_rate"), RATES, strict=True)
        )
        return {
            "hull": float(self.plant["mass"]) * ahead,
            "sway": sway * across + sway_yaw * turn,
            "yaw": yaw_sway * across + yaw * turn,
        }

    def _shaft_speed(self, channels: Channels) -> NDArray[np.float64]:
        if SHAFT_SPEED not in channels and SHAFT_ANGLE in channels:
            return rate(channels[SHAFT_ANGLE], self.replay.interval_s)
        nominal: NDArray[np.float64] = self.nominal_samples["shaft_speed"]
        return channels.get(SHAFT_SPEED, nominal)

    def lacking(self, simulated: Channels) -> NDArray[np.float64]:
        """What a simulation lacks of the recording in each balance; shape (balances, rows)."""
        return self.residuals(self.replay.measured) - self.residuals(simulated)
