"""Which blocks a residual asks for, told by straight lines: no block is simulated here.

What one unit at a place does to the balances is found once; a block's column is then that answer times
the block along a simulation. Whitened by a model's own likelihood, and with the
nominal numbers free in their tolerances, generalised least squares says what each block would gain, and
each pair of them (orthogonal matching pursuit: Pati, Rezaiifar & Krishnaprasad 1993).
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...plant.expressions import Heard
from ...plant.terms import PLACES, TERM_SIGNALS
from ..simulate.balances import Balances
from .blocks import Block, Values, blocks_of
from .catalogue import Placed
from .fitting import Fit, Fitter
from .spectra import Complex, Likelihood

PROBE = 1e-3
"""Share of a quantity's size by which its place is felt."""

LEFT = 1e-4
"""Share of a block's power that the nominal numbers must leave, or it is one of them."""

FIRST, SECOND = 12, 8
"""Blocks at a place to which a second one is sought, and how many seconds to each."""

ONES, PROFILED = 24, 48
"""Blocks that a place hands on, and formulas of all places whose likelihood is found exactly."""

REACH = 10.0
"""Prior standard deviation of a coefficient, as a share of the screen's: next to free."""

ACTS = {
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
"""Where what a balance lacks may act; thrust is told from resistance only where it is measured."""

ASIDE = {"side_force": "sway", "yaw_moment": "yaw"}
"""Places on a ship that turns, and the balances that lack what is added there."""

HEARD = {
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
"""Signals of a balance; every one from outside is heard in all of them."""

EARLY = tuple(Heard._fields)
"""Signals that are known where drive and inflow are formed."""


@dataclass(frozen=True)
class Screened:
    """Blocks at a place as a straight line has them.

    Args:
        place: where they act.
        blocks: one or two.
        coefficients: of each.
        gain: in 2 log L.
    """

    place: str
    blocks: tuple[Block, ...]
    coefficients: tuple[float, ...]
    gain: float


def places_of(balances: Balances, names: Iterable[str]) -> list[str]:
    """Where terms may act that some balances would show.

    Args:
        balances: of ship and recordings.
        names: of balances.
    """
    ship = balances.replay.ship
    found = [place for name in names for place in ACTS.get(name, ())]
    if not balances.gauged and ship.has_propeller and balances.prime_mover in names:
        found.append("inflow_velocity")
    if not ship.has_propeller or ship.has_constant_coefficients:
        found = [place for place in found if place != "inflow_velocity"]
    return [place for place in PLACES if place in found]


def home_of(place: str, balances: Balances) -> str:
    """The balance in which a term at a place is told; it is one of those that are measured."""
    if place in ("drive", "drive_torque"):
        return balances.prime_mover
    if place == "load_torque":
        return next(n for n in ("propeller", "load", balances.prime_mover) if n in balances.names)
    if place == "resistance":
        return "hull"
    if place in ASIDE:
        return ASIDE[place]
    if place == "pitch_rate":
        return "pitch-actuator"
    order = ("thrust", "hull", "propeller", balances.prime_mover)
    if place == "inflow_velocity":
        order = ("propeller", "thrust", "hull", balances.prime_mover)
    return next(n for n in order if n in balances.names)


class Screen:
    """Straight lines about one model.

    Args:
        fitter: of the recording.
        base: effects that hold already.
    """

    def __init__(self, fitter: Fitter, base: Fit) -> None:
        self.fitter, self.base = fitter, base
        self._blocks: dict[str, list[Block]] = {}
        self._answers: dict[str, NDArray[np.float64]] = {}
        self._values = self.values(base.effects)

    def values(self, effects: tuple[Placed, ...]) -> Values:
        """Every signal that an expression may use, along a simulation, by name."""
        replay = self.fitter.balances.replay
        samples = replay.simulate(self.fitter.trial_ship.record(effects))
        names = samples.dtype.names
        found = {n: np.ascontiguousarray(samples[n]) for n in TERM_SIGNALS if n in names}
        found["pitch_command"] = replay.command
        found["pitch_rate"] = np.gradient(found["pitch_ratio"], replay.interval_s)
        return found | replay.outside

    def heard(self, place: str) -> tuple[str, ...]:
        """Signals that a formula at a place may use."""
        balances = self.fitter.balances
        home = home_of(place, balances)
        names = list(HEARD[home])
        if (
            not balances.gauged
            and home == balances.prime_mover
            and balances.replay.ship.has_propeller
        ):
            names += HEARD["propeller"]
        if place in ("inflow_velocity", "drive"):
            names = [name for name in names if name in EARLY]
        return tuple(dict.fromkeys([*names, *balances.replay.outside]))

    def blocks(self, place: str) -> list[Block]:
        """The grammar's blocks at a place, of the signals that move."""
        if place not in self._blocks:
            names = self.heard(place)
            self._blocks[place] = blocks_of({name: self._values[name] for name in names})
        return self._blocks[place]

    def answer(self, place: str) -> NDArray[np.float64]:
        """What one unit at a place does to each balance, shape (balances, rows); 0 where nothing."""
        if place not in self._answers:
            self._answers[place] = self._felt(place)
        return self._answers[place]

    def _felt(self, place: str) -> NDArray[np.float64]:
        balances = self.fitter.balances
        replay, plant, names = balances.replay, balances.plant, balances.names
        if place in ("inflow_velocity", "drive"):
            # a model that has it already lacks so much less
            rows = "inflow_rows" if place == "inflow_velocity" else "drive_rows"
            given = getattr(replay, rows)
            probe = PROBE * max(float(np.sqrt(np.mean(np.square(given)))), 1e-3)
            other = copy.copy(balances)
            other.replay = copy.copy(replay)
            setattr(other.replay, rows, given + probe)
            here = balances.residuals(balances.nominal)
            return np.asarray((here - other.residuals(balances.nominal)) / probe)
        push = float(plant["propellers"] * (1.0 - plant["thrust_deduction"]))
        does = {
            "drive_torque": {balances.prime_mover: 1.0},
            "load_torque": dict.fromkeys([home_of(place, balances)], -1.0),
            "thrust": {"hull": push, "thrust": 1.0},
            "resistance": {"hull": -1.0},
            "side_force": {"sway": 1.0},
            "yaw_moment": {"yaw": 1.0},
            "pitch_rate": {"pitch-actuator": replay.ship.pitch_actuator.time_constant_s},
        }[place]
        found = np.zeros((len(names), replay.rows))
        for name, factor in does.items():
            if name in names:
                found[names.index(name)] = factor
        return found

    def columns(self, place: str, blocks: Sequence[Block], values: Values) -> Complex:
        """What blocks at a place do to the balances, transformed; shape (blocks, balances, f)."""
        balances, bands = self.fitter.balances, self.fitter.bands
        traces = np.array([block.trace(values) for block in blocks])
        if place == "pitch_rate":
            constant = self.fitter.trial_ship.ship.pitch_actuator.time_constant_s
            kept = float(np.exp(-balances.replay.interval_s / constant))
            traces = scipy.signal.lfilter([1.0 - kept], [1.0, -kept], traces, axis=1)
        answer = self.answer(place)
        found = np.zeros((len(blocks), len(balances.names), len(bands.order)), np.complex128)
        for row in np.flatnonzero(np.abs(answer).max(axis=1) > 0.0):
            found[:, row] = bands.transform(traces * answer[row])
        return found

    def singles_and_pairs(
        self, place: str, residual: Complex, weight: Complex, values: Values
    ) -> tuple[list[Screened], list[Screened]]:
        """The best blocks at a place and the best pairs of them, by what they would gain.

        Args:
            place: where they act.
            residual: that they are to explain, shape (balances, frequencies).
            weight: inverse covariance by band.
            values: of the signals along the simulation about which lines are drawn.
        """
        blocks = self.blocks(place)
        if not blocks:
            return [], []
        white = self._whitener(weight)
        nuisance = white(self.fitter.nuisance)
        root = scipy.linalg.cholesky(nuisance @ nuisance.T + np.eye(len(nuisance)), lower=True)
        explained = scipy.linalg.solve_triangular(root, nuisance, lower=True)
        columns = white(self.columns(place, blocks, values))
        rest = white(residual[None])[0]
        taken = columns @ explained.T
        gram = columns @ columns.T - taken @ taken.T
        along = columns @ rest - taken @ (explained @ rest)
        own = np.diag(gram).copy()
        told = own > LEFT * np.einsum("kd,kd->k", columns, columns)
        own[~told] = np.inf
        gains = along**2 / own
        order = np.argsort(-gains)
        singles = [
            Screened(place, (blocks[i],), (float(along[i] / own[i]),), float(gains[i]))
            for i in order[:ONES] if told[i]
        ]  # fmt: skip
        pairs: dict[frozenset[int], Screened] = {}
        for i in order[:FIRST]:
            if not told[i]:
                continue
            cross = gram[i]
            left = own - cross**2 / own[i]
            left[~told] = np.inf
            left[left < LEFT * own] = np.inf
            more = (along - cross * along[i] / own[i]) ** 2 / left
            for j in np.argsort(-more)[:SECOND]:
                if i == j or not np.isfinite(left[j]):
                    continue
                both = np.array([i, j])
                sizes = np.linalg.solve(gram[np.ix_(both, both)], along[both])
                pairs[frozenset((int(i), int(j)))] = Screened(
                    place, (blocks[i], blocks[j]), tuple(map(float, sizes)),
                    float(gains[i] + more[j]),
                )  # fmt: skip
        return singles, sorted(pairs.values(), key=lambda one: -one.gain)

    def likeliest(
        self,
        screened: list[Screened],
        residual: Complex,
        shares: NDArray[np.float64],
        values: Values,
    ) -> list[Screened]:
        """The best of a screen by what they gain with the covariance free, best first.

        Under one covariance for all, which what is missing may have made large, a form that is nearly
        right looks as good as the right one.

        Args:
            screened: of any places.
            residual: that they are to explain, shape (balances, frequencies).
            shares: of the nominal numbers' tolerances, to begin with.
            values: of the signals along the simulation about which lines are drawn.
        """
        found = []
        for one in sorted(screened, key=lambda s: -s.gain)[:PROFILED]:
            sizes = REACH * np.abs(one.coefficients)
            columns = self.columns(one.place, one.blocks, values) * sizes[:, None, None]
            judge = Likelihood(self.fitter.bands, np.concatenate([columns, self.fitter.nuisance]))
            marginal = judge(residual, np.concatenate([np.full(len(sizes), 1.0 / REACH), shares]))
            coefficients = marginal.shares[: len(sizes)] * sizes
            found.append(
                replace(one, coefficients=tuple(map(float, coefficients)), gain=marginal.score)
            )
        return sorted(found, key=lambda s: -s.gain)

    def _whitener(self, weight: Complex) -> Any:
        """Turns transformed residuals (..., balances, f) into rows whose squares add up to 2 log L."""
        bands = self.fitter.bands
        counts = np.diff(bands.edges)
        roots = np.repeat(np.linalg.cholesky(weight), counts, axis=0)
        sizes = np.sqrt(2.0 * bands.weights)

        def white(found: Complex) -> NDArray[np.float64]:
            turned = np.einsum("fqp,kqf->kpf", np.conj(roots), found, optimize=True) * sizes
            flat = turned.reshape(len(found), -1)
            return np.concatenate([flat.real, flat.imag], axis=1)

        return white
