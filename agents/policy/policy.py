"""A learned policy as one file, and as a controller: weights, normalisation, and what it was made for.

The file is a NumPy archive without pickled objects, so it can be loaded from anyone, and sailed without
torch.
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

from ...baselines.controller import OBSERVED, Controller, Readings
from ...core.archives import read_archive, write_archive
from ...envs.tasks import get_task
from ...plant import Ship
from .residual import ANSWERS, Form, Residual

FORMAT = 2
"""Of the file: it changes where what stands in it does, or what a policy sees or answers means."""

_ACTIVATIONS: dict[str, Callable[[Any], Any]] = {"tanh": np.tanh, "relu": partial(np.maximum, 0.0)}


class PolicyError(ValueError):
    """A policy that cannot be loaded or does not belong here; the message says what differs."""


def layout(ship: Ship, form: Form) -> dict[str, Any]:
    """What a policy and the ship it commands must agree on."""
    plant = ship.record()
    ranges = ("pitch_ratio_min", "pitch_ratio_max", "drive_min", "drive_max", "gear_ratio",
              "engine_speed_min", "engine_speed_max")  # fmt: skip
    return {
        "format": FORMAT,
        "ship": ship.name,
        "ranges": {name: float(plant[name]) for name in ranges},
        "observed": list(OBSERVED),
        "features": list(form.features),
        "answers": list(ANSWERS),
    }


def _differences(own: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    said = []
    for key, value in here.items():
        found = own.get(key)
        if isinstance(value, dict) and isinstance(found, dict):
            said += _differences(found, value)
        elif found != value:
            said.append(f"{key}: the policy has {found!r}, here it is {value!r}")
    return said


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron behind a normalisation.

    Args:
        mean: of the features, shape (f,).
        deviation: their standard deviation; infinite where a feature never varied in training.
        clip: of the normalised features.
        weights: of each layer, shape (out, in).
        biases: shape (out,).
        activation: ``tanh`` or ``relu`` between the layers.
        squashed: whether a tanh stands behind the last layer.
        log_deviation: of the answers' noise in training, shape (2,).

    Raises:
        ValueError: the layers do not fit together, or hold what is no finite number.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    clip: float
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    activation: str
    squashed: bool
    log_deviation: NDArray[np.float32]

    def __post_init__(self) -> None:  # noqa: D105 (dataclasses' hook)
        stored = (self.mean, self.deviation, self.log_deviation)
        arrays: list[NDArray[Any]] = [*self.weights, *self.biases, *stored]
        if not self.weights or any(array.dtype.kind != "f" for array in arrays):
            raise ValueError("layers of real numbers are needed")
        widths = [len(self.mean), *(len(bias) for bias in self.biases)]
        shapes = [(out, into) for into, out in pairwise(widths)]
        if [weight.shape for weight in self.weights] != shapes or widths[-1] != len(ANSWERS):
            raise ValueError("its layers do not fit together")
        if [array.shape for array in stored] != [(widths[0],), (widths[0],), (widths[-1],)]:
            raise ValueError("its normalisation does not fit its layers")
        finite = (array for array in arrays if array is not self.deviation)
        if not (all(np.isfinite(a).all() for a in finite) and (self.deviation > 0.0).all()):
            raise ValueError("a weight is not finite")
        if not self.clip > 0.0 or self.activation not in _ACTIVATIONS:
            raise ValueError(f"clip = {self.clip}, activation = {self.activation!r}")

    def __call__(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean answers, shape (n, 2)."""
        x = np.clip((features - self.mean) / self.deviation, -self.clip, self.clip)
        x = x.astype(np.float32)
        act = _ACTIVATIONS[self.activation]
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = act(x @ weight.T + bias)
        x = x @ self.weights[-1].T + self.biases[-1]
        return np.asarray(np.tanh(x) if self.squashed else np.clip(x, -1.0, 1.0))


