"""``shaftline tour``: a frigate in a seaway with every observer, then a measured drive train.

The drive train is that of the tug Tito Neri (Vrijdag & Martelli 2021): five measured steady states
(Table 4) and a frequency response of nine points about point C (Table 2), compared with the model with
each of the two parameter sets that the authors identified (Table 5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import pandas as pd
import typer
from numpy.typing import NDArray

from .. import display
from ..core.files import write_atomically
from ..observers import follow, get_observer, simulated_measurements
from ..observers.following import variance_accounted_for
from ..plant import Schedule, Ship, equilibrium, linearise, load_ship, simulate
from ..plant.load_cases import CASES
from ..plant.state import State
from .console import check_folder, print_table, progress, report_errors, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure


OBSERVERS = (
    "luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman", "power-balance",
    "shaft-acceleration", "shaft-acceleration-derived", "immersion-invariance-low",
    "immersion-invariance-moderate", "immersion-invariance-high", "random-walk-kalman-printed",
    "random-walk-kalman",
)  # fmt: skip
"""Compared observers: the eleven of the thesis, and the last one with an estimated noise."""

METER_NOISE = {
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 1500.0,
    "pitch_ratio": 0.004,
    "shaft_acceleration_rad_s2": 0.02,
}
"""Rms noise per sample at 20 Hz of good shipboard instruments, assumed as orders of magnitude."""

PERFECT, NOISY = "VAF without noise [%]", "VAF with noise [%]"


MODELS = ("tito-neri-staircase", "tito-neri-sine")
REFERENCE_VOLTAGE = 5.89  # [V] point C, about which the frequency response was measured
DISCARDED_ABOVE = (
    900.0  # [rad/s] The authors discard 1000 and 5000 rad/s because of the weak signal.
)


@dataclass(frozen=True)
class Seaway:
    """Simulation of the frigate: a table of observers and a figure."""

    table: pd.DataFrame
    figure: Figure

    @property
    def sentence(self) -> str:
        """Sentence on the most accurate observers."""
        by_name = self.table.set_index("observer")
        perfect, noisy = by_name[PERFECT], by_name[NOISY].drop("shaft-acceleration")
        return (
            f"With noisy sensors and no accelerometer, {noisy.idxmax()} is the most accurate "
            f"({noisy.max():.1f} %); {perfect.drop('shaft-acceleration').idxmax()}, the best with "
            "perfect sensors, amplifies the noise and falls to "
            f"{noisy[perfect.drop('shaft-acceleration').idxmax()]:.1f} %."
        )


def simulate_seaway(seed: int = 0, tick: Callable[[], None] = lambda: None) -> Seaway:
    """Simulate 300 s of head seas, and estimate the advance velocity with every observer.

    Args:
        seed: seed of the sea and of the noise.
        tick: function called after each observer.

    Returns:
        Table with VAF [%] and rms error [m/s], with perfect and with noisy measurements.
    """
    frigate = load_ship("frigate")
    samples = CASES["jonswap"].run(frigate, seed=seed)
    dt, truth = frigate.time_step_s, samples["advance_velocity"]
    clean = simulated_measurements(samples)
    rms = np.array([*METER_NOISE.values(), 0.0])
    noisy = clean + np.random.default_rng(seed).standard_normal(clean.shape) * rms
    rows, estimates, scores = [], {}, {}
    for name in OBSERVERS:
        exact, _ = follow(get_observer(name), frigate, clean, dt)
        real, valid = follow(get_observer(name), frigate, noisy, dt)
        estimates[name], scores[name] = real, variance_accounted_for(truth, real)
        rows.append(
            {
                "observer": name,
                PERFECT: variance_accounted_for(truth, exact),
                NOISY: scores[name],
                "rms error, noisy [m/s]": float(np.sqrt(np.mean((real - truth) ** 2))),
                "valid [%]": 100.0 * float(np.mean(valid)),
            }
        )
        tick()
    figure = _draw_seaway(samples["time"], truth, estimates, scores, (100.0, 160.0))
    return Seaway(pd.DataFrame(rows), figure)


@dataclass(frozen=True)
class DriveTrain:
    """Comparison of Tito Neri with its models: tables, sentences and a figure."""

    points: pd.DataFrame
    response: pd.DataFrame
    sentences: list[str]
    figure: Figure

    @property
    def gains(self) -> pd.DataFrame:
        """Gains of the frequency response: measured, and of each parameter set."""
        columns: dict[str, object] = {}
        for quantity in ("speed", "current"):
            for model, lines in self.response.groupby("model", sort=False):
                columns["rad/s"] = lines["frequency_rad_s"].to_numpy()
                columns[f"{quantity}, measured"] = lines[f"{quantity}_gain_measured"].to_numpy()
                short = str(model).removeprefix("tito-neri-")
                columns[f"{quantity}, {short}"] = lines[f"{quantity}_gain"].to_numpy()
        return pd.DataFrame(columns)


def simulate_drive_train() -> DriveTrain:
    """Simulate Tito Neri at the measured voltages with both published parameter sets."""
    points = operating_points()
    response = frequency_response()
    sentences = [verdict(points, model) for model in MODELS]
    sentences += [
        f"{model}: rms gain error of the frequency response up to 500 rad/s: speed "
        f"{response_error(response, model, 'speed'):.2f} dB, current "
        f"{response_error(response, model, 'current'):.2f} dB."
        for model in MODELS
    ]
    figure = _draw_drive_train(points, response)
    return DriveTrain(points, response, sentences, figure)


def _measured(name: str) -> pd.DataFrame:
    """Return a published table of measurements of Tito Neri, indexed by its first column."""
    with resources.files("shaftline.plant").joinpath(f"data/{name}.csv").open() as file:
        return pd.read_csv(file, index_col=0)


def _settled(ship: Ship, voltage: float) -> tuple[float, float]:
    """Return motor speed [rad/s] and current [A] two seconds after switching on from standstill."""
    rest = State(ship.propeller.pitch_ratio_max, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    last = simulate(ship, Schedule(voltage, ship.propeller.pitch_ratio_max), 2.0, initial=rest)[-1]
    return float(last["shaft_speed"]) * ship.transmission.gear_ratio, float(last["motor_current"])


def speed_errors_percent(ship: Ship) -> NDArray[np.float64]:
    """Return the errors of the steady speed at the five voltages [%], shape (5,)."""
    found = []
    for point in _measured("tito_neri_operating_points").itertuples():
        steady = equilibrium(ship, float(point.motor_voltage_V), ship.propeller.pitch_ratio_max)
        speed = steady.state.shaft_speed * ship.transmission.gear_ratio
        found.append(100.0 * (speed / float(point.motor_speed_rad_s) - 1.0))
    return np.array(found)


def operating_points() -> pd.DataFrame:
    """Compare measured and simulated steady states, and compute the imbalance of each measured state.

    Returns:
        One row for each model and point. ``motor_balance_V`` is U - K_e omega - R_a i and
        ``shaft_balance_N_m`` is K_e i - M_f - M_p, both with the *measured* speed and current: the error
        of one equation of the model alone. The percentages refer to the voltage and to the motor torque.
    """
    rows = []
    for name in MODELS:
        ship = load_ship(name)
        plant = ship.record()
        ratio = ship.transmission.gear_ratio
        load = (
            float(plant["kq"][0, 0] * plant["density"] * plant["diameter"] ** 5)
            / (2.0 * np.pi) ** 2
            / ratio**3
        )
        friction = float(plant["coulomb_engine_side"]) / ratio
        constant, ohm = float(plant["motor_constant"]), float(plant["armature_resistance"])
        for point in _measured("tito_neri_operating_points").itertuples():
            volt, speed, current = (
                float(point.motor_voltage_V),
                float(point.motor_speed_rad_s),
                float(point.motor_current_A),
            )
            simulated_speed, simulated_current = _settled(ship, volt)
            motor = volt - constant * speed - ohm * current
            shaft = constant * current - friction - load * speed**2
            rows.append(
                {
                    "model": name,
                    "point": point.Index,
                    "voltage_V": volt,
                    "motor_speed_rad_s_measured": speed,
                    "motor_speed_rad_s": simulated_speed,
                    "speed_error_percent": 100.0 * (simulated_speed / speed - 1.0),
                    "motor_current_A_measured": current,
                    "motor_current_A": simulated_current,
                    "current_error_percent": 100.0 * (simulated_current / current - 1.0),
                    "motor_balance_V": motor,
                    "motor_balance_percent": 100.0 * motor / volt,
                    "shaft_balance_N_m": shaft,
                    "shaft_balance_percent": 100.0 * shaft / (constant * current),
                }
            )
    return pd.DataFrame(rows)


def frequency_response() -> pd.DataFrame:
    """Compare measured and linearised responses to the voltage about point C, normalised as published.

    Returns:
        One row for each model and frequency: gains [-] of d(i/i_0)/d(U/U_0) and d(omega/omega_0)/
        d(U/U_0), phases [deg].
    """
    measured = _measured("tito_neri_frequency_response")
    rows = []
    for name in MODELS:
        ship = load_ship(name)
        point = equilibrium(ship, REFERENCE_VOLTAGE, ship.propeller.pitch_ratio_max)
        model = linearise(ship, point, outputs=("shaft_speed", "motor_current"))
        scale = {
            "speed": REFERENCE_VOLTAGE / point.state.shaft_speed,
            "current": REFERENCE_VOLTAGE / point.state.motor_current,
        }
        for line in measured.itertuples():
            frequency = float(line.Index)
            response = {
                "speed": complex(model["shaft_speed", "drive"](1j * frequency)) * scale["speed"],
                "current": complex(model["motor_current", "drive"](1j * frequency))
                * scale["current"],
            }
            row = {"model": name, "frequency_rad_s": frequency}
            for quantity, value in response.items():
                row[f"{quantity}_gain_measured"] = float(getattr(line, f"{quantity}_gain"))
                row[f"{quantity}_gain"] = abs(value)
                row[f"{quantity}_phase_deg_measured"] = float(
                    getattr(line, f"{quantity}_phase_deg")
                )
                row[f"{quantity}_phase_deg"] = float(np.degrees(np.angle(value)))
            rows.append(row)
    return pd.DataFrame(rows)


def response_error(response: pd.DataFrame, model: str, quantity: str) -> float:
    """Return the rms error of a gain [dB] over the frequencies that the authors used."""
    line = response[(response["model"] == model) & (response["frequency_rad_s"] < DISCARDED_ABOVE)]
    ratio = line[f"{quantity}_gain"] / line[f"{quantity}_gain_measured"]
    return float(np.sqrt(np.mean((20.0 * np.log10(ratio)) ** 2)))


def verdict(points: pd.DataFrame, model: str) -> str:
    """Return a sentence on the balance and the voltage at which a model differs most."""
    line = points[points["model"] == model].set_index("voltage_V")
    motor = line["motor_balance_percent"].abs()
    shaft = line["shaft_balance_percent"].abs()
    name, worst, imbalance, unit = (
        ("motor", motor, line["motor_balance_V"], "V of the supply")
        if motor.mean() > shaft.mean()
        else ("shaft", shaft, line["shaft_balance_N_m"], "N m of the motor's torque")
    )
    at = worst.idxmax()
    return (
        f"{model}: the {name} balance differs most (mean {worst.mean():.1f} %, the other "
        f"{min(motor.mean(), shaft.mean()):.1f} %), worst at {at:.2f} V, where the measured speed and "
        f"current leave {imbalance.loc[at]:+.3g} {unit} unaccounted for ({worst.loc[at]:.1f} %)."
    )


def _draw_seaway(
    time: NDArray[Any],
    truth: NDArray[Any],
    estimates: dict[str, NDArray[Any]],
    scores: dict[str, float],
    window: tuple[float, float],
) -> Figure:
    """Draw the estimate of every observer and the true value, one panel for each observer.

    Args:
        time: time [s], shape (n,).
        truth: true advance velocity [m/s], shape (n,).
        estimates: estimates by observer [m/s].
        scores: VAF [%] by observer.
        window: shown part of the time [s].
    """
    shown = (time >= window[0]) & (time <= window[1])
    columns = 3
    rows = -(-len(estimates) // columns)
    figure, axes = display.figures.new_figure(rows, columns, (12.0, 2.0 * rows + 0.6))
    figure.suptitle(
        "Advance velocity of the frigate in head seas, Hs 2.9 m: true (dark), estimated from noisy "
        "speed, torque and pitch (red)",
        fontsize=11,
    )
    low, high = truth[shown].min() - 0.6, truth[shown].max() + 0.6
    for axis, (name, estimate) in zip(axes.flat, estimates.items(), strict=False):
        axis.plot(time[shown], truth[shown], color=display.figures.TRUTH, linewidth=1.3)
        axis.plot(
            time[shown], estimate[shown], color=display.figures.ESTIMATE, linewidth=0.8, alpha=0.9
        )
        axis.set_title(f"{name}: VAF {scores[name]:.1f} %", fontsize=9)
        axis.set_ylim(low, high)
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(estimates) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("v_a [m/s]", fontsize=8)
    for axis in axes.flat[max(0, len(estimates) - columns) : len(estimates)]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def _draw_drive_train(points: pd.DataFrame, response: pd.DataFrame) -> Figure:
    """Draw measured and simulated operating points and frequency response of Tito Neri.

    Args:
        points: table from :func:`operating_points`.
        response: table from :func:`frequency_response`.
    """
    figure, axes = display.figures.new_figure(2, 2, (10.0, 7.0))
    figure.suptitle("Tito Neri drive train: measured (black) and simulated", fontsize=12)
    volts = points["voltage_V"].unique()
    for axis, column, label in (
        (axes[0, 0], "motor_speed_rad_s", "motor speed [rad/s]"),
        (axes[0, 1], "motor_current_A", "motor current [A]"),
    ):
        first = points[points["model"] == MODELS[0]]
        axis.plot(volts, first[f"{column}_measured"], "ko", label="measured")
        for i, model in enumerate(MODELS):
            line = points[points["model"] == model]
            axis.plot(
                volts, line[column], color=display.figures.PALETTE[i], marker="x", label=model
            )
        axis.set_xlabel("motor voltage [V]")
        axis.set_ylabel(label)
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis, name, label in (
        (axes[1, 0], "speed", "speed gain [-]"),
        (axes[1, 1], "current", "current gain [-]"),
    ):
        first = response[response["model"] == MODELS[0]]
        axis.loglog(first["frequency_rad_s"], first[f"{name}_gain_measured"].clip(lower=1e-3), "ko")
        for i, model in enumerate(MODELS):
            line = response[response["model"] == model]
            axis.loglog(
                line["frequency_rad_s"],
                line[f"{name}_gain"],
                color=display.figures.PALETTE[i],
                marker="x",
            )
        axis.set_xlabel("frequency [rad/s]")
        axis.set_ylabel(label + ", normalised at point C")
        axis.axvspan(700, 7000, color=display.figures.THESIS, alpha=0.15, linewidth=0)
    return figure


def tour(
    out: Annotated[Path, typer.Option(help="Folder for pictures and tables.")] = Path("out/tour"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sea and of the sensor noise.")] = 0,
) -> None:
    """Show a first example: a frigate in a seaway, then a real drive train.

    First, the frigate of van der Kroft's thesis is simulated for 300 s in head seas (significant wave
    height 2.9 m). Every observer estimates the advance velocity, the speed of the water at the
    propeller, which cannot be measured on a ship. Then the model tug Tito Neri is simulated at the motor
    voltages of its published measurements, and the largest differences are reported.

    Written: `seaway.png`, `tito-neri.png`, and the tables as CSV.

    Examples:
        shaftline tour

        shaftline tour --seed 1 --out out/tour-1
    """
    with report_errors():
        check_folder(out)
        say(
            "A frigate is simulated for 300 s in head seas. Each observer estimates, from shaft speed, "
            "shaft torque and pitch, how fast the water flows into the propeller."
        )
        with progress("simulating (the first run compiles the kernels)", len(OBSERVERS)) as tick:
            sea = simulate_seaway(seed, tick)
        print_table(sea.table, "1. The frigate in head seas: accuracy of each observer")
        say(
            "VAF is the share of the variance of the advance velocity that an estimate accounts for: "
            "100 % is perfect. The noise is that of good shipboard instruments."
        )
        say(f"{sea.sentence}\n")
        display.figures.save(sea.figure, out / "seaway.png")
        write_atomically(out / "seaway.csv", lambda f: sea.table.to_csv(f, index=False))

        train = simulate_drive_train()
        for model, points in train.points.groupby("model", sort=False):
            shown = points[
                ["voltage_V", "motor_speed_rad_s_measured", "motor_speed_rad_s",
                 "speed_error_percent", "motor_current_A_measured", "motor_current_A",
                 "current_error_percent"]
            ].set_axis(
                ["U [V]", "speed measured [rad/s]", "simulated", "error [%]",
                 "current measured [A]", "simulated ", "error [%] "], axis=1,
            )  # fmt: skip
            print_table(shown, f"2. Real measurements of a drive train, against {model}")
        print_table(
            train.gains,
            "3. Its measured frequency response about 5.89 V: gains, measured and simulated",
        )
        for sentence in train.sentences:
            say(f"- {sentence}")
        display.figures.save(train.figure, out / "tito-neri.png")
        for name, frame in (("points", train.points), ("response", train.response)):
            write_atomically(
                out / f"tito-neri-{name}.csv",
                lambda f, frame=frame: frame.to_csv(f, index=False),  # type: ignore[misc]
            )
        say(
            f"\nPictures: {out / 'seaway.png'} and {out / 'tito-neri.png'}; the tables are in the "
            "same folder as CSV."
        )
