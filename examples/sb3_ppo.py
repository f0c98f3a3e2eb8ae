"""Train PPO of stable-baselines3 with its defaults, and compare its return with the combinator's.

Run ``python examples/sb3_ppo.py --seed 1``. 100,000 control intervals take some minutes on one core.
"""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO

import shaftline.envs  # noqa: F401 (registers the environments)
from shaftline.baselines import make_controller
from shaftline.envs import CLASSIC, FrigateEnv

FIRST_SEED = 900_000  # seed of the first episode of the comparison; training draws other seeds


def returns(env: Any, controller: Any, episodes: int) -> list[float]:
    """Return the sum of rewards of each episode; ``controller`` predicts as in stable-baselines3."""
    sums = []
    for seed in range(FIRST_SEED, FIRST_SEED + episodes):
        observation, _ = env.reset(seed=seed)
        state, start, total = None, np.array([True]), 0.0
        while True:
            action, state = controller.predict(observation, state, start, deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total, start = total + float(reward), np.array([False])
            if terminated or truncated:
                break
        sums.append(total)
    return sums


def main(arguments: list[str] | None = None) -> tuple[float, float]:
    """Train, and return the mean returns of PPO and of the combinator."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the training")
    parser.add_argument("--steps", type=int, default=100_000, help="control intervals")
    parser.add_argument("--episodes", type=int, default=30, help="episodes of the comparison")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)  # faster for small networks, and repeatable

    env = gymnasium.make("shaftline/Frigate-v0")
    model = PPO("MlpPolicy", env, seed=options.seed).learn(options.steps)
    learned = float(np.mean(returns(env, model, options.episodes)))

    classic = FrigateEnv(**CLASSIC)  # commands in units, as classic controllers give them
    combinator = make_controller("combinator", classic.batch.ship, classic.batch.interval_s)
    reference = float(np.mean(returns(classic, combinator, options.episodes)))
    print(f"seed {options.seed}: PPO {learned:.1f}, combinator {reference:.1f} of 600")
    return learned, reference


if __name__ == "__main__":
    main()
