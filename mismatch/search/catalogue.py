"""Define the catalogue of physical effects, and read it and the user's own effects from TOML.

An effect ``[[effect]]`` is a set of keys of the ship file with values that are not neutral, so that its
equation is part of the ship model and a corrected ship is an ordinary ship. An effect ``[[term]]`` is
physics without such a key, given by an expression (:mod:`shaftline.plant.terms`)::

    [[term]]
    id = "wave-making"
    balance = "hull"
    acts_on = "resistance"
    expression = "c4 * ship_speed ** 4"
    lacks = "force that grows with the fourth power of speed: the ship makes waves"

    [term.parameters]
    c4 = { unit = "N s4/m4", low = 0.0, high = 1e4, probes = [0.5, 2.0, 8.0] }

The first parameter is the size: at its ``neutral`` value the term must add nothing. A parameter with
``set`` is not fitted: its value is the given number, a scale of the recording or a parameter of the ship
file. Each entry also describes the effect for the report: equation, balance, required excitation,
effects with which it can be confused, and the manoeuvre or sensor that distinguishes them.
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

from ...core.files import parse_toml, read_text
from ...core.models import FileModel
from ...plant.columns import SHAFT_POWER
from ...plant.expressions import (
    MAX_SIGNALS,
    MAX_STATES,
    InputSignals,
    LoadSignals,
    sum_input_terms,
    sum_load_terms,
)
from ...plant.keys import ShipParameter
from ...plant.record import PLANT
from ...plant.ship import Ship, ShipError
from ...plant.terms import NO_BOUND, TERM_SIGNALS, Term, add_term
from ..simulate.balances import is_transient


@dataclass(frozen=True)
class Parameter:
    """Parameter of an effect.

    Args:
        key: dotted key of the ship file.
        probes: values at which the effect is first tried, in multiples of ``of``.
        of: scale of the probes: ``unit`` (the unit of the key), or a name of
            :func:`.trial_ship.probe_scales`, such as ``torque`` or ``torque/shaft_speed``.
        signed: whether the negative probes are tried too.
        absolute: whether the probes are values of the key; else they are deviations from its neutral
            value.
        whole: whether the upper bound is the complete effect, as of an open switch, and no limit of the
            search.
        term: term of the ship to which the parameter belongs; None for a key of the ship file.
        least: distance from the neutral value, in the unit of the key, below which another cause has the
            same signature and the effect is not identified.
        plausible: lowest and highest physically plausible value, in multiples of ``plausible_of``. An
            effect outside this range explains a recording at most partly. None without a limit.
        plausible_of: scale of ``plausible``, as ``of``.
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

    def in_ship(self, ship: Ship) -> ShipParameter:
        """Return this parameter of a ship: unit, range, neutral value and position in the record.

        Args:
            ship: ship with or without the term of the parameter.

        Raises:
            ShipError: the ship has no such key, or the largest number of terms already.
        """
        return _with_term(ship, self.term).parameter(self.key)

    @property
    def name(self) -> str:
        """Name in reports: the key without its section."""
        return self.key.split(".")[-1]


