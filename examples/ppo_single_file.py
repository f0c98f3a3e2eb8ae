"""Proximal policy optimisation on the ship in one file, without a library of agents.

The policy commands pitch and shaft speed of a frigate in the task `speed-keeping`, without a classic
base controller as in `shaftline train`. All parts of the algorithm are in this file, to be changed.
Needs torch; takes a minute on one core:

    python examples/ppo_single_file.py --steps 600000

It prints the mean return of the last episodes, and at the end the return on unused seeds beside that of
the combinator, which is the baseline.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import gymnasium
import numpy as np
import torch
from torch import nn

import shaftline.envs  # noqa: F401 (registers the environments)
from shaftline.agents import Setting, run_episodes
from shaftline.baselines import make_controller
from shaftline.envs import get_task


@dataclass
class Settings:
    """Hyperparameters, with names and values as in Schulman et al. 2017 and later practice."""

    task: str = "speed-keeping"
    steps: int = 600_000
    seed: int = 1
    environments: int = 32
    rollout: int = 64  # steps of each environment between two updates
    epochs: int = 8
    minibatches: int = 4
    rate: float = 5e-4
    gamma: float = 0.98
    gae: float = 0.95
    clip: float = 0.2
    value_weight: float = 0.5
    entropy_weight: float = 0.0
    largest_gradient: float = 0.5


class Agent(nn.Module):
    """Gaussian policy and value function, each with two hidden layers."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()

        def network(out: int, gain: float) -> nn.Sequential:
            hidden = [nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh()]
            last = nn.Linear(64, out)
            nn.init.orthogonal_(last.weight, gain)
            return nn.Sequential(*hidden, last)

        self.mean, self.value = network(outputs, 0.01), network(1, 1.0)
        self.log_deviation = nn.Parameter(torch.full((outputs,), -1.0))

    def policy(self, seen: torch.Tensor) -> torch.distributions.Independent:
        """Return the distribution of the actions."""
        normal = torch.distributions.Normal(self.mean(seen), self.log_deviation.exp())
        return torch.distributions.Independent(normal, 1)


