"""The ship: all sections of a ship file together, their validation, and the record for the kernels.

:class:`Ship` holds the sections and the properties that follow from them. The functions ``check_...``
verify conditions between sections. Every error message names the file, the key, its unit and its allowed
range.
"""

from __future__ import annotations

import difflib
import functools
import math
from collections.abc import Container, Mapping
from typing import Annotated, Any, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, model_validator

from ..core.models import short
from .actuators import PitchActuator
from .cavitation import CavitationBucket
from .combinator_table import CombinatorTable
from .drives import Diesel, Drive
from .emissions import Emissions
from .expressions import FUNCTIONS, MAX_SIGNALS, MAX_TERMS
from .hull import Hull
from .keys import (
    MISSING_PROPERTIES,
    KeyInfo,
    Label,
    Line,
    MissingKeyError,
    Section,
    ShipParameter,
    declared,
    info_of,
    place_of,
    require,
    unit_and_range,
)
from .manoeuvring import WITH as MANOEUVRING
from .manoeuvring import Manoeuvring, planar_inertia
from .memory import HISTORY, Sensors
from .propeller import Propeller
from .record import PLANT, record_of
from .roll import WITH as ROLLING
from .roll import Roll
from .rudder import Rudder
from .shaft import UNLESS_HELD, Transmission
from .surroundings import THINNEST_LIQUID, WATER, Integration, Water
from .terms import TERM_SIGNALS, TURNING_SIGNALS, Name, Term
from .time_constants import check_time_constants, resolved_range, resolved_term_range
from .tolerances import Tolerances
from .ventilation import Ventilation
from .wind import Superstructure

Model = TypeVar("Model", bound=BaseModel)


class ShipError(ValueError):
    """A ship file that cannot be used; the message names file, key, unit and allowed range."""


def union_members(annotation: Any) -> tuple[Any, ...]:
    """Return the members of a union type, or the one type itself."""
    return get_args(annotation) or (annotation,)


def type_tag(section: type[BaseModel]) -> str:
    """Return the ``type`` of a section that has several kinds, such as ``diesel``."""
    return str(get_args(section.model_fields["type"].annotation)[0])


def validate_tables(model: type[Model], tree: dict[str, Any], source: str) -> Model:
    """Return a validated ship from its tables; a ShipError names the source and every error."""
    try:
        return model.model_validate(tree)
    except ValidationError as error:
        lines = [f"{source}: {_error_line(model, dict(item))}" for item in error.errors()]
        raise ShipError("\n".join(lines)) from None


def _error_line(model: type[BaseModel], item: dict[str, Any]) -> str:
    """Return a pydantic error as a sentence with key, unit, given value and allowed range."""
    tags = {type_tag(kind) for kind in union_members(model.model_fields["prime_mover"].annotation)}
    path = [str(part) for k, part in enumerate(item["loc"]) if k == 0 or part not in tags]
    key = ".".join(path) or "ship"
    allowed, kind = "", item["type"]
    for section in _kinds(model, path[0]) if path else ():  # Two sections may have the same key.
        if path[-1] in getattr(section, "model_fields", {}):
            allowed = unit_and_range(section.model_fields[path[-1]])
            break
    if kind.startswith("union_tag"):
        given = item["ctx"].get("tag")
        what = "is missing" if given is None else f"= {given!r} is unknown"
        return f"{key}.type {what} (allowed: {', '.join(sorted(tags))})"
    if kind == "missing":
        return f"{key} is missing{allowed}"
    if kind == "extra_forbidden" and "." in path[-1]:
        table, _, name = path[-1].rpartition(".")
        return f'"{path[-1]}" is in quotes and thus one name; write {name} under [{table}]'
    if kind == "extra_forbidden":
        return f"{key} is not a known key{_suggestion(model, key)}"
    if kind == "value_error":
        error = item["ctx"]["error"]
        joint = "." if isinstance(error, MissingKeyError) else ": "
        return f"{key}{joint}{error}" if path else str(error)
    return f"{key} = {short(item.get('input'))}: {item['msg'].lower()}{allowed}"