@dataclass(frozen=True)
class Effect:
    """Entry of the catalogue.

    Args:
        id: name of the physical effect.
        balance: balance in which the effect acts.
        parameters: fitted parameters; several parameters are tried in all combinations.
        equation: equation in plain text.
        latex: equation in LaTeX.
        lacks: what the balance lacks, in words: the end of a sentence of the report.
        excess: what the balance has in excess if the first value lies below its neutral value.
        excitation: excitation that makes the effect identifiable.
        confused_with: ids of effects that a recording may not distinguish from this one.
        split_by: manoeuvre or sensor that distinguishes them.
        fixed: keys with fixed values: a number, a scale of the nominal simulation (as ``of``) or the
            value of another key.
        ties: keys that depend on a parameter: (key, key of the parameter, factor).
        needs: columns without which the effect cannot be tried.
        windowed: whether the effect acts in a time window, whose start and end are fitted too.
        form: name of this form of the effect; forms have the same id and balance, and the first form in
            the catalogue is tried first.
        term: term of the ship with neutral parameters; None if the parameters are keys of the ship file.
        applies_to: required properties of the ship: ``has_diesel``, ``has_voltage``, ``has_propeller``,
            ``has_line_shaft``, ``has_variable_pitch``, ``reverses``; ``not moves`` requires that a
            property is absent.
        together: whether the effect is tried only when effects and parameters are estimated together;
            with fixed parameters it would imitate other effects.
        both_ways: whether the effect is identifiable only if the shaft turns, or is driven, both ways.
        straight: whether a ship that does not turn has the effect only in recordings without turns.
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
        """Return the ship with the term of the effect at neutral values, or the ship if there is none.

        Args:
            ship: the ship.

        Raises:
            ShipError: the ship has the largest number of terms already.
        """
        return _with_term(ship, self.term)

    def acts_on(self, ship: Ship) -> bool:
        """Return whether a ship can have the effect."""
        if self.balance not in ship.balances or not all(_has(ship, p) for p in self.applies_to):
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
        """Id and balance, which are common to all forms of an effect."""
        return self.id, self.balance

    @property
    def label(self) -> str:
        """Id with balance, because one id may act in several balances, and the form if there is one."""
        return f"{self.id} ({self.balance}{', ' + self.form if self.form else ''})"


def _has(ship: Ship, name: str) -> bool:
    """Return whether a ship has a property, or does not have a property that follows ``not``."""
    return bool(getattr(ship, name.removeprefix("not "))) != name.startswith("not ")


Window = tuple[float, float]
"""Start and end [s]."""


@dataclass(frozen=True)
class SizedEffect:
    """Effect with values of its parameters."""

    effect: Effect  # entry of the catalogue
    values: tuple[float, ...]  # values of its parameters in order, in the units of the ship file
    window: Window | None = None  # time window in which a windowed effect acts

    @property
    def pairs(self) -> tuple[tuple[Parameter, float], ...]:
        """Parameters with their values."""
        return tuple(zip(self.effect.parameters, self.values, strict=True))

    def replace_in(self, effects: tuple[SizedEffect, ...], which: int) -> tuple[SizedEffect, ...]:
        """Return effects with one of them replaced by this effect."""
        return (*effects[:which], self, *effects[which + 1 :])

    def with_values(self, values: Any) -> SizedEffect:
        """Return this effect with other values."""
        return SizedEffect(self.effect, tuple(float(v) for v in values), self.window)


def applicable_effects(
    ship: Ship,
    columns: Iterable[str],
    exclude: Iterable[str] = (),
    own: Iterable[Effect] = (),
    turning: bool = False,
    one_way: bool = False,
    steady: bool = False,
) -> list[Effect]:
    """Return the effects that a ship can have and that a recording may identify.

    Example:
        >>> from shaftline.plant import load_ship
        >>> columns = ("time_s", "fuel_rack_mm", "ship_speed_m_s")
        >>> "current" in {effect.id for effect in applicable_effects(load_ship("frigate"), columns)}
        True

    Args:
        ship: the nominal ship; an effect with external signals needs a ship with these signals.
        columns: columns of the recording.
        exclude: ids to leave out.
        own: effects in addition to the catalogue.
        turning: whether the recording turns.
        one_way: whether the shaft turns and is driven one way only.
        steady: whether each row is an equilibrium, so that effects in transients are not identifiable.

    Raises:
        ValueError: an id to leave out is unknown.
    """
    known, left_out = set(columns), set(exclude)
    if SHAFT_POWER in known:  # Shaft power is measured torque times shaft speed.
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
        and not (effect.straight and turning and not ship.turns)
        and not (effect.both_ways and one_way)
        and (acts_at_equilibrium(ship, effect) or not steady)
    ]


def acts_at_equilibrium(ship: Ship, effect: Effect) -> bool:
    """Return whether an effect changes equilibria of a ship that runs straight ahead.

    An effect with a state, or on the rate of the pitch actuator, acts in transients only.
    """
    if effect.balance in ("sway", "yaw"):
        return False
    if effect.term is not None:
        return effect.term.state is None and effect.term.acts_on != "pitch_rate"
    host = effect.on(ship)
    keys = [parameter.key for parameter in effect.parameters]
    return not any(is_transient(host, key) for key in keys if ".episode_" not in key)


def refuse_transient(ship: Ship, keys: Collection[str]) -> None:
    """Refuse parameters on which equilibria do not depend.

    Raises:
        ValueError: gives the parameter.
    """
    for key in keys:
        if is_transient(ship, key):
            raise ValueError(
                f"{key} acts in transients only, and each row of the recording is treated as an "
                "equilibrium; leave it out of --free, or use a recording with at least 1 row per second"
            )


def confusable_ids(effect: Effect, ship: Ship) -> tuple[str, ...]:
    """Return the ids that may be confused with an effect, among those that a ship can have."""
    own = {entry.id for entry in catalogue() if entry.acts_on(ship)}
    return tuple(name for name in effect.confused_with if name in own)


@functools.cache
def catalogue() -> tuple[Effect, ...]:
    """Return all effects of ``catalogue.toml``.

    Example:
        >>> [effect.label for effect in catalogue() if effect.id == "hull-fouling"]
        ['hull-fouling (hull)']
    """
    folder = importlib.resources.files("shaftline.mismatch.search")
    return parse_entries(folder.joinpath("catalogue.toml").read_text("utf-8"))


RANDOM_STATES = 16
"""Number of states of a ship at which a term is evaluated."""


def read_entries(path: Path) -> tuple[Effect, ...]:
    """Return the effects of a user's own catalogue file.

    Args:
        path: TOML file, as described in this module.

    Raises:
        ValueError: the file cannot be read or used; the message gives file, entry and key.
    """
    effects = parse_entries(read_text(path), str(path))
    if not effects:
        needed = "the file has no [[term]] and no [[effect]]; at least one is needed"
        raise ValueError(f"{path}: {needed}")
    for effect in effects:
        if effect.term is not None:
            _refuse_non_neutral(path, effect.label, effect.term)
    return effects


def _refuse_non_neutral(path: Path, label: str, term: Term) -> None:
    """Refuse a term without a state that is not 0 at its neutral size, or is never finite."""
    if term.state is not None:  # The value of a term with a state depends on its history.
        return
    plant = np.zeros(1, PLANT)[0]
    add_term(plant, term, term.external_signals)
    early, own = len(InputSignals._fields), len(TERM_SIGNALS)
    sizes = np.random.default_rng(0).uniform(-20.0, 20.0, (RANDOM_STATES, own + MAX_SIGNALS))
    adds = []
    for signals in [*sizes.tolist(), *np.abs(sizes).tolist()]:
        inputs, loads = InputSignals(*signals[:early]), LoadSignals(*signals[early:own])
        more = (0.0,) * MAX_STATES, tuple(signals[own:])
        added = [
            *sum_input_terms(plant, inputs, *more),
            *sum_load_terms(plant, inputs, loads, *more),
        ]
        adds.append(max(map(abs, added)) if np.isfinite(added).all() else math.nan)
    if np.isnan(adds).all():
        raise ValueError(
            f"{path}: {label}: the expression gives no finite number in any state of the ship; check it "
            "for a division by 0"
        )
    if (most := float(np.nanmax(adds))) > 1e-9:
        size, neutral = next((name, p.value) for name, p in term.parameters.items())
        raise ValueError(
            f"{path}: {label}: at {size} = {neutral:g}, its neutral value, the term adds up to "
            f"{most:.3g}; it must add 0 there, because the neutral value is the ship without the effect"
        )


def parse_entries(text: str, source: str = "catalogue") -> tuple[Effect, ...]:
    """Return the effects of a catalogue.

    Example:
        >>> text = '''
        ... [[term]]
        ... id = "wave-making"
        ... balance = "hull"
        ... acts_on = "resistance"
        ... expression = "c4 * ship_speed ** 4"
        ... [term.parameters]
        ... c4 = { unit = "N s4/m4", low = 0.0, high = 1e4, probes = [0.5, 2.0, 8.0] }
        ... '''
        >>> [effect.label for effect in parse_entries(text)]
        ['wave-making (hull)']

    Args:
        text: TOML, as described in this module.
        source: name of the catalogue in errors.

    Raises:
        ValueError: the message gives the entry, the key and the error.
    """
    tree = parse_toml(text, source)
    effects: list[Effect] = []
    begin: tuple[str | int, ...] = ()  # location of the entry whose own validation fails
    try:
        given = _File.model_validate(tree)
        for kind in ("effect", "term"):
            for k, entry in enumerate(getattr(given, kind)):
                begin = (kind, k)
                effects.append(entry.effect())
    except ValidationError as error:
        lines = [_error_text(source, tree, begin, dict(e)) for e in error.errors()]
        raise ValueError("\n".join(lines)) from None
    labels = [effect.label for effect in effects]
    if twice := [label for label in labels if labels.count(label) > 1]:
        raise ValueError(f'{source}: {twice[0]} occurs twice; name a second form with form = "..."')
    return tuple(effects)


def _error_text(
    source: str, tree: dict[str, Any], begin: tuple[str | int, ...], item: dict[str, Any]
) -> str:
    """Return an error of pydantic at a location in the tree as a sentence with the entry and the key."""
    place = [*begin, *item["loc"]]
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


class _Trial(FileModel):
    """Probes and limits of a parameter, as in :class:`Parameter`."""

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
        """Return the parameter of an effect for a key."""
        fields = {name: getattr(self, name) for name in _Trial.model_fields}
        return Parameter(key, term=term, **fields)


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
            needed = "probes (values at which the parameter is first tried) or set (a fixed value)"
            raise ValueError(f"{needed} is needed")
        return self


class _Entry(FileModel):
    """Description of an effect and the ships to which it applies, as in :class:`Effect`."""

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

    def common_fields(self) -> dict[str, Any]:
        """Return the fields that an effect takes over unchanged."""
        return {name: getattr(self, name) for name in _Entry.model_fields}


class _OfKeys(_Entry):
    """Entry ``[[effect]]``."""

    parameters: tuple[_OfKey, ...] = Field(min_length=1)
    fixed: dict[str, float | str] = Field(default={})
    ties: tuple[tuple[str, str, float], ...] = ()
    windowed: bool = False

    def effect(self) -> Effect:
        fields = self.common_fields() | {"ties": self.ties, "windowed": self.windowed}
        parameters = tuple(p.of_key(p.key) for p in self.parameters)
        return Effect(**fields, parameters=parameters, fixed=tuple(self.fixed.items()))


class _AsTerm(_Entry):
    """Entry ``[[term]]``."""

    acts_on: str
    expression: str
    also: dict[str, str] = Field(default={})
    state: str | None = None
    rate: str | None = None
    parameters: dict[str, _OfTerm] = Field(min_length=1)

    @model_validator(mode="after")
    def _of_a_size(self) -> _AsTerm:
        if next(iter(self.parameters.values())).set is not None:
            size = "the first parameter is the size of the effect"
            raise ValueError(f"parameters: {size} and needs probes, not set")
        return self

    @property
    def term(self) -> Term:
        """Term with neutral parameters."""
        numbers = {
            name: {"value": p.neutral, "unit": p.unit, "low": p.low, "high": p.high}
            for name, p in self.parameters.items()
        }
        name = "-".join(filter(None, (self.id, self.balance, self.form)))
        tree = {"id": name, "acts_on": self.acts_on, "expression": self.expression}
        more = {"also": self.also, "state": self.state, "rate": self.rate}
        given = {key: value for key, value in more.items() if value}
        return Term.model_validate({**tree, **given, "parameters": numbers})

    def effect(self) -> Effect:
        term = self.term
        fields = self.common_fields()
        adds = "; ".join(f"{where} + ({what})" for where, what in term.expressions)
        fields["equation"] = self.equation or adds
        fields["lacks"] = self.lacks or f"the contribution of {self.id.replace('-', ' ')}"
        keyed = [(f"term.{term.id}.{name}", p) for name, p in self.parameters.items()]
        fields["parameters"] = tuple(p.of_key(key, term) for key, p in keyed if p.set is None)
        fields["fixed"] = tuple((key, p.set) for key, p in keyed if p.set is not None)
        return Effect(**fields, term=term)


class _File(FileModel):
    effect: tuple[_OfKeys, ...] = ()
    term: tuple[_AsTerm, ...] = ()


@functools.lru_cache(maxsize=256)
def _with_term(ship: Ship, term: Term | None) -> Ship:
    if term is None or any(own.id == term.id for own in ship.term):
        return ship
    return ship.with_term(term)
