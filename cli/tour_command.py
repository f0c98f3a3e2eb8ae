"""``shaftline tour``: a frigate in a seaway with every observer, then a measured drive train.

The drive train is that of the tug Tito Neri (Vrijdag & Martelli 2021): five measured steady states
(Table 4) and a frequency response of nine points about point C (Table 2), compared with the model with
each of the two parameter sets that the authors identified (Table 5).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

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
    "luenberger-low",
    "luenberger-moderate",
    "luenberger-high",
    "shaft-kalman",
    "power-balance",
    "shaft-acceleration",
    "shaft-acceleration-derived",
    "immersion-invariance-low",
    "immersion-invariance-moderate",
    "immersion-invariance-high",
    "random-walk-kalman-printed",
    "random-walk-kalman",
)
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
DISCARDED_ABOVE = 900.0
"""Frequency [rad/s] above which the authors discard two points because of the weak signal."""


class Seaway(NamedTuple):
    """Simulation of the frigate: a table of observers, a sentence on the best ones, and a figure."""

    table: pd.DataFrame
    sentence: str
    figure: Figure


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
    rows, estimates = [], {}
    for name in OBSERVERS:
        exact, _ = follow(get_observer(name), frigate, clean, dt)
        real, valid = follow(get_observer(name), frigate, noisy, dt)
        row = {
            "observer": name,
            PERFECT: variance_accounted_for(truth, exact),
            NOISY: variance_accounted_for(truth, real),
            "rms error, noisy [m/s]": float(np.sqrt(np.mean((real - truth) ** 2))),
            "valid [%]": 100.0 * float(np.mean(valid)),
        }
        rows.append(row)
        estimates[f"{name}: VAF {row[NOISY]:.1f} %"] = real
        tick()
    table = pd.DataFrame(rows)
    scores = table.set_index("observer").drop("shaft-acceleration")
    noisy_scores, best = scores[NOISY], scores[PERFECT].idxmax()
    sentence = (
        f"With noisy sensors and no accelerometer, {noisy_scores.idxmax()} is the most accurate "
        f"({noisy_scores.max():.1f} %); {best}, the best with perfect sensors, amplifies the noise and "
        f"falls to {noisy_scores[best]:.1f} %."
    )
    return Seaway(table, sentence, _draw_seaway(samples["time"], truth, estimates))


def _measured(name: str) -> pd.DataFrame:
    """Return a published table of measurements of Tito Neri, indexed by its first column."""
    with resources.files("shaftline.plant").joinpath(f"data/{name}.csv").open() as file:
        return pd.read_csv(file, index_col=0)


def _settled(ship: Ship, voltage: float) -> tuple[float, float]:
    """Return motor speed [rad/s] and current [A] two seconds after switching on from standstill."""
    pitch = ship.propeller.pitch_ratio_max
    rest = State(pitch, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    last = simulate(ship, Schedule(voltage, pitch), 2.0, initial=rest)[-1]
    return float(last["shaft_speed"]) * ship.transmission.gear_ratio, float(last["motor_current"])


def speed_errors_percent(ship: Ship) -> NDArray[np.float64]:
    """Return the errors of the steady speed at the five voltages [%], shape (5,)."""
    points, pitch = _measured("tito_neri_operating_points"), ship.propeller.pitch_ratio_max
    steady = [equilibrium(ship, float(volt), pitch) for volt in points["motor_voltage_V"]]
    speed = np.array([one.state.shaft_speed for one in steady]) * ship.transmission.gear_ratio
    return np.asarray(100.0 * (speed / points["motor_speed_rad_s"].to_numpy() - 1.0))


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
        load = float(plant["kq"][0, 0] * plant["density"] * plant["diameter"] ** 5)
        load = load / (2.0 * np.pi) ** 2 / ratio**3
        friction = float(plant["coulomb_engine_side"]) / ratio
        constant, ohm = float(plant["motor_constant"]), float(plant["armature_resistance"])
        for point in _measured("tito_neri_operating_points").itertuples():
            volt, speed, current = map(float, point[1:4])
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
        for line in measured.itertuples():
            frequency = float(line.Index)
            row = {"model": name, "frequency_rad_s": frequency}
            for quantity, signal in (("speed", "shaft_speed"), ("current", "motor_current")):
                value = complex(model[signal, "drive"](1j * frequency))
                value *= REFERENCE_VOLTAGE / getattr(point.state, signal)
                gain, phase = f"{quantity}_gain", f"{quantity}_phase_deg"
                row[f"{gain}_measured"] = float(getattr(line, gain))
                row[gain] = abs(value)
                row[f"{phase}_measured"] = float(getattr(line, phase))
                row[phase] = float(np.degrees(np.angle(value)))
            rows.append(row)
    return pd.DataFrame(rows)


def gains(response: pd.DataFrame) -> pd.DataFrame:
    """Return the gains of :func:`frequency_response` side by side: measured, and of each model."""
    columns: dict[str, object] = {}
    for quantity in ("speed", "current"):
        for model, lines in response.groupby("model", sort=False):
            columns["rad/s"] = lines["frequency_rad_s"].to_numpy()
            columns[f"{quantity}, measured"] = lines[f"{quantity}_gain_measured"].to_numpy()
            short = str(model).removeprefix("tito-neri-")
            columns[f"{quantity}, {short}"] = lines[f"{quantity}_gain"].to_numpy()
    return pd.DataFrame(columns)


def response_error(response: pd.DataFrame, model: str, quantity: str) -> float:
    """Return the rms error of a gain [dB] over the frequencies that the authors used."""
    line = response[(response["model"] == model) & (response["frequency_rad_s"] < DISCARDED_ABOVE)]
    ratio = line[f"{quantity}_gain"] / line[f"{quantity}_gain_measured"]
    return float(np.sqrt(np.mean((20.0 * np.log10(ratio)) ** 2)))


def verdict(points: pd.DataFrame, model: str) -> str:
    """Return a sentence on the balance and the voltage at which a model differs most."""
    line = points[points["model"] == model].set_index("voltage_V")
    errors = {name: line[f"{name}_balance_percent"].abs() for name in ("motor", "shaft")}
    name, other = sorted(errors, key=lambda one: errors[one].mean(), reverse=True)
    worst = errors[name]
    column, unit = {
        "motor": ("motor_balance_V", "V of the supply"),
        "shaft": ("shaft_balance_N_m", "N m of the motor's torque"),
    }[name]
    at = worst.idxmax()
    return (
        f"{model}: the {name} balance differs most (mean {worst.mean():.1f} %, the other "
        f"{errors[other].mean():.1f} %), worst at {at:.2f} V, where the measured speed and "
        f"current leave {line[column].loc[at]:+.3g} {unit} unaccounted for ({worst.loc[at]:.1f} %)."
    )


def _draw_seaway(
    time: NDArray[Any], truth: NDArray[Any], estimates: dict[str, NDArray[Any]]
) -> Figure:
    """Draw the true advance velocity [m/s] and the estimates by title, one panel for each."""
    shown = (time >= 100.0) & (time <= 160.0)
    columns, colours = 3, display.figures
    rows = -(-len(estimates) // columns)
    figure, axes = display.figures.new_figure(rows, columns, (12.0, 2.0 * rows + 0.6))
    figure.suptitle(
        "Advance velocity of the frigate in head seas, Hs 2.9 m: true (dark), estimated from noisy "
        "speed, torque and pitch (red)",
        fontsize=11,
    )
    limits = truth[shown].min() - 0.6, truth[shown].max() + 0.6
    for axis, (title, estimate) in zip(axes.flat, estimates.items(), strict=False):
        axis.plot(time[shown], truth[shown], color=colours.TRUTH, linewidth=1.3)
        axis.plot(time[shown], estimate[shown], color=colours.ESTIMATE, linewidth=0.8, alpha=0.9)
        axis.set_title(title, fontsize=9)
        axis.set_ylim(limits)
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(estimates) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("v_a [m/s]", fontsize=8)
    for axis in axes.flat[max(0, len(estimates) - columns) : len(estimates)]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def _draw_drive_train(points: pd.DataFrame, response: pd.DataFrame) -> Figure:
    """Draw measured and simulated operating points and frequency response of Tito Neri."""
    figure, axes = display.figures.new_figure(2, 2, (10.0, 7.0))
    figure.suptitle("Tito Neri drive train: measured (black) and simulated", fontsize=12)
    panels = (
        (points, "voltage_V", "motor_speed_rad_s", "motor speed [rad/s]"),
        (points, "voltage_V", "motor_current_A", "motor current [A]"),
        (response, "frequency_rad_s", "speed_gain", "speed gain [-], normalised at point C"),
        (response, "frequency_rad_s", "current_gain", "current gain [-], normalised at point C"),
    )
    for axis, (table, along, column, label) in zip(axes.flat, panels, strict=True):
        for colour, (model, line) in zip(
            display.figures.PALETTE, table.groupby("model", sort=False), strict=False
        ):
            if model == MODELS[0]:
                measured = line[f"{column}_measured"].clip(lower=1e-3)
                axis.plot(line[along], measured, "ko", label="measured")
            axis.plot(line[along], line[column], color=colour, marker="x", label=model)
        axis.set_xlabel("motor voltage [V]" if table is points else "frequency [rad/s]")
        axis.set_ylabel(label)
    for axis in axes[1]:
        axis.set(xscale="log", yscale="log")
        axis.axvspan(700, 7000, color=display.figures.THESIS, alpha=0.15, linewidth=0)
    axes[0, 0].legend(fontsize=8, frameon=False)
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
        points, response = operating_points(), frequency_response()
        columns = {
            "voltage_V": "U [V]",
            "motor_speed_rad_s_measured": "speed measured [rad/s]",
            "motor_speed_rad_s": "simulated",
            "speed_error_percent": "error [%]",
            "motor_current_A_measured": "current measured [A]",
            "motor_current_A": "simulated ",
            "current_error_percent": "error [%] ",
        }
        for model, own in points.groupby("model", sort=False):
            shown = own[list(columns)].rename(columns=columns)
            print_table(shown, f"2. Real measurements of a drive train, against {model}")
        print_table(
            gains(response),
            "3. Its measured frequency response about 5.89 V: gains, measured and simulated",
        )
        for model in MODELS:
            say(f"- {verdict(points, model)}")
        for model in MODELS:
            speed, current = (response_error(response, model, q) for q in ("speed", "current"))
            say(
                f"- {model}: rms gain error of the frequency response up to 500 rad/s: speed "
                f"{speed:.2f} dB, current {current:.2f} dB."
            )
        display.figures.save(_draw_drive_train(points, response), out / "tito-neri.png")
        for name, table in {
            "seaway": sea.table,
            "tito-neri-points": points,
            "tito-neri-response": response,
        }.items():
            write_atomically(out / f"{name}.csv", partial(table.to_csv, index=False))
        say(
            f"\nPictures: {out / 'seaway.png'} and {out / 'tito-neri.png'}; the tables are in the "
            "same folder as CSV."
        )
