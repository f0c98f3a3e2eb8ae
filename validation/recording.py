"""A case's ship, demands and sea; and how large an effect must be to have its strength in them.

A case made real: the recording, its truth, and what an oracle would know.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from .cases import TOLERANCES, Case, Concealed, truth_of
from .equivalents import equivalent
from .reality.bench import run_bench, voltage_programme
from .reality.effects import BENCH
from .reality.governed import bench_orders, run_bench_governed, sail_governed, sail_held
from .reality.instruments import read, voyage
from .reality.motion import calm, head_sea
from .reality.numbers import Numbers
from .reality.sail import StalledError, restless, sail
from .variants import CLOSED_LOOP, LOGGED_S, calibrated_numbers, healthy_of, true_numbers

CHANNELS = (
    "pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s", "motor_current_A",
)  # fmt: skip
CLOSE = 0.08  # relative; how near a strength must come to the one drawn
TRIALS = 9
WIND = 0.003  # share of the resistance; slow wandering that goes with waves
THINNED = 10  # every so many samples enter the imitation by wrong numbers


def with_effect(numbers: Numbers, concealed: Concealed, size: float) -> Numbers:
    """The numbers with one effect of a given size."""
    return numbers | concealed.shape | {concealed.effect.size: concealed.sign * size}


def rms(values: Any) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(values))))


class Scenario:
    """A case's ship, demands and sea, ready to sail with any set of effects."""

    def __init__(self, case: Case) -> None:
        self.case = case
        rng = np.random.default_rng(case.programme_seed)
        governed = case.variant == CLOSED_LOOP
        self.nominal, self.true = calibrated_numbers(case), true_numbers(case) | case.instruments
        self.waves = calm()
        if case.ship == BENCH:
            self.drive = voltage_programme(case.programme, case.seconds, case.period, rng)
            self.orders = bench_orders(self.drive)
        else:
            drawn = voyage(case.programme, case.seconds, case.period, rng, governed)
            self.drive, self.pitch = drawn
            self.orders = drawn[0]
        if case.wave_height > 0.0:
            depth = self.nominal["depth"]
            self.waves = head_sea(case.wave_height, case.wave_period, depth, case.programme_seed)
            self.true["wind"] = WIND
        if governed:  # effects are sized under the demands that the governor gives without them
            self.drive = self._governed(self.true)[1]

    def _governed(self, numbers: Numbers) -> tuple[pd.DataFrame, NDArray[np.float64]]:
        """Readings without noise under the governor, and the demands that it gave."""
        case = self.case
        if case.ship == BENCH:
            truth = run_bench_governed(numbers, self.orders, case.period, case.noise_seed)
        else:
            truth = sail_governed(
                numbers, self.orders, self.pitch, case.period, case.noise_seed, waves=self.waves,
                wind_seed=case.programme_seed,
            )  # fmt: skip
        demand = truth["motor_voltage_V" if case.ship == BENCH else "fuel_rack_mm"].to_numpy()
        return read(truth, numbers, case.period, None), demand

    def logged(self, numbers: Numbers, sailed: pd.DataFrame) -> tuple[Scenario, pd.DataFrame]:
        """What the recording is made of: the scenario at its rows and demands, and its readings.

        Args:
            numbers: of the true ship, with effects.
            sailed: its readings without noise, as the scenario has them.

        Returns:
            A scenario to sail other ships in under the demands of the recording, and the readings of
            this one at the recording's rows, noise on top.
        """
        case = self.case
        if case.variant == CLOSED_LOOP:
            other = copy.copy(self)
            governed, other.drive = self._governed(numbers)
            return other, other.noisy(governed)
        finer = round(case.period / LOGGED_S.get(case.variant, case.period))
        if finer <= 1:
            return self, self.noisy(sailed)
        other = copy.copy(self)
        other.case = replace(
            case,
            period=case.period / finer,
            instruments={  # as much noise in each hertz
                name: size * math.sqrt(finer) if name.endswith("_noise") else size
                for name, size in self.true.items()
                if name in case.instruments or name.endswith("_noise")
            },
        )
        rows = finer * (len(self.drive) - 1) + 1
        other.drive = np.repeat(self.drive, finer)[:rows]
        if case.ship != BENCH:
            other.pitch = np.repeat(self.pitch, finer)[:rows]
        return other, other.noisy(other.sail(numbers, waves=True))

    @property
    def kept_rows(self) -> slice:
        """Rows that the log keeps."""
        kept = LOGGED_S.get(self.case.variant, self.case.period) / self.case.period
        return slice(None, None, max(round(kept), 1))

    def sail(self, numbers: Numbers, waves: bool) -> pd.DataFrame:
        """Readings without noise."""
        case = self.case
        if case.ship == BENCH:
            truth = run_bench(numbers, self.drive, case.period)
        else:
            sea = self.waves if waves else calm()
            own = numbers if waves else numbers | {"wind": 0.0}
            way = sail_held if restless(self.drive) else sail
            truth = way(own, self.drive, self.pitch, case.period, waves=sea,
                         wind_seed=case.programme_seed)  # fmt: skip
        return read(truth, numbers, case.period, None)

    def noisy(self, readings: pd.DataFrame) -> pd.DataFrame:
        """Readings with the case's noise on top (their systematic errors are in already).

        Without the column that is not recorded.
        """
        plain = self.nominal | self.case.instruments
        noisy = read(readings, plain, self.case.period, self.case.noise_seed)
        return noisy.drop(columns=self.case.missing, errors="ignore")

    @cached_property
    def file_run(self) -> pd.DataFrame:
        """The ship as its file says once it is calibrated, in calm water, without noise."""
        return self.sail(self.nominal, waves=False)

    @cached_property
    def base(self) -> pd.DataFrame:
        """The true ship without effects in the case's sea, without noise."""
        return self.sail(self.true, waves=True) if len(self.waves) else self.calm_run

    @cached_property
    def calm_run(self) -> pd.DataFrame:
        """The true ship without effects in calm water, without noise."""
        wrong = any(factor != 1.0 for factor in self.case.factors.values())  # off is put right
        return self.sail(self.true, waves=False) if wrong else self.file_run

    def compared(self, numbers: Numbers) -> pd.DataFrame:
        """Readings to be compared between ships: calm, or waves met on a given track.

        Elsewhere ships of unlike speed meet other waves, which hides what the effect does.
        """
        if not any(one.effect.waves for one in self.case.effects):
            return self.sail(numbers, waves=False)
        track = {"track_speed": float(self.file_run["ship_speed_m_s"].mean())}
        return self.sail(numbers | track, waves=True)

    @cached_property
    def _reference(self) -> pd.DataFrame:
        airy = any(one.effect.waves for one in self.case.effects)
        return self.compared(self.true) if airy else self.calm_run

    @cached_property
    def residual_rms(self) -> dict[str, float]:
        """What the file's ship leaves of a noisy recording without effects, rms by channel."""
        null = self.noisy(self.base)
        return {c: rms(null[c] - self.file_run[c]) for c in CHANNELS if c in null}

    def _stacked(self, table: pd.DataFrame, reference: pd.DataFrame) -> NDArray[np.float64]:
        return np.array([
            (table[c] - reference[c]).to_numpy()[::THINNED] / size
            for c, size in self.residual_rms.items()
        ])  # fmt: skip

    @cached_property
    def imitations(self) -> NDArray[np.float64]:
        """Changes by each number at its tolerance, shape (samples of all channels, numbers)."""
        columns = []
        for name, tolerance in TOLERANCES[self.case.ship].items():
            moved = self.nominal[name] * (1.0 + tolerance)
            off = self.sail(self.nominal | {name: moved}, waves=False)
            columns.append(self._stacked(off, self.file_run).ravel())
        return np.column_stack(columns)

    def strength(self, sailed: pd.DataFrame) -> tuple[float, float, str]:
        """Strength of an effect by its :meth:`compared` readings, in the most affected channel.

        Returns:
            The rms of what no wrong number within its tolerance can imitate of the change, over the
            rms of the residual without the change; the same before any imitation; the channel.
        """
        change = self._stacked(sailed, self._reference)
        raw = np.sqrt(np.mean(change**2, axis=1))
        tolerances = TOLERANCES[self.case.ship]
        taken = np.array([(self.case.factors[n] - 1.0) / t for n, t in tolerances.items()])
        fit = scipy.optimize.lsq_linear(
            self.imitations, change.ravel(), bounds=(-1.001 - taken, 1.001 - taken)
        )
        rest = change - (self.imitations @ fit.x).reshape(change.shape)
        beyond = np.minimum(np.sqrt(np.mean(rest**2, axis=1)), raw.max())
        return float(beyond.max()), float(raw.max()), list(self.residual_rms)[int(beyond.argmax())]

    def find_size(self, concealed: Concealed) -> tuple[float, float, float, str]:
        """Size at which an effect has its strength: secant steps on the logarithms.

        Returns:
            Size, and the two strengths and the channel as of :meth:`strength`.
        """
        effect, size = concealed.effect, concealed.effect.first
        low, high = 0.0, effect.most  # too weak, too strong
        before: tuple[float, float] | None = None
        for trial in range(TRIALS):
            try:
                sailed = self.compared(with_effect(self.true, concealed, size))
            except StalledError:
                high, size = size, max(0.5 * size, math.sqrt(low * size))
                continue
            ratio, raw, channel = self.strength(sailed)
            enough = abs(ratio / concealed.ratio - 1.0) < CLOSE
            if enough or trial == TRIALS - 1 or (size >= effect.most and ratio < concealed.ratio):
                break
            low, high = (size, high) if ratio < concealed.ratio else (low, size)
            slope = 1.0
            if before is not None and min(ratio, before[1]) > 0.0 and size != before[0]:
                slope = math.log(ratio / before[1]) / math.log(size / before[0])
                slope = min(max(slope, 0.4), 4.0)
            before = size, ratio
            step = (concealed.ratio / ratio) ** (1.0 / slope) if ratio > 0.0 else 4.0
            size *= min(max(step, 0.02), 20.0)
            if not low < size < high:  # halve what is left, or take its end
                size = max(0.5 * high, math.sqrt(low * high)) if high < effect.most else high
            size = max(size, 0.01 * effect.first)
        return size, ratio, raw, channel


