"""Perturb the parameters of a ship by their tolerances, and recognise parameters of transients.

A difference that the uncertainty of the nominal parameters explains is no missing effect. The table
``[tolerances]`` of the ship file gives the standard deviation of each parameter.

Compute the residual of each torque, force and power balance from measured signals.

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

If a recording has the shaft angle and not the shaft speed, the derivative of the angle at the sampling
interval replaces the speed. The residual is computed from measured and from simulated signals in the
same way, and the two are compared; lags and Coulomb friction may therefore be left out of it. Without a
shaft torque meter, engine and propeller form one balance. A drive that prescribes its speed has no
balance.

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
from ...plant.shaft import inertia_behind_meter
from ...plant.ship import Ship
from ...plant.state import STATE, Inputs, get_state, without_lags
from ...plant.tolerances import TOLERANCE_OF_KEY
from .joint_replay import NO_SHIFT as NO_SHIFT
from .joint_replay import JointReplay

START_DEVIATIONS = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]. The sway
speed has that of the ship speed, and the yaw rate gives the same speed at bow and stern."""

TURNING = tuple(
    key for key, of in TOLERANCE_OF_KEY.items() if of in ("hull_derivatives", "rudder_force")
)
"""Keys of the manoeuvring parameters that a general tolerance covers."""

LARGEST_STEP = 0.05
"""Largest change of a parameter, as a share of it, by which its influence is computed."""


class Perturbation(NamedTuple):
    """Nominal ship with one parameter, or several correlated ones, changed by one standard deviation."""

    record: Any
    start: tuple[float, ...]  # shift of the first state, as in JointReplay.simulate
    numbers: Mapping[str, float] = {}  # change of each parameter of the ship file, by dotted key
    share: float = 1.0  # share of the standard deviation that is applied in the record


def tolerance_records(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = ()
) -> Iterator[tuple[Any, tuple[float, ...]]]:
    """Yield the ship record and the shift of the first state for each perturbed parameter.

    Parameters with correlated errors are changed together, along the principal axes of their covariance.

    Args:
        replay: recordings; parameters that do not act in them or are known exactly are left out.
        scale: factor on all tolerances.
        free: dotted keys of parameters that are left out because they are fitted.
    """
    for one in tolerance_perturbations(replay, scale, free):
        yield one.record, one.start


