"""Compare observers during a thrust reversal: the towing tank in calm water, and a destroyer that stops.

Run ``python -m reproductions towing_tank.observers --out docs/results``; half a minute.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.display import figures
from shaftline.observers import Observer, follow, get_observer, simulated_measurements
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.luenberger import Luenberger
from shaftline.observers.random_walk_kalman import RandomWalkKalman
from shaftline.observers.shaft_acceleration import ShaftAccelerationDerived
from shaftline.observers.shaft_kalman import ShaftKalman
from shaftline.plant import Schedule, Ship, State, equilibrium, load_ship, simulate
from shaftline.plant.propeller import propeller_load
from shaftline.plant.shaft import brake_torque_of, load_torque

from ..pages import make_parser, write_page

THRUST_N, CARRIAGE_M_S = 80.0, 1.0
HALF_PERIOD_S, RAMP_S, DURATION_S = 10.0, 2.0, 60.0
WANTED_M_S = 0.1
SEEDS = 10

RIG, NAME = "towing-tank", "four-quadrant-observers"

NAMES = (
    "power-balance",
    "shaft-acceleration",
    "shaft-acceleration-derived",
    "luenberger-low",
    "luenberger",
    "luenberger-high",
    "shaft-kalman",
    "immersion-invariance-low",
    "immersion-invariance",
    "immersion-invariance-high",
    "random-walk-kalman",
    "random-walk-kalman-printed",
    "immersion-invariance-adaptive",
)
"""Observers with their tuning for the frigate."""

OF_THE_RIG: dict[str, Observer] = {
    "shaft-acceleration-derived, T 0.02 s": ShaftAccelerationDerived(0.02),
    "luenberger, both poles -50 rad/s": Luenberger((-50.0, -50.001)),
    "shaft-kalman, poles about 22 rad/s": ShaftKalman((1.0, 1e3)),
    "random-walk-kalman, noise of the rig": RandomWalkKalman(1.0, 0.0, 0.05, 0.05),
    "immersion-invariance, gamma 1.5": ImmersionInvariance(1.5),
}
"""Observers with a tuning for a propeller of 0.25 m."""


class Noise(NamedTuple):
    """Standard deviation of the white noise of each measurement."""

    shaft_speed: float = 0.05  # [rad/s], 0.1 % of the speed
    torque: float = 0.025  # [N m], 0.5 % of the torque
    acceleration: float = 1.0  # [rad/s2]


class Run(NamedTuple):
    """A test: the ship, its samples, and the measurements."""

    ship: Ship
    samples: NDArray[Any]
    readings: NDArray[np.float64]

    @property
    def against(self) -> NDArray[np.bool_]:
        """Return the samples in which the shaft turns against the inflow: zone 1."""
        return np.asarray(self.samples["shaft_speed"] * self.samples["advance_velocity"] < 0.0)

    def noisy(self, noise: Noise, seed: int) -> NDArray[np.float64]:
        """Return the measurements with noise."""
        size = [noise.shaft_speed, noise.torque, 0.0, noise.acceleration, 0.0]
        return (
            self.readings + np.random.default_rng(seed).standard_normal(self.readings.shape) * size
        )

    def estimate(self, observer: Observer, readings: Any = None) -> tuple[Any, Any]:
        """Return the estimated advance velocity [m/s] and its validity; without noise by default."""
        readings = self.readings if readings is None else readings
        return follow(observer, self.ship, readings, self.ship.time_step_s)


def programme(times: NDArray[np.float64]) -> Any:
    """Return the carriage speed over its largest: square, from rest, with ramps of 2 s."""
    corners, values = [0.0, 0.5 * RAMP_S], [0.0, 1.0]
    for k in range(1, 1 + int(DURATION_S / HALF_PERIOD_S)):
        corners += [k * HALF_PERIOD_S - 0.5 * RAMP_S, k * HALF_PERIOD_S + 0.5 * RAMP_S]
        values += [values[-1], -values[-1]]
    return np.interp(times, corners, values)


def steady_torque(ship: Ship, thrust: float, inflow: float) -> float:
    """Return the drive torque [N m] for a steady thrust [N] in an inflow [m/s] of the same sign."""
    plant, screw = ship.record(), ship.propeller

    def load(shaft_speed: float) -> Any:
        return propeller_load(plant, inflow, shaft_speed, screw.pitch_ratio_max, screw.depth_m, 0.0)

    ends = (5.0, 150.0) if thrust > 0.0 else (-150.0, -5.0)
    speed = scipy.optimize.brentq(lambda w: load(w).thrust - thrust, *ends)
    torque = load(speed).torque / screw.relative_rotative_efficiency
    return float(brake_torque_of(plant, load_torque(plant, torque, speed), speed))


def calm_test(ship: Ship) -> Run:
    """Simulate a torque programme for +-80 N of thrust, the carriage at +-1 m/s with its sign, 60 s."""
    ahead, astern = (steady_torque(ship, s * THRUST_N, s * CARRIAGE_M_S) for s in (1.0, -1.0))

    def torque(times: NDArray[np.float64]) -> Any:
        share = programme(times)
        return np.where(share > 0.0, ahead * share, -astern * share)

    pitch = ship.propeller.pitch_ratio_max
    schedule = Schedule(torque, pitch, inflow=lambda t: CARRIAGE_M_S * programme(t))
    samples = simulate(ship, schedule, DURATION_S, initial=State(pitch, 0.0, 0.0))
    return Run(ship, samples, simulated_measurements(samples, ship))


def crash_stop() -> Run:
    """Simulate the destroyer with four-quadrant curves: half torque ahead, from 10 s on half astern."""
    ship = load_ship("ddg-51-surrogate").with_values({"propeller.model": "four-quadrant"})
    torque, pitch = 0.5 * float(ship.record()["drive_max"]), ship.propeller.pitch_ratio_max
    order = Schedule(lambda t: np.interp(t, [10.0, 30.0], [torque, -torque]), pitch)
    samples = simulate(ship, order, 300.0, initial=equilibrium(ship, torque, pitch).state)
    samples = samples[: int(np.argmax(samples["ship_speed"] <= 0.0))]
    return Run(ship, samples, simulated_measurements(samples, ship))


def _rms(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(error**2))) if len(error) else float("nan")


def scores(run: Run, observer: Observer, readings: NDArray[np.float64]) -> dict[str, float]:
    """Return errors [m/s] and shares [%] of one estimate."""
    velocity, valid = run.estimate(observer, readings)
    error, against = velocity - run.samples["advance_velocity"], run.against
    return {
        "rms valid": _rms(error[valid]),
        "rms outside zone 1": _rms(error[~against]),
        "rms in zone 1": _rms(error[against]),
        "valid %": 100.0 * float(valid.mean()),
        "zone 1 called valid %": 100.0 * float(valid[against].mean()),
    }


def table_of(
    run: Run, observers: dict[str, Observer], noise: Noise | None, seeds: int
) -> pd.DataFrame:
    """Return the scores of the observers; with noise the mean over the seeds."""
    readings = (
        [run.readings] if noise is None else [run.noisy(noise, seed) for seed in range(seeds)]
    )
    rows = []
    for name, observer in observers.items():
        found = pd.DataFrame([scores(run, observer, one) for one in readings])
        rows.append({"observer": name} | found.mean().to_dict())
    return pd.DataFrame(rows)


def draw(rig: Run, stop: Run) -> Figure:
    """Draw the truth and three estimates; grey where the shaft turns against the inflow."""
    figure, axes = figures.new_figure(2, 2, (11.0, 6.0))
    ways: tuple[tuple[Run, Any, dict[str, Observer], Any], ...] = (
        (
            rig,
            rig.noisy(Noise(), 0),
            {
                "luenberger, both poles -50 rad/s": OF_THE_RIG["luenberger, both poles -50 rad/s"],
                "random-walk-kalman": OF_THE_RIG["random-walk-kalman, noise of the rig"],
                "immersion-invariance-adaptive": get_observer("immersion-invariance-adaptive"),
            },
            (8.0, 33.0),
        ),
        (
            stop,
            stop.readings,
            {
                name: get_observer(name)
                for name in ("luenberger", "random-walk-kalman", "immersion-invariance")
            },
            None,
        ),
    )
    for column, (run, readings, observers, span) in enumerate(ways):
        time, (top, bottom) = run.samples["time"], axes[:, column]
        for name, observer in observers.items():
            velocity, valid = run.estimate(observer, readings)
            (line,) = top.plot(time, np.where(valid, velocity, np.nan), linewidth=1.0, label=name)
            top.plot(time, velocity, linewidth=0.6, alpha=0.35, color=line.get_color())
        truth = run.samples["advance_velocity"]
        top.plot(time, truth, color="black", linewidth=1.0, linestyle="--", label="truth")
        bottom.plot(time, run.samples["shaft_speed"], color="black", linewidth=1.0)
        for axis, room in ((top, 0.3), (bottom, 0.0)):  # for the legend
            low, high = axis.get_ylim()
            high += room * (high - low)
            axis.fill_between(time, low, high, where=run.against, color="0.88", linewidth=0.0)
            axis.set(ylim=(low, high), xlim=span or (time[0], time[-1]))
        top.legend(fontsize=7, ncols=2, loc="upper center")
        top.set_title(run.ship.name, fontsize=9)
        top.set_ylabel("advance velocity [m/s]")
        bottom.set(xlabel="time [s]", ylabel="shaft speed [rad/s]")
    return figure


def followed_against_inflow(run: Run) -> dict[str, float]:
    """Return the time of the reversal [s], that of an error of 0.3 m/s [s], and the rms in between."""
    velocity, _ = run.estimate(get_observer("immersion-invariance"))
    error, times = velocity - run.samples["advance_velocity"], run.samples["time"]
    begins = int(np.argmax(run.against))
    lost = begins + int(np.argmax(np.abs(error[begins:]) > 3.0 * WANTED_M_S))
    return {
        "reversed": float(times[begins]),
        "lost": float(times[lost]),
        "follows": _rms(error[begins:lost]),
    }


def limits_met(clean: pd.DataFrame, noisy: pd.DataFrame) -> str:
    """Return list items with the observers whose error is below the limit."""
    lines = []
    for words, table in (("Without noise", clean), ("With noise", noisy)):
        valid = table.loc[table["rms valid"] < WANTED_M_S, "observer"].map("`{}`".format)
        outside = (table["rms outside zone 1"] < WANTED_M_S).sum()
        lines.append(
            f"- {words}: {len(valid)} of {len(table)} stay below {WANTED_M_S:g} m/s where valid "
            f"({', '.join(valid)}); {outside} in all samples outside zone 1."
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Write ``four-quadrant-observers.md``, its table and its figure."""
    parser = make_parser("towing_tank.observers", __doc__, f"out/{NAME}")
    ship_help = "ship with an electric drive and four-quadrant curves"
    parser.add_argument("--ship", default=RIG, help=ship_help)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds of the noise")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error("--seeds must be above zero")
    rig, stop = calm_test(load_ship(options.ship)), crash_stop()
    named: dict[str, Observer] = {name: get_observer(name) for name in NAMES}
    clean = table_of(rig, named | OF_THE_RIG, None, 1)
    noisy = table_of(rig, named | OF_THE_RIG, Noise(), options.seeds)
    stopped = table_of(stop, named, None, 1)
    figures.save(draw(rig, stop), options.out / "figures" / f"{NAME}.png")
    frames = {"rig": clean, "rig with noise": noisy, "crash stop": stopped}
    table = pd.concat([frame.assign(test=name) for name, frame in frames.items()])
    write_page(
        options.out, NAME, "Observers during a thrust reversal",
        "towing_tank.observers --out docs/results", table, Path(__file__).with_suffix(".md"),
        ship=rig.ship.name, thrust=THRUST_N, speed=CARRIAGE_M_S, half=HALF_PERIOD_S, ramp=RAMP_S,
        duration=DURATION_S, zone=100.0 * rig.against.mean(), limit=WANTED_M_S, noise=Noise(),
        rate=1.0 / rig.ship.time_step_s, seeds=options.seeds, clean=clean, noisy=noisy, stopped=stopped,
        meeting=limits_met(clean, noisy), seconds=float(stop.samples["time"][-1]),
        stop_zone=100.0 * stop.against.mean(), stop=followed_against_inflow(stop),
    )  # fmt: skip
    print(f"page: {options.out / f'{NAME}.md'}")
