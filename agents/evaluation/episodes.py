"""Simulation of any controller on any task: one episode for each seed, with the KPIs of each.

Controllers are given by name: the classic controllers, and policies by their file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...baselines import ControllerError, controller_names, make_controller
from ...baselines.controller import OBSERVED, Predictor, measurements_of
from ...baselines.registry import CONTROLLERS, read_options, split_steering_name
from ...core.discovery import external_class_digest
from ...core.sweep import digest_of, source_digest
from ...envs import CLASSIC, DEFAULTS, FrigateVectorEnv
from ...envs.orders import OrderProfile
from ...envs.records import TRUTHS
from ...envs.settings import EPISODE_S
from ...envs.steering import environment_classes
from ...envs.tasks import Task, controller_for, get_task
from ...fmi.controller import FmuController
from ...plant import Sea, Ship
from ..policy.policy import PolicyError, load_policy, packaged_policies, policy_file
from .kpis import EpisodeSums

_LONGEST = 160


@dataclass(frozen=True)
class Setting:
    """Cell of an evaluation: controller, task, sea, observer and episodes.

    Args:
        controller: name of the controller in tables.
        task: name; ``NAME:held-out`` for the seas that its training never draws.
        sea: ``task`` for the seas of the task, or any value of the environment's ``sea``.
        observer: name of the observer.
        seeds: number of episodes, one for each seed.
        ship: preset or path; by default the ship of the task.
        episode_s: length of an episode [s].
        sensor_noise: factor on the usual noise, or rms by instrument [unit of the instrument].
        task_model: the task itself, where ``task`` is not its registered name.
        first_seed: first seed.
        randomise: half width of a uniform factor by dotted key of the ship file. The simulated ship has
            the factors; observer and controller use the nominal ship.
        tuning: tuning of the observer; its default where None.
        interval_s: control interval [s].
        order_profile: orders in place of those of the task (:mod:`shaftline.envs.orders`).

    Examples:
        >>> cell = Setting("combinator", "transit", "task", "luenberger", seeds=4)
        >>> cell.vessel
        'frigate'
        >>> cell.name
        'combinator_transit_task_luenberger_4_frigate_300.0_1.0_0'
    """

    controller: str
    task: str
    sea: Any
    observer: str
    seeds: int
    ship: str | None = None
    episode_s: float = EPISODE_S
    sensor_noise: Any = DEFAULTS.sensor_noise
    task_model: Task | None = None
    first_seed: int = 0
    randomise: Mapping[str, float] | None = None
    tuning: str | None = None
    interval_s: float = DEFAULTS.control_interval_s
    order_profile: OrderProfile | None = None

    @property
    def model(self) -> Task:
        """Task of the cell."""
        return self.task_model or get_task(self.task)

    @property
    def vessel(self) -> str:
        """Preset or path of the simulated ship."""
        return self.ship or self.model.vessel

    def environment(self, controller: Any) -> dict[str, Any]:
        """Return the keywords of the environment of a controller."""
        return {
            "ship": self.vessel,
            "task": self.model,
            "sea": None if self.sea == "task" else self.sea,
            "observer": self.observer,
            "sensor_noise": self.sensor_noise,
            "max_episode_steps": self.intervals,
            "control_interval_s": self.interval_s,
            "randomise": self.randomise,
            "tuning": self.tuning,
            "order_profile": self.order_profile,
            **getattr(controller, "interface", CLASSIC),
        }

    @property
    def intervals(self) -> int:
        """Number of control intervals of an episode."""
        return max(round(self.episode_s / self.interval_s), 1)

    @property
    def columns(self) -> dict[str, Any]:
        """Fields as columns of a table, with the simulated ship and without ``task_model``.

        Columns with the default value are left out from ``randomise`` on; an order profile is a digest.
        """
        fields = asdict(self) | {"ship": self.vessel}
        del fields["task_model"]
        for name in ("randomise", "tuning", "interval_s", "order_profile"):
            if fields[name] == type(self).__dataclass_fields__[name].default:
                del fields[name]
        if self.order_profile is not None:
            fields["order_profile"] = digest_of(repr(self.order_profile))
        return fields

    @property
    def name(self) -> str:
        """File name of the cell, which differs where any field differs.

        A long name is cut and ends with a digest of the whole, because file systems allow 255 letters.
        """
        text = "_".join(map(str, self.columns.values()))
        if len(text) > _LONGEST:
            text = f"{text[:_LONGEST]}_{digest_of(text)}"
        return "".join(c if c.isalnum() or c in "-._" else "-" for c in text)


def run_episodes(
    setting: Setting,
    controller: Predictor,
    first_seed: int | None = None,
    threads: int | None = None,
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Simulate one episode for each seed.

    Args:
        setting: task, sea, observer and episodes.
        controller: controller with ``predict``; its ``interface`` holds the keywords of its environment,
            :data:`shaftline.envs.CLASSIC` where it has none.
        first_seed: first seed in place of that of the setting. Equal seeds give equal seas for every
            controller.
        threads: number of threads that step the episodes; one for each core by default. The results do
            not depend on it.

    Returns:
        KPIs, one row for each seed; and the episode of the first seed, shape (intervals, columns of
        :data:`TRACE`).

    Examples:
        >>> from shaftline.baselines import make_controller
        >>> from shaftline.plant import load_ship
        >>> cell = Setting("combinator", "transit", "calm", "none", seeds=2, episode_s=5.0)
        >>> kpis, trace = run_episodes(cell, make_controller("combinator", load_ship("frigate"), 0.5))
        >>> len(kpis), trace.shape == (10, len(TRACE))
        (2, True)
    """
    env = environment_classes(setting.model.steered).vector(
        setting.seeds,
        threads=threads,
        **setting.environment(controller),
        autoreset_mode="NextStep",  # so that the last info belongs to the ended episode
    )
    interval = env.batch.interval_s
    observation, _ = env.reset(seed=setting.first_seed if first_seed is None else first_seed)
    sums = EpisodeSums(setting.seeds, interval, env.batch.ship.transmission.gear_ratio)
    alive = np.ones(setting.seeds, dtype=bool)
    starting = alive.copy()
    state: Any = None
    trace: list[list[float]] = []
    order = _measured(env)[:, _ORDER]
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        sums.add(alive, info, reward, order)
        if alive[0]:
            seen = measurements_of(_measured(env)[0])
            truth = [float(info[name][0]) for name in TRUTHS]
            trace.append(
                [
                    len(trace) * interval,
                    order[0],
                    seen.pitch_ratio[0],
                    seen.fuel_rack[0],
                    *truth,
                    seen.advance_velocity[0],
                    seen.estimate_valid[0],
                ]
            )
        starting = terminated | truncated
        alive &= ~starting
        order = _measured(env)[:, _ORDER]
    env.close()
    return sums.kpis(), np.array(trace, dtype=np.float64)


