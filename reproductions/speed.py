"""Measure plant and environment steps per second, with reference programs in the same run.

Run ``python -m reproductions speed``. Machines differ and are noisy, so the ratios to the references are
more reliable than the rates.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.core.files import write_text
from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringVectorEnv
from shaftline.observers import get_observer
from shaftline.observers.records import ESTIMATE, OBSERVER, Measurement
from shaftline.observers.registry import update
from shaftline.plant import equilibrium, get_sea, load_ship, realise
from shaftline.plant.dynamics import evaluate
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE, Inputs, State
from shaftline.plant.stepping import UNDISTURBED, prepare, step
from shaftline.plant.waves import SEA, wave_field

from .pages import fill_template


@compiled
def simulate_batch(
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    observers: Any,
    estimates: Any,
    drive: NDArray[np.float64],
    pitch_command: NDArray[np.float64],
    steps: int,
    dt: float,
) -> None:
    """Simulate a batch of ships with held commands; observers are updated at every step.

    Args:
        plants: PLANT array of shape (n,).
        states: STATE array of shape (n,), changed in place like the next four.
        memories: MEMORY array of shape (n,), initialised by ``prepare``.
        seas: SEA array of shape (n,).
        observers: OBSERVER array of shape (n,), or (0,) for none.
        estimates: ESTIMATE array of the same shape.
        drive: command of each prime mover [mm | V | N m], shape (n,).
        pitch_command: commanded P/D [-], shape (n,).
        steps: number of steps.
        dt: time step [s].
    """
    for i in range(len(plants)):
        for _ in range(steps):
            state = states[i]
            shaft_speed = state.shaft_speed
            outputs = step(
                plants[i], state, memories[i], seas[i], drive[i], pitch_command[i], 0.0, UNDISTURBED,
                UNDISTURBED, UNDISTURBED, dt,
            )  # fmt: skip
            if len(observers) > 0:
                reading = Measurement(
                    shaft_speed,
                    memories[i].shaft_torque,
                    memories[i].pitch_ratio,
                    outputs.shaft_acceleration,
                    outputs.advance_velocity,
                )
                update(observers[i], estimates[i], reading)


BATCH, STEPS, REPEATS = 256, 100, 15
MANY = 1024


def best_rate(work: Callable[[], object], count: int, repeats: int = REPEATS) -> float:
    """Return the rate of the fastest of several repeats [1/s]."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return count / min(times)


class Benchmark:
    """A batch of frigates at the working point of the load cases, in a turn if they manoeuvre."""

    def __init__(
        self, ships: int, sea: str | None, observer: str | None = None, vessel: str = "frigate"
    ) -> None:
        frigate = load_ship(vessel)
        self.dt = frigate.time_step_s
        self.plants = np.full(ships, frigate.record(), PLANT)
        self.states = np.zeros(ships, STATE)
        self.states[:] = tuple(equilibrium(frigate, 22.0, 1.4).state)
        if frigate.turns:
            self.states["sway_speed"], self.states["yaw_rate"] = -0.5, 0.01
        self.memories = np.zeros(ships, MEMORY)
        self.seas = np.zeros(ships, SEA)
        waves = get_sea(sea) if sea else None
        for i in range(ships):
            if waves:
                self.seas[i] = realise(waves, frigate.propeller.depth_m, seed=i)
            prepare(self.plants[i], self.states[i], self.memories[i], self.seas[i],
                    22.0, UNDISTURBED, self.dt)  # fmt: skip
        self.drive, self.pitch = np.full(ships, 22.0), np.full(ships, 1.3)
        self.observers = np.zeros(ships if observer else 0, OBSERVER)
        self.estimates = np.zeros(len(self.observers), ESTIMATE)
        if observer:
            self.observers[:] = get_observer(observer).discretise(frigate, self.dt)

    def run(self, steps: int = STEPS) -> None:
        """Simulate some steps of all ships."""
        simulate_batch(self.plants, self.states, self.memories, self.seas, self.observers,
             self.estimates, self.drive, self.pitch, steps, self.dt)  # fmt: skip


def _solve_ivp_rate(sea: str | None) -> float:
    """Return the steps of 0.05 s per second of solve_ivp's RK45 on the same equations, rtol 1e-6."""
    frigate = load_ship("frigate")
    plant, start = frigate.record(), equilibrium(frigate, 22.0, 1.4).state
    waves = get_sea(sea) if sea else None
    record = realise(waves, frigate.propeller.depth_m, seed=0) if waves else None

    def rate(t: float, x: Any) -> Any:
        state = State(*x)
        inflow = wave_field(record, t, state.position)[0] if record is not None else 0.0
        return np.array(evaluate(plant, state, Inputs(22.0, 1.3, inflow), 1.4)[0])

    def work() -> object:
        return scipy.integrate.solve_ivp(
            rate, (0.0, 20.0), np.array(start), rtol=1e-6, max_step=0.05 * 10
        )

    return best_rate(work, round(20.0 / frigate.time_step_s), repeats=3)


