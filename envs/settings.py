"""Settings of an environment: each keyword with its default and its check."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..core.models import explain
from ..plant import Sea, Ship, get_sea
from .orders import OrderProfile, check_profile
from .records import NOISE
from .tasks import Task

SeaChoice = str | Sea | Mapping[str, Any] | Sequence[Any] | None
LARGEST_EPISODE = 10_000_000  # control intervals: about two months at one every 0.5 s
ACTION_MODES = ("increment", "absolute", "residual")  # ``residual:NAME`` also names the controller
BASE_CONTROLLER = "speed-pilot"  # base controller of a residual that does not name one
Command = Literal["shaft-speed", "limited-rack", "fuel-rack"]

COMMANDS: tuple[str, ...] = get_args(Command)  # what the second action can command
_ALLOWED = {
    "observer": ": must be the name of an observer, such as random-walk-kalman",
    "tuning": ": must be the name of a tuning, or None",
    "sensor_noise": ": must be a factor of at least 0 (1: usual noise), or an rms by instrument",
    "control_interval_s": " s: must be a number of seconds above 0 and finite",
    "max_episode_steps": ": must be a whole number of control intervals from 1 to 10 000 000, or None",
    "randomise": ": must map keys of the ship file to half widths from 0 to below 1",
    "normalised": ": must be True or False",
    "action_mode": f": must be one of {', '.join(ACTION_MODES)}",
    "order_profile": ": must be pairs of time [s] and ordered ship speed [m/s], or None",
}
"""Allowed values of each keyword, as the end of a message."""

SeaRange = tuple[Sea, Sea]  # lowest and highest value of every parameter, drawn uniformly between


class Settings(BaseModel):
    """Keywords of an environment.

    Args:
        ship: preset, path of a ship file, or Ship with a diesel engine; by default the ship of the task.
        task: name (see ``shaftline list``), a Task, or a dictionary of its fields.
        observer: name of the observer; ``oracle`` returns the true advance velocity.
        tuning: name of the tuning of the observer.
        sea: preset; parameters such as ``{"hs_m": (1.0, 5.0), "tp_s": 9.0}``, where a pair is a range
            from which each episode draws; or a list of these to draw from. By default the seas of the
            task.
        sensor_noise: factor on the usual noise of the instruments (0 for perfect instruments), or rms by
            instrument [unit of the instrument].
        control_interval_s: time between actions [s], a multiple of the time step of the plant.
        max_episode_steps: number of control intervals of an episode; None for episodes without an end.
            ``gymnasium.make`` limits an episode by its own ``max_episode_steps``.
        randomise: half width of a uniform factor by dotted key of the ship file, such as
            ``{"hull.resistance_coefficient_N_s2_m2": 0.1}``; each episode draws its own factors.
        normalised: whether observations are scaled so that the range of each signal on the ship is -1 to
            1 in all episodes, and clipped to :data:`shaftline.baselines.controller.NORMALISED_BOUND`.
            Classic controllers need ``False``: physical units.
        action_mode: ``increment``: actions are rates of change of the pitch and drive commands;
            ``absolute``: actions are the commands; ``residual`` or ``residual:CONTROLLER``: actions are
            added to the commands of a classic controller.
        command: what the second action commands. ``shaft-speed`` (default): the set-point of a governor,
            which acts at every plant step; ``limited-rack`` (default for a residual): the fuel rack
            within idle speed, torque and highest speed; ``fuel-rack``: without engine protection.
        order_profile: pairs of time [s] and ordered ship speed [m/s] in place of the orders of the task,
            such as ``[(0, 5.0), (60, 8.0)]``; each order holds until the next one
            (:mod:`shaftline.envs.orders`).

    Examples:
        >>> Settings(task="transit").drive_command
        'shaft-speed'
        >>> Settings(action_mode="residual").base_controller
        'speed-pilot'
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
    order_profile: Any = None

    @field_validator("order_profile")
    @classmethod
    def _check_profile(cls, rows: Any) -> OrderProfile | None:
        return None if rows is None else check_profile(rows)

    @model_validator(mode="after")
    def _check_action_mode(self) -> Settings:
        """Refuse an unknown action mode, and a residual on the set-point of a governor."""
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
        """Check keywords of an environment, by name, and return them as settings.

        Raises:
            TypeError: an unknown keyword, as in a Python call; the message lists the known keywords.
            ValueError: a value of a wrong type or out of range; the message names it and the range.
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
        """Name and options of the base controller of a residual; None in other modes."""
        kind, _, name = self.action_mode.partition(":")
        return (name or BASE_CONTROLLER) if kind == "residual" else None

    @property
    def drive_command(self) -> str:
        """Quantity that the second action commands, with the default where ``command`` is None."""
        return self.command or ("limited-rack" if self.base_controller else "shaft-speed")

    def steps(self, dt: float) -> int:
        """Return the number of plant steps of ``dt`` [s] in a control interval.

        Raises:
            ValueError: the interval is not a multiple of the time step.

        Examples:
            >>> Settings().steps(0.05)
            10
        """
        steps = round(self.control_interval_s / dt)
        if steps < 1 or abs(steps * dt - self.control_interval_s) > 1e-9:
            raise ValueError(
                f"control_interval_s = {self.control_interval_s!r} s: must be a multiple of the time "
                f"step of {dt} s"
            )
        return steps


def _explain(error: Any) -> str:
    """Return the message about a keyword that pydantic refused."""
    kind, given = error["type"], error["input"]
    if kind == "value_error":
        return str(error["ctx"]["error"])
    name, *where = map(str, error["loc"])
    if kind == "extra_forbidden":
        return f"unexpected keyword argument {name!r}; known: {', '.join(Settings.model_fields)}"

    if name == "command":
        return f"unknown command {given!r}; known: {', '.join(COMMANDS)}"
    if name == "randomise" and where:
        return f"randomise[{where[0]!r}] = {given!r}: must be a half width from 0 to below 1"
    return f"{name} = {given!r}{_ALLOWED[name]}"


DEFAULTS = Settings()
"""Default settings of the environments."""

LONGEST_S = LARGEST_EPISODE * DEFAULTS.control_interval_s  # longest episode by default [s]
EPISODE_S = 300.0  # length of an episode with the default number of control intervals [s]
CLASSIC: dict[str, Any] = {"normalised": False, "action_mode": "absolute", "command": "fuel-rack"}
"""Keywords of an environment for classic controllers: physical units, commands as actions."""


def read_seas(choice: SeaChoice, task: Task) -> list[SeaRange | None]:
    """Return the seas that an episode can draw; None stands for calm water.

    The choice is as in :class:`Settings`; None means the seas of the task.

    Raises:
        ValueError: an unknown or empty sea, or a range whose lower end is above its upper end.

    Examples:
        >>> from shaftline.envs import get_task
        >>> ((low, high),) = read_seas({"hs_m": (1.0, 2.0), "tp_s": 8.0}, get_task("transit"))
        >>> low.hs_m, high.hs_m
        (1.0, 2.0)
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
                    f"sea[{name!r}] = {choice[name]!r}: must be a number, or a pair (lowest, highest)"
                )
        low, high = ({name: pair[end] for name, pair in ends.items()} for end in (0, -1))
        try:
            return [(Sea(**low), Sea(**high))]
        except ValidationError as error:
            raise ValueError(
                f"sea: {explain(error)} (keys: {', '.join(Sea.model_fields)})"
            ) from None
    if not isinstance(choice, Sequence) or not choice:
        raise ValueError(
            f"sea = {choice!r}: must be a preset such as state-5, parameters, or a list of these"
        )
    return [sea for item in choice for sea in read_seas(item, task)]


