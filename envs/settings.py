"""What a user may vary of an environment: declared once, with its default, and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..core.models import explained
from ..plant import Sea, Ship, get_sea
from .records import NOISE
from .tasks import Task

SeaChoice = str | Sea | Mapping[str, Any] | Sequence[Any] | None

LARGEST_EPISODE = 10_000_000
"""Control intervals: about two months of a command every half second."""

ACTION_MODES = ("increment", "absolute", "residual")
"""How an action becomes commands; ``residual:NAME`` names the base controller."""

BASE_CONTROLLER = "speed-pilot"
"""Base controller of a residual that names none."""

Command = Literal["shaft-speed", "limited-rack", "fuel-rack"]
"""What the second action commands: the set-point of a governor, a fuel rack inside the limits of idle
speed, torque and highest speed, or the fuel rack itself."""

COMMANDS: tuple[str, ...] = get_args(Command)
"""What the second action commands."""

_ALLOWED = {
    "observer": ": must be the name of an observer",
    "tuning": ": must be the name of a tuning, or None",
    "sensor_noise": ": must be 0 or more (1: the usual instruments), or an rms by instrument",
    "control_interval_s": " s: must be a number of seconds above 0 and finite",
    "max_episode_steps": ": must be a whole number of control intervals from 1 to 10 000 000, or None",
    "randomise": ": must map keys of the ship's file to half widths",
    "normalised": ": must be True or False",
}
"""What a keyword may be, in words."""

SeaRange = tuple[Sea, Sea]
"""Lowest and highest value of every parameter; an episode draws each uniformly between them."""


class Settings(BaseModel):
    """Keywords of an environment.

    Args:
        ship: preset, path or Ship; a diesel ship that moves; by default the one of the task.
        task: a name (``shaftline list`` tells them), a Task, or a dictionary of its fields.
        observer: name of the observer; ``oracle`` shows the truth.
        tuning: its tuning.
        sea: preset; parameters, such as ``{"hs_m": (1.0, 5.0), "tp_s": 9.0}``, where a pair is a range
            from which each episode draws; or a list of those to draw from; the task's by default.
        sensor_noise: factor on the usual instruments' (0 for perfect ones), or rms by instrument [its
            unit].
        control_interval_s: time between actions [s], a multiple of the plant's time step.
        max_episode_steps: control intervals of an episode; None for episodes without an end.
            ``gymnasium.make`` limits an episode by its own ``max_episode_steps``.
        randomise: half width of a uniform factor by dotted key of the ship's file, such as
            ``{"hull.resistance_coefficient_N_s2_m2": 0.1}``; each episode draws its own.
        normalised: whether observations are scaled so that the ship's own range of each signal is -1 to
            1, and clipped to :data:`shaftline.baselines.controller.NORMALISED_BOUND`. One range serves
            all episodes, so no statistics need to be kept with a policy. Classic controllers need
            ``False``: physical units.
        action_mode: ``increment``: the actions are rates of change of pitch and drive command, added to
            the commands that run; ``absolute``: they are the commands; ``residual`` or
            ``residual:CONTROLLER``: they are added to the commands of a classic controller.
        command: what the second action commands. ``shaft-speed``: the set-point of a governor, which
            acts at every plant step; ``limited-rack``: the fuel rack, inside the limits of idle speed,
            torque and highest speed; ``fuel-rack``: the fuel rack itself, with nothing that protects
            the engine. By default ``shaft-speed``, and ``limited-rack`` for a residual.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    ship: Any = None
    task: Any = "speed-keeping"
    observer: str = "random-walk-kalman"
    tuning: str | None = None
    sea: Any = None
    sensor_noise: float | Mapping[str, float] = 1.0
    control_interval_s: float = Field(default=0.5, gt=0)
    max_episode_steps: int | None = Field(default=600, ge=1, le=LARGEST_EPISODE)
    randomise: Mapping[str, float] | None = None
    normalised: bool = True
    action_mode: str = "increment"
    command: Command | None = None

    @model_validator(mode="after")
    def _check_action_mode(self) -> Settings:
        """Refuse an unknown action mode, and a residual on a governor's set-point."""
        kind, separator, name = self.action_mode.partition(":")
        if kind not in ACTION_MODES or (separator and not (kind == "residual" and name)):
            raise ValueError(
                f"unknown action_mode {self.action_mode!r}; known: {', '.join(ACTION_MODES)}, and "
                "residual:CONTROLLER"
            )
        if kind == "residual" and self.command == "shaft-speed":
            raise ValueError(
                "command = 'shaft-speed': a residual is added to the fuel rack of a classic "
                "controller; choose limited-rack or fuel-rack"
            )
        return self

    @staticmethod
    def of(keywords: Mapping[str, Any]) -> Settings:
        """Check keywords and return them as settings.

        Raises:
            TypeError: an unknown keyword, as Python has it; the message names those that are known.
            ValueError: a value of another kind, or one out of range; the message names keyword, value
                and what is allowed.
        """
        try:
            return Settings.model_validate(dict(keywords))
        except ValidationError as error:
            first = error.errors()[0]
            if first["type"] == "extra_forbidden":
                raise TypeError(_explain(first)) from None
            raise ValueError(_explain(first)) from None

    @property
    def base_controller(self) -> str | None:
        """Name and options of the controller to which a residual is added; None in other modes."""
        kind, _, name = self.action_mode.partition(":")
        return (name or BASE_CONTROLLER) if kind == "residual" else None

    @property
    def drive_command(self) -> str:
        """What the second action commands, where ``command`` leaves it open too."""
        return self.command or ("limited-rack" if self.base_controller else "shaft-speed")

    def steps(self, dt: float) -> int:
        """Plant steps in a control interval, for a time step ``dt`` [s].

        Raises:
            ValueError: the interval is no multiple of it.
        """
        steps = round(self.control_interval_s / dt)
        if steps < 1 or abs(steps * dt - self.control_interval_s) > 1e-9:
            raise ValueError(
                f"control_interval_s = {self.control_interval_s!r} s: must be a multiple of the time "
                f"step of {dt} s"
            )
        return steps


