"""Speed loss of a ship in service over months and years, by ISO 19030-2:2016.

The speed loss is 100 (V - V_ref) / V_ref: V is the measured speed through the water, V_ref the speed at
which the reference curve has the measured power, corrected for wind. A fouled hull has a negative
speed loss. Rows outside the reference conditions of the standard are left out. Change points, such as a
docking or a cleaning, split the time into periods with a straight trend each.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..core.models import FileModel, read_model
from ..core.statistics import half_95
from ..plant.surroundings import GRAVITY, KNOT
from ..plant.wind import AIR_DENSITY, Superstructure
from .corrections import Wind, true_wind, wind_resistance
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

DAY_S = 86400.0
YEAR_S = 365.25 * DAY_S

COLUMNS: dict[str, Column] = {
    "time": Column(
        ("time", "date", "timestamp", "start", "date_time", "datetime"),
        {"h": 3600.0, "s": 1.0, "d": DAY_S}, None, -1e10, 1e11,
    ),
    "speed_through_water": Column(("speed_through_water", "stw", "log_speed"), SPEEDS, None, 0.0, 40.0),
    "shaft_power": Column(("shaft_power", "power", "ps"), POWERS, None, 0.0, 2e8),
    "speed_over_ground": Column(("speed_over_ground", "sog"), SPEEDS, math.nan, -5.0, 40.0),
    "heading": Column(("heading", "hdg"), DEGREES, math.nan, -7.0, 7.0, COURSES),
    "wind_speed": Column(
        ("wind_speed", "relative_wind_speed", "apparent_wind_speed", "rel_wind_speed", "aws"),
        {"m/s": 1.0} | SPEEDS, math.nan, 0.0, 80.0
    ),
    "wind_angle": Column(
        WIND_ANGLES, DEGREES, math.nan, -7.0, 7.0,
    ),
    "draught": Column(
        ("draught", "mean_draught", "draft", "mean_draft", "draught_mean", "draft_mean"), METRES,
        math.nan, 0.1, 40.0,
    ),
    "draught_fore": Column(
        ("draught_fore", "draft_fore", "draught_fwd", "draft_fwd", "draught_forward", "draft_forward"),
        METRES, math.nan, 0.1, 40.0,
    ),
    "draught_aft": Column(("draught_aft", "draft_aft"), METRES, math.nan, 0.1, 40.0),
    "depth": Column(("depth", "water_depth"), METRES, math.nan, 0.5, 12000.0),
    "water_temperature": Column(
        ("water_temperature", "temperature", "sea_temperature"), {"C": 1.0, "°C": 1.0}, math.nan, -3.0,
        40.0
    ),
    "rudder": Column(("rudder", "rudder_angle"), DEGREES, math.nan, -1.6, 1.6),
}  # fmt: skip
"""Columns of a log by quantity; the wind is relative to the bow, from ahead 0."""


class ReferenceShip(FileModel):
    """Ship of a performance analysis, with the reference curve of her clean state."""

    name: str = Field(min_length=1, max_length=100)
    beam_m: float = Field(gt=0, le=100)
    draught_m: float = Field(gt=0, le=40, description="draught of the reference curve")
    draught_tolerance: float = Field(
        default=0.1, gt=0, le=0.5, description="largest relative difference of the draught"
    )
    speed_kn: tuple[float, ...] = Field(min_length=2, description="speeds of the reference curve")
    power_kW: tuple[float, ...] = Field(min_length=2, description="shaft power at these speeds")
    superstructure: Superstructure | None = None
    propulsive_efficiency: float = Field(
        default=0.7, gt=0.2, le=1, description="for the wind correction"
    )

    @model_validator(mode="after")
    def _rising(self) -> ReferenceShip:
        if len(self.speed_kn) != len(self.power_kW):
            raise ValueError(
                f"speed_kn has {len(self.speed_kn)} values and power_kW {len(self.power_kW)}; they "
                f"must be pairs"
            )
        for key, values in (("speed_kn", self.speed_kn), ("power_kW", self.power_kW)):
            if values[0] <= 0.0 or not np.all(np.diff(values) > 0.0):
                raise ValueError(f"{key} must rise from a value above 0")
        return self

    def reference_speed(self, power: Floats) -> Floats:
        """Return the speed of the clean ship [m/s] at shaft powers [W]; nan outside the reference curve.

        The curve is a power law between neighbouring points.

        Example:
            >>> ship = ReferenceShip(
            ...     name="a", beam_m=32, draught_m=10, speed_kn=(10, 20), power_kW=(1000, 8000)
            ... )
            >>> (ship.reference_speed(np.array([1e6, 3.375e6, 9e6])) / KNOT).round(6).tolist()
            [10.0, 15.0, nan]
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.interp(
                np.log(power),
                np.log(np.multiply(self.power_kW, 1e3)),
                np.log(self.speed_kn),
                left=math.nan,
                right=math.nan,
            )
        return np.asarray(np.exp(logs) * KNOT)


