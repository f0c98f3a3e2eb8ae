"""The balances of a plant that measured signals can check in isolation.

Each residual is what its balance lacks: the torque, force or pitch that must be added to the nominal
model's so that the measured signals of its neighbours and its own agree. A fault in one balance does not
smear over the others, as it does in the channels of an open-loop simulation.

    engine      I_L dw/dt + M_m - M_drive(X, w)            [N m]
    propeller   I_R dw/dt + M_p(w, P/D, v_a) + M_f - M_m   [N m]
    load        the same on a shaft without a propeller    [N m]
    hull        m dv/dt - k_p (1 - t) T + R(v)             [N]
    pitch       P/D - its answer to the command            [-]
    thrust      T - T(w, P/D, v_a), where it is measured   [N]
    current     i - (U - K w) / R, where it is measured    [A]

Where a recording has the shaft's angle and not its speed, the speed is the angle's derivative at the
recording's interval. The residual is a coordinate, not the model: it is formed alike from measured and
from simulated signals, and what is compared is their difference; so lags and Coulomb friction may be
left out of it. Without a torque gauge, engine and propeller are one balance. A drive that holds its
speed has no balance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import Record, compiled
from ...plant.columns import SHAFT_ANGLE, SHAFT_SPEED
from ...plant.dynamics import loads
from ...plant.shaft import inertia_behind_gauge
from ...plant.state import motion_state, steady_inputs, without_lags
from .joint_replay import JointReplay

Channels = dict[str, NDArray[np.float64]]


@compiled
def _loads_at(
    plant: Record,
    demand: NDArray[np.float64],
    pitch_ratio: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    ship_speed: NDArray[np.float64],
    inflow: NDArray[np.float64],
    elevation: NDArray[np.float64],
    drive_torque: NDArray[np.float64],
    load_torque: NDArray[np.float64],
    thrust: NDArray[np.float64],
    push: NDArray[np.float64],
    drag: NDArray[np.float64],
    current: NDArray[np.float64],
) -> None:
    """The plant's loads at each sample; the last six filled."""
    for k in range(len(demand)):
        rack = min(max(demand[k], plant.drive_min), plant.drive_max)
        state = motion_state(pitch_ratio[k], shaft_speed[k], ship_speed[k])
        acts = steady_inputs(rack, pitch_ratio[k], inflow[k], elevation[k])
        acting = loads(plant, state, acts, pitch_ratio[k])
        drive_torque[k] = acting.drive_torque
        load_torque[k] = acting.load_torque
        thrust[k] = acting.thrust
        push[k] = acting.push
        drag[k] = acting.resistance
        current[k] = acting.motor_current


PART_OF = {"thrust": "propeller", "current": "motor", "load": "motor"}
"""The plant's balance to which a residual belongs that has a name of its own."""


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
        self.gauged = "shaft_torque_N_m" in replay.channels
        self.prime_mover = replay.ship.drive_balance
        rows = []
        # a pitch that never moves is known no better than its unknown resolution
        if replay.controllable and np.ptp(replay.recorded.get("pitch_ratio", 0.0)) > 0.0:
            rows.append(("pitch-actuator", "-"))
        held = not replay.ship.turns_freely
        if held or SHAFT_SPEED in replay.channels or SHAFT_ANGLE in replay.channels:
            if not held:
                rows.append((self.prime_mover, "N m"))
            if self.gauged:
                rows.append(("propeller" if replay.ship.has_propeller else "load", "N m"))
        if self.moving:
            rows.append(("hull", "N"))
        if "thrust_N" in replay.channels:
            rows.append(("thrust", "N"))
        if "motor_current_A" in replay.channels and replay.ship.has_voltage:
            rows.append(("current", "A"))
        self.names = [name for name, _ in rows]
        self.units = [unit for _, unit in rows]
        nominal = replay.simulate(self.plant)
        self.nominal = replay.simulated(nominal)
        self._refuse_runaway()
        self.nominal_samples = nominal
        # where a neighbour is not measured, its nominal simulation stands in
        self._pitch = np.ascontiguousarray(nominal["pitch_ratio"])
        self._speed = np.ascontiguousarray(nominal["ship_speed"])

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
        replay, plant, dt = self.replay, self.plant, self.replay.interval_s
        pitch = channels.get("pitch_ratio", self._pitch) - float(plant["pitch_sensor_offset"])
        speed = channels.get("ship_speed_m_s", self._speed)
        omega = self._shaft_speed(channels)
        n = replay.rows
        drive, load, thrust, push, drag, current = (np.zeros(n) for _ in range(6))
        _loads_at(
            self._prompt, replay.drive_rows, np.ascontiguousarray(pitch),
            np.ascontiguousarray(omega), np.ascontiguousarray(speed), replay.inflow_rows,
            replay.elevation_rows, drive, load, thrust, push, drag, current,
        )  # fmt: skip
        acceleration = rate(omega, dt)
        left = float(plant["inertia_engine_side"])
        right = inertia_behind_gauge(plant)
        found = []
        for name in self.names:
            if name == "pitch-actuator":
                found.append(channels["pitch_ratio"] - self.nominal["pitch_ratio"])
            elif name == self.prime_mover:
                if self.gauged:
                    found.append(left * acceleration + channels["shaft_torque_N_m"] - drive)
                else:
                    found.append((left + right) * acceleration + load - drive)
            elif name in ("propeller", "load"):
                found.append(right * acceleration + load - channels["shaft_torque_N_m"])
            elif name == "hull":
                found.append(float(plant["mass"]) * rate(speed, dt) - push + drag)
            elif name == "thrust":
                found.append(channels["thrust_N"] - thrust)
            else:
                found.append(channels["motor_current_A"] - current)
        return np.array(found)

    def _shaft_speed(self, channels: Channels) -> NDArray[np.float64]:
        if SHAFT_SPEED not in channels and SHAFT_ANGLE in channels:
            return rate(channels[SHAFT_ANGLE], self.replay.interval_s)
        nominal: NDArray[np.float64] = self.nominal_samples["shaft_speed"]
        return channels.get(SHAFT_SPEED, nominal)

    def lacking(self, simulated: Channels) -> NDArray[np.float64]:
        """What a simulation lacks of the recording in each balance; shape (balances, rows)."""
        return self.residuals(self.replay.measured) - self.residuals(simulated)
