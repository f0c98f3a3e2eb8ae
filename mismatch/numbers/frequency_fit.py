"""Numbers of a ship from a frequency response: least squares of complex errors, and in closed form.

Vrijdag & Martelli 2021, eqs. 18 and 19. The balances at the working point are held beside the errors,
for without them the response knows ratios only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from .drive_train import DriveTrain, WorkingPoint, drive_train, from_poles, keys_of
from .found import Found
from .free import Free
from .frequency import SPEED, FrequencyResponse, modelled, point_of
from .identifiable import refuse_indistinct
from .steady import CURRENT, balances

AT_POINT = 1e-3
"""Share of torque, voltage or force within which the working point's balances close: an excitation of
5 % shifts the means by half of it."""

FORM = 2e-3
"""Share of a response within which a linear model can be right, besides its noise."""


@dataclass(frozen=True)
class Fitted:
    """Numbers that meet a frequency response.

    Args:
        values: shape (n,).
        covariance: shape (n, n).
        misfit: rms of the weighted errors [-]; 1 where noise explains them.
        steps: cost of the response's errors by evaluation of the search.
    """

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    misfit: float
    steps: pd.DataFrame


def fit(chosen: Free, measured: FrequencyResponse, method: str) -> Fitted:
    """Least squares of the complex errors over all channels, the working point's balances held.

    Errors are weighted by what is known of their noise and by :data:`FORM`; where no noise is known,
    all weigh alike, as in the paper, and what is left tells it.

    Raises:
        ValueError: numbers that the response does not tell apart.
    """
    known = all(np.isfinite(error).all() for error in measured.error.values())
    weights = {
        column: 1.0 / np.hypot(measured.error[column], FORM * np.abs(values)) if known else 1.0
        for column, values in measured.response.items()
    }
    point = pd.DataFrame([{drive_column(chosen.ship): measured.demand, **measured.means}])
    closing = AT_POINT * _sizes(chosen.ship, measured, list(balances(chosen.ship, point)))
    costs: list[float] = []

    def residual(values: Any) -> NDArray[np.float64]:
        ship = chosen.on(values * chosen.scale)
        answer = modelled(ship, measured)
        errors = [weights[c] * (answer[c] - measured.response[c]) for c in answer]
        parts = np.concatenate([part for error in errors for part in (error.real, error.imag)])
        costs.append(float(np.sum(parts**2)))
        left = np.concatenate(list(balances(ship, point).values()))
        return np.concatenate([parts, left / closing])

    low, high = (bound / chosen.scale for bound in chosen.bounds)
    best: Any = None
    starts = [s for s in _starts(chosen, measured) if np.isfinite(residual(s / chosen.scale)).all()]
    if not starts:
        raise ValueError(
            f"{method}: the linear model of {chosen.ship.name} has no finite response with its file's "
            "parameters; check the ship file against the recording"
        )
    for start in starts:
        tried = scipy.optimize.least_squares(
            residual, np.clip(start / chosen.scale, low, high), bounds=(low, high), x_scale="jac",
            xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip
        if best is None or tried.cost < best.cost:
            best = tried
    refuse_indistinct(chosen.keys, best.jac, method)
    freedom = max(len(best.fun) - len(best.x), 1)
    variance = float(np.sum(best.fun**2)) / freedom
    if known:
        variance = max(variance, 1.0)
    unit = np.linalg.inv(best.jac.T @ best.jac)
    return Fitted(
        best.x * chosen.scale, variance * unit * np.outer(chosen.scale, chosen.scale),
        float(np.sqrt(np.mean(best.fun[: -len(closing)] ** 2))),
        pd.DataFrame({"evaluation": np.arange(len(costs)), "cost": costs}),
    )  # fmt: skip


def _sizes(ship: Ship, measured: FrequencyResponse, names: list[str]) -> NDArray[np.float64]:
    """Size of what stands on either side of each balance at the working point."""
    outputs = point_of(ship, measured).outputs
    size = {
        "motor": abs(measured.demand),
        "shaft": abs(float(outputs.brake_torque)),
        "hull": abs(float(outputs.resistance)),
    }
    return np.array([size[name] for name in names])


def _starts(chosen: Free, measured: FrequencyResponse) -> list[NDArray[np.float64]]:
    """Where the search begins: at the file's numbers, and at those of the closed form."""
    starts = [chosen.start]
    closed = closed_form(chosen.ship, measured)
    if closed is not None:
        values = keys_of(chosen.ship, closed[0])
        pairs = zip(chosen.keys, chosen.start, strict=True)
        starts.append(np.array([values.get(key, start) for key, start in pairs]))
    return starts


