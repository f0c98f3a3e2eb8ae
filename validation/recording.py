"""Simulate a case: size its effects for the wanted strength, and make the recording and its truth."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from .cases import TOLERANCES, Case, Concealed, truth_of
from .equivalents import equivalent
from .localisation import noticeable_rows, rows_inside, windows_of
from .simulator.bench import run_bench, voltage_programme
from .simulator.effects import BENCH
from .simulator.governor import bench_orders, run_bench_governed, simulate_governed, simulate_held
from .simulator.instruments import NOISE, add_instruments, voyage
from .simulator.motion import calm, head_sea
from .simulator.parameters import Parameters
from .simulator.voyage import StalledError, simulate_voyage, varies_every_sample
from .variants import CLOSED_LOOP, LOGGED_S, calibrated_parameters, reference_case, true_parameters

CHANNELS = (
    "pitch_ratio",
    "shaft_speed_rad_s",
    "shaft_torque_N_m",
    "ship_speed_m_s",
    "motor_current_A",
)
CLOSE = 0.08  # relative tolerance of the strength
TRIALS = 9
WIND = 0.003  # slow variation of the resistance in waves, as a share
THINNED = 10  # rows between samples for the imitation by biased parameters


def with_effect(numbers: Parameters, concealed: Concealed, size: float) -> Parameters:
    """Return the parameters with one effect of a given size."""
    return numbers | concealed.shape | {concealed.effect.size: concealed.sign * size}


def rms(values: Any) -> float:
    """Return the root mean square."""
    return math.sqrt(float(np.mean(np.square(values))))


class Scenario:
    """Ship, commands and sea of a case, for simulations with any set of effects."""

    def __init__(self, case: Case) -> None:
        self.case = case
        rng = np.random.default_rng(case.programme_seed)
        governed = case.variant == CLOSED_LOOP
        self.nominal = calibrated_parameters(case)
        self.true = true_parameters(case) | case.instruments
        self.waves = calm()
        if case.ship == BENCH:
            self.drive = voltage_programme(case.programme, case.seconds, case.period, rng)
            self.orders = bench_orders(self.drive)
        else:
            self.drive, self.pitch = voyage(
                case.programme, case.seconds, case.period, rng, governed
            )
            self.orders = self.drive
        if case.wave_height > 0.0:
            depth = self.nominal["depth"]
            self.waves = head_sea(case.wave_height, case.wave_period, depth, case.programme_seed)
            self.true["wind"] = WIND
        if governed:  # effects are sized with the governor's commands without them
            self.drive = self._governed(self.true)[1]

    def _governed(self, numbers: Parameters) -> tuple[pd.DataFrame, NDArray[np.float64]]:
        """Return noise-free measurements under the governor, and its commands."""
        case = self.case
        if case.ship == BENCH:
            truth = run_bench_governed(numbers, self.orders, case.period, case.noise_seed)
        else:
            truth = simulate_governed(
                numbers,
                self.orders,
                self.pitch,
                case.period,
                case.noise_seed,
                waves=self.waves,
                wind_seed=case.programme_seed,
            )
        demand = truth["motor_voltage_V" if case.ship == BENCH else "fuel_rack_mm"].to_numpy()
        return add_instruments(truth, numbers, case.period, None), demand

    def logged(
        self, numbers: Parameters, noise_free: pd.DataFrame
    ) -> tuple[Scenario, pd.DataFrame]:
        """Return a scenario with the commands of the recording, and noisy measurements at its rows.

        Args:
            numbers: parameters of the true ship with effects.
            noise_free: its noise-free measurements in this scenario.
        """
        case, other = self.case, copy.copy(self)
        if case.variant == CLOSED_LOOP:
            governed, other.drive = self._governed(numbers)
            return other, other.noisy(governed)
        finer = round(case.period / LOGGED_S.get(case.variant, case.period))
        if finer <= 1:
            return self, self.noisy(noise_free)
        instruments = {  # the same noise density
            name: size * math.sqrt(finer) if name.endswith("_noise") else size
            for name, size in self.true.items()
            if name in case.instruments or name.endswith("_noise")
        }
        other.case = replace(case, period=case.period / finer, instruments=instruments)
        rows = finer * (len(self.drive) - 1) + 1
        other.drive = np.repeat(self.drive, finer)[:rows]
        if case.ship != BENCH:
            other.pitch = np.repeat(self.pitch, finer)[:rows]
        return other, other.noisy(other.simulate(numbers, waves=True))

    @property
    def kept_rows(self) -> slice:
        """Rows that the log keeps."""
        kept = LOGGED_S.get(self.case.variant, self.case.period) / self.case.period
        return slice(None, None, max(round(kept), 1))

    def simulate(self, numbers: Parameters, waves: bool) -> pd.DataFrame:
        """Return the measurements without noise."""
        case = self.case
        if case.ship == BENCH:
            truth = run_bench(numbers, self.drive, case.period)
        else:
            sea = self.waves if waves else calm()
            own = numbers if waves else numbers | {"wind": 0.0}
            way = simulate_held if varies_every_sample(self.drive) else simulate_voyage
            truth = way(
                own, self.drive, self.pitch, case.period, waves=sea, wind_seed=case.programme_seed
            )
        return add_instruments(truth, numbers, case.period, None)

    def noisy(self, readings: pd.DataFrame) -> pd.DataFrame:
        """Add the case's noise to measurements, and drop the column that is not recorded."""
        plain = self.nominal | self.case.instruments
        noisy = add_instruments(readings, plain, self.case.period, self.case.noise_seed)
        return noisy.drop(columns=self.case.missing, errors="ignore")

    @cached_property
    def file_run(self) -> pd.DataFrame:
        """Noise-free simulation of the calibrated ship file in calm water."""
        return self.simulate(self.nominal, waves=False)

    @cached_property
    def base(self) -> pd.DataFrame:
        """Noise-free simulation of the true ship without effects in the case's sea."""
        return self.simulate(self.true, waves=True) if len(self.waves) else self.calm_run

    @cached_property
    def calm_run(self) -> pd.DataFrame:
        """Noise-free simulation of the true ship without effects in calm water."""
        right = all(factor == 1.0 for factor in self.case.factors.values())
        return self.file_run if right else self.simulate(self.true, waves=False)

    def compared(self, numbers: Parameters) -> pd.DataFrame:
        """Return measurements in calm water, or on a given track in waves.

        Otherwise ships of different speeds would meet different waves, which would hide the effect.
        """
        if not self.needs_waves:
            return self.simulate(numbers, waves=False)
        track = {"track_speed": float(self.file_run["ship_speed_m_s"].mean())}
        return self.simulate(numbers | track, waves=True)

    @property
    def needs_waves(self) -> bool:
        """Whether an effect acts in waves only."""
        return any(one.effect.waves for one in self.case.effects)

    @cached_property
    def _reference(self) -> pd.DataFrame:
        return self.compared(self.true) if self.needs_waves else self.calm_run

    @cached_property
    def residual_rms(self) -> dict[str, float]:
        """Rms residual of the ship file for a noisy recording without effects, by channel."""
        null = self.noisy(self.base)
        return {c: rms(null[c] - self.file_run[c]) for c in CHANNELS if c in null}

    def _stacked(self, table: pd.DataFrame, reference: pd.DataFrame) -> NDArray[np.float64]:
        return np.array(
            [
                (table[c] - reference[c]).to_numpy()[::THINNED] / size
                for c, size in self.residual_rms.items()
            ]
        )

    @cached_property
    def imitations(self) -> NDArray[np.float64]:
        """Changes by each parameter at its tolerance, shape (samples of all channels, parameters)."""
        columns = []
        for name, tolerance in TOLERANCES[self.case.ship].items():
            moved = self.nominal[name] * (1.0 + tolerance)
            off = self.simulate(self.nominal | {name: moved}, waves=False)
            columns.append(self._stacked(off, self.file_run).ravel())
        return np.column_stack(columns)

    def strength(self, noise_free: pd.DataFrame) -> tuple[float, float, str]:
        """Return the strength of an effect from its :meth:`compared` measurements.

        Returns:
            Rms of the part of the change that no bias of the parameters within tolerance can imitate,
            relative to the rms residual without the change; that of the whole change; the most affected
            channel.
        """
        change = self._stacked(noise_free, self._reference)
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
        """Return the size for the wanted strength of an effect, and the result of :meth:`strength`.

        The steps are those of the secant method on the logarithms.
        """
        effect, size = concealed.effect, concealed.effect.first
        low, high = 0.0, effect.most  # too weak, too strong
        before: tuple[float, float] | None = None
        for trial in range(TRIALS):
            try:
                noise_free = self.compared(with_effect(self.true, concealed, size))
            except StalledError:
                high, size = size, max(0.5 * size, math.sqrt(low * size))
                continue
            ratio, raw, channel = self.strength(noise_free)
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
            if not low < size < high:  # bisect the interval, or take its end
                size = max(0.5 * high, math.sqrt(low * high)) if high < effect.most else high
            size = max(size, 0.01 * effect.first)
        return size, ratio, raw, channel


