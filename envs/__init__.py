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

for _name in ("Steering", "Frigate"):
    if (_id := f"shaftline/{_name}-v0") not in registry:
        _place = f"shaftline.envs.{_name.lower()}:{_name}"
        register(
            _id,
            f"{_place}Env",
            vector_entry_point=f"{_place}VectorEnv",
            max_episode_steps=DEFAULTS.max_episode_steps,
        )

__all__ = [
    "CLASSIC",
    "DEFAULTS",
    "TERMS",
    "FrigateEnv",
    "FrigateVectorEnv",
    "Goal",
    "Goals",
    "Sb3Frigates",
    "Settings",
    "SteeringEnv",
    "SteeringVectorEnv",
    "Task",
    "get_task",
    "tasks",
]


def __getattr__(name: str) -> Any:
    """Import ``Sb3Frigates`` at its first use, because it needs torch."""
    if name != "Sb3Frigates":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .sb3 import Sb3Frigates

    return Sb3Frigates