def tolerance_perturbations(
    replay: JointReplay,
    scale: float = 1.0,
    free: Collection[str] = (),
    near: float = float("inf"),
) -> Iterator[Perturbation]:
    """Yield the ship with each parameter changed by one standard deviation, and its change.

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

    def scaled(key: str, power: float = 1.0, field: str = "") -> Iterator[Perturbation]:
        """Change a parameter by a share of itself; a power of -1 changes its reciprocal."""
        tolerance = scale * getattr(known, TOLERANCE_OF_KEY[key])
        if (
            tolerance != 0.0
            and key not in excluded
            and not (replay.steady and is_transient(ship, key))
        ):
            record, name = ship.record(), field or ship.parameter(key).field
            record[name] = record[name] * (1.0 + tolerance) ** power
            own = (1.0 + tolerance) ** power - 1.0
            in_file = ship.has_key(key)
            yield Perturbation(
                record, NO_SHIFT, {key: own * ship.parameter(key).value} if in_file else {}
            )

    def shifted(key: str, unit: float) -> Iterator[Perturbation]:
        """Change a parameter by a share of another quantity."""
        tolerance = scale * getattr(known, TOLERANCE_OF_KEY[key])
        if tolerance != 0.0 and key not in excluded:
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
    individual = [
        k for k, one in known.numbers.items()
        if k not in free and scale * one > 0.0 and not (replay.steady and is_transient(ship, k))
    ]  # fmt: skip
    for numbers in _deviations(ship, individual, scale):
        yield _perturb(ship, numbers, near)
    deviations = first_state_deviations(replay)
    for k in (1, 0, *range(2, len(deviations))):
        if deviations[k] > 0.0:
            shift = [0.0] * max(k + 1, len(NO_SHIFT))
            shift[k] = scale * deviations[k]
            yield Perturbation(ship.record(), tuple(shift))


def first_state_deviations(replay: JointReplay) -> list[float]:
    """Return the standard deviation of each state of the first row, by :data:`START_DEVIATIONS`.

    Args:
        replay: the recordings.

    Returns:
        Standard deviations of pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and for a ship
        that turns of sway speed [m/s] and yaw rate [rad/s]; 0 for a state that is known.
    """
    ship = replay.ship
    shaft = max(abs(replay.start[1]), 1.0)
    found = [
        START_DEVIATIONS["pitch_ratio"] if replay.controllable else 0.0,
        START_DEVIATIONS["shaft_speed"] * shaft if ship.turns_freely else 0.0,
        START_DEVIATIONS["ship_speed"] if ship.moves else 0.0,
    ]
    if ship.moves and ship.turns:
        across = START_DEVIATIONS["ship_speed"]
        found += [across, 2.0 * across / ship.manoeuvring.length_m]
    # An equilibrium does not depend on the first state.
    return [0.0] * len(found) if replay.steady else found


def _deviations(ship: Ship, keys: list[str], scale: float) -> Iterator[dict[str, float]]:
    """Yield one standard deviation of each parameter, or along each axis of correlated parameters."""
    known = ship.tolerances
    together = [k for k in keys if any(known.correlation(k, other) for other in keys if other != k)]
    for key in keys:
        if key not in together:
            yield {key: scale * known.numbers[key]}
    if together:
        correlation = np.array([[known.correlation(a, b) for b in together] for a in together])
        sizes, axes = np.linalg.eigh(correlation)
        deviations = scale * np.array([known.numbers[key] for key in together])
        for size, axis in zip(sizes, axes.T, strict=True):
            if size > 0.0:  # Rounded correlations may give an eigenvalue below 0.
                yield dict(zip(together, np.sqrt(size) * deviations * axis, strict=True))


def _perturb(ship: Ship, numbers: Mapping[str, float], near: float = float("inf")) -> Perturbation:
    """Return the ship with changed parameters; each changes by at most ``near`` times its value."""
    own = {key: ship.parameter(key) for key in numbers}
    shares = [
        near * abs(own[key].value / change)
        for key, change in numbers.items()
        if change != 0.0 and own[key].value != 0.0
    ]
    share = min(1.0, *shares) if shares else 1.0
    record = ship.record()
    for key, change in numbers.items():
        own[key].write(record, own[key].value + share * change)
    return Perturbation(record, NO_SHIFT, numbers, share)


_WORDS = ("inertia_", "mass_kg", "rate_limit", "dead_band", "backlash", "added_mass")


def is_transient(ship: Ship, key: str) -> bool:
    """Return whether a parameter acts in transients only, or depends on earlier states.

    Time constants, delays, inertias and rate limits act in transients; backlash and dead band of the
    pitch actuator depend on its earlier positions.

    Args:
        ship: ship with the parameter.
        key: dotted key of the parameter.
    """
    name = key.rpartition(".")[2]
    if any(word in name for word in _WORDS):
        return True
    timed = not key.startswith("term.") and ship.has_key(key)
    return timed and ship.parameter(key).info.unit == "s"


Channels = dict[str, NDArray[np.float64]]


RATES = ("surge_rate", "sway_rate", "yaw_rate_rate")
LOADS = np.dtype(
    [(name, np.float64) for name in (
        "drive", "load", "thrust", "push", "drag", "current", "electric", *RATES
    )]
)  # fmt: skip
"""Loads of the model at a sample [N m, N, A, W]; also the accelerations of a ship that turns
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
    """Write the loads of the model at each sample of STATE records to ``found``, LOADS records."""
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


BALANCE_OF_RESIDUAL = {
    "thrust": "propeller", "current": "motor", "load": "motor", "electric-power": "motor",
    "shaft-power": "propeller",
}  # fmt: skip
"""Balance of the model for each residual with another name."""


STANDSTILL = 0.05
"""Share of the rms shaft speed at which a torque from power has half weight."""


