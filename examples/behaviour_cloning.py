"""Behaviour cloning from a recorded data set: fit a network to the recorded actions and evaluate it.

    shaftline dataset --task rough-sea --episodes 100 --out out/datasets
    python examples/behaviour_cloning.py --datasets out/datasets --dataset shaftline/rough-sea/expert-v0

Needs ``pip install 'shaftline[train,datasets]'``.
"""

import argparse
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

import shaftline.envs  # noqa: F401 (registers the environments)


def clone_actions(dataset: Any, epochs: int, seed: int) -> torch.nn.Module:
    """Return a network fitted to the actions of a data set."""
    torch.manual_seed(seed)
    episodes = list(dataset.iterate_episodes())
    seen = torch.tensor(np.concatenate([one.observations[:-1] for one in episodes]))
    acted = torch.tensor(np.concatenate([one.actions for one in episodes]))
    net = torch.nn.Sequential(
        torch.nn.Linear(seen.shape[1], 64),
        torch.nn.Tanh(),
        torch.nn.Linear(64, 64),
        torch.nn.Tanh(),
        torch.nn.Linear(64, acted.shape[1]),
        torch.nn.Tanh(),
    )
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-3)
    for epoch in range(epochs):
        order, total = torch.randperm(len(seen)), 0.0
        for batch in order.split(512):
            loss = torch.nn.functional.mse_loss(net(seen[batch]), acted[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch)
        print(f"epoch {epoch + 1} of {epochs}: mean squared error {total / len(seen):.4f}")
    return net


def mean_return(env: Any, act: Callable[[Any], Any], episodes: int) -> float:
    """Return the mean return of episodes that are not in the data set."""
    total = 0.0
    for k in range(episodes):
        observation, _ = env.reset(seed=900_000 + k)
        done = False
        while not done:
            observation, reward, terminated, truncated, _ = env.step(act(observation))
            total += reward
            done = terminated or truncated
    return total / episodes


def main() -> None:
    """Clone the recorded policy, and compare the returns."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--datasets", default="out/datasets", help="folder of the data sets")
    parser.add_argument("--dataset", default="shaftline/rough-sea/expert-v0")
    parser.add_argument("--epochs", type=int, default=20)
    parser.add_argument("--episodes", type=int, default=12, help="episodes of the comparison")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    os.environ["MINARI_DATASETS_PATH"] = os.path.abspath(options.datasets)
    import minari  # It reads the environment variable when it is imported.

    dataset = minari.load_dataset(options.dataset)
    recorded = float(np.mean([one.rewards.sum() for one in dataset.iterate_episodes()]))
    net = clone_actions(dataset, options.epochs, options.seed)
    env = dataset.recover_environment()

    def act(observation: Any) -> Any:
        with torch.no_grad():
            return net(torch.as_tensor(observation)[None])[0].numpy()

    env.action_space.seed(options.seed)
    print(f"return of the data set's episodes: {recorded:.1f}")
    print(f"return of the clone: {mean_return(env, act, options.episodes):.1f}")
    random = mean_return(env, lambda _: env.action_space.sample(), options.episodes)
    print(f"return of random actions: {random:.1f}")


if __name__ == "__main__":
    main()
