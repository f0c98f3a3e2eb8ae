"""CPP optimiser: pitch and shaft speed of least fuel for the ordered thrust.

Control scheme of the CPP optimiser paper, sections 2.3 and 4. The speed order is converted to a thrust
set-point. The optimal combinator surface gives pitch and shaft speed at this thrust and the estimated
advance speed. The estimated advance speed, the measured shaft speed and the pitch give the advance
ratio J, and the fitted open-water surface gives the thrust. A thrust controller trims the shaft speed
until this thrust equals the set-point, and a governor sets the fuel rack. If the estimate of the
observer is not valid, or the set-point is below the surface, the combinator takes over gradually.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..plant.hull import resistance
from ..plant.open_water import MIN_REVOLUTIONS, REVOLUTIONS_PER_RADIAN
from ..plant.ship import Ship
from .combinator import Combinator
from .combinator_surface import OptimalSetting, combinator_surface, look_up
from .controller import Commands, Controller, Measurements, Ranges, Variants
from .governor import RESPONSE_S
from .inflow_schedule import SCHEDULE_COLUMNS, make_schedule, valid_estimate
from .uncertainty import Uncertainty
from .working_point import fit_open_water, surface

FILTER_S = 8.0  # of estimated advance speed and thrust [s], longer than a wave period
THRUST_INTEGRAL_S = 20.0  # integral time of the thrust controller [s], slower than the filters
TRUST_S = 5.0  # time constant of the transition between combinator and optimiser [s]
TRIM_SHARE = 0.2  # largest trim of the thrust controller over the highest shaft speed [-]
INTEGRAL, ADVANCE, THRUST, TRIM, TRUST, SCHEDULE = range(6)
"""Columns of the controller state: integral of the governor [mm], filtered advance speed [m/s] and
thrust [N], trim of the shaft speed [rad/s], weight of the optimiser (0 to 1) [-], and the first column
of the inflow schedule."""


@compiled
def _thrusts(
    plant: Record, matrix: Floats, velocity: Floats, speed: Floats, pitch: Floats
) -> Floats:
    """Return the thrusts of one propeller [N] from the fitted surface; J is limited to 0 to P/D."""
    thrust = np.empty(len(velocity))
    for i in range(len(velocity)):
        n = max(speed[i] * REVOLUTIONS_PER_RADIAN, MIN_REVOLUTIONS)
        j = min(max(velocity[i] / (n * plant.diameter), 0.0), max(pitch[i], 0.0))
        thrust[i] = surface(matrix, j, pitch[i]) * plant.density * plant.diameter**4 * n * n
    return thrust


class CppOptimiser(Controller):
    """Set pitch and shaft speed of least fuel for the thrust that the ordered speed takes in calm water.

    Args:
        ship: ship with a diesel and a controllable-pitch propeller, or its name. The first instance
            computes the combinator surface, which takes some seconds; later instances share it.
        response_s: time constant of the governed shaft speed [s].
        filter_s: time constant of the filters of estimated advance speed and thrust [s].
        pitch_at: thrust at which the pitch is taken from the surface: ``ordered``, or ``actual`` for the
            estimated thrust, as in the paper. In a steady state both are equal.
        cavitation_weight: weight of Burrill's cavitation ratio against the relative fuel flow [-]; 0, as
            in the paper, for least fuel.
        kq_margin: share by which KQ may be higher than the ship file says [-], for a surface that stays
            within the engine's torque then.
        nox_weight: weight of the relative NOx flow against the relative fuel flow [-]; the ship file
            needs a NOx map (``[emissions]``).
        kq_error: largest relative error of KQ in the ship file [-]; this and the two next options make
            the surface robust (:mod:`.uncertainty`).
        eta_r_error: largest relative error of eta_R [-].
        wake_error: largest error of the wake fraction [-]; 0 where the advance velocity is estimated.
        expected: 1 for the least expected fuel under these errors, 0 for the least fuel in the worst
            case, with the engine within its torque limit there [-].
        va_weight: weight k of the estimate in the advance velocity of :mod:`.inflow_schedule` [-], which
            falls back to the nominal wake; 0 for the nominal wake alone. By default the estimate is used
            as it is, as in the paper.

    State: shape (n, 7), columns :data:`INTEGRAL` to :data:`TRUST`, then those of the inflow schedule.

    Raises:
        ValueError: ``pitch_at`` is another word, or another option is out of range.
    """

    name = "cpp-optimiser"
    source = "CPP optimiser paper"
    variants: ClassVar[Variants] = {"cpp-optimiser-at-actual": {"pitch_at": "actual"}}
    tunable: ClassVar[Ranges] = {
        "cavitation_weight": (0.0, 2.0),
        "kq_margin": (0.0, 0.1),
        "va_weight": (0.0, 1.0),
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        response_s: float = RESPONSE_S,
        *,
        filter_s: float = FILTER_S,
        pitch_at: str = "ordered",
        cavitation_weight: float = 0.0,
        kq_margin: float = 0.0,
        nox_weight: float = 0.0,
        kq_error: float = 0.0,
        eta_r_error: float = 0.0,
        wake_error: float = 0.0,
        expected: float = 0.0,
        va_weight: float | None = None,
    ) -> None:
        super().__init__(ship, interval_s)
        if pitch_at not in ("ordered", "actual"):
            raise ValueError(f"pitch_at = {pitch_at!r}: must be 'ordered' or 'actual'")
        if not (math.isfinite(filter_s) and filter_s > 0.0):
            raise ValueError(f"filter_s = {filter_s!r} s: must be a number above 0")
        for key, value, most in (
            ("cavitation_weight", cavitation_weight, 10.0),
            ("kq_margin", kq_margin, 0.3),
            ("nox_weight", nox_weight, 10.0),
        ):
            if not 0.0 <= value <= most:
                raise ValueError(f"{key} = {value!r}: must be 0 to {most:g}")
        if expected not in (0.0, 1.0):
            raise ValueError(
                f"expected = {expected!r}: must be 1 (expected fuel) or 0 (worst case)"
            )
        self.pitch_at, self.filter_s = pitch_at, filter_s
        self.fit = fit_open_water(self.ship)
        errors = Uncertainty(kq_error, eta_r_error, wake_error, expected == 1.0)
        if expected == 1.0 and not errors.present:
            raise ValueError("expected = 1: needs a kq_error, eta_r_error or wake_error above 0")
        self.surface = combinator_surface(
            self.ship,
            cavitation_weight=cavitation_weight,
            kq_margin=kq_margin,
            nox_weight=nox_weight,
            uncertainty=errors,
        )
        self.combinator = Combinator(self.ship, interval_s, response_s=response_s)
        self.schedule = make_schedule(self.name, self.plant, interval_s, va_weight)
        self._top = self.ship.shaft_speeds[1]

    def ordered_thrust(self, speed_order: Any) -> Floats:
        """Return the thrust of one propeller [N] at an ordered speed [m/s] in calm water, shape (n,).

        Orders above the highest speed of the ship give a thrust above the highest in calm water, for a
        higher resistance; the surface limits it.
        """
        push = float(self.plant["propellers"] * (1.0 - self.plant["thrust_deduction"]))
        orders = np.atleast_1d(np.asarray(speed_order, dtype=np.float64))
        return np.array([resistance(self.plant, max(v, 0.0), 1.0) / push for v in orders])

    def thrust(self, signals: Measurements) -> Floats:
        """Return the thrust of one propeller [N] at the estimated working point, shape (n,)."""
        screw, speed = self.ship.propeller, np.ascontiguousarray(signals.shaft_speed)
        velocity = np.ascontiguousarray(signals.advance_velocity)
        pitch = np.clip(signals.pitch_ratio, screw.pitch_ratio_min, screw.pitch_ratio_max)
        return _thrusts(self.plant, self.fit.thrust, velocity, speed, pitch)

    def initial_state(self, signals: Measurements) -> Floats:
        """Return empty filters and an integral that the first call of :meth:`act` sets."""
        memory = np.zeros((len(signals.shaft_speed), SCHEDULE + SCHEDULE_COLUMNS))
        memory[:, INTEGRAL] = np.nan  # set when the shaft speed set-point is known
        memory[:, TRUST] = valid_estimate(self._scheduled(signals, memory))
        return memory

    def act(self, signals: Measurements, memory: Floats) -> Commands:
        """Return pitch and fuel rack of the optimiser and the combinator, by their weights."""
        if self.schedule is not None:
            memory[:, SCHEDULE:] = self.schedule.update(signals, memory[:, SCHEDULE:])
        signals = self._scheduled(signals, memory)
        valid = valid_estimate(signals)
        estimate = self.thrust(signals)
        plain_pitch, plain_speed = self.combinator.set_points(signals.speed_order)
        # An empty filter starts at its first valid input.
        first = valid & (memory[:, ADVANCE] == 0.0) & (memory[:, THRUST] == 0.0)
        memory[first, ADVANCE] = signals.advance_velocity[first]
        memory[first, THRUST] = estimate[first]

        keep = math.exp(-self.interval_s / self.filter_s)
        for column, value in ((ADVANCE, signals.advance_velocity), (THRUST, estimate)):
            filtered = keep * memory[:, column] + (1.0 - keep) * value
            memory[:, column] = np.where(valid, filtered, memory[:, column])
        gives = math.exp(-self.interval_s / TRUST_S)
        memory[:, TRUST] = gives * memory[:, TRUST] + (1.0 - gives) * valid

        setting = look_up(
            self.surface, self.ordered_thrust(signals.speed_order), memory[:, ADVANCE]
        )
        memory[:, TRIM] = self._trim(memory, setting, valid)
        best_pitch = setting.pitch_ratio
        if self.pitch_at == "actual":
            best_pitch = look_up(self.surface, memory[:, THRUST], memory[:, ADVANCE]).pitch_ratio
        share = memory[:, TRUST] * setting.reach
        speed = share * (setting.shaft_speed + memory[:, TRIM]) + (1.0 - share) * plain_speed
        pitch = share * best_pitch + (1.0 - share) * plain_pitch
        governor = self.combinator.governor
        settled = governor.settle(signals.shaft_speed, signals.fuel_rack, speed)
        integral = np.where(np.isnan(memory[:, INTEGRAL]), settled, memory[:, INTEGRAL])
        rack, memory[:, INTEGRAL] = governor.command(speed, signals.shaft_speed, integral)
        return pitch, rack

    def _scheduled(self, signals: Measurements, memory: Floats) -> Measurements:
        """Return the measurements with the scheduled advance velocity in place of the estimate."""
        if self.schedule is None:
            return signals
        velocity = self.schedule.velocity(signals, memory[:, SCHEDULE:])
        known = np.isfinite(velocity).astype(np.float64)
        return signals._replace(advance_velocity=velocity, estimate_valid=known)

    def _trim(self, memory: Floats, setting: OptimalSetting, valid: NDArray[np.bool_]) -> Floats:
        """Return the trim of the shaft speed [rad/s] by the integral of the thrust error.

        T is proportional to omega^2, so d omega / d T = omega / (2 T). The trim is constant where the
        optimiser has no weight.
        """
        error = (setting.thrust - memory[:, THRUST]) / np.maximum(setting.thrust, 1.0)
        rate = 0.5 * setting.shaft_speed * np.clip(error, -1.0, 1.0) / THRUST_INTEGRAL_S
        acting = np.where(valid, setting.reach, 0.0)
        trim = memory[:, TRIM] + acting * rate * self.interval_s
        return np.asarray(np.clip(trim, -TRIM_SHARE * self._top, TRIM_SHARE * self._top))
