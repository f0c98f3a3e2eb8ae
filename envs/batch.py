"""A batch of environments as arrays, and how each begins: what single and vector environment share."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.governor import tune
from ..observers import get_observer
from ..observers.base import ESTIMATE, OBSERVER
from ..plant import Sea, Ship, equilibrium, get_sea, load_ship, realise
from ..plant.memory import MEMORY
from ..plant.record import PLANT
from ..plant.state import STATE, State
from ..plant.stepping import Disturbance, prepare
from ..plant.waves import SEA
from .kernel import (
    EPISODE,
    MAX_ORDERS,
    N_OBSERVED,
    N_TERMS,
    N_TRUTH,
    NOISE,
    control_interval,
    first_observation,
)
from .tasks import TERMS, Task, get_task

ACTION_MODES = ("rack", "shaft-speed")

SeaChoice = str | Sea | Mapping[str, Any] | Sequence[Any] | None

SeaRange = tuple[Sea, Sea]
"""Lowest and highest value of every parameter; an episode draws each uniformly between them."""


def _seas(choice: SeaChoice, task: Task) -> list[SeaRange | None]:
    """The seas that an episode may draw."""
    if choice is None:
        choice = task.seas
    if isinstance(choice, str):
        choice = get_sea(choice)
        if choice is None:
            return [None]  # calm water
    if isinstance(choice, Sea):
        return [(choice, choice)]
    if isinstance(choice, Mapping):
        ends = {name: np.atleast_1d(value).tolist() for name, value in choice.items()}
        for name, pair in ends.items():
            if len(pair) > 2 or pair[0] > pair[-1]:
                raise ValueError(
                    f"sea[{name!r}] = {choice[name]!r}: must be a number, or a lowest and a highest"
                )
        low, high = ({name: pair[end] for name, pair in ends.items()} for end in (0, -1))
        return [(Sea(**low), Sea(**high))]
    return [sea for item in choice for sea in _seas(item, task)]


def _drawn(sea: SeaRange, rng: np.random.Generator) -> Sea:
    """One sea of a range."""
    low, high = (end.model_dump() for end in sea)
    return Sea(**{name: float(rng.uniform(low[name], high[name])) for name in low})


def _noise(ship: Ship, choice: float | Mapping[str, float]) -> Any:
    """NOISE record: a share of the usual instruments' noise, or rms values by name."""
    record = np.zeros(1, NOISE)[0]
    if isinstance(choice, Mapping):
        for name, rms in choice.items():
            if name not in (NOISE.names or ()) or not (math.isfinite(rms) and rms >= 0.0):
                raise ValueError(
                    f"sensor_noise[{name!r}] = {rms!r}: known instruments are "
                    f"{', '.join(NOISE.names or ())}, with an rms of 0 or more"
                )
            record[name] = rms
        return record
    if not (math.isfinite(choice) and choice >= 0.0):
        raise ValueError(f"sensor_noise = {choice!r}: must be 0 or more (1: the usual instruments)")
    plant = ship.record()
    top_speed = float(plant["engine_speed_max"] / plant["gear_ratio"])
    top_torque = float(plant["torque_limit"] * plant["gear_ratio"])
    # encoder 0.1 %, strain gauge 0.5 % of full scale, pitch feedback, accelerometer, speed log
    record["shaft_speed"] = 1e-3 * top_speed
    record["shaft_torque"] = 5e-3 * top_torque if math.isfinite(top_torque) else 0.0
    record["pitch_ratio"] = 4e-3
    record["shaft_acceleration"] = 2e-2
    record["ship_speed"] = 5e-2
    for name in NOISE.names or ():
        record[name] *= choice
    return record


