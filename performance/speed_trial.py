"""Correct a speed trial to calm, deep sea water of 15 degrees Celsius, by ISO 15016:2015.

Each run is corrected by the direct power method: the power for the resistance by wind, waves and water
is taken from the measured power. The current is removed by comparing runs on reciprocal courses. The
corrected runs give the speed-power curve of the ship with its uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field, ModelWrapValidatorHandler, PrivateAttr, model_validator
from scipy.optimize import minimize_scalar
from scipy.special import comb

from ..core.models import FileModel, make_model, read_keys
from ..core.statistics import covariance_of, half_95
from ..plant.holtrop import FORM, HullForm, estimate_form, resistance
from ..plant.particulars import Particulars
from ..plant.surroundings import GRAVITY, KNOT
from ..plant.wind import AIR_DENSITY, Superstructure
from .corrections import (
    SEA_WATER,
    WAVE_RANGE,
    Wind,
    admiralty_factor,
    in_wave_range,
    mean_wind,
    relative_wind,
    shallow_water_speed_loss,
    true_wind,
    water_resistance,
    wave_resistance,
    wind_at_height,
    wind_resistance,
)
from .tables import (
    COURSES,
    DEGREES,
    METRES,
    POWERS,
    SPEEDS,
    WIND_ANGLES,
    Column,
    TableError,
    canonical,
    read_table,
)

Floats = NDArray[np.float64]


class TrialError(TableError):
    """A speed trial cannot be analysed."""


class TrialShip(FileModel):
    """Ship of a speed trial, as her TOML file states it."""

    name: str = Field(min_length=1, max_length=100)
    hull: HullForm = Field(
        description="midship_coefficient, waterplane_coefficient and lcb_percent are estimated if absent"
    )
    design_speed_kn: float | None = Field(
        default=None, gt=0, le=60, description="for the estimate of lcb_percent"
    )
    superstructure: Superstructure | None = Field(
        default=None, description="above the water; without it, no wind correction"
    )
    shaft_efficiency: float = Field(
        default=0.99, gt=0.5, le=1, description="P_D over the shaft power"
    )
    propulsive_efficiency: float | None = Field(
        default=None,
        gt=0.2,
        le=1,
        description="eta_D; without it, from the resistance by Holtrop and the measured power",
    )
    overload_factor: float = Field(
        default=-0.1,
        ge=-1,
        le=0,
        description="xi_P: change of eta_D over itself per relative change of the resistance",
    )
    gyradius: float = Field(
        default=0.25, gt=0.1, lt=0.4, description="pitch gyradius over the length"
    )
    contract_displacement_m3: float | None = Field(default=None, gt=0)
    mcr_kW: float | None = Field(
        default=None, gt=0, description="maximum continuous rating, all shafts"
    )

    _estimated: tuple[str, ...] = PrivateAttr(default=())

    @property
    def estimated(self) -> tuple[str, ...]:
        """Keys of the hull that the file does not give."""
        return self._estimated

    @model_validator(mode="wrap")
    @classmethod
    def _estimate_form(
        cls, values: Any, handler: ModelWrapValidatorHandler[TrialShip]
    ) -> TrialShip:
        hull = values.get("hull") if isinstance(values, dict) else None
        if not isinstance(hull, dict):
            return handler(values)
        absent = [key for key in FORM if key not in hull]
        keys = ("length_m", "beam_m", "draught_m", "displacement_m3")
        size: list[Any] = [hull.get(key) for key in keys]
        if not absent or not all(isinstance(one, int | float) and one > 0 for one in size):
            return handler(values)
        length, beam, draught, displacement = size
        speed = values.get("design_speed_kn")
        froude = 0.0
        if isinstance(speed, int | float):
            froude = speed * KNOT / math.sqrt(GRAVITY * length)
        elif "lcb_percent" in absent:
            raise ValueError(
                "hull.lcb_percent is missing; give it, or design_speed_kn of the ship for an estimate"
            )
        form = estimate_form(displacement / (length * beam * draught), froude)
        ship = handler(values | {"hull": {**{key: form[key] for key in absent}, **hull}})
        ship._estimated = tuple(absent)
        return ship

    @model_validator(mode="after")
    def _within_two_per_cent(self) -> TrialShip:
        contract = self.contract_displacement_m3
        if contract is not None and abs(contract / self.hull.displacement_m3 - 1.0) > 0.02:
            raise ValueError(
                f"contract_displacement_m3 = {contract:g} differs by more than 2 % from "
                f"hull.displacement_m3 = {self.hull.displacement_m3:g} of the trial; beyond that the "
                "standard needs model tests in both conditions"
            )
        return self


def load_trial_ship(path: str | Path) -> TrialShip:
    """Read the ship of a speed trial from a TOML file.

    Args:
        path: file with the keys of :class:`TrialShip`, or file of main particulars
            (:class:`~shaftline.plant.particulars.Particulars`).

    Raises:
        TrialError: the file cannot be read, or a key or value is wrong; names file and key.
    """
    keys = read_keys(path, TrialError)
    if "prime_mover" in keys:
        raise TrialError(
            f"{path}: a ship file of the simulation, which does not have the form of the hull; give the "
            "file of main particulars instead, or the keys of docs/trial.md"
        )
    if "length_m" in keys:
        given = make_model(Particulars, keys, path, TrialError)
        keys = {
            "name": given.name,
            "hull": given.hull,
            "design_speed_kn": given.design_speed_kn,
            "superstructure": given.superstructure,
            "mcr_kW": given.shafts * given.mcr_kW,
        }
    return make_model(TrialShip, keys, path, TrialError)


COLUMNS: dict[str, Column] = {
    "heading": Column(("heading", "hdg"), DEGREES, None, -7, 7, COURSES),
    "speed_over_ground": Column(("speed_over_ground", "sog", "speed"), SPEEDS, None, 0.3, 40),
    "shaft_power": Column(("shaft_power", "power", "ps"), POWERS, None, 1, 2e8),
    "shaft_speed": Column(
        ("shaft_speed", "rpm", "n"),
        {"rpm": 1 / 60, "1/min": 1 / 60, "1/s": 1.0},
        math.nan,
        0.01,
        60,
    ),
    "time": Column(
        ("time", "start", "start_time", "beginn"),
        {"h": 3600.0, "min": 60.0, "s": 1.0},
        math.nan,
        -1e9,
        1e10,
    ),
    "wind_speed": Column(
        ("wind_speed", "relative_wind_speed", "apparent_wind_speed", "rel_wind_speed", "aws"),
        {"m/s": 1.0} | SPEEDS,
        math.nan,
        0,
        60,
    ),
    "wind_angle": Column(
        WIND_ANGLES,
        DEGREES,
        math.nan,
        -7,
        7,
    ),
    "wave_height": Column(("wave_height", "hs"), METRES, 0.0, 0, 15),
    "wave_period": Column(("wave_period", "t01", "tm"), {"s": 1.0}, 6.0, 1, 25),
    "wave_angle": Column(("wave_angle", "relative_wave_angle"), DEGREES, 0.0, -7, 7),
    "swell_height": Column(("swell_height",), METRES, 0.0, 0, 15),
    "swell_period": Column(("swell_period",), {"s": 1.0}, 10.0, 1, 30),
    "swell_angle": Column(("swell_angle",), DEGREES, 0.0, -7, 7),
    "depth": Column(("depth", "water_depth"), METRES, 1e4, 2, 12000),
    "water_temperature": Column(
        ("water_temperature", "temperature"), {"C": 1.0, "°C": 1.0}, 15.0, -3, 40
    ),
    "water_density": Column(
        ("water_density", "density"), {"kg/m3": 1.0, "t/m3": 1e3}, SEA_WATER, 950, 1100
    ),
    "air_density": Column(("air_density",), {"kg/m3": 1.0}, AIR_DENSITY, 0.9, 1.5),
}
"""Columns of the table of runs by quantity. Wind and waves are relative to the bow, from ahead 0."""


def read_runs(path: str | Path) -> pd.DataFrame:
    """Read a table of runs: one row for each run, in the order of time.

    The names of the columns are those of :data:`COLUMNS`, with the unit in brackets or after the last
    underscore: ``SOG [kn]``, ``shaft_power_kW``. Other columns are ignored.

    Args:
        path: CSV or similar text table.

    Returns:
        Table in SI units with one column for each quantity.

    Raises:
        TableError: the file or a column cannot be used; names file, column and row.
    """
    return canonical(read_table(path), COLUMNS, str(path))


def canonical_runs(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of runs in SI units with one column for each quantity of :data:`COLUMNS`.

    Args:
        table: runs with names and units as in :func:`read_runs`.

    Raises:
        TableError: a column is missing, read twice, or has a value outside its range.
    """
    return canonical(table, COLUMNS, "runs")


