"""Estimate the noises of the augmented filter along recordings; write ``adaptive-noise.md``.

The recordings are simulated with the equations of the filter, so that the true noises are known.
"""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.display.figures import PALETTE, TRUTH
from shaftline.mismatch.identification.augmented_filter import tune_filter
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.observers.adaptive_noise import adapt, correct_slopes, start_adaptive_noise
from shaftline.observers.augmented import correct
from shaftline.observers.ship_filter import (
    DISTURBANCE,
    DISTURBANCE_TIME_S,
    NOISE_MEMORY_S,
    FilterResult,
    ShipFilter,
)
from shaftline.plant import Ship, ValidityWarning, get_sea, load_ship, realise
from shaftline.plant.columns import drive_column
from shaftline.plant.particulars import Particulars, ship_from_particulars
from shaftline.plant.replay import Replay, simulate_recording

from .anti_spin_ships import PARTICULARS
from .pages import make_parser, print_dot
from .writing import Line, Panel, draw, rms, share, write_results

Array = NDArray[np.float64]

TITLE = "Adaptive noise of the augmented filter"

TRUE_SHARES = {
    "hull.resistance_coefficient_N_s2_m2": 1.1,
    "prime_mover.torque_per_rack_N_m_mm": 1.05,
}
"""True parameters over those of the ship file."""

SECONDS, INTERVAL_S = 300.0, 0.1
START_S = 60.0  # of the evaluated rows
INFLOW_M_S = 0.5  # rms of the inflow's disturbance
WINDOW = 240  # rows over which squared innovations are averaged
TORQUE = "shaft_torque_N_m"

BOUND, GIVEN, TUNED = "true noises (bound)", "given, constant", "likelihood, constant"
GIVEN_ADAPTIVE, TUNED_ADAPTIVE = "given, adaptive", "likelihood, adaptive"
FILTERS = (BOUND, GIVEN, GIVEN_ADAPTIVE, TUNED, TUNED_ADAPTIVE)


class Kind(NamedTuple):
    """Recordings of one kind; the noises change in the middle of the recording."""

    ship: str = "frigate"
    waves: bool = False  # a sea in place of the filter's model of the inflow
    noise: float = 1.0  # instrument noise of the second half over that of the first
    sea: float = 1.0  # disturbance of the second half over that of the first
    only: str = ""  # the one column whose noise changes; all by default


class Case(NamedTuple):
    """A kind of recordings, and the noises given to the filter over the true ones of the first half."""

    name: str
    kind: Kind = Kind()
    noise: float = 1.0
    walk: float = 1.0


CASES = (
    Case("right noises"),
    Case("instruments given as 0.1 times their noise", noise=0.1),
    Case("instruments given as 10 times their noise", noise=10.0),
    Case("inflow given as 0.1 times its noise", walk=0.1),
    Case("inflow given as 10 times its noise", walk=10.0),
    Case("noise of all instruments becomes 4 times larger", Kind(noise=4.0)),
    Case("sea becomes 3 times rougher", Kind(sea=3.0)),
    Case("waves", Kind(waves=True)),
    Case("trawler, waves 3 times, noise 4 times larger", Kind("trawler", True, 4.0, 3.0)),
    Case("harbour tug, waves 3 times, noise 4 times larger", Kind("harbour-tug", True, 4.0, 3.0)),
    Case(
        "ferry, waves, noise of the torque meter becomes 4 times larger",
        Kind("ferry", waves=True, noise=4.0, only=TORQUE),
    ),
    Case("frigate, waves become a third", Kind(waves=True, sea=1.0 / 3.0)),
)
CHOSEN_ON = 10
"""Number of cases, from the first on, that were used with other seeds to choose memory and limits."""


class Run(NamedTuple):
    """A simulated recording with its truth."""

    ship: Ship  # as in its file
    table: pd.DataFrame
    noise: dict[str, float]  # rms of the instruments in the first half
    inflow: Array  # disturbance of the inflow [m/s], shape (rows,)
    truth: Array  # true parameters


