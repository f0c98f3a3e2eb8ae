"""Open-water curves: the Wageningen B-series, and tables of measured KT and KQ.

B-series: KT and KQ are polynomials in advance ratio J, pitch ratio P/D, expanded area ratio and number
of blades (Oosterveld & van Oossanen 1975; coefficients as in Bernitsas, Ray & Kinley 1981, Re 2e6). For
one propeller the last two are constants, so each curve is a 5 x 4 matrix in P/D and J.

Tables: KT and KQ over J, at one pitch ratio or several. Over J the curves are monotone cubics between
the entries (PCHIP; Fritsch & Butland 1984): they pass through every entry, rise and fall with the
entries, and have no kinks. Over P/D they are cubics with the slopes of the parabola through three
neighbours. Outside the table they are constant.
"""

from __future__ import annotations

import csv
import functools
import itertools
import math
from importlib import resources
from typing import Annotated, Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from ..core.compiled import Real, Record, compiled, compiled_apart, compiled_polynomial
from ..core.lanes import where
from ..core.numeric import clip, newton_step, start_between
from .keys import Section

PITCH_POWERS = (0, 1, 2, 3, 6)  # powers of P/D in the B-series
J_POWERS = 4
CURVE_SHAPE = (len(PITCH_POWERS), J_POWERS)

MIN_ADVANCE_RATIO, MAX_ADVANCE_RATIO = -0.25, 1.6
"""Range of J outside which the curves are held constant, because the polynomials diverge.

KQ falls monotonically with J over the whole range for B5-90 at P/D 0.8 to 1.4 (to J 1.43 at P/D 0.6).
"""

REVOLUTIONS_PER_RADIAN = 0.5 / math.pi
MIN_REVOLUTIONS = 1e-3  # 1/s; keeps J finite at standstill, where thrust and torque vanish


class _PolynomialTerm(NamedTuple):
    """Term of a B-series polynomial: a coefficient and the powers of its factors."""

    curve: str
    coefficient: float
    j: int
    pitch_ratio: int
    expanded_area_ratio: int
    blades: int


@functools.cache
def _polynomials() -> list[_PolynomialTerm]:
    # Without pandas, because every ship needs this table and the import of pandas takes long.
    with resources.files("shaftline.plant").joinpath("data/b_series_polynomials.csv").open() as f:
        _, *rows = csv.reader(f)
    return [_PolynomialTerm(curve, float(c), *map(int, powers)) for curve, c, *powers in rows]


@functools.lru_cache(maxsize=64)
def b_series(curve: str, expanded_area_ratio: float, blades: int) -> NDArray[np.float64]:
    """Return the coefficients of a B-series polynomial (``"KT"`` or ``"KQ"``) for one propeller.

    The expanded area ratio is 0.3 to 1.05, the number of blades 2 to 7. The matrix has shape (5, 4):
    entry [k, i] multiplies (P/D)**PITCH_POWERS[k] J**i (Bernitsas, Ray & Kinley 1981, eqs. (1) and (2)).

    >>> from shaftline.plant.open_water import b_series, open_water
    >>> kt = b_series("KT", expanded_area_ratio=0.7, blades=4)
    >>> round(open_water(kt, 0.6, 1.0), 3)  # KT at J = 0.6 and P/D = 1.0
    0.226
    """
    matrix = np.zeros(CURVE_SHAPE)
    for term in _polynomials():
        if term.curve == curve:
            area = expanded_area_ratio**term.expanded_area_ratio
            value = term.coefficient * area * blades**term.blades
            matrix[PITCH_POWERS.index(term.pitch_ratio), term.j] += value
    matrix.flags.writeable = False
    return matrix


def constant_coefficient(value: float) -> NDArray[np.float64]:
    """Return the matrix of a curve that depends on neither J nor P/D (a propeller at bollard pull)."""
    matrix = np.zeros(CURVE_SHAPE)
    matrix[0, 0] = value
    return matrix


@compiled_polynomial
def collapse_pitch(curve: NDArray[np.float64], pitch_ratio: Real) -> tuple[Real, Real, Real, Real]:
    """Return the coefficients of J**0 to J**3 at one pitch ratio, by Horner's rule in P/D."""
    p = pitch_ratio
    cube = p * p * p
    c0 = curve[4, 0] * cube + curve[3, 0]
    c1 = curve[4, 1] * cube + curve[3, 1]
    c2 = curve[4, 2] * cube + curve[3, 2]
    c3 = curve[4, 3] * cube + curve[3, 3]
    for k in range(2, -1, -1):
        c0 = c0 * p + curve[k, 0]
        c1 = c1 * p + curve[k, 1]
        c2 = c2 * p + curve[k, 2]
        c3 = c3 * p + curve[k, 3]
    return c0, c1, c2, c3


