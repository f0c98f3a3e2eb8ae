"""Terms: physics as data, expressions in a ship file that are added to the equations.

    [[term]]
    id = "friction-by-direction"
    acts_on = "drive_torque"
    expression = "-c_ahead * step(shaft_speed) + c_astern * step(-shaft_speed)"
    parameters = { c_ahead = 1200.0, c_astern = 900.0 }

    [[term]]
    id = "induced-flow"
    acts_on = "load_torque"
    expression = "-k * abs(shaft_speed) * u"
    also = { thrust = "-c * abs(shaft_speed) * u" }   # the same physics at a second location
    state = "u"                                       # a dynamic state of the term
    rate = "(g * shaft_speed - u) / tau"
    parameters = { k = 0.01, c = 0.2, g = 0.05, tau = 0.4 }

An expression combines numbers, the term's parameters, its state, :data:`TERM_SIGNALS` and the external
signals that the ship declares under ``[signals]`` by ``+ - * / **`` and the functions of
:data:`FUNCTIONS`. It is parsed, never executed: the kernels receive a list of operations on a stack,
stored in the ship record. Operations accept complex numbers, so linear models include the terms.
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
    InputSignals,
    Program,
    TermError,
    names_in,
    parse_expression,
    stack_depth,
)
from .keys import Section

PLACES = {
    "drive": "demand that reaches the prime mover [mm | V | N m]",
    "inflow_velocity": "advance velocity of the propeller [m/s]",
    "thrust": "thrust of one propeller [N]",
    "drive_torque": "torque that drives the shaft, before the torque meter [N m]",
    "load_torque": "load torque of the shaft, behind the torque meter [N m]",
    "resistance": "resistance of the hull [N]",
    "pitch_rate": "rate of the pitch actuator [1/s]",
    "side_force": "force on the hull to starboard [N]",
    "yaw_moment": "moment on the hull to starboard, about midship [N m]",
}
"""Locations in the model at which a term may act, and the quantity to which it is added."""

TERM_SIGNALS = {
    "shaft_speed": "omega [rad/s]",
    "ship_speed": "v_s over ground [m/s]",
    "pitch_ratio": "P/D of the blades [-]",
    "pitch_command": "P/D commanded [-]",
    "drive": "fuel rack [mm], voltage [V] or torque [N m]",
    "advance_velocity": "v_a before its lag and before terms [m/s]",
    "submergence": "depth of the propeller's centre [m]",
    "time": "since the start [s]",
    "sway_speed": "to starboard, over ground [m/s]",
    "yaw_rate": "to starboard [rad/s]",
    "heading": "to starboard of the initial course [rad]",
    "rudder_angle": "positive turns to starboard [rad]",
    "shaft_angle": "angle since the start, or from the first measurement [rad]",
    "thrust": "of one propeller, from its curves [N]",
    "propeller_torque": "M_p, from its curves [N m]",
    "brake_torque": "M_b, from the equations of the prime mover [N m]",
    "resistance": "R, from the equation of the hull [N]",
    "pitch_rate": "of the actuator, from its equation [1/s]",
}
"""Signals that an expression may use; the last five are not known in terms that act on drive or
inflow_velocity."""

TURNING_SIGNALS = {
    "sway_speed": "sway_speed_m_s",
    "yaw_rate": "yaw_rate_rad_s",
    "heading": "heading_rad",
    "rudder_angle": "rudder_rad",
}
"""Signals that only a ship with sway and yaw has, and their columns.

