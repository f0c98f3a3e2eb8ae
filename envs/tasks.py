"""Tasks as data: orders, seas, disturbances and goals (``envs/tasks.toml``)."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any

from pydantic import Field, ValidationError, model_validator

from ..baselines.combinator import combinator_curve
from ..baselines.controller import Predictor
from ..baselines.registry import ControllerError, make_controller, make_steering
from ..core.models import FileModel, Number, Range, explain
from ..plant import Ship, load_ship
from .rewards import Goals

LIMITS = {
    "speed_order_m_s": (0.0, 40.0, "m/s"),
    "resistance_rise": (-0.9, 10.0, "-"),
    "heading_order_deg": (-360.0, 360.0, "deg"),
    "track_order_m": (-1e5, 1e5, "m"),
    "cross_current_m_s": (-5.0, 5.0, "m/s"),
    "drift_force_kN": (-1e5, 1e5, "kN"),
}
"""Lowest and highest value, and unit, of the quantities of a task and of ``reset(options=...)``."""

LEAST_RESISTANCE = 0.05  # smallest share of the calm-water resistance after rise and fluctuation


def _within_limits(task: Any) -> Any:
    """Refuse ranges beyond :data:`LIMITS`, and a resistance that falls below its smallest share."""
    for name, (low, high, unit) in LIMITS.items():
        ends = getattr(task, name, None)
        if ends is not None and not low <= ends[0] <= ends[1] <= high:
            raise ValueError(f"{name} = {list(ends)}: must lie within {low:g} to {high:g} {unit}")
    left = 1.0 + task.resistance_rise[0] - task.resistance_swing
    if left < LEAST_RESISTANCE:
        raise ValueError(
            f"resistance_rise from {task.resistance_rise[0]:g} with a resistance_swing of "
            f"{task.resistance_swing:g} leaves {left:.2g} of the calm-water resistance; at least "
            f"{LEAST_RESISTANCE:g} must remain"
        )
    return task


TaskSea = str | dict[str, Number | Range]  # preset, or parameters; a range is drawn


class HeldOut(FileModel):
    """Seas and disturbances of a task for the evaluation, which training never draws."""

    seas: tuple[TaskSea, ...] = Field(min_length=1)
    resistance_rise: Range
    resistance_swing: float = Field(ge=0, lt=1)
    cross_current_m_s: Range | None = None
    drift_force_kN: Range | None = None

    _sound = model_validator(mode="after")(_within_limits)


def _absent(description: str) -> Any:
    """Declare a range that is zero by default."""
    return Field((0.0, 0.0), description=description)


class Task(FileModel):
    """Task: orders, seas, disturbances and goals of an environment.

    Examples:
        >>> task = get_task("transit")
        >>> task.speed_order_m_s, list(task.goals.used)[:2]
        ((7.0, 9.0), ['speed_error_m_s', 'fuel_excess'])
    """

    description: str
    vessel: str = Field("frigate", description="preset of the ship of the task")
    seas: tuple[TaskSea, ...] = Field(
        min_length=1, description="seas, of which an episode draws one"
    )
    speed_order_m_s: Range = Field(description="range of the ordered ship speeds, for this ship")
    order_interval_s: float = Field(gt=0, description="time between new orders")
    resistance_rise: Range = Field(description="range of the mean rise of the resistance")
    resistance_swing: float = Field(
        ge=0, lt=1, description="amplitude of the slow fluctuation of the resistance"
    )
    steered: bool = Field(
        False, description="whether the rudder is an action; needs a ship that turns"
    )
    heading_order_deg: Range = _absent("range of the ordered headings")
    track_order_m: Range = _absent("range of the ordered cross-track positions")
    cross_current_m_s: Range = _absent("range of the current across the first course")
    drift_force_kN: Range = _absent("range of the mean of the slow side force")
    preview: bool = Field(False, description="whether a sensor at the bow measures the waves ahead")
    randomise: dict[str, float] = Field(
        default_factory=dict,
        description="half width of a uniform factor by key of the ship file, drawn each episode",
    )
    goals: Goals
    ship: dict[str, Any] = Field(
        default_factory=dict, description="changed values by key of the ship file"
    )
    held_out: HeldOut | None = None

    @model_validator(mode="before")
    @classmethod
    def _with_tolerances(cls, values: Any) -> Any:
        """Complete goals without a tolerance by the shared tolerance of their term."""
        goals = values.get("goals") if isinstance(values, Mapping) else None
        if not isinstance(goals, Mapping):
            return values
        shared = _contents()["tolerances"]
        completed = {
            term: shared.get(term, {}) | dict(goal) if isinstance(goal, Mapping) else goal
            for term, goal in goals.items()
        }
        return dict(values) | {"goals": completed}

    _sound = model_validator(mode="after")(_within_limits)

    @property
    def helmsman(self) -> str:
        """Name of the helmsman that suits the goals of a task with the rudder as an action."""
        return "track-keeper" if "track_error_m" in self.goals.used else "autopilot"

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the seas of the task that are presets."""
        return tuple(sea for sea in self.seas if isinstance(sea, str))

    def load_ship(self, ship: Any = None) -> Ship:
        """Load a ship with the changes that the task makes to it; by default the ship of the task.

        The ship is a preset, the path of a ship file, or a Ship.

        Raises:
            ShipError: the ship cannot be read, or the task changes a key that the ship does not have.

        Examples:
            >>> get_task("storm").load_ship().propeller.depth_m
            3.0
        """
        return load_ship(self.vessel if ship is None else ship).with_values(dict(self.ship))

    def scale_orders(self, ship: Ship) -> Task:
        """Return the task with ordered speeds that suit a ship.

        A ship that reaches the highest order in calm water gets the orders as they are. A slower ship
        gets the same shares of its highest speed as the ship of the task; highest speeds are those of
        the combinator curves in calm water.

        Examples:
            >>> slow = get_task("transit").scale_orders(load_ship("ferry"))
            >>> [round(speed, 2) for speed in slow.speed_order_m_s]
            [3.95, 5.08]
        """
        if ship == self.load_ship():
            return self
        top = highest_speed(ship)
        if top is None or self.speed_order_m_s[1] <= top:
            return self
        own = highest_speed(self.load_ship())
        if own is None or own <= top:
            return self
        low, high = (speed * top / own for speed in self.speed_order_m_s)
        return self.model_copy(update={"speed_order_m_s": (low, high)})


