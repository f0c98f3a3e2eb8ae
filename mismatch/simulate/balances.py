"""Compute the residual of each torque, force and power balance, and its change by uncertain parameters.

A difference that the uncertainty of the nominal parameters explains is no missing effect. The table
``[tolerances]`` of the ship file gives the standard deviation of each parameter, by which it is changed.

The residual of a balance is the torque, force or pitch that must be added to the nominal model so that
it agrees with the measured signals of this balance and of its neighbours. A fault in one balance does
not affect the others, as it does in the channels of an open-loop simulation.

    engine      I_L dw/dt + M_m - M_drive(X, w)            [N m]
    propeller   I_R dw/dt + M_p(w, P/D, v_a) + M_f - M_m   [N m]
    load        the propeller balance of a shaft without a propeller    [N m]
    hull        m dv/dt - k_p (1 - t) T + R(v)             [N]
    sway, yaw   see below, for a ship that turns           [N, N m]
    pitch       P/D - simulated P/D                        [-]
    thrust      T - T(w, P/D, v_a), with measured T        [N]
    current     i - (U - K w) / R, with measured i         [A]
    electric-power   P - P(U, w, load) with measured P, for a drive with known torque; for a drive that
                     prescribes its speed, the load is the measured torque [W]
    shaft-power      P - (I_R dw/dt + M_p + M_f) w with measured P, without a shaft speed [W]

The derivative of a shaft angle replaces a shaft speed that is not measured. The residual is computed
from measured and from simulated signals in the same way, and the two are compared; lags and Coulomb
friction may therefore be left out of it. Without a shaft torque meter, engine and propeller form one
balance. A drive that prescribes its speed has no balance.

If a power is measured and no torque, power over shaft speed replaces the torque: the shaft power, or,
for a drive that prescribes its speed, the electric power times the nominal efficiency. Near standstill
the power does not determine the torque, so both sides of the balance are weighted by w^2 / (w^2 +
w_0^2).

For a ship that turns, hull, sway and yaw are the mass matrix times the difference of the measured
accelerations and the accelerations of the model at the measured velocities, with centripetal forces,
drift and rudder. The yaw rate is the measured one, or the derivative of the heading.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...core.compiled import Record, compiled
from ...plant.columns import (
    ELECTRIC_POWER,
    HEADING,
    MEASURED,
    RUDDER,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    SHIP_SPEED,
    SWAY_SPEED,
    YAW_RATE,
)
from ...plant.drives.prime_mover import delivered_power, supplied_power
from ...plant.dynamics import loads
from ...plant.expressions import NO_SIGNALS
from ...plant.manoeuvring import planar_acceleration, planar_inertia
from ...plant.shaft import inertia_behind_meter
from ...plant.ship import Ship
from ...plant.state import STATE, get_state, inputs_without_sea, without_lags
from ...plant.tolerances import TOLERANCE_OF_KEY
from .joint_replay import NO_SHIFT as NO_SHIFT
from .joint_replay import Floats, JointReplay

Channels = dict[str, Floats]

START_DEVIATIONS = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]. The sway
speed has that of the ship speed, and the yaw rate gives the same speed at bow and stern."""

TURNING = tuple(
    key for key, of in TOLERANCE_OF_KEY.items() if of in ("hull_derivatives", "rudder_force")
)
"""Keys of the manoeuvring parameters that a general tolerance covers."""

LARGEST_STEP = 0.05
"""Largest change of a parameter, as a share of it, by which its influence is computed."""

SIGNALS = (
    "pitch_ratio", "shaft_speed", "ship_speed", "thrust", "propeller_torque", "brake_torque",
    "resistance", "motor_current", "rudder_angle",
)  # fmt: skip
"""Signals of the nominal simulation that are kept, beside the measured channels."""

TURNING_SIGNALS = ("sway_speed", "yaw_rate", "heading", "roll_angle")
"""Further signals that are kept for a ship that turns."""

BLOCK_ROWS = 8192
"""Rows for which the loads of the model are computed at a time: their records fit into a cache."""

RATES = ("surge_rate", "sway_rate", "yaw_rate_rate")

