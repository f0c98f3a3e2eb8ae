"""What is wrong with a ship's file, in sentences that name key, unit and allowed range.

What must hold between the sections of a ship.

A ship: all its sections together, what they say of it, and its record for the kernels.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Container, Mapping
from typing import Annotated, Any, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, model_validator

from .actuators import PitchActuator
from .cavitation import CavitationBucket
from .drives import Diesel, Drive
from .expressions import FUNCTIONS, MAX_SIGNALS, MAX_TERMS
from .hull import Hull
from .keys import (
    LACKING,
    KeyInfo,
    Label,
    Line,
    MissingKeyError,
    Number,
    Section,
    allowed_range,
    info_of,
    needs_of,
    place_of,
    require,
    required_when,
    unit_of,
)
from .manoeuvring import WITH as MANOEUVRING
from .manoeuvring import Manoeuvring, planar_inertia
from .memory import HISTORY, Sensors
from .propeller import Propeller
from .record import PLANT, record_of
from .rudder import Rudder
from .shaft import UNLESS_HELD, Transmission
from .surroundings import WATER, InFluid, Integration, Water
from .terms import OF_A_TURN, TERM_SIGNALS, Name, Term
from .time_constants import check_time_constants, resolved, resolved_parameter
from .tolerances import Tolerances
from .ventilation import Ventilation

Model = TypeVar("Model", bound=BaseModel)


class ShipError(ValueError):
    """A ship that cannot be used; the message names file, key, unit and allowed range."""


def kinds(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, or the one type itself."""
    return get_args(annotation) or (annotation,)


def tag_of(section: type[BaseModel]) -> str:
    """The ``type`` of a section of which there are several kinds."""
    return str(get_args(section.model_fields["type"].annotation)[0])


def validated(model: type[Model], tree: dict[str, Any], source: str) -> Model:
    """A ship from its tables.

    Args:
        model: of the ship.
        tree: of its file.
        source: named in errors.

    Raises:
        ShipError: a line for everything that is wrong.
    """
    try:
        return model.model_validate(tree)
    except ValidationError as error:
        lines = [f"{source}: {_explained(model, dict(item))}" for item in error.errors()]
        raise ShipError("\n".join(lines)) from None


def _explained(model: type[BaseModel], item: dict[str, Any]) -> str:
    """One pydantic error as a sentence with key, unit, given value and allowed range."""
    tags = {tag_of(kind) for kind in kinds(model.model_fields["prime_mover"].annotation)}
    path = [str(part) for part in item["loc"] if part not in tags]
    key = ".".join(path) or "ship"
    table = model.model_fields.get(path[0]) if path else None  # one key may stand in two sections
    info = next(
        (
            section.model_fields[path[-1]]
            for section in (kinds(table.annotation) if table else ())
            if path[-1] in getattr(section, "model_fields", {})
        ),
        None,
    )
    allowed = ""
    if info is not None:
        allowed = f" (unit {unit_of(info)}; allowed: {allowed_range(info)})"
    kind = item["type"]
    if kind.startswith("union_tag"):
        given = item["ctx"].get("tag")
        what = "is missing" if given is None else f"= {given!r} is unknown"
        return f"{key}.type {what} (allowed: {', '.join(sorted(tags))})"
    if kind == "missing":
        return f"{key} is missing{allowed}"
    if kind == "extra_forbidden":
        return f"{key} is not a known key"
    if kind == "value_error":
        section = ".".join(str(part) for part in item["loc"] if part not in tags)
        error = item["ctx"]["error"]
        joint = "." if isinstance(error, MissingKeyError) else ": "
        return f"{section}{joint}{error}" if section else str(error)
    return f"{key} = {item.get('input')!r}: {item['msg'].lower()}{allowed}"