def _kinds(model: type[BaseModel], section: str) -> tuple[Any, ...]:
    """Return the kinds of a section; none if it is unknown."""
    table = model.model_fields.get(section)
    return union_members(table.annotation) if table else ()


def _suggestion(model: type[BaseModel], key: str) -> str:
    """Return the known key that is most similar to an unknown one, as the end of a message."""
    section, _, name = key.rpartition(".")
    kinds = _kinds(model, section) or (model,)
    known = [k for kind in kinds for k in getattr(kind, "model_fields", {})]
    if name in known:
        return f"; it belongs to another type of {section}"
    similar = difflib.get_close_matches(name, known, n=1)
    if similar:
        return f"; did you mean {key.removesuffix(name)}{similar[0]}?"
    return "; `shaftline list --markdown FILE` lists the known keys"


def check_terms(ship: Ship) -> None:
    """Refuse terms that use a signal or a location which the ship does not have, with a ValueError."""
    ids = [term.id for term in ship.term]
    if twice := [name for name in ids if ids.count(name) > 1]:
        raise ValueError(f"term {twice[0]!r} is defined twice; give each term an id of its own")
    own = [name for name in TERM_SIGNALS if ship.turns or name not in TURNING_SIGNALS]
    for name in ship.signals:
        if name in own or name in FUNCTIONS:
            raise ValueError(
                f"signals.{name}: this name is already a signal or a function; choose another name"
            )
    for term in ship.term:
        if unknown := [name for name in ship.external_signals_of(term) if name not in ship.signals]:
            known = [*own, *term.parameters, *ship.signals]
            raise ValueError(
                f"term {term.id!r}: {unknown[0]!r} is unknown; known: {', '.join(known)}; declare a "
                "signal from outside the ship, with its unit, under [signals]"
            )
        for acts, places, kind in (
            (ship.turns_freely, ("drive", "drive_torque"), "a shaft whose speed is held"),
            (ship.turns, ("side_force", "yaw_moment"), "a ship without a manoeuvring.length_m"),
        ):
            for where in (place for place, _ in term.expressions if place in places and not acts):
                raise ValueError(
                    f"term {term.id!r} has no effect: acts_on = {where!r} on {kind}; remove the term"
                )


def check_fluid(ship: Ship) -> None:
    """Refuse effects of water or of a free surface in another fluid; a ValueError names the remedy."""
    density = f"water.density_kg_m3 = {ship.water.density_kg_m3:g} kg/m3"
    if not ship.in_liquid and ship.moves:
        raise ValueError(
            f"{density} is a gas, in which no hull floats (water has about 1000 kg/m3). For a propeller "
            "in air set hull.fixed = true and give the airspeed as inflow_velocity_m_s"
        )
    air = ship.ventilation
    if not ship.in_liquid and any((air.thrust_loss, air.torque_loss, air.surface_loss)):
        raise ValueError(
            f"ventilation draws air into a liquid, but {density} is a gas: remove [ventilation]"
        )
    bucket = bool(ship.cavitation_bucket.model_fields_set)
    if not ship.in_water and (bucket or ship.propeller.cavitation_breakdown):
        key = "[cavitation_bucket]" if bucket else "propeller.cavitation_breakdown"
        raise ValueError(
            f"cavitation depends on the vapour pressure of water, but {density} is another fluid "
            f"(water: {WATER[0]:g} to {WATER[1]:g} kg/m3): remove {key}"
        )


def refuse_sea(ship: Ship, sea: Any) -> None:
    """Refuse a sea (a SEA record; None is calm water) that cannot act on a ship, with a ValueError."""
    if sea is None:
        return
    refuse_wind(ship, float(sea["wind"]))
    if not ship.in_liquid:
        raise ValueError(
            f"{ship.name}: waves require a liquid, but water.density_kg_m3 = "
            f"{ship.water.density_kg_m3:g} kg/m3 is a gas: simulate without a sea"
        )


