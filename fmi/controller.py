"""An FMU as a controller of the fuel rack and the pitch, in the form of the classic controllers.

An FMU contains machine code, which runs in this process with the rights of the user. The constructor
of :class:`FmuController` parses the description alone; the first prediction loads the code.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED, actions, measurements_of
from ..core.archives import refuse_large_archive
from ..core.files import reason_of, refuse_special
from ..plant.columns import drive_column
from ..plant.ship import Ship
from ..plant.signals import get_signal
from .archive import FmuError
from .description import base_unit, measured_column

_LARGEST = 500_000_000  # of an unpacked FMU [bytes]
_PITCH = "pitch_ratio_command"


class FmuController:
    """Compute pitch and fuel rack by an FMU for co-simulation (FMI 2.0), one instance for each ship.

    The inputs of the FMU are some of the measurements of a classic controller, its outputs the commands,
    all with the names and units of the signal registry. Each control interval the FMU receives the
    measurements at its start and makes one communication step; the outputs at the end are the commands
    of this interval, as if the computation took no time.

    Args:
        path: file, whose machine code the first prediction executes.
        ship: ship to control.
        interval_s: control interval [s], the communication step.

    Raises:
        FmuError: the file is no FMU for co-simulation by FMI 2.0 or has no binary for this platform, or
            a variable is missing, unknown or has another unit.
    """

    name = "fmu"

    def __init__(self, path: Path, ship: Ship, interval_s: float) -> None:
        self.path, self.interval_s, self.plant = path, interval_s, ship.record()
        self._description = _read_description(path)
        measured = {measured_column(name): k for k, name in enumerate(OBSERVED)}
        units = {measured_column(name): get_signal(name).unit for name in OBSERVED}
        commands = {drive_column(ship): ship.prime_mover.demand.unit}
        if ship.has_variable_pitch:
            commands[_PITCH] = get_signal("pitch_command").unit
        variables = self._description.modelVariables
        inputs = {v.name: v for v in variables if v.causality == "input"}
        outputs = {v.name: v for v in variables if v.causality == "output"}
        if unknown := [name for name in inputs if name not in measured]:
            raise FmuError(
                f"{path}: the input {unknown[0]} is unknown. The inputs of a controller can be "
                f"{', '.join(measured)}"
            )
        if missing := [name for name in commands if name not in outputs]:
            raise FmuError(
                f"{path}: the output {missing[0]} [{commands[missing[0]]}] is missing. The outputs of "
                f"a controller of {ship.name} must be {' and '.join(commands)}"
            )
        for name, variable in inputs.items():
            self._check(variable, units[name])
        for name, unit in commands.items():
            self._check(outputs[name], unit)
        self._columns = [measured[name] for name in inputs]
        self._inputs = [variable.valueReference for variable in inputs.values()]
        self._outputs = [outputs[name].valueReference for name in commands]
        self._forget()

    def _forget(self) -> None:
        self._folder: str | None = None
        self._instances: list[Any] = []
        self._steps = np.zeros(0, np.int64)  # of each instance since its start
        self._messages: list[str] = []

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process needs: the instances belong to this one."""
        own = ("_folder", "_instances", "_steps", "_messages")
        return {key: value for key, value in vars(self).items() if key not in own}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a controller without instances."""
        vars(self).update(state)
        self._forget()

    def _check(self, variable: Any, unit: str) -> None:
        """Refuse a variable that is not real or that declares another unit."""
        if variable.type != "Real":
            raise FmuError(f"{self.path}: {variable.name} is {variable.type}, but must be Real")
        if variable.unit is None:
            return
        declared = base_unit(variable.unit)
        for one in self._description.unitDefinitions:
            if one.name == variable.unit and (base := one.baseUnit) is not None:
                names = ("kg", "m", "s", "A", "rad")
                declared = base.factor, {n: getattr(base, n) for n in names if getattr(base, n)}
        if variable.unit != unit and not _equal(declared, base_unit(unit)):
            raise FmuError(
                f"{self.path}: {variable.name} has the unit {variable.unit}, but must have {unit}; "
                "convert it in the FMU"
            )

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return the actions for one observation or a batch, as the classic controllers do.

        The state of an FMU is inside the FMU. The returned state only counts its steps, and a state
        other than the last one is refused.

        Args:
            observation: measurements in physical units, shape (8,) or (n, 8).
            state: second value of the last call, None at first.
            episode_start: mask of the ships whose episode starts, shape (n,).
            deterministic: without effect.

        Returns:
            Actions in [-1, 1], shape (2,) or (n, 2), and the state for the next call.

        Raises:
            FmuError: a function of the FMU reports an error; the message is that of the FMU.
            ValueError: the state is not that of the last call.
        """
        measurements_of(observation)  # checks their number and that they are in physical units
        rows = np.atleast_2d(np.asarray(observation, np.float64))[:, self._columns]
        starts = np.ones(len(rows), bool)
        if state is not None:
            if not np.array_equal(state, self._steps):
                raise ValueError(
                    f"{self.path}: an FMU continues only from its last step; call predict in order, "
                    "with the state that it returned last"
                )
            starts[:] = False if episode_start is None else episode_start
        self._instantiate(len(rows))
        if state is None:
            self._steps = np.zeros(len(rows), np.int64)
        try:
            commands = np.array([self._step(i, row, starts[i]) for i, row in enumerate(rows)])
        except self._failure as error:
            said = self._messages[-1] if self._messages else str(error)
            raise FmuError(f"{self.path}: the FMU reports an error: {said}") from None
        rack = commands[:, 0]
        pitch = commands[:, 1] if commands.shape[1] > 1 else np.zeros(len(rows))
        table = actions(self.plant, pitch, rack)
        return table if np.ndim(observation) > 1 else table[0], self._steps.copy()

    def _step(self, i: int, measured: NDArray[np.float64], starts: bool) -> list[float]:
        """Return the commands of one instance for the measurements at the start of an interval."""
        instance = self._instances[i]
        if starts:
            instance.reset()
            instance.setupExperiment(startTime=0.0)
            instance.enterInitializationMode()
            instance.setReal(self._inputs, measured)
            instance.exitInitializationMode()
            self._steps[i] = 0
        instance.setReal(self._inputs, measured)
        instance.doStep(self._steps[i] * self.interval_s, self.interval_s)
        self._steps[i] += 1
        commands: list[float] = instance.getReal(self._outputs)
        if not np.isfinite(commands).all():
            raise FmuError(f"{self.path}: a command of the FMU is not finite: {commands}")
        return commands

    def _instantiate(self, count: int) -> None:
        """Load the machine code of the FMU and make ``count`` instances."""
        from fmpy import extract
        from fmpy.fmi1 import FMICallException
        from fmpy.simulation import instantiate_fmu

        self._failure = FMICallException
        slave = self._description.coSimulation
        if count > 1 and slave.canBeInstantiatedOnlyOncePerProcess:
            raise FmuError(
                f"{self.path}: the FMU can be instantiated only once in a process; evaluate one "
                "episode (--seeds 1)"
            )
        if self._folder is None:
            self._folder = tempfile.mkdtemp(prefix="shaftline-fmu-")
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
            extract(str(self.path), self._folder)

        def log(_: Any, __: Any, status: int, ___: Any, text: bytes) -> None:
            self._messages.append(text.decode(errors="replace"))

        while len(self._instances) < count:
            try:
                made = instantiate_fmu(self._folder, self._description, "CoSimulation", logger=log)
            except Exception as error:  # FMPy raises plain exceptions
                said = self._messages[-1] if self._messages else reason_of(error)
                raise FmuError(f"{self.path}: cannot be loaded: {said}") from None
            self._instances.append(made)