def noise_record(ship: Ship, choice: float | Mapping[str, float]) -> Any:
    """Return the noise of the instruments as a NOISE record.

    The choice is a factor on the usual noise of the ship, or an rms by instrument [its unit].

    Raises:
        ValueError: an unknown instrument, or a factor or rms below 0.
    """
    record = np.zeros(1, NOISE)[0]
    names = NOISE.names or ()
    if isinstance(choice, Mapping):
        for name, rms in choice.items():
            if name not in names or not (math.isfinite(rms) and rms >= 0.0):
                raise ValueError(
                    f"sensor_noise[{name!r}] = {rms!r}: known instruments are "
                    f"{', '.join(names)}, each with an rms of at least 0"
                )
            record[name] = rms
        return record
    if not (math.isfinite(choice) and choice >= 0.0):
        raise ValueError(f"sensor_noise = {choice!r}: must be at least 0 (1: usual noise)")
    plant = ship.record()
    top_speed = float(plant["engine_speed_max"] / plant["gear_ratio"])
    top_torque = float(plant["torque_limit"] * plant["gear_ratio"])
    # Encoder 0.1 % and strain gauge 0.5 % of full scale, pitch feedback, accelerometer, speed log.
    torque = 5e-3 * top_torque if math.isfinite(top_torque) else 0.0
    usual = [1e-3 * top_speed, torque, 4e-3, 2e-2, 5e-2]
    # Gyrocompass, rate gyro, rudder feedback, position from a navigation filter, and inflow of the
    # waves that the sensor at the bow measures (assumed).
    usual += [math.radians(0.1), math.radians(0.02), math.radians(0.1), 5e-2, 0.05]
    return np.array(tuple(rms * choice for rms in usual), NOISE)[()]


_NOT_VARIED = ("integration.time_step_s",)  # keys of the integration, not of the ship


def check_randomise(ship: Ship, randomise: Mapping[str, float]) -> None:
    """Refuse keys that a factor (1 plus or minus its half width) cannot vary within their range.

    Raises:
        ValueError: names the key, its unit and its allowed range.
    """
    for key, width in randomise.items():
        where = f"randomise[{key!r}] = {width!r}"
        if key in _NOT_VARIED:
            raise ValueError(
                f"{where}: {key} sets the integration and is not a parameter of the ship; remove it"
            )
        if not ship.has_key(key):
            raise ValueError(
                f"{where}: not the key of a number in the ship file, such as hull.mass_kg"
            )
        if not 0.0 <= width < 1.0:
            raise ValueError(f"{where}: must be a half width from 0 to below 1")
        _, value, info, *_ = ship.parameter(key)
        if value == 0.0 or not math.isfinite(value):
            raise ValueError(
                f"{where}: the value on this ship is {value:g}, which a factor cannot vary"
            )
        ends = sorted((value * (1.0 - width), value * (1.0 + width)))
        if ends[0] < info.low or ends[1] > info.high:
            raise ValueError(
                f"{where}: {ends[0]:g} to {ends[1]:g} leaves the range of {info.low:g} to "
                f"{info.high:g} (unit {info.unit})"
            )