def refuse_wind(ship: Ship, wind_m_s: float) -> None:
    """Refuse a wind [m/s] that does not act on a ship, with a ValueError."""
    if wind_m_s > 0.0 and not ship.superstructure.present:
        raise ValueError(
            f"{ship.name}: a wind of {wind_m_s:g} m/s has no effect on a ship without a "
            "[superstructure]; add this table to the ship file, or leave the wind out"
        )


def check_turning(ship: Ship) -> None:
    """Refuse inconsistent rudder, hull, mass or inertia in sway and yaw; a ValueError names the key."""
    if ship.rudder.area_m2 > 0.0 and not ship.turns:
        raise ValueError(
            "rudder.area_m2 has no effect without a manoeuvring.length_m: give the [manoeuvring] section"
        )
    if ship.roll.metacentric_height_m > 0.0 and not ship.turns:
        raise ValueError(
            "roll.metacentric_height_m has no effect without a manoeuvring.length_m: give the "
            "[manoeuvring] section"
        )
    if not ship.turns:
        return
    if ship.rolls and ship.rudder.area_m2 > 0.0:
        require(ship.roll, ("rudder_force_depth_m",), f"{ROLLING} and a rudder", "roll.")
    if not ship.moves:
        raise ValueError(
            "manoeuvring.length_m requires a hull that moves: remove hull.fixed = true"
        )
    require(ship.water, ("density_kg_m3",), MANOEUVRING, "water.")
    if ship.hull.mass_kg < ship.manoeuvring.displacement_kg:
        raise ValueError(
            f"hull.mass_kg = {ship.hull.mass_kg:g} kg includes the added mass, so it must not be less "
            f"than manoeuvring.displacement_kg = {ship.manoeuvring.displacement_kg:g} kg"
        )
    plant = np.zeros(1, PLANT)[0]
    for section in (ship.water, ship.hull, ship.manoeuvring):
        section.fill(plant)
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(plant)
    if not sway * yaw > sway_yaw * yaw_sway:
        raise ValueError(
            "manoeuvring: the inertia matrix of sway and yaw is not positive definite: Y_rdot and "
            "N_vdot (with centre_of_gravity_m) are too large compared with Y_vdot and N_rdot"
        )


def check_combinator(ship: Ship) -> None:
    """Refuse a combinator table that does not suit the ship; a ValueError names column and row."""
    if not ship.combinator.present:
        return
    if not (ship.has_diesel and ship.has_propeller):
        raise ValueError(
            "combinator: the table needs a ship with a diesel and a propeller; remove it"
        )
    screw = ship.propeller
    try:
        ship.combinator.check(ship.shaft_speeds, (screw.pitch_ratio_min, screw.pitch_ratio_max))
    except ValueError as error:
        raise ValueError(f"combinator: {error}") from None


def check_emissions(ship: Ship) -> None:
    """Refuse emissions that lack a diesel, its reference power or a fuel model, with a ValueError."""
    if not ship.emissions.model_fields_set:
        return
    if not isinstance(ship.prime_mover, Diesel):
        raise ValueError("emissions: the section needs a diesel; remove it")
    if ship.emissions.nox_base_g_kWh > 0.0:
        because = "with an emissions.nox_base_g_kWh"
        require(ship.prime_mover, ("fuel_rated_power_W",), because, "prime_mover.")
    try:
        ship.emissions.check(ship.prime_mover.fuel_base_g_kWh)
    except ValueError as error:
        raise ValueError(f"emissions: {error}") from None


