"""Clairvoyant bound of a task: optimal commands for an episode that is known in advance.

Waves and resistance of the episode are given, and the commands of all its control intervals are
optimised together, so that the sum of the rewards is highest. An order becomes known when it is given:
until then the plan assumes that the present order holds, otherwise it would start to accelerate too
early. No controller on board can know as much, so the result is a bound against which controllers are
compared. It is a local optimum, found from the commands of a classic controller, so the true optimum can
be higher.

The environment kernel is the model. Central differences of that kernel give the derivatives of an
interval's reward and final state with respect to its initial state and commands. The adjoint recursion
gives the gradient of the sum (Bryson & Ho 1975, section 2.2):

    lambda_k = r_x + A_k^T lambda_k+1,     dJ/du_k = r_u + B_k^T lambda_k+1

The first command is a rate of the blades, u_1 = (P_d - p) / tau_p, within the limits of the actuator: a
pitch command far from the pitch does not move the blades faster and would have no gradient.
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
from ...plant.together import GROUP
from ...plant.waves import SEA

_FAST = 1.3
"""Bound of the pitch rate over that of the actuator: the blades reach a command in an interval."""

_MEMORIES = {
    ("memory", "rack"): 1e-2,
    ("episode", "drive"): 1e-2,
    ("episode", "mean_speed"): 1e-3,
    ("episode", "mean_torque"): 10.0,
    ("episode", "mean_brake_torque"): 10.0,
    ("episode", "mean_attack"): 1e-3,
}
"""Quantities beside the states that pass from interval to interval, with their difference steps."""

_STATES = {
    "pitch_ratio": 1e-4,
    "shaft_speed": 1e-3,
    "ship_speed": 1e-3,
    "position": 1e-2,
    "brake_torque": 10.0,
    "inflow": 1e-3,
}
_SHARE = 1e-3  # difference step of states that are shares
_COMMAND_STEPS = (1e-4, 1e-2)  # difference steps of the pitch rate [1/s] and the rack [mm]
_AT_ONCE = 16  # intervals whose derivatives are computed in one call
_GAIN = 1e-3  # relative gain below which the optimiser is not restarted
_BEYOND_S = 30.0  # horizon of a plan beyond its order, so that the end state stays useful
_CARRIED = np.dtype([("state", STATE), ("memory", MEMORY), ("sea", SEA), ("episode", EPISODE)])


class Plan(NamedTuple):
    """Optimised commands of an episode.

    Examples:
        >>> import numpy as np
        >>> plan = Plan(np.array([0.9, 1.0]), np.zeros((2, 2), np.float32), rounds=20)
        >>> float(plan.rewards.sum())
        1.9
    """

    rewards: NDArray[np.float64]  # reward of each control interval, shape (k,)
    actions: NDArray[np.float32]  # shape (k, 2)
    rounds: int  # number of gradients that were computed


class Clairvoyant:
    """Optimiser of the commands of one episode; see the module.

    Args:
        settings: settings of the environment; noise and observer have no effect.
        seed: seed of the episode, as of ``reset`` of the environment.

    Raises:
        ValueError: invalid settings, an episode without an end, or a ship with a fixed pitch.
    """

    def __init__(self, settings: Settings, seed: int) -> None:
        quiet = settings.model_copy(
            update={"sensor_noise": 0.0, "observer": "none", "tuning": None} | CLASSIC
        )
        if quiet.max_episode_steps is None:
            raise ValueError("max_episode_steps = None: a plan needs an episode with an end")
        if quiet.order_profile is not None:
            raise ValueError("order_profile: a plan follows the orders of its task; give None")
        self._one = one = Batch(1, quiet)
        self.intervals = quiet.max_episode_steps  # number of control intervals of the episode
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
        width = 2 * (len(self._carried) + len(_COMMAND_STEPS))
        self._beside = Batch(width * _AT_ONCE, quiet)
        for name in ("plant", "observer"):
            self._beside.environments[name] = self._first[name]

    @property
    def interval_s(self) -> float:
        """Control interval [s]."""
        return self._one.interval_s

    def simulate(
        self, commands: NDArray[np.float64], begin: Any = None
    ) -> tuple[NDArray[Any], NDArray[np.float64], Any]:
        """Return the state of the environment before each interval, the rewards and the actions.

        Args:
            commands: rate of the blades [1/s] and rack [mm], shape (k, 2).
            begin: environment at the start; by default that at the start of the episode.
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
                break  # A failed episode has a lower reward than any that continues.
        return before, rewards, acted

    def gradient(self, commands: NDArray[np.float64], before: NDArray[Any]) -> NDArray[np.float64]:
        """Return the gradient of the sum of the rewards with respect to the commands, shape (k, 2).

        Args:
            commands: rate of the blades [1/s] and rack [mm], shape (k, 2).
            before: states from :meth:`simulate`.
        """
        count = len(self._carried)
        ends = np.zeros((len(commands), count, count + len(_COMMAND_STEPS)))
        reward = np.zeros((len(commands), count + len(_COMMAND_STEPS)))
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
        """Return the derivatives of final state and reward of intervals by initial state and commands.

        The shapes are (k, c, c + 2) and (k, c + 2), for c carried quantities.
        """
        n, beside = len(commands), self._beside
        width = 2 * (len(self._carried) + len(_COMMAND_STEPS))
        rows = beside.environments[: n * width]
        for name in _CARRIED.names or ():
            rows[name] = np.repeat(before[name], width)
        given = np.repeat(commands, width, axis=0)
        varied = [(rows[record][field], scale) for (record, field), scale in self._carried]
        varied += [(given[:, j], scale) for j, scale in enumerate(_COMMAND_STEPS)]
        for j, (values, scale) in enumerate(varied):
            values[2 * j :: width] += scale
            values[2 * j + 1 :: width] -= scale
        pitch = rows["state"]["pitch_ratio"] + self._lag * given[:, 0]
        control_interval(
            rows,
            rows["plant"],
            rows["state"],
            beside.commons,
            np.zeros(1, GROUP)[0],
            beside.gains,
            actions(self._plant, pitch, given[:, 1]),
            beside.steps,
            beside.dt,
            0,
            len(rows),
        )
        scales = 2.0 * np.array([scale for _, scale in varied])

        def slope(values: Any) -> NDArray[np.float64]:
            pairs = np.asarray(values, dtype=np.float64).reshape(n, width // 2, 2)
            return np.asarray((pairs[..., 0] - pairs[..., 1]) / scales)

        ends = np.stack([slope(rows[r][f]) for (r, f), _ in self._carried], axis=1)
        return ends, slope(rows["reward"])

    def commands_of(
        self, controller: Predictor, begin: Any = None, intervals: int | None = None
    ) -> NDArray[np.float64]:
        """Return the commands of a controller as the initial value of a plan, shape (k, 2).

        Args:
            controller: controller of this ship.
            begin: environment at the start, as in :meth:`simulate`.
            intervals: number k of intervals; all of the episode by default.
        """
        one = self._one
        one.environments[:] = self._first if begin is None else begin
        commands = np.zeros((intervals or self.intervals, 2))
        state: Any = None
        for k in range(len(commands)):
            action, state = controller.predict(one.observation(), state, np.array([k == 0]))
            now = one.environments[0]
            low, high = self._plant["pitch_ratio_min"], self._plant["pitch_ratio_max"]
            pitch = decode(action[0, 0], low, high)
            rate = (pitch - float(now["state"]["pitch_ratio"])) / self._lag
            rack = decode(action[0, 1], self._plant["drive_min"], self._plant["drive_max"])
            commands[k] = rate, rack
            one.step(action)
        return np.clip(commands, self.low, self.high)

    def plan(self, controller: Predictor, rounds: int = 300) -> Plan:
        """Return the optimised commands, starting from those of a controller, one order after another.

        Args:
            controller: controller of this ship.
            rounds: largest number of gradients for each order.
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
            begin = self.commands_of(controller, known, beyond - first)
            best, taken = self._best(begin, known, rounds)
            _, gained, actions_there = self.simulate(best[: last - first], here)
            here = self._one.environments.copy()
            count += taken
            rewards.append(gained)
            acted.append(actions_there)
        return Plan(np.concatenate(rewards), np.concatenate(acted), count)

    def _best(
        self, begin: NDArray[np.float64], known: Any, rounds: int
    ) -> tuple[NDArray[np.float64], int]:
        """Return the commands that L-BFGS-B finds from initial ones, and the number of gradients."""
        span = self.high - self.low
        count = 0

        def cost(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            nonlocal count
            count += 1
            commands = self.low + span * x.reshape(-1, 2)
            before, rewards, _ = self.simulate(commands, known)
            return -float(rewards.sum()), -(self.gradient(commands, before) * span).ravel()

        best, least = ((begin - self.low) / span).ravel(), np.inf
        while count < rounds:  # The reward has kinks at which L-BFGS-B can stop early: restart it.
            found = scipy.optimize.minimize(
                cost,
                best,
                jac=True,
                method="L-BFGS-B",
                bounds=[(0.0, 1.0)] * begin.size,
                options={"maxfun": rounds - count, "maxcor": 30, "ftol": 1e-7},
            )
            gained = least - float(found.fun)
            best, least = found.x, float(found.fun)
            if gained < _GAIN * abs(least):
                break
        return self.low + span * best.reshape(-1, 2), count
