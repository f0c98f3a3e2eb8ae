"""What could be had at best: commands for an episode of which everything is known beforehand.

Waves and resistance of the episode are given, and the commands of its control intervals are chosen
together, so that the sum of the task's rewards is highest. An order is known from when it is given:
until then the plan is made as if the present one stood, or it would set out before it is told to. No
controller at sea can know as much, so what it reaches is a bound to hold controllers against; it is a
local optimum that was begun from a classic controller's commands, so the true best may lie above it.

The environment's own kernel is the model. How an interval's reward and the state at its end follow the
state at its beginning and the commands is found by central differences of that kernel, and the gradient
of the sum by going back through the episode (adjoint, as in Bryson & Ho 1975, section 2.2):

    lambda_k = r_x + A_k^T lambda_k+1,     dJ/du_k = r_u + B_k^T lambda_k+1

The first command is a rate of the blades, u_1 = (P_d - p) / tau_p, held within what the actuator can do:
a pitch command far away moves the blades no faster and would have no gradient.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from ...baselines.controller import Predictor, actions, decode
from ...envs.batch import Batch
from ...envs.kernel import RUNNING, control_interval
from ...envs.records import EPISODE, MAX_ORDERS
from ...envs.settings import CLASSIC, Settings
from ...plant.memory import MEMORY
from ...plant.state import STATE, active_states
from ...plant.waves import SEA

_FAST = 1.3
"""Bound of the rate over the actuator's: the blades close in on the command within an interval."""

_MEMORIES = {("memory", "rack"): 1e-2, ("episode", "drive"): 1e-2, ("episode", "mean_speed"): 1e-3,
             ("episode", "mean_torque"): 10.0,
             ("episode", "mean_brake_torque"): 10.0, ("episode", "mean_attack"): 1e-3}  # fmt: skip
"""What is carried from interval to interval beside the states, and by how much it is moved."""

_STATES = {"pitch_ratio": 1e-4, "shaft_speed": 1e-3, "ship_speed": 1e-3, "position": 1e-2,
           "brake_torque": 10.0, "inflow": 1e-3}  # fmt: skip
_SHARE = 1e-3  # of states that are shares
_MOVED = (1e-4, 1e-2)  # commands: rate of the pitch [1/s] and rack [mm]
_AT_ONCE = 16  # intervals whose slopes are found in one call
_GAIN = 1e-3  # of the cost, below which a search is not begun anew
_BEYOND_S = 30.0  # sailed on behind an order's end in its plan, or the end would be used up
_CARRIED = np.dtype([("state", STATE), ("memory", MEMORY), ("sea", SEA), ("episode", EPISODE)])


class Plan(NamedTuple):
    """Commands of an episode."""

    rewards: NDArray[np.float64]
    """Of each control interval, shape (k,)."""
    actions: NDArray[np.float32]
    """Shape (k, 2)."""
    rounds: int
    """Gradients that were taken."""


