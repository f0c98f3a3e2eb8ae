"""Physics as data: what an expression in a ship's file adds to the equations.

    [[term]]
    id = "friction-by-direction"
    acts_on = "drive_torque"
    expression = "-c_ahead * step(shaft_speed) + c_astern * step(-shaft_speed)"
    parameters = { c_ahead = 1200.0, c_astern = 900.0 }

    [[term]]
    id = "induced-flow"
    acts_on = "load_torque"
    expression = "-k * abs(shaft_speed) * u"
    also = { thrust = "-c * abs(shaft_speed) * u" }   # the same physics at another place
    state = "u"                                       # with a memory of its own
    rate = "(g * shaft_speed - u) / tau"
    parameters = { k = 0.01, c = 0.2, g = 0.05, tau = 0.4 }

An expression is numbers, the term's parameters, its state, :data:`TERM_SIGNALS` and the signals from
outside that the ship's ``[signals]`` name, joined by ``+ - * / **`` and the functions of
:data:`FUNCTIONS`. It is parsed, never run: what the kernels see is a list of operations on a stack,
carried in the ship's record. Complex numbers pass, so linear models know the terms too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from ..core.models import FileModel
from .expressions import (
    BEFORE,
    FIRST_SIGNAL,
    FIRST_STATE,
    FUNCTIONS,
    MAX_CONSTANTS,
    MAX_OPERATIONS,
    MAX_PROGRAMS,
    MAX_STATES,
    MAX_TERMS,
    Heard,
    Program,
    TermError,
    deepest,
    names_in,
    parsed,
)
from .keys import Section

PLACES = {
    "drive": "demand that reaches the prime mover [mm | V | N m]",
    "inflow_velocity": "advance velocity of the propeller [m/s]",
    "thrust": "thrust of one propeller [N]",
    "drive_torque": "torque that drives the shaft, before the gauge [N m]",
    "load_torque": "torque that the shaft bears, behind the gauge [N m]",
    "resistance": "resistance of the hull [N]",
    "pitch_rate": "rate of the pitch actuator [1/s]",
    "side_force": "force on the hull to starboard [N]",
    "yaw_moment": "moment on the hull to starboard, about midship [N m]",
}
"""Where a term may act, and what it adds to."""

TERM_SIGNALS = {
    "shaft_speed": "omega [rad/s]",
    "ship_speed": "v_s over ground [m/s]",
    "pitch_ratio": "P/D of the blades [-]",
    "pitch_command": "P/D commanded [-]",
    "drive": "fuel rack [mm], voltage [V] or torque [N m]",
    "advance_velocity": "v_a before it lags and terms act on it [m/s]",
    "submergence": "of the propeller's centre [m]",
    "time": "since the start [s]",
    "sway_speed": "to starboard, over ground [m/s]",
    "yaw_rate": "to starboard [rad/s]",
    "heading": "to starboard of the first course [rad]",
    "rudder_angle": "positive turns to starboard [rad]",
    "shaft_angle": "turned since the start, or as measured at first [rad]",
    "thrust": "of one propeller, by its curves [N]",
    "propeller_torque": "M_p, by its curves [N m]",
    "brake_torque": "M_b, by the prime mover's own equations [N m]",
    "resistance": "R, by the hull's own equation [N]",
    "pitch_rate": "of the actuator, by its own equation [1/s]",
}
"""What an expression may use; the last five are not yet known where drive or
inflow_velocity are formed."""

OF_A_TURN = {
    "sway_speed": "sway_speed_m_s",
    "yaw_rate": "yaw_rate_rad_s",
    "heading": "heading_rad",
    "rudder_angle": "rudder_rad",
}
"""Signals that a ship has that turns, and their columns; any other ship hears them from outside, where a
recording has them."""

_ITS_OWN = frozenset(TERM_SIGNALS) - {*OF_A_TURN}

_EARLY = len(Heard._fields)


class Programs(NamedTuple):
    """All of a term's expressions as the kernels take them."""

    by_place: tuple[tuple[int, Program], ...]  # among :data:`PLACES`; the rate of a state last
    literals: tuple[float, ...]  # numbers that stand in them, behind the term's parameters


NO_BOUND = (-1e12, 1e12)
"""Lowest and highest value of a parameter for which none is given."""


class TermParameter(FileModel):
    """A number of a term, with its unit and range."""

    value: float = Field(description="in the unit beside it")
    unit: str = Field("-", description="of value, low and high")
    low: float = Field(NO_BOUND[0], ge=NO_BOUND[0], description="lowest value")
    high: float = Field(NO_BOUND[1], le=NO_BOUND[1], description="highest value")

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, given: Any) -> Any:
        return {"value": given} if isinstance(given, int | float) else given

    @model_validator(mode="after")
    def _inside(self) -> TermParameter:
        if not self.low <= self.value <= self.high:
            raise ValueError(f"{self.value:g} lies outside {self.low:g} to {self.high:g}")
        return self


Name: TypeAlias = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Place: TypeAlias = Literal[
    "drive", "inflow_velocity", "thrust", "drive_torque", "load_torque", "resistance", "pitch_rate",
    "side_force", "yaw_moment",
]  # fmt: skip
Expression: TypeAlias = Annotated[str, Field(max_length=1000)]


