"""Tables and figures of a linear model: its modes, its channels, and their frequency responses."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core.lazy import control
from ..plant import Loop, Ship
from ..plant.loops import drop_unconnected_states
from ..plant.signals import SIGNALS
from .figures import TRUTH, new_figure

_UNITS = {
    "resistance_factor": "-",
    "inflow": "m/s",
    "engine_torque": "N m",
    "thrust": "N",
    **{signal.name: signal.unit for signal in SIGNALS},
}
_NO_RESPONSE = 1e-12
"""Gain, relative to the largest of the output, below which a channel counts as zero."""


def unit_of(name: str, ship: Ship) -> str:
    """Return the unit of an input, state or output of the linear model of a ship."""
    return ship.prime_mover.demand.unit if name == "drive" else _UNITS.get(name, "SI")


def modes(system: control.StateSpace) -> pd.DataFrame:
    """Return the poles of a linear model, slowest first.

    Columns: real and imaginary part [rad/s], time constant [s], natural frequency [rad/s], damping
    ratio.
    """
    poles = sorted(map(complex, system.poles()), key=lambda pole: (abs(pole), pole.imag))
    return pd.DataFrame(
        {
            "real [rad/s]": pole.real,
            "imaginary [rad/s]": pole.imag,
            "time constant [s]": -1.0 / pole.real if pole.real else np.nan,
            "natural frequency [rad/s]": abs(pole),
            "damping [-]": -pole.real / abs(pole) if pole else np.nan,
        }
        for pole in poles
    )


def _frequencies(system: control.StateSpace, points: int = 400) -> NDArray[np.float64]:
    """Return frequencies from well below the slowest pole to well above the fastest [rad/s]."""
    sizes = np.abs(system.poles())
    sizes = sizes[sizes > 1e-9]
    low, high = (sizes.min(), sizes.max()) if len(sizes) else (1.0, 1.0)
    return np.geomspace(low / 20.0, 50.0 * high, points)


def _responding_channels(system: control.StateSpace) -> list[tuple[int, int]]:
    """Return the indices (output, input) of the channels with a non-zero response."""
    response = np.abs(system(1j * _frequencies(system, 60), squeeze=False)).max(axis=2)
    responds = response > _NO_RESPONSE * response.max(axis=1, keepdims=True)
    return [(int(i), int(j)) for j, i in np.argwhere(responds.T)]


def channels(system: control.StateSpace, ship: Ship) -> pd.DataFrame:
    """Return steady gain, zeros and margins of each channel of a ship's model with a non-zero response.

    The margins are those of the loop closed with a gain of 1 or -1; they are missing if it is unstable,
    and infinite if they are unlimited.
    """
    rows = []
    for i, j in _responding_channels(system):
        one = drop_unconnected_states(system[i, j])
        output, acting = system.output_labels[i], system.input_labels[j]
        gain = float(np.real(one.dcgain()))
        loop = Loop(one * math.copysign(1.0, gain))
        bounds = loop.margins() if loop.stable else None
        zeros = sorted(map(complex, one.zeros()), key=abs)
        rows.append(
            {
                "from": f"{acting} [{unit_of(acting, ship)}]",
                "to": f"{output} [{unit_of(output, ship)}]",
                "steady gain": gain,
                "zeros [rad/s]": ", ".join(_format(zero) for zero in zeros) or "none",
                "gain margin [dB]": bounds.gain_margin_dB if bounds else np.nan,
                "phase margin [deg]": bounds.phase_margin_deg if bounds else np.nan,
            }
        )
    return pd.DataFrame(rows)


def _per(output: str, acting: str, ship: Ship) -> str:
    above, below = (unit_of(name, ship).replace("-", "1") for name in (output, acting))
    return above if below == "1" else f"{above} per {below}"


def _format(value: complex) -> str:
    return f"{value.real:.4g}" if abs(value.imag) < 1e-9 * abs(value) else f"{value:.4g}"


def frequency_response(system: control.StateSpace, ship: Ship, title: str) -> Figure:
    """Return a Bode plot: gain and phase of every channel with a response, one column for each input."""
    responding = _responding_channels(system)
    columns = sorted({j for _, j in responding})
    rows = sorted({i for i, _ in responding})
    frequency = _frequencies(system)
    response = system(1j * frequency, squeeze=False)
    size = (3.3 * len(columns) + 0.6, 3.2 * len(rows) + 0.6)
    figure, axes = new_figure(2 * len(rows), len(columns), size)
    figure.suptitle(title, fontsize=11)
    for a, i in enumerate(rows):
        for b, j in enumerate(columns):
            gain, phase = axes[2 * a, b], axes[2 * a + 1, b]
            output, acting = system.output_labels[i], system.input_labels[j]
            if (i, j) not in responding:
                gain.set_visible(False)
                phase.set_visible(False)
                continue
            level = 20.0 * np.log10(np.abs(response[i, j]))
            gain.semilogx(frequency, level, color=TRUTH, linewidth=1.2)
            turned = np.degrees(np.unwrap(np.angle(response[i, j])))
            phase.semilogx(frequency, turned, color=TRUTH, linewidth=1.2)
            gain.set_title(f"{acting} to {output}".replace("_", " "), fontsize=9)
            gain.set_ylabel(f"dB of {_per(output, acting, ship)}", fontsize=8)
            phase.set_ylabel("deg", fontsize=8)
            phase.set_xlabel("frequency [rad/s]", fontsize=8)
            for axis in (gain, phase):
                axis.tick_params(labelsize=7)
    return figure
