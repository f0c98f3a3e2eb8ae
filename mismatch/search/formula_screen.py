"""Screen blocks of formulas by linear regression of a residual, without simulating each block.

The response of the balances to one unit at a location of the model is computed once; the regressor of a
block is this response times the block along a simulation. Generalised least squares, whitened by the
likelihood of the model and with free nominal parameters, gives the gain of each block and of each pair
of blocks (orthogonal matching pursuit: Pati, Rezaiifar & Krishnaprasad 1993).
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from ...plant.expressions import InputSignals
from ...plant.simulation import ALL_SIGNALS
from ...plant.terms import PLACES, TERM_SIGNALS
from ..simulate.balances import Balances
from ..simulate.joint_replay import Floats
from .blocks import Block, Values, make_blocks
from .catalogue import SizedEffect
from .fitting import Fit, Fitter
from .spectra import Complex, Likelihood

PROBE = 1e-3
"""Perturbation of an input, as a share of its rms, from which the response is computed."""

LEFT = 1e-4
"""Smallest share of a block's power that must be independent of the nominal parameters."""

FIRST, SECOND = 12, 8
"""Number of the best blocks at a location from which pairs are made, and of partners for each."""

ONES, PROFILED = 24, 48
"""Number of blocks that are kept for each location, and of formulas with an exact likelihood."""

REACH = 10.0
"""Prior standard deviation of a coefficient, as a multiple of its least-squares value: nearly free."""

LOCATIONS_OF_BALANCE = {
    "engine": ("drive_torque", "drive"),
    "motor": ("drive_torque", "drive"),
    "propeller": ("load_torque", "inflow_velocity"),
    "load": ("load_torque",),
    "hull": ("resistance", "inflow_velocity"),
    "sway": ("side_force",),
    "yaw": ("yaw_moment",),
    "thrust": ("thrust", "inflow_velocity"),
    "pitch-actuator": ("pitch_rate",),
}
"""Locations of a term for each balance. Thrust and resistance differ only if the thrust is measured."""


SIGNALS_OF_BALANCE = {
    "engine": ("shaft_speed", "drive", "brake_torque"),
    "motor": ("shaft_speed", "drive", "brake_torque"),
    "propeller": ("shaft_speed", "pitch_ratio", "ship_speed", "advance_velocity", "submergence",
                  "propeller_torque"),
    "load": ("shaft_speed", "drive"),
    "hull": ("ship_speed", "shaft_speed", "pitch_ratio", "thrust", "resistance", "submergence"),
    "sway": ("sway_speed", "yaw_rate", "rudder_angle", "ship_speed", "thrust"),
    "yaw": ("sway_speed", "yaw_rate", "rudder_angle", "ship_speed", "thrust"),
    "thrust": ("shaft_speed", "pitch_ratio", "ship_speed", "advance_velocity", "submergence", "thrust"),
    "pitch-actuator": ("pitch_ratio", "pitch_command", "shaft_speed", "propeller_torque", "pitch_rate"),
}  # fmt: skip
"""Signals of the formulas of each balance; external signals are allowed in every balance."""

INPUT_SIGNALS = tuple(InputSignals._fields)
"""Signals that are known before drive torque and inflow are computed."""


@dataclass(frozen=True)
class Screened:
    """Blocks at a location with their linear estimates."""

    location: str  # location in the model
    blocks: tuple[Block, ...]  # one or two blocks
    coefficients: tuple[float, ...]  # coefficient of each block
    gain: float  # gain in 2 log L


def locations_of(balances: Balances, names: Iterable[str]) -> list[str]:
    """Return the locations in the model at which a term acts on the named balances."""
    ship = balances.replay.ship
    locations = {location for name in names for location in LOCATIONS_OF_BALANCE.get(name, ())}
    if not balances.has_torque and ship.has_propeller and balances.prime_mover in names:
        locations.add("inflow_velocity")
    if not ship.has_propeller or ship.has_constant_coefficients:
        locations.discard("inflow_velocity")
    return [location for location in PLACES if location in locations]


