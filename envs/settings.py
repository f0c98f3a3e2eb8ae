"""What a user may vary of an environment: declared once, with its default, and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..plant import Sea, Ship, get_sea
from .records import MAX_ORDERS, NOISE
from .tasks import Task

ActionMode = Literal["rack", "shaft-speed"]

ACTION_MODES: tuple[str, ...] = get_args(ActionMode)
"""What the second action commands."""

_ALLOWED = {
    "observer": ": must be the name of an observer",
    "tuning": ": must be the name of a tuning, or None",
    "sensor_noise": ": must be 0 or more (1: the usual instruments), or an rms by instrument",
    "control_interval_s": " s: must be a number of seconds above 0 and finite",
    "episode_s": " s: must be a number of seconds above 0 and finite",
    "randomise": ": must map keys of the ship's file to half widths",
    "normalised": ": must be True or False",
}
"""What a keyword may be, in words."""

SeaChoice = str | Sea | Mapping[str, Any] | Sequence[Any] | None

LARGEST_EPISODE = 10_000_000
"""Control intervals: about two months of a command every half second."""

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
        episode_s: length of an episode [s].
        randomise: half width of a uniform factor by dotted key of the ship's file, such as
            ``{"hull.resistance_coefficient_N_s2_m2": 0.1}``; each episode draws its own.
        normalised: whether observations are scaled so that the ship's own range of each signal is -1 to
            1; an agent that knows no units wants it, classic controllers do not. A single range serves
            all episodes, so nothing has to be learned or kept with a policy.
        action_mode: ``rack``: the second action is the fuel rack; ``shaft-speed``: it is the set-point
            of a governor that runs at the plant's time step.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    ship: Any = None
    task: Any = "speed-keeping"
    observer: str = "random-walk-kalman"
    tuning: str | None = None
    sea: Any = None
    sensor_noise: float | Mapping[str, float] = 1.0
    control_interval_s: float = Field(default=0.5, gt=0)
    episode_s: float = Field(default=300.0, gt=0)
    randomise: Mapping[str, float] | None = None
    normalised: bool = False
    action_mode: ActionMode = "rack"

    @model_validator(mode="after")
    def _check_length(self) -> Settings:
        """Refuse an episode of no control interval, or of more than :data:`LARGEST_EPISODE`."""
        intervals = self.episode_s / self.control_interval_s
        if intervals > LARGEST_EPISODE + 0.5:
            raise ValueError(
                f"episode_s = {self.episode_s!r} s: {intervals:.3g} control intervals; an "
                f"episode has at most {LARGEST_EPISODE:.0e}"
            )
        if self.intervals < 1:
            raise ValueError(
                f"episode_s = {self.episode_s!r} s is shorter than a control interval of "
                f"{self.control_interval_s!r} s"
            )
        return self

    @staticmethod
    def of(keywords: Mapping[str, Any]) -> Settings:
        """Check keywords and return them as settings.

        Raises:
            ValueError: an unknown keyword, a value of another kind, or one out of range; the message
                names keyword, value and what is allowed.
        """
        try:
            return Settings.model_validate(dict(keywords))
        except ValidationError as error:
            raise ValueError(_explain(error.errors()[0])) from None

    @property
    def intervals(self) -> int:
        """Control intervals of an episode."""
        return round(self.episode_s / self.control_interval_s)

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
        return f"unknown keyword {name!r}; known: {', '.join(Settings.model_fields)}"
    if name == "action_mode":
        return f"unknown action_mode {given!r}; known: {', '.join(ACTION_MODES)}"
    if name == "randomise" and where:
        return f"randomise[{where[0]!r}] = {given!r}: must be a half width from 0 to below 1"
    return f"{name} = {given!r}{_ALLOWED[name]}"


DEFAULTS = Settings()
"""Every default of the environments."""

LONGEST_S = LARGEST_EPISODE * DEFAULTS.control_interval_s
"""Of an episode at the usual interval [s]."""


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
            if len(pair) not in (1, 2) or pair[0] > pair[-1]:
                raise ValueError(
                    f"sea[{name!r}] = {choice[name]!r}: must be a number, or a lowest and a highest"
                )
        low, high = ({name: pair[end] for name, pair in ends.items()} for end in (0, -1))
        return [(Sea(**low), Sea(**high))]
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
    for name in names:
        record[name] *= choice
    return record


def check_randomise(ship: Ship, randomise: Mapping[str, float]) -> None:
    """Refuse what a factor cannot vary, or would carry out of its range.

    Raises:
        ValueError: names the key, its unit and its allowed range.
    """
    for key, width in randomise.items():
        where = f"randomise[{key!r}] = {width!r}"
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


OPTIONS = ("sea", "speed_order_m_s", "order_interval_s", "initial_speed_m_s", "resistance_rise")
"""What ``reset(options=...)`` takes."""

STEERED_OPTIONS = ("heading_order_deg", "track_order_m", "cross_current_m_s", "drift_force_kN")
"""And besides, of a ship that is steered."""


@dataclass(frozen=True)
class Begin:
    """How an episode begins, where ``reset(options=...)`` says it.

    Args:
        seas: to draw from; None leaves them to the environment.
        orders: ordered ship speeds [m/s], one an order interval, the last held; None draws them.
        order_interval_s: [s].
        initial_speed_m_s: ship speed [m/s] at which the episode begins; the first order by default.
        resistance_rise: of the mean resistance [-]; None draws it.
        heading_orders: [rad], one an order interval, the last held; None draws them.
        track_orders: cross tracks [m], likewise.
        cross_current_m_s: of the water, to starboard of the first course [m/s]; None draws it.
        drift_force_N: mean of the slow side force, to starboard [N]; None draws it.
    """

    seas: list[SeaRange | None] | None
    orders: NDArray[np.float64] | None
    order_interval_s: float
    initial_speed_m_s: float | None
    resistance_rise: float | None
    heading_orders: NDArray[np.float64] | None = None
    track_orders: NDArray[np.float64] | None = None
    cross_current_m_s: float | None = None
    drift_force_N: float | None = None

    @staticmethod
    def of(
        options: Mapping[str, Any] | None,
        task: Task,
        speeds: tuple[float, float],
        steered: bool = False,
    ) -> Begin:
        """From the options of a reset, :data:`OPTIONS` and, steered, :data:`STEERED_OPTIONS`.

        Args:
            options: of the reset, or None.
            task: decides what the options leave open.
            speeds: lowest and highest at which the ship can begin [m/s].
            steered: whether the rudder is an action.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        given = dict(options or {})
        known = (*OPTIONS, *(STEERED_OPTIONS if steered else ()))
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ValueError(f"unknown option {unknown[0]!r}; known: {', '.join(known)}")
        interval = _within(
            "order_interval_s", given.get("order_interval_s", task.order_interval_s),
            1e-3, math.inf, "s",
        )  # fmt: skip

        def one(name: str, low: float, high: float, unit: str) -> float | None:
            return None if given.get(name) is None else _within(name, given[name], low, high, unit)

        headings = _orders(given, "heading_order_deg", -360.0, 360.0, "deg")
        force = one("drift_force_kN", -1e5, 1e5, "kN")
        return Begin(
            seas_of(given["sea"], task) if "sea" in given else None,
            _orders(given, "speed_order_m_s", 0.0, 40.0, "m/s"),
            interval,
            one("initial_speed_m_s", *speeds, "m/s"),
            one("resistance_rise", -0.9, 10.0, "-"),
            None if headings is None else np.radians(headings),
            _orders(given, "track_order_m", -1e5, 1e5, "m"),
            one("cross_current_m_s", -5.0, 5.0, "m/s"),
            None if force is None else 1e3 * force,
        )


def _orders(
    given: Mapping[str, Any], name: str, low: float, high: float, unit: str
) -> NDArray[np.float64] | None:
    """Orders of an option, the last held to the end; None where it is not given."""
    if name not in given:
        return None
    asked = np.atleast_1d(given[name])
    if asked.ndim != 1 or not 1 <= len(asked) <= MAX_ORDERS:
        raise ValueError(f"options: {name}: 1 to {MAX_ORDERS} orders are needed")
    orders = np.empty(MAX_ORDERS)
    orders[: len(asked)] = [_within(name, order, low, high, unit) for order in asked]
    orders[len(asked) :] = orders[len(asked) - 1]
    return orders


def _within(name: str, value: Any, low: float, high: float, unit: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not low <= number <= high:
        raise ValueError(f"options: {name} = {value!r}: must be {low:g} to {high:g} {unit}")
    return number
