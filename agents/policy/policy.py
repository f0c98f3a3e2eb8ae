"""Policy file: weights of a network, and the environment for which it was trained.

The file is a NumPy archive without pickled objects, so loading a file from another person runs no code.
A policy runs without torch.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...baselines.controller import resume_state
from ...core.archives import read_archive, write_archive
from ...envs.batch import Batch
from ...envs.settings import Settings
from ...envs.tasks import get_task
from ...plant import Ship

FORMAT = 3
"""Format of the file; it changes where an entry, an observation or an action changes its meaning."""

_ACTIVATIONS: dict[str, Callable[[Any], Any]] = {"tanh": np.tanh, "relu": partial(np.maximum, 0.0)}

INTERFACE = ("action_mode", "command")
"""Keywords of the environment that define the observations and the actions of a policy."""

MOST_FRAMES = 64


class PolicyError(ValueError):
    """A policy cannot be loaded or does not match the environment; the message says why."""


def layout(batch: Batch) -> dict[str, Any]:
    """Return the properties in which a policy and its environment must agree."""
    plant = batch.ship.record()
    ranges = (
        "pitch_ratio_min",
        "pitch_ratio_max",
        "drive_min",
        "drive_max",
        "gear_ratio",
        "engine_speed_min",
        "engine_speed_max",
    )
    return {
        "format": FORMAT,
        "ship": batch.ship.name,
        "ranges": {name: float(plant[name]) for name in ranges},
        "observed": list(batch.observed),
        "action_mode": batch.settings.action_mode,
        "command": batch.command,
        "actions": batch.actions,
    }


def _differences(own: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    said = []
    for key, value in here.items():
        found = own.get(key)
        if isinstance(value, dict) and isinstance(found, dict):
            said += _differences(found, value)
        elif found != value:
            said.append(f"{key}: the policy has {found!r}, the environment {value!r}")
    return said


def stack_frame(stack: NDArray[np.float32], frame: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return stacked observations, shape (n, frames o), with a new one, shape (n, o), at their end."""
    return np.concatenate([stack[:, frame.shape[1] :], frame], axis=1)