def closed_form(
    ship: Ship, measured: FrequencyResponse
) -> tuple[DriveTrain, dict[str, float]] | None:
    """The drive train whose poles, zero and steady gains meet the response best.

    Args:
        ship: where the search for the five begins, and its known viscous friction and delay.
        measured: with the motor's current.

    Returns:
        The six numbers, and the five of the Bode plots: ``s1``, ``s2``, ``z1`` [rad/s], ``speed_gain``,
        ``current_gain`` [-]. None of a ship that is no drive train or whose current was not measured,
        or where the five are not those of one.
    """
    if not ship.has_voltage or ship.moves or CURRENT not in measured.response:
        return None
    ratio = ship.transmission.gear_ratio
    point = WorkingPoint(measured.demand, measured.means[SPEED] * ratio, measured.means[CURRENT])
    linear = drive_train(ship).linear(point)
    fast, slow = (max(-pole.real, 1e-3) for pole in linear.poles)
    zero = -linear.zero if linear.zero < 0.0 else slow / 3.0
    gains = max(linear.speed_gain, 0.1), max(linear.current_gain, 0.1)
    start = np.log([min(fast, 20.0 * measured.frequency[-1]), slow, zero, *gains])
    s = 1j * measured.frequency
    late = np.exp(-s * ship.sensors.speed_delay_s)

    def residual(logs: Any) -> NDArray[np.float64]:
        s1, s2, z1, speed, current = np.exp(logs)
        both = 1.0 / ((1.0 + s / s1) * (1.0 + s / s2))
        errors = np.concatenate(
            [
                speed * both * late - measured.response[SPEED],
                current * (1.0 + s / z1) * both - measured.response[CURRENT],
            ]
        )
        return np.concatenate([errors.real, errors.imag])

    s1, s2, z1, speed, current = map(
        float, np.exp(scipy.optimize.least_squares(residual, start, x_scale=0.1).x)
    )
    five = {"s1": -s1, "s2": -s2, "z1": -z1, "speed_gain": speed, "current_gain": current}
    train = from_poles(-s1, -s2, -z1, speed, current, point, drive_train(ship).viscous)
    sizes = (train.inductance, train.constant, train.resistance, train.inertia, train.load)
    return (train, five) if min(sizes) > 0.0 and train.friction >= 0.0 else None


def found_by(method: str, chosen: Free, measured: FrequencyResponse) -> Found:
    """What a frequency response tells, with all that led there.

    Raises:
        ValueError: numbers that the response does not tell apart.
    """
    fitted = fit(chosen, measured, method)
    ship = chosen.on(fitted.values)
    answer = replace(measured, response=modelled(ship, measured), coherence={}).table()
    model = answer[[name for name in answer if name.endswith(("_gain", "_phase_deg"))]]
    tables = {
        "frequency-response": pd.concat([measured.table(), model.add_suffix("_model")], axis=1),
        "search": fitted.steps,
    }
    closed = closed_form(ship, measured)
    if closed is not None:
        rows = closed[1] | keys_of(ship, closed[0])
        tables["closed-form"] = pd.DataFrame({"number": rows.keys(), "value": rows.values()})
    unit = ship.prime_mover.demand.unit
    remark = (
        f"{len(measured.frequency)} frequencies from {measured.frequency[0]:.3g} to "
        f"{measured.frequency[-1]:.3g} rad/s about {measured.demand:.4g} {unit}; errors of "
        f"{fitted.misfit:.2g} of what is expected"
    )
    return Found(
        chosen.keys, tuple(map(float, fitted.values)), fitted.covariance, tables, (remark,)
    )
