"""Thrust controller with torque-loss compensation and anti-spin (Pivano et al. 2008, section 4).

"A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin", brought
from an electric motor on a towing carriage to a diesel engine and a controllable-pitch propeller: the
motor torque that the law asks for is turned into a fuel rack by the engine's own map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from ..plant.signals import get_signal
from .anti_spin_kernel import ANTI_SPIN_MEMORY, CONTROLLER, control_all
from .combinator import combinator_curve
from .controller import OBSERVED, Controller, Readings
from .torque_loss import TorqueLossObserver
from .ventilation_detection import VentilationDetector

_BOUNDS = np.array([get_signal(name).high for name in OBSERVED])


def check_gains(
    gamma: float, proportional: float, integral: float, inertia: float, viscous: float
) -> None:
    """Refuse gains of the law (21) that violate the paper's conditions B1 to B3.

    Args:
        gamma: [1/s].
        proportional: k_P [N m s/rad].
        integral: k_I [N m/rad].
        inertia: J_m of the whole shaft line [kg m2].
        viscous: k_f2 [N m s/rad].

    Raises:
        ValueError: a gain is not finite or a condition is violated; the message names it.
    """
    if not all(map(math.isfinite, (gamma, proportional, integral))):
        raise ValueError("anti-spin: every gain must be a finite number")
    if not gamma > 0.0:
        raise ValueError(f"anti-spin: condition B1 is violated: gamma = {gamma:g} 1/s must be > 0")
    least = max(0.0, gamma * inertia - viscous)
    if not proportional > least:
        raise ValueError(
            f"anti-spin: condition B2 is violated: k_P = {proportional:g} N m s/rad must exceed "
            f"{least:g}, the larger of 0 and gamma J_m - k_f2"
        )
    least = max(0.0, -inertia * gamma * gamma + gamma * viscous)
    if not integral > least:
        raise ValueError(
            f"anti-spin: condition B3 is violated: k_I = {integral:g} N m/rad must exceed "
            f"{least:g}, the larger of 0 and -J_m gamma^2 + gamma k_f2"
        )


@dataclass(frozen=True)
class AntiSpinTuning:
    """Numbers of the controller; the paper prints none but omega_v,opt, for its own 25 cm propeller."""

    gamma: float = 0.1  # [1/s]
    proportional_rate: float = 0.6  # k_P / J_m [1/s]
    integral_rate: float = 0.05  # k_I / J_m [1/s2]
    cutoff_rad_s: float = 1.5  # omega_c of the reference filter [rad/s]
    damping: float = 1.0  # xi of the reference filter [-]
    ventilated_speed: float = 0.92  # omega_v,opt over the order's calm-water shaft speed [-]
    top_speed: float = 1.0  # highest desired shaft speed over the engine's highest [-]
    highest_advance: float = 0.9  # highest J-hat over P/D in G_QT: beyond, thrust nears zero [-]
    observer: TorqueLossObserver = field(default_factory=TorqueLossObserver)  # of the torque loss
    detector: VentilationDetector = field(default_factory=VentilationDetector)  # of air


def _tuned(tuning: AntiSpinTuning, numbers: dict[str, float]) -> AntiSpinTuning:
    """The tuning with some numbers of its own or of its parts replaced."""
    rest, parts = dict(numbers), {}
    for name in ("observer", "detector"):
        part = getattr(tuning, name)
        own = {f.name: rest.pop(f.name) for f in fields(part) if f.name in rest}
        parts[name] = replace(part, **own)
    return replace(tuning, **parts, **rest)  # type: ignore[arg-type]


class AntiSpin(Controller):
    """Holds the thrust that the order takes in calm water, and the shaft speed where air comes in.

    A reading that is not finite, or beyond the bounds of the signal registry, is replaced by the last
    good one of that ship, at first by that of its slowest steady state.

    Args:
        ship: a moving ship with a diesel engine and a B-series propeller, or its name.
        interval_s: control interval of the environment [s].
        anti_spin: whether ventilation limits the shaft speed; False is the paper's comparison.
        tuning: gains and thresholds.
        numbers: single numbers of the tuning, its observer or its detector by name, for example
            ``ventilated_speed=0.85, sea_margin=3.0``.

    State: an ANTI_SPIN_MEMORY array of shape (n,), new at every call, with the estimates, the detection
    and the references of this instant.

    Raises:
        TypeError: a number that the tuning does not have.
        ValueError: another kind of ship, or tuning that violates a condition of the paper.
    """

    name = "anti-spin"
    source = "Pivano et al. 2008"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"no-anti-spin": {"anti_spin": False}}

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        *,
        anti_spin: bool = True,
        tuning: AntiSpinTuning | None = None,
        **numbers: float,
    ) -> None:
        super().__init__(ship, interval_s)
        tuning = _tuned(AntiSpinTuning() if tuning is None else tuning, numbers)
        plant = self.plant
        if not self.ship.has_diesel or self.ship.propeller.model != "b-series":
            raise ValueError(f"{self.ship.name}: anti-spin needs a diesel and a B-series propeller")
        if not (tuning.ventilated_speed > 0.0 and tuning.top_speed > 0.0):
            raise ValueError("anti-spin: ventilated_speed and top_speed must be positive")
        if not (tuning.cutoff_rad_s > 0.0 and tuning.damping > 0.0):
            raise ValueError("anti-spin: the reference filter's cut-off and damping must be > 0")
        inertia = shaft_inertia(plant)
        viscous = float(plant["viscous_propeller_side"])
        proportional = tuning.proportional_rate * inertia
        integral = tuning.integral_rate * inertia
        check_gains(tuning.gamma, proportional, integral, inertia, viscous)
        settings = np.zeros(1, CONTROLLER)[0]
        settings["observer"] = tuning.observer.discretise(self.ship, interval_s)
        settings["detector"] = tuning.detector.discretise(interval_s)
        settings["anti_spin"] = anti_spin
        settings["inertia"] = inertia
        settings["gamma"] = tuning.gamma
        settings["proportional"] = proportional
        settings["integral"] = integral
        settings["highest_advance"] = tuning.highest_advance
        settings["ventilated_speed"] = tuning.ventilated_speed
        settings["speed_min"] = plant["engine_speed_min"] / plant["gear_ratio"]
        settings["speed_max"] = tuning.top_speed * plant["engine_speed_max"] / plant["gear_ratio"]
        # eq. 20 for an input held over the step, exactly
        cutoff = tuning.cutoff_rad_s
        settings["filter"] = expm(
            interval_s * np.array([[0.0, 1.0], [-(cutoff**2), -2.0 * cutoff * tuning.damping]])
        )
        self.curve = combinator_curve(self.ship)
        self.settings = settings

    def fresh(self, seen: Readings) -> NDArray[Any]:
        """Nothing but the readings of a slow ship."""
        memory = np.zeros(len(seen.shaft_speed), ANTI_SPIN_MEMORY)
        memory["reading"] = self._slowest()
        return memory

    def act(
        self, seen: Readings, memory: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch of the order, and the rack of the paper's law."""
        table = np.column_stack(seen)
        memory["reading"] = np.where(np.abs(table) <= _BOUNDS, table, memory["reading"])
        now = Readings(*memory["reading"].T)
        wanted = self.curve.at(now.speed_order)
        rack = np.empty(len(table))
        control_all(
            self.settings,
            memory,
            wanted.shaft_speed,
            wanted.thrust,
            now.shaft_speed,
            now.shaft_torque,
            now.pitch_ratio,
            now.ship_speed,
            now.fuel_rack,
            rack,
        )
        return wanted.pitch_ratio, rack

    def _slowest(self) -> NDArray[np.float64]:
        """Readings of the slowest steady state, for instruments that have said nothing yet."""
        slowest = float(self.curve.ship_speed[0])
        values = dict.fromkeys(OBSERVED, 0.0)
        values["speed_order"] = values["measured_ship_speed"] = slowest
        values["shaft_speed"] = float(self.curve.shaft_speed[0])
        values["measured_pitch_ratio"] = float(self.curve.pitch_ratio[0])
        return np.array(list(values.values()))