@compiled_polynomial
def open_water(curve: NDArray[np.float64], advance_ratio: Real, pitch_ratio: Real) -> Real:
    """Return KT or KQ [-] at advance ratio J and pitch ratio P/D."""
    c0, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    return ((c3 * advance_ratio + c2) * advance_ratio + c1) * advance_ratio + c0


@compiled_polynomial
def open_water_slope(curve: NDArray[np.float64], advance_ratio: Real, pitch_ratio: Real) -> Real:
    """Return dKT/dJ or dKQ/dJ [-]."""
    _, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    return (3.0 * c3 * advance_ratio + 2.0 * c2) * advance_ratio + c1


@compiled
def advance_ratio(advance_velocity: Real, shaft_speed: Real, diameter: float) -> Real:
    """Return J = 2 pi v_a / (omega D) [-] (thesis eq. 2-7), finite at standstill."""
    revolutions = shaft_speed * REVOLUTIONS_PER_RADIAN
    revolutions = where(abs(revolutions.real) < MIN_REVOLUTIONS, MIN_REVOLUTIONS, revolutions)
    return advance_velocity / (revolutions * diameter)


@compiled
def invert_torque_coefficient(
    curve: NDArray[np.float64], torque_coefficient: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Return the J at which KQ(J, P/D) has a given value, by safeguarded Newton steps, and its validity.

    ``curve`` is a KQ matrix of shape (5, 4); ``guess`` is the start, for example the previous J. J is
    valid inside the falling branch of the curve, between J = 0 and the largest usable J. Otherwise it is
    the edge of the branch; for an input that is not finite, the guess.
    """
    c0, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    if not (math.isfinite(torque_coefficient) and math.isfinite(c0)):
        return guess, False
    # KQ falls with J until its derivative c1 + 2 c2 J + 3 c3 J^2 vanishes.
    high = MAX_ADVANCE_RATIO
    discriminant = c2 * c2 - 3.0 * c3 * c1
    if c3 > 0.0 and discriminant > 0.0:
        high = min(high, (-c2 + math.sqrt(discriminant)) / (3.0 * c3))
    low = 0.0
    if torque_coefficient >= c0:
        return low, torque_coefficient == c0
    if torque_coefficient <= ((c3 * high + c2) * high + c1) * high + c0:
        return high, False
    j = start_between(guess, low, high)
    for _ in range(60):
        error = ((c3 * j + c2) * j + c1) * j + c0 - torque_coefficient
        slope = (3.0 * c3 * j + 2.0 * c2) * j + c1
        following, low, high = newton_step(j, error, slope, low, high)
        if abs(following - j) <= 1e-14:
            return following, True
        j = following
    return j, True


MOST_ADVANCE_RATIOS, MOST_PITCH_RATIOS = 32, 6
SURFACE_SHAPE = (4, MOST_PITCH_RATIOS, MOST_ADVANCE_RATIOS)
"""Value, slope over J, slope over P/D, and mixed derivative, at each entry."""

_JUDGED = 6  # fewest entries for which one can be compared with its neighbours
_DAMAGED, _ALONE = 0.1, 10.0  # deviation of a damaged entry: share of the span, times the median

_Ratio = Annotated[float, Field(ge=-2, le=3)]
_Coefficient = Annotated[float, Field(ge=-3, le=3)]
_Curves = tuple[tuple[_Coefficient, ...], ...]


def _array(description: str, most: int, **more: Any) -> Any:
    return Field(description=description, max_length=most, strict=False, **more)


class OpenWaterTable(Section):
    """Open-water table: measured KT and KQ over J."""

    # fmt: off
    advance_ratio: tuple[_Ratio, ...] = _array(
        "J of the entries, rising, 2 to 32 of them; the curves are constant outside them",
        MOST_ADVANCE_RATIOS, min_length=2)
    thrust_coefficient: _Curves = _array(
        "KT at each J; with several pitch ratios, one list for each of them", MOST_PITCH_RATIOS)
    torque_coefficient: _Curves = _array("KQ (not 10 KQ), in the same form", MOST_PITCH_RATIOS)
    pitch_ratio: tuple[_Ratio, ...] = _array(
        "P/D of each list, rising, 2 to 6 of them; absent for a single curve", MOST_PITCH_RATIOS,
        default=())
    # fmt: on

    @field_validator("thrust_coefficient", "torque_coefficient", mode="before")
    @classmethod
    def _one_curve(cls, given: Any) -> Any:
        if not isinstance(given, list | tuple):
            return given
        rows = [given] if given and isinstance(given[0], int | float) else given
        return tuple(tuple(row) if isinstance(row, list) else row for row in rows)

    @model_validator(mode="after")
    def _matched(self) -> OpenWaterTable:
        for name in ("advance_ratio", "pitch_ratio"):
            values = getattr(self, name)
            if any(b <= a for a, b in itertools.pairwise(values)):
                raise ValueError(f"the values of {name} must rise: {list(values)}")
        curves = max(1, len(self.pitch_ratio))
        for name in ("thrust_coefficient", "torque_coefficient"):
            rows = getattr(self, name)
            if len(rows) != curves or any(len(row) != len(self.advance_ratio) for row in rows):
                raise ValueError(
                    f"{name} must have one entry for each of the {len(self.advance_ratio)} values of "
                    f"advance_ratio, in one list for each of {curves} pitch_ratio; it has "
                    f"{', '.join(str(len(row)) for row in rows) or 'none'}"
                )
        for name in ("thrust_coefficient", "torque_coefficient"):
            for row in getattr(self, name):
                _refuse_damage(name, np.array(self.advance_ratio), np.array(row))
        return self

    def fill_table(self, record: Any) -> None:
        """Write nodes and surfaces into a ship record."""
        j, p = np.array(self.advance_ratio), np.array(self.pitch_ratio or (1.0,))
        record["table_advance_ratios"][: len(j)] = j
        record["table_advance_count"] = len(j)
        record["table_pitch_ratios"][: len(p)] = p
        record["table_pitch_count"] = len(p)
        curves = {"table_kt": self.thrust_coefficient, "table_kq": self.torque_coefficient}
        for name, curve in curves.items():
            record[name][:, : len(p), : len(j)] = _surface(j, p, np.array(curve))


RECORD_FIELDS = (
    ("table_advance_count", np.int64),
    ("table_pitch_count", np.int64),
    ("table_advance_ratios", np.float64, (MOST_ADVANCE_RATIOS,)),
    ("table_pitch_ratios", np.float64, (MOST_PITCH_RATIOS,)),
    ("table_kt", np.float64, SURFACE_SHAPE),
    ("table_kq", np.float64, SURFACE_SHAPE),
)
"""Fields of the ship record for the open-water table."""


def _kinks(j: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each inner entry from the straight line through its neighbours."""
    share = (j[1:-1] - j[:-2]) / (j[2:] - j[:-2])
    return np.asarray(np.abs(values[1:-1] - values[:-2] - share * (values[2:] - values[:-2])))


def _refuse_damage(name: str, j: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Refuse an entry with a lost digit or sign: one that deviates far from its neighbours' line."""
    if len(j) < _JUDGED:
        return
    rough = [_kinks(np.delete(j, i), np.delete(values, i)) for i in range(len(j))]
    worst = int(np.argmin([kinks.max() for kinks in rough]))  # The rest is smoothest without it.
    first = min(max(worst - 1, 0), len(j) - 3)  # first of its two neighbours
    (j0, j1), (y0, y1) = (np.delete(line, worst)[first : first + 2] for line in (j, values))
    expected = y0 + (y1 - y0) * (j[worst] - j0) / (j1 - j0)
    span, usual = np.ptp(np.delete(values, worst)), np.median(rough[worst])
    if abs(values[worst] - expected) > max(_DAMAGED * span, _ALONE * usual):
        raise ValueError(
            f"{name} at advance_ratio {j[worst]:g} is {values[worst]:g}, but its neighbours suggest "
            f"{expected:.3g}: check for a lost digit or sign. If the value is right, add entries near it"
        )


def _over_pitch(p: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the slopes over P/D at the entries."""
    if len(p) == 1:
        return np.zeros_like(values)
    return np.asarray(np.gradient(values, p, axis=0, edge_order=1 if len(p) == 2 else 2))


def _surface(
    j: NDArray[np.float64], p: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    over_j = scipy.interpolate.PchipInterpolator(j, values, axis=1).derivative()(j)
    return np.array([values, over_j, _over_pitch(p, values), _over_pitch(p, over_j)])


@compiled
def _interval(nodes: NDArray[np.float64], count: int, x: Real) -> int:
    """Return the index of the interval that contains a value; the outermost one if it lies outside."""
    k = 0
    while k < count - 2 and x.real >= nodes[k + 1]:
        k += 1
    return k


@compiled
def _cubic(a: Real, b: Real, slope_a: Real, slope_b: Real, width: float, t: Real) -> Real:
    """Return a cubic Hermite polynomial at the relative position ``t`` in an interval."""
    u = 1.0 - t
    ends = a * (1.0 + 2.0 * t) * u * u + b * t * t * (3.0 - 2.0 * t)
    return ends + width * t * u * (slope_a * u - slope_b * t)


@compiled
def _cubic_slope(a: Real, b: Real, slope_a: Real, slope_b: Real, width: float, t: Real) -> Real:
    """Return the derivative of :func:`_cubic`."""
    u = 1.0 - t
    rise = 6.0 * t * u * (b - a) / width
    return rise + slope_a * u * (1.0 - 3.0 * t) + slope_b * t * (3.0 * t - 2.0)


@compiled_apart
def table_curve(
    plant: Record, surface: NDArray[np.float64], advance_ratio: Real, pitch_ratio: Real
) -> tuple[Real, Real]:
    """Return KT or KQ [-] of the ship's table and its slope over J, constant outside the table.

    ``surface`` is ``table_kt`` or ``table_kq``; P/D [-] is without effect for a single curve.
    """
    nodes, count = plant.table_advance_ratios, plant.table_advance_count
    j = clip(advance_ratio, nodes[0], nodes[count - 1])
    k = _interval(nodes, count, j)
    width = nodes[k + 1] - nodes[k]
    a, b = surface[0, 0, k], surface[0, 0, k + 1]
    slope_a, slope_b = surface[1, 0, k], surface[1, 0, k + 1]
    if plant.table_pitch_count > 1:
        ratios, curves = plant.table_pitch_ratios, plant.table_pitch_count
        p = clip(pitch_ratio, ratios[0], ratios[curves - 1])
        m = _interval(ratios, curves, p)
        apart = ratios[m + 1] - ratios[m]
        u = (p - ratios[m]) / apart
        f = surface[:, m]
        g = surface[:, m + 1]
        a = _cubic(f[0, k], g[0, k], f[2, k], g[2, k], apart, u)
        b = _cubic(f[0, k + 1], g[0, k + 1], f[2, k + 1], g[2, k + 1], apart, u)
        slope_a = _cubic(f[1, k], g[1, k], f[3, k], g[3, k], apart, u)
        slope_b = _cubic(f[1, k + 1], g[1, k + 1], f[3, k + 1], g[3, k + 1], apart, u)
    t = (j - nodes[k]) / width
    value = _cubic(a, b, slope_a, slope_b, width, t)
    return value, _cubic_slope(a, b, slope_a, slope_b, width, t)


@compiled_apart
def invert_table(
    plant: Record, torque_coefficient: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Return the J at which the table's KQ has a value, by safeguarded Newton steps, and its validity.

    J is valid on the falling branch that begins at J = 0, or at the table's first J if that is larger.
    Otherwise it is an end of the branch; for an input that is not finite, the guess (such as the
    previous J).
    """
    if not (math.isfinite(torque_coefficient) and math.isfinite(pitch_ratio)):
        return guess, False
    nodes, surface = plant.table_advance_ratios, plant.table_kq
    low = max(0.0, nodes[0])
    top = table_curve(plant, surface, low, pitch_ratio)[0]
    high, least = low, top
    for k in range(plant.table_advance_count):
        if nodes[k] > low:
            value = table_curve(plant, surface, nodes[k], pitch_ratio)[0]
            if value >= least:
                break
            high, least = nodes[k], value
    if torque_coefficient >= top:
        return low, torque_coefficient == top
    if torque_coefficient <= least:
        return high, False
    j = start_between(guess, low, high)
    for _ in range(60):
        value, slope = table_curve(plant, surface, j, pitch_ratio)
        following, low, high = newton_step(j, value - torque_coefficient, slope, low, high)
        if abs(following - j) <= 1e-14:
            return following, True
        j = following
    return j, True