@dataclass(frozen=True)
class Network:
    """Multilayer perceptron.

    Args:
        weights: weights of each layer, shape (out, in).
        biases: biases of each layer, shape (out,).
        activation: ``tanh`` or ``relu`` between the layers.
        squashed: whether a tanh follows the last layer; otherwise the outputs are clipped.

    Raises:
        ValueError: the layers do not match, or a weight is not finite.

    Examples:
        >>> one = np.ones((1, 2), np.float32)
        >>> network = Network((one,), (np.zeros(1, np.float32),), "tanh", squashed=False)
        >>> network(np.array([[0.25, 0.5], [3.0, 0.0]], np.float32)).ravel().tolist()
        [0.75, 1.0]
    """

    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    activation: str
    squashed: bool

    def __post_init__(self) -> None:  # noqa: D105 (dataclasses' hook)
        arrays: list[NDArray[Any]] = [*self.weights, *self.biases]
        if not self.weights or any(array.dtype.kind != "f" for array in arrays):
            raise ValueError("the weights of the layers must be real numbers")
        if any(weight.ndim != 2 for weight in self.weights):
            raise ValueError("the weights of a layer must have two dimensions")
        widths = [self.weights[0].shape[1], *(len(bias) for bias in self.biases)]
        shapes = [(out, into) for into, out in pairwise(widths)]
        if [weight.shape for weight in self.weights] != shapes:
            raise ValueError("the shapes of the layers do not match")
        if not all(np.isfinite(array).all() for array in arrays):
            raise ValueError("a weight is not finite")
        if self.activation not in _ACTIVATIONS:
            raise ValueError(f"activation = {self.activation!r}: must be tanh or relu")

    @property
    def shape(self) -> tuple[int, int]:
        """Number of inputs and number of outputs."""
        return self.weights[0].shape[1], len(self.biases[-1])

    def __call__(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1], shape (n, outputs), for inputs of shape (n, inputs)."""
        act = _ACTIVATIONS[self.activation]
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = act(x @ weight.T + bias)
        x = x @ self.weights[-1].T + self.biases[-1]
        return np.asarray(np.tanh(x) if self.squashed else np.clip(x, -1.0, 1.0), np.float32)


class Policy:
    """Learned controller with ``predict``, as the models of stable-baselines3 have it.

    Args:
        network: network with its weights.
        about: environment, recipe and training (``layout`` and others), as JSON values.
        ship: ship to control; by default the ship of the training.
        curve: evaluations during the training: columns by name.

    Raises:
        PolicyError: the policy does not match this version, the ship or the environment.

    Examples:
        >>> policy = load_policy("storm")
        >>> policy.interval_s, policy.frames
        (0.5, 4)
    """

    def __init__(
        self,
        network: Network,
        about: Mapping[str, Any],
        ship: Ship | None = None,
        curve: Mapping[str, list[float]] | None = None,
    ) -> None:
        self.network, self.about, self.curve = network, dict(about), dict(curve or {})
        task = get_task(about["recipe"]["task"])
        self.ship = task.load_ship(about["ship_source"]) if ship is None else ship
        self.interval_s = float(about["control_interval_s"])
        own = about.get("layout", {})
        given = {key: own[key] for key in INTERFACE if key in own}
        self.interface: dict[str, Any] = {"normalised": True} | given
        self.frames = int(about["recipe"].get("frame_stack", 1))
        if not 1 <= self.frames <= MOST_FRAMES:
            raise PolicyError(f"frame_stack = {self.frames}: must be from 1 to {MOST_FRAMES}")
        batch = self.make_batch()
        self.base_controller = batch.settings.base_controller
        if said := _differences(own, layout(batch)):
            raise PolicyError("this policy does not match the environment: " + "; ".join(said))
        self._width = len(batch.observed)
        (inputs, outputs), wanted = network.shape, (self.frames * self._width, batch.actions)
        if (inputs, outputs) != wanted:
            raise PolicyError(
                f"the network has {inputs} inputs and {outputs} outputs; expected are {wanted[0]} and "
                f"{wanted[1]}"
            )

    def make_batch(self) -> Batch:
        """Return one environment for which the policy is made, without an observer."""
        task = self.about["recipe"]["task"]
        settings = {
            "ship": self.ship,
            "task": task,
            "observer": "none",
            "control_interval_s": self.interval_s,
        }
        return Batch(1, Settings.of(settings | self.interface), get_task(task).steered)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return actions for one observation or a batch of observations.

        Args:
            observation: normalised observation, shape (o,) or (n, o), of an environment with the
                keywords :attr:`interface`.
            state: second value of the last call, None at first; it is not changed.
            episode_start: mask of the environments whose episode starts, shape (n,).
            deterministic: without effect, because the file contains no exploration noise.

        Returns:
            Actions in [-1, 1], shape (a,) or (n, a), and the state for the next call.

        Raises:
            ValueError: observations with another number of signals.
        """
        table = np.atleast_2d(np.asarray(observation, dtype=np.float32))
        if table.shape[1] != self._width:
            raise ValueError(
                f"observations of {table.shape[1]} signals: the policy needs {self._width}; create the "
                f"environment with the keywords {self.interface}"
            )
        empty = np.zeros((len(table), self.frames * self._width), np.float32)
        stack = stack_frame(resume_state(state, empty, episode_start), table)
        action = self.network(stack)
        return action if np.ndim(observation) > 1 else action[0], stack

    def summary(self) -> str:
        """Return the training and its last evaluation as text."""
        recipe = self.about["recipe"]
        lines = [
            f"{recipe['algorithm'].upper()} on {recipe['task']}, ship {self.about['layout']['ship']}, "
            f"seed {self.about.get('seed')}, a command every {self.interval_s:g} s"
        ]
        if self.curve:
            last = {name: values[-1] for name, values in self.curve.items()}
            lines.append(", ".join(f"{name} {value:.4g}" for name, value in last.items()))
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return environment, recipe, training and curve as JSON values, without the weights."""
        return self.about | {"curve": self.curve}

    def save(self, path: str | Path) -> None:
        """Write one self-contained file.

        Args:
            path: file that ends in ``.npz``.
        """
        n = self.network
        layers: dict[str, Any] = {f"weight_{i}": w for i, w in enumerate(n.weights)}
        layers |= {f"bias_{i}": b for i, b in enumerate(n.biases)}
        about = self.to_dict() | {"activation": n.activation, "squashed": n.squashed}
        text = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        write_archive(Path(path), {"about": text, **layers})


def packaged_policies_folder() -> Path:
    """Return the folder of the policies of the package."""
    return Path(str(resources.files("shaftline.agents.policy").joinpath("trained")))


def packaged_policies() -> dict[str, Path]:
    """Return the policy files of the package, by name.

    Examples:
        >>> "storm" in packaged_policies()
        True
    """
    return {path.stem: path for path in sorted(packaged_policies_folder().glob("*.npz"))}


def policy_file(source: str | Path) -> Path:
    """Return the file of a policy.

    Args:
        source: file, or name of a policy of the package.

    Raises:
        PolicyError: no such policy.
    """
    path = packaged_policies().get(str(source), Path(source))
    if not path.is_file():
        raise PolicyError(
            f"{source}: no such policy file; the package contains "
            f"{', '.join(packaged_policies()) or 'none'}"
        )
    return path


def load_policy(source: str | Path, ship: Ship | None = None) -> Policy:
    """Load a policy.

    Args:
        source: file, or name of a policy of the package.
        ship: ship to control; by default the ship of the training.

    Raises:
        PolicyError: no such policy, not a policy file, or a policy that does not match.

    Examples:
        >>> load_policy("rough-sea").about["recipe"]["algorithm"]
        'ppo'
    """
    path = policy_file(source)
    try:
        archive = read_archive(path)
        about = json.loads(bytes(archive["about"]).decode())
        count = sum(name.startswith("weight_") for name in archive)
        network = Network(
            tuple(archive[f"weight_{i}"] for i in range(count)),
            tuple(archive[f"bias_{i}"] for i in range(count)),
            about["activation"],
            bool(about["squashed"]),
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise PolicyError(f"{path}: not a policy file ({error})") from None
    try:
        return Policy(network, about, ship, about.get("curve"))
    except PolicyError as error:
        raise PolicyError(f"{path}: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise PolicyError(f"{path}: not a policy file ({error!r} in its description)") from None
