"""The kernels' record of a ship: its fields, collected from the sections, and how it is filled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .actuators import PitchActuator
from .cavitation import CavitationBucket
from .drives import DRIVES
from .emissions import Emissions
from .hull import Hull
from .keys import Section, record_field
from .manoeuvring import Manoeuvring
from .memory import Sensors
from .propeller import Propeller
from .roll import Roll
from .rudder import Rudder
from .shaft import Transmission
from .surroundings import Integration, Water
from .terms import RECORD_FIELDS, Term, add_term
from .ventilation import Ventilation
from .wind import Superstructure

SECTIONS: tuple[type[Section], ...] = (
    Water,
    Hull,
    Superstructure,
    Manoeuvring,
    Rudder,
    Roll,
    Propeller,
    Ventilation,
    CavitationBucket,
    *DRIVES,
    Emissions,
    Transmission,
    PitchActuator,
    Sensors,
    Integration,
)
"""All sections whose parameters the kernels use."""


def _plant_dtype() -> np.dtype[Any]:
    fields: dict[str, tuple[Any, ...]] = {}
    for section in SECTIONS:
        for info in section.model_fields.values():
            if (name := record_field(info)) is not None:
                fields[name] = (name, np.float64)
        fields |= {field[0]: field for field in section.derived}
    fields |= {field[0]: field for field in RECORD_FIELDS}
    fields["drive_min"] = ("drive_min", np.float64)
    fields["prime_mover"] = ("prime_mover", np.int64)
    return np.dtype(list(fields.values()), align=True)


PLANT = _plant_dtype()
"""Structured dtype of a ship in the kernels; an array of it is a batch of ships."""


def record_of(
    sections: Iterable[Section],
    prime_mover: int,
    terms: Iterable[Term] = (),
    signals: Sequence[str] = (),
) -> Any:
    """Return the record of a ship: one element of dtype :data:`PLANT`.

    ``prime_mover`` is the code of its kind, ``signals`` are the names of the external signals in their
    order. Too many terms, or a term that uses another signal, raise a TermError.
    """
    record = np.zeros(1, PLANT)[0]
    for section in sections:
        section.fill(record)
    record["prime_mover"] = prime_mover
    for term in terms:
        add_term(record, term, signals)
    return record
