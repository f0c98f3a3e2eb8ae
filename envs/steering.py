"""``shaftline/Steering-v0``: the same ship with her rudder among the actions."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from .frigate import FrigateEnv, FrigateVectorEnv

_DEFAULTS: dict[str, Any] = {"task": "course-keeping"}


class SteeringEnv(FrigateEnv):
    """A ship that turns, with her propulsion in the loop, commanded by pitch, fuel rack and rudder.

    Everything is as in :class:`FrigateEnv`, and besides:

    ## Observation
    ``Box(23,)``: after the eight measured signals come ordered heading [rad], heading [rad], rate of
    turn [rad/s], rudder angle [rad], ordered cross track [m] and cross track [m], all to starboard of
    the first course; before the last signal come the errors of heading (by the shorter way) [rad] and
    cross track [m].

    ## Action
    ``Box(3,)``: the two, and the rudder command over the end stops, positive to starboard.

    ## Options of a reset
    Also ``heading_order_deg``, ``track_order_m`` (one order, or one for each interval),
    ``cross_current_m_s`` and ``drift_force_kN``.

    Args:
        render_mode: None or ``rgb_array``.
        settings: keywords, as of :class:`shaftline.envs.Settings`; the task is ``course-keeping`` by
            default.

    Raises:
        ValueError: something that does not exist or is out of range, or a ship that cannot be steered;
            the message names it.
    """

    steered: ClassVar[bool] = True
    defaults: ClassVar[dict[str, Any]] = _DEFAULTS


class SteeringVectorEnv(FrigateVectorEnv):
    """Many of :class:`SteeringEnv` stepped in one compiled call; see :class:`FrigateVectorEnv`.

    Args:
        num_envs: how many.
        threads: that step them; the machine's cores by default.
        settings: keywords, as of :class:`shaftline.envs.Settings`; the task is ``course-keeping`` by
            default.

    Raises:
        ValueError: something that does not exist or is out of range; the message names it.
    """

    steered: ClassVar[bool] = True
    defaults: ClassVar[dict[str, Any]] = _DEFAULTS


class Kinds(NamedTuple):
    """Environments of a task, by whether the rudder is an action."""

    id: str
    """Of the single environment in Gymnasium's registry."""
    single: type[FrigateEnv]
    vector: type[FrigateVectorEnv]


def kinds(steered: bool) -> Kinds:
    """Return the environments with the rudder among the actions, or without."""
    if steered:
        return Kinds("shaftline/Steering-v0", SteeringEnv, SteeringVectorEnv)
    return Kinds("shaftline/Frigate-v0", FrigateEnv, FrigateVectorEnv)
