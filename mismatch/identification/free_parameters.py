"""The numbers of a ship's file that an identification may move.

Which numbers a recording tells apart: by the information that it holds of them together.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import Number, Section, info_of
from ...plant.ship import Ship, ShipError
from ...plant.tolerances import TOLERATED

AUTO = "auto"
"""In place of keys: those that the recording tells, of all that a ship's file may be wrong about."""

RATIO = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
"""KQ and eta_R: torque on the shaft tells their ratio and nothing else."""


RESISTANCE = "hull.resistance_coefficient_N_s2_m2"

DOUBTED = {*TOLERATED, "hull.thrust_deduction"}
"""Keys of numbers that a file may be wrong about. A tolerance speaks of each but the thrust deduction:
of mass, resistance and 1 - t the hull's balance tells but ratios."""


class Free:
    """Some numbers of a ship, and the ship at other values of them.

    Args:
        ship: nominal.
        keys: dotted keys of its file.

    Raises:
        ValueError: a key that is no number of this ship, or one that is given twice; names it.
    """

    def __init__(self, ship: Ship, keys: Sequence[str]) -> None:
        self.ship = ship
        self.keys = tuple(keys)
        if not self.keys:
            raise ValueError(f"{ship.name}: no number is free: name at least one key of its file")
        if twice := [key for i, key in enumerate(self.keys) if key in self.keys[:i]]:
            raise ValueError(f"{ship.name}: {twice[0]} is given twice")
        self.numbers = tuple(number_of(ship, key) for key in self.keys)
        self.start = np.array(self.values)

    @property
    def values(self) -> tuple[float, ...]:
        """As the ship's file has them."""
        return tuple(number.value for number in self.numbers)

    def at(self, values: Sequence[float]) -> Ship:
        """The ship with other values, validated like a file.

        Raises:
            ShipError: a value out of range.
        """
        return self.ship.with_values(dict(zip(self.keys, self._resolved(values), strict=True)))

    def _resolved(self, values: Sequence[float]) -> list[float]:
        """Return the values, each time constant at what the time step resolves, or at 0."""
        found = []
        for number, value in zip(self.numbers, map(float, values), strict=True):
            short = 0.0 < value < number.info.gap
            found.append(number.info.inside(value) if short else value)
        return found

    def record(self, values: Sequence[float]) -> Any:
        """Its record for the kernels."""
        if not all(number.field for number in self.numbers):
            return self.at(values).record()
        plant = self.ship.record()
        for number, value in zip(self.numbers, self._resolved(values), strict=True):
            number.write(plant, value)
        return plant

    def on(self, values: Any) -> Ship:
        """A ship with other values of these numbers, shape (n,).

        For the equations alone: values inside their ranges are not checked against each other, so
        that a search may pass where an armature is faster than the ship's time step.
        """
        ship = self.ship
        for key, value in zip(self.keys, values, strict=True):
            section, _, name = key.partition(".")
            if section == "term":
                ship = ship.with_values({key: float(value)})
                continue
            table = getattr(ship, section).model_copy(update={name: float(value)})
            ship = ship.model_copy(update={section: table})
        return ship

    @property
    def scale(self) -> NDArray[np.float64]:
        """Size by which each number is varied: its own value, or 1e-3 of its unit where that is 0."""
        return np.where(self.start != 0.0, np.abs(self.start), 1e-3)

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest values that a search may try: within the file's, and within a factor of
        50 of a number that has a size.
        """
        sized = self.start != 0.0
        low, high = np.array([number.searched for number in self.numbers]).T
        wide = 50.0 * np.abs(self.start)
        bottom = np.where((low >= 0.0) & sized, np.abs(self.start) / 50.0, -np.inf)
        top = np.where(sized, np.maximum(wide, np.abs(self.start)), np.inf)
        return np.maximum(low, bottom), np.minimum(high, top)

    def __contains__(self, key: str) -> bool:
        """Whether a number is among them."""
        return key in self.keys

    def towards(self, values: Sequence[float], wanted: Sequence[float]) -> list[float]:
        """From values to others, but at most nine tenths of the way to a bound that is beyond."""
        found = []
        for number, here, there in zip(self.numbers, values, wanted, strict=True):
            low, high = number.searched
            if there <= low:
                there = low + 0.1 * (here - low)
            elif there >= high:
                there = high - 0.1 * (high - here)
            found.append(float(there))
        return found


def usual_keys(ship: Ship, *, response: bool = False) -> tuple[str, ...]:
    """Return the keys of the parameters that a method frees where the user names none.

    The ship's drive lists them. A hull that moves adds its resistance, and to a frequency response its
    mass. An optional number that the file leaves at 0 is left out. The torque of a propeller that has
    no constant KQ is scaled by eta_R.

    Args:
        ship: nominal ship.
        response: whether a frequency response is to identify them, instead of steady states.
    """
    drive = ship.prime_mover
    keys = [*(drive.response_keys if response else drive.steady_keys)]
    if not ship.has_constant_coefficients:
        kept = [RATIO[1]] if ship.has_propeller else []
        keys = [own for key in keys for own in (kept if key == RATIO[0] else [key])]
    if ship.moves:
        keys += ["hull.mass_kg", RESISTANCE] if response else [RESISTANCE]
    return tuple(key for key in keys if not _is_absent(ship, key))


def _is_absent(ship: Ship, key: str) -> bool:
    """Whether a key is optional and the file leaves it at 0."""
    section, _, name = key.partition(".")
    table = getattr(ship, section)
    default: object = type(table).model_fields[name].default
    return bool(getattr(table, name) == 0.0 == default)


def freed(ship: Ship, free: Sequence[str] | None, default: Sequence[str]) -> Free:
    """The numbers that a method finds on a shaft.

    Args:
        ship: the ship.
        free: dotted keys; None for ``default``.
        default: what the method finds where nothing is named.

    Raises:
        ValueError: as of :class:`Free`, or two keys of which only the ratio acts.
    """
    found = Free(ship, default if free is None else free)
    if set(RATIO) <= set(found.keys):
        raise ValueError(
            f"{ship.name}: only the ratio of {RATIO[0]} and {RATIO[1]} acts on the shaft; free one of "
            "the two"
        )
    return found


def number_of(ship: Ship, key: str) -> Number:
    """A number of a ship's file; its ``field`` is empty where the record holds it in another form.

    Raises:
        ValueError: no such key, or one that is not a number.
    """
    try:
        return ship.number(key)
    except ShipError:
        section, _, name = key.partition(".")
        table = getattr(ship, section, None)
        value = getattr(table, name, None)
        if not isinstance(table, Section) or not isinstance(value, float):
            known = ", ".join(k for k in _numbers(ship) if k.startswith(f"{section}."))
            raise ValueError(
                f"{ship.name}: {key} is no number of this ship that can be free"
                + (f"; of [{section}]: {known}" if known else "")
            ) from None
        return Number(key, value, info_of(type(table).model_fields[name]), "")


@functools.lru_cache(maxsize=32)
def _numbers(ship: Ship) -> tuple[str, ...]:
    """Dotted keys of every number that stands in the ship's file."""
    found = []
    for section in type(ship).model_fields:
        table = getattr(ship, section)
        if isinstance(table, Section) and section != "tolerances":
            found += [
                f"{section}.{key}"
                for key in type(table).model_fields
                if isinstance(getattr(table, key), float)
            ]
    return tuple(found)


