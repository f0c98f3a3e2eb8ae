"""Measure plant and environment steps per second, with reference programs in the same run.

Run ``python -m reproductions speed``. Machines differ and are noisy, so the ratios to the references are
more reliable than the rates.
"""

from __future__ import annotations

import argparse
import timeit
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.core.files import write_text
from shaftline.core.lanes import LANES
from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringVectorEnv
from shaftline.observers import get_observer
from shaftline.observers.records import ESTIMATE, OBSERVER, Measurement
from shaftline.observers.registry import update
from shaftline.plant import equilibrium, get_sea, load_ship, realise
from shaftline.plant.dynamics import evaluate
from shaftline.plant.memory import MEMORY
from shaftline.plant.record import PLANT
from shaftline.plant.state import STATE, Inputs, State
from shaftline.plant.stepping import UNDISTURBED, constant_inputs, prepare
from shaftline.plant.together import GROUP, begin_lane, complete_lane, gather, respond
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
    group: Record,
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
        group: GROUP record, working memory.
        drive: command of each prime mover [mm | V | N m], shape (n,).
        pitch_command: commanded P/D [-], shape (n,).
        steps: number of steps.
        dt: time step [s].
    """
    for first in range(0, len(plants), LANES):
        count = gather(group, plants, states, first, len(plants))
        for _ in range(steps):
            for lane in range(count):
                i = first + lane
                acting = constant_inputs(drive[i], pitch_command[i], 0.0, UNDISTURBED)
                begin_lane(group, lane, plants[i], states[i], memories[i], seas[i], acting, dt)
            respond(group, plants, dt)
            for lane in range(count):
                i = first + lane
                shaft_speed = states[i].shaft_speed
                acting = constant_inputs(drive[i], pitch_command[i], 0.0, UNDISTURBED)
                outputs = complete_lane(
                    group, lane, plants[i], states[i], memories[i], seas[i], acting, dt
                )
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
PASSES = 3  # through the whole table, because a shared machine is slow for seconds
MANY = 1024


def best_rate(work: Callable[[], object], count: int, repeats: int = REPEATS) -> float:
    """Return the rate of the fastest of several repeats [1/s]."""
    work()
    return count / min(timeit.repeat(work, number=1, repeat=repeats))


def _plant_rate(
    ships: int,
    sea: str | None = None,
    observer: str | None = None,
    vessel: str = "frigate",
    steps: int = STEPS,
    repeats: int = REPEATS,
) -> float:
    """Return the steps per second of a batch at the working point of the load cases, or in a turn."""
    frigate = load_ship(vessel)
    dt = frigate.time_step_s
    plants, seas = np.full(ships, frigate.record(), PLANT), np.zeros(ships, SEA)
    states, memories = np.zeros(ships, STATE), np.zeros(ships, MEMORY)
    states[:] = tuple(equilibrium(frigate, 22.0, 1.4).state)
    if frigate.turns:
        states["sway_speed"], states["yaw_rate"] = -0.5, 0.01
    waves = get_sea(sea) if sea else None
    for i in range(ships):
        if waves:
            seas[i] = realise(waves, frigate.propeller.depth_m, seed=i)
        prepare(plants[i], states[i], memories[i], seas[i], 22.0, UNDISTURBED, dt)
    observers = np.zeros(ships if observer else 0, OBSERVER)
    if observer:
        observers[:] = get_observer(observer).discretise(frigate, dt)
    estimates = np.zeros(len(observers), ESTIMATE)
    batch = plants, states, memories, seas, observers, estimates, np.zeros(1, GROUP)[0]
    commands = np.full(ships, 22.0), np.full(ships, 1.3)
    return best_rate(lambda: simulate_batch(*batch, *commands, steps, dt), ships * steps, repeats)


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
        span = (0.0, 20.0)
        return scipy.integrate.solve_ivp(rate, span, np.array(start), rtol=1e-6, max_step=0.5)

    return best_rate(work, round(20.0 / frigate.time_step_s), repeats=3)


def _single_rate(
    environment: gymnasium.Env[Any, Any],
    action: Callable[[], Any],
    count: int,
    repeats: int = REPEATS,
) -> float:
    """Return the steps per second of one environment."""
    environment.reset(seed=0)

    def work() -> None:
        for _ in range(count):
            _, _, terminated, truncated, _ = environment.step(action())
            if terminated or truncated:
                environment.reset()

    return best_rate(work, count, repeats)


def _vector_rate(many: FrigateVectorEnv) -> float:
    """Return the control intervals per second of a vector environment."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.2, 0.6, (many.num_envs, many.batch.actions)).astype(np.float32)
    many.reset(seed=0)
    rate = best_rate(lambda: many.step(actions), many.num_envs, 60)
    many.close()
    return rate


