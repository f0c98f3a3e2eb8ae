"""Proximal policy optimisation with TorchRL: its environment wrapper, collector and loss on the ship.

    pip install torchrl
    python examples/torchrl_ppo.py --steps 200000

It prints the mean reward of the collected intervals, and at the end the mean return of the deterministic
policy in episodes that training did not use.
"""

import argparse

import torch
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, RewardSum, TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import MLP, NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import shaftline.envs  # noqa: F401 (registers the environments)


def make_environment(task: str, seed: int) -> TransformedEnv:
    """Return an environment that sums its rewards."""
    env = TransformedEnv(GymEnv("shaftline/Frigate-v0", task=task), RewardSum())
    env.set_seed(seed)
    return env


def main() -> None:
    """Train a policy and evaluate it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--task", default="speed-keeping")
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--episodes", type=int, default=8, help="episodes of the evaluation")
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)
    env = make_environment(options.task, options.seed)
    actions = env.action_spec.shape[-1]
    body = torch.nn.Sequential(
        MLP(out_features=2 * actions, num_cells=[64, 64], activation_class=torch.nn.Tanh),
        NormalParamExtractor(),
    )
    actor = ProbabilisticActor(
        TensorDictModule(body, ["observation"], ["loc", "scale"]),
        spec=env.action_spec,
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = ValueOperator(MLP(out_features=1, num_cells=[64, 64], activation_class=torch.nn.Tanh))
    with torch.no_grad():
        first = env.reset()
        actor(first), critic(first)  # This sets the widths of the lazy layers.
    advantage = GAE(gamma=0.99, lmbda=0.95, value_network=critic)
    loss_of = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_coeff=0.0)
    optimiser = torch.optim.Adam(loss_of.parameters(), lr=1e-3)
    collector = Collector(env, actor, frames_per_batch=2048, total_frames=options.steps)
    done = 0
    for data in collector:
        for _ in range(10):
            with torch.no_grad():
                advantage(data)
            flat = data.reshape(-1)
            for part in torch.randperm(len(flat)).split(64):
                losses = loss_of(flat[part])
                total = sum(value for name, value in losses.items() if name.startswith("loss_"))
                optimiser.zero_grad()
                total.backward()
                torch.nn.utils.clip_grad_norm_(loss_of.parameters(), 0.5)
                optimiser.step()
        done += len(flat)
        if done // 2048 % 10 == 0:
            print(f"{done:,} steps: mean reward {float(data['next', 'reward'].mean()):.3f}")
    collector.shutdown()
    judge = make_environment(options.task, 900_000)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        returns = [
            float(judge.rollout(10_000, actor)["next", "episode_reward"][-1])
            for _ in range(options.episodes)
        ]
    print(f"mean return of {options.episodes} episodes: {sum(returns) / len(returns):.1f} of 600")


if __name__ == "__main__":
    main()