def drawn_seas(setting: Setting) -> pd.DataFrame:
    """Return the sea of each episode: seed, Hs [m], Tp [s], gamma [-], heading [deg] and wind [m/s].

    In calm water Hs is 0, and period, gamma and heading are nan.

    Examples:
        >>> cell = Setting("combinator", "transit", "state-5", "none", seeds=1)
        >>> drawn_seas(cell).to_dict("records")
        [{'seed': 0, 'hs_m': 3.25, 'tp_s': 9.7, 'gamma': 3.3, 'heading_deg': 180.0, 'wind_m_s': 0.0}]
    """
    env = environment_classes(setting.model.steered).vector(
        setting.seeds, threads=1, **setting.environment(object())
    )
    env.reset(seed=setting.first_seed)
    table = pd.DataFrame(env.batch.arrays.episodes["sea"].copy(), columns=list(Sea.model_fields))
    env.close()
    table.loc[table["hs_m"] == 0.0, ["tp_s", "gamma", "heading_deg"]] = np.nan
    table.insert(0, "seed", range(setting.first_seed, setting.first_seed + setting.seeds))
    return table


def _measured(env: FrigateVectorEnv) -> NDArray[np.float64]:
    """Return the signals of the classic controllers in physical units, shape (n, 8)."""
    return env.batch.signals[:, : len(OBSERVED)].astype(np.float64)


