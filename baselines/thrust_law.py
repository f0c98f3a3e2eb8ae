"""Tuning of the thrust law (Pivano et al. 2008, section 4) and the conditions on its gains."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
import scipy

from ..plant.propeller_curves import coefficients_along
from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from .thrust_law_kernel import THRUST_LAW
from .torque_loss import TorqueLossObserver
from .ventilation_detection import VentilationDetector


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
        raise ValueError("thrust law: every gain must be a finite number")
    if not gamma > 0.0:
        raise ValueError(f"thrust law: condition B1 is violated: gamma = {gamma:g} 1/s must be > 0")
    least = max(0.0, gamma * inertia - viscous)
    if not proportional > least:
        raise ValueError(
            f"thrust law: condition B2 is violated: k_P = {proportional:g} N m s/rad must exceed "
            f"{least:g}, the larger of 0 and gamma J_m - k_f2"
        )
    least = max(0.0, -inertia * gamma * gamma + gamma * viscous)
    if not integral > least:
        raise ValueError(
            f"thrust law: condition B3 is violated: k_I = {integral:g} N m/rad must exceed "
            f"{least:g}, the larger of 0 and -J_m gamma^2 + gamma k_f2"
        )


def _thrust_ends(ship: Ship) -> tuple[float, float]:
    """J over P/D [-] about which there is no thrust left, ahead and astern.

    A four-quadrant propeller loses its thrust astern at a lower J; J = P/D does for the B-series.
    """
    if ship.propeller.model != "four-quadrant":
        return 1.0, 1.0
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_max

    def end(direction: float) -> float:
        return float(
            scipy.optimize.brentq(
                lambda j: coefficients_along(plant, j, pitch, direction)[0], 0.0, 3.0
            )
        )

    return end(1.0) / pitch, end(-1.0) / pitch


@dataclass(frozen=True)
class ThrustLaw:
    """Numbers of the law that holds a thrust; the paper prints none of them.

    The defaults are the diesel frigate's, for a control interval of 0.5 s.
    """

    gamma: float = 0.1  # [1/s]
    proportional_rate: float = 0.6  # k_P / J_m [1/s]
    integral_rate: float = 0.05  # k_I / J_m [1/s2]
    cutoff_rad_s: float = 1.5  # omega_c of the reference filter [rad/s]
    damping: float = 1.0  # xi of the reference filter [-]
    highest_advance: float = 0.9  # highest J-hat in G_QT over that of no thrust, about P/D [-]
    observer: TorqueLossObserver = field(default_factory=TorqueLossObserver)  # of the torque loss
    detector: VentilationDetector = field(default_factory=VentilationDetector)  # of air

    def tuned(self, numbers: dict[str, float]) -> Self:
        """The same with some numbers of its own or of its parts replaced, by name.

        Raises:
            TypeError: a number that it does not have.
        """
        rest, parts = dict(numbers), {}
        for name in ("observer", "detector"):
            part = getattr(self, name)
            own = {f.name: rest.pop(f.name) for f in fields(part) if f.name in rest}
            parts[name] = replace(part, **own)
        return replace(self, **parts, **rest)  # type: ignore[arg-type]

    def settings(
        self, ship: Ship, interval_s: float, anti_spin: bool, speeds: tuple[float, float]
    ) -> Any:
        """THRUST_LAW record.

        Args:
            ship: with a shaft that turns freely.
            interval_s: control interval [s].
            anti_spin: whether ventilation limits the shaft speed.
            speeds: lowest and highest desired shaft speed [rad/s].

        Raises:
            ValueError: the tuning violates a condition of the paper.
        """
        if not (self.cutoff_rad_s > 0.0 and self.damping > 0.0):
            raise ValueError("thrust law: the reference filter's cut-off and damping must be > 0")
        law = np.zeros(1, THRUST_LAW)[0]
        law["observer"] = self.observer.discretise(ship, interval_s)
        law["detector"] = self.detector.discretise(interval_s)
        law["anti_spin"] = anti_spin
        inertia = float(shaft_inertia(ship.record()))
        law["inertia"] = inertia
        law["gamma"] = self.gamma
        law["proportional"] = self.proportional_rate * inertia
        law["integral"] = self.integral_rate * inertia
        check_gains(
            self.gamma,
            float(law["proportional"]),
            float(law["integral"]),
            inertia,
            float(law["observer"]["viscous"]),
        )
        law["highest_advance"] = self.highest_advance * np.array(_thrust_ends(ship))
        law["speed_min"], law["speed_max"] = speeds
        # eq. 20 for an input held over the step, exactly
        cutoff = self.cutoff_rad_s
        law["filter"] = scipy.linalg.expm(
            interval_s * np.array([[0.0, 1.0], [-(cutoff**2), -2.0 * cutoff * self.damping]])
        )
        return law