@functools.cache
def load(name: str) -> Ship:
    """Return a ship of the package or from particulars, with a time step of one row."""
    given = PARTICULARS.get(name)
    ship = ship_from_particulars(Particulars(name=name, **given)) if given else load_ship(name)
    return ship.with_values({"integration.time_step_s": INTERVAL_S})


def draw_inflow(waves: bool, rows: int, rng: np.random.Generator) -> Array:
    """Return a disturbance of the inflow [m/s] with the rms :data:`INFLOW_M_S`, shape (rows,).

    It is the process of the filter, or the orbital velocity at the propeller of a ship that meets a
    JONSWAP sea at 6 m/s.
    """
    if waves:
        sea, gravity, depth_m = get_sea("state-5"), 9.81, 3.0
        assert sea is not None
        record = realise(sea, depth_m=depth_m, seed=int(rng.integers(2**31)))
        omega = record["frequency"]
        number = omega**2 / gravity
        velocity = record["amplitude"] * omega * np.exp(-number * depth_m)
        phase = np.outer(INTERVAL_S * np.arange(rows), omega + 6.0 * number)
        phase += rng.uniform(0.0, 2.0 * math.pi, len(omega))
        return np.asarray(
            INFLOW_M_S * np.sin(phase) @ velocity / math.sqrt(0.5 * velocity @ velocity)
        )
    fades = math.exp(-INTERVAL_S / DISTURBANCE_TIME_S)
    drive = INFLOW_M_S * rng.standard_normal(rows)
    drive[1:] *= math.sqrt(1.0 - fades**2)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -fades], drive))


