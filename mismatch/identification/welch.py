"""Estimate parameters from noise on the command: frequency response by Welch's method (eq. 40).

H = S_xy / S_xx from overlapping windowed segments (Welch 1967), with the coherence between command and
response. Long segments resolve low frequencies and short ones have more averages, so each part of the
spectrum uses segments as long as it needs, and neighbouring lines are joined. The parameters are fitted
to the response as in the sine method; the paper leaves this step open.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from ..estimate import Tick, ignore_progress
from .free_parameters import parse_free, usual_keys
from .frequency import (
    OUTPUTS,
    FrequencyResponse,
    attenuation,
    channels_of,
    fit_response,
    interval_of,
    means_of,
    slowest_s,
    zero_order_hold,
)
from .parameters import MethodResult

METHOD = "welch"
SEGMENTS = 3  # fewest segments without overlap over which the lowest frequencies are averaged
SHORTER = 4  # ratio of the lengths of segments of one part of the spectrum and the next
PERIODS = 6  # of the lowest frequency in a segment; the longest segments are used down to one
MEMORY = 20.0  # shortest segment in time constants of the ship, so that it forgets its first state
PER_DECADE = 12  # number of frequencies of the response per decade
COHERENT = 0.5  # least squared coherence of a frequency in the fit
DRIVEN = 0.01  # least power density of the command at a frequency, as a share of its maximum
FLAT = 0.5  # largest share of a noise command's power in the strongest hundredth of its lines
OVERLAPPED = 0.53  # averages per segment at half overlap with Hann's window (Welch 1967)
NO_WEIGHT = 1e6  # error so large that a value has no weight


def welch(
    ship: Ship,
    tables: Iterable[pd.DataFrame],
    free: Sequence[str] | None = None,
    tick: Tick = ignore_progress,
) -> MethodResult:
    """Estimate parameters of a ship from its response to noise on the command.

    Args:
        ship: ship with the start of the search and the parameters that are not free.
        tables: recordings in canonical columns at an even interval, with noise on the command about one
            working point, one to two minutes or more; equal columns and intervals. Columns:
            ``shaft_speed_rad_s`` (needed), ``motor_current_A``, ``shaft_torque_N_m``,
            ``ship_speed_m_s``.
        free: dotted keys; by default those of :func:`.free_parameters.usual_keys`, the paper's six for a
            direct-current motor at bollard pull. ``sensors.speed_delay_s`` is allowed.
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        Estimates by least squares of complex errors, with the covariance from coherence and residual.
        Tables as in :func:`shaftline.mismatch.identification.sine.sine`, with the coherence.

    Raises:
        ValueError: a missing column, a command that is no noise, a shaft that stops or reverses, no
            coherent frequency, or parameters that the response does not distinguish.
    """
    chosen = parse_free(ship, free, usual_keys(ship, response=True))
    return fit_response(METHOD, chosen, keep_coherent(noise_response(ship, tables, tick)))


def noise_response(
    ship: Ship, tables: Iterable[pd.DataFrame], tick: Tick = ignore_progress
) -> FrequencyResponse:
    """Return the response at all frequencies; arguments and errors as in :func:`welch`."""
    tables = list(tables)
    if not tables:
        raise ValueError(f"{METHOD}: no recording")
    demand = drive_column(ship)
    runs = [channels_of(ship, table, METHOD) for table in tables]
    interval_s = interval_of(tables[0])
    for run, table in zip(runs, tables, strict=True):
        if set(run) != set(runs[0]) or abs(interval_of(table) / interval_s - 1.0) > 0.01:
            raise ValueError(f"{METHOD}: the recordings have different columns or intervals")
        if not _is_noise(run[demand]):
            raise ValueError(
                f"{METHOD}: {demand} is no noise: most of its power is in few lines of the spectrum, as "
                "for steps or sines; use --method step or sine"
            )
    whole = {c: np.concatenate([run[c] for run in runs]) for c in runs[0]}
    level = {c: float(values.mean()) for c, values in whole.items()}
    relative = [{c: run[c] / level[c] - 1.0 for c in run} for run in runs]
    outputs = [c for c in OUTPUTS if c in whole]
    pairs = zip(tables, runs, strict=True)
    each = [means_of(ship, table, run, slice(None)) for table, run in pairs]
    rows = [len(table) for table in tables]
    means = {c: float(np.average([one[c] for one in each], weights=rows)) for c in each[0]}
    about = FrequencyResponse(level[demand], means, np.empty(0), {}, {}, interval_s)
    shortest = max(round(MEMORY * slowest_s(ship, about) / interval_s), 64)
    bands = _bands(min(rows), shortest, interval_s)
    lines: list[_Line] = []
    for done, (length, low, high) in enumerate(bands, 1):
        lines += _band(relative, demand, outputs, length, low, high, interval_s)
        tick(METHOD, done, len(bands))
    if not lines:
        raise ValueError(
            f"{METHOD}: recordings of {min(rows) * interval_s:.4g} s are too short for segments of "
            f"{shortest * interval_s:.4g} s, which is {MEMORY:g} time constants of "
            f"{ship.name}; record for longer"
        )
    density = max(line.density for line in lines)
    lines = [line for line in lines if line.density >= DRIVEN * density]
    frequency = np.array([line.frequency for line in lines])
    parts = {c: np.array([line.answers[c] for line in lines]) for c in outputs}
    hold = zero_order_hold(frequency, interval_s)
    lacking = {c: attenuation(whole[c], interval_s, frequency) for c in outputs}
    return replace(
        about,
        frequency=frequency,
        response={c: part[:, 0] / hold for c, part in parts.items()},
        error={c: np.hypot(p[:, 1].real, lacking[c] * np.abs(p[:, 0])) for c, p in parts.items()},
        coherence={c: part[:, 2].real for c, part in parts.items()},
    )


def keep_coherent(measured: FrequencyResponse) -> FrequencyResponse:
    """Return the response at frequencies with a coherent channel; other channels get no weight there.

    Raises:
        ValueError: no channel is coherent at any frequency.
    """
    clear = {c: values >= COHERENT for c, values in measured.coherence.items()}
    kept = np.any(list(clear.values()), axis=0)
    if not kept.any():
        raise ValueError(
            f"{METHOD}: no channel has a coherence of {COHERENT:g} with the command at any frequency; "
            "record a stronger or longer excitation"
        )
    return replace(
        measured,
        frequency=measured.frequency[kept],
        response={c: v[kept] for c, v in measured.response.items()},
        error={c: np.where(clear[c], v, NO_WEIGHT)[kept] for c, v in measured.error.items()},
        coherence={c: v[kept] for c, v in measured.coherence.items()},
    )


def _is_noise(demand: NDArray[np.float64]) -> bool:
    power = np.abs(np.fft.rfft(demand - demand.mean())) ** 2
    total = float(power.sum())
    if total <= 1e-20 * float(np.sum(demand**2)) * len(demand):
        return False
    strongest = np.sort(power)[-max(1, len(power) // 100) :]
    occupied = int(np.sum(power > 1e-3 * power.max()))
    return float(strongest.sum()) < FLAT * total or occupied > len(power) // 50


def _bands(rows: int, shortest: int, interval_s: float) -> list[tuple[int, float, float]]:
    """Return the segment length [rows] and the limits [rad/s] of each part, lowest frequencies first."""
    length, found = rows // SEGMENTS, []
    low, top = 1.9 * math.pi / (length * interval_s), 0.8 * math.pi / interval_s
    while low < top:
        shorter = length // SHORTER
        last = shorter < shortest
        high = top if last else min(2.0 * math.pi * PERIODS / (shorter * interval_s), top)
        found.append((length, low, high))
        length, low = shorter, high
    return found


class _Line(NamedTuple):
    """Response at one frequency, from several lines of the spectrum joined."""

    frequency: float  # [rad/s]
    density: float  # of the demand's power
    answers: dict[str, tuple[complex, float, float]]  # response, standard error, coherence


def _band(
    runs: list[dict[str, NDArray[np.float64]]],
    demand: str,
    outputs: list[str],
    length: int,
    low: float,
    high: float,
    interval_s: float,
) -> list[_Line]:
    """Return the responses of one part of the spectrum."""
    window = scipy.signal.get_window("hann", length)
    lines = 2.0 * math.pi * np.fft.rfftfreq(length, interval_s)
    spectra: dict[str, list[NDArray[np.complex128]]] = {c: [] for c in (demand, *outputs)}
    for run in runs:
        for begin in range(0, len(run[demand]) - length + 1, max(1, length // 2)):
            for column, parts in spectra.items():
                values = run[column][begin : begin + length]
                parts.append(np.fft.rfft(window * (values - values.mean())))
    stacked = {c: np.array(parts) for c, parts in spectra.items()}
    count = max(round(PER_DECADE * math.log10(high / low)), 1)
    edges = low * (high / low) ** (np.arange(count + 1) / count)
    found = []
    for a, b in itertools.pairwise(edges):
        inside = np.flatnonzero((lines >= a) & (lines < b))
        if not len(inside):
            continue
        cause = stacked[demand][:, inside]
        input_power = float(np.sum(np.abs(cause) ** 2))
        weight = np.sum(np.abs(cause) ** 2, axis=0)
        frequency = float(np.sum(weight * lines[inside]) / max(weight.sum(), 1e-300))
        # Neighbouring lines of a Hann window are correlated; two thirds of them are independent.
        averages = max(1.0, OVERLAPPED * len(cause) * max(1.0, len(inside) * 2.0 / 3.0))
        answers = {}
        for column in outputs:
            answer = stacked[column][:, inside]
            cross = complex(np.sum(np.conj(cause) * answer))
            power = float(np.sum(np.abs(answer) ** 2))
            gamma = min(abs(cross) ** 2 / max(input_power * power, 1e-300), 1.0)
            gain = cross / max(input_power, 1e-300)
            spread = (1.0 - gamma) / max(gamma, 1e-12) / (2.0 * averages)
            answers[column] = (gain, abs(gain) * math.sqrt(spread), gamma)
        density = input_power / cause.size / length  # a windowed sum grows with the length
        found.append(_Line(frequency, density, answers))
    return found
