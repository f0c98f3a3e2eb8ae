"""A ship: all its sections together, what they say of it, and its record for the kernels."""

from __future__ import annotations

import functools
import math
from collections.abc import Container, Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from .actuators import PitchActuator
from .cavitation import CavitationBucket
from .drives import Diesel, Drive
from .hull import Hull
from .keys import (
    LACKING,
    KeyInfo,
    Label,
    Line,
    Number,
    Section,
    info_of,
    needs_of,
    place_of,
    require,
    required_when,
)
from .manoeuvring import Manoeuvring
from .memory import HISTORY, Sensors
from .propeller import Propeller
from .record import record_of
from .rudder import Rudder
from .shaft import UNLESS_HELD, Transmission
from .ship_checks import check_fluid, check_terms, check_turning
from .ship_errors import ShipError, validated
from .surroundings import InFluid, Integration, Water
from .term_kernel import MAX_SIGNALS, MAX_TERMS
from .terms import OF_A_TURN, Name, Term
from .time_constants import check_time_constants, resolved, resolved_parameter
from .tolerances import Tolerances
from .ventilation import Ventilation


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
