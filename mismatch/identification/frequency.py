"""Fit parameters to frequency responses, and find which parameters recordings identify, and up to where.

A response is relative: the deviation of a channel over its mean, per deviation of the command over its
mean (Vrijdag & Martelli 2021). The model is the linearised plant about the measured working point,
sampled like the recording, with the command held between rows.

Parameters follow from least squares of the complex errors (eqs. 18 and 19) and, for a drive train, in
closed form. The balances at the working point are additional equations, because only ratios are
identifiable from a relative response.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import TIME, drive_column
from ...plant.linear import linearise
from ...plant.ship import Ship
from ...plant.steady_state import Equilibrium
from ..judge.held_out import Segments, bands_of
from ..search.fitting import Fitter
from ..search.spectra import Likelihood, informative_frequency
from ..simulate.balances import Balances
from .drive_train import DriveTrain, WorkingPoint, drive_train, from_poles, keys_of
from .free_parameters import Free, UnidentifiableError, distinguishable, doubtful, refuse_indistinct
from .output_error import OutputError
from .parameters import MethodResult
from .steady import CURRENT, balances, blade_column, point_at

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

STILL = 1e-9  # relative standard deviation up to which only the last digits of a channel change
AT_POINT = 1e-3
"""Relative error of the balances at the working point: an excitation of 5 % shifts the means by half of
this share of torque, voltage or force."""
FORM = 2e-3  # relative error of the response of a linear model, besides its noise

SPEED = "shaft_speed_rad_s"
OUTPUTS = {
    SPEED: "shaft_speed",
    CURRENT: "motor_current",
    "shaft_torque_N_m": "shaft_torque",
    "ship_speed_m_s": "ship_speed",
}
"""Columns whose response is used, with the output of the linear model for each."""


def identifiable_keys(
    balances: Balances, train: Segments
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the keys of identifiable parameters, and why other uncertain parameters are left out.

    Args:
        balances: balances of the ship and the recordings.
        train: segments of the fitted data.

    Raises:
        UnidentifiableError: no parameter is identifiable.
    """
    ship = balances.replay.ship
    free = Free(ship, doubtful(ship))
    fitter = Fitter(balances, bands_of(balances, train), free=free.keys)
    fit = fitter.evaluate_record(free.record(free.values))
    columns = OutputError(fitter, free).slopes(free.values, fit)
    # The noise is that which would remain if the parameters explained as much as they can.
    sizes = np.abs(np.array(free.values))[:, None, None]
    everything = Likelihood(fitter.bands, np.concatenate([columns * sizes, fitter.nuisance]))
    information = fitter.likelihood.information(everything(fit.difference).weight, columns)
    count = len(free.keys)
    # The tolerances of the other parameters reduce the information.
    own, crossed = information[:count, :count], information[:count, count:]
    own = own - crossed @ np.linalg.solve(information[count:, count:], crossed.T)
    rest, left = distinguishable(free.keys, free.values, own)
    if not rest:
        why = "; ".join(f"{key}: {reason}" for key, reason in left.items())
        raise UnidentifiableError(
            f"these recordings identify no parameter of {ship.name}: {why}", free.keys, ()
        )
    return tuple(free.keys[i] for i in rest), left


def parameters_hertz(
    balances: Balances, free: Free, values: Sequence[float], segments: Segments
) -> float:
    """Return the highest frequency with information about parameters at their values [Hz].

    It is infinite for a parameter without influence. ``segments`` are those of the fitted data.
    """
    replay = balances.replay
    steps = np.diag([1e-3 * abs(value) or 1e-3 for value in values])
    records = [free.record(list(np.asarray(values) + step)) for step in steps]
    here, *moved = replay.simulate_ships([free.record(values), *records])
    return max(map(informative_frequency(replay, here, segments), moved))


@dataclass(frozen=True)
class FrequencyResponse:
    """Measured frequency response about one working point.

    Args:
        demand: mean of the drive command, in the unit of its column.
        means: means of the channels by column, with the pitch ratio of a controllable-pitch propeller.
        frequency: rising frequencies [rad/s], shape (n,).
        response: relative response [-] of each channel by column, each of shape (n,).
        error: standard error [-] of real and imaginary part, likewise; NaN if it is unknown.
        interval_s: sampling interval of the recording [s]; 0 for a response that was not sampled.
        coherence: squared coherence [-], likewise; empty if the method has none.
    """

    demand: float
    means: dict[str, float]
    frequency: Array
    response: dict[str, Complex]
    error: dict[str, Array]
    interval_s: float
    coherence: dict[str, Array] = field(default_factory=dict)

    def table(self) -> pd.DataFrame:
        """Return frequency, gain, phase [deg], standard error and coherence of each channel."""
        columns: dict[str, Any] = {"frequency_rad_s": self.frequency}
        for column, values in self.response.items():
            name = OUTPUTS[column]
            columns[f"{name}_gain"] = np.abs(values)
            columns[f"{name}_phase_deg"] = np.degrees(np.angle(values))
            columns[f"{name}_standard_error"] = self.error[column]
            if column in self.coherence:
                columns[f"{name}_coherence"] = self.coherence[column]
        return pd.DataFrame(columns)


