"""Entries of a catalogue as they stand in a TOML file: the tool's own, and anybody's.

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
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from ...core.files import read_text, toml_of
from ...core.models import FileModel
from ...plant.record import PLANT
from ...plant.term_kernel import MAX_SIGNALS, MAX_STATES, Heard, Loaded, added, added_before
from ...plant.terms import NO_BOUND, TERM_SIGNALS, Term, add_term
from .effect import Effect, Parameter

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