For any other ship they are external signals, which a recording may contain.
"""

_ITS_OWN = frozenset(TERM_SIGNALS) - {*TURNING_SIGNALS}

_EARLY = len(InputSignals._fields)


class Programs(NamedTuple):
    """The programs of all expressions of a term."""

    by_place: tuple[tuple[int, Program], ...]  # index in :data:`PLACES`; the rate of a state last
    literals: tuple[float, ...]  # numbers in the expressions, stored behind the term's parameters


NO_BOUND = (-1e12, 1e12)
"""Lowest and highest value of a parameter without given bounds."""


class TermParameter(FileModel):
    """A parameter of a term, with its unit and range."""

    value: float = Field(description="value, in the unit given beside it")
    unit: str = Field("-", description="unit of value, low and high")
    low: float = Field(NO_BOUND[0], ge=NO_BOUND[0], description="lowest value")
    high: float = Field(NO_BOUND[1], le=NO_BOUND[1], description="highest value")

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, given: Any) -> Any:
        return {"value": given} if isinstance(given, int | float) else given

    @model_validator(mode="after")
    def _inside(self) -> TermParameter:
        if not self.low <= self.value <= self.high:
            raise ValueError(
                f"value = {self.value:g} lies outside its range from low = {self.low:g} to high = "
                f"{self.high:g}"
            )
        return self


Name: TypeAlias = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Place: TypeAlias = Literal[
    "drive",
    "inflow_velocity",
    "thrust",
    "drive_torque",
    "load_torque",
    "resistance",
    "pitch_rate",
    "side_force",
    "yaw_moment",
]
Expression: TypeAlias = Annotated[str, Field(max_length=1000)]


class Term(Section):
    """A term; see the module for the format."""

    id: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60, description="name of the term"
    )
    acts_on: Place = Field(description="location in the model: quantity to which the term is added")
    expression: Expression = Field(description="expression in signals and parameters")
    also: dict[Place, Expression] = Field(
        default={}, description="expressions for further locations, by location"
    )
    state: Name | None = Field(default=None, description="name of a dynamic state of the term")
    rate: Expression | None = Field(default=None, description="rate of the state [per s]")
    parameters: dict[Name, TermParameter] = Field(default_factory=dict, strict=False)

    @model_validator(mode="after")
    def _usable(self) -> Term:
        own = [*self.parameters, *([self.state] if self.state else [])]
        for name in own:
            if name in TERM_SIGNALS or name in FUNCTIONS or own.count(name) > 1:
                raise ValueError(
                    f"{name!r} is already a signal, a function or a name of the term; choose another"
                )
        if (self.state is None) != (self.rate is None):
            raise ValueError(
                "state and rate must be given together: the name of the state and its rate of change"
            )
        if self.acts_on in self.also:
            raise ValueError(
                f"also: {self.acts_on} is the location of the expression; combine both in one expression"
            )
        self.programs(self.external_signals)  # raises an error if an expression is invalid
        return self

    def __hash__(self) -> int:
        """Return a hash of the content, because ships are cached by their content."""
        return hash((self.id, *self.expressions, self.state, tuple(self.parameters.items())))

    @property
    def expressions(self) -> tuple[tuple[str, str], ...]:
        """Each expression with its location; ``rate`` is the location of the state's rate."""
        located = [(str(self.acts_on), self.expression), *self.also.items()]
        return tuple([*located, ("rate", self.rate)] if self.rate is not None else located)

    @property
    def external_signals(self) -> tuple[str, ...]:
        """Names of signals that are not signals of every ship, in the order of their first use.

        They include :data:`TURNING_SIGNALS`, which a ship with sway and yaw has itself.
        """
        own = {*self.parameters, *_ITS_OWN, *FUNCTIONS, self.state}
        names = (name for _, expression in self.expressions for name in names_in(expression))
        return tuple(dict.fromkeys(name for name in names if name not in own))

    def programs(self, signals: Sequence[str], state: int = 0) -> Programs:
        """Return the programs of the term's expressions; a TermError says why an expression is invalid.

        ``signals`` are the ship's external signals in their order, ``state`` is the index of the term's
        state among those of the ship's terms.
        """
        literals: list[float] = []
        programs = []
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
                        f"{expression!r}: {name} is not known yet where {where} is computed; use "
                        "another signal"
                    )
            program = parse_expression(expression, list(self.parameters), names, literals)
            programs.append((place, program))
        return Programs(tuple(programs), tuple(literals))


RECORD_FIELDS = (
    ("term_count", np.int64),
    ("term_programs", np.int64),
    ("term_states", np.int64),
    ("term_early", np.int64),  # number of programs that act on inputs of the models
    ("term_place", np.int64, (MAX_PROGRAMS,)),
    ("term_owner", np.int64, (MAX_PROGRAMS,)),
    ("term_length", np.int64, (MAX_PROGRAMS,)),
    ("term_depth", np.int64, (MAX_PROGRAMS,)),
    ("term_code", np.int16, (MAX_PROGRAMS, MAX_OPERATIONS)),
    ("term_index", np.int16, (MAX_PROGRAMS, MAX_OPERATIONS)),
    ("term_constants", np.float64, (MAX_TERMS, MAX_CONSTANTS)),
)
"""Fields of the ship record for terms."""


def add_term(record: Any, term: Term, signals: Sequence[str] = ()) -> int:
    """Add a term to a ship record, which is changed in place, and return its index.

    ``signals`` are the ship's external signals in their order. A full record, or a term that uses
    another signal, raises a TermError.
    """
    names = ("term_count", "term_programs", "term_states")
    slot, first, state = (int(record[name]) for name in names)
    if slot >= MAX_TERMS:
        raise TermError(f"{term.id}: a ship may have at most {MAX_TERMS} terms")
    if term.state is not None and state >= MAX_STATES:
        raise TermError(f"{term.id}: the terms of a ship may have at most {MAX_STATES} states")
    programs = term.programs(signals, state)
    end = first + len(programs.by_place)
    if end > MAX_PROGRAMS:
        most = f"the terms of a ship may have at most {MAX_PROGRAMS} expressions"
        raise TermError(f"{term.id}: {most}")
    record["term_count"], record["term_programs"] = slot + 1, end
    record["term_states"] = state + (term.state is not None)
    for row, (place, program) in enumerate(programs.by_place, first):
        record["term_place"][row], record["term_owner"][row] = place, slot
        record["term_early"] += place < BEFORE
        record["term_length"][row], record["term_depth"][row] = len(program), stack_depth(program)
        codes, indices = zip(*program, strict=True)
        record["term_code"][row, : len(codes)] = codes
        record["term_index"][row, : len(indices)] = indices
    numbers = [*(p.value for p in term.parameters.values()), *programs.literals]
    record["term_constants"][slot, : len(numbers)] = numbers
    return slot