LOADS = np.dtype(
    [
        (name, np.float64)
        for name in ("drive", "load", "thrust", "push", "drag", "current", "electric", *RATES)
    ]
)
"""Loads of the model at a sample [N m, N, A, W]; also the accelerations of a ship that turns
[m/s2, rad/s2]."""

BALANCE_OF_RESIDUAL = {
    "thrust": "propeller",
    "current": "motor",
    "load": "motor",
    "electric-power": "motor",
    "shaft-power": "propeller",
}
"""Balance of the model for each residual with another name."""

STANDSTILL = 0.05
"""Share of the rms shaft speed at which a torque from power has half weight."""


class RunawayError(ValueError):
    """The simulation of a ship with the recorded commands diverges."""


class Balances:
    """Balances whose residuals the channels of a recording determine.

    Args:
        replay: the recordings and the nominal ship.

    Raises:
        RunawayError: the simulation of the nominal ship with the recorded commands diverges.

    Attributes:
        names: balances in the order of the residuals: ``engine``, ``propeller`` and so on.
        units: unit of each residual.
        torque_column: column from which the shaft torque is taken; empty if there is none.
        nominal: channels of the nominal simulation.
        nominal_samples: signals of the nominal simulation by name: :data:`SIGNALS`, and
            :data:`TURNING_SIGNALS` for a ship that turns.
    """

    def __init__(self, replay: JointReplay) -> None:
        self.replay = replay
        self.plant = replay.ship.record()
        self._prompt = without_lags(self.plant)
        # The jump of Coulomb friction at standstill would turn noise of a speed near 0 into torque.
        self._prompt["coulomb_engine_side"] = self._prompt["coulomb_propeller_side"] = 0.0
        self.moving = replay.ship.moves and "ship_speed_m_s" in replay.channels
        held = not replay.ship.turns_freely
        turning = held or SHAFT_SPEED in replay.channels or SHAFT_ANGLE in replay.channels
        self.torque_column = self._torque_column_of(turning, held)
        self.has_torque = bool(self.torque_column)
        self.prime_mover = replay.ship.drive_balance
        self.turning = replay.ship.turns and replay.ship.moves
        loaded = "propeller" if replay.ship.has_propeller else "load"
        has_current = replay.ship.has_voltage and self._varies("motor_current_A")
        has_power = self.torque_column != ELECTRIC_POWER and self._varies(ELECTRIC_POWER)
        # A channel that is constant throughout may have a coarse resolution, so it gives no balance.
        rows = [
            ("pitch-actuator", "-", replay.controllable and self._varies("pitch_ratio")),
            (self.prime_mover, "N m", turning and not held),
            (loaded, "N m", turning and self.has_torque),
            ("hull", "N", self.moving),
            ("sway", "N", self.turning and self._varies(SWAY_SPEED)),
            ("yaw", "N m", self.turning and self._varies(YAW_RATE, HEADING)),
            ("thrust", "N", self._varies("thrust_N")),
            ("current", "A", has_current),
            ("electric-power", "W", has_power),
            ("shaft-power", "W", not turning and self._varies(SHAFT_POWER)),
        ]
        self.names = [name for name, _, measured in rows if measured]
        self.units = [unit for _, unit, measured in rows if measured]
        measured = {MEASURED[c]: c for c in replay.channels}
        kept = [*SIGNALS, *(TURNING_SIGNALS if replay.ship.turns else ())]
        nominal = replay.simulate_signals(self.plant, [*dict.fromkeys([*kept, *measured])])
        self.nominal = {c: nominal[signal] for signal, c in measured.items()}
        self._refuse_runaway()
        self.nominal_samples: Mapping[str, Floats] = {name: nominal[name] for name in kept}
        # The nominal simulation replaces a pitch or a ship speed that is not measured.
        self._pitch, self._speed = nominal["pitch_ratio"], nominal["ship_speed"]

    def _torque_column_of(self, turning: bool, held: bool) -> str:
        """Return the column that gives the shaft torque; empty if there is none.

        A power gives it if the shaft speed is known; electric power, if the drive holds that speed.
        """
        powers = [SHAFT_POWER, ELECTRIC_POWER] if held else [SHAFT_POWER]
        columns = ["shaft_torque_N_m", *(powers if turning else [])]
        return next((c for c in columns if c in self.replay.channels and self._varies(c)), "")

    def _varies(self, *columns: str) -> bool:
        """Return whether any of these columns was recorded and varies."""
        return any(np.ptp(self.replay.recorded.get(column, 0.0)) > 0.0 for column in columns)

    def _refuse_runaway(self) -> None:
        for column, values in self.nominal.items():
            if not np.isfinite(values).all():
                when = float(self.replay.time_s[np.argmin(np.isfinite(values))])
                raise RunawayError(
                    f"{self.replay.ship.name}: the simulated {column} is not finite from {when:g} s on "
                    "with the recorded commands; check that the recording is of this ship"
                )

    def residuals(self, channels: Channels) -> Floats:
        """Return the residual of each balance for measured or simulated channels, (balances, rows)."""
        replay, plant, dt = self.replay, self.plant, self.replay.rate_interval_s
        omega = self._shaft_speed(channels)
        states = self._states(channels, omega)
        acting = self._loads(states, self._rudder(channels))
        acceleration, speed = time_derivative(omega, dt), states["ship_speed"]
        meter, share = self._meter_torque(channels, omega)
        planar = self._planar_forces(states, acting) if self.turning else {}
        left, right = float(plant["inertia_engine_side"]), inertia_behind_meter(plant)
        drive, load = acting["drive"], acting["load"]

        def residual(name: str) -> Any:
            if name in planar:
                return planar[name]
            if name == "hull":
                inertial = float(plant["mass"]) * time_derivative(speed, dt)
                return inertial - acting["push"] + acting["drag"]
            if name == self.prime_mover:
                if self.has_torque:
                    return share * (left * acceleration - drive) + meter
                return (left + right) * acceleration + load - drive
            if name in ("propeller", "load"):
                return share * (right * acceleration + load) - meter
            if name == "shaft-power":
                return channels[SHAFT_POWER] - (right * acceleration + load) * omega
            if name == "electric-power":
                supplied = acting["electric"]
                # With a prescribed speed the torque is measured, and no propeller model is needed.
                if not replay.ship.turns_freely:
                    supplied = _supplied(plant, (meter + left * acceleration) * omega)
                return channels[ELECTRIC_POWER] - supplied
            if name == "pitch-actuator":
                return channels["pitch_ratio"] - self.nominal["pitch_ratio"]
            if name == "thrust":
                return channels["thrust_N"] - acting["thrust"]
            return channels["motor_current_A"] - acting["current"]

        return np.array([residual(name) for name in self.names])

    def _meter_torque(self, channels: Channels, omega: Floats) -> tuple[Floats, Any]:
        """Return the measured shaft torque [N m], shape (rows,), and its weight near standstill."""
        if self.torque_column in ("", "shaft_torque_N_m"):
            return channels.get(self.torque_column, np.zeros_like(omega)), 1.0
        power = channels[self.torque_column]
        if self.torque_column == ELECTRIC_POWER:
            power = _delivered(self.plant, power)
        usual = float(np.sqrt(np.mean(np.square(self.nominal_samples["shaft_speed"]))))
        slow = STANDSTILL * max(usual, 1e-9)
        below = omega**2 + slow**2
        return power * omega / below, omega**2 / below

    def _loads(self, states: Channels, rudder: Floats) -> Channels:
        """Return the loads of the model by name, each of shape (rows,).

        Records of all rows would take far more memory than the loads, so they hold a block of rows.
        """
        replay = self.replay
        names = [name for name in LOADS.names or () if self.turning or name not in RATES]
        found = {name: np.empty(replay.rows) for name in names}
        block = min(BLOCK_ROWS, replay.rows)
        records, loads_of_block = np.zeros(block, STATE), np.zeros(block, LOADS)
        for a in range(0, replay.rows, block):
            b = min(a + block, replay.rows)
            for name, values in states.items():
                records[name][: b - a] = values[a:b]
            _loads_at(
                self._prompt,
                replay.drive_rows[a:b],
                records[: b - a],
                rudder[a:b],
                replay.inflow_rows[a:b],
                replay.elevation_rows[a:b],
                loads_of_block[: b - a],
            )
            for name, values in found.items():
                values[a:b] = loads_of_block[name][: b - a]
        return found

    def _states(self, channels: Channels, omega: Floats) -> Channels:
        """Return the measured states by name, or nominal ones for channels that are missing."""
        offset = float(self.plant["pitch_sensor_offset"])
        states = {"pitch_ratio": channels.get("pitch_ratio", self._pitch) - offset}
        states["ship_speed"] = self._speed
        if SHIP_SPEED in channels:
            states["ship_speed"] = channels[SHIP_SPEED] / float(self.plant["speed_log_gain"])
        states["shaft_speed"] = omega
        if self.turning:
            nominal = self.nominal_samples
            columns = {"sway_speed": SWAY_SPEED, "heading": HEADING, "yaw_rate": YAW_RATE}
            for name, column in columns.items():
                states[name] = channels.get(column, nominal[name])
            states["roll_angle"] = nominal["roll_angle"]
            if HEADING in channels and YAW_RATE not in channels:
                states["yaw_rate"] = self._run_rate(channels[HEADING])
        return states

    def _rudder(self, channels: Channels) -> Floats:
        """Return the rudder angle [rad]: the measured one, or that of the nominal simulation."""
        return np.ascontiguousarray(channels.get(RUDDER, self.nominal_samples["rudder_angle"]))

    def _run_rate(self, values: Floats) -> Floats:
        """Return the time derivative within each recording, because recordings start independently."""
        dt, segments = self.replay.rate_interval_s, self.replay.segments
        return np.concatenate([time_derivative(values[a:b], dt) for a, b in segments])

    def _planar_forces(self, states: Any, acting: Any) -> Channels:
        """Return the residuals of hull and sway [N] and of yaw [N m], each of shape (rows,)."""
        sway, sway_yaw, yaw_sway, yaw = map(float, planar_inertia(self.plant))
        pairs = zip(("ship_speed", "sway_speed", "yaw_rate"), RATES, strict=True)
        ahead, across, turn = (self._run_rate(states[own]) - acting[rate] for own, rate in pairs)
        return {
            "hull": float(self.plant["mass"]) * ahead,
            "sway": sway * across + sway_yaw * turn,
            "yaw": yaw_sway * across + yaw * turn,
        }

    def _shaft_speed(self, channels: Channels) -> Floats:
        if SHAFT_SPEED not in channels and SHAFT_ANGLE in channels:
            return time_derivative(channels[SHAFT_ANGLE], self.replay.interval_s)
        nominal: Floats = self.nominal_samples["shaft_speed"]
        return channels.get(SHAFT_SPEED, nominal)

    def residuals_against(self, simulated: Channels) -> Floats:
        """Return the residuals of the recording minus those of a simulation, (balances, rows)."""
        return self.residuals(self.replay.measured) - self.residuals(simulated)