LEAST = 0.15  # strength below which another programme is drawn
ATTEMPTS = 4
OPTIONAL = ("thrust_N", "propeller_submergence_m")
_DIGITS = {
    "time_s": 4,
    "fuel_rack_mm": 4,
    "pitch_ratio_command": 5,
    "pitch_ratio": 5,
    "shaft_speed_rad_s": 5,
    "shaft_torque_N_m": 1,
    "ship_speed_m_s": 5,
    "thrust_N": 3,
    "propeller_submergence_m": 3,
    "motor_voltage_V": 4,
    "motor_current_A": 5,
}


@dataclass(frozen=True)
class SimulatedCase:
    """Recording of a case with its truth and reference simulations."""

    recording: pd.DataFrame
    truth: Any
    without: pd.DataFrame  # true ship without effects, calm water, perfect instruments
    concealed: pd.DataFrame  # true ship with effects, calm water, instruments without noise
    healthy: pd.DataFrame | None = None  # recording of a reference period without effects


@dataclass
class _SizedEffects:
    """Effects with their sizes, strengths and most affected channels."""

    scenario: Scenario
    noise_free: pd.DataFrame
    numbers: Parameters
    sizes: dict[str, float] = field(default_factory=dict)
    beyond: dict[str, float] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)
    channels: dict[str, str] = field(default_factory=dict)


