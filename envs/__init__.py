"""The Gymnasium environment around the plant; importing it registers ``shaftline/Frigate-v0``."""

from gymnasium.envs.registration import register, registry

from .frigate import FrigateEnv, FrigateVectorEnv
from .rewards import TERMS, Weights
from .settings import DEFAULTS, Settings
from .tasks import Task, get_task, tasks

if "shaftline/Frigate-v0" not in registry:
    register(
        id="shaftline/Frigate-v0",
        entry_point="shaftline.envs.frigate:FrigateEnv",
        vector_entry_point="shaftline.envs.frigate:FrigateVectorEnv",
    )

__all__ = [
    "DEFAULTS", "TERMS", "FrigateEnv", "FrigateVectorEnv", "Settings", "Task", "Weights",
    "get_task", "tasks",
]  # fmt: skip