_ORDER = OBSERVED.index("speed_order")

TRACE = ("time", "speed_order", "pitch_ratio", "fuel_rack", *TRUTHS, "estimate", "valid")
"""Columns of the trace of an episode."""


_POLICY, _FMU = "policy", "fmu"


def known_controllers() -> str:
    """Return the values that :func:`load_controller` accepts, as text."""
    return (
        f"{', '.join(controller_names())}, module:Class, fmu:FILE.fmu, policy:FILE.npz"
        + "".join(f", {_POLICY}:{name}" for name in packaged_policies())
    )


def load_controller(
    text: str, ship: Ship, interval_s: float, task: Task | None = None
) -> Predictor:
    """Return a controller from ``NAME``, ``NAME:option=number,...``, ``policy:FILE`` or ``fmu:FILE``.

    Args:
        text: one of the forms above; FILE is a policy file, the name of a policy of the package, or an
            FMU. The machine code in an FMU is executed with the rights of the user.
        ship: ship to control.
        interval_s: control interval [s].
        task: task of the controller. Where the rudder is an action, ``HELMSMAN+NAME`` selects the
            helmsman; the default is the helmsman of the task.

    Raises:
        ControllerError: unknown name, or an option that the controller does not accept.
        PolicyError: not a policy file, or a policy of another version, ship, observation or interval.
        FmuError: not an FMU, or one whose variables do not suit a controller.

    Examples:
        >>> from shaftline.plant import load_ship
        >>> load_controller("speed-pilot", load_ship("frigate"), 0.5).name
        'speed-pilot'
    """
    kind, _, source = text.partition(":")
    if kind == _FMU and source:
        if task is not None and task.steered:
            raise ControllerError(
                f"{text!r}: an FMU commands pitch and drive, but this task steers"
            )
        return FmuController(Path(source), ship, interval_s)
    if kind != _POLICY:
        steered = task is not None and task.steered
        parts = split_steering_name(text)
        name, _ = read_options(parts[-1])
        if (":" in name or name in controller_names()) and len(parts) <= 1 + steered:
            if task is None:
                return make_controller(text, ship, interval_s)
            return controller_for(task, text, ship, interval_s, steered)
    if kind != _POLICY or not source:
        raise ControllerError(f"unknown controller {text!r}; known: {known_controllers()}")
    policy = load_policy(source, ship)
    own = policy.interval_s
    if abs(own - interval_s) > 1e-9:
        raise PolicyError(
            f"{source}: this policy does not match the environment: control_interval_s: the policy has "
            f"{own:g} s, the environment {interval_s:g} s"
        )
    return policy


def label(text: str) -> str:
    """Return the name in tables and cells of a controller that :func:`load_controller` accepts.

    The content of a file can change under the same name, and results of an earlier content must not be
    reused. The label of a policy or an FMU therefore ends with eight letters of a digest of its file and
    of the source code that runs it, the label of a user's controller with those of its source and its
    imports.

    Examples:
        >>> label("combinator")
        'combinator'
    """
    kind, _, source = text.partition(":")
    if kind == _FMU:
        return f"{_FMU}:{'/'.join(Path(source).parts[-2:])} {version_of(Path(source), 'fmi')}"
    if kind != _POLICY:
        propulsion = split_steering_name(text)[-1]
        return f"{text} {external_class_digest(read_options(propulsion)[0], CONTROLLERS)}".rstrip()
    return f"{_POLICY}:{'/'.join(Path(source).parts[-2:])} {version_of(policy_file(source))}"


def version_of(file: Path, code: str = "agents/policy") -> str:
    """Return eight letters that change with a policy file or FMU and the source code that runs it."""
    return hashlib.sha256(source_digest(code).encode() + file.read_bytes()).hexdigest()[:8]
