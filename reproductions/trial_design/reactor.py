"""Batch reactor A -> B -> C of Pyomo.DoE, designed by the planner's D-criterion and exchange.

Wang and Dowling 2022, AIChE Journal 68(12), e17813. The numbers are those that the tests of Pyomo.DoE
check (pyomo/contrib/doe/tests/test_reactor_example.py): the Fisher information of the four Arrhenius
parameters, each scaled by its nominal value, for the concentrations of A, B and C at nine times, with an
error of 1 mol/L. The temperature is piecewise constant between these times.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from shaftline.mismatch.planning.evidence import Noise, Predictions, evidence_of
from shaftline.mismatch.planning.exchange import exchange

Floats = NDArray[np.float64]

TIMES = np.linspace(0.0, 1.0, 9)
"""Times of the measurements, and of the changes of the temperature [h]."""

GAS_CONSTANT = 8.31446261815324e-3
"""[kJ/(mol K)]."""

NOMINAL = {
    "A1": 84.79085853498033,
    "A2": 371.71773413976416,
    "E1": 7.777032028026428,
    "E2": 15.047135137500822,
}
"""Pre-exponential factors [1/h] and activation energies [kJ/mol]."""

TEMPERATURES, CONCENTRATIONS = (300.0, 700.0), (1.0, 5.0)
"""Ranges of the temperature [K] and of the first concentration of A [mol/L]."""

STEP = 1e-4
"""Relative step of the central differences."""

TRIED = 41
"""Number of temperatures and of concentrations between which the exchange chooses."""

STEP_K = (TEMPERATURES[1] - TEMPERATURES[0]) / (TRIED - 1)
"""Distance of the temperatures that are tried [K]."""


ELEMENTS = 4
"""Finite elements in each interval of the temperature: 32 in all, as published."""

NODES = np.array([0.0, (4.0 - math.sqrt(6.0)) / 10.0, (4.0 + math.sqrt(6.0)) / 10.0, 1.0])
"""Start of an element and its three Radau points, as shares of its length."""


def _slopes() -> Floats:
    """Return the derivatives of the Lagrange polynomials at the Radau points, shape (3, 4)."""
    powers = np.arange(len(NODES))
    coefficients = np.linalg.inv(NODES[:, None] ** powers)
    return np.asarray((powers * NODES[1:, None] ** np.maximum(powers - 1, 0)) @ coefficients)


SLOPES = _slopes()


def concentrations(start: float, temperatures: Floats, parameters: Floats) -> Floats:
    """Return the concentrations of A, B and C at :data:`TIMES`, shape (3, 9), by Radau collocation.

    As published, the temperature at the end of an interval is already that of the next one, so that one
    of the three Radau points of an element has it.

    Args:
        start: first concentration of A [mol/L].
        temperatures: temperature from each time on [K], shape (9,).
        parameters: in the order of :data:`NOMINAL`, shape (4,).
    """
    first, second, energy_1, energy_2 = parameters
    length = (TIMES[1] - TIMES[0]) / ELEMENTS
    held = np.repeat(temperatures[:-1], 3 * ELEMENTS).reshape(-1, 3)
    held[ELEMENTS - 1 :: ELEMENTS, 2] = temperatures[1:]
    k1 = first * np.exp(-energy_1 / (GAS_CONSTANT * held))
    k2 = second * np.exp(-energy_2 / (GAS_CONSTANT * held))
    inner, outer = SLOPES[:, 1:] / length, -SLOPES[:, 0] / length
    unit, right = np.eye(3), np.broadcast_to(outer, held.shape)[..., None]
    of_a = np.linalg.solve(inner + unit * k1[:, None, :], right)
    matrix = inner + unit * k2[:, None, :]
    kept = np.linalg.solve(matrix, right)[:, -1, 0]
    made = np.linalg.solve(matrix, k1[..., None] * of_a)[:, -1, 0]
    a, b = start, 0.0
    found = [(a, b)]
    for k, left in enumerate(of_a[:, -1, 0], 1):
        a, b = left * a, kept[k - 1] * b + made[k - 1] * a
        if k % ELEMENTS == 0:
            found.append((a, b))
    values = np.array(found).T
    return np.vstack([values, start - values.sum(axis=0)])


def derivatives(start: float, temperatures: Floats) -> Floats:
    """Return the derivatives of the concentrations by the parameters over their nominal values.

    Shape (4, 3, 9): parameters, species, times.
    """
    nominal = np.array([*NOMINAL.values()])
    found = []
    for k in range(len(nominal)):
        change = np.zeros(len(nominal))
        change[k] = STEP * nominal[k]
        ends = [concentrations(start, temperatures, nominal + sign * change) for sign in (1, -1)]
        found.append((ends[0] - ends[1]) / (2.0 * STEP))
    return np.array(found)


def information(start: float, temperatures: Floats) -> Floats:
    """Return the Fisher information of the scaled parameters, shape (4, 4)."""
    flat = derivatives(start, temperatures).reshape(len(NOMINAL), -1)
    return np.asarray(flat @ flat.T)


PRIOR = np.array(
    [
        [28.67892806, 5.41249739, -81.73674601, -24.02377324],
        [5.41249739, 26.40935036, -12.41816477, -139.23992532],
        [-81.73674601, -12.41816477, 240.46276004, 58.76422806],
        [-24.02377324, -139.23992532, 58.76422806, 767.25584508],
    ]
)
"""Information of earlier experiments in the published example."""


class Design(NamedTuple):
    """An experiment, and the common logarithm of the determinant of the information after it."""

    start: float
    temperatures: Floats
    log10_det: float


def log10_det(start: float, temperatures: Floats) -> float:
    """Return the common logarithm of the determinant of prior and new information."""
    both = PRIOR + information(start, temperatures)
    return float(np.linalg.slogdet(both)[1] / math.log(10.0))


def merit_of(start: float, temperatures: Floats) -> float:
    """Return the planner's merit of one model, with unknowns of unit variance before the experiment."""
    factor = np.linalg.cholesky(PRIOR)
    slopes = derivatives(start, temperatures)
    scaled = scipy.linalg.solve_triangular(factor, slopes.reshape(len(NOMINAL), -1), lower=True)
    effects = scaled.reshape(slopes.shape)
    predicted = concentrations(start, temperatures, np.array([*NOMINAL.values()]))
    none, owners = np.zeros((0, *predicted.shape)), np.zeros(len(NOMINAL), dtype=np.int64)
    predictions = Predictions(predicted[None], none, np.zeros(0, dtype=bool), effects, owners)
    return evidence_of(predictions, [Noise(1.0)] * 3).merit()


