"""Tasks as data: orders, seas, disturbances and the reward's weights (``envs/tasks.toml``)."""

from __future__ import annotations

import functools
import tomllib
from importlib import resources
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Weights(_Model):
    """Weight of each reward term, per its physical unit and control interval."""

    speed_error_m_s: float = Field(ge=0, description="|ship speed - order|")
    fuel_kg_s: float = Field(ge=0, description="fuel flow of all engines")
    overload: float = Field(
        ge=0, description="engine torque asked for beyond the envelope, as share"
    )
    torque_rate_kN_m_s: float = Field(ge=0, description="mean |d M_m / dt| at the gauge")
    rack_travel_mm: float = Field(ge=0, description="|change of the rack command|")
    cavitation: float = Field(ge=0, description="thrust loading beyond Burrill's limit, as share")
    overspeed: float = Field(ge=0, description="engine speed beyond its highest, as share")


TERMS = tuple(Weights.model_fields)
"""Reward terms, in the order of the kernels."""


class Task(_Model):
    """One task."""

    description: str
    seas: tuple[str, ...] = Field(min_length=1, description="presets, one drawn an episode")
    speed_order_m_s: tuple[float, float] = Field(description="range of the orders")
    order_interval_s: float = Field(gt=0, description="time between new orders")
    resistance_rise: tuple[float, float] = Field(description="range of the mean rise")
    resistance_swing: float = Field(ge=0, lt=1, description="amplitude of the slow swing")
    weights: Weights
    ship: dict[str, Any] = Field(default_factory=dict, description="keys of the ship's file")


class TaskError(ValueError):
    """A task that does not exist or cannot be used."""


@functools.cache
def tasks() -> dict[str, Task]:
    """The tasks that come with the package, by name."""
    text = resources.files("shaftline.envs").joinpath("tasks.toml").read_text(encoding="utf-8")
    return {name: Task.model_validate(values) for name, values in tomllib.loads(text).items()}


def get_task(task: str | Task | dict[str, Any]) -> Task:
    """A task by name, or made from a dictionary of its fields.

    Raises:
        TaskError: unknown name, or fields that are missing, unknown or out of range.
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, dict):
        try:
            return Task.model_validate(task)
        except ValidationError as error:
            raise TaskError(f"task: {error}") from None
    if task not in tasks():
        raise TaskError(f"unknown task {task!r}; known: {', '.join(tasks())}")
    return tasks()[task]