class Policy(Controller):
    """A learned controller.

    Args:
        network: its weights.
        about: what it was made for and with (``layout`` and the training), as JSON allows.
        ship: that it shall command; the one that it was trained on by default.
        curve: evaluations while it was trained: columns by name.

    Raises:
        PolicyError: it does not belong to this version, ship or observation.
    """

    def __init__(
        self,
        network: Network,
        about: Mapping[str, Any],
        ship: Ship | None = None,
        curve: Mapping[str, list[float]] | None = None,
    ) -> None:
        self.network, self.about, self.curve = network, dict(about), dict(curve or {})
        vessel = trained_on(about) if ship is None else ship
        form = Form(**about["recipe"].get("form", {}))
        if said := _differences(about.get("layout", {}), layout(vessel, form)):
            raise PolicyError("this policy does not fit: " + "; ".join(said))
        super().__init__(vessel, float(about["control_interval_s"]))
        self.adapter = Residual(vessel, self.interval_s, form)
        if len(network.mean) != len(form.features):
            raise PolicyError(
                f"it hears {len(network.mean)} features, where its form has {len(form.features)}"
            )

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """Memory of what is seen for the first time."""
        return self.adapter.fresh(seen)

    def act(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What the base commands, and the network's mean answers beside it."""
        answer = self.network(self.adapter.take_in(seen, memory))
        return self.adapter.set_points(answer, seen, memory)

    def explore(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same with the noise that the answers had in training."""
        answer = self.network(self.adapter.take_in(seen, memory))
        noise = np.random.default_rng().standard_normal(answer.shape)
        answer = answer + np.exp(self.network.log_deviation) * noise.astype(np.float32)
        return self.adapter.set_points(answer, seen, memory)

    def summary(self) -> str:
        """What it was trained on, and how it was judged on the way, as text."""
        recipe = self.about["recipe"]
        lines = [
            f"{recipe['algorithm'].upper()} on {recipe['task']}, ship {self.about['layout']['ship']}, "
            f"seed {self.about.get('seed')}, a command every {self.about['control_interval_s']:g} s"
        ]
        if self.curve:
            last = {name: values[-1] for name, values in self.curve.items()}
            lines.append(", ".join(f"{name} {value:.4g}" for name, value in last.items()))
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """What it was made for and with, and its curve, as JSON allows; the weights stay in the file."""
        return self.about | {"curve": self.curve}

    def save(self, path: str | Path) -> None:
        """Write one self-contained file."""
        n = self.network
        layers: dict[str, Any] = {f"weight_{i}": w for i, w in enumerate(n.weights)}
        layers |= {f"bias_{i}": b for i, b in enumerate(n.biases)}
        about = self.about | {
            "activation": n.activation, "squashed": n.squashed, "clip": n.clip, "curve": self.curve,
        }  # fmt: skip
        text = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        layers |= {"mean": n.mean, "deviation": n.deviation, "log_deviation": n.log_deviation}
        write_archive(Path(path), {"about": text, **layers})


def trained_on(about: Mapping[str, Any]) -> Ship:
    """The ship of a policy's training, as its task has it."""
    return get_task(about["recipe"]["task"]).sailed(about["ship_source"])


def trained() -> dict[str, Path]:
    """Policies that come with the package, by name."""
    folder = Path(str(resources.files("shaftline.agents.policy").joinpath("trained")))
    return {path.stem: path for path in sorted(folder.glob("*.npz"))}


def load_policy(source: str | Path, ship: Ship | None = None) -> Policy:
    """Load a policy.

    Args:
        source: file, or name of one that comes with the package.
        ship: that it shall command; the one that it was trained on by default.

    Raises:
        PolicyError: no such policy, not a policy file, or one that does not fit.
    """
    path = trained().get(str(source), Path(source))
    if not path.is_file():
        raise PolicyError(
            f"{source}: no such policy file; with the package come {', '.join(trained()) or 'none'}"
        )
    try:
        archive = read_archive(path)
        about = json.loads(bytes(archive["about"]).decode())
        count = sum(name.startswith("weight_") for name in archive)
        network = Network(
            archive["mean"], archive["deviation"], float(about["clip"]),
            tuple(archive[f"weight_{i}"] for i in range(count)),
            tuple(archive[f"bias_{i}"] for i in range(count)),
            about["activation"], bool(about["squashed"]), archive["log_deviation"],
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise PolicyError(f"{path}: not a policy file ({error})") from None
    try:
        return Policy(network, about, ship, about.get("curve"))
    except PolicyError as error:
        raise PolicyError(f"{path}: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise PolicyError(
            f"{path}: not a policy file ({error!r} in what it was made for)"
        ) from None