class Curve(NamedTuple):
    """Speed-power curve P = a + b V^q through the corrected runs [W, m/s]."""

    constant: float
    factor: float
    exponent: float
    covariance: Floats
    """Of the fitted parameters, shape (3, 3); zeros for a parameter that is held."""
    values: int
    """Number of independent values to which the curve was fitted."""
    parameters: int
    """Number of parameters of the curve and of the current that were fitted to these values."""

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residual; 0: no uncertainty is known."""
        return max(self.values - self.parameters, 0)

    def power(self, speed: Any) -> Any:
        """Return the delivered power [W] at a speed [m/s]."""
        return self.constant + self.factor * np.power(speed, self.exponent)

    def interval(self, speed: float) -> float:
        """Return half the 95 % interval of the power [W] at a speed [m/s]; nan if it is not known."""
        if self.freedom < 1:
            return math.nan
        power = speed**self.exponent
        slope = np.array([1.0, power, self.factor * power * math.log(speed)])
        return half_95(self.freedom) * math.sqrt(slope @ self.covariance @ slope)

    def speed(self, power: float) -> float:
        """Return the speed [m/s] at a power [W].

        Raises:
            TrialError: the curve does not reach the power.
        """
        ratio = (power - self.constant) / self.factor
        if ratio <= 0.0:
            raise TrialError(f"the speed-power curve does not reach {power / 1e3:.0f} kW")
        return float(ratio ** (1.0 / self.exponent))


def fit_curve(
    speeds: Floats,
    powers: Floats,
    settings: int,
    values: int | None = None,
    current: Floats | None = None,
) -> Curve:
    """Fit P = a + b V^q to runs by least squares.

    Example:
        >>> speeds = np.array([6.0, 7.0, 8.0])
        >>> round(fit_curve(speeds, 4e4 * speeds**3.2, 3).exponent, 3)
        3.2

    With fewer than four power settings a is 0, with a single one q is 3.

    Args:
        speeds: speed through the water [m/s], (n,).
        powers: delivered power [W], (n,).
        settings: number of different power settings.
        values: number of independent values, by default n; fewer if runs share a mean.
        current: derivatives of the speeds by parameters of the current that were estimated from the same
            runs, (n, k); the interval of the curve then contains their uncertainty.
    """

    def columns(exponent: float) -> Floats:
        rising = speeds**exponent
        return np.array([np.ones_like(speeds), rising]).T if settings >= 4 else rising[:, None]

    def misfit(exponent: float) -> float:
        lhs = columns(exponent)
        scale = np.linalg.norm(lhs, axis=0)
        solution = np.linalg.lstsq(lhs / scale, powers, rcond=None)[0]
        return float(np.sum((lhs / scale @ solution - powers) ** 2))

    exponent = 3.0
    if settings > 1:
        exponent = float(minimize_scalar(misfit, bounds=(1.5, 8.0), method="bounded").x)
    lhs = columns(exponent)
    scale = np.linalg.norm(lhs, axis=0)
    solution = np.linalg.lstsq(lhs / scale, powers, rcond=None)[0] / scale
    constant, factor = (0.0, *solution)[-2:]
    free = [0, 1, 2] if settings >= 4 else [1, 2] if settings > 1 else [1]
    rising = speeds**exponent
    jacobian = np.array([np.ones_like(speeds), rising, factor * rising * np.log(speeds)]).T[:, free]
    if current is not None:
        slope = factor * exponent * speeds ** (exponent - 1.0)
        jacobian = np.hstack([jacobian, slope[:, None] * current])
    values = len(speeds) if values is None else values
    freedom = values - jacobian.shape[1]
    covariance = np.zeros((3, 3))
    if freedom > 0:
        residual = constant + factor * rising - powers
        variance = float(residual @ residual) / freedom
        inverse = covariance_of(jacobian.T @ jacobian)[: len(free), : len(free)]
        covariance[np.ix_(free, free)] = variance * inverse
    return Curve(float(constant), float(factor), exponent, covariance, values, jacobian.shape[1])


def _count_settings(powers: Floats, pairs: list[int]) -> int:
    """Return the number of different power settings; those within 3 per cent are one."""
    numbers = np.array(pairs)
    means = np.sort([powers[numbers == n].mean() for n in set(pairs)])
    return 1 + int(np.sum(np.diff(means) > 0.03 * means[:-1]))


@dataclass(frozen=True)
class SpeedTrial:
    """Result of a speed trial.

    Args:
        ship: ship of the trial.
        runs: measured and corrected values of each run, in SI units; corrected are ``power_W``
            (delivered power in calm deep water) and ``speed_m_s`` (through the water).
        curve: speed-power curve of delivered power in calm water.
        method: how the current was removed: ``iterative`` or ``mean of means``.
        remarks: sentences on what was assumed, left out, or lies outside a range of validity.
    """

    ship: TrialShip
    runs: pd.DataFrame
    curve: Curve
    method: str
    remarks: tuple[str, ...]

    def shaft_power(self, speed_m_s: float) -> tuple[float, float]:
        """Return shaft power and half of its 95 % interval at a speed [W].

        Args:
            speed_m_s: speed through calm water.
        """
        efficiency = self.ship.shaft_efficiency
        power, half = float(self.curve.power(speed_m_s)), self.curve.interval(speed_m_s)
        return power / efficiency, half / efficiency

    def speed_at(self, shaft_power_W: float) -> tuple[float, float]:
        """Return speed in calm water and half of its 95 % interval at a shaft power [m/s].

        Args:
            shaft_power_W: power of all shafts [W].

        Raises:
            TrialError: the speed-power curve does not reach the power.
        """
        curve = self.curve
        speed = curve.speed(shaft_power_W * self.ship.shaft_efficiency)
        slope = curve.factor * curve.exponent * speed ** (curve.exponent - 1.0)
        return speed, curve.interval(speed) / slope


def analyse_trial(ship: TrialShip, runs: pd.DataFrame) -> SpeedTrial:
    """Correct the runs of a speed trial, and fit the speed-power curve (ISO 15016:2015).

    Args:
        ship: ship of the trial.
        runs: table of :func:`read_runs`; consecutive runs of one power are on reciprocal courses.

    Raises:
        TrialError: fewer than two runs, a run without its reciprocal, or corrections larger than the
            measured power.
    """
    pairs = double_runs(runs)
    for number in sorted(set(pairs)):
        if pairs.count(number) < 2:
            run, log = pairs.index(number), len(runs) > MOST_RUNS
            raise TrialError(
                f"run {run + 1} ({runs['shaft_power'].iloc[run] / 1e3:.0f} kW, heading "
                f"{math.degrees(runs['heading'].iloc[run]):.0f} deg) has no run beside it in the table "
                "at the same power (within 6 %) on the reciprocal course (within 30 deg); the current "
                "cannot be removed"
                + ("; a log of the whole trial needs --from-log 10 (find_runs)" if log else "")
            )
    _refuse_implausible(ship, runs)
    remarks = list(_remarks(ship, runs))
    result = runs.copy()
    result["pair"] = pairs
    result["delivered_power_W"] = runs["shaft_power"] * ship.shaft_efficiency
    winds = _winds(ship, runs, pairs)
    rows = [
        _corrected_run(ship, row, wind)
        for (_, row), wind in zip(runs.iterrows(), winds, strict=True)
    ]
    corrected = pd.DataFrame(rows, index=runs.index)
    result = pd.concat([result, corrected], axis=1)
    power = corrected["power_W"].to_numpy(copy=True)
    share = float(np.max(np.abs(power / result["delivered_power_W"].to_numpy() - 1.0)))
    ground = runs["speed_over_ground"].to_numpy()
    speed, current = _through_water(runs, pairs, ground, power)
    result["power_W"] = power
    result["current_m_s"] = ground - speed
    losses = [
        shallow_water_speed_loss(v, ship.hull.midship_area, h)
        for v, h in zip(speed, runs["depth"], strict=True)
    ]
    result["shallow_water_loss"] = losses
    result["speed_m_s"] = speed * (1.0 + np.array(losses))
    if ship.contract_displacement_m3 is not None:
        power = power * admiralty_factor(ship.hull.displacement_m3, ship.contract_displacement_m3)
        result["power_W"] = power
    values = len(set(pairs)) if current is None else len(runs)
    settings = _count_settings(power, pairs)
    curve = fit_curve(result["speed_m_s"].to_numpy(), power, settings, values, current)
    method = "mean of means" if current is None else "iterative"
    remarks += _interval_remarks(curve, method, share)
    return SpeedTrial(ship, result, curve, method, tuple(remarks))


def _interval_remarks(curve: Curve, method: str, share: float) -> list[str]:
    """Return sentences on the degrees of freedom of the interval, and on what it does not contain.

    Args:
        curve: fitted curve.
        method: method that removed the current.
        share: largest correction of a run, over its power.
    """
    of = "runs" if method == "iterative" else "power settings, each the mean of its runs"
    counts = f"{curve.values} {of}, and {curve.parameters} parameters of the curve"
    counts += " and the current" if method == "iterative" else ""
    if curve.freedom < 1:
        return [f"no interval of the speed-power curve: {counts}; measure at more powers"]
    plural = "s" if curve.freedom > 1 else ""
    return [
        f"the interval has {curve.freedom} degree{plural} of freedom: {counts}",
        f"wind, waves and water change the power by up to {100.0 * share:.1f} %; an error of these "
        "corrections or of a sensor that all runs share is not in the interval",
    ]


def _refuse_implausible(ship: TrialShip, runs: pd.DataFrame) -> None:
    """Raise a TrialError if the resistance of the hull at the speeds does not fit the powers at all."""
    speed, power = runs["speed_over_ground"], runs["shaft_power"] * ship.shaft_efficiency
    effective = np.array([resistance(ship.hull, v, SEA_WATER).total * v for v in speed])
    ratios = effective / power.to_numpy()
    low, high = EFFECTIVE_POWER
    if not low <= np.median(ratios) <= high:
        run = int(np.argsort(ratios)[len(ratios) // 2])
        raise TrialError(
            f"run {run + 1}: at {speed.iloc[run] / KNOT:.1f} kn the resistance by Holtrop and Mennen "
            f"takes {effective[run] / 1e3:.0f} kW, {ratios[run]:.2g} of the "
            f"{power.iloc[run] / 1e3:.0f} kW delivered; {low:g} to {high:g} is plausible. Check the "
            "units of speed and power and the dimensions of the hull"
        )


def double_runs(runs: pd.DataFrame) -> list[int]:
    """Return the number of the power setting of each run: runs on alternating courses at one power.

    Raises:
        TrialError: fewer than two runs.
    """
    if len(runs) < 2:
        raise TrialError(f"{len(runs)} run: a speed trial needs at least one run in each direction")
    numbers = [0]
    for k in range(1, len(runs)):
        same = are_reciprocal(runs.iloc[k - 1], runs.iloc[k])
        numbers.append(numbers[-1] + (0 if same else 1))
    return numbers


def are_reciprocal(run: Any, other: Any) -> bool:
    """Return whether two runs have one power (within 6 %) and opposite courses (within 30 deg)."""
    turned = abs(math.remainder(other["heading"] - run["heading"] - math.pi, 2.0 * math.pi))
    same_power = abs(other["shaft_power"] / run["shaft_power"] - 1.0) < 0.06
    return bool(same_power and turned < math.radians(30.0))


def _winds(ship: TrialShip, runs: pd.DataFrame, pairs: list[int]) -> list[Wind | None]:
    """Return the relative wind of each run at the reference height, by the mean wind of its setting."""
    if ship.superstructure is None or runs[["wind_speed", "wind_angle"]].isna().to_numpy().any():
        return [None] * len(runs)
    air = ship.superstructure
    true = [
        true_wind(Wind(row.wind_speed, row.wind_angle), row.speed_over_ground, row.heading)
        for row in runs.itertuples()
    ]
    found: list[Wind | None] = []
    for row, number in zip(runs.itertuples(), pairs, strict=True):
        mean = mean_wind([wind for wind, other in zip(true, pairs, strict=True) if other == number])
        speed = wind_at_height(mean.speed, air.anemometer_height_m, air.reference_height_m)
        found.append(relative_wind(Wind(speed, mean.angle), row.speed_over_ground, row.heading))
    return found


def _corrected_run(
    ship: TrialShip, run: Mapping[str, float], wind: Wind | None
) -> dict[str, float]:
    """Return added resistances [N] and the delivered power in calm water [W] of a run.

    The power follows from the direct power method.

    Raises:
        TrialError: the corrections are larger than the measured power.
    """
    speed, hull = run["speed_over_ground"], ship.hull
    seas = sum(
        wave_resistance(
            hull,
            speed,
            run[f"{sea}_height"],
            run[f"{sea}_period"],
            run[f"{sea}_angle"],
            ship.gyradius,
            run["water_density"],
        )
        for sea in ("wave", "swell")
    )
    calm = resistance(hull, speed, SEA_WATER).total
    water = water_resistance(hull, speed, calm, run["water_temperature"], run["water_density"])
    blow = 0.0
    if wind is not None and ship.superstructure is not None:
        blow = wind_resistance(ship.superstructure, wind, speed, run["air_density"])
    added, delivered = blow + seas + water, run["shaft_power"] * ship.shaft_efficiency
    efficiency = ship.propulsive_efficiency
    if efficiency is None:
        efficiency = float(np.clip((calm + added) * speed / delivered, 0.4, 0.85))
    share = added * speed / efficiency
    rest = delivered - share
    inside = rest**2 + 4.0 * delivered * share * ship.overload_factor
    if rest <= 0.0 or inside < 0.0:
        raise TrialError(
            f"wind, waves and water take {share / 1e3:.0f} kW of the {delivered / 1e3:.0f} kW delivered "
            f"at {speed / KNOT:.1f} kn; check the units of wind and waves and the dimensions of the ship"
        )
    return {
        "wind_resistance_N": blow,
        "wave_resistance_N": seas,
        "water_resistance_N": water,
        "propulsive_efficiency": efficiency,
        "power_W": 0.5 * (rest + math.sqrt(inside)),
    }


TIDE_S = 44712.0
"""Period of the semi-diurnal tide [s]: 12 hours, 25 minutes, 12 seconds."""

EFFECTIVE_POWER = (0.15, 2.0)
"""Plausible effective power by Holtrop and Mennen over the delivered power, median of the runs."""

ROUNDS = 50
MOST_RUNS = 60  # number of rows from which a table is taken for a log


def _through_water(
    runs: pd.DataFrame, pairs: list[int], ground: Floats, power: Floats
) -> tuple[Floats, Floats | None]:
    """Return the speed of each run through the water [m/s] without the current.

    Returns:
        The speeds, and their derivatives by the parameters of the current of the iterative method; None
        for the mean of means.
    """
    time = runs["time"].to_numpy()
    if len(runs) >= 8 and np.isfinite(time).all() and len(set(pairs)) >= 3:
        return _iterative(time - time[0], runs["heading"].to_numpy(), pairs, ground, power)
    speed = np.empty(len(runs))
    for number in sorted(set(pairs)):
        rows = [k for k, other in enumerate(pairs) if other == number]
        weights = comb(len(rows) - 1, np.arange(len(rows)))
        speed[rows] = np.average(ground[rows], weights=weights)
        power[rows] = np.average(power[rows], weights=weights)
    return speed, None


def _iterative(
    time: Floats, heading: Floats, pairs: list[int], ground: Floats, power: Floats
) -> tuple[Floats, Floats]:
    """Return the speed through the water by the iterative method (ISO 15016:2015, Annex B).

    The second result has the derivatives of the speeds by the parameters of the current.

    The current along the first course is V_c cos(2 pi t / T) + V_s sin(2 pi t / T) + V_t t + V_0. It and
    the speed-power curve are fitted in turn.
    """
    along = np.where(np.cos(heading - heading[0]) > 0.0, 1.0, -1.0)
    phase = 2.0 * math.pi * time / TIDE_S
    tide = np.array([np.cos(phase), np.sin(phase), time / TIDE_S, np.ones_like(time)]).T
    numbers, settings = np.array(pairs), _count_settings(power, pairs)
    speed = np.array([ground[numbers == n].mean() for n in pairs])
    mean_power = np.array([power[numbers == n].mean() for n in pairs])
    curve = fit_curve(speed, mean_power, settings)
    for _ in range(ROUNDS):
        expected = np.array([curve.speed(p) for p in power])
        current = tide @ np.linalg.lstsq(tide, along * (ground - expected), rcond=None)[0]
        further = ground - along * current
        if np.max(np.abs(further - speed)) < 1e-6:
            break
        speed = further
        curve = fit_curve(speed, power, settings)
    return speed, -along[:, None] * tide


def _remarks(ship: TrialShip, runs: pd.DataFrame) -> list[str]:
    """Return sentences on what is assumed or outside the range of a formula."""
    said = list(runs.attrs.get("remarks", ()))
    if ship.superstructure is None:
        said.append("no wind correction: the ship file has no table [superstructure]")
    elif runs[["wind_speed", "wind_angle"]].isna().to_numpy().any():
        said.append("no wind correction: the runs have no wind_speed and wind_angle")
    waves = runs["wave_height"] + runs["swell_height"]
    if not waves.any():
        said.append("no wave correction: the runs have no wave_height")
    for sea in ("wave", "swell"):
        absent = runs.attrs.get("absent", ()) if runs[f"{sea}_height"].any() else ()
        if f"{sea}_period" in absent:
            period = COLUMNS[f"{sea}_period"].default
            said.append(f"no {sea}_period in the runs: a mean period of {period:g} s is assumed")
        if f"{sea}_angle" in absent:
            said.append(f"no {sea}_angle in the runs: the {sea}s are taken from ahead")
    if waves.any() and not all(in_wave_range(ship.hull, v) for v in runs["speed_over_ground"]):
        said.append(f"STAWAVE-2 is used outside its range ({WAVE_RANGE})")
    if ship.estimated:
        values = ", ".join(f"{key} = {getattr(ship.hull, key):.3g}" for key in ship.estimated)
        said.append(f"form of the hull estimated: {values}")
    if ship.propulsive_efficiency is None:
        said.append("propulsive efficiency estimated from the resistance by Holtrop and Mennen")
    if not np.isfinite(runs["time"]).all():
        said.append("no time of the runs: the current is taken as constant within each setting")
    depth = runs["depth"].to_numpy()
    if (depth >= 1e4).all():
        said.append("no water depth: deep water is assumed")
    return said