def doubtful(ship: Ship) -> list[str]:
    """Keys that a ship's file may be wrong about: those of :data:`DOUBTED`, and effects in force."""
    found = []
    for key in _numbers(ship):
        number = number_of(ship, key)
        in_force = number.info.neutral is not None and number.value != number.info.neutral
        section, _, name = key.partition(".")
        stated = name in getattr(ship, section).model_fields_set
        if stated and (in_force or (key in DOUBTED and number.value != 0.0)):
            found.append(key)
    return found


ALIKE = 1e-4
"""Smallest eigenvalue of the scaled information below which numbers cannot be told from each other; of
two numbers, a correlation of 0.9999."""

INDISTINCT = 1e-5
"""Least singular value, over the largest, of numbers that act each in its own way."""

TELLING = 0.1
"""Relative standard error above which a number is not found but guessed at."""


class UntoldError(ValueError):
    """Numbers that recordings do not tell; the message names them.

    Args:
        message: for the reader.
        keys: of the numbers, the ones first that had best stay as they are.
        among: of all that were to be found; none where not one of them is told.
    """

    def __init__(self, message: str, keys: Sequence[str], among: Sequence[str]) -> None:
        super().__init__(message)
        self.keys = tuple(keys)
        self.among = tuple(among)

    @property
    def worst(self) -> dict[str, str]:
        """What to leave out next, one at a time where the others may be told without it; and why."""
        if self.among and len(self.keys) > 1:
            first, *others = self.keys
            return {first: _combined(others)}
        return {key: str(self).removeprefix(f"{key} cannot be found: ") for key in self.keys}

    @property
    def rest(self) -> list[str]:
        """What may then be told."""
        return [key for key in self.among if key not in self.worst]


def _combined(others: Sequence[str]) -> str:
    return f"only its combination with {' and '.join(others)} is told"