def _explain(error: Any) -> str:
    """Return a sentence about a keyword that pydantic refused."""
    kind, given = error["type"], error["input"]
    if kind == "value_error":
        return str(error["ctx"]["error"])
    name, *where = map(str, error["loc"])
    if kind == "extra_forbidden":
        return f"unexpected keyword argument {name!r}; known: {', '.join(Settings.model_fields)}"
    if name == "action_mode":
        return f"action_mode = {given!r}: must be one of {', '.join(ACTION_MODES)}"
    if name == "command":
        return f"unknown command {given!r}; known: {', '.join(COMMANDS)}"
    if name == "randomise" and where:
        return f"randomise[{where[0]!r}] = {given!r}: must be a half width from 0 to below 1"
    return f"{name} = {given!r}{_ALLOWED[name]}"


DEFAULTS = Settings()
"""Every default of the environments."""

LONGEST_S = LARGEST_EPISODE * DEFAULTS.control_interval_s
"""Longest episode at the default control interval [s]."""

EPISODE_S = 300.0
"""Length of an episode of the default number of control intervals [s]."""

CLASSIC: dict[str, Any] = {
    "normalised": False, "action_mode": "absolute", "command": "fuel-rack",
}  # fmt: skip
"""Keywords with which an environment suits the classic controllers: units, and commands as actions."""