def simulate_case(case: Case) -> SimulatedCase:
    """Simulate a case.

    The strength of an effect is the rms of its change of the most affected channel, less the part that
    parameters within their tolerances can imitate, relative to the rms difference between the recording
    without effects and the ship file in calm water. If a programme cannot show an effect, another one is
    drawn. The truth has the strength without tolerances as well (``ratios``).
    """
    for attempt in range(ATTEMPTS):
        seed = case.programme_seed + 7919 * attempt
        found = _conceal(Scenario(replace(case, programme_seed=seed)))
        if all(strength >= LEAST for strength in found.beyond.values()):
            break
    return _simulated_case(found)


def simulate_case_with_sizes(case: Case, sizes: Mapping[str, float]) -> SimulatedCase:
    """Simulate a case whose effects have given sizes, with any strength.

    Args:
        case: case as drawn.
        sizes: positive sizes by key of the effect, in the unit of its parameter.

    Raises:
        StalledError: the engine stops.
    """
    scenario = Scenario(case)
    numbers = scenario.true
    for one in case.effects:
        numbers = with_effect(numbers, one, sizes[one.key])
    signed = {one.key: one.sign * sizes[one.key] for one in case.effects}
    noise_free = scenario.simulate(numbers, waves=True)
    return _simulated_case(_SizedEffects(scenario, noise_free, numbers, signed))


