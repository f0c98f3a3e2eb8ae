"""Tables 2-2 to 2-14, 3-5 and 3-9: poles, zeros and steady gains of the linear models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from shaftline.core.lazy import control
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.linear import shaft_model
from shaftline.observers.shaft_kalman import ShaftKalman
from shaftline.observers.torque_curve import torque_slopes
from shaftline.plant import Ship, equilibrium, linearise, load_ship

from ..side_by_side import published

# table number: (output, input) in our names
TABLES = {
    "2-2": ("pitch_ratio", "pitch_command"),
    "2-3": ("shaft_speed", "pitch_command"),
    "2-4": ("ship_speed", "pitch_command"),
    "2-5": ("shaft_torque", "pitch_command"),
    "2-6": ("shaft_speed", "drive"),
    "2-7": ("ship_speed", "drive"),
    "2-8": ("shaft_torque", "drive"),
    "2-9": ("shaft_speed", "resistance_factor"),
    "2-10": ("ship_speed", "resistance_factor"),
    "2-11": ("shaft_torque", "resistance_factor"),
    "2-12": ("shaft_speed", "inflow"),
    "2-13": ("ship_speed", "inflow"),
    "2-14": ("shaft_torque", "inflow"),
}


def reduced(system: control.StateSpace) -> tuple[list[float], list[float], float]:
    """Poles, zeros [rad/s] and steady gain of one transfer, common factors cancelled, by size."""
    poles = [complex(p) for p in system.poles()]
    zeros = [complex(z) for z in system.zeros() if abs(z) < 1e6]
    for zero in list(zeros):
        near = [p for p in poles if abs(p - zero) < 1e-7 * max(1.0, abs(p))]
        if near:
            poles.remove(near[0])
            zeros.remove(zero)
    gain = float(np.real(system.dcgain()))
    return sorted((p.real for p in poles), key=abs), sorted((z.real for z in zeros), key=abs), gain


def sorted_numbers(text: Any) -> list[float]:
    """Numbers of a printed cell, by size."""
    if not isinstance(text, str) or not text.strip():
        return [float(text)] if isinstance(text, float) and np.isfinite(text) else []
    return sorted((float(part) for part in text.split(",")), key=abs)


def _shown(values: list[float]) -> str:
    return ", ".join(f"{value:.4f}" for value in values) or "–"


def plant_transfers(ship: Ship) -> pd.DataFrame:
    """Return every transfer of Tables 2-2 to 2-14 at A to D, ours beside the thesis's."""
    printed = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    rows = []
    for point, model in models(ship).items():
        for table, (output, source) in TABLES.items():
            poles, zeros, gain = reduced(model[output, source])
            line = printed[
                (printed["table"] == table) & (printed["working_point_or_source"] == point)
            ].iloc[0]
            thesis_gain = float(line["dc_gain"])
            difference = 100.0 * (gain / thesis_gain - 1.0)
            rows.append(
                {
                    "table": table,
                    "transfer": f"{output} / {source}",
                    "point": point,
                    "poles": _shown(poles),
                    "poles_thesis": _shown(sorted_numbers(line["poles_rad_s"])),
                    "zeros": _shown(zeros),
                    "zeros_thesis": _shown(sorted_numbers(line["zeros_rad_s"])),
                    "gain": gain,
                    "gain_thesis": thesis_gain,
                    "gain_difference_percent": difference,
                }
            )
    return pd.DataFrame(rows)


def observer_transfers(ship: Ship) -> pd.DataFrame:
    """Poles and zeros of the shaft Kalman filter (Table 3-5) and of the I&I observer (3-9)."""
    a, _, c = shaft_model(float(ship.record()["inertia_propeller_side"]))
    gain = ShaftKalman().gain(ship)
    speed = control.ss(a - gain @ c, gain, c, [[0.0]])
    rows = [
        {
            "table": "3-5",
            "observer": "shaft-kalman",
            "transfer": "omega estimated / omega",
            "poles": ", ".join(f"{p:.2f}" for p in ShaftKalman().poles(ship)),
            "poles_thesis": "-10.53 ± 10.41i",
            "zeros": ", ".join(f"{z.real:.2f}" for z in speed.zeros()),
            "zeros_thesis": "-10.42",
        }
    ]
    points = published("advance_velocity_thesis_working_points")
    inertia = float(ship.record()["inertia_propeller_side"])
    for point, printed in (("A", "-0.1481"), ("D", "-8.6677")):
        inputs = points.loc[point]
        found = equilibrium(ship, float(inputs["fuel_rack_mm"]), float(inputs["pitch_ratio"]))
        by_speed, by_velocity = torque_slopes(
            ship.record(),
            found.outputs.advance_velocity,
            found.state.shaft_speed,
            found.outputs.pitch_ratio,
        )
        for name, gamma in (
            ("low", ImmersionInvariance.tunings["low"].gain),
            ("high", ImmersionInvariance.tunings["high"].gain),
        ):
            rows.append(
                {
                    "table": "3-9",
                    "observer": f"immersion-invariance-{name}",
                    "transfer": f"v_a estimated / omega at {point}",
                    "poles": f"{gamma * by_velocity / inertia:.4f}",
                    "poles_thesis": "0",
                    "zeros": f"{-by_speed / inertia:.4f}",
                    "zeros_thesis": printed,
                }
            )
    return pd.DataFrame(rows)


def models(ship: Ship) -> dict[str, control.StateSpace]:
    """Linear models at A to D, for the Bode plot of Figure 2-5."""
    points = published("advance_velocity_thesis_working_points")
    return {
        point: linearise(
            ship,
            equilibrium(
                ship,
                float(points.loc[point, "fuel_rack_mm"]),
                float(points.loc[point, "pitch_ratio"]),
            ),
        )
        for point in "ABCD"
    }


def compared() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Plant and observer transfers of the frigate."""
    frigate = load_ship("frigate")
    return plant_transfers(frigate), observer_transfers(frigate)