def fit_response(method: str, chosen: Free, measured: FrequencyResponse) -> MethodResult:
    """Return the parameters that fit a frequency response, with their tables.

    Raises:
        ValueError: parameters that the response does not distinguish.
    """
    fitted = fit(chosen, measured, method)
    ship = chosen.on(fitted.values)
    answer = replace(measured, response=modelled_response(ship, measured), coherence={}).table()
    model = answer[[name for name in answer if name.endswith(("_gain", "_phase_deg"))]]
    tables = {
        "frequency-response": pd.concat([measured.table(), model.add_suffix("_model")], axis=1),
        "search": fitted.steps,
    }
    closed = closed_form(ship, measured)
    if closed is not None:
        rows = closed[1] | keys_of(ship, closed[0])
        tables["closed-form"] = pd.DataFrame({"number": rows.keys(), "value": rows.values()})
    remark = (
        f"{len(measured.frequency)} frequencies from {measured.frequency[0]:.3g} to "
        f"{measured.frequency[-1]:.3g} rad/s about {measured.demand:.4g} "
        f"{ship.prime_mover.demand.unit}; the errors are {fitted.misfit:.2g} times the expected ones"
    )
    return MethodResult(
        chosen.keys, tuple(map(float, fitted.values)), fitted.covariance, tables, (remark,)
    )


@dataclass(frozen=True)
class ResponseFit:
    """Parameters that fit a frequency response.

    Args:
        values: estimates, shape (n,).
        covariance: covariance of the estimates, shape (n, n).
        misfit: rms of the weighted errors [-]; 1 if they are noise.
        steps: cost function by evaluation of the search.
    """

    values: Array
    covariance: Array
    misfit: float
    steps: pd.DataFrame


