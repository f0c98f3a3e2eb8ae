"""Gymnasium environments of ship propulsion; importing this package registers them.

The environments are ``shaftline/Frigate-v0`` (pitch and drive) and ``shaftline/Steering-v0`` (pitch,
drive and rudder). ``Sb3Frigates`` needs ``pip install 'shaftline[train]'`` and is imported at its first
use, because importing torch takes seconds.
"""

from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register, registry

from .frigate import FrigateEnv, FrigateVectorEnv
from .rewards import TERMS, Goal, Goals
from .settings import CLASSIC, DEFAULTS, Settings
from .steering import SteeringEnv, SteeringVectorEnv
from .tasks import Task, get_task, tasks

if TYPE_CHECKING:
    from .sb3 import Sb3Frigates

if "shaftline/Steering-v0" not in registry:
    register(
        id="shaftline/Steering-v0",
        entry_point="shaftline.envs.steering:SteeringEnv",
        vector_entry_point="shaftline.envs.steering:SteeringVectorEnv",
        max_episode_steps=DEFAULTS.max_episode_steps,
    )
if "shaftline/Frigate-v0" not in registry:
    register(
        id="shaftline/Frigate-v0",
        entry_point="shaftline.envs.frigate:FrigateEnv",
        vector_entry_point="shaftline.envs.frigate:FrigateVectorEnv",
        max_episode_steps=DEFAULTS.max_episode_steps,
    )

__all__ = [
    "CLASSIC", "DEFAULTS", "TERMS", "FrigateEnv", "FrigateVectorEnv", "Goal", "Goals", "Sb3Frigates",
    "Settings", "SteeringEnv", "SteeringVectorEnv", "Task", "get_task", "tasks",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import ``Sb3Frigates`` at its first use, because it needs torch."""
    if name != "Sb3Frigates":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .sb3 import Sb3Frigates

    return Sb3Frigates