def one_direction(information: NDArray[np.float64]) -> tuple[float, list[int]]:
    """The combination of numbers that is known worst.

    Args:
        information: Fisher information, shape (n, n).

    Returns:
        Its eigenvalue after each number was scaled to 1, and the numbers that it is made of.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    made_of = [int(i) for i in np.flatnonzero(np.abs(vectors[:, 0]) > 0.2)]
    return float(values[0]), made_of


def refuse_unidentifiable(keys: Sequence[str], information: NDArray[np.float64]) -> None:
    """Refuse numbers that no length of such a recording would tell.

    Args:
        keys: of the numbers.
        information: of them, and of anything else after them.

    Raises:
        UntoldError: a number that acts on nothing measured, or several of which only a ratio, product
            or sum matters; names them.
    """
    own = information[: len(keys), : len(keys)]
    for key, told in zip(keys, np.diag(own), strict=True):
        if not told > 0.0:
            raise UntoldError(
                f"{key} cannot be found: it moves nothing that is measured here", [key], keys
            )
    value, made_of = one_direction(own)
    if value < ALIKE:
        names = [keys[i] for i in made_of]
        raise UntoldError(
            f"{' and '.join(names)} cannot be found together: the recording tells only a combination "
            "of them (their ratio, product or sum); leave one of them as it is",
            names[::-1], keys,
        )  # fmt: skip


def refuse_indistinct(keys: Sequence[str], jacobian: NDArray[np.float64], method: str) -> None:
    """Refuse numbers of which the recording tells a sum, a ratio or a product only.

    Args:
        keys: of the numbers, n of them.
        jacobian: of what the method compares, by number, shape (rows, n); each column in units of the
            number's own size.
        method: named in the error.

    Raises:
        UntoldError: names the numbers that can change together without any change of what is compared.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    silent = [key for key, norm in zip(keys, norms, strict=True) if norm <= 1e-12 * norms.max()]
    if silent:
        raise UntoldError(
            f"{method}: nothing that it compares depends on {', '.join(silent)}", silent[:1], keys
        )
    _, sizes, directions = np.linalg.svd(jacobian / norms, full_matrices=True)
    if len(sizes) == len(keys) and sizes[-1] > INDISTINCT * sizes[0]:
        return
    together = np.abs(directions[-1])
    named = [key for key, part in zip(keys, together, strict=True) if part > 0.05 * together.max()]
    raise UntoldError(
        f"{method}: the recording does not tell {', '.join(named)} apart; leave out one of them",
        named[::-1], keys,
    )  # fmt: skip


def refuse_guesses(
    keys: Sequence[str], values: Sequence[float], errors: NDArray[np.float64]
) -> None:
    """Refuse the parameter whose standard error is the largest share of it, if above :data:`TELLING`.

    Args:
        keys: of the parameters.
        values: as they were found.
        errors: standard error of each, in its key's unit.

    Raises:
        UntoldError: names it.
    """
    shares = np.abs(errors / np.where(np.array(values) == 0.0, 1e-300, values))
    worst = int(np.argmax(shares))
    if not shares[worst] <= TELLING:
        raise UntoldError(
            f"{keys[worst]} cannot be found: its standard error would be {_percent(shares[worst])} "
            "of it",
            [keys[worst]], keys,
        )  # fmt: skip


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 10.0 else "more than 1000 %"


def told_apart(
    keys: Sequence[str], values: Sequence[float], information: NDArray[np.float64]
) -> tuple[list[int], dict[str, str]]:
    """The largest part of some numbers that a recording tells well, by dropping the worst told.

    Args:
        keys: of the numbers.
        values: of each; the one is told well whose standard error is below :data:`TELLING` of it.
        information: Fisher information, shape (n, n).

    Returns:
        Indices of those that remain, and why each of the others does not.
    """
    left: dict[str, str] = {}
    rest = []
    for i, key in enumerate(keys):
        if information[i, i] > 0.0:
            rest.append(i)
        else:
            left[key] = "it moves nothing that is measured here"
    while rest:
        own = information[np.ix_(rest, rest)]
        eigenvalue, made_of = one_direction(own)
        sizes = np.abs([values[i] for i in rest])
        alone = 1.0 / np.sqrt(np.diag(own)) / sizes
        if eigenvalue < ALIKE:
            worst = max(made_of, key=lambda i: alone[i])
            others = [keys[rest[i]] for i in made_of if i != worst]
            why = _combined(others)
        else:
            errors = np.sqrt(np.diag(np.linalg.inv(own))) / sizes
            worst = int(np.argmax(errors))
            if errors[worst] <= TELLING:
                break
            why = f"its standard error would be {_percent(errors[worst])} of it"
        left[keys[rest.pop(worst)]] = why
    return rest, left
