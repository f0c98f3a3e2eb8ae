"""Free parameters of an identification, and tests whether recordings identify them."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import Section, ShipParameter, info_of
from ...plant.ship import Ship, ShipError
from ...plant.tolerances import TOLERANCE_OF_KEY

Array = NDArray[np.float64]

AUTO = "auto"  # value in place of keys: all uncertain parameters that the recording identifies

RATIO = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
"""KQ and eta_R: only their ratio is identifiable from the shaft torque."""

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
DOUBTED = {*TOLERANCE_OF_KEY, "hull.thrust_deduction"}
"""Keys of uncertain parameters. Each has a tolerance except the thrust deduction, because only ratios of
mass, resistance and 1 - t are identifiable from the hull balance."""


class Free:
    """Free parameters of a ship, and the ship with other values of them.

    Args:
        ship: nominal ship.
        keys: dotted keys of the ship file.

    Raises:
        ValueError: no key, a key that is no parameter of this ship, or a key that is given twice.

    >>> from shaftline.plant import load_ship
    >>> free = Free(load_ship("frigate"), ["hull.wake_fraction"])
    >>> free.at([0.08]).hull.wake_fraction
    0.08
    """

    def __init__(self, ship: Ship, keys: Sequence[str]) -> None:
        self.ship = ship
        self.keys = tuple(keys)
        if not self.keys:
            raise ValueError(
                f"{ship.name}: no parameter is free; give at least one key of the ship file"
            )
        if twice := [key for i, key in enumerate(self.keys) if key in self.keys[:i]]:
            raise ValueError(f"{ship.name}: the key {twice[0]} is given twice")
        self.numbers = tuple(number_of(ship, key) for key in self.keys)
        self.start = np.array(self.values)

    @property
    def values(self) -> tuple[float, ...]:
        """Values in the ship file."""
        return tuple(number.value for number in self.numbers)

    def at(self, values: Sequence[float]) -> Ship:
        """Return the ship with other values, validated like a ship file.

        Raises:
            ShipError: a value out of range.
        """
        return self.ship.with_values({n.key: value for n, value in self._resolved(values)})

    def _resolved(self, values: Sequence[float]) -> Iterator[tuple[ShipParameter, float]]:
        """Yield the values, with short time constants that the time step can resolve, or 0."""
        for number, value in zip(self.numbers, map(float, values), strict=True):
            short = 0.0 < value < number.info.gap
            yield number, number.info.inside(value) if short else value

    def record(self, values: Sequence[float]) -> Any:
        """Return the ship's record with other values."""
        if not all(number.field for number in self.numbers):
            return self.at(values).record()
        plant = self.ship.record()
        for number, value in self._resolved(values):
            number.write(plant, value)
        return plant

    def on(self, values: Any) -> Ship:
        """Return the ship with other values, shape (n,), without validation.

        The ship serves the equations only: a search may pass through combinations that a ship file does
        not allow, such as an armature faster than the time step.
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
    def scale(self) -> Array:
        """Scale of each parameter: its value, or 1e-3 of its unit if the value is 0."""
        return np.where(self.start != 0.0, np.abs(self.start), 1e-3)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest values of a search: those of a ship file, at most a factor of 50 away."""
        sized, size = self.start != 0.0, np.abs(self.start)
        low, high = np.array([number.search_range for number in self.numbers]).T
        bottom = np.where((low >= 0.0) & sized, size / 50.0, -np.inf)
        return np.maximum(low, bottom), np.minimum(high, np.where(sized, 50.0 * size, np.inf))

    def __contains__(self, key: str) -> bool:
        """Return whether a key is free."""
        return key in self.keys

    def towards(self, values: Sequence[float], wanted: Sequence[float]) -> list[float]:
        """Return wanted values, or nine tenths of the way to a bound that they exceed."""
        found = []
        for number, here, there in zip(self.numbers, values, wanted, strict=True):
            low, high = number.search_range
            if there <= low:
                there = low + 0.1 * (here - low)
            elif there >= high:
                there = high - 0.1 * (high - here)
            found.append(float(there))
        return found


def usual_keys(ship: Ship, *, response: bool = False) -> tuple[str, ...]:
    """Return the keys of the parameters that a method estimates where the user gives none.

    The ship's drive lists them, for a frequency response or for steady states. A hull that moves adds
    its resistance, and its mass for a frequency response. Optional parameters that are 0 in the ship
    file are left out. The torque of a propeller without a constant KQ is scaled by eta_R.
    """
    drive = ship.prime_mover
    keys = [*(drive.response_keys if response else drive.steady_keys)]
    if not ship.has_constant_coefficients:
        kept = [RATIO[1]] if ship.has_propeller else []
        keys = [own for key in keys for own in (kept if key == RATIO[0] else [key])]
    if ship.moves:
        keys += ["hull.mass_kg", RESISTANCE] if response else [RESISTANCE]

    def is_absent(key: str) -> bool:
        section, _, name = key.partition(".")
        table = getattr(ship, section)
        return bool(getattr(table, name) == 0.0 == type(table).model_fields[name].default)

    return tuple(key for key in keys if not is_absent(key))


