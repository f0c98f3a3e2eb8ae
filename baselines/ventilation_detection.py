"""Detection of ventilation from the torque that is missing (Pivano et al. 2008, section 4.2).

The estimated propeller torque over the nominal one at the ship's speed is the torque reduction
coefficient beta_Q; ventilation is called below one threshold and called off above another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..observers.base import model_torque
from ..plant.compiled import Record, compiled
from ..plant.hull import wake_inflow
from .torque_loss import bollard_gain

_LEAST_NOMINAL = 0.05
"""Share of the bollard torque below which the nominal torque says nothing: the propeller idles."""

DETECTOR = np.dtype(
    [
        ("dt", np.float64),  # [s]
        ("blend_gain", np.float64),  # k
        ("blend_power", np.float64),  # p
        ("on_below", np.float64),  # beta_v,on
        ("off_above", np.float64),  # beta_v,off
        ("hold", np.float64),  # T_hold [s]
    ],
    align=True,
)

DETECTION = np.dtype(
    [
        ("ventilating", np.int64),  # nu
        ("torque_ratio", np.float64),  # beta_Q-hat [-]
        ("since", np.float64),  # time since the last detection [s]
    ],
    align=True,
)


@dataclass(frozen=True)
class VentilationDetector:
    """Tuning of the detector.

    The paper prints none of these. The blend gives 0.85 at 2 rad/s and 0.08 at 5 rad/s, the frigate's
    idle speed. The thresholds lie below most of what the waves' orbital motion alone takes from the
    torque.
    """

    blend_gain: float = 0.02  # k [(s/rad)^p]
    blend_power: float = 3.0  # p [-]
    on_below: float = 0.65  # beta_v,on [-]
    off_above: float = 0.70  # beta_v,off [-]
    hold_s: float = 1.0  # T_hold [s]

    def discretise(self, dt: float) -> Any:
        """DETECTOR record for a time step ``dt`` [s].

        Raises:
            ValueError: the blend is not positive, the thresholds are not in order, or the hold time
                or step is negative.
        """
        if not (self.blend_gain > 0.0 and self.blend_power > 0.0):
            raise ValueError("ventilation detector: k and p of the blend must be positive")
        if not 0.0 < self.on_below <= self.off_above < 1.0:
            raise ValueError(
                "ventilation detector: thresholds must satisfy 0 < beta_v,on <= beta_v,off < 1, "
                f"got {self.on_below:g} and {self.off_above:g}"
            )
        if not (self.hold_s >= 0.0 and dt > 0.0):
            raise ValueError("ventilation detector: hold time must be >= 0 s and time step > 0 s")
        record = np.zeros(1, DETECTOR)[0]
        record["dt"] = dt
        for name in ("blend_gain", "blend_power", "on_below", "off_above"):
            record[name] = getattr(self, name)
        record["hold"] = self.hold_s
        return record


@compiled
def torque_ratio(
    detector: Record,
    ship: Record,
    propeller_torque: float,
    shaft_speed: float,
    pitch_ratio: float,
    ship_speed: float,
) -> float:
    """Torque reduction coefficient beta_Q-hat [-] (eqs. 23 to 26).

    Args:
        detector: DETECTOR record.
        ship: PLANT record of the ship as believed.
        propeller_torque: Q_p-hat [N m].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        ship_speed: v_s [m/s]; the nominal advance velocity is (1 - w) v_s.

    Returns:
        1 where nothing is missing; also 1 where the nominal torque is too small to compare with.
    """
    blend = math.exp(-detector.blend_gain * abs(shaft_speed) ** detector.blend_power)
    nominal = model_torque(ship, wake_inflow(ship, ship_speed), shaft_speed, pitch_ratio)
    bollard = bollard_gain(ship, pitch_ratio) * shaft_speed * shaft_speed
    if not nominal > _LEAST_NOMINAL * bollard:
        return 1.0
    return float(blend + (1.0 - blend) * propeller_torque / nominal)


@compiled
def update_detection(detector: Record, detection: Record, ratio: float) -> None:
    """Bring the ventilation state nu to this sample's beta_Q-hat; it changes in place.

    Args:
        detector: DETECTOR record.
        detection: DETECTION record, all zeros at first.
        ratio: beta_Q-hat [-].
    """
    detection.torque_ratio = ratio
    detection.since += detector.dt
    if ratio < detector.on_below:
        if detection.ventilating == 0:
            detection.since = 0.0
        detection.ventilating = 1
    # half a step of slack: sums of dt are not exact
    elif ratio >= detector.off_above and detection.since >= detector.hold - 0.5 * detector.dt:
        detection.ventilating = 0
