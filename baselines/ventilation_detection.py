"""Detection of ventilation from the torque that is missing (Pivano et al. 2008, section 4.2).

The estimated propeller torque over the nominal one at the ship's speed is the torque reduction
coefficient beta_Q; ventilation is called below one threshold and called off above another.

Waves take torque too. Their orbital motion, though, adds to the inflow as often as it takes from it,
whereas air only takes torque. So the side on which torque is gained tells the sea's own share, and an
option beyond the paper (``sea_margin``) calls ventilation only where the loss is more than that: the
inflow at which a propeller without air would take the estimated torque must exceed the calm one by
some standard deviations of the sea's, a threshold of constant false-alarm rate as in a radar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.torque_curve import model_torque, velocity_from_torque
from ..plant.hull import wake_inflow
from .torque_loss import bollard_gain, direction_of

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
        ("sea_margin", np.float64),  # 0: the paper's detection
        ("sea_memory", np.float64),  # [s]
    ],
    align=True,
)

DETECTION = np.dtype(
    [
        ("ventilating", np.int64),  # nu
        ("torque_ratio", np.float64),  # beta_Q-hat [-]
        ("since", np.float64),  # time since the last detection [s]
        ("excess_inflow", np.float64),  # that would explain the torque without air [m/s]
        ("sea_square", np.float64),  # mean square of the sea's inflow [m2/s2]
        ("samples", np.float64),
    ],
    align=True,
)


@dataclass(frozen=True)
class VentilationDetector:
    """Tuning of the detector.

    The paper prints none of these, and does not know the last two. The blend gives 0.85 at 2 rad/s
    and 0.08 at 5 rad/s, the frigate's idle speed. The thresholds lie below most of what the waves'
    orbital motion alone takes from the torque.
    """

    blend_gain: float = 0.02  # k [(s/rad)^p]
    blend_power: float = 3.0  # p [-]
    on_below: float = 0.65  # beta_v,on [-]
    off_above: float = 0.70  # beta_v,off [-]
    hold_s: float = 1.0  # T_hold [s]
    sea_margin: float = (
        0.0  # standard deviations of the sea's inflow; 0 as in the paper, else 3 [-]
    )
    sea_memory_s: float = 120.0  # over which the sea's inflow is averaged [s]

    def discretise(self, dt: float) -> Any:
        """DETECTOR record for a time step ``dt`` [s].

        Raises:
            ValueError: the blend or the sea's memory is not positive, the thresholds are not in
                order, or the hold time, sea margin or step is negative.
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
        if not (self.sea_margin >= 0.0 and self.sea_memory_s > 0.0):
            raise ValueError("ventilation detector: sea margin must be >= 0, sea memory > 0 s")
        record = np.zeros(1, DETECTOR)[0]
        record["dt"] = dt
        for name in ("blend_gain", "blend_power", "on_below", "off_above", "sea_margin"):
            record[name] = getattr(self, name)
        record["hold"], record["sea_memory"] = self.hold_s, self.sea_memory_s
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
    direction = direction_of(ship, shaft_speed)
    nominal = model_torque(ship, wake_inflow(ship, ship_speed), shaft_speed, pitch_ratio)
    bollard = bollard_gain(ship, pitch_ratio, direction) * shaft_speed * shaft_speed
    if not direction * nominal > _LEAST_NOMINAL * bollard:
        return 1.0
    return float(blend + (1.0 - blend) * propeller_torque / nominal)


@compiled
def excess_inflow(
    ship: Record, propeller_torque: float, shaft_speed: float, pitch_ratio: float, ship_speed: float
) -> float:
    """Inflow beyond the calm one (1 - w) v_s [m/s] that would explain a torque without air.

    Positive where it takes torque: of a shaft that turns astern, as the flow goes astern.

    Args:
        ship: PLANT record of the ship as believed.
        propeller_torque: Q_p-hat [N m].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        ship_speed: v_s [m/s].
    """
    calm = wake_inflow(ship, ship_speed)
    told, _ = velocity_from_torque(ship, propeller_torque, shaft_speed, pitch_ratio, calm)
    return float(direction_of(ship, shaft_speed) * (told - calm))


@compiled
def update_detection(detector: Record, detection: Record, ratio: float, inflow: float) -> None:
    """Bring the ventilation state nu to this sample; it changes in place.

    Args:
        detector: DETECTOR record.
        detection: DETECTION record, all zeros at first.
        ratio: beta_Q-hat [-].
        inflow: from :func:`excess_inflow` [m/s].
    """
    detection.torque_ratio = ratio
    detection.excess_inflow = inflow
    detection.since += detector.dt
    limit = detector.sea_margin * math.sqrt(detection.sea_square)
    beyond = detector.sea_margin == 0.0 or inflow > limit
    # a mean over all samples at first, later over the memory; twice the half that gains torque
    detection.samples += 1.0
    share = max(1.0 / detection.samples, min(detector.dt / detector.sea_memory, 1.0))
    gained = min(inflow, 0.0)
    detection.sea_square += share * (2.0 * gained * gained - detection.sea_square)
    if ratio < detector.on_below and beyond:
        if detection.ventilating == 0:
            detection.since = 0.0
        detection.ventilating = 1
    # half a step of slack: sums of dt are not exact
    elif (ratio >= detector.off_above or not beyond) and (
        detection.since >= detector.hold - 0.5 * detector.dt
    ):
        detection.ventilating = 0