def planned() -> Design:
    """Return the experiment that the planner's exchange finds from the published start."""
    ranges = (CONCENTRATIONS, TEMPERATURES)
    levels = np.array([[3.0] * 9, [500.0] + [300.0] * 8])
    choices = {k: np.linspace(*ends, TRIED) for k, ends in enumerate(ranges)}
    found, _ = exchange(levels, choices, lambda x: merit_of(x[0, 0], x[1]), sweeps=20, better=1.0)
    start, temperatures = float(found[0, 0]), found[1]
    return Design(start, temperatures, log10_det(start, temperatures))


class Printed(NamedTuple):
    """A number that the published tests check, and ours."""

    temperature: float
    """First temperature [K]; the others are 300 K, and the first concentration of A is 5 mol/L."""
    prior: bool
    figure: str
    published: float
    ours: float


PUBLISHED = (
    (300.0, False, "log10 trace", 2.96),
    (300.0, False, "row 1, column 2", 1.84),
    (300.0, False, "row 1, column 3", -70.238),
    (570.0, False, "log10 trace", 2.788587),
    (570.0, False, "log10 determinant", 2.821840),
    (570.0, False, "log10 least eigenvalue", -1.012346),
    (579.212348, True, "log10 trace", 3.214432),
    (579.212348, True, "log10 determinant", 6.214118),
)
"""First temperature, whether earlier experiments are added, figure of the information, and its value."""

FIGURES: Mapping[str, Callable[[Floats], float]] = {
    "log10 trace": lambda matrix: math.log10(np.trace(matrix)),
    "log10 determinant": lambda matrix: float(np.linalg.slogdet(matrix)[1]) / math.log(10.0),
    "log10 least eigenvalue": lambda matrix: math.log10(np.linalg.eigvalsh(matrix)[0]),
    "row 1, column 2": lambda matrix: float(matrix[0, 1]),
    "row 1, column 3": lambda matrix: float(matrix[0, 2]),
}
"""Figures of the information, by name."""


def printed_numbers() -> list[Printed]:
    """Return the published numbers beside ours."""
    found = []
    for temperature, prior, figure, published in PUBLISHED:
        matrix = information(CONCENTRATIONS[1], np.array([temperature] + [300.0] * 8))
        ours = FIGURES[figure](matrix + PRIOR if prior else matrix)
        found.append(Printed(temperature, prior, figure, published, ours))
    return found