def _cart_pole_rate() -> float:
    """Return the steps per second of Gymnasium's CartPole-v1 with random actions."""
    environment = gymnasium.make("CartPole-v1")
    environment.reset(seed=0)
    environment.action_space.seed(0)

    def work() -> None:
        for _ in range(5000):
            _, _, terminated, truncated, _ = environment.step(environment.action_space.sample())
            if terminated or truncated:
                environment.reset()

    return best_rate(work, 5000, repeats=5)


def _environment_rate(n: int) -> float:
    """Return control intervals per second with waves, sensor noise and the default observer."""
    if n == 1:
        actions = np.random.default_rng(0).uniform(-0.2, 0.6, (1, 2)).astype(np.float32)
        single = FrigateEnv()
        single.reset(seed=0)

        def one() -> None:
            for _ in range(500):
                _, _, terminated, truncated, _ = single.step(actions[0])
                if terminated or truncated:
                    single.reset()

        return best_rate(one, 500)
    return _vector_rate(FrigateVectorEnv(n))


def _vector_rate(many: FrigateVectorEnv) -> float:
    """Return the control intervals per second of a vector environment."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.2, 0.6, (many.num_envs, many.batch.actions)).astype(np.float32)
    many.reset(seed=0)
    rate = best_rate(lambda: many.step(actions), many.num_envs, 60)
    many.close()
    return rate


def _tensor_rates() -> list[tuple[str, float]]:
    """Return the rates at which observations become torch tensors."""
    try:
        import torch
    except ModuleNotFoundError:
        return []
    many = FrigateVectorEnv(MANY)
    seen, _ = many.reset(seed=0)
    many.close()
    return [
        (f"observations of {MANY} as a torch tensor, shared memory",
         best_rate(lambda: torch.from_numpy(seen), MANY, 2000)),
        (f"observations of {MANY} as a torch tensor, copied",
         best_rate(lambda: torch.tensor(seen), MANY, 2000)),
    ]  # fmt: skip


def _cart_pole_vector_rate() -> float:
    """Return the steps per second of Gymnasium's vectorised CartPole-v1."""
    many = gymnasium.make_vec("CartPole-v1", MANY, vectorization_mode="vector_entry_point")
    many.reset(seed=0)
    actions = many.action_space.sample()
    return best_rate(lambda: many.step(actions), MANY, 60)


def measure() -> list[tuple[str, float]]:
    """Return all rates [1/s] with their labels, the plant first, the references last."""
    rows = []
    for label, sea, observer in (
        ("calm water", None, None),
        ("waves, 64 components", "thesis", None),
        ("waves and an I&I observer", "thesis", "immersion-invariance"),
        ("waves and an extended Kalman filter", "thesis", "random-walk-kalman"),
    ):
        for size, kind in ((BATCH, f"batch of {BATCH}"), (1, "one ship")):
            benchmark = Benchmark(size, sea, observer)
            rows.append((f"plant, {label}, {kind}", best_rate(benchmark.run, size * STEPS)))
    for vessel in ("frigate-at-sea", "frigate-turning"):
        benchmark = Benchmark(BATCH, None, vessel=vessel)
        label = f"plant of {vessel}, calm water, batch of {BATCH}"
        rows.append((label, best_rate(benchmark.run, BATCH * STEPS)))
    alone = Benchmark(1, None)
    rows.append(("plant, calm water, one step a call", best_rate(lambda: alone.run(1), 1, 2000)))
    rows.append(("solve_ivp on the same equations, calm water", _solve_ivp_rate(None)))
    rows.append(("solve_ivp on the same equations, waves", _solve_ivp_rate("thesis")))
    rows.append(("environment Frigate-v0, one, a step is 10 plant steps", _environment_rate(1)))
    rows.append((f"environment Frigate-v0, {MANY} on all cores", _environment_rate(MANY)))
    for name, many in (
        ("Frigate-v0, rough-sea", FrigateVectorEnv(MANY, task="rough-sea")),
        ("Steering-v0, course-keeping", SteeringVectorEnv(MANY, task="course-keeping")),
    ):
        rows.append((f"environment {name}, {MANY} on all cores", _vector_rate(many)))
    rows += _tensor_rates()
    rows.append((f"Gymnasium CartPole-v1, {MANY} in its vector form", _cart_pole_vector_rate()))
    rows.append(("Gymnasium CartPole-v1, one environment", _cart_pole_rate()))
    return rows


def main() -> None:
    """Measure, print, and write a Markdown table where ``--out FILE`` is given."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="Markdown file for the table")
    out = parser.parse_args().out
    rows = measure()
    cart_pole = rows[-1][1]
    frame = pd.DataFrame(
        [(label, f"{rate:,.0f}", f"{rate / cart_pole:.1f}") for label, rate in rows],
        columns=["program", "steps/s", "per CartPole step"],
    )
    text = fill_template(Path(__file__).with_name("speed.md"), table=frame)
    print(text)
    if out is not None:
        write_text(
            out, f"# Steps per second\n\nMade by `python -m reproductions speed`.\n\n{text}\n"
        )


if __name__ == "__main__":
    main()