def balance_of_location(location: str, balances: Balances) -> str:
    """Return the measured balance in which a term at a location is reported."""
    mover = balances.prime_mover
    only = {
        "drive": mover,
        "drive_torque": mover,
        "resistance": "hull",
        "side_force": "sway",
        "yaw_moment": "yaw",
        "pitch_rate": "pitch-actuator",
    }
    if location in only:
        return only[location]
    order = {
        "load_torque": ("propeller", "load", mover),
        "inflow_velocity": ("propeller", "thrust", "hull", mover),
        "thrust": ("thrust", "hull", "propeller", mover),
    }[location]
    return next(name for name in order if name in balances.names)


class Screen:
    """Linear regressors of blocks about a fitted model, which has the effects identified so far."""

    def __init__(self, fitter: Fitter, base: Fit) -> None:
        self.fitter, self.base = fitter, base
        self._blocks: dict[str, list[Block]] = {}
        self._responses: dict[str, Floats] = {}
        self._values = self.values(base.effects)

    def values(self, effects: tuple[SizedEffect, ...]) -> Values:
        """Simulate the ship with effects, and return the signals that an expression may use by name."""
        replay = self.fitter.balances.replay
        names = [name for name in TERM_SIGNALS if name in ALL_SIGNALS]
        values = replay.simulate_signals(self.fitter.trial_ship.record(effects), names)
        values["pitch_command"] = replay.command
        values["pitch_rate"] = np.gradient(values["pitch_ratio"], replay.interval_s)
        return values | replay.outside

    def signals_at(self, location: str) -> tuple[str, ...]:
        """Return the signals that a formula at a location may use."""
        balances = self.fitter.balances
        balance = balance_of_location(location, balances)
        names = SIGNALS_OF_BALANCE[balance]
        one_shaft = balances.replay.ship.has_propeller and not balances.has_torque
        if one_shaft and balance == balances.prime_mover:
            names += SIGNALS_OF_BALANCE["propeller"]
        if location in ("inflow_velocity", "drive"):
            names = tuple(name for name in names if name in INPUT_SIGNALS)
        return tuple(dict.fromkeys([*names, *balances.replay.outside]))

    def blocks(self, location: str) -> list[Block]:
        """Return the blocks of a location, made of those of its signals that vary."""
        if location not in self._blocks:
            names = self.signals_at(location)
            self._blocks[location] = make_blocks({name: self._values[name] for name in names})
        return self._blocks[location]

    def unit_response(self, location: str) -> Floats:
        """Return the response of each balance to one unit at a location, shape (balances, rows)."""
        if location not in self._responses:
            self._responses[location] = self._compute_response(location)
        return self._responses[location]

    def _compute_response(self, location: str) -> Floats:
        balances = self.fitter.balances
        replay, plant, names = balances.replay, balances.plant, balances.names
        if location in ("inflow_velocity", "drive"):
            # A contribution of the input reduces the residual, therefore the sign.
            rows = "inflow_rows" if location == "inflow_velocity" else "drive_rows"
            given = getattr(replay, rows)
            probe = PROBE * max(float(np.sqrt(np.mean(np.square(given)))), 1e-3)
            other = copy.copy(balances)
            other.replay = copy.copy(replay)
            setattr(other.replay, rows, given + probe)
            here = balances.residuals(balances.nominal)
            return np.asarray((here - other.residuals(balances.nominal)) / probe)
        factors = {balance_of_location(location, balances): 1.0}
        if location in ("load_torque", "resistance"):
            factors = dict.fromkeys(factors, -1.0)
        elif location == "pitch_rate":
            factors = dict.fromkeys(factors, replay.ship.pitch_actuator.time_constant_s)
        elif location == "thrust":
            push = float(plant["propellers"] * (1.0 - plant["thrust_deduction"]))
            factors = {"hull": push, "thrust": 1.0}
        response = np.zeros((len(names), replay.rows))
        for row, name in enumerate(names):
            response[row] = factors.get(name, 0.0)
        return response

    def columns(self, location: str, blocks: Sequence[Block], values: Values) -> Complex:
        """Return the transformed regressors of blocks at a location, shape (blocks, balances, f)."""
        balances, bands = self.fitter.balances, self.fitter.bands
        traces = np.array([block.trace(values) for block in blocks])
        if location == "pitch_rate":
            constant = self.fitter.trial_ship.ship.pitch_actuator.time_constant_s
            kept = float(np.exp(-balances.replay.interval_s / constant))
            traces = scipy.signal.lfilter([1.0 - kept], [1.0, -kept], traces, axis=1)
        response = self.unit_response(location)
        columns = np.zeros((len(blocks), len(balances.names), len(bands.order)), np.complex128)
        for row in np.flatnonzero(np.abs(response).max(axis=1) > 0.0):
            columns[:, row] = bands.transform(traces * response[row])
        return columns

    def singles_and_pairs(
        self, location: str, residual: Complex, weight: Complex, values: Values
    ) -> tuple[list[Screened], list[Screened]]:
        """Return the best blocks at a location and the best pairs of blocks, by their linear gain.

        Args:
            location: location in the model.
            residual: residual to be explained, shape (balances, frequencies).
            weight: inverse covariance by band.
            values: signals along the simulation about which the model is linearised.
        """
        blocks = self.blocks(location)
        if not blocks:
            return [], []
        white = self._whitener(weight)
        nuisance = white(self.fitter.nuisance)
        root = scipy.linalg.cholesky(nuisance @ nuisance.T + np.eye(len(nuisance)), lower=True)
        explained = scipy.linalg.solve_triangular(root, nuisance, lower=True)
        columns, rest = white(self.columns(location, blocks, values)), white(residual[None])[0]
        shared = columns @ explained.T
        gram = columns @ columns.T - shared @ shared.T
        along = columns @ rest - shared @ (explained @ rest)
        own = np.diag(gram).copy()
        independent = own > LEFT * np.einsum("kd,kd->k", columns, columns)
        own[~independent] = np.inf
        gains = along**2 / own

        def screened(which: Sequence[int], sizes: Floats, gain: float) -> Screened:
            own_blocks = tuple(blocks[i] for i in which)
            return Screened(location, own_blocks, tuple(sizes.tolist()), float(gain))

        order = [i for i in np.argsort(-gains)[:ONES].tolist() if independent[i]]
        singles = [screened([i], along[[i]] / own[i], gains[i]) for i in order]
        pairs: dict[frozenset[int], Screened] = {}
        for i in (i for i in np.argsort(-gains)[:FIRST].tolist() if independent[i]):
            cross = gram[i]
            left = own - cross**2 / own[i]
            left[~independent | (left < LEFT * own)] = np.inf
            more = (along - cross * along[i] / own[i]) ** 2 / left
            for j in np.argsort(-more)[:SECOND].tolist():
                if i != j and np.isfinite(left[j]):
                    both = [i, j]
                    sizes = np.linalg.solve(gram[np.ix_(both, both)], along[both])
                    pairs[frozenset(both)] = screened(both, sizes, gains[i] + more[j])
        return singles, sorted(pairs.values(), key=lambda pair: -pair.gain)

    def likeliest(
        self, screened: list[Screened], residual: Complex, shares: Floats, values: Values
    ) -> list[Screened]:
        """Return the best screened formulas by their gain with a free covariance, best first.

        The missing effect increases the covariance of the model. With this covariance held fixed, an
        inexact form fits nearly as well as the true form. ``shares`` are initial deviations of the
        nominal parameters, in standard deviations; other arguments are as in
        :meth:`singles_and_pairs`.
        """
        profiled = []
        for one in sorted(screened, key=lambda s: -s.gain)[:PROFILED]:
            sizes = REACH * np.abs(one.coefficients)
            columns = self.columns(one.location, one.blocks, values) * sizes[:, None, None]
            judge = Likelihood(self.fitter.bands, np.concatenate([columns, self.fitter.nuisance]))
            marginal = judge(residual, np.concatenate([np.full(len(sizes), 1.0 / REACH), shares]))
            coefficients = tuple((marginal.shares[: len(sizes)] * sizes).tolist())
            profiled.append(replace(one, coefficients=coefficients, gain=marginal.score))
        return sorted(profiled, key=lambda s: -s.gain)

    def _whitener(self, weight: Complex) -> Any:
        """Return a function that whitens residuals (..., balances, f); its squares sum to 2 log L."""
        bands = self.fitter.bands
        counts = np.diff(bands.edges)
        roots = np.repeat(np.linalg.cholesky(weight), counts, axis=0)
        sizes = np.sqrt(2.0 * bands.weights)

        def white(residuals: Complex) -> Floats:
            whitened = np.einsum("fqp,kqf->kpf", np.conj(roots), residuals, optimize=True) * sizes
            flat = whitened.reshape(len(residuals), -1)
            return np.concatenate([flat.real, flat.imag], axis=1)

        return white