def time_derivative(values: Floats, interval_s: float) -> Floats:
    """Return the time derivative by central differences, for measured and simulated signals.

    Example:
        >>> time_derivative(np.array([0.0, 1.0, 4.0, 9.0]), 0.5).tolist()
        [2.0, 4.0, 8.0, 10.0]
    """
    return np.asarray(np.gradient(values, interval_s))


@compiled
def _loads_at(
    plant: Record,
    demand: Floats,
    states: Any,
    rudder: Floats,
    inflow: Floats,
    elevation: Floats,
    found: Any,
) -> None:
    """Write the loads of the model at each sample of STATE records to ``found``, LOADS records."""
    for k in range(len(demand)):
        rack = min(max(demand[k], plant.drive_min), plant.drive_max)
        state = get_state(states[k])
        acts = inputs_without_sea(
            rack, state.pitch_ratio, inflow[k], elevation[k], 1.0, 0.0, 0.0, rudder[k], NO_SIGNALS
        )
        acting = loads(plant, state, acts, state.pitch_ratio)
        found[k].drive = acting.drive_torque
        found[k].load = acting.load_torque
        found[k].thrust = acting.thrust
        found[k].push = acting.push
        found[k].drag = acting.resistance
        found[k].current = acting.mover.current
        found[k].electric = acting.electric_power
        if plant.turns != 0:
            surge, sway, yaw = planar_acceleration(
                plant,
                acting.ahead,
                acting.across,
                state.yaw_rate,
                state.heading,
                acting.push - acting.resistance + acting.surge_force,
                acting.side_force,
                acting.yaw_moment,
            )
            found[k].surge_rate, found[k].sway_rate, found[k].yaw_rate_rate = surge, sway, yaw


