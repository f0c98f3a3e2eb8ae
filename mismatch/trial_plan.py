"""Plan the manoeuvres that decide between models which a recording cannot distinguish.

A diagnosis may end with alternatives: several models that the recording supports alike. Each model
predicts the measurements of a manoeuvre. The expected evidence against model j if model i is true is

    lambda_ij = min over x of |W (y_i - y_j(x))|^2 + |x|^2,

with W the whitening by the noise of the instruments and x the changes of the parameters of model j, in
prior standard deviations: a rival may fit its own parameters to the new recording. It is the expected
difference in 2 log L (T-optimality, Atkinson and Fedorov 1975, Biometrika 62(1); Box and Hill 1967,
Technometrics 9(1)). The predictions are linear in x here, so that the evidence is a sum over manoeuvres:

    lambda = a - b' (C + I)^-1 b,   a = |W d|^2, b = (W J)' W d, C = (W J)' W J

where d = y_i - y_j and J the derivatives of y_j by x. The programme grows by one manoeuvre at a time. Of
random ones that begin where the last one has ended, the one is taken that makes the least lambda over
all pairs of models largest, for the worse case of which one is true.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..plant.columns import (
    ALWAYS_SIMULATED,
    MEASURED,
    RUDDER,
    SHAFT_SPEED,
    TURNING_COLUMNS,
    absent_columns,
    drive_column,
    simulated_columns,
)
from ..plant.recording import RecordingError
from ..plant.ship import Ship, ShipError
from .estimate import Tick, ignore_progress
from .search.selection import INDISTINGUISHABLE
from .simulate.balances import tolerance_perturbations
from .simulate.joint_replay import NO_SHIFT, JointReplay
from .trial_manoeuvres import (
    INTERVAL_S,
    Floats,
    Limits,
    Manoeuvre,
    PlanError,
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

RANDOM = 6
"""Number of random programmes to which the result is compared."""

STEP = 0.02
"""Step of the derivatives, in prior standard deviations."""

INSTRUMENTS = (
    "shaft_torque_N_m",
    "thrust_N",
    "ship_speed_m_s",
    "pitch_ratio",
    SHAFT_SPEED,
    "motor_current_A",
)
"""Channels that a further instrument may measure."""

SENSOR_NOISE = 0.01
"""Assumed noise of an instrument that the recording did not have, over the rms of its channel."""


class Noise(NamedTuple):
    """Difference between measurement and simulation of a channel that no model explains."""

    sd: float
    """Standard deviation, in the unit of the channel."""
    time_s: float = 0.0
    """Correlation time [s]; 0 for white noise."""


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


class _Predictor:
    """Predictions of one model, and their derivatives by what the model may change.

    A model may change the parameters of its own effects (``sizes``: prior standard deviation by key),
    all parameters within the tolerances of the ship file, and the first state.
    """

    def __init__(self, ship: Ship, sizes: Mapping[str, float], channels: Sequence[str]) -> None:
        self.ship, self.sizes, self.channels = ship, sizes, channels
        self.record = ship.record()
        self._changed: list[tuple[Any, tuple[float, ...], float]] | None = None

    def _changes(self, replay: JointReplay) -> list[tuple[Any, tuple[float, ...], float]]:
        """Return changed ship records, shifts of the first state, and changes in standard deviations."""
        if self._changed is None:
            self._changed = list(self._effects())
            for one in tolerance_perturbations(replay, free=self.sizes):
                self._changed.append((one.record, one.start, one.share))
        return self._changed

    def _effects(self) -> Iterator[tuple[Any, tuple[float, ...], float]]:
        for key, sd in self.sizes.items():
            with contextlib.suppress(ShipError):  # a key without influence on this ship
                number = self.ship.parameter(key)
                low, high = number.search_range
                for step in (STEP, -STEP):
                    if low <= number.value + step * sd <= high:
                        record = self.ship.record()
                        number.write(record, number.value + step * sd)
                        yield record, NO_SHIFT, step
                        break

    def measured(self, samples: Any) -> Floats:
        """Return the measured channels of samples, shape (channels, rows)."""
        return np.array([samples[MEASURED[c]] for c in self.channels])

    def __call__(self, table: pd.DataFrame) -> Prediction:
        """Return what the model predicts for a table of commands."""
        return self.differentiate(*self.simulate(table))

    def simulate(self, table: pd.DataFrame) -> tuple[JointReplay, Any]:
        """Return the replay of a table of commands, and its samples."""
        replay = JointReplay(self.ship, table)
        return replay, replay.simulate(self.record)

    def differentiate(self, replay: JointReplay, samples: Any) -> Prediction:
        """Return the prediction of which ``samples`` are the simulation, with its derivatives."""
        own = self.measured(samples)
        changes = self._changes(replay)
        slopes = [
            (self.measured(replay.simulate(record, shift)) - own) / share
            for record, shift, share in changes
        ]
        starts = np.array([any(shift) for _, shift, _ in changes], dtype=bool)
        return Prediction(own, np.reshape(slopes, (-1, *own.shape)), starts)


class Prediction(NamedTuple):
    """Prediction of a model, and its derivatives by unknowns of unit prior variance."""

    own: Floats
    """Measured channels, shape (channels, rows)."""
    slopes: Floats
    """Derivatives, shape (unknowns, channels, rows)."""
    starts: NDArray[np.bool_]
    """Whether each unknown is a shift of the first state, which every manoeuvre has anew."""


def _whiten(values: Floats, noise: Sequence[Noise]) -> Floats:
    """Return values (..., channels, rows) whitened by the noise of each channel, shape (..., n)."""
    parts = []
    for k, one in enumerate(noise):
        channel = values[..., k, :]
        keeps = math.exp(-INTERVAL_S / one.time_s) if one.time_s > 0.0 else 0.0
        white = (channel[..., 1:] - keeps * channel[..., :-1]) / (
            one.sd * math.sqrt(1.0 - keeps**2)
        )
        parts.append(white)
    return np.stack(parts, axis=-2)


class _Evidence(NamedTuple):
    """Sums of one pair of models over rows: |W d|^2, (W J)' W d and (W J)' W J."""

    a: Any
    b: Any
    c: Any

    def plus(self, other: _Evidence) -> _Evidence:
        """Return the sums of two manoeuvres."""
        return _Evidence(self.a + other.a, self.b + other.b, self.c + other.c)

    def without(self, own: NDArray[np.bool_]) -> _Evidence:
        """Return the sums after the rival has fitted some unknowns, which are left out."""
        rest = ~own
        inner = self.c[np.ix_(own, own)] + np.eye(int(own.sum()))
        cross = self.c[np.ix_(rest, own)]
        fitted = np.linalg.solve(inner, np.column_stack([self.b[own], cross.T]))
        return _Evidence(
            self.a - self.b[own] @ fitted[:, 0],
            self.b[rest] - cross @ fitted[:, 0],
            self.c[np.ix_(rest, rest)] - cross @ fitted[:, 1:],
        )

    def value(self) -> float:
        """Return lambda; all unknowns have unit prior variance."""
        return float(self.without(np.ones(len(self.b), dtype=bool)).a)


Pair = tuple[str, str]
Evidence = dict[Pair, _Evidence]


def evidence_of(
    predictions: Mapping[str, Prediction],
    noise: Sequence[Noise],
    rows: int | None = None,
) -> Evidence:
    """Return the sums of every ordered pair (true model, rival) over the first rows."""
    found = {}
    for true, rival in itertools.permutations(predictions, 2):
        own, (other, slopes, starts) = predictions[true].own, predictions[rival]
        difference = _whiten(own - other, noise)[..., :rows].ravel()
        derivatives = _whiten(slopes, noise)[..., :rows].reshape(len(slopes), -1)
        sums = _Evidence(
            difference @ difference, derivatives @ difference, derivatives @ derivatives.T
        )
        found[true, rival] = sums.without(starts)
    return found


def _pairs(models: Sequence[str]) -> list[Pair]:
    return list(itertools.combinations(models, 2))


def worst_of(evidence: Evidence) -> dict[Pair, float]:
    """Return lambda of each pair of models, the smaller one of the two that may be true."""
    names = list(dict.fromkeys(name for pair in evidence for name in pair))
    return {(i, j): min(evidence[i, j].value(), evidence[j, i].value()) for i, j in _pairs(names)}


@dataclass(frozen=True)
class TrialPlan:
    """Programme of a trial, and what it is expected to decide.

    Args:
        table: commands at every second, as ``shaftline simulate --inputs`` takes them.
        steps: a row for each manoeuvre: start and end [min], what it is.
        pairs: a row for each pair of models: expected difference in 2 log L at the end, minutes until
            it is :data:`DECIDED` (NaN where it is not reached), the mean of random programmes of equal
            length, and the minutes with each instrument that the recording did not have.
        history: expected difference in 2 log L of each pair (columns) over the minutes (index).
        predicted: predictions by model, arrays of shape (channels, rows).
        channels: measured channels.
        noise: noise of each channel.
    """

    table: pd.DataFrame
    steps: pd.DataFrame
    pairs: pd.DataFrame
    history: pd.DataFrame
    predicted: Mapping[str, Floats]
    channels: tuple[str, ...]
    noise: tuple[Noise, ...]

    @property
    def least(self) -> float:
        """Expected difference in 2 log L of the pair that is hardest to decide."""
        return float(self.pairs["expected_2logL"].min())


def plan_trial(
    models: Mapping[str, Ship],
    noise: Mapping[str, Noise],
    minutes: float = 30.0,
    limits: Limits = Limits(),  # noqa: B008 (immutable)
    *,
    seed: int = 0,
    pool: int = POOL,
    tick: Tick = ignore_progress,
) -> TrialPlan:
    """Plan a trial that decides between models.

    Args:
        models: ships by the names of the models, two at least, such as the corrected ship of a diagnosis
            and its alternatives.
        noise: noise of each measured channel, by canonical column.
        minutes: length of the trial [min].
        limits: limits of commands, shaft speed, ship speed and rudder.
        seed: of the random manoeuvres.
        pool: number of random manoeuvres from which the programme is chosen.
        tick: progress callback ``tick(stage, done, total)``.

    Raises:
        PlanError: fewer than two models, models that do not differ or drive different shafts, an unknown
            channel, limits outside what the ship can do, or no manoeuvre within the limits.

    Examples:
        >>> from shaftline.plant import load_ship
        >>> clean = load_ship("frigate")
        >>> models = {
        ...     "fouled": clean.with_values({"hull.fouling_fraction": 0.1}),
        ...     "current": clean.with_values({"hull.current_m_s": -0.3}),
        ... }
        >>> noise = {"ship_speed_m_s": Noise(0.05), "shaft_speed_rad_s": Noise(0.02)}
        >>> plan = plan_trial(models, noise, minutes=10.0, pool=6)
        >>> len(plan.table), len(plan.steps), plan.least > DECIDED
        (600, 2, True)
    """
    models = {name: _coarse(one) for name, one in models.items()}
    ship, sizes, channels = _check(models, noise, minutes), own_effects(models), tuple(noise)
    predictors = {name: _Predictor(one, sizes[name], channels) for name, one in models.items()}
    slots = max(1, round(60.0 * minutes / MANOEUVRE_S))
    search = _Search(
        ship, predictors, tuple(noise.values()), limits, round(60.0 * minutes / INTERVAL_S) // slots
    )
    generator = np.random.default_rng(seed)
    best = search.programme(slots, pool, generator, tick)
    others = []
    for k in range(RANDOM):
        tick("comparing with random programmes", k, RANDOM)
        others.append(search.judge(search.programme(slots, 1, generator)))
    whole = table_of(ship, best)
    predictions = search.predict(whole)
    return TrialPlan(
        table=whole,
        steps=steps_of(ship, best),
        pairs=_table_of_pairs(search, predictions, whole, noise, others),
        history=_history(predictions, search.noise),
        predicted={name: one.own for name, one in predictions.items()},
        channels=channels,
        noise=search.noise,
    )


@dataclass(frozen=True)
class _Search:
    """Search of a programme of manoeuvres of equal length."""

    ship: Ship
    predictors: Mapping[str, _Predictor]
    noise: tuple[Noise, ...]
    limits: Limits
    rows: int

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
            options: list[tuple[float, int, Manoeuvre, Evidence]] = []
            tries = 0
            while len(options) < pool and tries < 20 * max(pool, 5):
                tries += 1
                manoeuvre = random_manoeuvre(self.ship, self.limits, self.rows, generator)
                table = table_of(self.ship, [manoeuvre]).assign(**begin)
                predictions = self.predict_within_limits(table)
                if predictions is None:
                    continue
                found = evidence_of(predictions, self.noise)
                if total is not None:
                    found = {pair: total[pair].plus(one) for pair, one in found.items()}
                values = worst_of(found).values()
                # The mean decides between equal minima, as where no manoeuvre decides one pair.
                score = min(values) + 1e-3 * sum(values) / len(values)
                options.append((score, -len(options), manoeuvre, found))
                tick("simulating manoeuvres", slot * pool + len(options), slots * pool)
            if not options:
                raise PlanError(
                    f"none of {tries} random manoeuvres of {self.rows * INTERVAL_S:g} s stays within "
                    "the limits; widen drive, pitch_ratio, shaft_speed_rad_s or ship_speed_m_s"
                )
            _, _, manoeuvre, total = max(options, key=lambda option: option[:2])
            chosen.append(manoeuvre)
            begin = self.state_after(table_of(self.ship, chosen))
        return chosen

    def predict(self, table: pd.DataFrame) -> dict[str, Prediction]:
        """Return what every model predicts for a table of commands."""
        return {name: predictor(table) for name, predictor in self.predictors.items()}

    def judge(self, programme: Sequence[Manoeuvre]) -> dict[Pair, float]:
        """Return lambda of each pair of models after a whole programme."""
        return worst_of(evidence_of(self.predict(table_of(self.ship, programme)), self.noise))

    def predict_within_limits(self, table: pd.DataFrame) -> dict[str, Prediction] | None:
        """Return what every model predicts, None if one leaves the limits or the engine's envelope."""
        simulated = {}
        for name, one in self.predictors.items():
            try:
                replay, samples = one.simulate(table)
            except (RecordingError, ShipError, ValueError):  # no equilibrium at the first commands
                return None
            if not is_inside(one.ship, samples, self.limits):
                return None
            simulated[name] = replay, samples
        return {
            name: self.predictors[name].differentiate(*both) for name, both in simulated.items()
        }

    def state_after(self, table: pd.DataFrame) -> dict[str, float]:
        """Return the measurements at the end of a programme by the first model, by column."""
        first = next(iter(self.predictors.values()))
        last = JointReplay(first.ship, table).simulate(first.record)[-1]
        state = (*ALWAYS_SIMULATED, *TURNING_COLUMNS)
        known = set(_channels(first.ship)) & set(state) - {"shaft_torque_N_m", RUDDER}
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