def check_terms(ship: Ship) -> None:
    """Refuse terms that hear or move what the ship does not have.

    Raises:
        ValueError: names the term and what is wrong with it.
    """
    ids = [term.id for term in ship.term]
    if twice := [name for name in ids if ids.count(name) > 1]:
        raise ValueError(f"term {twice[0]!r} stands twice")
    own = [name for name in TERM_SIGNALS if ship.turns or name not in OF_A_TURN]
    for name in ship.signals:
        if name in own or name in FUNCTIONS:
            raise ValueError(f"signals.{name}: a name of its own is needed")
    for term in ship.term:
        if unknown := [name for name in ship.heard_by(term) if name not in ship.signals]:
            known = [*own, *term.parameters, *ship.signals]
            raise ValueError(
                f"term {term.id!r}: {unknown[0]!r} is unknown; known: {', '.join(known)}; a "
                "signal from outside the ship is named, with its unit, under [signals]"
            )
        for where, lacking in _idle(ship, term):
            raise ValueError(f"term {term.id!r} acts on nothing: acts_on = {where!r} on {lacking}")


def _idle(ship: Ship, term: Term) -> list[tuple[str, str]]:
    """Where a term acts on nothing, and on what kind of ship."""
    places = [place for place, _ in term.expressions]
    held = "a shaft whose speed is held"
    straight = "a ship without a manoeuvring.length_m"
    found = [(p, held) for p in places if p in ("drive", "drive_torque") and not ship.turns_freely]
    turning = ("side_force", "yaw_moment")
    return found + [(p, straight) for p in places if p in turning and not ship.turns]


def check_fluid(ship: Ship) -> None:
    """Refuse effects of water or of its surface on a ship whose fluid has neither.

    Raises:
        ValueError: names the key, the density and what to do.
    """
    density = f"water.density_kg_m3 = {ship.water.density_kg_m3:g} kg/m3"
    if not ship.in_liquid and ship.moves:
        raise ValueError(
            f"{density} is a gas, in which no hull floats: water has about 1000 kg/m3. For a propeller "
            "in air say hull.fixed = true, and give the airspeed as inflow_velocity_m_s"
        )
    ventilation = ship.ventilation
    if not ship.in_liquid and any(
        (ventilation.thrust_loss, ventilation.torque_loss, ventilation.surface_loss)
    ):
        raise ValueError(
            f"ventilation draws air into a liquid, and {density} is a gas: leave [ventilation] out"
        )
    bucket = bool(ship.cavitation_bucket.model_fields_set)
    if not ship.in_water and (bucket or ship.propeller.cavitation_breakdown):
        key = "[cavitation_bucket]" if bucket else "propeller.cavitation_breakdown"
        raise ValueError(
            f"cavitation is modelled by the vapour pressure of water, and {density} is another fluid "
            f"(water: {WATER[0]:g} to {WATER[1]:g}): leave {key} out"
        )


def refuse_waves(ship: Ship, sea: Any) -> None:
    """Refuse a sea around a ship whose fluid has no surface.

    Args:
        ship: that is simulated.
        sea: SEA record, or None for calm water.

    Raises:
        ValueError: names the density.
    """
    if sea is not None and not ship.in_liquid:
        raise ValueError(
            f"{ship.name}: waves need a liquid, and water.density_kg_m3 = "
            f"{ship.water.density_kg_m3:g} kg/m3 is a gas: leave the sea out"
        )


def check_turning(ship: Ship) -> None:
    """Refuse a hull that cannot turn as its file says.

    Raises:
        ValueError: names the key.
    """
    if ship.rudder.area_m2 > 0.0 and not ship.turns:
        raise ValueError("rudder.area_m2 acts on nothing without a manoeuvring.length_m")
    if not ship.turns:
        return
    if not ship.moves:
        raise ValueError("manoeuvring.length_m asks for a hull that is not fixed")
    require(ship.water, ("density_kg_m3",), MANOEUVRING, "water.")
    if ship.hull.mass_kg < ship.manoeuvring.displacement_kg:
        raise ValueError(
            f"hull.mass_kg = {ship.hull.mass_kg:g} kg, with added mass, is less than "
            f"manoeuvring.displacement_kg = {ship.manoeuvring.displacement_kg:g} kg without"
        )
    plant = np.zeros(1, PLANT)[0]
    for section in (ship.water, ship.hull, ship.manoeuvring):
        section.fill(plant)
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(plant)
    if not sway * yaw > sway_yaw * yaw_sway:
        raise ValueError(
            "manoeuvring: sway and yaw have no inertia of their own: Y_rdot and N_vdot (with "
            "centre_of_gravity_m) are too large beside Y_vdot and N_rdot"
        )