def seas_of(choice: SeaChoice, task: Task) -> list[SeaRange | None]:
    """The seas that an episode may draw; None is calm water.

    Args:
        choice: as of :class:`Settings`; None leaves it to the task.
        task: the task.

    Raises:
        ValueError: a sea that does not exist, none at all, or a range whose ends are the wrong way
            round.
    """
    if choice is None:
        choice = task.seas
    if isinstance(choice, str):
        choice = get_sea(choice)
        if choice is None:
            return [None]  # calm water
    if isinstance(choice, Sea):
        return [(choice, choice)]
    if isinstance(choice, Mapping):
        ends = {name: np.atleast_1d(value).tolist() for name, value in choice.items()}
        for name, pair in ends.items():
            numbers = all(type(end) in (int, float) for end in pair)
            if len(pair) not in (1, 2) or not numbers or pair[0] > pair[-1]:
                raise ValueError(
                    f"sea[{name!r}] = {choice[name]!r}: must be a number, or a lowest and a highest"
                )
        low, high = ({name: pair[end] for name, pair in ends.items()} for end in (0, -1))
        try:
            return [(Sea(**low), Sea(**high))]
        except ValidationError as error:
            raise ValueError(
                f"sea: {explained(error)} (keys: {', '.join(Sea.model_fields)})"
            ) from None
    if not isinstance(choice, Sequence) or not choice:
        raise ValueError(f"sea = {choice!r}: must be a preset, parameters, or a list of those")
    return [sea for item in choice for sea in seas_of(item, task)]


def noise_of(ship: Ship, choice: float | Mapping[str, float]) -> Any:
    """NOISE record: a share of the usual instruments' noise, or rms values by name.

    Raises:
        ValueError: an unknown instrument, or an rms or share below 0.
    """
    record = np.zeros(1, NOISE)[0]
    names = NOISE.names or ()
    if isinstance(choice, Mapping):
        for name, rms in choice.items():
            if name not in names or not (math.isfinite(rms) and rms >= 0.0):
                raise ValueError(
                    f"sensor_noise[{name!r}] = {rms!r}: known instruments are "
                    f"{', '.join(names)}, with an rms of 0 or more"
                )
            record[name] = rms
        return record
    if not (math.isfinite(choice) and choice >= 0.0):
        raise ValueError(f"sensor_noise = {choice!r}: must be 0 or more (1: the usual instruments)")
    plant = ship.record()
    top_speed = float(plant["engine_speed_max"] / plant["gear_ratio"])
    top_torque = float(plant["torque_limit"] * plant["gear_ratio"])
    # encoder 0.1 %, strain gauge 0.5 % of full scale, pitch feedback, accelerometer, speed log
    record["shaft_speed"] = 1e-3 * top_speed
    record["shaft_torque"] = 5e-3 * top_torque if math.isfinite(top_torque) else 0.0
    record["pitch_ratio"] = 4e-3
    record["shaft_acceleration"] = 2e-2
    record["ship_speed"] = 5e-2
    # gyrocompass, rate gyro, rudder feedback, position behind a navigation filter
    record["heading"] = math.radians(0.1)
    record["yaw_rate"] = math.radians(0.02)
    record["rudder_angle"] = math.radians(0.1)
    record["cross_track"] = 5e-2
    # inflow of the waves that are measured at the bow (assumed)
    record["wave_inflow"] = 0.05
    for name in names:
        record[name] *= choice
    return record


_NOT_VARIED = ("integration.time_step_s",)
"""Keys that set how the plant is integrated, and no number of the ship."""


def check_randomise(ship: Ship, randomise: Mapping[str, float]) -> None:
    """Refuse what a factor cannot vary, or would carry out of its range.

    Raises:
        ValueError: names the key, its unit and its allowed range.
    """
    for key, width in randomise.items():
        where = f"randomise[{key!r}] = {width!r}"
        if key in _NOT_VARIED:
            raise ValueError(f"{where}: every episode has the same {key}")
        if not ship.has_key(key):
            raise ValueError(f"{where}: must be a number of the ship's file by its dotted key")
        if not 0.0 <= width < 1.0:
            raise ValueError(f"{where}: must be a half width from 0 to below 1")
        _, value, info, *_ = ship.number(key)
        if value == 0.0 or not math.isfinite(value):
            raise ValueError(f"{where}: the ship has {value:g} there, which a factor does not vary")
        ends = sorted((value * (1.0 - width), value * (1.0 + width)))
        if ends[0] < info.low or ends[1] > info.high:
            raise ValueError(
                f"{where}: {ends[0]:g} to {ends[1]:g} leaves the range of {info.low:g} to "
                f"{info.high:g} (unit {info.unit})"
            )
