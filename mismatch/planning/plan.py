"""Plan the manoeuvres that decide between models which a recording cannot distinguish.

A diagnosis may end with alternatives: several models that the recording supports alike. A recording
with too little excitation may hide any effect of the catalogue below its detection limit. The intervals
of a single model may be wide. The programme grows by one manoeuvre at a time. Of random manoeuvres that
begin where the last one has ended, the one with the largest merit together with those before it is taken
(:mod:`.evidence`). Then the commands are held in intervals and exchanged one at a time where that is
better (:mod:`.exchange`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from ...core.statistics import HALF_95
from ...plant.columns import (
    ALWAYS_SIMULATED,
    MEASURED,
    RUDDER,
    SHAFT_SPEED,
    TURNING_COLUMNS,
    absent_columns,
    drive_column,
    simulated_columns,
)
from ...plant.recording import RecordingError
from ...plant.ship import Ship, ShipError
from ..estimate import Tick, ignore_progress
from ..search.selection import INDISTINGUISHABLE
from ..simulate.joint_replay import JointReplay
from .evidence import (
    Evidence,
    Noise,
    Predictions,
    Predictor,
    evidence_of,
    evidence_over_time,
    pair_names,
)
from .exchange import exchange
from .manoeuvres import (
    INTERVAL_S,
    Floats,
    Limits,
    Manoeuvre,
    PlanError,
    command_ranges,
    hold_commands,
    is_inside,
    random_manoeuvre,
    steps_of,
    table_of,
)

DECIDED = INDISTINGUISHABLE
"""Difference in 2 log L from which a pair of models counts as decided: one is 20 times as probable."""

TIME_STEP_S = 0.25
"""Time step of the predictions, where the ship allows it [s]."""

LEAST_STEP_S = 0.02
"""Shortest time step of a ship for which a trial can be planned [s]."""

MANOEUVRE_S = 300.0
"""Usual length of a manoeuvre."""

POOL = 24
"""Number of random manoeuvres from which each one of a programme is chosen."""

HELD, LEVELS = 12, 3
"""Largest number of intervals in which commands are held, and of values tried for each command."""

PARTS = 3
"""Number of equal parts of a programme after each of which the exchange of commands counts its merit."""

RANDOM = 6
"""Number of random programmes to which the result is compared."""

INSTRUMENTS = (
    "shaft_torque_N_m",
    "thrust_N",
    "ship_speed_m_s",
    "pitch_ratio",
    SHAFT_SPEED,
    "motor_current_A",
)
"""Channels that a further instrument may measure."""

BLOCK_S = 10.0
"""Interval at which the expected evidence is computed during a programme."""

SENSOR_NOISE = 0.01
"""Assumed noise of an instrument that the recording did not have, over the rms of its channel."""


def _leaves(tree: Any, at: str = "") -> Iterator[tuple[str, float]]:
    """Yield key and value of each parameter in the tables of a ship file, terms included."""
    for name, item in tree.items():
        key = f"{at}{name}"
        if name == "term":
            for term in item:
                for own, declared in term["parameters"].items():
                    yield f"term.{term['id']}.{own}", float(declared["value"])
        elif isinstance(item, dict) and name not in ("signals", "tolerances"):
            yield from _leaves(item, f"{key}.")
        elif isinstance(item, int | float) and not isinstance(item, bool):
            yield key, float(item)


def own_effects(models: Mapping[str, Ship]) -> dict[str, dict[str, float]]:
    """Return the parameters of the effects in which each model differs from others, with their sizes.

    The size is the distance from the value that switches the effect off, or that of a term's parameter
    from 0. A rival may fit these parameters to the new recording. Effects that all models share are not
    among them.
    """
    values = {name: dict(_leaves(ship.model_dump())) for name, ship in models.items()}
    found: dict[str, dict[str, float]] = {}
    for name, own in values.items():
        sizes = {}
        for key, value in own.items():
            if all(other.get(key) == value for other in values.values()):
                continue
            with contextlib.suppress(ShipError):  # a key without influence on this ship
                neutral = models[name].parameter(key).info.neutral
                if neutral is None and key.startswith("term."):
                    neutral = 0.0
                if neutral is not None and value != neutral and math.isfinite(value):
                    sizes[key] = abs(value - neutral) if math.isfinite(neutral) else abs(value)
        found[name] = sizes
    return found


@dataclass(frozen=True)
class TrialPlan:
    """Programme of a trial, and what it is expected to decide.

    Args:
        table: commands at every second, as ``shaftline simulate --inputs`` takes them.
        steps: a row for each manoeuvre: start and end [min], what it is.
        pairs: a row for each pair of models: expected difference in 2 log L at the end, minutes until
            it is :data:`DECIDED` (NaN where it is not reached), the mean of random programmes of equal
            length, and the minutes with each instrument that the recording did not have.
        intervals: a row for each uncertain parameter of the first model: its value, and the half-width
            of its 95 % interval from noise before and after the trial.
        history: expected difference in 2 log L of each pair (columns) over the minutes (index).
        predicted: predictions by model, arrays of shape (channels, rows).
        channels: measured channels.
        noise: noise of each channel.
    """

    table: pd.DataFrame
    steps: pd.DataFrame
    pairs: pd.DataFrame
    intervals: pd.DataFrame
    history: pd.DataFrame
    predicted: Mapping[str, Floats]
    channels: tuple[str, ...]
    noise: tuple[Noise, ...]

    @property
    def least(self) -> float:
        """Expected difference in 2 log L of the pair that is hardest to decide; NaN for one model."""
        return float(self.pairs["expected_2logL"].min()) if len(self.pairs) else math.nan


def plan_trial(
    models: Mapping[str, Ship],
    noise: Mapping[str, Noise],
    minutes: float = 30.0,
    limits: Limits = Limits(),  # noqa: B008 (immutable)
    *,
    uncertain: Mapping[str, float] | None = None,
    seed: int = 0,
    pool: int = POOL,
    tick: Tick = ignore_progress,
) -> TrialPlan:
    """Plan a trial that decides between models, or that narrows the intervals of a single one.

    Args:
        models: ships by the names of the models, such as the corrected ship of a diagnosis and its
            alternatives; a single one with ``uncertain`` parameters.
        noise: noise of each measured channel, by canonical column.
        minutes: length of the trial [min].
        limits: limits of commands, shaft speed, ship speed and rudder.
        uncertain: present standard errors of parameters of the first model by dotted key, in the unit of
            the key.
        seed: of the random manoeuvres.
        pool: number of random manoeuvres from which each one of the programme is chosen.
        tick: progress callback ``tick(stage, done, total)``.

    Raises:
        PlanError: nothing to decide or to narrow, models that do not differ or drive different shafts,
            an unknown channel or parameter, limits outside what the ship can do, or no manoeuvre within
            the limits.

    Examples:
        >>> from shaftline.plant import load_ship
        >>> clean = load_ship("frigate")
        >>> models = {
        ...     "fouled": clean.with_values({"hull.fouling_fraction": 0.1}),
        ...     "current": clean.with_values({"hull.current_m_s": -0.3}),
        ... }
        >>> noise = {"ship_speed_m_s": Noise(0.05), "shaft_speed_rad_s": Noise(0.02)}
        >>> plan = plan_trial(models, noise, minutes=10.0, pool=6)
        >>> len(plan.table), plan.least > DECIDED
        (600, True)

        >>> fouling = {"hull.fouling_fraction": 0.05}
        >>> plan = plan_trial({"fouled": models["fouled"]}, noise, 10.0, uncertain=fouling, pool=6)
        >>> plan.intervals[["key", "value", "half_95_before"]].round(3).to_dict("records")
        [{'key': 'hull.fouling_fraction', 'value': 0.1, 'half_95_before': 0.098}]
    """
    uncertain = uncertain or {}
    models = {name: _coarse(one) for name, one in models.items()}
    ship, channels = _check(models, noise, minutes, uncertain), tuple(noise)
    sizes, first = own_effects(models), next(iter(models))
    sizes[first] |= uncertain
    others = [c for c in INSTRUMENTS if c not in noise and c in _channels(ship)]
    predictor = Predictor(models, sizes, (*channels, *others))
    slots = max(1, round(60.0 * minutes / MANOEUVRE_S))
    rows = round(60.0 * minutes / INTERVAL_S) // slots
    room_m = math.inf if limits.sea_room_m is None else limits.sea_room_m / slots
    search = _Search(ship, predictor, tuple(noise.values()), limits, rows, room_m)
    generator = np.random.default_rng(seed)
    best = search.programme(slots, pool, generator, tick)
    if pool > 1:
        best = search.exchange_commands(best, room_m * slots, tick)
    random = []
    for k in range(RANDOM):
        tick("comparing with random programmes", k, RANDOM)
        programme = table_of(ship, search.programme(slots, 1, generator))
        random.append(evidence_of(search.measured(predictor(programme)), search.noise))
    whole = table_of(ship, best)
    predictions = predictor(whole)
    measured = search.measured(predictions)
    both = pair_names([*models])
    history = _history(measured, search.noise, both)
    pairs = _table_of_pairs(both, history, random)
    for channel, wider, size in _with_instruments(predictions, len(channels), others):
        known = (*search.noise, Noise(SENSOR_NOISE * size))
        pairs[f"minutes_with_{channel}"] = [
            _minutes_until(values) for _, values in _history(wider, known, both).items()
        ]
    return TrialPlan(
        table=whole,
        steps=steps_of(ship, best),
        pairs=pairs,
        intervals=_intervals(
            predictor, uncertain, sizes[first], evidence_of(measured, search.noise)
        ),
        history=history,
        predicted=dict(zip(models, measured.own, strict=True)),
        channels=channels,
        noise=search.noise,
    )


@dataclass(frozen=True)
class _Search:
    """Search of a programme of manoeuvres of equal length."""

    ship: Ship
    predictor: Predictor
    noise: tuple[Noise, ...]
    limits: Limits
    rows: int  # of a manoeuvre
    room_m: float = math.inf  # longest distance of a manoeuvre [m]

    def measured(self, predictions: Predictions) -> Predictions:
        """Return the predictions of the channels that the recording has."""
        return predictions.of_channels(range(len(self.noise)))

    def programme(
        self, slots: int, pool: int, generator: np.random.Generator, tick: Tick = ignore_progress
    ) -> list[Manoeuvre]:
        """Return manoeuvres, each the best of a pool of random ones after those before it.

        Raises:
            PlanError: no manoeuvre stays within the limits.
        """
        chosen: list[Manoeuvre] = []
        total: Evidence | None = None
        begin: dict[str, float] = {}
        for slot in range(slots):
            options: list[tuple[float, Manoeuvre, Evidence | None]] = []
            tries = 0
            while len(options) < pool and tries < 20 * max(pool, 5):
                tries += 1
                manoeuvre = random_manoeuvre(self.ship, self.limits, self.rows, generator)
                table = table_of(self.ship, [manoeuvre]).assign(**begin)
                found: Evidence | None = None
                merit = 0.0
                if pool == 1 and self.simulate_within_limits(table) is None:
                    continue
                if pool > 1:
                    predictions = self.predict_within_limits(table)
                    if predictions is None:
                        continue
                    found = evidence_of(predictions, self.noise)
                    found = found if total is None else total.plus(found)
                    merit = found.merit()
                options.append((merit, manoeuvre, found))
                tick("simulating manoeuvres", slot * pool + len(options), slots * pool)
            if not options:
                raise PlanError(
                    f"none of {tries} random manoeuvres of {self.rows * INTERVAL_S:g} s stays within "
                    "the limits; widen drive, pitch_ratio, shaft_speed_rad_s, ship_speed_m_s or "
                    "sea_room_m"
                )
            _, manoeuvre, total = max(options, key=lambda option: option[0])
            chosen.append(manoeuvre)
            begin = self.state_after(table_of(self.ship, chosen))
        return chosen

    def exchange_commands(
        self, chosen: list[Manoeuvre], room_m: float, tick: Tick = ignore_progress
    ) -> list[Manoeuvre]:
        """Return a programme of held commands that is better than the chosen one, or the chosen one.

        The means of the commands over intervals are replaced one at a time by the ends and the middle of
        their range, and kept where that increases the merit. The rudder stays amidships.

        Args:
            chosen: manoeuvres; those of a ship that turns are not changed if they use the rudder.
            room_m: longest distance of the programme [m].
            tick: progress callback.
        """
        if any(m.rudder.any() for m in chosen):
            return chosen
        whole = replace(self, room_m=room_m)
        drive, pitch = (np.concatenate(values) for values in list(zip(*chosen, strict=True))[1:3])
        least = max(1, round(self.limits.shortest_hold_s / INTERVAL_S))
        count = max(1, min(HELD, len(drive) // least))
        edges = [round(k * len(drive) / count) for k in range(count + 1)]
        ends = command_ranges(self.ship, self.limits)
        choices = {
            k: np.linspace(*both, LEVELS) for k, both in enumerate(ends) if both[0] < both[1]
        }
        levels = np.array([[x[a:b].mean() for a, b in pairwise(edges)] for x in (drive, pitch)])

        def merit_of(values: Floats) -> float:
            return whole.mean_merit(table_of(self.ship, hold_commands(values, edges)))

        levels, best = exchange(levels, choices, merit_of, tick=tick)
        before = whole.mean_merit(table_of(self.ship, chosen))
        return hold_commands(levels, edges) if best > before else chosen

    def mean_merit(self, table: pd.DataFrame) -> float:
        """Return the mean of a programme's merit after each of :data:`PARTS`; -inf outside the limits.

        A trial that decides early may be stopped early.
        """
        predictions = self.predict_within_limits(table)
        if predictions is None:
            return -math.inf
        found = evidence_over_time(predictions, self.noise, -(-len(table) // PARTS))
        return float(np.mean([one.merit() for one in found]))

    def predict_within_limits(self, table: pd.DataFrame) -> Predictions | None:
        """Return the predictions of all models; None if one leaves the limits."""
        simulated = self.simulate_within_limits(table)
        if simulated is None:
            return None
        return self.measured(self.predictor.differentiate(simulated))

    def simulate_within_limits(self, table: pd.DataFrame) -> list[tuple[JointReplay, Any]] | None:
        """Return the simulations of all models; None if one leaves the limits or the envelope."""
        simulated = []
        try:
            for one in self.predictor.simulate(table):
                if not is_inside(one[0].ship, one[1], self.limits, self.room_m):
                    return None
                simulated.append(one)
        except (RecordingError, ShipError, ValueError):  # no equilibrium at the first commands
            return None
        return simulated

    def state_after(self, table: pd.DataFrame) -> dict[str, float]:
        """Return the measurements at the end of a programme by the first model, by column."""
        ship = next(iter(self.predictor.models.values()))
        last = JointReplay(ship, table).simulate(ship.record())[-1]
        state = (*ALWAYS_SIMULATED, *TURNING_COLUMNS)
        known = set(_channels(ship)) & set(state) - {"shaft_torque_N_m", RUDDER}
        return {column: float(last[MEASURED[column]]) for column in sorted(known)}


def _channels(ship: Ship) -> list[str]:
    """Return the measured columns that a ship can have."""
    return [c for c in simulated_columns(ship) if c not in absent_columns(ship)]


def _coarse(ship: Ship) -> Ship:
    """Return the ship with a longer time step, if it resolves the time constants of the ship."""
    with contextlib.suppress(ShipError):
        if ship.time_step_s < TIME_STEP_S:
            return ship.with_values({"integration.time_step_s": TIME_STEP_S})
    return ship


def _check(
    models: Mapping[str, Ship],
    noise: Mapping[str, Noise],
    minutes: float,
    uncertain: Mapping[str, float],
) -> Ship:
    """Refuse what cannot be planned; return the ship of the first model."""
    if not models or (len(models) == 1 and not uncertain):
        raise PlanError(
            f"{len(models)} model given and no uncertain parameter: give two models or more to decide "
            "between, or the standard errors of the parameters of a single one as `uncertain`"
        )
    ship = next(iter(models.values()))
    for key, sd in uncertain.items():
        if not ship.has_key(key):
            raise PlanError(f"uncertain: {key} is no parameter of {ship.name}")
        if not (math.isfinite(sd) and sd > 0.0):
            raise PlanError(f"uncertain: standard error of {key} = {sd:g}: must be above 0")
    for name, other in models.items():
        if drive_column(other) != drive_column(ship) or other.turns != ship.turns:
            raise PlanError(f"{name}: is not the same kind of ship as {next(iter(models))}")
        if other.time_step_s < LEAST_STEP_S:
            raise PlanError(
                f"{name}: its time step of {other.time_step_s:g} s is that of a test rig, too fast for "
                f"programmes with a row every {INTERVAL_S:g} s"
            )
        if other.external_signals:
            raise PlanError(
                f"{name}: uses {', '.join(other.external_signals)} from the recording, which a plan "
                "cannot predict; leave this model out"
            )
    known = _channels(ship)
    if unknown := [c for c in noise if c not in known]:
        raise PlanError(
            f"{unknown[0]}: no channel that {ship.name} simulates; known: {', '.join(known)}"
        )
    if not noise:
        raise PlanError("no measured channel is given")
    for channel, one in noise.items():
        if not (math.isfinite(one.sd) and one.sd > 0.0 and one.time_s >= 0.0):
            raise PlanError(
                f"{channel}: noise {one.sd:g} with correlation time {one.time_s:g} s; must be above 0"
            )
    if not 1.0 <= minutes <= 24.0 * 60.0:
        raise PlanError(f"minutes = {minutes:g}: must be 1 to 1440")
    if len(models) > 1 and all(one == ship for one in models.values()):
        raise PlanError("the models do not differ in any parameter")
    return ship


def _minutes_until(history: pd.Series[float]) -> float:
    """Return the minutes from which on a pair is decided to the end; NaN where it never is."""
    late = history[history < DECIDED].index
    after = history.index[history.index > (late[-1] if len(late) else 0.0)]
    return float(after[0]) if len(after) else math.nan


def _history(
    predictions: Predictions, noise: Sequence[Noise], pairs: Sequence[tuple[str, str]]
) -> pd.DataFrame:
    """Return lambda of each pair (columns) over the minutes (index)."""
    block = round(BLOCK_S / INTERVAL_S)
    values = [one.pairs() for one in evidence_over_time(predictions, noise, block)]
    rows = predictions.own.shape[-1]
    ends = np.minimum(block * np.arange(1, len(values) + 1), rows)
    index = pd.Index(ends * INTERVAL_S / 60.0, name="minutes")
    names = [f"{i} or {j}" for i, j in pairs]
    return pd.DataFrame(np.reshape(values, (len(values), len(names))), index=index, columns=names)


def _table_of_pairs(
    pairs: Sequence[tuple[str, str]], history: pd.DataFrame, random: Sequence[Evidence]
) -> pd.DataFrame:
    """Return the table of pairs, without further instruments."""
    mean = np.mean([one.pairs() for one in random], axis=0)
    columns = ["model", "rival", "expected_2logL", "minutes", "random_2logL"]
    rows = [
        (*pair, float(values.iloc[-1]), _minutes_until(values), float(other))
        for pair, (_, values), other in zip(pairs, history.items(), mean, strict=True)
    ]
    return pd.DataFrame(rows, columns=columns)


def _with_instruments(
    predictions: Predictions, measured: int, others: Sequence[str]
) -> Iterator[tuple[str, Predictions, float]]:
    """Yield each further instrument with the predictions including it, and the rms of its channel."""
    for k, channel in enumerate(others, measured):
        size = float(np.sqrt(np.mean(predictions.own[:, k] ** 2)))
        if size > 0.0:
            yield channel, predictions.of_channels([*range(measured), k]), size


def _intervals(
    predictor: Predictor,
    uncertain: Mapping[str, float],
    sizes: Mapping[str, float],
    evidence: Evidence,
) -> pd.DataFrame:
    """Return the half-widths of the 95 % intervals of uncertain parameters before and after a trial."""
    ship = next(iter(predictor.models.values()))
    errors = np.sqrt(np.diag(evidence.covariance()))
    own = dict(zip(predictor.keys_of(0), errors.tolist(), strict=True))
    return pd.DataFrame(
        [
            {
                "key": key,
                "value": ship.parameter(key).value,
                "half_95_before": HALF_95 * sd,
                "half_95_after": HALF_95 * sizes[key] * own[key],
            }
            for key, sd in uncertain.items()
            if key in own
        ],
        columns=["key", "value", "half_95_before", "half_95_after"],
    )