def highest_speed(ship: Ship) -> float | None:
    """Return the highest speed of the combinator curve in calm water [m/s]; None without a curve."""
    try:
        return float(combinator_curve(ship).ship_speed[-1])
    except ValueError:  # The combinator refuses this ship.
        return None


def controller_for(
    task: Task, text: str, ship: Ship, interval_s: float, steered: bool
) -> Predictor:
    """Return a classic controller; ``HELMSMAN+CONTROLLER`` or ``CONTROLLER`` if the rudder is an action.

    By default the helmsman is that of the task.

    Raises:
        ControllerError: unknown name or option, or a controller that needs signals which the task lacks.
    """
    if steered:
        name = text if "+" in text else f"{task.helmsman}+{text}"
        made: Predictor = make_steering(name, ship, interval_s)
    else:
        made = make_controller(text, ship, interval_s)
    if getattr(getattr(made, "propulsion", made), "preview", False) and not task.preview:
        raise ControllerError(
            f"{text!r}: this controller needs the waves ahead, which only a task with preview = true "
            "provides, such as wave-preview"
        )
    return made


HELD_OUT = "held-out"  # suffix of a task: seas and disturbances that training never draws


class TaskError(ValueError):
    """A task does not exist or cannot be used; the message says why."""


@functools.cache
def _contents() -> dict[str, Any]:
    text = resources.files("shaftline.envs").joinpath("tasks.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@functools.cache
def _all() -> dict[str, Task]:
    named = {name: values for name, values in _contents().items() if name != "tolerances"}
    return {name: Task.model_validate(values) for name, values in named.items()}


def tasks(steered: bool | None = False) -> dict[str, Task]:
    """Return the tasks of the package by name: without the rudder as an action, with it, or all (None).

    Examples:
        >>> sorted(tasks(steered=True))
        ['course-keeping', 'track-keeping']
    """
    return {name: task for name, task in _all().items() if steered in (None, task.steered)}


def get_task(task: str | Task | dict[str, Any]) -> Task:
    """Return a task by name (``transit``, or ``transit:held-out``), or from a dictionary of its fields.

    Raises:
        TaskError: unknown name, or fields that are missing, unknown or out of range.

    Examples:
        >>> get_task("transit").order_interval_s
        100.0
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, dict):
        try:
            return Task.model_validate(task)
        except ValidationError as error:
            raise TaskError(f"task: {explain(error)}") from None
    if not isinstance(task, str):
        raise TaskError(f"task = {task!r}: must be a name, a Task, or a dictionary of its fields")
    name, _, part = task.partition(":")
    if name not in _all() or part not in ("", HELD_OUT):
        raise TaskError(
            f"unknown task {task!r}; known: {', '.join(_all())}, and each with :{HELD_OUT}"
        )
    found = _all()[name]
    if part and found.held_out is not None:
        found = found.model_copy(update=found.held_out.model_dump(exclude_none=True))
    return found