def parse_free(ship: Ship, free: Sequence[str] | None, default: Sequence[str]) -> Free:
    """Return the free parameters of a method that uses the shaft: the given keys, or the default ones.

    Raises:
        ValueError: as in :class:`Free`, or two keys of which only the ratio is identifiable.
    """
    found = Free(ship, default if free is None else free)
    if set(RATIO) <= set(found.keys):
        raise ValueError(
            f"{ship.name}: only the ratio of {RATIO[0]} and {RATIO[1]} is identifiable from the shaft; "
            "free only one of them"
        )
    return found


def number_of(ship: Ship, key: str) -> ShipParameter:
    """Return a parameter of the ship file; ``field`` is empty if the record holds it in another form.

    Raises:
        ValueError: no such key, or a key whose value is not a float.
    """
    try:
        return ship.parameter(key)
    except ShipError:
        section, _, name = key.partition(".")
        table = getattr(ship, section, None)
        value = getattr(table, name, None)
        if not isinstance(table, Section) or not isinstance(value, float):
            known = ", ".join(k for k in _numbers(ship) if k.startswith(f"{section}."))
            raise ValueError(
                f"{ship.name}: {key} is no parameter of this ship that can be free"
                + (f"; those of [{section}] are {known}" if known else "")
            ) from None
        return ShipParameter(key, value, info_of(type(table).model_fields[name]), "")


@functools.lru_cache(maxsize=32)
def _numbers(ship: Ship) -> tuple[str, ...]:
    """Return the dotted keys of all float parameters of the ship file."""
    found = []
    for section in type(ship).model_fields:
        table = getattr(ship, section)
        if isinstance(table, Section) and section != "tolerances":
            keys = [k for k in type(table).model_fields if isinstance(getattr(table, k), float)]
            found += [f"{section}.{key}" for key in keys]
    return tuple(found)


AT_BOUND = 1e-3
"""Relative distance of an estimate from the end of its range up to which it counts as there."""


def keys_at_bounds(ship: Ship, values: Iterable[tuple[str, float]]) -> list[str]:
    """Return the keys of values at the end of their range, except at 0 and at a value without effect.

    Example:
        >>> from shaftline.plant import load_ship
        >>> keys_at_bounds(load_ship("frigate"), [("hull.mass_kg", 3e6), ("hull.wake_fraction", 0.6)])
        ['hull.wake_fraction']
    """
    ends = []
    for key, value in values:
        if not ship.has_key(key):
            continue
        number = ship.parameter(key)
        bounds = (end for end in number.search_range if end not in (0.0, number.info.neutral))
        if any(math.isclose(value, end, rel_tol=AT_BOUND) for end in bounds):
            ends.append(key)
    return ends


def split_keys(text: str) -> list[str]:
    """Return the keys of a list that is separated by commas.

    Example:
        >>> split_keys("hull.mass_kg, hull.wake_fraction")
        ['hull.mass_kg', 'hull.wake_fraction']
    """
    return [key.strip() for key in text.split(",") if key.strip()]


def read_free_keys(text: str, ship: Ship) -> list[str] | str:
    """Return the keys of the option ``--free``, or ``auto``.

    Raises:
        ValueError: the text has no key; the message gives keys of the ship.
    """
    keys = split_keys(text)
    if not keys:
        raise ValueError(
            f"--free {text!r} contains no key; give {AUTO}, or keys of the ship file separated by "
            f"commas: {', '.join(doubtful(ship))}"
        )
    return AUTO if keys == [AUTO] else keys


def doubtful(ship: Ship) -> list[str]:
    """Return the keys of uncertain parameters: those of :data:`DOUBTED`, and those of active effects."""
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
"""Smallest eigenvalue of the scaled information below which parameters are not distinguishable; for two
parameters, a correlation of 0.9999."""

INDISTINCT = 1e-5
"""Ratio of the smallest to the largest singular value below which parameters are not distinguishable."""

LEAST_CERTAIN = 0.1  # relative standard error above which a parameter is not identifiable


