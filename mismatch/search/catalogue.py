"""What an entry of a catalogue is: an effect and its parameters.

An effect at some size: an entry of the catalogue with values.

Entries of a catalogue as they stand in a TOML file: the tool's own, and anybody's.

``[[effect]]`` is some keys of a ship's file whose values are not neutral; ``[[term]]`` is physics that
no key describes, with an expression (:mod:`shaftline.plant.terms`)::

    [[term]]
    id = "wave-making"
    balance = "hull"
    acts_on = "resistance"
    expression = "c4 * ship_speed ** 4"
    lacks = "force that grows with the fourth power of speed: the ship makes waves"

    [term.parameters]
    c4 = { unit = "N s4/m4", low = 0.0, high = 1e4, probes = [0.5, 2.0, 8.0] }

The first parameter is the size: at its ``neutral`` value the term must add nothing. A parameter with
``set`` is not fitted: it is that number, that scale of the recording or that number of the ship's file
wherever the effect is tried.

Effects and parameters that rows which are equilibria can show.

The catalogue: every physical effect that the tool knows by name.

An effect is some keys of the ship's file with values that are not neutral, so its equation stands where
the plant's equations live and a corrected ship is an ordinary ship. The entry adds what an engineer must
be told: equation, balance, what excites it, what it can be mistaken for, what would tell them apart.
"""

from __future__ import annotations