def _random_rate(many: FrigateVectorEnv, count: int = 120) -> float:
    """Return the rate under random actions over their whole range, with the ends of episodes."""
    rng = np.random.default_rng(0)
    shape = (count, many.num_envs, many.batch.actions)
    actions = rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    many.reset(seed=0)

    def work() -> None:
        for action in actions:
            many.step(action)

    rate = best_rate(work, count * many.num_envs, 3)
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
    label = f"observations of {MANY} as a torch tensor"
    return [
        (f"{label}, shared memory", best_rate(lambda: torch.from_numpy(seen), MANY, 2000)),
        (f"{label}, copied", best_rate(lambda: torch.tensor(seen), MANY, 2000)),
    ]


def _cart_pole_rates() -> list[tuple[str, float]]:
    """Return the steps per second of Gymnasium's CartPole-v1, vectorised and alone, random actions."""
    many = gymnasium.make_vec("CartPole-v1", MANY, vectorization_mode="vector_entry_point")
    many.reset(seed=0)
    actions = many.action_space.sample()
    one = gymnasium.make("CartPole-v1")
    one.action_space.seed(0)
    return [
        (
            f"Gymnasium CartPole-v1, {MANY} in its vector form",
            best_rate(lambda: many.step(actions), MANY, 60),
        ),
        (
            "Gymnasium CartPole-v1, one environment",
            _single_rate(one, one.action_space.sample, 5000, 5),
        ),
    ]


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
            rows.append((f"plant, {label}, {kind}", _plant_rate(size, sea, observer)))
    for vessel in ("frigate-at-sea", "frigate-turning"):
        label = f"plant of {vessel}, calm water, batch of {BATCH}"
        rows.append((label, _plant_rate(BATCH, vessel=vessel)))
    action = np.random.default_rng(0).uniform(-0.2, 0.6, 2).astype(np.float32)
    on_all = f"{MANY} on all cores"
    turning = SteeringVectorEnv(MANY, task="course-keeping")
    return [
        *rows,
        ("plant, calm water, one step a call", _plant_rate(1, steps=1, repeats=2000)),
        ("solve_ivp on the same equations, calm water", _solve_ivp_rate(None)),
        ("solve_ivp on the same equations, waves", _solve_ivp_rate("thesis")),
        (
            "environment Frigate-v0, one, a step is 10 plant steps",
            _single_rate(FrigateEnv(), lambda: action, 500),
        ),
        (f"environment Frigate-v0, {on_all}", _vector_rate(FrigateVectorEnv(MANY))),
        (
            f"environment Frigate-v0, {on_all}, random actions and ends of episodes",
            _random_rate(FrigateVectorEnv(MANY)),
        ),
        (
            f"environment Frigate-v0, rough-sea, {on_all}",
            _vector_rate(FrigateVectorEnv(MANY, task="rough-sea")),
        ),
        (f"environment Steering-v0, course-keeping, {on_all}", _vector_rate(turning)),
        *_tensor_rates(),
        *_cart_pole_rates(),
    ]


def main() -> None:
    """Measure, print, and write a Markdown table where ``--out FILE`` is given."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="Markdown file for the table")
    out = parser.parse_args().out
    passes = [dict(measure()) for _ in range(PASSES)]
    best = {label: max(rates[label] for rates in passes) for label in passes[0]}
    frame = pd.DataFrame(best.items(), columns=["program", "rate"])
    shares = frame["rate"] / frame["rate"].iloc[-1]
    frame["steps/s"] = frame.pop("rate").map("{:,.0f}".format)
    frame["per CartPole step"] = shares.map("{:.1f}".format)
    text = fill_template(Path(__file__).with_name("speed.md"), table=frame)
    print(text)
    if out is not None:
        head = "# Steps per second\n\nMade by `python -m reproductions speed`.\n\n"
        write_text(out, f"{head}{text}\n")


if __name__ == "__main__":
    main()