def load_reference_ship(path: str | Path) -> ReferenceShip:
    """Read the ship and reference curve of a performance analysis from a TOML file.

    Args:
        path: file with the keys of :class:`ReferenceShip`.

    Raises:
        TableError: the file cannot be read, or a key or value is wrong; names file and key.
    """
    return read_model(ReferenceShip, path, TableError)


def read_log(path: str | Path) -> pd.DataFrame:
    """Read the log of a ship; its columns are those of :data:`COLUMNS`.

    Args:
        path: CSV or similar text table, one row for each record: seconds, hours or noon reports; or a
            folder of such tables.

    Returns:
        Table in SI units, ordered by time; ``time`` is in seconds since the first row, ``stamp`` the
        date. The draughts fore and aft give the draught in rows without one.

    Raises:
        TableError: the file or a column cannot be used; names file, column and row.
    """
    return _ordered(canonical(read_table(path), COLUMNS, str(path), gaps=True))


def canonical_log(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of log rows in SI units, as :func:`read_log` returns it.

    Args:
        table: rows with names and units as in :func:`read_log`; a cell may be empty.

    Raises:
        TableError: a column is missing, read twice, or has a value outside its range.
    """
    return _ordered(canonical(table, COLUMNS, "log", gaps=True))


def _ordered(log: pd.DataFrame) -> pd.DataFrame:
    ordered = log.sort_values("time", ignore_index=True)
    mean = 0.5 * (ordered["draught_fore"] + ordered["draught_aft"])
    ordered["draught"] = ordered["draught"].fillna(mean)
    ordered.attrs = log.attrs
    return ordered


STRONG_WIND = 7.9
"""Largest true wind speed of the reference conditions [m/s], Beaufort 4."""

COLD_WATER = 2.0
"""Lowest water temperature of the reference conditions [degrees Celsius]."""

RUDDER = math.radians(5.0)
"""Largest rudder angle of the reference conditions."""


def filters(ship: ReferenceShip, log: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Return by reason which rows lie outside the reference conditions (ISO 19030-2, 6.2 and 6.3).

    A condition whose channel a row does not have is not applied to it.

    Args:
        ship: ship with her reference curve.
        log: table of :func:`read_log`.
    """
    speed = log["speed_through_water"].to_numpy()
    deep = np.maximum(3.0 * math.sqrt(ship.beam_m * ship.draught_m), 2.75 * speed**2 / GRAVITY)
    wind = _true_wind_speed(log)
    return {
        "no speed or power": ~(np.isfinite(speed) & np.isfinite(log["shaft_power"].to_numpy())),
        "true wind above 7.9 m/s": wind > STRONG_WIND,
        "shallow water": log["depth"].to_numpy() < deep,
        "water below 2 degrees Celsius": log["water_temperature"].to_numpy() <= COLD_WATER,
        "rudder above 5 degrees": np.abs(log["rudder"].to_numpy()) > RUDDER,
        "draught off the reference": np.abs(log["draught"].to_numpy() / ship.draught_m - 1.0)
        > ship.draught_tolerance,
    }


def _true_wind_speed(log: pd.DataFrame) -> Floats:
    """Return the true wind speed of each row [m/s]; nan where it is not known."""
    ground = log["speed_over_ground"].fillna(log["speed_through_water"])
    return np.array(
        [
            true_wind(Wind(speed, angle), over_ground, 0.0).speed
            for speed, angle, over_ground in zip(
                log["wind_speed"], log["wind_angle"], ground, strict=True
            )
        ]
    )


def still_air_power(ship: ReferenceShip, log: pd.DataFrame) -> Floats:
    """Return the shaft power without the wind [W] (ISO 19030-2, Annex G).

    Args:
        ship: ship; without ``superstructure`` the power is not corrected.
        log: table of :func:`read_log`; rows without wind are not corrected.
    """
    power: Floats = log["shaft_power"].to_numpy(copy=True)
    if ship.superstructure is None:
        return power
    for row, (speed, wind, angle) in enumerate(
        zip(log["speed_through_water"], log["wind_speed"], log["wind_angle"], strict=True)
    ):
        if math.isfinite(wind) and math.isfinite(angle) and math.isfinite(speed):
            added = wind_resistance(ship.superstructure, Wind(wind, angle), speed, AIR_DENSITY)
            power[row] -= added * speed / ship.propulsive_efficiency
    return power


class Period(NamedTuple):
    """Time between two change points, with the straight trend of the speed loss."""

    start_s: float
    end_s: float
    days: int
    """Number of days with data."""
    mean: float
    """Mean speed loss [%]."""
    mean_half: float
    """Half of its 95 % interval."""
    slope: float
    """Change of the speed loss [% per year]."""
    slope_half: float

    def trend(self, time: float) -> tuple[float, float]:
        """Return the trend line at a time [s] and half of its 95 % interval [%]."""
        years = (time - 0.5 * (self.start_s + self.end_s)) / YEAR_S
        return self.mean + self.slope * years, math.hypot(self.mean_half, self.slope_half * years)


def step_between(before: Period, after: Period) -> tuple[float, float]:
    """Return the step from the trend of a period to that of the next, and half its 95 % interval [%].

    Example:
        >>> before = Period(0.0, 10 * DAY_S, 10, -3.0, 0.3, 0.0, 0.0)
        >>> after = Period(11 * DAY_S, 20 * DAY_S, 9, -1.0, 0.4, 0.0, 0.0)
        >>> step_between(before, after)
        (2.0, 0.5)

    Args:
        before: period.
        after: the next period; the step is taken halfway between both.
    """
    time = 0.5 * (before.end_s + after.start_s)
    (low, low_half), (high, high_half) = before.trend(time), after.trend(time)
    return high - low, math.hypot(low_half, high_half)


@dataclass(frozen=True)
class PerformanceReport:
    """Speed loss over time.

    Args:
        ship: ship with her reference curve.
        rows: accepted rows: ``time`` [s], ``speed_loss_percent``, ``power_W`` in still air.
        daily: daily medians: ``time`` [s], ``speed_loss_percent``, ``rows``.
        rejected: number of rows left out, by the first reason that applies.
        periods: periods between change points.
        first: date of time 0, if the log has dates.
        remarks: sentences on what could not be checked or corrected.
    """

    ship: ReferenceShip
    rows: pd.DataFrame
    daily: pd.DataFrame
    rejected: dict[str, int]
    periods: tuple[Period, ...]
    first: pd.Timestamp | None
    remarks: tuple[str, ...]


def analyse_performance(ship: ReferenceShip, log: pd.DataFrame) -> PerformanceReport:
    """Return the speed loss of a log over time (ISO 19030-2).

    Args:
        ship: ship with her reference curve.
        log: table of :func:`read_log`.

    Raises:
        TableError: no row lies within the reference conditions and the reference curve.
    """
    left_out = filters(ship, log)
    power = still_air_power(ship, log)
    reference = ship.reference_speed(power)
    left_out["outside the reference curve"] = ~np.isfinite(reference)
    accepted, rejected = np.ones(len(log), bool), {}
    for reason, rows in left_out.items():
        rejected[reason] = int(np.sum(accepted & rows))
        accepted &= ~rows
    if not accepted.any():
        reasons = ", ".join(f"{reason}: {n}" for reason, n in rejected.items() if n)
        raise TableError(
            f"none of the {len(log)} rows lies within the reference conditions ({reasons}); check the "
            f"units "
            "and the reference curve"
        )
    loss = 100.0 * (log["speed_through_water"].to_numpy() / reference - 1.0)
    rows = pd.DataFrame({"time": log["time"], "speed_loss_percent": loss, "power_W": power})[
        accepted
    ].reset_index(drop=True)
    daily = _daily(rows)
    periods = split_periods(daily)
    first = log["stamp"].iloc[0] if "stamp" in log else None
    return PerformanceReport(
        ship, rows, daily, rejected, periods, first, tuple(_remarks(ship, log))
    )


def _daily(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the median of each day, which single wrong rows do not move."""
    groups = rows.groupby((rows["time"] // DAY_S).astype(int))
    return pd.DataFrame(
        {
            "time": groups["time"].mean(),
            "speed_loss_percent": groups["speed_loss_percent"].median(),
            "rows": groups.size(),
        }
    ).reset_index(drop=True)


SHORTEST_DAYS = 10
"""Smallest number of days of a period."""

PENALTY = 4.0
"""Price of a change point in units of log(n) of 2 log L: place, mean and slope, and correlated days."""


def change_points(time: Floats, loss: Floats) -> list[tuple[int, int]]:
    """Split daily speed losses into periods with a straight trend each.

    Example:
        >>> days, loss = DAY_S * np.arange(60.0), np.repeat([-3.0, -0.5], 30)
        >>> change_points(days, loss)
        [(0, 30), (30, 60)]

    The sum of squares plus a price for each change point is minimised exactly by dynamic programming
    (Jackson et al. 2005, An algorithm for optimal partitioning of data on an interval). The noise is
    estimated from differences of neighbouring days, robustly.

    Args:
        time: [s], rising, (n,).
        loss: speed loss of each day, (n,).

    Returns:
        First index and index after the last of each period, in order of time.
    """
    count = len(loss)
    if count < 2 * SHORTEST_DAYS:
        return [(0, count)]
    variance = max((np.median(np.abs(np.diff(loss))) / (0.6745 * math.sqrt(2.0))) ** 2, 1e-12)
    price = PENALTY * math.log(count) * variance
    years = (time - time[0]) / YEAR_S
    sums = np.cumsum(
        np.array([np.ones(count), years, years**2, loss, years * loss, loss**2]), axis=1
    )
    sums = np.hstack([np.zeros((6, 1)), sums])
    best, last = np.full(count + 1, math.inf), np.zeros(count + 1, int)
    best[0] = -price
    for end in range(SHORTEST_DAYS, count + 1):
        starts = np.arange(0, end - SHORTEST_DAYS + 1)
        n, x, xx, y, xy, yy = sums[:, end][:, None] - sums[:, starts]
        spread = np.maximum(xx - x**2 / n, 1e-12)
        cost = yy - y**2 / n - (xy - x * y / n) ** 2 / spread
        total = best[starts] + cost + price
        choice = int(np.argmin(total))
        best[end], last[end] = total[choice], starts[choice]
    bounds, end = [], count
    while end > 0:
        bounds.append((int(last[end]), end))
        end = int(last[end])
    return bounds[::-1]


SMALLEST_STEP = 0.5
"""Smallest step of the speed loss [%] that counts as an event."""


def split_periods(daily: pd.DataFrame) -> tuple[Period, ...]:
    """Return the periods of daily speed losses; at each boundary the trend makes a clear step.

    Neighbouring periods of :func:`change_points` without a step are one: a trend that only bends is no
    event.

    Args:
        daily: daily medians with ``time`` and ``speed_loss_percent``.
    """
    bounds = change_points(daily["time"].to_numpy(), daily["speed_loss_percent"].to_numpy())
    while True:
        periods = [fit_period(daily.iloc[a:b]) for a, b in bounds]
        steps = [step_between(a, b) for a, b in itertools.pairwise(periods)]
        unclear = [abs(step) - max(half, SMALLEST_STEP) for step, half in steps]
        if not unclear or min(unclear) > 0.0:
            return tuple(periods)
        k = int(np.argmin(unclear))
        bounds[k : k + 2] = [(bounds[k][0], bounds[k + 1][1])]


def fit_period(daily: pd.DataFrame) -> Period:
    """Return mean and trend of a period, with intervals that count neighbouring days as dependent.

    Args:
        daily: daily medians with ``time`` and ``speed_loss_percent``.
    """
    time, loss = daily["time"].to_numpy(), daily["speed_loss_percent"].to_numpy()
    count = len(loss)
    centred = (time - time.mean()) / YEAR_S
    spread = float(centred @ centred)
    slope = float(centred @ loss) / spread if spread > 0.0 else 0.0
    residual = loss - loss.mean() - slope * centred
    if count < 4:
        return Period(time[0], time[-1], count, float(loss.mean()), math.inf, 0.0, math.inf)
    memory = float(
        np.clip(residual[1:] @ residual[:-1] / max(residual @ residual, 1e-12), 0.0, 0.9)
    )
    independent = max(count * (1.0 - memory) / (1.0 + memory), 3.0)
    deviation = math.sqrt(residual @ residual / count * independent / (independent - 2.0))
    factor = half_95(independent - 2.0) * deviation / math.sqrt(independent)
    return Period(
        float(time[0]),
        float(time[-1]),
        count,
        float(loss.mean()),
        factor,
        slope,
        factor / math.sqrt(spread / count),
    )


def _remarks(ship: ReferenceShip, log: pd.DataFrame) -> list[str]:
    """Return sentences on assumed units and on conditions that could not be checked."""
    said = list(log.attrs.get("remarks", ()))
    if log["wind_speed"].isna().all() or log["wind_angle"].isna().all():
        said.append("no wind in the log: neither filtered nor corrected")
    elif ship.superstructure is None:
        said.append(
            "no [superstructure] in the ship file: strong wind is filtered, weaker wind not corrected"
        )
    for column, what in (
        ("draught", "draught"),
        ("depth", "water depth"),
        ("water_temperature", "water temperature"),
        ("rudder", "rudder angle"),
    ):
        if log[column].isna().all():
            said.append(f"no {what} in the log: not filtered")
    return said
