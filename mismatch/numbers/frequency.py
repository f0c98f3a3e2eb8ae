"""Frequency responses: measured ones, and what a ship's linear model says to them.

A response is relative, a deviation of a channel over its mean by a deviation of the demand over its
own, as in Vrijdag & Martelli 2021. The model is the plant's linear one about the measured working
point, sampled as the recording is, with the demand held between rows as everywhere in the house.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import TIME, drive_column
from ...plant.linear import linearise
from ...plant.ship import Ship
from ...plant.steady_state import Equilibrium
from .steady import CURRENT, blade_column, point_at

Complex = NDArray[np.complex128]

STILL = 1e-9
"""Standard deviation, as a share of the mean, below which only last digits of a channel move."""

SPEED = "shaft_speed_rad_s"

OUTPUTS = {
    SPEED: "shaft_speed",
    CURRENT: "motor_current",
    "shaft_torque_N_m": "shaft_torque",
    "ship_speed_m_s": "ship_speed",
}
"""Columns whose response is looked at, and the linear model's output that answers each."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Measured response about one working point.

    Args:
        demand: its mean, in the unit of the drive's column.
        means: of the channels, by column; the pitch ratio among them where the blades turn.
        frequency: [rad/s], shape (n,), rising.
        response: relative response [-] of each channel, by column, each of shape (n,).
        error: standard error [-] of real and imaginary part, likewise; NaN where it is not known.
        interval_s: of the recording [s]; 0 of a response that was not sampled.
        coherence: squared [-], likewise; empty where the method has none.
    """

    demand: float
    means: dict[str, float]
    frequency: NDArray[np.float64]
    response: dict[str, Complex]
    error: dict[str, NDArray[np.float64]]
    interval_s: float
    coherence: dict[str, NDArray[np.float64]]

    def table(self) -> pd.DataFrame:
        """Frequency [rad/s], gain [-], phase [deg], standard error and coherence of each channel."""
        columns: dict[str, Any] = {"frequency_rad_s": self.frequency}
        for column, values in self.response.items():
            name = OUTPUTS[column]
            columns[f"{name}_gain"] = np.abs(values)
            columns[f"{name}_phase_deg"] = np.degrees(np.angle(values))
            columns[f"{name}_standard_error"] = self.error[column]
            if column in self.coherence:
                columns[f"{name}_coherence"] = self.coherence[column]
        return pd.DataFrame(columns)


def channels_of(ship: Ship, table: pd.DataFrame, method: str) -> dict[str, NDArray[np.float64]]:
    """Return the demand and the channels of a recording by column, the demand first.

    A channel other than the shaft speed is left out where it has no relative response: it is constant,
    as the speed of a hull that is fixed, or its mean is smaller than its standard deviation.

    Raises:
        ValueError: a drive that holds the shaft's speed, a column that is missing, a shaft that rests or
            reverses, or a demand without a mean.
    """
    demand = drive_column(ship)
    if not ship.turns_freely:
        raise ValueError(
            f"{method}: the drive of {ship.name} holds the shaft's speed, which then answers no demand; "
            "use --method output-error"
        )
    needed = [TIME, demand, SPEED, *(["ship_speed_m_s"] if ship.moves else [])]
    if lacking := [column for column in needed if column not in table]:
        raise ValueError(f"{method}: {ship.name} needs {lacking[0]}, which a recording lacks")
    found = {c: table[c].to_numpy(dtype=np.float64) for c in (demand, *OUTPUTS) if c in table}
    if found[SPEED].min() * found[SPEED].max() <= 0.0:
        raise ValueError(
            f"{method}: the shaft rests or reverses; a frequency response is that of a shaft that turns "
            "one way all the time"
        )
    if found[demand].mean() == 0.0:
        raise ValueError(f"{method}: {demand} has no mean, so the response has no working point")
    return {c: v for c, v in found.items() if c in (demand, SPEED) or _responds(v)}


def _responds(values: NDArray[np.float64]) -> bool:
    """Whether a channel has a relative response: it moves, about a mean that is larger than that."""
    mean, deviation = abs(float(values.mean())), float(values.std())
    return STILL * mean < deviation < mean


def means_of(
    ship: Ship, table: pd.DataFrame, channels: dict[str, NDArray[np.float64]], rows: slice
) -> dict[str, float]:
    """Return the means over some rows of the channels, and of the pitch ratio where the blades turn."""
    means = {c: float(channels[c][rows].mean()) for c in OUTPUTS if c in channels}
    blade = blade_column(ship, table)
    return means | ({} if blade is None else {"pitch_ratio": float(table[blade].iloc[rows].mean())})


def interval_of(table: pd.DataFrame) -> float:
    """Interval of a recording [s]."""
    time = table[TIME].to_numpy(dtype=np.float64)
    return float((time[-1] - time[0]) / (len(time) - 1))


def held(frequency: Any, interval_s: float) -> Complex:
    """Response [-] of holding a demand between rows, at frequencies [rad/s]; 1 if not sampled."""
    turn = 1j * np.asarray(frequency, dtype=np.float64) * interval_s
    small = np.abs(turn) < 1e-9
    return np.where(small, 1.0, -np.expm1(-turn) / np.where(small, 1.0, turn))


def blurred(values: NDArray[np.float64], interval_s: float, frequency: Any) -> NDArray[np.float64]:
    """Share [-] of a response that a channel may lack which takes new values now and then.

    An encoder tells the mean speed between two flanks and holds it until the next, which is (sin x /
    x)^2 with x half the frequency times the time between new values. Whether a channel does both, or
    only holds, its values do not say; what it may lack is therefore an error and no correction.

    Args:
        values: of the channel, shape (n,).
        interval_s: of the recording [s].
        frequency: [rad/s].
    """
    changes = int(np.count_nonzero(np.diff(values)))
    every = len(values) / max(changes, 1) * interval_s
    half = np.asarray(frequency, dtype=np.float64) * every / 2.0
    lacking = 1.0 - np.sinc(np.minimum(half, np.pi) / np.pi) ** 2
    return lacking if every > 1.5 * interval_s else 0.0 * lacking


def point_of(ship: Ship, measured: FrequencyResponse) -> Equilibrium:
    """The measured working point as one of the plant, whether its balances close there or not."""
    point, _ = point_at(
        ship, ship.record(), {drive_column(ship): measured.demand, **measured.means}
    )
    return point


def slowest_s(ship: Ship, measured: FrequencyResponse) -> float:
    """Longest time constant [s] of the ship's linear model about the measured point, or 0."""
    poles = np.real(linearise(ship, point_of(ship, measured), ("shaft_speed",)).poles())
    return float(1.0 / np.min(-poles[poles < 0.0], initial=np.inf))