def train(s: Settings) -> tuple[Agent, list[float]]:
    """Train an agent and return it with the returns of all episodes."""
    torch.manual_seed(s.seed)
    torch.set_num_threads(1)
    # NextStep: the step after an end starts the next episode; it is not part of the experience.
    env = gymnasium.make_vec(
        "shaftline/Frigate-v0",
        num_envs=s.environments,
        vectorization_mode="vector_entry_point",
        task=s.task,
        autoreset_mode="NextStep",
    )
    width = gymnasium.spaces.flatdim(env.single_observation_space)
    outputs = gymnasium.spaces.flatdim(env.single_action_space)
    agent = Agent(width, outputs)
    optimiser = torch.optim.Adam(agent.parameters(), lr=s.rate, eps=1e-5)
    shape = (s.rollout, s.environments)
    seen, actions = torch.zeros(*shape, width), torch.zeros(*shape, outputs)
    logs, rewards, values = (torch.zeros(shape) for _ in range(3))
    ended, begins = torch.zeros(shape), torch.zeros(shape)
    now, _ = env.reset(seed=s.seed)
    before = np.zeros(s.environments, dtype=bool)  # whether the last step ended an episode
    running, returns, scale = np.zeros(s.environments), [], 1.0
    updates, start = s.steps // (s.rollout * s.environments), time.perf_counter()
    for update in range(updates):
        optimiser.param_groups[0]["lr"] = s.rate * (1.0 - update / updates)
        for t in range(s.rollout):
            seen[t] = torch.as_tensor(now)
            with torch.no_grad():
                chosen = agent.policy(seen[t])
                actions[t] = chosen.sample()
                logs[t], values[t] = chosen.log_prob(actions[t]), agent.value(seen[t]).squeeze(-1)
            now, reward, terminated, truncated, _ = env.step(actions[t].clamp(-1.0, 1.0).numpy())
            rewards[t] = torch.as_tensor(reward, dtype=torch.float32)
            begins[t], done = torch.as_tensor(before, dtype=torch.float32), terminated | truncated
            ended[t] = torch.as_tensor(terminated, dtype=torch.float32)
            running += reward
            returns += running[done].tolist()
            running[done] = 0.0
            before = done
        if update == 0:
            scale = max(float(rewards.std()), 1e-6)  # so that the values are of the order of one
        with torch.no_grad():
            follows = agent.value(torch.as_tensor(now)).squeeze(-1)
            over = torch.as_tensor(before, dtype=torch.float32)
            advantages, last = torch.zeros(shape), torch.zeros(s.environments)
            for t in reversed(range(s.rollout)):
                later = follows if t == s.rollout - 1 else values[t + 1]
                cut = over if t == s.rollout - 1 else begins[t + 1]
                # After a truncation the value of the next state counts, but no later advantage.
                delta = rewards[t] / scale + s.gamma * later * (1.0 - ended[t]) - values[t]
                last = delta + s.gamma * s.gae * (1.0 - cut) * last
                advantages[t] = last
        aims = advantages + values
        experience = (begins == 0.0).flatten().nonzero().squeeze(-1)
        flat = [x.flatten(0, 1) for x in (seen, actions, logs, advantages, aims)]
        for _ in range(s.epochs):
            for part in experience[torch.randperm(len(experience))].chunk(s.minibatches):
                rows, took, old, gain, aim = (x[part] for x in flat)
                chosen = agent.policy(rows)
                ratio = (chosen.log_prob(took) - old).exp()
                gain = (gain - gain.mean()) / (gain.std() + 1e-8)
                clipped = ratio.clamp(1.0 - s.clip, 1.0 + s.clip)
                loss = -torch.min(ratio * gain, clipped * gain).mean()
                loss = loss + s.value_weight * (agent.value(rows).squeeze(-1) - aim).pow(2).mean()
                loss = loss - s.entropy_weight * chosen.entropy().mean()
                optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), s.largest_gradient)
                optimiser.step()
        if update % max(updates // 20, 1) == 0 or update == updates - 1:
            done_steps = (update + 1) * s.rollout * s.environments
            recent = f"{np.mean(returns[-50:]):.1f}" if returns else "no episode yet"
            print(
                f"{done_steps} steps, {time.perf_counter() - start:.0f} s, return {recent}",
                flush=True,
            )
    env.close()
    return agent, returns


def evaluate(agent: Agent, s: Settings, episodes: int = 20) -> float:
    """Return the mean return of the mean actions on seeds that training did not use."""
    env = gymnasium.make_vec(
        "shaftline/Frigate-v0",
        num_envs=episodes,
        vectorization_mode="vector_entry_point",
        task=s.task,
        autoreset_mode="NextStep",
    )
    now, _ = env.reset(seed=900_000)
    total, open_ = np.zeros(episodes), np.ones(episodes, dtype=bool)
    while open_.any():
        with torch.no_grad():
            action = agent.mean(torch.as_tensor(now)).clamp(-1.0, 1.0).numpy()
        now, reward, terminated, truncated, _ = env.step(action)
        total += reward * open_
        open_ &= ~(terminated | truncated)
    return float(total.mean())


def main(arguments: list[str] | None = None) -> None:
    """Train an agent and compare it with the combinator."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--steps", type=int, default=Settings.steps, help="total number of control intervals"
    )
    parser.add_argument("--seed", type=int, default=Settings.seed)
    parser.add_argument("--task", default=Settings.task)
    options = parser.parse_args(arguments)
    s = Settings(task=options.task, steps=options.steps, seed=options.seed)
    agent, _ = train(s)
    combinator = make_controller("combinator", get_task(s.task).load_ship(), 0.5)
    kpis, _ = run_episodes(
        Setting("combinator", s.task, "task", "random-walk-kalman", 20, first_seed=900_000),
        combinator,
    )
    print(
        f"mean return of 20 episodes of other seeds: {evaluate(agent, s):.1f}, "
        f"combinator {kpis['reward'].mean():.1f}"
    )


if __name__ == "__main__":
    main()