def fit(chosen: Free, measured: FrequencyResponse, method: str) -> ResponseFit:
    """Fit parameters by least squares of the complex errors over all channels and of the balances.

    The weights follow from the noise and from :data:`FORM`. Without a known noise all errors have equal
    weights, as in the paper, and the residual gives the noise.

    Raises:
        ValueError: parameters that the response does not distinguish.
    """
    known = all(np.isfinite(error).all() for error in measured.error.values())
    weights = {
        column: 1.0 / np.hypot(measured.error[column], FORM * np.abs(values)) if known else 1.0
        for column, values in measured.response.items()
    }
    point = pd.DataFrame([{drive_column(chosen.ship): measured.demand, **measured.means}])
    outputs = working_point(chosen.ship, measured).outputs
    sizes = {"motor": measured.demand, "shaft": outputs.brake_torque, "hull": outputs.resistance}
    closing = AT_POINT * np.array([abs(float(sizes[b])) for b in balances(chosen.ship, point)])
    costs: list[float] = []

    def residual(values: Any) -> Array:
        ship = chosen.on(values * chosen.scale)
        answer = modelled_response(ship, measured)
        errors = [weights[c] * (answer[c] - measured.response[c]) for c in answer]
        parts = np.concatenate([part for error in errors for part in (error.real, error.imag)])
        costs.append(float(np.sum(parts**2)))
        left = np.concatenate(list(balances(ship, point).values()))
        return np.concatenate([parts, left / closing])

    starts = [chosen.start]  # the values of the ship file, and those of the closed form
    if (closed := closed_form(chosen.ship, measured)) is not None:
        values = dict(zip(chosen.keys, chosen.start, strict=True)) | keys_of(chosen.ship, closed[0])
        starts.append(np.array([values[key] for key in chosen.keys]))
    starts = [s for s in starts if np.isfinite(residual(s / chosen.scale)).all()]
    if not starts:
        raise ValueError(
            f"{method}: the linear model of {chosen.ship.name} has no finite response with its file's "
            "parameters; check the ship file against the recording"
        )
    low, high = (bound / chosen.scale for bound in chosen.bounds)
    tried = [
        scipy.optimize.least_squares(
            residual,
            np.clip(start / chosen.scale, low, high),
            bounds=(low, high),
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
        for start in starts
    ]
    best: Any = min(tried, key=lambda one: float(one.cost))
    refuse_indistinct(chosen.keys, best.jac, method)
    variance = float(np.sum(best.fun**2)) / max(len(best.fun) - len(best.x), 1)
    if known:
        variance = max(variance, 1.0)
    unit = np.linalg.inv(best.jac.T @ best.jac)
    return ResponseFit(
        best.x * chosen.scale,
        variance * unit * np.outer(chosen.scale, chosen.scale),
        float(np.sqrt(np.mean(best.fun[: -len(closing)] ** 2))),
        pd.DataFrame({"evaluation": np.arange(len(costs)), "cost": costs}),
    )


def closed_form(
    ship: Ship, measured: FrequencyResponse
) -> tuple[DriveTrain, dict[str, float]] | None:
    """Return the drive train whose poles, zero and steady gains fit the response best.

    The ship gives the start of the search, the viscous friction and the sensor delay.

    Returns:
        The six parameters, and the five values of the Bode plots: ``s1``, ``s2``, ``z1`` [rad/s],
        ``speed_gain``, ``current_gain`` [-]. None for a ship without such a drive train or without a
        measured current, and if the five values belong to no drive train.
    """
    if not ship.has_voltage or ship.moves or CURRENT not in measured.response:
        return None
    own, ratio = drive_train(ship), ship.transmission.gear_ratio
    point = WorkingPoint(measured.demand, measured.means[SPEED] * ratio, measured.means[CURRENT])
    linear = own.linear(point)
    fast, slow = (max(-pole.real, 1e-3) for pole in linear.poles)
    zero = -linear.zero if linear.zero < 0.0 else slow / 3.0
    gains = max(linear.speed_gain, 0.1), max(linear.current_gain, 0.1)
    start = np.log([min(fast, 20.0 * measured.frequency[-1]), slow, zero, *gains])
    s = 1j * measured.frequency
    late = np.exp(-s * ship.sensors.speed_delay_s)

    def residual(logs: Any) -> Array:
        s1, s2, z1, speed, current = np.exp(logs)
        both = 1.0 / ((1.0 + s / s1) * (1.0 + s / s2))
        speed_error = speed * both * late - measured.response[SPEED]
        current_error = current * (1.0 + s / z1) * both - measured.response[CURRENT]
        errors = np.concatenate([speed_error, current_error])
        return np.concatenate([errors.real, errors.imag])

    best = np.exp(scipy.optimize.least_squares(residual, start, x_scale=0.1).x)
    s1, s2, z1, speed, current = (float(v) for v in best * [-1.0, -1.0, -1.0, 1.0, 1.0])
    train = from_poles(s1, s2, z1, speed, current, point, own.viscous)
    sizes = (train.inductance, train.constant, train.resistance, train.inertia, train.load)
    if min(sizes) <= 0.0 or train.friction < 0.0:
        return None
    five = {"s1": s1, "s2": s2, "z1": z1, "speed_gain": speed, "current_gain": current}
    return train, five


def modelled_response(ship: Ship, measured: FrequencyResponse) -> dict[str, Complex]:
    """Return the modelled relative response by column at the measured frequencies.

    It is sampled and held like the measured one and includes the delay ``sensors.speed_delay_s``.
    """
    columns = list(measured.response)
    system = linearise(ship, working_point(ship, measured), tuple(OUTPUTS[c] for c in columns))
    drive = system.input_labels.index("drive")
    a, c = np.asarray(system.A), np.asarray(system.C)
    b, d = np.asarray(system.B)[:, [drive]], np.asarray(system.D)[:, [drive]]
    frequency, interval_s = measured.frequency, measured.interval_s
    shift = np.asarray(1j * frequency, dtype=np.complex128)
    if interval_s > 0.0:
        size = len(a)
        both = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, size + 1))]]) * interval_s)
        a, b, shift = both[:size, :size], both[:size, size:], np.exp(shift * interval_s)
    resolvent = shift[:, None, None] * np.eye(len(a)) - a
    answer = c @ np.linalg.solve(resolvent, np.broadcast_to(b, (len(shift), *b.shape))) + d
    answer = answer[:, :, 0] / zero_order_hold(frequency, interval_s)[:, None]
    found = {
        column: answer[:, k] * measured.demand / measured.means[column]
        for k, column in enumerate(columns)
    }
    if SPEED in found:
        found[SPEED] = found[SPEED] * np.exp(-1j * frequency * ship.sensors.speed_delay_s)
    return found