def modelled(ship: Ship, measured: FrequencyResponse) -> dict[str, Complex]:
    """Relative response of a ship about the measured point, by column, at the measured frequencies.

    Sampled and held as the measured one; a late speed sensor (``sensors.speed_delay_s``) among it.
    """
    columns = list(measured.response)
    system = linearise(ship, point_of(ship, measured), tuple(OUTPUTS[c] for c in columns))
    drive = system.input_labels.index("drive")
    a, c = np.asarray(system.A), np.asarray(system.C)
    b, d = np.asarray(system.B)[:, [drive]], np.asarray(system.D)[:, [drive]]
    frequency, interval_s = measured.frequency, measured.interval_s
    shift = np.asarray(1j * frequency, dtype=np.complex128)
    if interval_s > 0.0:
        size = len(a)
        both = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, size + 1))]]) * interval_s)
        a, b, shift = both[:size, :size], both[:size, size:], np.exp(shift * interval_s)
    resolvent = shift[:, None, None] * np.eye(len(a)) - a
    answer = c @ np.linalg.solve(resolvent, np.broadcast_to(b, (len(shift), *b.shape))) + d
    answer = answer[:, :, 0] / held(frequency, interval_s)[:, None]
    found = {}
    for k, column in enumerate(columns):
        found[column] = answer[:, k] * measured.demand / measured.means[column]
    if SPEED in found:
        found[SPEED] = found[SPEED] * np.exp(-1j * frequency * ship.sensors.speed_delay_s)
    return found
