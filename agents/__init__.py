"""Training of policies, and evaluation of controllers, classic and learned."""

from .policy.policy import load

__all__ = ["load"]