class Ship(Section):
    """A ship: all parameters that the plant needs, immutable.

    :func:`load_ship` returns one, :meth:`with_values` returns a copy with other values, and
    :meth:`record` returns the record for the kernels.

    >>> from shaftline.plant import load_ship
    >>> ship = load_ship("frigate")
    >>> ship.propeller.diameter_m, ship.has_diesel, ship.turns
    (4.2, True, False)
    >>> heavier = ship.with_values({"hull.mass_kg": 4e6})
    >>> heavier.parameter("hull.mass_kg").value
    4000000.0
    """

    name: Label
    description: Line = ""
    water: Water = Water()
    hull: Hull
    superstructure: Superstructure = Superstructure()
    manoeuvring: Manoeuvring = Manoeuvring()
    rudder: Rudder = Rudder()
    roll: Roll = Roll()
    propeller: Propeller
    ventilation: Ventilation = Ventilation()
    cavitation_bucket: CavitationBucket = CavitationBucket()
    prime_mover: Annotated[Drive, Field(discriminator="type")]
    emissions: Emissions = Emissions()
    transmission: Transmission = Transmission()
    pitch_actuator: PitchActuator = PitchActuator()
    combinator: CombinatorTable = CombinatorTable()
    sensors: Sensors = Sensors()
    integration: Integration = Integration()
    tolerances: Tolerances = Tolerances()
    signals: dict[Name, str] = Field(
        default={},
        max_length=MAX_SIGNALS,
        description="external signals that terms use, each with its unit",
    )
    term: Annotated[tuple[Term, ...], Field(strict=False, max_length=MAX_TERMS)] = ()

    def __hash__(self) -> int:
        """Return a hash of the content, so that ships can be cached by it."""
        own = {name: getattr(self, name) for name in type(self).model_fields}
        return hash((*(own | {"signals": None}).values(), *sorted(self.signals.items())))

    @model_validator(mode="after")
    def _consistent(self) -> Ship:
        step = self.integration.time_step_s
        longest = step * (HISTORY - 2)
        for key, delay in (self.sensors.delays | self.prime_mover.delays).items():
            if delay > longest:
                raise ValueError(
                    f"{key} = {delay} s exceeds {longest:.4g} s, the longest delay that a time step of "
                    f"{step} s allows; give a shorter delay or a longer integration.time_step_s"
                )
        check_terms(self)
        check_fluid(self)
        for key in self.tolerances.numbers:
            self.parameter(key)
        if self.has_propeller:
            require(self.water, ("density_kg_m3",), "with a propeller", "water.")
        if self.turns_freely:
            fields = Transmission.model_fields.items()
            keys = tuple(k for k, info in fields if declared(info, "required") == UNLESS_HELD)
            require(self.transmission, keys, UNLESS_HELD, "transmission.")
        check_turning(self)
        check_combinator(self)
        check_emissions(self)
        check_time_constants(self)
        return self

    @property
    def time_step_s(self) -> float:
        """Time step of the integration [s]."""
        return self.integration.time_step_s

    def with_values(self, values: dict[str, Any]) -> Ship:
        """Return a copy with other values, by dotted key, validated like a file.

        Raises:
            ShipError: unknown key, or value out of range.
        """
        tree = self.model_dump(exclude_unset=True)
        for dotted, value in values.items():
            *path, key = dotted.split(".")
            section = tree
            if path[:1] == ["term"]:
                self.parameter(dotted)  # raises an error if the key is unknown
                own: Any = next(term for term in tree["term"] if term["id"] == path[1])
                section, path, key = own["parameters"], [key], "value"
            for part in path:
                section = section.setdefault(part, {})
                if not isinstance(section, dict):
                    raise ShipError(
                        f"{self.name}: {dotted!r} is not a known key: {part!r} is no section"
                    )
            section[key] = value
        return validate_tables(type(self), tree, self.name)

    def record(self) -> Any:
        """Return the kernels' record of this ship: one element of dtype ``PLANT``, a copy to change."""
        return _record(self).copy()

    @property
    def has_diesel(self) -> bool:
        """Whether the prime mover is a diesel engine."""
        return isinstance(self.prime_mover, Diesel)

    @property
    def has_voltage(self) -> bool:
        """Whether the prime mover is a motor that is commanded by a voltage."""
        return self.prime_mover.demand.unit == "V"

    @property
    def has_propeller(self) -> bool:
        """Whether the shaft turns a propeller."""
        return self.propeller.model != "none"

    @property
    def meets_water(self) -> bool:
        """Whether water acts on the ship: on its propeller, or on a hull that moves."""
        return self.has_propeller or self.moves

    @property
    def has_constant_coefficients(self) -> bool:
        """Whether KT and KQ of the propeller are constants, as at bollard pull."""
        return self.propeller.model == "bollard"

    @property
    def turns_freely(self) -> bool:
        """Whether the shaft speed follows from the torques; False if the drive holds the speed."""
        return not self.prime_mover.holds_speed

    @property
    def reverses(self) -> bool:
        """Whether the shaft can turn astern; the shaft of a diesel cannot."""
        return not self.has_diesel

    @property
    def has_line_shaft(self) -> bool:
        """Whether friction behind the torque meter is identifiable apart from a drive's: on no motor."""
        return self.drive_balance != "motor"

    @property
    def has_variable_pitch(self) -> bool:
        """Whether the pitch of the blades can change."""
        return self.propeller.pitch_ratio_min < self.propeller.pitch_ratio_max

    @property
    def turns(self) -> bool:
        """Whether sway and yaw are simulated."""
        return self.manoeuvring.length_m > 0.0

    @property
    def rolls(self) -> bool:
        """Whether the roll of the ship is simulated."""
        return self.turns and self.roll.metacentric_height_m > 0.0

    @property
    def moves(self) -> bool:
        """Whether the hull is free to move in surge."""
        return not self.hull.fixed

    @property
    def in_liquid(self) -> bool:
        """Whether the fluid is a liquid, which has a free surface and carries a hull."""
        return self.water.density_kg_m3 >= THINNEST_LIQUID

    @property
    def in_water(self) -> bool:
        """Whether the fluid is water, whose vapour pressure is known."""
        return WATER[0] <= self.water.density_kg_m3 <= WATER[1]

    @property
    def drive_balance(self) -> str:
        """Balance of the prime mover: ``engine`` or ``motor``; empty if the drive holds the speed."""
        return self.prime_mover.balance

    @property
    def balances(self) -> tuple[str, ...]:
        """Balances in which an effect on this ship may act."""
        own = [self.drive_balance] if self.drive_balance else []
        own += ["propeller", "sensor"] if self.has_propeller else ["sensor"]
        own += ["hull", *(("sway", "yaw") if self.turns else ())] if self.moves else []
        return (*own, "pitch-actuator") if self.has_variable_pitch else tuple(own)

    @property
    def shaft_speeds(self) -> tuple[float, float]:
        """Lowest and highest speed of a diesel's shaft [rad/s]; another drive raises a ShipError."""
        mover = self.diesel
        scale = math.pi / 30.0 / self.transmission.gear_ratio
        return mover.speed_min_rpm * scale, mover.speed_max_rpm * scale

    @property
    def diesel(self) -> Diesel:
        """The diesel engine; another prime mover raises a ShipError."""
        mover = self.prime_mover
        if not isinstance(mover, Diesel):
            given = f"not prime_mover.type = {mover.type!r}"
            raise ShipError(f"{self.name}: this needs a diesel engine, {given}")
        return mover

    def has_key(self, dotted: str) -> bool:
        """Return whether a dotted key names a parameter of this ship."""
        try:
            self._locate(dotted)
        except ShipError:
            return False
        return True

    def parameter(self, dotted: str) -> ShipParameter:
        """Return the parameter at ``section.key``, or ``term.ID.PARAMETER`` of a term.

        Raises:
            ShipError: unknown key, a key without a single value in the ship record, or a parameter
                without effect on this ship.
        """
        found = self._locate(dotted)
        section, _, key = dotted.partition(".")
        if section == "term":
            own = self.term[found.place[0]]
            name = key.partition(".")[2]
            return found._replace(info=resolved_term_range(self, own, name, found.info))
        return found._replace(info=resolved_range(self, dotted, found.value, found.info))

    def _locate(self, dotted: str) -> ShipParameter:
        """Return a parameter with its plain range, which ignores the time step."""
        section, _, key = dotted.partition(".")
        if section == "term":
            return self._locate_in_term(dotted, *key.partition(".")[::2])
        table = getattr(self, section, None) if section in type(self).model_fields else None
        fields = type(table).model_fields if isinstance(table, Section) else {}
        if table is None or key not in fields:
            suggestion = _suggestion(type(self), dotted)
            raise ShipError(f"{self.name}: {dotted} is not a known key{suggestion}")
        for need in f"{table.needs} {declared(fields[key], 'needs', '')}".split():
            if not getattr(self, need):
                raise ShipError(f"{dotted} has no effect: {self.name} {MISSING_PROPERTIES[need]}")
        location = place_of(fields[key])
        if location is None:
            raise ShipError(f"{self.name}: {dotted} has no field of its own in the ship record")
        return ShipParameter(dotted, float(getattr(table, key)), info_of(fields[key]), *location)

    def _locate_in_term(self, dotted: str, term: str, name: str) -> ShipParameter:
        for slot, own in enumerate(self.term):
            if own.id == term and name in own.parameters:
                declared = own.parameters[name]
                place = (slot, list(own.parameters).index(name))
                info = KeyInfo(declared.unit, declared.low, declared.high, None)
                return ShipParameter(dotted, declared.value, info, "term_constants", place)
        known = ", ".join(f"term.{own.id}.{key}" for own in self.term for key in own.parameters)
        raise ShipError(f"{self.name}: {dotted} is not a known key; known: {known or 'no term'}")

    def with_term(self, term: Term) -> Ship:
        """Return a copy with one more term.

        Raises:
            ShipError: a term of this name exists already, or the ship has the largest number of terms.
        """
        tree = self.model_dump(exclude_unset=True)
        more = {"term": [*tree.get("term", ()), term.model_dump(exclude_unset=True)]}
        return validate_tables(type(self), tree | more, self.name)

    def with_signals(self, units: Mapping[str, str]) -> Ship:
        """Return a copy that declares external signals for its terms, by name with their units.

        Raises:
            ShipError: a name is in use already, or there are more signals than a ship may have.
        """
        tree = self.model_dump(exclude_unset=True)
        return validate_tables(type(self), tree | {"signals": dict(units)}, self.name)

    @property
    def external_signals(self) -> tuple[str, ...]:
        """External signals that the terms of this ship use, sorted."""
        used = {name for term in self.term for name in self.external_signals_of(term)}
        return tuple(sorted(used))

    def external_signals_of(self, term: Term) -> tuple[str, ...]:
        """Return the external signals that a term uses on this ship."""
        return tuple(n for n in term.external_signals if not (self.turns and n in TURNING_SIGNALS))

    def external_rows(self, given: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return external signals, shape (n, MAX_SIGNALS); one row if no signal is given.

        Args:
            given: values of each signal, shape (n,), by name.

        Raises:
            ShipError: a term uses a signal that is not given.
        """
        self.require_external_signals(given)
        rows = np.zeros((max(map(len, given.values()), default=1), MAX_SIGNALS))
        for k, name in enumerate(sorted(self.signals)):
            if name in given:
                rows[:, k] = given[name]
        return rows

    def external_values(self, given: Mapping[str, float]) -> tuple[float, ...]:
        """Return external signals at one instant, shape (MAX_SIGNALS,); see :meth:`external_rows`."""
        rows = self.external_rows({name: np.array([value]) for name, value in given.items()})
        return tuple(map(float, rows[0]))

    def require_external_signals(self, given: Container[str]) -> None:
        """Refuse a term that uses an external signal which is not given.

        Raises:
            ShipError: names the term and the signal.
        """
        for term in self.term:
            for name in self.external_signals_of(term):
                if name not in given:
                    raise ShipError(
                        f"{self.name}: term {term.id!r} uses the signal {name} [{self.signals[name]}], "
                        "which is not given here; simulate with a recording that has this column"
                    )


@functools.lru_cache(maxsize=256)
def _record(ship: Ship) -> Any:
    sections = [getattr(ship, name) for name in type(ship).model_fields]
    own = [section for section in sections if isinstance(section, Section)]
    return record_of(own, ship.prime_mover.code, ship.term, sorted(ship.signals))