@functools.lru_cache(maxsize=16)
def _steady_table(ship: Ship) -> NDArray[np.float64]:
    """Steady states in calm water, rows of (ship speed, shaft speed, rack, pitch), speed rising."""
    plant = ship.record()
    pitch = float(
        plant["pitch_ratio_min"] + 0.75 * (plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
    )
    rows = []
    for rack in np.linspace(0.05, 0.95, 19) * float(plant["drive_max"]):
        try:
            found = equilibrium(ship, float(rack), pitch)
        except ValueError:
            continue  # too little fuel to turn the shaft
        engine_speed = found.state.shaft_speed * plant["gear_ratio"]
        if plant["engine_speed_min"] <= engine_speed <= plant["engine_speed_max"]:
            rows.append((found.state.ship_speed, found.state.shaft_speed, rack, pitch))
    if len(rows) < 2:
        raise ValueError(f"{ship.name}: no steady states inside the engine's speed range")
    return np.array(sorted(rows))


@functools.lru_cache(maxsize=16)
def _governor_gains(ship: Ship) -> NDArray[np.float64]:
    """Gains of the built-in governor, which acts at every plant step; shape (3, m)."""
    return np.array(tune(ship, ship.time_step_s))


class Fleet:
    """Environments 0 to n - 1 with one task.

    Args:
        n: how many.
        ship: preset, path or Ship; a diesel ship that moves.
        task: name, Task or dictionary.
        observer: name of the observer.
        tuning: its tuning.
        sea: preset, Sea, dictionary of its parameters (a pair of them is a range from which each
            episode draws), or a list of those to draw from; the task's by default.
        sensor_noise: 1 for the usual instruments, 0 for perfect ones, or rms by instrument.
        control_interval_s: time between actions [s], a multiple of the plant's time step.
        randomise: half width of a uniform factor by field of the plant's record, such as
            ``{"resistance_coefficient": 0.1}``.
        action_mode: ``rack``: the second action is the fuel rack; ``shaft-speed``: it is the set-point
            of a governor that runs at the plant's time step.

    Raises:
        ValueError: something that does not exist or is out of range.
    """

    def __init__(
        self,
        n: int,
        *,
        ship: Any,
        task: Any,
        observer: str,
        tuning: str | None,
        sea: SeaChoice,
        sensor_noise: float | Mapping[str, float],
        control_interval_s: float,
        randomise: Mapping[str, float] | None,
        action_mode: str,
    ) -> None:
        self.task = get_task(task)
        self.ship = load_ship(ship).with_values(dict(self.task.ship))
        if not (self.ship.has_diesel and self.ship.moves):
            raise ValueError(f"{self.ship.name}: the environment needs a diesel ship that moves")
        self.dt = self.ship.time_step_s
        self.steps = round(control_interval_s / self.dt)
        if self.steps < 1 or abs(self.steps * self.dt - control_interval_s) > 1e-9:
            raise ValueError(
                f"control_interval_s = {control_interval_s!r} s: must be a multiple of the time step "
                f"of {self.dt} s"
            )
        self.seas_to_draw = _seas(sea, self.task)
        self.noise = _noise(self.ship, sensor_noise)
        self.randomise = dict(randomise or {})
        for name, width in self.randomise.items():
            if name not in (PLANT.names or ()) or not 0.0 <= width < 1.0:
                raise ValueError(
                    f"randomise[{name!r}] = {width!r}: must be a field of the plant's record with a "
                    "half width from 0 to below 1"
                )
        if action_mode not in ACTION_MODES:
            raise ValueError(
                f"unknown action_mode {action_mode!r}; known: {', '.join(ACTION_MODES)}"
            )
        self.gains = np.zeros((3, 0))
        if action_mode == "shaft-speed":
            self.gains = _governor_gains(self.ship)
        self.table = _steady_table(self.ship)
        self._plant = self.ship.record()
        self.n = n
        self.plants = np.full(n, self._plant, PLANT)
        self.states = np.zeros(n, STATE)
        self.memories = np.zeros(n, MEMORY)
        self.seas = np.zeros(n, SEA)
        self.observers = np.full(
            n, get_observer(observer, tuning).discretise(self.ship, self.dt), OBSERVER
        )
        self.estimates = np.zeros(n, ESTIMATE)
        self.episodes = np.zeros(n, EPISODE)
        self.observation = np.zeros((n, N_OBSERVED), np.float32)
        self.terms = np.zeros((n, N_TERMS))
        self.reward = np.zeros(n)
        self.truth = np.zeros((n, N_TRUTH))
        self.ended = np.zeros(n, np.int64)
        self.weights = np.array([getattr(self.task.weights, term) for term in TERMS])

    def reset(self, i: int, rng: np.random.Generator) -> None:
        """Begin a new episode of environment ``i``; draws everything from ``rng``."""
        task, episode = self.task, self.episodes[i]
        self.plants[i] = self._plant
        for name, width in self.randomise.items():
            self.plants[i][name] *= rng.uniform(1.0 - width, 1.0 + width)
        sea = self.seas_to_draw[int(rng.integers(len(self.seas_to_draw)))]
        wave_seed = int(rng.integers(2**31))
        self.seas[i] = (
            realise(_drawn(sea, rng), self.ship.propeller.depth_m, wave_seed)
            if sea
            else np.zeros(1, SEA)[0]
        )
        self.episodes[i] = np.zeros(1, EPISODE)[0]
        episode["random"] = rng.integers(2**63, dtype=np.uint64)
        episode["orders"] = rng.uniform(*task.speed_order_m_s, MAX_ORDERS)
        episode["order_interval"] = task.order_interval_s
        episode["resistance_mean"] = 1.0 + rng.uniform(*task.resistance_rise)
        episode["resistance_swing"] = task.resistance_swing
        episode["resistance_frequency"] = 2.0 * math.pi / rng.uniform(60.0, 180.0)
        episode["resistance_phase"] = rng.uniform(0.0, 2.0 * math.pi)
        speed = float(episode["orders"][0])
        known = self.table[:, 0]
        shaft, rack, pitch = (float(np.interp(speed, known, self.table[:, c])) for c in (1, 2, 3))
        speed = float(np.clip(speed, known[0], known[-1]))
        episode["pitch_command"], episode["drive"] = pitch, rack
        episode["integral"] = rack  # the governor takes over without a bump
        self.states[i] = tuple(State(pitch, shaft, speed))
        self.estimates[i] = np.zeros(1, ESTIMATE)[0]
        begin = Disturbance(0.0, 0.0, float(episode["resistance_mean"]))
        prepare(
            self.plants[i], self.states[i], self.memories[i], self.seas[i], rack, begin, self.dt
        )

    def observe(self, which: NDArray[np.int64]) -> None:
        """Fill the observations of environments that were just reset."""
        first_observation(
            self.plants, self.states, self.memories, self.seas, self.observers, self.estimates,
            self.episodes, self.noise, self.dt, which, self.observation,
        )  # fmt: skip

    def step(self, action: NDArray[np.float32], pool: ThreadPoolExecutor | None = None) -> None:
        """Carry every environment over one control interval; results stand in the arrays."""
        if pool is None:
            self._step(action, 0, self.n)
            return
        # more shares than threads, so that no thread waits long for another on a busy machine
        shares = min(2 * pool._max_workers, self.n)
        bounds = np.linspace(0, self.n, shares + 1).astype(int)
        list(pool.map(self._step, [action] * shares, bounds[:-1], bounds[1:]))

    def _step(self, action: NDArray[np.float32], first: int, last: int) -> None:
        control_interval(
            self.plants, self.states, self.memories, self.seas, self.observers, self.estimates,
            self.episodes, self.noise, self.weights, self.gains, action, self.steps, self.dt,
            first, last, self.observation, self.terms, self.reward, self.truth, self.ended,
        )  # fmt: skip