class Clairvoyant:
    """Plans one episode; see the module.

    Args:
        settings: of the environment; noise and observer do not matter.
        seed: of the episode, as of the environment's ``reset``.

    Raises:
        ValueError: as of the environment; or the ship's pitch is fixed.
    """

    def __init__(self, settings: Settings, seed: int) -> None:
        quiet = settings.model_copy(
            update={"sensor_noise": 0.0, "observer": "none", "tuning": None} | CLASSIC
        )
        if quiet.max_episode_steps is None:
            raise ValueError("max_episode_steps = None: a plan needs an episode with an end")
        self._one = one = Batch(1, quiet)
        self._length = quiet.max_episode_steps
        if not one.ship.has_variable_pitch:
            raise ValueError(f"{one.ship.name}: a plan needs a controllable pitch")
        one.reset(np.array([0]), [np_random(seed)[0]], one.begin(None))
        one.observe(np.array([0]))
        self._first = one.environments.copy()
        plant = one.ship.record()
        self._plant, self._lag = plant, float(plant["pitch_time_constant"])
        scales = {("state", name): _STATES.get(name, _SHARE) for name in active_states(plant)}
        self._carried = list((scales | {("state", "position"): 1e-2} | _MEMORIES).items())
        span = float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
        fastest = _FAST * min(float(plant["pitch_rate_limit"]), span / self._lag)
        self.low = np.array([-fastest, float(plant["drive_min"])])
        self.high = np.array([fastest, float(plant["drive_max"])])
        width = 2 * (len(self._carried) + len(_MOVED))
        self._beside = Batch(width * _AT_ONCE, quiet)
        for name in ("plant", "observer"):
            self._beside.environments[name] = self._first[name]

    @property
    def interval_s(self) -> float:
        """Control interval [s]."""
        return self._one.interval_s

    @property
    def intervals(self) -> int:
        """Control intervals of the episode."""
        return self._length

    def sail(
        self, commands: NDArray[np.float64], begin: Any = None
    ) -> tuple[NDArray[Any], NDArray[np.float64], Any]:
        """The environment at the beginning of each interval, its rewards and its actions.

        Args:
            commands: rate of the blades [1/s] and rack [mm], shape (k, 2).
            begin: the environment where they begin; that of the episode's beginning by default.
        """
        one = self._one
        one.environments[:] = self._first if begin is None else begin
        before = np.zeros(len(commands), _CARRIED)
        rewards = np.zeros(len(commands))
        acted = np.zeros((len(commands), 2), np.float32)
        for k, (rate, rack) in enumerate(commands):
            now = one.environments[0]
            for name in _CARRIED.names or ():
                before[name][k] = now[name]
            pitch = float(now["state"]["pitch_ratio"]) + self._lag * rate
            acted[k] = actions(self._plant, np.array([pitch]), np.array([rack]))[0]
            one.step(acted[k : k + 1])
            rewards[k] = now["reward"]
            if now["ended"] != RUNNING:
                break  # the failure's reward is below that of any episode that runs on
        return before, rewards, acted

    def gradient(self, commands: NDArray[np.float64], before: NDArray[Any]) -> NDArray[np.float64]:
        """Of the sum of the rewards by the commands, shape (k, 2); see the module.

        Args:
            commands: shape (k, 2).
            before: from :meth:`sail`.
        """
        count = len(self._carried)
        ends = np.zeros((len(commands), count, count + len(_MOVED)))
        reward = np.zeros((len(commands), count + len(_MOVED)))
        for first in range(0, len(commands), _AT_ONCE):
            part = slice(first, min(first + _AT_ONCE, len(commands)))
            ends[part], reward[part] = self._slopes(commands[part], before[part])
        found = np.zeros_like(commands)
        adjoint = np.zeros(count)
        for k in reversed(range(len(commands))):
            slope = reward[k] + ends[k].T @ adjoint
            adjoint, found[k] = slope[:count], slope[count:]
        return found

    def _slopes(
        self, commands: NDArray[np.float64], before: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How end and reward of intervals follow their beginning and commands.

        Returns:
            Shapes (k, c, c + 2) and (k, c + 2), for c numbers that are carried.
        """
        n, count, beside = len(commands), len(self._carried), self._beside
        width = 2 * (count + len(_MOVED))
        rows = beside.environments[: n * width]
        for name in _CARRIED.names or ():
            rows[name] = np.repeat(before[name], width)
        given = np.repeat(commands, width, axis=0)
        for j, ((record, field), scale) in enumerate(self._carried):
            values = rows[record][field]
            values[2 * j :: width] += scale
            values[2 * j + 1 :: width] -= scale
        for j, scale in enumerate(_MOVED):
            given[2 * (count + j) :: width, j] += scale
            given[2 * (count + j) + 1 :: width, j] -= scale
        pitch = rows["state"]["pitch_ratio"] + self._lag * given[:, 0]
        control_interval(
            rows, beside.commons, beside.gains, actions(self._plant, pitch, given[:, 1]),
            beside.steps, beside.dt, 0, len(rows),
        )  # fmt: skip
        scales = 2.0 * np.array([scale for _, scale in self._carried] + list(_MOVED))

        def slope(values: Any) -> NDArray[np.float64]:
            pairs = np.asarray(values, dtype=np.float64).reshape(n, width // 2, 2)
            return np.asarray((pairs[..., 0] - pairs[..., 1]) / scales)

        ends = np.stack([slope(rows[r][f]) for (r, f), _ in self._carried], axis=1)
        return ends, slope(rows["reward"])

    def follow(
        self, controller: Predictor, begin: Any = None, intervals: int | None = None
    ) -> NDArray[np.float64]:
        """What a controller commands, shape (k, 2): where a plan begins.

        Args:
            controller: of this ship.
            begin: as of :meth:`sail`.
            intervals: k; all of the episode by default.
        """
        one = self._one
        one.environments[:] = self._first if begin is None else begin
        commands = np.zeros((intervals or self.intervals, 2))
        state: Any = None
        for k in range(len(commands)):
            action, state = controller.predict(one.observation(), state, np.array([k == 0]))
            now = one.environments[0]
            pitch = decode(
                action[0, 0], self._plant["pitch_ratio_min"], self._plant["pitch_ratio_max"]
            )
            rate = (pitch - float(now["state"]["pitch_ratio"])) / self._lag
            commands[k] = (
                rate,
                decode(action[0, 1], self._plant["drive_min"], self._plant["drive_max"]),
            )
            one.step(action)
        return np.clip(commands, self.low, self.high)

    def plan(self, controller: Predictor, rounds: int = 300) -> Plan:
        """The best commands that are found from what a controller commands, order by order.

        Args:
            controller: of this ship.
            rounds: most gradients for each order.
        """
        interval = float(self._first["episode"]["order_interval"][0]) / self.interval_s
        given = np.ceil(np.arange(MAX_ORDERS) * interval)
        edges = [int(k) for k in given[given < self.intervals]] + [self.intervals]
        here, count = self._first.copy(), 0
        rewards, acted = [], []
        for which, (first, last) in enumerate(pairwise(edges)):
            known = here.copy()
            orders = known["episode"]["orders"][0]
            orders[which:] = orders[which]
            beyond = min(last + round(_BEYOND_S / self.interval_s), self.intervals)
            begin = self.follow(controller, known, beyond - first)
            best, taken = self._best(begin, known, rounds)
            _, gained, actions_there = self.sail(best[: last - first], here)
            here = self._one.environments.copy()
            count += taken
            rewards.append(gained)
            acted.append(actions_there)
        return Plan(np.concatenate(rewards), np.concatenate(acted), count)

    def _best(
        self, begin: NDArray[np.float64], known: Any, rounds: int
    ) -> tuple[NDArray[np.float64], int]:
        """The best commands that L-BFGS-B finds from some, and how many gradients it took."""
        span = self.high - self.low
        count = 0

        def cost(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            nonlocal count
            count += 1
            commands = self.low + span * x.reshape(-1, 2)
            before, rewards, _ = self.sail(commands, known)
            return -float(rewards.sum()), -(self.gradient(commands, before) * span).ravel()

        best, least = ((begin - self.low) / span).ravel(), np.inf
        while count < rounds:  # the reward has kinks, at which a search may stop short: begun anew
            found = scipy.optimize.minimize(
                cost, best, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * begin.size,
                options={"maxfun": rounds - count, "maxcor": 30, "ftol": 1e-7},
            )  # fmt: skip
            gained = least - float(found.fun)
            best, least = found.x, float(found.fun)
            if gained < _GAIN * abs(least):
                break
        return self.low + span * best.reshape(-1, 2), count