def _equal(one: Any, other: Any) -> bool:
    """Whether two units are the same; radian counts as 1."""
    if one is None or other is None:
        return False
    first, second = ({n: k for n, k in unit[1].items() if n != "rad"} for unit in (one, other))
    return first == second and abs(one[0] / other[0] - 1.0) < 1e-9


def _read_description(path: Path) -> Any:
    """Return the description of an FMU for co-simulation by FMI 2.0, without running its code."""
    try:
        from fmpy import platform, read_model_description, supported_platforms
    except ModuleNotFoundError as error:
        raise FmuError(
            f"an FMU as controller needs {error.name}, which is not installed: pip install "
            "'shaftline[fmi]'"
        ) from None
    refuse_special(path)
    if not path.is_file():
        raise FmuError(f"{path}: no such FMU")
    try:
        refuse_large_archive(path, _LARGEST, FmuError)
        description = read_model_description(str(path))
        platforms = supported_platforms(str(path))
    except FmuError:
        raise
    except Exception as error:  # zipfile, lxml and FMPy raise many kinds of errors
        raise FmuError(f"{path}: not a valid FMU: {reason_of(error)[:500]}") from None
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        kind = "model exchange" if description.coSimulation is None else "co-simulation"
        raise FmuError(
            f"{path}: is an FMU for {kind} by FMI {description.fmiVersion}; a controller must be one "
            "for co-simulation by FMI 2.0"
        )
    if platform not in platforms:
        raise FmuError(
            f"{path}: has no binary for {platform}, only for {', '.join(platforms) or 'none'}"
        )
    return description
