"""What an entry of a catalogue is: an effect and its parameters."""

from __future__ import annotations

import functools
from dataclasses import dataclass

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
