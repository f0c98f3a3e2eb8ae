"""Training of policies, and evaluation of classic controllers and policies.

``train`` and ``read_recipe`` need ``pip install 'shaftline[train]'`` and are imported at their first
use, because importing torch takes seconds.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .evaluation.clairvoyant import Clairvoyant
from .evaluation.episodes import Setting, load_controller, run_episodes
from .evaluation.kpis import KPIS
from .evaluation.statistics import summary
from .evaluation.sweeps import Evaluation, evaluate
from .policy.policy import Policy, PolicyError, load_policy

if TYPE_CHECKING:
    from .learning.recipe import Recipe, RecipeError, read_recipe
    from .learning.training import train

_MODULES = {
    "Recipe": "recipe",
    "RecipeError": "recipe",
    "read_recipe": "recipe",
    "train": "training",
}

__all__ = [
    "KPIS", "Clairvoyant", "Evaluation", "Policy", "PolicyError", "Recipe", "RecipeError", "Setting",
    "evaluate", "load_controller", "load_policy", "read_recipe", "run_episodes", "summary", "train",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import the names that need torch at their first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".learning.{_MODULES[name]}", __name__), name)