def working_point(ship: Ship, measured: FrequencyResponse) -> Equilibrium:
    """Return the measured working point as a state of the plant, whose balances need not close."""
    means = {drive_column(ship): measured.demand, **measured.means}
    return point_at(ship, ship.record(), means)[0]


def slowest_s(ship: Ship, measured: FrequencyResponse) -> float:
    """Return the longest time constant [s] of the linear model about the measured point, or 0."""
    poles = np.real(linearise(ship, working_point(ship, measured), ("shaft_speed",)).poles())
    return float(1.0 / np.min(-poles[poles < 0.0], initial=np.inf))


def channels_of(ship: Ship, table: pd.DataFrame, method: str) -> dict[str, Array]:
    """Return the drive command and the channels of a recording by column, the command first.

    A channel other than the shaft speed is left out if it has no relative response: it is constant, such
    as the speed of a fixed hull, or its mean is smaller than its standard deviation.

    Raises:
        ValueError: a drive that prescribes the shaft speed, a missing column, a shaft that stops or
            reverses, or a command with mean 0.
    """
    demand = drive_column(ship)
    if not ship.turns_freely:
        raise ValueError(
            f"{method}: the drive of {ship.name} prescribes the shaft speed, so no command changes it; "
            "use --method output-error"
        )
    needed = [TIME, demand, SPEED, *(["ship_speed_m_s"] if ship.moves else [])]
    if lacking := [column for column in needed if column not in table]:
        raise ValueError(f"{method}: {ship.name} needs {lacking[0]}, which a recording lacks")
    found = {c: table[c].to_numpy(dtype=np.float64) for c in (demand, *OUTPUTS) if c in table}
    if found[SPEED].min() * found[SPEED].max() <= 0.0:
        raise ValueError(
            f"{method}: the shaft stops or reverses; a frequency response needs a shaft that turns in "
            "one direction"
        )
    if found[demand].mean() == 0.0:
        raise ValueError(f"{method}: the mean of {demand} is 0, so there is no working point")

    def responds(values: Array) -> bool:
        mean, deviation = abs(float(values.mean())), float(values.std())
        return STILL * mean < deviation < mean

    return {c: v for c, v in found.items() if c in (demand, SPEED) or responds(v)}


def means_of(
    ship: Ship, table: pd.DataFrame, channels: dict[str, Array], rows: slice
) -> dict[str, float]:
    """Return the means of the channels, and of a variable pitch ratio, over some rows."""
    means = {c: float(channels[c][rows].mean()) for c in OUTPUTS if c in channels}
    blade = blade_column(ship, table)
    return means | ({} if blade is None else {"pitch_ratio": float(table[blade].iloc[rows].mean())})


def interval_of(table: pd.DataFrame) -> float:
    """Return the sampling interval of a recording [s]."""
    time = table[TIME].to_numpy(dtype=np.float64)
    return float((time[-1] - time[0]) / (len(time) - 1))


def zero_order_hold(frequency: Any, interval_s: float) -> Complex:
    """Return the response [-] of a zero-order hold at frequencies [rad/s]; 1 without sampling.

    >>> abs(zero_order_hold(0.0, 0.1)).item()
    1.0
    """
    turn = 1j * np.asarray(frequency, dtype=np.float64) * interval_s
    small = np.abs(turn) < 1e-9
    return np.where(small, 1.0, -np.expm1(-turn) / np.where(small, 1.0, turn))


def attenuation(values: Array, interval_s: float, frequency: Any) -> Array:
    """Return the possible attenuation [-] of a response by a channel with a low update rate.

    An encoder measures the mean speed between two edges and holds it until the next, with the response
    (sin x / x)^2, x half the frequency times the time between new values. Whether a channel averages and
    holds, or only holds, is unknown; the attenuation is therefore an error and no correction.

    Args:
        values: values of the channel, shape (n,).
        interval_s: sampling interval of the recording [s].
        frequency: frequencies [rad/s].
    """
    changes = int(np.count_nonzero(np.diff(values)))
    every = len(values) / max(changes, 1) * interval_s
    half = np.asarray(frequency, dtype=np.float64) * every / 2.0
    lacking = 1.0 - np.sinc(np.minimum(half, np.pi) / np.pi) ** 2
    return lacking if every > 1.5 * interval_s else 0.0 * lacking