@compiled
def _delivered(plant: Record, electric: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mechanical power [W] of a drive at each electric power [W]."""
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


def time_derivative(values: NDArray[np.float64], interval_s: float) -> NDArray[np.float64]:
    """Return the time derivative by central differences, for measured and simulated signals.

    Example:
        >>> time_derivative(np.array([0.0, 1.0, 4.0, 9.0]), 0.5).tolist()
        [2.0, 4.0, 8.0, 10.0]
    """
    return np.asarray(np.gradient(values, interval_s))


class Balances:
    """Balances whose residuals the channels of a recording determine.

    Args:
        replay: the recordings and the nominal ship.

    Raises:
        ValueError: the simulation of the nominal ship with the recorded commands diverges.

    Attributes:
        names: balances in the order of the residuals: ``engine``, ``propeller`` and so on.
        units: unit of each residual.
        torque_column: column from which the shaft torque is taken; empty if there is none.
        nominal: channels of the nominal simulation.
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
        rows = []
        # A channel that is constant throughout may have a coarse resolution, so it gives no balance.
        if replay.controllable and self._moved("pitch_ratio"):
            rows.append(("pitch-actuator", "-"))
        if turning:
            if not held:
                rows.append((self.prime_mover, "N m"))
            if self.has_torque:
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
        if self._moved(ELECTRIC_POWER) and self.torque_column != ELECTRIC_POWER:
            rows.append(("electric-power", "W"))
        if self._moved(SHAFT_POWER) and not turning:
            rows.append(("shaft-power", "W"))
        self.names = [name for name, _ in rows]
        self.units = [unit for _, unit in rows]
        nominal = replay.simulate(self.plant)
        self.nominal = replay.simulated(nominal)
        self._refuse_runaway()
        self.nominal_samples = nominal
        # The nominal simulation replaces a pitch or a ship speed that is not measured.
        self._pitch = np.ascontiguousarray(nominal["pitch_ratio"])
        self._speed = np.ascontiguousarray(nominal["ship_speed"])

    def _torque_column_of(self, turning: bool, held: bool) -> str:
        """Return the column that gives the shaft torque; empty if there is none.

        Args:
            turning: whether the shaft speed is known.
            held: whether the drive prescribes the shaft speed.
        """
        known = ["shaft_torque_N_m"]
        if turning:
            known += [SHAFT_POWER, *([ELECTRIC_POWER] if held else [])]
        return next((c for c in known if c in self.replay.channels and self._moved(c)), "")

    def _moved(self, *columns: str) -> bool:
        """Return whether any of these columns was recorded and varies."""
        return any(np.ptp(self.replay.recorded.get(column, 0.0)) > 0.0 for column in columns)

    def _refuse_runaway(self) -> None:
        for column, values in self.nominal.items():
            if not np.isfinite(values).all():
                when = float(self.replay.time_s[np.argmin(np.isfinite(values))])
                raise ValueError(
                    f"{self.replay.ship.name}: the simulated {column} is not finite from {when:g} s on "
                    "with the recorded commands; check that the recording is of this ship"
                )

    def residuals(self, channels: Channels) -> NDArray[np.float64]:
        """Return the residual of each balance for measured or simulated channels, (balances, rows)."""
        replay, plant, dt = self.replay, self.plant, self.replay.rate_interval_s
        omega = self._shaft_speed(channels)
        acting = np.zeros(replay.rows, LOADS)
        states = self._states(channels, omega)
        _loads_at(
            self._prompt, replay.drive_rows, states, self._rudder(channels), replay.inflow_rows,
            replay.elevation_rows, acting,
        )  # fmt: skip
        acceleration, speed = time_derivative(omega, dt), states["ship_speed"]
        gauge, share = self._meter_torque(channels, omega)
        planar = self._planar_forces(states, acting) if self.turning else {}
        left = float(plant["inertia_engine_side"])
        right = inertia_behind_meter(plant)
        found = []
        for name in self.names:
            if name == "pitch-actuator":
                found.append(channels["pitch_ratio"] - self.nominal["pitch_ratio"])
            elif name == self.prime_mover:
                if self.has_torque:
                    found.append(share * (left * acceleration - acting["drive"]) + gauge)
                else:
                    found.append((left + right) * acceleration + acting["load"] - acting["drive"])
            elif name in ("propeller", "load"):
                found.append(share * (right * acceleration + acting["load"]) - gauge)
            elif name in planar:
                found.append(planar[name])
            elif name == "hull":
                found.append(
                    float(plant["mass"]) * time_derivative(speed, dt)
                    - acting["push"]
                    + acting["drag"]
                )
            elif name == "thrust":
                found.append(channels["thrust_N"] - acting["thrust"])
            elif name == "electric-power":
                taken = acting["electric"]
                # With a prescribed speed the torque is measured, and no propeller model is needed.
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

    def _meter_torque(
        self, channels: Channels, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], Any]:
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

    def _states(self, channels: Channels, omega: NDArray[np.float64]) -> Any:
        """Return the measured states, or nominal ones for channels that are missing, (rows,) STATE."""
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
        """Return the rudder angle [rad]: the measured one, or that of the nominal simulation."""
        return np.ascontiguousarray(channels.get(RUDDER, self.nominal_samples["rudder_angle"]))

    def _run_rate(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the time derivative within each recording, because recordings start independently."""
        dt, segments = self.replay.rate_interval_s, self.replay.segments
        return np.concatenate([time_derivative(values[a:b], dt) for a, b in segments])

    def _planar_forces(self, states: Any, acting: Any) -> Channels:
        """Return the residuals of hull and sway [N] and of yaw [N m], each of shape (rows,)."""
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
            return time_derivative(channels[SHAFT_ANGLE], self.replay.interval_s)
        nominal: NDArray[np.float64] = self.nominal_samples["shaft_speed"]
        return channels.get(SHAFT_SPEED, nominal)

    def residuals_against(self, simulated: Channels) -> NDArray[np.float64]:
        """Return the residuals of the recording minus those of a simulation, (balances, rows)."""
        return self.residuals(self.replay.measured) - self.residuals(simulated)
