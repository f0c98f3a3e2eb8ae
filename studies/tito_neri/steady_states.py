"""Tito Neri: a real drive train, measured and simulated (Vrijdag & Martelli 2021).

Five measured steady states (Table 4) and a nine-point frequency response about point C (Table 2) meet
the model with each of the two parameter sets that its authors identified (Table 5).
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant import Schedule, Ship, equilibrium, linearise, load_ship, simulate
from ...plant.state import State
from ..side_by_side import published

MODELS = ("tito-neri-staircase", "tito-neri-sine")
REFERENCE_VOLTAGE = 5.89  # point C, about which the frequency response was measured
DISCARDED_ABOVE = 900.0  # rad/s; the authors discard 1000 and 5000 rad/s: too little signal


def _settled(ship: Ship, voltage: float) -> tuple[float, float]:
    """Motor speed [rad/s] and current [A], two seconds after switching on from standstill."""
    rest = State(ship.propeller.pitch_ratio_max, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    last = simulate(ship, Schedule(voltage, ship.propeller.pitch_ratio_max), 2.0, initial=rest)[-1]
    return float(last["shaft_speed"]) * ship.transmission.gear_ratio, float(last["motor_current"])


def speed_errors_percent(ship: Ship) -> NDArray[np.float64]:
    """Steady speed at the five voltages less the measured one [%], shape (5,)."""
    found = []
    for point in published("tito_neri_operating_points").itertuples():
        steady = equilibrium(ship, float(point.motor_voltage_V), ship.propeller.pitch_ratio_max)
        speed = steady.state.shaft_speed * ship.transmission.gear_ratio
        found.append(100.0 * (speed / float(point.motor_speed_rad_s) - 1.0))
    return np.array(found)


def operating_points() -> pd.DataFrame:
    """Measured and simulated steady states, and what each balance lacks with measured neighbours.

    Returns:
        One row per model and point. ``motor_balance_V`` is U - K_e omega - R_a i and
        ``shaft_balance_N_m`` is K_e i - M_f - M_p, both of the *measured* speed and current: what
        the model's equation is off by when nothing else can be to blame. In percent: of the
        voltage, and of the motor's torque.
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
        for point in published("tito_neri_operating_points").itertuples():
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
    """Measured and linearised response to the voltage about point C, normalised as in the paper.

    Returns:
        One row per model and frequency: gains [-] of d(i/i_0)/d(U/U_0) and d(omega/omega_0)/
        d(U/U_0), phases [deg].
    """
    measured = published("tito_neri_frequency_response")
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
    """Rms error of a gain [dB] over the frequencies that the authors kept."""
    line = response[(response["model"] == model) & (response["frequency_rad_s"] < DISCARDED_ABOVE)]
    ratio = line[f"{quantity}_gain"] / line[f"{quantity}_gain_measured"]
    return float(np.sqrt(np.mean((20.0 * np.log10(ratio)) ** 2)))


def verdict(points: pd.DataFrame, model: str) -> str:
    """In which balance and at which voltages a model differs most, as a sentence."""
    line = points[points["model"] == model].set_index("voltage_V")
    motor = line["motor_balance_percent"].abs()
    shaft = line["shaft_balance_percent"].abs()
    name, worst, left_over, unit = (
        ("motor", motor, line["motor_balance_V"], "V of the supply")
        if motor.mean() > shaft.mean()
        else ("shaft", shaft, line["shaft_balance_N_m"], "N m of the motor's torque")
    )
    at = worst.idxmax()
    return (
        f"{model}: the {name} balance differs most (mean {worst.mean():.1f} %, the other "
        f"{min(motor.mean(), shaft.mean()):.1f} %), worst at {at:.2f} V, where the measured speed and "
        f"current leave {left_over.loc[at]:+.3g} {unit} unaccounted for ({worst.loc[at]:.1f} %)."
    )