class Ship(InFluid, Section):
    """A ship: everything that the plant needs to know, immutable.

    Use :func:`load_ship` to get one, :meth:`with_values` to vary it, :meth:`record` for the kernels.
    """

    name: Label
    description: Line = ""
    water: Water = Water()
    hull: Hull
    manoeuvring: Manoeuvring = Manoeuvring()
    rudder: Rudder = Rudder()
    propeller: Propeller
    ventilation: Ventilation = Ventilation()
    cavitation_bucket: CavitationBucket = CavitationBucket()
    prime_mover: Annotated[Drive, Field(discriminator="type")]
    transmission: Transmission = Transmission()
    pitch_actuator: PitchActuator = PitchActuator()
    sensors: Sensors = Sensors()
    integration: Integration = Integration()
    tolerances: Tolerances = Tolerances()
    signals: dict[Name, str] = Field(
        default={}, max_length=MAX_SIGNALS,
        description="signals from outside that terms hear, each with its unit",
    )  # fmt: skip
    term: Annotated[tuple[Term, ...], Field(strict=False, max_length=MAX_TERMS)] = ()

    def __hash__(self) -> int:
        """Of what stands in it: ships are remembered by that."""
        own = {name: getattr(self, name) for name in type(self).model_fields}
        return hash((*(own | {"signals": None}).values(), *sorted(self.signals.items())))

    @model_validator(mode="after")
    def _consistent(self) -> Ship:
        step = self.integration.time_step_s
        longest = step * (HISTORY - 2)
        for key, delay in (self.sensors.delays | self.prime_mover.delays).items():
            if delay > longest:
                raise ValueError(
                    f"{key} = {delay} s is more than {longest:.4g} s, "
                    f"the longest delay at a time step of {step} s"
                )
        check_terms(self)
        check_fluid(self)
        for key in self.tolerances.numbers:
            self.number(key)
        if self.has_propeller:
            require(self.water, ("density_kg_m3",), "with a propeller", "water.")
        if self.turns_freely:
            keys = [
                k for k, i in Transmission.model_fields.items() if required_when(i) == UNLESS_HELD
            ]
            require(self.transmission, tuple(keys), UNLESS_HELD, "transmission.")
        check_turning(self)
        check_time_constants(self)
        return self

    @property
    def time_step_s(self) -> float:
        """Time step of the integration [s]."""
        return self.integration.time_step_s

    def with_values(self, values: dict[str, Any]) -> Ship:
        """A copy with some values changed, validated like a file.

        Args:
            values: by dotted key, for example ``{"transmission.gear_ratio": 7.0}``.

        Raises:
            ShipError: unknown key, or a value out of range.
        """
        tree = self.model_dump(exclude_unset=True)
        for dotted, value in values.items():
            *path, key = dotted.split(".")
            section = tree
            if path[:1] == ["term"]:
                section, path, key = self._term(tree, dotted)["parameters"], [key], "value"
            for part in path:
                section = section.setdefault(part, {})
                if not isinstance(section, dict):
                    raise ShipError(f"{self.name}: no section {part!r} in {dotted!r}")
            section[key] = value
        return validated(type(self), tree, self.name)

    def _term(self, tree: dict[str, Any], dotted: str) -> dict[str, Any]:
        """The table of the term that a dotted key names, in the tables of this ship."""
        self.number(dotted)
        own: dict[str, Any] = next(t for t in tree["term"] if t["id"] == dotted.split(".")[1])
        return own

    def record(self) -> Any:
        """The kernels' record of this ship: one element of dtype ``PLANT``, yours to change."""
        return _record(self).copy()

    @property
    def has_diesel(self) -> bool:
        """Whether a diesel engine drives it."""
        return isinstance(self.prime_mover, Diesel)

    @property
    def has_voltage(self) -> bool:
        """Whether a motor drives it to which a voltage is applied."""
        return self.prime_mover.demand.unit == "V"

    @property
    def has_propeller(self) -> bool:
        """Whether its shaft turns a propeller."""
        return self.propeller.model != "none"

    @property
    def meets_water(self) -> bool:
        """Whether water acts on it: on its propeller, or on a hull that moves."""
        return self.has_propeller or self.moves

    @property
    def has_constant_coefficients(self) -> bool:
        """Whether its propeller's KT and KQ are two numbers, as at bollard pull."""
        return self.propeller.model == "bollard"

    @property
    def turns_freely(self) -> bool:
        """Whether its shaft's speed follows from the torques on it, and is not held."""
        return not self.prime_mover.holds_speed

    @property
    def reverses(self) -> bool:
        """Whether its shaft can turn astern: a diesel's does not."""
        return not self.has_diesel

    @property
    def has_line_shaft(self) -> bool:
        """Whether friction behind the torque gauge is told from that of the drive: not on a motor."""
        return self.drive_balance != "motor"

    @property
    def has_variable_pitch(self) -> bool:
        """Whether its blades turn."""
        return self.propeller.pitch_ratio_min < self.propeller.pitch_ratio_max

    @property
    def turns(self) -> bool:
        """Whether it sways and yaws."""
        return self.manoeuvring.length_m > 0.0

    @property
    def moves(self) -> bool:
        """Whether its hull is free."""
        return not self.hull.fixed

    @property
    def drive_balance(self) -> str:
        """Balance of its prime mover: ``engine`` or ``motor``; empty where its speed is held."""
        return self.prime_mover.balance

    @property
    def balances(self) -> tuple[str, ...]:
        """Balances that an effect on this ship may act in."""
        own = [self.drive_balance] if self.drive_balance else []
        own += ["propeller", "sensor"] if self.has_propeller else ["sensor"]
        own += ["hull", *(("sway", "yaw") if self.turns else ())] if self.moves else []
        return (*own, "pitch-actuator") if self.has_variable_pitch else tuple(own)

    @property
    def shaft_speeds(self) -> tuple[float, float]:
        """Lowest and highest running speed of a diesel's propeller shaft [rad/s].

        Raises:
            ShipError: the ship has no diesel.
        """
        mover = self.diesel
        scale = math.pi / 30.0 / self.transmission.gear_ratio
        return mover.speed_min_rpm * scale, mover.speed_max_rpm * scale

    @property
    def diesel(self) -> Diesel:
        """Its diesel engine.

        Raises:
            ShipError: another prime mover.
        """
        mover = self.prime_mover
        if not isinstance(mover, Diesel):
            raise ShipError(f"{self.name}: needs a diesel, not {mover.type!r}")
        return mover

    def has_key(self, dotted: str) -> bool:
        """Whether a dotted key is a number of this ship."""
        try:
            self.number(dotted)
        except ShipError:
            return False
        return True

    def number(self, dotted: str) -> Number:
        """The number at a dotted key, with its unit, range and place in the record.

        Args:
            dotted: ``section.key``, or ``term.ID.PARAMETER`` of a term.

        Raises:
            ShipError: unknown key, one that is not a single number of the kernels' record, or one
                that acts on nothing on this ship.
        """
        section, _, key = dotted.partition(".")
        if section == "term":
            return self._number_of_term(dotted, *key.partition(".")[::2])
        table = getattr(self, section, None) if section in type(self).model_fields else None
        fields = type(table).model_fields if isinstance(table, Section) else {}
        if table is None or key not in fields:
            raise ShipError(f"{self.name}: {dotted} is not a known key")
        for need in f"{table.needs} {needs_of(fields[key])}".split():
            if not getattr(self, need):
                raise ShipError(f"{dotted} acts on nothing: {self.name} {LACKING[need]}")
        found = place_of(fields[key])
        if found is None:
            raise ShipError(f"{self.name}: {dotted} has no field of its own in the kernels' record")
        value, info = float(getattr(table, key)), info_of(fields[key])
        return Number(dotted, value, resolved(self, dotted, value, info), *found)

    def _number_of_term(self, dotted: str, term: str, name: str) -> Number:
        for slot, own in enumerate(self.term):
            if own.id == term and name in own.parameters:
                found = own.parameters[name]
                place = (slot, list(own.parameters).index(name))
                info = KeyInfo(found.unit, found.low, found.high, None)
                info = resolved_parameter(self, own, name, info)
                return Number(dotted, found.value, info, "term_constants", place)
        raise ShipError(f"{self.name}: {dotted} is not a known key")

    def with_term(self, term: Term) -> Ship:
        """A copy that carries one term more.

        Raises:
            ShipError: it carries one of that name already, or as many as it can.
        """
        tree = self.model_dump(exclude_unset=True)
        more = {"term": [*tree.get("term", ()), term.model_dump(exclude_unset=True)]}
        return validated(type(self), tree | more, self.name)

    def with_signals(self, units: Mapping[str, str]) -> Ship:
        """A copy whose terms may hear some signals from outside.

        Args:
            units: of each, by its name.

        Raises:
            ShipError: a name that has a meaning already, or more than a ship can hear.
        """
        tree = self.model_dump(exclude_unset=True)
        return validated(type(self), tree | {"signals": dict(units)}, self.name)

    @property
    def hears(self) -> tuple[str, ...]:
        """Signals from outside that its terms use."""
        return tuple(sorted({name for term in self.term for name in self.heard_by(term)}))

    def heard_by(self, term: Term) -> tuple[str, ...]:
        """Signals that a term hears from outside on this ship."""
        return tuple(n for n in term.hears if not (self.turns and n in OF_A_TURN))

    def outside_rows(self, given: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Signals from outside along a time base, as the kernels take them.

        Args:
            given: each of shape (n,), by name.

        Returns:
            Shape (n, MAX_SIGNALS), or one row where none is given.

        Raises:
            ShipError: a term hears one that is not given.
        """
        self.refuse_unheard(given)
        found = np.zeros((max(map(len, given.values()), default=1), MAX_SIGNALS))
        for k, name in enumerate(sorted(self.signals)):
            if name in given:
                found[:, k] = given[name]
        return found

    def outside(self, given: Mapping[str, float]) -> tuple[float, ...]:
        """The same at one instant, of shape (MAX_SIGNALS,)."""
        rows = self.outside_rows({name: np.array([value]) for name, value in given.items()})
        return tuple(map(float, rows[0]))

    def refuse_unheard(self, given: Container[str]) -> None:
        """Refuse a term that hears a signal from outside that is not among those given by name.

        Raises:
            ShipError: names term and signal.
        """
        for term in self.term:
            for name in self.heard_by(term):
                if name not in given:
                    raise ShipError(
                        f"{self.name}: term {term.id!r} hears {name} [{self.signals[name]}], which "
                        "this simulation does not have; a recording with a column of that name does"
                    )


@functools.lru_cache(maxsize=256)
def _record(ship: Ship) -> Any:
    sections = [getattr(ship, name) for name in type(ship).model_fields]
    own = [section for section in sections if isinstance(section, Section)]
    return record_of(own, ship.prime_mover.code, ship.term, sorted(ship.signals))