def _conceal(scenario: Scenario) -> _SizedEffects:
    found = _SizedEffects(scenario, scenario.base, scenario.true)
    for one in scenario.case.effects:
        size, beyond, raw, channel = scenario.find_size(one)
        found.beyond[one.key], found.ratios[one.key] = beyond, raw
        found.channels[one.key] = channel
        found.numbers = with_effect(found.numbers, one, size)
        found.sizes[one.key] = one.sign * size
    if scenario.case.effects:
        found.noise_free = scenario.simulate(found.numbers, waves=True)
    return found


def _simulated_case(found: _SizedEffects) -> SimulatedCase:
    scenario, case, noise_free = found.scenario, found.scenario.case, found.noise_free
    effects, numbers = case.effects, found.numbers
    windows = {c.key: _window(case, numbers, c) for c in effects}
    aboard, readings = scenario.logged(found.numbers, noise_free)
    without, concealed = scenario.calm_run, noise_free
    if aboard is not scenario:
        without = aboard.simulate(scenario.true, waves=False)
    if aboard is not scenario or case.wave_height > 0.0:
        concealed = aboard.simulate(found.numbers, waves=False)
    notes = {
        "channels": found.channels,
        "beyond_tolerances": found.beyond,
        "windows": windows,
        "equivalents": {c.key: equivalent(c.effect, numbers, noise_free) for c in effects},
        "residual_rms": scenario.residual_rms,
        "active_s": _active_windows(aboard, numbers, (without, concealed), list(windows.values())),
    }
    rows, healthy = aboard.kept_rows, None
    if (reference := reference_case(case)) is not None:
        period = Scenario(reference)
        healthy = _file(reference, period.noisy(period.base))
    return SimulatedCase(
        _file(case, readings[rows]),
        truth_of(case, found.sizes, found.ratios, notes),
        without[rows].reset_index(drop=True),
        concealed[rows].reset_index(drop=True),
        healthy,
    )


def _active_windows(
    aboard: Scenario,
    numbers: Parameters,
    calm_runs: tuple[pd.DataFrame, pd.DataFrame],
    windows: list[list[float] | None],
) -> list[list[float]]:
    """Return the windows in which the effects act noticeably [s], by the rules of :mod:`.localisation`.

    Args:
        aboard: scenario with the commands of the recording.
        numbers: parameters of the true ship with effects.
        calm_runs: noise-free measurements in calm water without and with effects.
        windows: window of each effect; None for an effect that has none.
    """
    case = aboard.case
    if not case.effects:
        return []
    without, acting = calm_runs
    if aboard.needs_waves:
        without, acting = aboard.compared(aboard.true), aboard.compared(numbers)
    sizes = aboard.nominal | case.instruments
    noise = {c: sizes[NOISE[c][0]] for c in CHANNELS if c in without and c != case.missing}
    change, time = acting[[*noise]] - without[[*noise]], acting["time_s"].to_numpy()
    rows = noticeable_rows(change, noise, case.period)
    open_s = [window for window in windows if window is not None]
    if len(open_s) == len(windows):
        rows &= rows_inside(open_s, time)
    return windows_of(rows, time)


def _file(case: Case, readings: pd.DataFrame) -> pd.DataFrame:
    """Return the columns of the recording's file, rounded like those of a logger."""
    kept = [c for c in readings if c not in OPTIONAL or c in case.columns]
    return readings[kept].round({c: _DIGITS[c] for c in kept}).reset_index(drop=True)


def _window(case: Case, numbers: Parameters, concealed: Concealed) -> list[float] | None:
    window = concealed.effect.window
    return [numbers[name] * case.seconds for name in window] if window else None