def simulate(kind: Kind, seed: int) -> Run:
    """Simulate one recording with steps of the commands every 40 s."""
    rng, ship = np.random.default_rng([seed, 8861]), load(kind.ship)
    truth = {key: factor * ship.parameter(key).value for key, factor in TRUE_SHARES.items()}
    true, rows = ship.with_values(truth), round(SECONDS / INTERVAL_S) + 1
    time = INTERVAL_S * np.arange(rows)
    later, plateau = time >= 0.5 * SECONDS, (time // 40.0).astype(int)
    table = pd.DataFrame({"time_s": time})
    shares = rng.uniform(0.45, 0.75, plateau[-1] + 1)
    table[drive_column(ship)] = float(ship.record()["drive_max"]) * shares[plateau]
    if ship.has_variable_pitch:
        highest = min(1.35, ship.propeller.pitch_ratio_max)
        shares = rng.uniform(0.7, 0.95, plateau[-1] + 1)
        table["pitch_ratio_command"] = highest * shares[plateau]
    inflow = draw_inflow(kind.waves, rows, rng) * np.where(later, kind.sea, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        own = simulate_recording(true, table)
        # The advance velocity is an input here. The ship speed that belongs to it is iterated.
        for _ in range(3):
            met = (1.0 - ship.hull.wake_fraction) * own["ship_speed_m_s"] + inflow
            start = own[["shaft_speed_rad_s", "ship_speed_m_s"]]
            given = table.assign(inflow_velocity_m_s=met, **start)
            own = simulate_recording(true, given)
    inflow = np.asarray(met - (1.0 - ship.hull.wake_fraction) * own["ship_speed_m_s"])
    noise = {
        "shaft_speed_rad_s": 2e-3 * float(own["shaft_speed_rad_s"].mean()),
        TORQUE: 0.01 * float(own[TORQUE].mean()),
        "ship_speed_m_s": 0.05,
    }
    if ship.has_variable_pitch:
        noise["pitch_ratio"] = 0.004
    for column, size in noise.items():
        changes = kind.only in ("", column)
        factor = np.where(later, kind.noise if changes else 1.0, 1.0)
        own[column] += size * factor * rng.standard_normal(rows)
    return Run(
        ship, own.drop(columns="inflow_velocity_m_s"), noise, inflow, np.array([*truth.values()])
    )


class Followed(NamedTuple):
    """Results of a filter along a whole recording."""

    inflow: Array  # shape (rows,)
    inflow_error: Array  # standard error, likewise
    parameters: Array
    errors: Array  # standard errors of the parameters
    innovations: Array  # over their standard deviations, shape (rows, channels)
    noise: Array  # shape (rows, channels)
    walk: Array  # of the inflow, shape (rows,)


def follow(filters: Sequence[ShipFilter], run: Run) -> Followed:
    """Run one filter along a recording, or one along each half, starting with the last parameters."""
    parts: list[FilterResult] = []
    edges = np.linspace(0, len(run.table), len(filters) + 1).astype(int)
    for k, own in enumerate(filters):
        if k:
            own.restart(filters[k - 1].parameters)
            count = len(own.keys)
            own.p[-count:, -count:] = filters[k - 1].covariance
        table = run.table.iloc[edges[k] : edges[k + 1]].reset_index(drop=True)
        parts.append(own.follow(Replay(own.ship, table.assign(time_s=INTERVAL_S * table.index))))
    last, place = filters[-1], len(filters[-1].states)
    return Followed(
        np.concatenate([one.estimates[:, place] for one in parts]),
        np.concatenate([one.standard_errors[:, place] for one in parts]),
        last.parameters,
        np.sqrt(np.diag(last.covariance)),
        np.concatenate([one.innovations for one in parts]),
        np.concatenate([one.noise for one in parts]),
        np.concatenate([one.walk[:, place] for one in parts]),
    )


def filters_of(run: Run, cases: Sequence[Case]) -> Iterator[tuple[Case, str, list[ShipFilter]]]:
    """Yield the filters of the cases that share a recording; its likelihood is searched once."""
    kind = cases[0].kind
    tuned = tune_filter(JointReplay(run.ship, run.table), tuple(TRUE_SHARES))
    walk = {DISTURBANCE: INFLOW_M_S * math.sqrt(2.0 / DISTURBANCE_TIME_S)}

    def build(
        noise: Mapping[str, float], sea: float = 1.0, memory_s: float | None = None
    ) -> ShipFilter:
        return ShipFilter(
            run.ship,
            tuple(TRUE_SHARES),
            parameter_spread=tuned.noises.numbers,
            noise=noise,
            state_spread=tuned.noises.states,
            state_walk={DISTURBANCE: sea * walk[DISTURBANCE]},
            noise_memory_s=memory_s,
        )

    later = {c: x * (kind.noise if kind.only in ("", c) else 1.0) for c, x in run.noise.items()}
    for case in cases:
        given = {c: x * case.noise for c, x in run.noise.items()}
        yield case, BOUND, [build(run.noise), build(later, kind.sea)]
        yield case, GIVEN, [build(given, case.walk)]
        yield case, GIVEN_ADAPTIVE, [build(given, case.walk, NOISE_MEMORY_S)]
        for name, memory_s in ((TUNED, None), (TUNED_ADAPTIVE, NOISE_MEMORY_S)):
            yield case, name, [tuned.filter(tuned.noises.state_walk, noise_memory_s=memory_s)]


def evaluate(
    case: Case, run: Run, name: str, found: Followed, columns: Sequence[str]
) -> dict[str, Any]:
    """Return errors, coverage and innovations of a filter on a recording from :data:`START_S` on."""
    first = round(START_S / INTERVAL_S)
    error = found.inflow[first:] - run.inflow[first:]
    off = found.parameters - run.truth
    squares = np.square(found.innovations[first : first + (len(error) // WINDOW) * WINDOW])
    windows = squares.reshape(-1, WINDOW, squares.shape[1]).mean(axis=1)
    low, high = (float(scipy.stats.chi2.ppf(x, WINDOW)) / WINDOW for x in (0.025, 0.975))
    place = [*columns].index(TORQUE)
    torque = case.kind.noise if case.kind.only in ("", TORQUE) else 1.0
    return {
        "case": case.name,
        "filter": name,
        "error resistance": float(100.0 * off[0] / run.truth[0]),
        "error rack": float(100.0 * off[1] / run.truth[1]),
        "held": int(np.sum(np.abs(off) <= 1.96 * found.errors)),
        "inflow rms": rms(error),
        "inflow held": float(np.mean(np.abs(error) <= 1.96 * found.inflow_error[first:])),
        "NIS": float(squares.mean()),
        "windows held": float(np.mean((windows >= low) & (windows <= high))),
        "torque noise": float(found.noise[-1, place] / (torque * run.noise[TORQUE])),
    }


def compute(seeds: Sequence[int], cases: Sequence[Case] = CASES) -> pd.DataFrame:
    """Return a row for each case, seed and filter."""
    rows = []
    for kind in dict.fromkeys(case.kind for case in cases):
        for seed in seeds:
            run = simulate(kind, seed)
            for case, name, filters in filters_of(run, [c for c in cases if c.kind == kind]):
                found = follow(filters, run)
                rows.append({"seed": seed} | evaluate(case, run, name, found, filters[-1].columns))
            print_dot()
    return pd.DataFrame(rows)


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Return the errors and shares of each case and filter over the seeds."""
    rows = []
    for (case, name), own in table.groupby(["case", "filter"], sort=False):
        held = np.repeat([True, False], [own["held"].sum(), 2 * len(own) - own["held"].sum()])
        rows.append(
            {
                "case": case,
                "filter": name,
                "resistance [%]": f"{rms(own['error resistance']):.3f}",
                "torque per rack [%]": f"{rms(own['error rack']):.3f}",
                "parameters in 95 %": share(held),
                "inflow [m/s]": f"{rms(own['inflow rms']):.3f}",
                "inflow in 95 %": f"{own['inflow held'].mean():.2f}",
                "NIS": f"{own['NIS'].mean():.2f}",
                "NIS in bounds": f"{own['windows held'].mean():.2f}",
                "torque noise": f"{own['torque noise'].median():.2f}",
            }
        )
    return pd.DataFrame(rows)


def follow_random_walk(
    matching: bool, noise: float, process: float, seed: int, rows: int = 9000
) -> dict[str, float]:
    """Estimate a random walk of unit variance a row, measured with unit variance, by adaptive noise.

    Args:
        matching: whether only the variance of the innovations is used, as by covariance matching.
        noise: given variance of the measurement.
        process: given variance of a step.
        seed: seed of the walk and its measurements.
        rows: number of rows; the second half is evaluated, and a row has the weight 1 / 300.

    Returns:
        Estimated variances, NIS and the share of states within their 95 % intervals.
    """
    rng = np.random.default_rng(seed)
    truth = np.cumsum(rng.standard_normal(rows))
    measured = truth + rng.standard_normal(rows)
    z, p, h, row = np.zeros(1), np.array([[10.0]]), np.ones(1), np.zeros((3, 1))
    r, q = np.array([noise]), np.array([process])
    adaptive = start_adaptive_noise(1.0 / 300.0, np.zeros(1, np.int64), np.full(2, 1e-9), 1)
    found = np.empty((rows, 4))
    for k in range(rows):
        innovation = measured[k] - z[0]
        total = correct(z, p, h, innovation, r[0], row)
        correct_slopes(adaptive, 0, h, row[1], innovation, r[0], total)
        adapt(adaptive, r, q)
        inside = abs(z[0] - truth[k]) <= 1.96 * math.sqrt(p[0, 0])
        found[k] = r[0], q[0], innovation**2 / total, inside
        p[0, 0] += q[0]
        adaptive.covariance[1, 0, 0] += q[0]
        if matching:
            adaptive.estimate[:] = 0.0
    names = ("R", "Q", "NIS", "states in 95 %")
    return dict(zip(names, found[rows // 2 :].mean(axis=0).tolist(), strict=True))


def compare_matching(seeds: Sequence[int]) -> pd.DataFrame:
    """Return the means over seeds for covariance matching and for the likelihood, by given noises."""
    rows = []
    for noise, process in ((1.0, 1.0), (0.01, 1.0), (0.01, 100.0), (100.0, 0.01)):
        for name, matching in (("covariance matching", True), ("likelihood", False)):
            found = pd.DataFrame([follow_random_walk(matching, noise, process, s) for s in seeds])
            own = {key: f"{value:.2f}" for key, value in found.mean().items()}
            rows.append(
                {"given R": f"{noise:g}", "given Q": f"{process:g}", "estimated by": name} | own
            )
    return pd.DataFrame(rows)


def figure(seed: int) -> Figure:
    """Draw the noises of the torque meter and of the inflow along one recording of two cases."""
    panels: list[Panel] = []
    for case in (CASES[5], CASES[6], CASES[8]):
        run = simulate(case.kind, seed)
        time = run.table["time_s"]
        found = {name: (follow(own, run), own[-1]) for _, name, own in filters_of(run, [case])}
        for what in ("torque meter", "inflow"):
            lines = []
            for colour, name in zip(
                (TRUTH, *PALETTE), (BOUND, GIVEN_ADAPTIVE, TUNED, TUNED_ADAPTIVE), strict=False
            ):
                own, last = found[name]
                values = own.walk if what == "inflow" else own.noise[:, last.columns.index(TORQUE)]
                values = values / (
                    found[BOUND][0].walk[0] if what == "inflow" else run.noise[TORQUE]
                )
                lines.append(Line(time, values, name, colour, "--" if name == BOUND else "-"))
            settings = {
                "title": f"{case.name}: {what}",
                "ylabel": "noise / true noise at the start",
            }
            panels.append(Panel(lines, settings, 1 if not panels else 0))
    return draw(panels, (11.0, 9.0), 2, "time [s]")


def main(arguments: list[str] | None = None) -> None:
    """Compute the table, and write the page."""
    parser = make_parser("adaptive_noise", __doc__, "out/adaptive-noise")
    parser.add_argument("--seeds", type=int, default=20, help="recordings of each kind")
    parser.add_argument("--first", type=int, default=1001, help="first seed")
    options = parser.parse_args(arguments)
    seeds = range(options.first, options.first + options.seeds)
    table = compute(seeds)
    summary = summarise(table)
    cells = summary.set_index(["case", "filter"])
    pair = (TUNED_ADAPTIVE, TUNED)
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {"": figure(options.first)},
        f"--seeds {options.seeds} --first {options.first}",
        summary=summary,
        error={
            name: [cells.at[(case, own), "resistance [%]"] for own in pair]
            for name, case in (("trawler", CASES[8].name), ("tug", CASES[9].name))
        },
        held={
            "waves": [cells.at[(CASES[7].name, own), "inflow in 95 %"] for own in pair],
            "rough": cells.at[(CASES[6].name, TUNED_ADAPTIVE), "torque noise"],
            "rough inflow": cells.at[(CASES[6].name, TUNED_ADAPTIVE), "inflow in 95 %"],
            "small": cells.at[(CASES[1].name, GIVEN_ADAPTIVE), "parameters in 95 %"],
        },
        matching=compare_matching(seeds),
        seeds=options.seeds,
        seconds=SECONDS,
        start=START_S,
        memory=NOISE_MEMORY_S,
        window=WINDOW * INTERVAL_S,
        chosen=CHOSEN_ON,
        cases=len(CASES),
    )


if __name__ == "__main__":
    main()