LEAST = (
    0.15  # strength below which another programme is drawn, since this one does not show the effect
)
ATTEMPTS = 4
OPTIONAL = ("thrust_N", "propeller_submergence_m")
_DIGITS = {"time_s": 4, "fuel_rack_mm": 4, "pitch_ratio_command": 5, "pitch_ratio": 5,
           "shaft_speed_rad_s": 5, "shaft_torque_N_m": 1, "ship_speed_m_s": 5, "thrust_N": 3,
           "propeller_submergence_m": 3, "motor_voltage_V": 4, "motor_current_A": 5}  # fmt: skip


@dataclass(frozen=True)
class Reality:
    """A recording and its truth."""

    recording: pd.DataFrame
    truth: Any
    without: pd.DataFrame  # the true ship without its effects, calm, perfect instruments
    concealed: pd.DataFrame  # with them, calm, as faulty instruments read it without noise
    healthy: pd.DataFrame | None = None  # a recording of the same ship without effects


@dataclass
class _Found:
    """Effects with their sizes; strengths beyond tolerances, raw strengths, channels."""

    scenario: Scenario
    sailed: pd.DataFrame
    numbers: Numbers
    sizes: dict[str, float]
    beyond: dict[str, float]
    ratios: dict[str, float]
    channels: dict[str, str]


