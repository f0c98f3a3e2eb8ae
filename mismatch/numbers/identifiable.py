"""Which numbers a recording tells apart: by the information that it holds of them together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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