class UnidentifiableError(ValueError):
    """Error for parameters that recordings do not identify; the message names them.

    Args:
        message: message for the user.
        keys: keys of these parameters; the first ones are the best to leave out.
        among: keys of all free parameters; empty if none of them is identifiable.
    """

    def __init__(self, message: str, keys: Sequence[str], among: Sequence[str]) -> None:
        super().__init__(message)
        self.keys = tuple(keys)
        self.among = tuple(among)

    @property
    def worst(self) -> dict[str, str]:
        """Parameters to leave out next, with reasons: one of several that are not distinguishable."""
        if self.among and len(self.keys) > 1:
            first, *others = self.keys
            return {first: _combined(others)}
        return {key: str(self).removeprefix(f"{key} is not identifiable: ") for key in self.keys}

    @property
    def rest(self) -> list[str]:
        """Keys that may then be identifiable."""
        return [key for key in self.among if key not in self.worst]


def _combined(others: Sequence[str]) -> str:
    return f"only its combination with {' and '.join(others)} is identifiable"


def one_direction(information: Array) -> tuple[float, list[int]]:
    """Return the combination of parameters with the least Fisher information, shape (n, n).

    Returns:
        Its eigenvalue with each parameter scaled to 1, and the indices of its parameters.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    made_of = [int(i) for i in np.flatnonzero(np.abs(vectors[:, 0]) > 0.2)]
    return float(values[0]), made_of


def refuse_unidentifiable(keys: Sequence[str], information: Array) -> None:
    """Refuse parameters that are not identifiable from such a recording of any length.

    The Fisher information may have other values after those of the parameters.

    Raises:
        UnidentifiableError: a parameter without influence on the measured channels, or several of which
            only a ratio, product or sum is identifiable; names them.
    """
    own = information[: len(keys), : len(keys)]
    for key, content in zip(keys, np.diag(own), strict=True):
        if not content > 0.0:
            raise UnidentifiableError(
                f"{key} is not identifiable: no measured channel depends on it here", [key], keys
            )
    value, made_of = one_direction(own)
    if value < ALIKE:
        names = [keys[i] for i in made_of]
        message = (
            f"{' and '.join(names)} are not identifiable together: the recording determines only a "
            "combination of them (ratio, product or sum); free one less"
        )
        raise UnidentifiableError(message, names[::-1], keys)


def refuse_indistinct(keys: Sequence[str], jacobian: Array, method: str) -> None:
    """Refuse parameters of which the recording determines only a sum, a ratio or a product.

    Args:
        keys: keys of n parameters.
        jacobian: derivatives of the compared values, shape (rows, n), each column for a relative change
            of its parameter.
        method: name of the method for the message.

    Raises:
        UnidentifiableError: names the parameters that can change together without a change of the
            compared values.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    silent = [key for key, norm in zip(keys, norms, strict=True) if norm <= 1e-12 * norms.max()]
    if silent:
        message = f"{method}: none of the compared values depends on {', '.join(silent)}"
        raise UnidentifiableError(message, silent[:1], keys)
    _, sizes, directions = np.linalg.svd(jacobian / norms, full_matrices=True)
    if len(sizes) == len(keys) and sizes[-1] > INDISTINCT * sizes[0]:
        return
    together = np.abs(directions[-1])
    named = [key for key, part in zip(keys, together, strict=True) if part > 0.05 * together.max()]
    message = f"{method}: the recording does not distinguish {', '.join(named)}; free one less"
    raise UnidentifiableError(message, named[::-1], keys)


def refuse_guesses(keys: Sequence[str], values: Sequence[float], errors: Array) -> None:
    """Refuse the parameter with the largest relative standard error if it exceeds :data:`LEAST_CERTAIN`.

    Estimates and standard errors are in the keys' units.

    Raises:
        UnidentifiableError: names the parameter.
    """
    shares = np.abs(errors / np.where(np.array(values) == 0.0, 1e-300, values))
    worst = int(np.argmax(shares))
    if not shares[worst] <= LEAST_CERTAIN:
        message = f"{keys[worst]} is not identifiable: {_too_uncertain(shares[worst])}"
        raise UnidentifiableError(message, [keys[worst]], keys)


def _too_uncertain(share: float) -> str:
    size = f"{100.0 * share:.2g} %" if share < 10.0 else "more than 1000 %"
    return f"its standard error would be {size} of its value"


def distinguishable(
    keys: Sequence[str], values: Sequence[float], information: Array
) -> tuple[list[int], dict[str, str]]:
    """Return the parameters that a recording identifies well, by dropping the least certain ones.

    Args:
        keys: keys of the parameters.
        values: their values; a standard error below :data:`LEAST_CERTAIN` of the value is accepted.
        information: Fisher information, shape (n, n).

    Returns:
        Indices of the parameters that remain, and the reasons for the others by key.
    """
    rest = [i for i in range(len(keys)) if information[i, i] > 0.0]
    silent = [key for i, key in enumerate(keys) if i not in rest]
    left = dict.fromkeys(silent, "no measured channel depends on it here")
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
            if errors[worst] <= LEAST_CERTAIN:
                break
            why = _too_uncertain(errors[worst])
        left[keys[rest.pop(worst)]] = why
    return rest, left