def make(case: Case) -> Reality:
    """Simulate a case.

    An effect's strength is the rms of its change of the most affected reading, less what numbers
    within their tolerances can imitate of it, over the rms of (recording without effects - file's ship
    in calm water), on this very programme and sea. Where a programme cannot show an effect, another is
    drawn. The truth also holds the strength without regard to tolerances (``ratios``).
    """
    for attempt in range(ATTEMPTS):
        found = _conceal(
            Scenario(replace(case, programme_seed=case.programme_seed + 7919 * attempt))
        )
        if all(strength >= LEAST for strength in found.beyond.values()):
            break
    return _recorded(found)


def make_sized(case: Case, sizes: Mapping[str, float]) -> Reality:
    """Simulate a case whose effects have given sizes, whatever strength that is.

    Args:
        case: as drawn.
        sizes: by key of the effect, positive, in the unit of its number.

    Raises:
        StalledError: the engine stops.
    """
    scenario = Scenario(case)
    numbers = scenario.true
    for one in case.effects:
        numbers = with_effect(numbers, one, sizes[one.key])
    signed = {one.key: one.sign * sizes[one.key] for one in case.effects}
    sailed = scenario.sail(numbers, waves=True)
    return _recorded(_Found(scenario, sailed, numbers, signed, {}, {}, {}))


def _conceal(scenario: Scenario) -> _Found:
    found = _Found(scenario, scenario.base, scenario.true, {}, {}, {}, {})
    for one in scenario.case.effects:
        size, beyond, raw, channel = scenario.find_size(one)
        found.numbers = with_effect(found.numbers, one, size)
        found.sizes[one.key] = one.sign * size
        found.beyond[one.key], found.ratios[one.key] = beyond, raw
        found.channels[one.key] = channel
    if scenario.case.effects:
        found.sailed = scenario.sail(found.numbers, waves=True)
    return found


def _recorded(found: _Found) -> Reality:
    scenario, case, sailed = found.scenario, found.scenario.case, found.sailed
    notes = {
        "channels": found.channels,
        "beyond_tolerances": found.beyond,
        "windows": {c.key: _window(case, found.numbers, c) for c in case.effects},
        "equivalents": {c.key: equivalent(c.effect, found.numbers, sailed) for c in case.effects},
        "residual_rms": scenario.residual_rms,
    }
    aboard, readings = scenario.logged(found.numbers, sailed)
    without, concealed = scenario.calm_run, sailed
    if aboard is not scenario:
        without = aboard.sail(scenario.true, waves=False)
    if aboard is not scenario or case.wave_height > 0.0:
        concealed = aboard.sail(found.numbers, waves=False)
    rows = aboard.kept_rows
    healthy = healthy_of(case)
    return Reality(
        _file(case, readings[rows]),
        truth_of(case, found.sizes, found.ratios, notes),
        without=without[rows].reset_index(drop=True),
        concealed=concealed[rows].reset_index(drop=True),
        healthy=None if healthy is None else _healthy(healthy),
    )


def _healthy(case: Case) -> pd.DataFrame:
    """A recording without effects."""
    scenario = Scenario(case)
    return _file(case, scenario.noisy(scenario.base))


def _file(case: Case, readings: pd.DataFrame) -> pd.DataFrame:
    """What stands in a recording's file: its columns, in the digits of a logger."""
    kept = [c for c in readings if c not in OPTIONAL or c in case.columns]
    return readings[kept].round({c: _DIGITS[c] for c in kept}).reset_index(drop=True)


def _window(case: Case, numbers: Numbers, concealed: Concealed) -> list[float] | None:
    window = concealed.effect.window
    return [numbers[name] * case.seconds for name in window] if window else None
