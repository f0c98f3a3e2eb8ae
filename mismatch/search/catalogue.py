"""The catalogue: every physical effect that the tool knows by name.

An effect is some keys of the ship's file with values that are not neutral, so its equation stands where
the plant's equations live and a corrected ship is an ordinary ship. The entry adds what an engineer must
be told: equation, balance, what excites it, what it can be mistaken for, what would tell them apart.
"""

from __future__ import annotations

import functools
import importlib.resources
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ...plant.keys import Number
from ...plant.ship import Ship
from ...plant.ship_errors import ShipError
from ...plant.terms import Term


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
        term: of which it is a number, where the effect is a term of the ship and not a key of its own.
        least: distance from the neutral value below which something else looks the same, and the
            effect is not named; in the key's own unit.
    """

    key: str
    probes: tuple[float, ...]
    of: str = "unit"
    signed: bool = False
    absolute: bool = False
    least: float = 0.0
    term: Term | None = None

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
        excitation: what the recording must do for the effect to show.
        confused_with: ids that a recording may not be able to tell from it.
        split_by: manoeuvre or sensor that would.
        fixed: keys that are set with it, by a mean of the nominal simulation.
        ties: keys that follow a parameter: (key, parameter's key, factor).
        needs: columns without which it cannot be tried.
        windowed: acts for a time, whose start and end are fitted too.
        form: what tells it from an entry of the same id and balance.
        term: that the effect is, with its numbers at values that change nothing; None where the
            parameters are keys of the ship's file.
        applies_to: what a ship must be, as its properties say: ``has_diesel``, ``has_voltage``,
            ``has_propeller``, ``has_line_shaft``, ``has_variable_pitch``; beside having the balance
            and the keys.
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
    fixed: tuple[tuple[str, str], ...] = ()
    ties: tuple[tuple[str, str, float], ...] = ()
    needs: tuple[str, ...] = ()
    windowed: bool = False
    form: str = ""
    applies_to: tuple[str, ...] = ()
    term: Term | None = None

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
        if not all(getattr(ship, what) for what in self.applies_to):
            return False
        try:
            host = self.on(ship)
        except ShipError:
            return False
        return all(host.has_key(parameter.key) for parameter in self.parameters)

    @property
    def label(self) -> str:
        """Id and balance, for friction may act in several; and the form where there are some."""
        return f"{self.id} ({self.balance}{', ' + self.form if self.form else ''})"


@functools.cache
def catalogue() -> tuple[Effect, ...]:
    """Every entry, as ``catalogue.toml`` states them."""
    text = (
        importlib.resources.files("shaftline.mismatch.search")
        .joinpath("catalogue.toml")
        .read_text("utf-8")
    )
    return entries_of(text)


def entries_of(text: str) -> tuple[Effect, ...]:
    """Entries from the text of a catalogue.

    An entry that needs no code has a ``term`` (see :mod:`shaftline.plant.terms`) and gives its
    parameters ``unit``, ``low`` and ``high``; their keys are then the names in the term's expression.
    """
    return tuple(_entry(item) for item in tomllib.loads(text)["effect"])


@functools.lru_cache(maxsize=256)
def _carrying(ship: Ship, term: Term | None) -> Ship:
    if term is None or any(own.id == term.id for own in ship.term):
        return ship
    return ship.with_term(term)


def _term(item: dict[str, Any]) -> Term | None:
    """The entry's term, if it has one; its parameters' keys become those of the ship's file."""
    given = item.pop("term", None)
    if given is None:
        return None
    name = "-".join(filter(None, (item["id"], item["balance"], item.get("form", ""))))
    numbers = {}
    for parameter in item["parameters"]:
        own = {k: parameter.pop(k) for k in ("unit", "low", "high", "neutral") if k in parameter}
        numbers[parameter["key"]] = {"value": own.pop("neutral", 0.0), **own}
        parameter["key"] = f"term.{name}.{parameter['key']}"
    return Term.model_validate({"id": name, **given, "parameters": numbers})


def _entry(item: dict[str, Any]) -> Effect:
    item["term"] = _term(item)
    parameters = tuple(
        Parameter(**{**p, "probes": tuple(p["probes"]), "term": item["term"]})
        for p in item.pop("parameters")
    )
    for key in ("confused_with", "needs", "applies_to"):
        item[key] = tuple(item.get(key, ()))
    item["ties"] = tuple((key, of, float(factor)) for key, of, factor in item.get("ties", ()))
    item["fixed"] = tuple(item.get("fixed", {}).items())
    return Effect(parameters=parameters, **item)


def mistaken_for(effect: Effect, ship: Ship) -> tuple[str, ...]:
    """Ids that a recording of a ship may not be able to tell from an effect; only what it can have."""
    own = {entry.id for entry in catalogue() if entry.acts_on(ship)}
    return tuple(name for name in effect.confused_with if name in own)


def applicable(ship: Ship, columns: Iterable[str], exclude: Iterable[str] = ()) -> list[Effect]:
    """Entries that a ship can have and a recording could show.

    Args:
        ship: the nominal ship.
        columns: of the recording.
        exclude: ids to leave out.

    Raises:
        ValueError: an id to leave out is unknown.
    """
    known, left_out = set(columns), set(exclude)
    unknown = left_out - {effect.id for effect in catalogue()}
    if unknown:
        names = ", ".join(sorted({effect.id for effect in catalogue()}))
        raise ValueError(f"unknown effect {sorted(unknown)[0]!r}; known: {names}")
    return [
        effect
        for effect in catalogue()
        if effect.id not in left_out and set(effect.needs) <= known and effect.acts_on(ship)
    ]