import functools
import importlib.resources
import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from ...core.files import read_text, toml_of
from ...core.models import FileModel
from ...plant.columns import SHAFT_POWER
from ...plant.expressions import MAX_SIGNALS, MAX_STATES, Heard, Loaded, added, added_before
from ...plant.keys import Number
from ...plant.record import PLANT
from ...plant.ship import Ship, ShipError
from ...plant.terms import NO_BOUND, TERM_SIGNALS, Term, add_term
from ..simulate.tolerances import is_transient


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect.

    Args:
        key: dotted key of the ship's file.
        probes: values at which the effect is first tried, in ``of``.
        of: what a probe of 1 is worth: ``unit`` (one of the key's own unit), or a name among those of
            :func:`.trial_ship.scales`, such as ``torque`` or ``torque/shaft_speed``.
        signed: whether the negative probes are tried too.
        absolute: the probes are values of the key, not deviations from its neutral value.
        whole: its upper bound is all of it, as of a switch that is open, and no end of a search.
        term: of which it is a number, where the effect is a term of the ship and not a key of its own.
        least: distance from the neutral value below which something else looks the same, and the
            effect is not named; in the key's own unit.
        plausible: lowest and highest value that physics allows, in ``plausible_of``; an effect outside
            is reported, but explains a recording partly at most. None where physics sets no limit.
        plausible_of: unit of ``plausible``: ``unit`` or a scale, as ``of``.
    """

    key: str
    probes: tuple[float, ...]
    of: str = "unit"
    signed: bool = False
    absolute: bool = False
    least: float = 0.0
    term: Term | None = None
    whole: bool = False
    plausible: tuple[float, float] | None = None
    plausible_of: str = "unit"

    def number(self, ship: Ship) -> Number:
        """The number of a ship that it is: unit, range, neutral value and place in the record.

        Args:
            ship: carries the parameter's term or not.

        Raises:
            ShipError: the ship has no such key, or no room for the term.
        """
        return _carrying(ship, self.term).number(self.key)

    @property
    def name(self) -> str:
        """Name in reports: the key without its section."""
        return self.key.split(".")[-1]


@dataclass(frozen=True)
class Effect:
    """An entry of the catalogue.

    Args:
        id: name of the physics.
        balance: in which it acts.
        parameters: that the tool fits; more than one are tried in all combinations.
        equation: in plain text.
        latex: the same.
        lacks: what the balance lacks, in words: the end of the report's sentence.
        excess: what the balance has instead where the first value lies below its neutral one.
        excitation: what the recording must do for the effect to show.
        confused_with: ids that a recording may not be able to tell from it.
        split_by: manoeuvre or sensor that would.
        fixed: keys that are set with it: to a number, by a scale of the nominal simulation (as ``of``)
            or to another key's number.
        ties: keys that follow a parameter: (key, parameter's key, factor).
        needs: columns without which it cannot be tried.
        windowed: acts for a time, whose start and end are fitted too.
        form: what tells it from the other forms of the same physics, which have the same id and
            balance; the first of them in the catalogue is tried first.
        term: that the effect is, with its numbers at values that change nothing; None where the
            parameters are keys of the ship's file.
        applies_to: what a ship must be, as its properties say: ``has_diesel``, ``has_voltage``,
            ``has_propeller``, ``has_line_shaft``, ``has_variable_pitch``, ``reverses``; beside having
            the balance and the keys. ``not moves`` is a ship without that property.
        together: it is tried only where effects and parameters are estimated together: beside parameters
            that are held it imitates others.
        both_ways: it shows only where the shaft turns, or is driven, both ways.
        straight: a ship that does not turn has it only where the recording does not turn either.
    """

    id: str
    balance: str
    parameters: tuple[Parameter, ...]
    equation: str
    latex: str
    lacks: str
    excitation: str
    confused_with: tuple[str, ...] = ()
    split_by: str = ""
    fixed: tuple[tuple[str, float | str], ...] = ()
    ties: tuple[tuple[str, str, float], ...] = ()
    needs: tuple[str, ...] = ()
    windowed: bool = False
    form: str = ""
    applies_to: tuple[str, ...] = ()
    term: Term | None = None
    straight: bool = False
    both_ways: bool = False
    together: bool = False
    excess: str = ""

    def on(self, ship: Ship) -> Ship:
        """A ship with the effect's term on it, at values that change nothing; else the ship itself.

        Args:
            ship: the ship.

        Raises:
            ShipError: the ship carries as many terms as it can.
        """
        return _carrying(ship, self.term)

    def acts_on(self, ship: Ship) -> bool:
        """Whether a ship can have the effect."""
        if self.balance not in ship.balances:
            return False
        if not all(_has(ship, what) for what in self.applies_to):
            return False
        try:
            host = self.on(ship)
        except ShipError:
            return False
        keys = [parameter.key for parameter in self.parameters]
        keys += [of for _, of in self.fixed if isinstance(of, str) and "." in of]
        return all(host.has_key(key) for key in keys)

    @property
    def kind(self) -> tuple[str, str]:
        """What forms of one piece of physics have in common: id and balance."""
        return self.id, self.balance

    @property
    def label(self) -> str:
        """Id and balance, for friction may act in several; and the form where there are some."""
        return f"{self.id} ({self.balance}{', ' + self.form if self.form else ''})"


def _has(ship: Ship, what: str) -> bool:
    """Return whether a ship has a property, or lacks one that ``not`` stands before."""
    wanted = not what.startswith("not ")
    return bool(getattr(ship, what.removeprefix("not "))) == wanted


@functools.lru_cache(maxsize=256)
def _carrying(ship: Ship, term: Term | None) -> Ship:
    if term is None or any(own.id == term.id for own in ship.term):
        return ship
    return ship.with_term(term)


Window = tuple[float, float]
"""Start and end [s]."""


@dataclass(frozen=True)
class Placed:
    """An effect with values.

    Args:
        effect: the catalogue's entry.
        values: of its parameters, in its order, in the ship file's units.
        window: in which it acts, where it acts for a time.
    """

    effect: Effect
    values: tuple[float, ...]
    window: Window | None = None

    @property
    def pairs(self) -> tuple[tuple[Parameter, float], ...]:
        """Each parameter with its value."""
        return tuple(zip(self.effect.parameters, self.values, strict=True))

    def in_place_of(self, effects: tuple[Placed, ...], which: int) -> tuple[Placed, ...]:
        """Some effects with this one where another stood."""
        return (*effects[:which], self, *effects[which + 1 :])

    def with_values(self, values: Any) -> Placed:
        """The same effect with other values."""
        return Placed(self.effect, tuple(float(v) for v in values), self.window)


_EARLY = len(Heard._fields)
_TRIED = 16  # states at which a term is looked at, of either sign
_NOTHING = 1e-9


class _Trial(FileModel):
    """How a parameter is first tried; as of :class:`.effect.Parameter`."""

    probes: tuple[float, ...] = ()
    of: str = "unit"
    signed: bool = False
    absolute: bool = False
    least: float = 0.0
    whole: bool = False
    plausible: tuple[float, float] | None = None
    plausible_of: str = "unit"

    @model_validator(mode="after")
    def _plausible_in_order(self) -> _Trial:
        if self.plausible is not None and self.plausible[0] >= self.plausible[1]:
            raise ValueError("plausible = [low, high]: low must be below high")
        return self

    def of_key(self, key: str, term: Term | None = None) -> Parameter:
        """The parameter of an effect that it states."""
        return Parameter(
            key, self.probes, self.of, self.signed, self.absolute, self.least, term, self.whole,
            self.plausible, self.plausible_of,
        )  # fmt: skip


class _OfKey(_Trial):
    key: str


class _OfTerm(_Trial):
    unit: str = "-"
    low: float = NO_BOUND[0]
    high: float = NO_BOUND[1]
    neutral: float = 0.0
    set: float | str | None = None

    @model_validator(mode="after")
    def _tried(self) -> _OfTerm:
        if not self.probes and self.set is None:
            raise ValueError("probes are needed, values at which it is first tried; or set")
        return self


class _Entry(FileModel):
    """What an engineer is told of an effect, and where it can be; as of :class:`.effect.Effect`."""

    id: str = Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)
    balance: Literal[
        "engine", "motor", "propeller", "hull", "sway", "yaw", "pitch-actuator", "sensor"
    ]
    form: str = Field("", pattern=r"^([a-z0-9]+(-[a-z0-9]+)*)?$", max_length=40)
    equation: str = ""
    latex: str = ""
    lacks: str = ""
    excess: str = ""
    excitation: str = ""
    confused_with: tuple[str, ...] = ()
    split_by: str = ""
    needs: tuple[str, ...] = ()
    applies_to: tuple[str, ...] = ()
    straight: bool = False
    both_ways: bool = False
    together: bool = False

    def told(self) -> dict[str, Any]:
        """What is handed on as it stands."""
        return {name: getattr(self, name) for name in _Entry.model_fields}


class _OfKeys(_Entry):
    """An ``[[effect]]``."""

    parameters: tuple[_OfKey, ...] = Field(min_length=1)
    fixed: dict[str, float | str] = Field(default={})
    ties: tuple[tuple[str, str, float], ...] = ()
    windowed: bool = False

    def effect(self) -> Effect:
        return Effect(
            **self.told(), parameters=tuple(p.of_key(p.key) for p in self.parameters),
            fixed=tuple(self.fixed.items()), ties=self.ties, windowed=self.windowed,
        )  # fmt: skip


class _AsTerm(_Entry):
    """A ``[[term]]``."""

    acts_on: str
    expression: str
    also: dict[str, str] = Field(default={})
    state: str | None = None
    rate: str | None = None
    parameters: dict[str, _OfTerm] = Field(min_length=1)

    @model_validator(mode="after")
    def _of_a_size(self) -> _AsTerm:
        if next(iter(self.parameters.values())).set is not None:
            raise ValueError("parameters: the first is the effect's size, which is not set")
        return self

    @property
    def term(self) -> Term:
        """The term, at values that change nothing."""
        numbers = {
            name: {"value": p.neutral, "unit": p.unit, "low": p.low, "high": p.high}
            for name, p in self.parameters.items()
        }
        tree = {
            "id": "-".join(filter(None, (self.id, self.balance, self.form))),
            "acts_on": self.acts_on, "expression": self.expression, "parameters": numbers,
        }  # fmt: skip
        more = {"also": self.also, "state": self.state, "rate": self.rate}
        return Term.model_validate(tree | {key: value for key, value in more.items() if value})

    def effect(self) -> Effect:
        term = self.term
        told = self.told()
        adds = "; ".join(f"{where} + ({what})" for where, what in term.expressions)
        told["equation"] = self.equation or adds
        told["lacks"] = self.lacks or f"what {self.id.replace('-', ' ')} would give"
        keys = {name: f"term.{term.id}.{name}" for name in self.parameters}
        return Effect(
            **told, term=term,
            parameters=tuple(
                p.of_key(keys[n], term) for n, p in self.parameters.items() if p.set is None
            ),
            fixed=tuple(
                (keys[n], p.set) for n, p in self.parameters.items() if p.set is not None
            ),
        )  # fmt: skip


class _File(FileModel):
    effect: tuple[_OfKeys, ...] = ()
    term: tuple[_AsTerm, ...] = ()


def entries_of(text: str, source: str = "catalogue") -> tuple[Effect, ...]:
    """Entries from the text of a catalogue.

    Args:
        text: TOML; see the module.
        source: named in errors.

    Raises:
        ValueError: what is wrong, with the entry's id and the key.
    """
    tree = toml_of(text, source)
    try:
        given = _File.model_validate(tree)
    except ValidationError as error:
        raise ValueError("\n".join(_said(source, tree, dict(e)) for e in error.errors())) from None
    found = [entry.effect() for entry in given.effect]
    for entry in given.term:
        try:
            found.append(entry.effect())
        except ValidationError as error:  # of the term itself, which a ship would carry
            whole = {"term": [entry.model_dump()]}
            parts = [dict(e) | {"loc": ("term", 0, *e["loc"])} for e in error.errors()]
            lines = [_said(source, whole, part) for part in parts]
            raise ValueError("\n".join(lines)) from None
    labels = [effect.label for effect in found]
    if twice := [label for label in labels if labels.count(label) > 1]:
        raise ValueError(f'{source}: {twice[0]} stands twice; a second form has a form = "..."')
    return tuple(found)


def read_entries(path: Path) -> tuple[Effect, ...]:
    """Entries of a file of one's own.

    Raises:
        ValueError: it cannot be read or used; names file, entry and key.
    """
    found = entries_of(read_text(path), str(path))
    if not found:
        raise ValueError(f"{path}: no [[term]] and no [[effect]] in it")
    for effect in found:
        if effect.term is not None:
            _refuse_never_nothing(path, effect.label, effect.term)
    return found


def _refuse_never_nothing(path: Path, label: str, term: Term) -> None:
    """Refuse a term without a state that adds something where its size is neutral, or no number at all.

    Raises:
        ValueError: names it.
    """
    if term.state is not None:  # what it adds then hangs on what went before
        return
    plant = np.zeros(1, PLANT)[0]
    add_term(plant, term, term.hears)
    sizes = np.random.default_rng(0).uniform(-20.0, 20.0, (_TRIED, len(TERM_SIGNALS) + MAX_SIGNALS))
    adds = []
    for signals in [*sizes.tolist(), *np.abs(sizes).tolist()]:
        heard, loaded = Heard(*signals[:_EARLY]), Loaded(*signals[_EARLY : len(TERM_SIGNALS)])
        given = (plant, heard), ((0.0,) * MAX_STATES, tuple(signals[len(TERM_SIGNALS) :]))
        found = [*added_before(*given[0], *given[1]), *added(*given[0], loaded, *given[1])]
        adds.append(max(map(abs, found)) if np.isfinite(found).all() else math.nan)
    if np.isnan(adds).all():
        raise ValueError(
            f"{path}: {label}: its expression is no finite number, whatever the ship does"
        )
    if (most := float(np.nanmax(adds))) > _NOTHING:
        size, neutral = next((name, p.value) for name, p in term.parameters.items())
        raise ValueError(
            f"{path}: {label}: at {size} = {neutral:g}, its neutral value, the term adds up to "
            f"{most:.3g}; it must add nothing there, for that is the ship without it"
        )


def _said(source: str, tree: dict[str, Any], item: dict[str, Any]) -> str:
    """One error of pydantic as a sentence that names the entry."""
    place = list(item["loc"])
    name = source
    if len(place) > 1 and isinstance(place[1], int):
        entry = tree[place[0]][place[1]]
        own = entry.get("id", f"number {place[1] + 1}") if isinstance(entry, dict) else place[1] + 1
        name = f"{source}: {place[0]} {own}"
        place = place[2:]
    key = ".".join(map(str, place))
    kind = item["type"]
    if kind == "missing":
        return f"{name}: {key} is missing"
    if kind == "extra_forbidden":
        return f"{name}: {key} is not a known key"
    what = str(item["ctx"]["error"]) if kind == "value_error" else item["msg"].lower()
    return f"{name}: {key}: {what}" if key else f"{name}: {what}"


_OF_A_TURN = ("sway", "yaw")


def acts_at_rest(ship: Ship, effect: Effect) -> bool:
    """Return whether an effect changes equilibria of a ship that runs straight ahead.

    An effect with a state of its own, or on the rate of the pitch actuator, acts in transients.
    """
    if effect.balance in _OF_A_TURN:
        return False
    if effect.term is not None:
        return effect.term.state is None and effect.term.acts_on != "pitch_rate"
    host = effect.on(ship)
    keys = [parameter.key for parameter in effect.parameters]
    return not any(is_transient(host, key) for key in keys if ".episode_" not in key)


def refuse_transient(ship: Ship, keys: Collection[str]) -> None:
    """Refuse parameters that equilibria do not depend on.

    Raises:
        ValueError: names the parameter.
    """
    for key in keys:
        if is_transient(ship, key):
            raise ValueError(
                f"{key} acts in transients only, and each row of the recording is taken as an "
                "equilibrium; leave it out of --free, or give a recording of 1 row a second or faster"
            )


@functools.cache
def catalogue() -> tuple[Effect, ...]:
    """Every entry, as ``catalogue.toml`` states them."""
    folder = importlib.resources.files("shaftline.mismatch.search")
    return entries_of(folder.joinpath("catalogue.toml").read_text("utf-8"))


def mistaken_for(effect: Effect, ship: Ship) -> tuple[str, ...]:
    """Ids that a recording of a ship may not be able to tell from an effect; only what it can have."""
    own = {entry.id for entry in catalogue() if entry.acts_on(ship)}
    return tuple(name for name in effect.confused_with if name in own)


def applicable(
    ship: Ship,
    columns: Iterable[str],
    exclude: Iterable[str] = (),
    own: Iterable[Effect] = (),
    turned: bool = False,
    one_way: bool = False,
    steady: bool = False,
) -> list[Effect]:
    """Entries that a ship can have and a recording could show.

    Args:
        ship: the nominal ship; a term is heard where the ship hears its signals.
        columns: of the recording.
        exclude: ids to leave out.
        own: entries besides the catalogue's.
        turned: whether the recording turns.
        one_way: whether the shaft turns and is driven one way only.
        steady: whether each row is an equilibrium, where effects of transients do not show.

    Raises:
        ValueError: an id to leave out is unknown.
    """
    known, left_out = set(columns), set(exclude)
    if SHAFT_POWER in known:  # it is measured torque times shaft speed
        known.add("shaft_torque_N_m")
    everything = [*catalogue(), *own]
    unknown = left_out - {effect.id for effect in everything}
    if unknown:
        names = ", ".join(sorted({effect.id for effect in everything}))
        raise ValueError(f"unknown effect {sorted(unknown)[0]!r}; known: {names}")
    return [
        effect
        for effect in everything
        if effect.id not in left_out
        and set(effect.needs) <= known
        and effect.acts_on(ship)
        and not (effect.straight and turned and not ship.turns)
        and not (effect.both_ways and one_way)
        and (acts_at_rest(ship, effect) or not steady)
    ]