@compiled
def _delivered(plant: Record, electric: Floats) -> Floats:
    """Return the mechanical power [W] of a drive at each electric power [W]."""
    found = np.empty_like(electric)
    for k in range(len(electric)):
        found[k] = delivered_power(plant, electric[k])
    return found


@compiled
def _supplied(plant: Record, mechanical: Floats) -> Floats:
    """Return the electric power [W] of a drive at each mechanical power [W]."""
    found = np.empty_like(mechanical)
    for k in range(len(mechanical)):
        found[k] = supplied_power(plant, mechanical[k])
    return found


class Perturbation(NamedTuple):
    """Nominal ship with one parameter, or several correlated ones, changed by one standard deviation."""

    record: Any
    start: tuple[float, ...]  # shift of the first state, as in JointReplay.simulate
    numbers: Mapping[str, float] = {}  # change of each parameter of the ship file, by dotted key
    share: float = 1.0  # share of the standard deviation that is applied in the record


def tolerance_perturbations(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = (), near: float = float("inf")
) -> Iterator[Perturbation]:
    """Yield the ship with each parameter changed by one standard deviation, and its change.

    Parameters with correlated errors are changed together, along the principal axes of their covariance.

    Args:
        replay: recordings; parameters that do not act in them or are known exactly are left out.
        scale: factor on all tolerances.
        free: dotted keys of parameters that are left out because they are fitted.
        near: largest change as a share of the parameter; a smaller change than the standard deviation
            has its ``share`` in the result.
    """
    ship = replay.ship
    known = ship.tolerances
    excluded = {*free, *known.numbers}  # General tolerances do not apply to these parameters.

    def is_idle(key: str) -> bool:
        return replay.steady and is_transient(ship, key)

    def tolerance_of(key: str) -> float:
        return 0.0 if key in excluded else scale * float(getattr(known, TOLERANCE_OF_KEY[key]))

    def scaled(key: str, power: float = 1.0, field: str = "") -> Iterator[Perturbation]:
        """Change a parameter by a share of itself; a power of -1 changes its reciprocal."""
        tolerance = tolerance_of(key)
        if tolerance != 0.0 and not is_idle(key):
            record, name = ship.record(), field or ship.parameter(key).field
            factor = (1.0 + tolerance) ** power
            record[name] = record[name] * factor
            value = ship.parameter(key).value if ship.has_key(key) else None
            numbers = {} if value is None else {key: (factor - 1.0) * value}
            yield Perturbation(record, NO_SHIFT, numbers)

    def shifted(key: str, unit: float) -> Iterator[Perturbation]:
        """Change a parameter by a share of another quantity."""
        if (tolerance := tolerance_of(key)) != 0.0:
            yield _perturb(ship, {key: tolerance * unit})

    if ship.moves:
        yield from scaled("hull.resistance_coefficient_N_s2_m2")
        yield from scaled("hull.mass_kg")
    if ship.moves and ship.has_propeller:
        yield from shifted("hull.wake_fraction", 1.0)
        for moved in scaled("propeller.thrust_coefficient", field="kt"):
            factor = 1.0 + scale * known.thrust_curve
            moved.record["four_quadrant"][..., :2] *= factor  # harmonics of the thrust coefficient
            moved.record["table_kt"] *= factor
            yield moved
    for side in ("engine", "propeller") if ship.turns_freely else ("propeller",):
        yield from scaled(f"transmission.inertia_{side}_side_kg_m2")
    if ship.has_key("propeller.torque_coefficient"):
        yield from scaled("propeller.torque_coefficient")
    elif ship.has_propeller:
        yield from scaled("propeller.relative_rotative_efficiency", power=-1.0)
    if ship.has_diesel:
        yield from scaled("prime_mover.torque_per_rack_N_m_mm")
        plant = ship.record()
        highest = float(min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"]))
        yield from shifted("prime_mover.torque_offset_N_m", highest)
    elif ship.has_voltage:
        yield from scaled("prime_mover.motor_constant_V_s_rad")
        yield from scaled("prime_mover.armature_resistance_ohm")
    if replay.controllable:
        yield from scaled("pitch_actuator.time_constant_s")
    if ship.moves and ship.turns and not replay.steady:
        for key in TURNING:
            if ship.has_key(key) and ship.parameter(key).value != 0.0:
                yield from scaled(key)
    given = [key for key, one in known.numbers.items() if key not in free and scale * one > 0.0]
    for numbers in _deviations(ship, [key for key in given if not is_idle(key)], scale):
        yield _perturb(ship, numbers, near)
    deviations = first_state_deviations(replay)
    for k in (1, 0, *range(2, len(deviations))):
        if deviations[k] > 0.0:
            shift = [0.0] * max(k + 1, len(NO_SHIFT))
            shift[k] = scale * deviations[k]
            yield Perturbation(ship.record(), tuple(shift))


def tolerance_records(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = ()
) -> Iterator[tuple[Any, tuple[float, ...]]]:
    """Yield the ship record and the shift of the first state of :func:`tolerance_perturbations`."""
    for one in tolerance_perturbations(replay, scale, free):
        yield one.record, one.start


def _perturb(ship: Ship, numbers: Mapping[str, float], near: float = float("inf")) -> Perturbation:
    """Return the ship with changed parameters; each changes by at most ``near`` times its value."""
    pairs = [(ship.parameter(key), change) for key, change in numbers.items()]
    shares = [
        near * abs(p.value / change) for p, change in pairs if change != 0.0 and p.value != 0.0
    ]
    record, share = ship.record(), min([1.0, *shares])
    for parameter, change in pairs:
        parameter.write(record, parameter.value + share * change)
    return Perturbation(record, NO_SHIFT, numbers, share)


def _deviations(ship: Ship, keys: list[str], scale: float) -> Iterator[dict[str, float]]:
    """Yield one standard deviation of each parameter, or along each axis of correlated parameters."""
    known = ship.tolerances
    together = [k for k in keys if any(known.correlation(k, other) for other in keys if other != k)]
    yield from ({key: scale * known.numbers[key]} for key in keys if key not in together)
    if together:
        correlation = np.array([[known.correlation(a, b) for b in together] for a in together])
        sizes, axes = np.linalg.eigh(correlation)
        deviations = scale * np.array([known.numbers[key] for key in together])
        for size, axis in zip(sizes, axes.T, strict=True):
            if size > 0.0:  # Rounded correlations may give an eigenvalue below 0.
                yield dict(zip(together, np.sqrt(size) * deviations * axis, strict=True))


def first_state_deviations(replay: JointReplay) -> list[float]:
    """Return the standard deviation of each state of the first row, by :data:`START_DEVIATIONS`.

    The states are pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and for a ship that turns
    sway speed [m/s] and yaw rate [rad/s]. The deviation is 0 for a state that is known.
    """
    ship, (pitch, shaft, speed) = replay.ship, START_DEVIATIONS.values()
    deviations = [
        pitch if replay.controllable else 0.0,
        shaft * max(abs(replay.start[1]), 1.0) if ship.turns_freely else 0.0,
        speed if ship.moves else 0.0,
    ]
    if ship.moves and ship.turns:
        deviations += [speed, 2.0 * speed / ship.manoeuvring.length_m]
    # An equilibrium does not depend on the first state.
    return [0.0] * len(deviations) if replay.steady else deviations


def is_transient(ship: Ship, key: str) -> bool:
    """Return whether a parameter, by its dotted key, acts in transients only or with earlier states.

    Time constants, delays, inertias and rate limits act in transients; backlash and dead band of the
    pitch actuator depend on its earlier positions.
    """
    words = ("inertia_", "mass_kg", "rate_limit", "dead_band", "backlash", "added_mass")
    if any(word in key.rpartition(".")[2] for word in words):
        return True
    timed = not key.startswith("term.") and ship.has_key(key)
    return timed and ship.parameter(key).info.unit == "s"
