"""What a diagnosis means in service: power, fuel and speed of the nominal and the corrected ship.

Both ships are solved for steady states in calm water (:func:`shaftline.plant.equilibrium`) at a range of
drive commands, which gives a curve of power over speed for each. All numbers are read from these curves
at one speed, the service speed. A ship whose hull is fixed, such as a rig, is compared at the median
command of the recording.

The interval of a number moves each estimated parameter to the ends of its own 95 % interval, solves the
corrected ship again, and adds the changes in quadrature, upwards and downwards apart. Parameters count
as independent.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...core.statistics import HALF_95
from ...plant.columns import drive_column
from ...plant.fuel import fuel_rate
from ...plant.ship import Ship, ShipError
from ...plant.steady_state import Equilibrium, equilibrium
from ...plant.surroundings import KNOT
from ..outcome import Outcome
from ..recordings.steady_rows import missing_drive_remark
from .wording import (
    DAY_S,
    channel_name,
    effect_words,
    join_words,
    number,
    value_with_unit,
    values_by_key,
)

Floats = NDArray[np.float64]

SHIP_SPEED = "ship_speed_m_s"
ENGINE_POWER, SHAFT_POWER, FUEL, SHAFT_SPEED = (
    "engine_power_kW",
    "shaft_power_kW",
    "fuel_t_d",
    "shaft_speed_rpm",
)
EQUAL_POWER, EQUAL_COMMAND = "speed_at_equal_power_kn", "speed_at_equal_command_kn"
SHAFT_TORQUE, THRUST = "shaft_torque_N_m", "thrust_N"

METHOD = (
    "each estimated parameter is moved to the ends of its 95 % interval, the steady state is solved "
    "again, and the changes are added in quadrature, as for independent parameters"
)
"""How the intervals are computed, in words."""

LOWEST, HIGHEST = 0.6, 1.3  # range of the curves, in service speeds
UNDER_WAY = 0.5  # share of the highest speed above which the ship counts as under way
_SPEED_BINS = 20  # classes of speed between these two, among which the most frequent one is found
LEAST_EXTRA = 1e-3  # share of the power below which an effect costs none
RPM = 30.0 / math.pi  # of 1 rad/s
JUMP = 0.7  # ratio of the speeds at neighbouring commands below which they are on two branches
_DRIVES = 60  # number of drive commands between standstill and the highest
_STRIDE = 3  # number of drive commands that are skipped above the range of speed
_BAND = 60  # number of speeds of the interval of the power curve
_SAME = 1e-5  # relative difference below which two speeds or powers are equal


class ServiceError(ValueError):
    """A ship that has no steady state at the service speed; the message says which speeds it has."""


@dataclass(frozen=True)
class Quantity:
    """One number of the nominal and of the corrected ship.

    Args:
        words: name in reports.
        unit: unit of all values.
        before: value of the nominal ship.
        after: value of the corrected ship.
        ci95: 95 % interval of the change; None if it is unknown.

    >>> power = Quantity("engine power", "kW", 1300.0, 1430.0, (100.0, 160.0))
    >>> power.change, power.percent(power.change), power.is_sure
    (130.0, 10.0, True)
    """

    words: str
    unit: str
    before: float
    after: float
    ci95: tuple[float, float] | None = None

    @property
    def change(self) -> float:
        """Value of the corrected less that of the nominal ship."""
        return self.after - self.before

    def percent(self, change: float) -> float:
        """Return a change of this quantity in per cent of the nominal ship's value."""
        return 100.0 * change / self.before

    @property
    def differs(self) -> bool:
        """Whether both ships differ by more than the solver's accuracy."""
        return abs(self.change) > _SAME * abs(self.before)

    @property
    def is_sure(self) -> bool:
        """Whether the change differs from 0: the interval, where there is one, excludes 0."""
        return self.differs and (self.ci95 is None or self.ci95[0] * self.ci95[1] > 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the values for ``report.json``."""
        end = None if self.ci95 is None else list(self.ci95)
        return {"before": self.before, "after": self.after, "change": self.change, "ci95": end}


@dataclass(frozen=True)
class Service:
    """Both ships at service speed.

    Args:
        condition: condition of the comparison, as a sentence.
        speed_m_s: service speed through the water [m/s]; None for a fixed hull.
        quantities: the numbers by their names in ``report.json``.
        curves: steady states of the nominal and the corrected ship over speed; None for a fixed hull.
        band: speeds [m/s], and lowest and highest engine power [W] of the corrected ship by the 95 %
            intervals; None without intervals.
        hidden: where nothing is missing, the smallest effects that would have been detected, with the
            engine power [kW] that they would cost.
        note: why there are no numbers, or none with an interval; else empty.
    """

    condition: str = ""
    speed_m_s: float | None = None
    quantities: dict[str, Quantity] = field(default_factory=dict)
    curves: tuple[SteadyCurve, SteadyCurve] | None = None
    band: tuple[Floats, Floats, Floats] | None = None
    hidden: list[tuple[str, float]] = field(default_factory=list)
    note: str = ""

    @property
    def changes(self) -> bool:
        """Whether any number of the corrected ship differs from that of the nominal ship."""
        return any(quantity.is_sure for quantity in self.quantities.values())

    def sure(self, name: str) -> Quantity | None:
        """Return a quantity if its change differs from 0, else None."""
        quantity = self.quantities.get(name)
        return quantity if quantity is not None and quantity.is_sure else None


class SteadyCurve(NamedTuple):
    """Steady states of a ship at one pitch over rising speed, each of shape (points,)."""

    speed: Floats  # through the water [m/s]
    power: Floats  # of all engines or motors [W]
    shaft_power: Floats  # of all shafts, at the torque meters [W]
    fuel: Floats  # of all engines [kg/s]; 0 without a fuel model
    shaft_speed: Floats  # [rad/s]
    drive: Floats  # command of the prime mover, in its unit

    def at(self, name: str, speed: float) -> float:
        """Return a column at a speed [m/s]; NaN outside the curve."""
        return _power_law(self.speed, getattr(self, name), speed)

    def speed_at(self, name: str, value: float) -> float:
        """Return the speed [m/s] at which a column has a value; NaN outside the curve."""
        column = getattr(self, name)
        return _power_law(column, self.speed, value) if np.all(np.diff(column) > 0.0) else math.nan


def _power_law(x: Floats, y: Floats, at: float) -> float:
    """Return y at a position, by a monotone cubic of the logarithms; NaN outside the points."""
    if not (x[0] <= at <= x[-1] and np.all(y > 0.0)):
        return math.nan
    return float(np.exp(scipy.interpolate.PchipInterpolator(np.log(x), np.log(y))(math.log(at))))


@functools.lru_cache(maxsize=64)
def steady_curve(
    ship: Ship,
    pitch_ratio: float,
    signals: tuple[tuple[str, float], ...],
    lowest: float,
    highest: float,
) -> SteadyCurve:
    """Return the steady states of a ship between two speeds, and one point beyond either.

    Args:
        ship: ship whose hull moves.
        pitch_ratio: commanded P/D [-].
        signals: name and value of external signals; those that no term of the ship uses are ignored.
        lowest: speed through the water [m/s].
        highest: likewise [m/s].

    Raises:
        ServiceError: there are fewer than three steady states.

    >>> from shaftline.plant import load_ship
    >>> curve = steady_curve(load_ship("frigate"), 1.4, (), lowest=5.0, highest=10.0)
    >>> round(curve.at("power", 8.0) / 1e3)  # [kW], two engines
    2466
    """
    own = {name: value for name, value in signals if name in ship.external_signals}
    rows: list[tuple[float, ...]] = []
    missing, enough = 0, math.sqrt(lowest * highest)
    # From the top, because a slow shaft may have no steady state. Of commands with the same speed (the
    # engine is at its limit) the lowest is kept. A slow shaft may also have a second, unstable steady
    # state at the same command: a jump of the speed shows it.
    drives = np.linspace(float(ship.record()["drive_max"]), 0.0, _DRIVES + 1)[:-1].tolist()
    while drives and not (missing > 1 and rows and rows[-1][0] < enough):
        drive, missing = drives.pop(0), missing + 1
        try:
            row = _point(ship, equilibrium(ship, drive, pitch_ratio, signals=own))
        except ValueError:
            continue
        if rows and row[0] < JUMP * rows[-1][0]:
            continue
        if min(row[:3]) <= 0.0:  # at rest, or a ship on which the engine need not drive
            break
        missing = 0
        if rows and (row[0] >= rows[-1][0] * (1.0 - _SAME) or row[0] > highest):
            rows.pop()
        rows.append(row)
        if row[0] > highest:  # Far above the range wide steps are enough.
            del drives[:_STRIDE]
        if row[0] < lowest:
            break
    if len(rows) < 3:
        raise ServiceError(f"{ship.name} has no steady states with the shaft turning ahead")
    return SteadyCurve(*np.array(rows[::-1]).T)


def _point(ship: Ship, point: Equilibrium) -> tuple[float, ...]:
    """Return a row of :class:`SteadyCurve`."""
    plant, (state, outputs, inputs) = ship.record(), point
    shafts, engine_speed = (
        float(plant["propellers"]),
        float(plant["gear_ratio"]) * state.shaft_speed,
    )
    brake = float(outputs.brake_torque)
    return (
        float(state.ship_speed) - ship.hull.current_m_s,
        shafts * brake * engine_speed,
        shafts * float(outputs.shaft_power),
        shafts * float(fuel_rate(plant, engine_speed, brake)),
        float(state.shaft_speed),
        float(inputs.drive),
    )


def most_frequent_speed(speed: Floats) -> tuple[float, NDArray[np.bool_]]:
    """Return the most frequent speed under way and the rows at which the ship has it.

    Args:
        speed: measured speed [m/s], shape (rows,).

    >>> speed, rows = most_frequent_speed(np.array([0.0, 0.0, 0.0, 5.0, 8.0, 8.1, 10.0]))
    >>> round(speed, 2), rows.tolist()
    (8.05, [False, False, False, False, True, True, False])
    """
    top = float(np.quantile(speed, 0.99))
    edges = np.linspace(UNDER_WAY * top, max(float(speed.max()), top), _SPEED_BINS + 1)
    counts, _ = np.histogram(speed, edges)
    fullest = int(np.argmax(counts))
    rows = (speed >= edges[fullest]) & (speed <= edges[fullest + 1])
    return float(np.median(speed[rows])), rows


def service_of(diagnosis: Outcome, undecided: bool = False) -> Service:
    """Return both ships of a diagnosis at service speed, or a note on why they cannot be compared.

    Args:
        diagnosis: the diagnosis.
        undecided: whether the recording does not allow a verdict.
    """
    if undecided:
        return Service(note="the recording does not decide what is missing")
    if diagnosis.findings and diagnosis.corrected == diagnosis.ship:
        return Service(
            note="the corrected ship is the nominal ship, because the ship with the identified effects "
            "does not fit better in open loop"
        )
    try:
        return _at_speed(diagnosis) if diagnosis.ship.moves else _at_command(diagnosis)
    except (ValueError, ShipError) as error:
        return Service(note=str(error))


def _median(diagnosis: Outcome, name: str, rows: Any, default: float) -> float:
    values = diagnosis.inputs.get(name)
    return default if values is None else float(np.median(values[rows]))


class _Inputs(NamedTuple):
    """Constant inputs of the steady states beside the drive command."""

    pitch_ratio: float  # commanded P/D [-]
    signals: tuple[tuple[str, float], ...]  # external signals by name
    words: list[str]  # of the inputs that a user may have chosen


def _inputs(diagnosis: Outcome, rows: Any) -> _Inputs:
    """Return the medians of pitch command and external signals in some rows."""
    ship, corrected = diagnosis.ship, diagnosis.corrected
    pitch, words = ship.propeller.pitch_ratio_max, []
    if ship.has_variable_pitch:
        pitch = _median(diagnosis, "pitch_ratio_command", rows, pitch)
        words.append(f"pitch ratio {number(pitch)}")
    units = {**ship.signals, **corrected.signals}
    names = sorted({*ship.external_signals, *corrected.external_signals})
    signals = tuple((name, _median(diagnosis, name, rows, 0.0)) for name in names)
    words += [f"{n.replace('_', ' ')} {value_with_unit(value, units[n])}" for n, value in signals]
    return _Inputs(pitch, signals, words)


Solved = TypeVar("Solved")


@dataclass(frozen=True)
class _Comparison(Generic[Solved]):
    """Steady states of the nominal ship, the corrected ship, and the ships at the intervals' ends."""

    nominal: Solved
    corrected: Solved
    ends: list[tuple[Solved, Solved]]
    note: str  # why there are no intervals; else empty

    @classmethod
    def of(cls, diagnosis: Outcome, solve: Callable[[Ship], Solved]) -> _Comparison[Solved]:
        """Solve all ships of a diagnosis."""
        ships, ends, note = (diagnosis.ship, diagnosis.corrected), [], ""
        nominal, corrected = map(solve, ships)
        try:
            if ships[0] != ships[1]:
                ends = [(solve(low), solve(high)) for low, high in interval_ships(diagnosis)]
        except (ValueError, ShipError) as error:
            note = f"no intervals: {error}"
        return cls(nominal, corrected, ends, note)

    def quantities(
        self, words_of: Mapping[str, tuple[str, str]], values: Callable[[Solved], dict[str, float]]
    ) -> dict[str, Quantity]:
        """Return the quantities that all ships have, with intervals if there are any."""
        before, after = values(self.nominal), values(self.corrected)
        ends = [(values(low), values(high)) for low, high in self.ends]
        found = {}
        for name, (words, unit) in words_of.items():
            if not all(math.isfinite(made.get(name, math.nan)) for made in (before, after)):
                continue
            interval = None
            changes = np.array([[pair[0][name], pair[1][name]] for pair in ends]) - after[name]
            if ends and np.isfinite(changes).all():
                down, up = (float(side) for side in add_in_quadrature(changes))
                change = after[name] - before[name]
                interval = change - down, change + up
            found[name] = Quantity(words, unit, before[name], after[name], interval)
        return found


def add_in_quadrature(changes: Floats) -> tuple[Floats, Floats]:
    """Return the total downward and upward change, each as a positive number.

    Args:
        changes: change with each parameter at either end of its interval, shape (parameters, 2, ...).

    >>> [float(x) for x in add_in_quadrature(np.array([[-3.0, 1.0], [2.0, -4.0]]))]
    [5.0, 2.23606797749979]
    """
    down = np.minimum(changes.min(axis=1), 0.0)
    up = np.maximum(changes.max(axis=1), 0.0)
    return np.sqrt(np.sum(down**2, axis=0)), np.sqrt(np.sum(up**2, axis=0))


def _at_speed(diagnosis: Outcome) -> Service:
    """Return both ships at the same speed through calm water."""
    ship = diagnosis.ship
    measured = diagnosis.measured.get(SHIP_SPEED)
    if measured is not None and float(measured.max()) > 0.0:
        speed, rows = most_frequent_speed(measured)
        pitch, signals, words = _inputs(diagnosis, rows)
        source = "the most frequent speed of the recording"
    else:
        pitch, signals, words = _inputs(diagnosis, slice(None))
        own = {name: value for name, value in signals if name in ship.external_signals}
        drive = float(np.median(diagnosis.drive))
        speed = _point(ship, equilibrium(ship, drive, pitch, signals=own))[0]
        source = "the speed by the ship file at the median command, because no speed was recorded"
    compared = _Comparison.of(
        diagnosis, lambda s: steady_curve(s, pitch, signals, LOWEST * speed, HIGHEST * speed)
    )
    nominal, corrected = compared.nominal, compared.corrected
    for which, curve in (("uncorrected ship", nominal), ("corrected ship", corrected)):
        if not curve.speed[0] <= speed <= curve.speed[-1]:
            low, high, own_speed = (
                number(v / KNOT) for v in (curve.speed[0], curve.speed[-1], speed)
            )
            raise ServiceError(
                f"the {which} has steady speeds from {low} to {high} kn only, not {own_speed} kn, "
                f"{source}"
            )
    power, drive = nominal.at("power", speed), nominal.at("drive", speed)
    command, name = drive_column(ship), command_words(ship)

    def values(curve: SteadyCurve) -> dict[str, float]:
        return {
            ENGINE_POWER: 1e-3 * curve.at("power", speed),
            SHAFT_POWER: 1e-3 * curve.at("shaft_power", speed),
            FUEL: 1e-3 * DAY_S * curve.at("fuel", speed),
            SHAFT_SPEED: RPM * curve.at("shaft_speed", speed),
            command: curve.at("drive", speed),
            EQUAL_POWER: curve.speed_at("power", power) / KNOT,
            EQUAL_COMMAND: curve.speed_at("drive", drive) / KNOT,
        }

    mover = "engine" if ship.has_diesel else "drive"
    words_of = {
        ENGINE_POWER: (f"{mover} power", "kW"),
        SHAFT_POWER: ("shaft power", "kW"),
        FUEL: ("fuel", "t/d"),
        SHAFT_SPEED: ("shaft speed", "rpm"),
        command: (name, channel_name(command)[1]),
        EQUAL_POWER: (f"speed at equal {mover} power", "kn"),
        EQUAL_COMMAND: (f"speed at equal {name}", "kn"),
    }
    if not ship.turns_freely:  # The command is the shaft speed.
        del words_of[command]
    beside = f", with {join_words(words)}" if words else ""
    return Service(
        f"Steady in calm water at {number(speed / KNOT)} kn ({number(speed)} m/s), {source}{beside}.",
        speed,
        compared.quantities(words_of, values),
        (nominal, corrected),
        _band(compared),
        list(_hidden(diagnosis, pitch, signals, speed)) if corrected is nominal else [],
        compared.note,
    )


def command_words(ship: Ship) -> str:
    """Return the name of the drive command, such as ``fuel rack``."""
    return channel_name(drive_column(ship))[0].removesuffix(" demand")


def _band(compared: _Comparison[SteadyCurve]) -> tuple[Floats, Floats, Floats] | None:
    """Return speeds [m/s] and the 95 % interval of the corrected ship's power [W]; None if unknown."""
    if not compared.ends:
        return None
    curves = [compared.corrected, *itertools.chain.from_iterable(compared.ends)]
    slowest, fastest = max(c.speed[0] for c in curves), min(c.speed[-1] for c in curves)
    speed = np.linspace(slowest, fastest, _BAND)[1:-1]

    def power(curve: SteadyCurve) -> Floats:
        return np.array([curve.at("power", v) for v in speed])

    middle = power(compared.corrected)
    changes = np.array([[power(curve) for curve in pair] for pair in compared.ends]) - middle
    down, up = add_in_quadrature(changes)
    return speed, middle - down, middle + up


def _at_command(diagnosis: Outcome) -> Service:
    """Return both ships with a fixed hull at the median command of the recording."""
    ship, command = diagnosis.ship, drive_column(diagnosis.ship)
    if missing_drive_remark(ship) in diagnosis.warnings:
        raise ServiceError(f"the recording has no {command} at which to compare the ships")
    ahead = diagnosis.drive > 0.0
    if not ahead.any():
        raise ServiceError(f"{command} is never above 0, so no steady state ahead was recorded")
    drive = float(np.median(diagnosis.drive[ahead]))
    pitch, signals, words = _inputs(diagnosis, ahead)
    if inflow := _median(diagnosis, "inflow", ahead, 0.0):
        words.append(f"an inflow of {number(inflow)} m/s")

    def values(made: Ship) -> dict[str, float]:
        own = {name: value for name, value in signals if name in made.external_signals}
        point = equilibrium(made, drive, pitch, inflow=inflow, signals=own)
        found = {
            SHAFT_SPEED: RPM * float(point.state.shaft_speed),
            SHAFT_TORQUE: float(point.outputs.shaft_torque),
            ENGINE_POWER: 1e-3 * _point(made, point)[1],
            THRUST: float(point.outputs.thrust),
        }
        return {name: value for name, value in found.items() if value != 0.0}

    words_of = {
        SHAFT_SPEED: ("shaft speed", "rpm"),
        SHAFT_TORQUE: ("shaft torque", "N m"),
        ENGINE_POWER: ("engine power" if ship.has_diesel else "drive power", "kW"),
        THRUST: ("thrust", "N"),
    }
    unit = channel_name(command)[1]
    compared = _Comparison.of(diagnosis, values)
    beside = f", with {join_words(words)}" if words else ""
    return Service(
        f"Steady at {number(drive)} {unit}, the median {command_words(ship)} of the recording{beside}. "
        "The hull is fixed, so the ship has no speed.",
        None,
        compared.quantities(words_of, dict),
        note=compared.note,
    )


def interval_ships(diagnosis: Outcome) -> Iterator[tuple[Ship, Ship]]:
    """Yield the corrected ship with each estimated parameter at either end of its 95 % interval.

    Raises:
        ServiceError: a size has no interval.
        ShipError: the ship file does not allow an end.
    """
    ship, corrected = diagnosis.ship, diagnosis.corrected
    intervals: dict[str, tuple[float, float]] = {}
    ties: list[tuple[str, str, float]] = []
    for finding in diagnosis.findings:
        if finding.unmeasured:
            raise ServiceError(f"the size of {finding.effect.id} is not measured")
        intervals |= {e.key: e.ci95 for e in finding.estimates}
        ties += finding.effect.ties
    new = {term.id for term in corrected.term} - {term.id for term in ship.term}
    new -= {f.effect.term.id for f in diagnosis.findings if f.effect.term is not None}
    formula = diagnosis.formula
    if formula is not None and formula.term.id in new:
        intervals |= {f"term.{formula.term.id}.{e.name}": e.ci95 for e in formula.estimates}
        new.discard(formula.term.id)
    if new:
        raise ServiceError("the shape of the residual has none")
    errors = {n.key: n.standard_error for n in diagnosis.parameters}
    set_by_effects = {key for finding in diagnosis.findings for key, *_ in finding.effect.fixed}
    set_by_effects |= {key for key, *_ in ties}
    for key, (old, now) in changed_numbers(ship, corrected).items():
        of_effect = key in set_by_effects or key.startswith(("hull.episode_", "integration."))
        if key not in intervals and not of_effect:
            # A small change inside the tolerance has no error of its own and may as well be absent.
            error = errors.get(key, math.nan)
            half = HALF_95 * (error if math.isfinite(error) else abs(now - old))
            intervals[key] = now - half, now + half
    for key, ends in intervals.items():
        if not corrected.has_key(key):
            continue
        if not all(map(math.isfinite, ends)):
            raise ServiceError(f"that of {key} has no end")
        low, high = corrected.parameter(key).search_range
        one, two = (
            corrected.with_values(_with_ties(key, min(max(end, low), high), ties)) for end in ends
        )
        yield one, two


def changed_numbers(ship: Ship, corrected: Ship) -> dict[str, tuple[float, float]]:
    """Return the parameters of a ship that its correction changes: old and new value by dotted key."""
    old, new = values_by_key(ship), values_by_key(corrected)
    changed = [key for key, value in new.items() if value != old.get(key, value)]
    return {
        key: (ship.parameter(key).value, corrected.parameter(key).value)
        for key in changed
        if ship.has_key(key) and corrected.has_key(key)
    }


def _hidden(
    diagnosis: Outcome, pitch_ratio: float, signals: tuple[tuple[str, float], ...], speed: float
) -> Iterator[tuple[str, float]]:
    """Yield the smallest detectable effects of hull and propeller that cost power, with it [kW]."""
    ship = diagnosis.ship

    def power(made: Ship) -> float:
        curve = steady_curve(made, pitch_ratio, signals, LOWEST * speed, HIGHEST * speed)
        return 1e-3 * curve.at("power", speed)

    for item in diagnosis.detectable:
        effect, key = item.effect, item.effect.parameters[0].key
        if effect.balance not in ("hull", "propeller") or effect.fixed or not ship.has_key(key):
            continue
        try:
            size = ship.parameter(key).value + item.value
            extra = power(ship.with_values(_with_ties(key, size, effect.ties))) - power(ship)
        except (ValueError, ShipError):
            continue
        if extra > LEAST_EXTRA * power(ship):
            yield effect_words(effect), extra


def _with_ties(key: str, value: float, ties: Iterable[tuple[str, str, float]]) -> dict[str, float]:
    """Return a value by its key, and the values of the keys that are tied to it."""
    return {key: value} | {tied: factor * value for tied, of, factor in ties if of == key}
