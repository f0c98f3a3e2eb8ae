"""Cases of a challenge as a rival gets them, and the base class of the rivals of this package.

A rival is a class with one method, ``analyse``, from a case to its entry of a submission
(:mod:`.submission`). Rivals of other people need not derive from :class:`Rival`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd

from ...core.discovery import classes_in, load_external_class
from ...plant import Ship, simulate_recording
from ...plant.columns import DEMANDS, TIME
from ..recording import CHANNELS

RECORDING, INPUTS, SIMULATION = "recording.csv", "held_out_inputs.csv", "simulation.csv"
SHIP, REFERENCE = "ship.toml", "reference.csv"
"""Files of a case: fitted part, inputs of the held-out part, simulation of the ship file over both
parts, ship file, and recording of a reference period (variant realistic only)."""

GROUP = "shaftline.rivals"
"""Group of entry points for rivals of other packages."""

_COMMANDS = (*(demand.column for demand in DEMANDS), "pitch_ratio_command")
COMMANDS = tuple(column for column in _COMMANDS if column not in CHANNELS)
"""Commands to the ship. The shaft speed, a command of some drives, is measured in all cases."""

WATER = "propeller_submergence_m"
_STATES = ("pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s")


def input_names(recording: pd.DataFrame) -> list[str]:
    """Return the columns of a recording that drive the ship: time, commands, and the submergence."""
    return [name for name in recording if name in (TIME, *COMMANDS, WATER)]


def simulate_inputs(ship: Ship, recording: pd.DataFrame, inputs: pd.DataFrame) -> pd.DataFrame:
    """Return the open-loop simulation of a ship over the fitted and the held-out part.

    The simulation starts from the first measurements of the recording and uses no later one. The water
    is calm, except for a recorded submergence of the propeller.

    Args:
        ship: the ship.
        recording: fitted part, with measurements.
        inputs: inputs of the held-out part.

    Returns:
        The time and each measured channel of the recording, shape (rows of both parts,).
    """
    table = pd.concat([recording[inputs.columns], inputs], ignore_index=True)
    channels = [name for name in CHANNELS if name in recording]
    for name in {*_STATES, *channels} & {*recording}:
        table[name] = float(recording[name].iloc[0])
    return simulate_recording(ship, table)[[TIME, *channels]]


@dataclass(frozen=True)
class ChallengeCase:
    """Case of a challenge, read from its folder.

    Args:
        folder: folder of the case.
    """

    folder: Path

    @property
    def name(self) -> str:
        """Name of the case, such as ``case-003``."""
        return self.folder.name

    @cached_property
    def recording(self) -> pd.DataFrame:
        """Fitted part: time, commands and measurements."""
        return pd.read_csv(self.folder / RECORDING)

    @cached_property
    def inputs(self) -> pd.DataFrame:
        """Inputs of the held-out part, which follows the fitted part."""
        return pd.read_csv(self.folder / INPUTS)

    @cached_property
    def simulation(self) -> pd.DataFrame:
        """Simulation of the ship file over both parts, at the rows of both."""
        return pd.read_csv(self.folder / SIMULATION)

    @property
    def channels(self) -> list[str]:
        """Channels that a prediction may have: the measured channels of the simulation."""
        return [name for name in self.simulation if name != TIME]

    @property
    def ship(self) -> Path:
        """Ship file (TOML)."""
        return self.folder / SHIP

    @property
    def reference(self) -> Path | None:
        """Recording of a reference period without missing physics; None if the case has none."""
        path = self.folder / REFERENCE
        return path if path.is_file() else None

    @property
    def simulated_held_out(self) -> pd.DataFrame:
        """Rows of the simulation in the held-out part."""
        return self.simulation.iloc[len(self.recording) :].reset_index(drop=True)

    def predict(self, ship: Ship) -> dict[str, list[float]]:
        """Return the held-out channels as a ship without measurements gives them, for an entry."""
        rows = simulate_inputs(ship, self.recording, self.inputs).iloc[len(self.recording) :]
        return {name: rows[name].tolist() for name in self.channels}


class Rival(ABC):
    """Method that takes part in a challenge."""

    name: ClassVar[str]
    requires: ClassVar[str] = ""
    """Optional library without which the rival does not run."""

    @abstractmethod
    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the entry of a case, with the keys of :class:`.submission.CaseEntry`."""


def rivals() -> dict[str, type[Rival]]:
    """Return the rivals of the package by name."""
    own = classes_in(__name__.rpartition(".")[0], Rival)  # type: ignore[type-abstract]
    return {rival.name: rival for rival in own}


def load_rival(name: str) -> type[Any]:
    """Return the class of a rival.

    Args:
        name: name of one of :func:`rivals`, or ``module:Class``; the module's import executes it.

    Raises:
        ValueError: unknown, not importable, without the method ``analyse``, or a library is missing.
    """
    own = rivals()
    if name in own:
        needed = own[name].requires
        if needed and find_spec(needed) is None:
            raise ValueError(
                f"rival {name}: needs the library {needed}: pip install 'shaftline[rivals]'"
            )
        return own[name]
    found = load_external_class(name, GROUP)
    if found is None:
        raise ValueError(
            f"rival {name}: unknown; known: {', '.join(own)}, or yours as module:Class"
        )
    if not isinstance(found, type) or not callable(getattr(found, "analyse", None)):
        raise ValueError(f"rival {name}: must be a class with the method analyse(case)")
    return found


def entry_of(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry of a submission from a report like ``report.json``."""
    location = report.get("location") or {}
    named = report["verdict"] in ("explained", "partly-explained")
    return {
        "verdict": report["verdict"],
        "balances": [name.strip() for name in location.get("balances") or []],
        "windows_s": list(location.get("windows_s") or []),
        "effects": [_effect(effect) for effect in report["effects"]] if named else [],
    }


def _effect(effect: Mapping[str, Any]) -> dict[str, Any]:
    parameters = {}
    for name, found in effect["parameters"].items():
        if found.get("value") is not None:
            ends = found.get("ci95") or [None]
            parameters[name] = {"value": found["value"]}
            parameters[name] |= {} if None in ends else {"ci95": list(ends)}
    return {
        "id": effect["id"],
        "equivalent_ids": list(effect.get("equivalent_ids") or []),
        "parameters": parameters,
    }