def _check(models: Mapping[str, Ship], noise: Mapping[str, Noise], minutes: float) -> Ship:
    """Refuse what cannot be planned; return the ship of the first model."""
    if len(models) < 2:
        raise PlanError(
            f"{len(models)} model given: at least two are needed to decide between; a diagnosis without "
            "alternatives needs no further trial"
        )
    ship = next(iter(models.values()))
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
    if all(one == ship for one in models.values()):
        raise PlanError("the models do not differ in any parameter")
    return ship


def _minutes_until(
    predictions: Mapping[str, Prediction], noise: Sequence[Noise], pair: Pair
) -> float:
    """Return the minutes until a pair is decided, to 10 s; NaN where it never is."""
    both = {name: predictions[name] for name in pair}
    rows = both[pair[0]].own.shape[1]
    step = max(1, round(10.0 / INTERVAL_S))

    def is_decided(count: int) -> bool:
        return worst_of(evidence_of(both, noise, count))[pair] >= DECIDED

    if not is_decided(rows):
        return math.nan
    low, high = 0, -(-rows // step)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_decided(middle * step) else (middle, high)
    return float(min(high * step, rows)) * INTERVAL_S / 60.0


def _history(predictions: Mapping[str, Prediction], noise: Sequence[Noise]) -> pd.DataFrame:
    """Return lambda of each pair at every half minute."""
    rows = next(iter(predictions.values())).own.shape[1]
    counts = np.arange(1, int(rows * INTERVAL_S // 30.0) + 1) * round(30.0 / INTERVAL_S)
    values = [worst_of(evidence_of(predictions, noise, int(n))) for n in counts]
    return pd.DataFrame(
        [{f"{i} or {j}": value for (i, j), value in one.items()} for one in values],
        index=pd.Index(counts * INTERVAL_S / 60.0, name="minutes"),
    )


def _table_of_pairs(
    search: _Search,
    predictions: Mapping[str, Prediction],
    table: pd.DataFrame,
    noise: Mapping[str, Noise],
    others: Sequence[Mapping[Pair, float]],
) -> pd.DataFrame:
    """Return the table of pairs, with the minutes that each further instrument would need."""
    value = worst_of(evidence_of(predictions, search.noise))
    columns: dict[Pair, dict[str, float]] = {
        pair: {
            "expected_2logL": value[pair],
            "minutes": _minutes_until(predictions, search.noise, pair),
            "random_2logL": float(np.mean([one[pair] for one in others])),
        }
        for pair in value
    }
    for channel in INSTRUMENTS:
        if channel in noise or channel not in _channels(search.ship):
            continue
        wider = {
            name: _Predictor(one.ship, one.sizes, (*one.channels, channel))(table)
            for name, one in search.predictors.items()
        }
        size = float(np.sqrt(np.mean([one.own[-1] ** 2 for one in wider.values()])))
        if size > 0.0:
            more = (*search.noise, Noise(SENSOR_NOISE * size))
            for pair in value:
                columns[pair][f"minutes_with_{channel}"] = _minutes_until(wider, more, pair)
    return pd.DataFrame([{"model": i, "rival": j} | columns[i, j] for i, j in columns])
