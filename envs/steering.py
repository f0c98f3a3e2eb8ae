"""``shaftline/Steering-v0``: the environment with the rudder as a third action."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from .frigate import FrigateEnv, FrigateVectorEnv

_DEFAULTS: dict[str, Any] = {"task": "course-keeping"}


class SteeringEnv(FrigateEnv):
    """Propulsion plant of a ship that turns, controlled by blade pitch, drive and rudder.

    This class differs from :class:`FrigateEnv` as follows.

    ## Action Space

    ``Box(-1, 1)`` of shape ``(3,)``: the third value is the rudder command between the end stops (35
    degrees), positive to starboard.

    ## Observation Space

    ``Box(-3, 3)`` of shape ``(23,)``. Six signals follow the eight measured signals, and two errors
    precede the last signal. Directions are positive to starboard of the first course.

    | index | signal | unit | range | meaning |
    |---|---|---|---|---|
    | 8 | `heading_order` | rad | -3.142 to 3.142 | ordered heading |
    | 9 | `heading` | rad | -3.142 to 3.142 | measured heading |
    | 10 | `yaw_rate` | rad/s | -0.09312 to 0.09312 | measured rate of turn |
    | 11 | `rudder_angle` | rad | -0.6109 to 0.6109 | measured rudder angle |
    | 12 | `cross_track_order` | m | -115 to 115 | ordered cross-track position |
    | 13 | `cross_track` | m | -115 to 115 | measured cross-track position |
    | 20 | `heading_error` | rad | -0.5236 to 0.5236 | ordered less measured heading |
    | 21 | `track_error` | m | -57.5 to 57.5 | ordered less measured cross-track position |

    ## Starting State

    The task also draws ordered headings or cross-track positions, the current across and the mean of a
    slow side force. ``reset(options=...)`` also accepts ``heading_order_deg``, ``track_order_m`` (one
    order, or a list with one for each order interval), ``cross_current_m_s`` and ``drift_force_kN``.

    ## Arguments

    Those of :class:`FrigateEnv`; the default task is ``course-keeping``, with the ship
    ``frigate-turning``.

    ## Version History

    * v0: initial version.

    Examples:
        >>> env = SteeringEnv(sea="calm")
        >>> observation, info = env.reset(seed=1)
        >>> observation.shape, env.action_space.shape
        ((23,), (3,))
    """

    steered: ClassVar[bool] = True
    defaults: ClassVar[dict[str, Any]] = _DEFAULTS


class SteeringVectorEnv(FrigateVectorEnv):
    """Many :class:`SteeringEnv` environments in one compiled call; see :class:`FrigateVectorEnv`.

    Raises:
        ValueError: a name does not exist or a value is out of range; the message names it.
    """

    steered: ClassVar[bool] = True
    defaults: ClassVar[dict[str, Any]] = _DEFAULTS


class EnvironmentClasses(NamedTuple):
    """Classes of the environments with or without the rudder as an action."""

    id: str  # of the single environment in the registry of Gymnasium
    single: type[FrigateEnv]
    vector: type[FrigateVectorEnv]


def environment_classes(steered: bool) -> EnvironmentClasses:
    """Return the environment classes with or without the rudder as an action.

    Examples:
        >>> environment_classes(steered=False).id
        'shaftline/Frigate-v0'
    """
    if steered:
        return EnvironmentClasses("shaftline/Steering-v0", SteeringEnv, SteeringVectorEnv)
    return EnvironmentClasses("shaftline/Frigate-v0", FrigateEnv, FrigateVectorEnv)
