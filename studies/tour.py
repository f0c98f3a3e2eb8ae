"""The first look: the frigate in a seaway with every observer, then a real drive train."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .. import display
from ..observers import follow, get_observer, readings_of
from ..observers.metrics import variance_accounted_for
from ..plant import load_ship
from .thesis.load_cases import CASES
from .thesis.vaf import ROWS
from .tito_neri import steady_states

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAUGE_NOISE = {
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 1500.0,
    "pitch_ratio": 0.004,
    "shaft_acceleration_rad_s2": 0.02,
}
"""Rms noise per reading at 20 Hz of good shipboard instruments: encoder, strain gauge (1 % of full
torque), pitch feedback, accelerometer. Assumed, as orders of magnitude."""

PERFECT, NOISY = "VAF perfect readings [%]", "VAF noisy readings [%]"


@dataclass(frozen=True)
class Seaway:
    """The frigate's voyage: a table of observers and a picture."""

    table: pd.DataFrame
    figure: Figure

    @property
    def sentence(self) -> str:
        """Which observers follow best."""
        by_name = self.table.set_index("observer")
        perfect, noisy = by_name[PERFECT], by_name[NOISY].drop("shaft-acceleration")
        return (
            f"With noisy readings and no accelerometer, {noisy.idxmax()} follows best "
            f"({noisy.max():.1f} %); {perfect.drop('shaft-acceleration').idxmax()}, the best with "
            "perfect readings, amplifies the noise and falls to "
            f"{noisy[perfect.drop('shaft-acceleration').idxmax()]:.1f} %."
        )


def sail_the_thesis_sea(seed: int = 0, tick: Callable[[], None] = lambda: None) -> Seaway:
    """Sail 300 s of head seas and let every observer estimate the advance velocity.

    Args:
        seed: of the sea and of the noise.
        tick: called after each observer.

    Returns:
        Table with VAF [%] and rms error [m/s], with perfect and with noisy readings.
    """
    frigate = load_ship("frigate")
    samples = CASES["jonswap"].run(frigate, seed=seed)
    dt, truth = frigate.time_step_s, samples["advance_velocity"]
    clean = readings_of(samples)
    rms = np.array([*GAUGE_NOISE.values(), 0.0])
    noisy = clean + np.random.default_rng(seed).standard_normal(clean.shape) * rms
    rows, estimates, scores = [], {}, {}
    for name, observer in ROWS.items():
        exact, _ = follow(get_observer(observer), frigate, clean, dt)
        real, valid = follow(get_observer(observer), frigate, noisy, dt)
        estimates[name], scores[name] = real, variance_accounted_for(truth, real)
        rows.append(
            {
                "observer": name,
                PERFECT: variance_accounted_for(truth, exact),
                NOISY: scores[name],
                "rms error, noisy [m/s]": float(np.sqrt(np.mean((real - truth) ** 2))),
                "valid [%]": 100.0 * float(np.mean(valid)),
            }
        )
        tick()
    figure = display.figures.seaway(samples["time"], truth, estimates, scores, (100.0, 160.0))
    return Seaway(pd.DataFrame(rows), figure)


@dataclass(frozen=True)
class DriveTrain:
    """Tito Neri: tables, sentences and a picture."""

    points: pd.DataFrame
    response: pd.DataFrame
    sentences: list[str]
    figure: Figure

    @property
    def gains(self) -> pd.DataFrame:
        """Gains of the frequency response, measured beside each parameter set's."""
        columns: dict[str, object] = {}
        for quantity in ("speed", "current"):
            for model, lines in self.response.groupby("model", sort=False):
                columns["rad/s"] = lines["frequency_rad_s"].to_numpy()
                columns[f"{quantity}, measured"] = lines[f"{quantity}_gain_measured"].to_numpy()
                short = str(model).removeprefix("tito-neri-")
                columns[f"{quantity}, {short}"] = lines[f"{quantity}_gain"].to_numpy()
        return pd.DataFrame(columns)


def meet_the_drive_train() -> DriveTrain:
    """Simulate Tito Neri at the measured voltages with both published parameter sets."""
    points = steady_states.operating_points()
    response = steady_states.frequency_response()
    sentences = [steady_states.verdict(points, model) for model in steady_states.MODELS]
    sentences += [
        f"{model}: rms gain error of the frequency response up to 500 rad/s: speed "
        f"{steady_states.response_error(response, model, 'speed'):.2f} dB, current "
        f"{steady_states.response_error(response, model, 'current'):.2f} dB."
        for model in steady_states.MODELS
    ]
    figure = display.figures.drive_train(points, response, steady_states.MODELS)
    return DriveTrain(points, response, sentences, figure)