class Term(Section):
    """One term; see the module."""

    id: Annotated[
        str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60, description="its name")
    ]
    acts_on: Place = Field(description="what the expression adds to")
    expression: Expression = Field(description="in signals and parameters")
    also: dict[Place, Expression] = Field(
        default={}, description="expressions that add to more, by what they add to"
    )
    state: Name | None = Field(default=None, description="name of a state of its own")
    rate: Expression | None = Field(default=None, description="of the state [per s]")
    parameters: dict[Name, TermParameter] = Field(default_factory=dict, strict=False)

    @model_validator(mode="after")
    def _usable(self) -> Term:
        own = [*self.parameters, *([self.state] if self.state else [])]
        for name in own:
            if name in TERM_SIGNALS or name in FUNCTIONS or own.count(name) > 1:
                raise ValueError(f"{name!r}: a name of its own is needed")
        if (self.state is None) != (self.rate is None):
            raise ValueError("state and rate go together: the state's name and how fast it changes")
        if self.acts_on in self.also:
            raise ValueError(f"also: {self.acts_on} is acted on by expression already")
        self.programs(self.hears)  # raises what is wrong with it
        return self

    def __hash__(self) -> int:
        """Of its content, for ships are kept by theirs."""
        return hash((self.id, *self.expressions, self.state, tuple(self.parameters.items())))

    @property
    def expressions(self) -> tuple[tuple[str, str], ...]:
        """What it acts on with each of its expressions; ``rate`` is that of its state."""
        found = [(str(self.acts_on), self.expression), *self.also.items()]
        return tuple([*found, ("rate", self.rate)] if self.rate is not None else found)

    @property
    def hears(self) -> tuple[str, ...]:
        """Signals from outside the ship that it uses, in the order in which they are named.

        Those of :data:`OF_A_TURN` are among them, which a ship that turns has herself.
        """
        own = {*self.parameters, *_ITS_OWN, *FUNCTIONS, self.state}
        found: dict[str, None] = {}
        for _, expression in self.expressions:
            for name in names_in(expression):
                if name not in own:
                    found[name] = None
        return tuple(found)

    def programs(self, signals: Sequence[str], state: int = 0) -> Programs:
        """Its expressions as the kernels take them.

        Args:
            signals: from outside that the ship hears, in their order.
            state: place of its own state among those of the ship's terms.

        Raises:
            TermError: what is wrong with one of them.
        """
        literals: list[float] = []
        found = []
        for where, expression in self.expressions:
            place = len(PLACES) + state if where == "rate" else list(PLACES).index(where)
            known = list(TERM_SIGNALS)[: _EARLY if place < BEFORE else None]
            names = {name: i for i, name in enumerate(known)}
            if self.state is not None:
                names[self.state] = FIRST_STATE + state
            names |= {name: FIRST_SIGNAL + i for i, name in enumerate(signals)}
            for name in names_in(expression):
                if name in TERM_SIGNALS and name not in names:
                    raise TermError(
                        f"{expression!r}: {name} is not yet known where {where} is formed"
                    )
            found.append((place, parsed(expression, list(self.parameters), names, literals)))
        return Programs(tuple(found), tuple(literals))


RECORD_FIELDS = (
    ("term_count", np.int64),
    ("term_programs", np.int64),
    ("term_states", np.int64),
    ("term_early", np.int64),  # programs that act before the parts do
    ("term_place", np.int64, (MAX_PROGRAMS,)),
    ("term_owner", np.int64, (MAX_PROGRAMS,)),
    ("term_length", np.int64, (MAX_PROGRAMS,)),
    ("term_depth", np.int64, (MAX_PROGRAMS,)),
    ("term_code", np.int64, (MAX_PROGRAMS, MAX_OPERATIONS)),
    ("term_index", np.int64, (MAX_PROGRAMS, MAX_OPERATIONS)),
    ("term_constants", np.float64, (MAX_TERMS, MAX_CONSTANTS)),
)
"""What a ship's record holds of its terms."""


def add_term(record: Any, term: Term, signals: Sequence[str] = ()) -> int:
    """Put a term into a ship's record, in the next free place; gives the place's number.

    Args:
        record: of the ship.
        term: the term.
        signals: from outside that the ship hears, in their order.

    Raises:
        TermError: the record is full, or the term uses a signal that the ship does not hear.
    """
    slot, first, state = (
        int(record[name]) for name in ("term_count", "term_programs", "term_states")
    )
    if slot >= MAX_TERMS:
        raise TermError(f"{term.id}: a ship carries at most {MAX_TERMS} terms")
    if term.state is not None and state >= MAX_STATES:
        raise TermError(f"{term.id}: a ship's terms have at most {MAX_STATES} states")
    programs = term.programs(signals, state)
    end = first + len(programs.by_place)
    if end > MAX_PROGRAMS:
        raise TermError(f"{term.id}: a ship's terms have at most {MAX_PROGRAMS} expressions")
    record["term_count"], record["term_programs"] = slot + 1, end
    record["term_states"] = state + (term.state is not None)
    for row, (place, program) in enumerate(programs.by_place, first):
        record["term_place"][row], record["term_owner"][row] = place, slot
        record["term_early"] += place < BEFORE
        record["term_length"][row], record["term_depth"][row] = len(program), deepest(program)
        codes, indices = zip(*program, strict=True)
        record["term_code"][row, : len(codes)] = codes
        record["term_index"][row, : len(indices)] = indices
    numbers = [*(p.value for p in term.parameters.values()), *programs.literals]
    record["term_constants"][slot, : len(numbers)] = numbers
    return slot
