"""Trials of the frigate by the planner's criterion and by that of Strouwen and Micluța-Câmpeanu 2026.

The search is the same: coordinate exchange from the same random commands. Their criterion is the mean
over all pairs of models of the largest squared difference of the predictions; with several instruments
here, each difference is divided by the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy

from shaftline.mismatch import Limits
from shaftline.mismatch.planning.evidence import Noise, Predictions, Predictor, evidence_of
from shaftline.mismatch.planning.exchange import exchange
from shaftline.mismatch.planning.manoeuvres import (
    Floats,
    command_ranges,
    hold_commands,
    is_inside,
    table_of,
)
from shaftline.mismatch.planning.plan import DECIDED, own_effects
from shaftline.plant import Ship, load_ship
from shaftline.plant.recording import RecordingError
from shaftline.plant.ship import ShipError

from .criteria import CRITERIA, RANDOM, Criterion

MINUTES, HOLD_S = 15, 75
"""Length of a trial, and the time for which commands are held [s]."""

TRIED = 3
"""Number of values of a command between which the exchange chooses."""

SMALLER = 0.9
"""Factor on the distance of random commands from the middle of their range, until they are allowed."""

LIMITS = Limits(drive=(14.0, 30.0), pitch_ratio=(0.95, 1.35))

NOISE = {
    "shaft_speed_rad_s": Noise(0.03),
    "ship_speed_m_s": Noise(0.05),
    "shaft_torque_N_m": Noise(2500.0),
    "pitch_ratio": Noise(0.003),
}
"""Noise of the instruments, that of the example of the documentation."""

QUESTIONS: Mapping[str, Mapping[str, float]] = {
    "engine and friction": {
        "prime_mover.derating_fraction": 0.02,
        "transmission.coulomb_friction_engine_side_N_m": 8_000.0,
        "transmission.viscous_friction_engine_side_N_m_s_rad": 700.0,
        "sensors.torque_gain": 0.98,
    },
    "shaft and propeller": {
        "transmission.coulomb_friction_propeller_side_N_m": 8_000.0,
        "transmission.viscous_friction_propeller_side_N_m_s_rad": 700.0,
        "propeller.roughness_drag": 0.0005,
        "sensors.torque_gain": 1.02,
        "sensors.torque_bias_N_m": 8_000.0,
    },
    "hull and inflow": {
        "hull.fouling_fraction": 0.06,
        "hull.current_m_s": -0.15,
        "hull.wake_slope_s_m": 0.004,
        "sensors.speed_log_gain": 0.98,
    },
    "pitch": {
        "pitch_actuator.offset": 0.01,
        "sensors.pitch_offset": -0.01,
        "hull.fouling_fraction": 0.03,
        "prime_mover.derating_fraction": 0.02,
    },
}
"""Effects that a steady run confuses, with sizes; each is a model."""


class Trial(NamedTuple):
    """Expected evidence of a trial."""

    least: float
    """Expected difference in 2 log L of the pair that is hardest to decide."""
    decided: int
    """Number of pairs with a difference of 6 or more."""
    pairs: int
    wrong: float
    """Bound of the probability of a wrong choice."""


def models_of(question: str) -> dict[str, Ship]:
    """Return the frigate with each effect of a question, by its key."""
    ship = load_ship("frigate").with_values({"integration.time_step_s": 0.25})
    effects = QUESTIONS[question].items()
    return {key: ship.with_values({key: size}) for key, size in effects}


def trials(question: str, seed: int) -> dict[str, Trial]:
    """Return the trial that each criterion chooses, and a random one, by name."""
    models = models_of(question)
    ship = next(iter(models.values()))
    predictor = Predictor(models, own_effects(models), tuple(NOISE))
    ends = command_ranges(ship, LIMITS)
    count = 60 * MINUTES // HOLD_S
    edges = [HOLD_S * k for k in range(count + 1)]

    def predict(levels: Floats) -> Predictions | None:
        try:
            simulated = [*predictor.simulate(table_of(ship, hold_commands(levels, edges)))]
        except (RecordingError, ShipError, ValueError):  # no equilibrium at the first commands
            return None
        if not all(is_inside(one.ship, samples, LIMITS, math.inf) for one, samples in simulated):
            return None
        return predictor.differentiate(simulated)

    noise = [*NOISE.values()]
    generator = np.random.default_rng(seed)
    middle = np.mean(ends, axis=1)[:, None]
    start = np.array([generator.uniform(*both, count) for both in ends])
    while predict(start) is None:  # outside the envelope of the engine
        start = middle + SMALLER * (start - middle)
    choices = {k: np.linspace(*both, TRIED) for k, both in enumerate(ends)}
    found = {RANDOM: start}
    for way, criterion in CRITERIA.items():

        def merit(levels: Floats, criterion: Criterion = criterion) -> float:
            predictions = predict(levels)
            return -math.inf if predictions is None else criterion(predictions, noise)

        found[way], _ = exchange(start, choices, merit)
    return {way: _judge(predict(levels)) for way, levels in found.items()}


def _judge(predictions: Predictions | None) -> Trial:
    assert predictions is not None
    pairs = evidence_of(predictions, [*NOISE.values()]).pairs()
    wrong = float(np.sum(scipy.stats.norm.sf(0.5 * np.sqrt(pairs))))
    return Trial(float(pairs.min()), int(np.sum(pairs >= DECIDED)), len(pairs), wrong)
