"""Figures over the operating regime: where a balance lacks what, and the shape of what has no name."""

from __future__ import annotations

import numpy as np

from ...plant.columns import drive_column
from ..estimate import HALF_95
from ..outcome import Outcome
from .figures import QUANTITY, changed, interval
from .panels import AFTER, BEFORE, HELD_OUT, MEASURED, QUIET, Array, block_rows, blocks, panel, svg
from .wording import channel_name, scaled, with_unit

_BINS = 12


def located_rows(diagnosis: Outcome) -> list[int]:
    """Balances that the findings point to; where there are none, the one that wanders most."""
    if diagnosis.findings:
        return list(dict.fromkeys(f.row for f in diagnosis.findings))
    names = [name for name, _ in diagnosis.balances]
    if diagnosis.shape is not None and diagnosis.shape.balance in names:
        return [names.index(diagnosis.shape.balance)]
    if diagnosis.left_over is not None:
        return [diagnosis.left_over.balance]
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    means = [
        float(np.std(blocks(r, size)) / (np.std(r) + 1e-300)) for r in diagnosis.residual_before
    ]
    return [int(np.argmax(means))]


def signals_shown(diagnosis: Outcome) -> dict[str, tuple[Array, str, str]]:
    """Signals over which a residual is shown: values, name and unit.

    They are simulated, by the corrected ship: measured ones share their noise with the residual.
    """
    found = {}
    columns = {
        "shaft_speed": "shaft_speed_rad_s", "ship_speed": "ship_speed_m_s", "pitch_ratio": "pitch_ratio",
    }  # fmt: skip
    for key, column in columns.items():
        if column in diagnosis.after:
            found[key] = (diagnosis.after[column], *channel_name(column))
    found["drive"] = (diagnosis.drive, *channel_name(drive_column(diagnosis.ship)))
    return {k: v for k, v in found.items() if np.ptp(v[0]) > 0.02 * np.abs(v[0]).max()}


def binned(signal: Array, residual: Array, size: int) -> tuple[Array, Array, Array]:
    """Means of a residual in bins of equal count, and half their 95 % interval, from block means."""
    x, y = blocks(signal, size), blocks(residual, size)
    order = np.argsort(x)
    parts = [p for p in np.array_split(order, min(_BINS, max(1, len(order) // 5))) if len(p) > 1]
    error = [HALF_95 * np.std(y[p], ddof=1) / np.sqrt(len(p)) for p in parts]
    return (
        np.array([x[p].mean() for p in parts]),
        np.array([y[p].mean() for p in parts]),
        np.array(error),
    )


def regimes(diagnosis: Outcome) -> list[str]:
    """What the located balances lack over the operating regime, before and after."""
    drawn: list[str] = []
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    shape = diagnosis.shape
    for row in located_rows(diagnosis)[:2]:
        name, unit = diagnosis.balances[row]
        lines = [(diagnosis.residual_before[row], BEFORE)]
        if changed(diagnosis):
            lines.append((diagnosis.residual_after[row], AFTER))
        for key, (signal, words, signal_unit) in signals_shown(diagnosis).items():
            stats = [(*binned(signal, values, size), colour) for values, colour in lines]
            factor, shown = scaled(max(float(np.abs(s[1]).max()) for s in stats), unit)
            figure, axes = panel(
                f"{name} balance over {words}", with_unit(words, signal_unit),
                with_unit(f"missing {QUANTITY.get(name, '')}", shown),
            )  # fmt: skip
            axes.axhline(0.0, color=MEASURED, linewidth=0.6)
            if shape is not None and shape.signal == key and shape.balance == name:
                axes.plot(shape.knots, shape.values / factor, color=MEASURED, lw=1.2, ls="--")
            for x, mean, error, colour in stats:
                axes.errorbar(
                    x, mean / factor, yerr=error / factor, color=colour, markersize=3.2,
                    fmt="o--" if colour == BEFORE else "o-", linewidth=1.0, capsize=2,
                )  # fmt: skip
            drawn.append(
                svg(figure, f"residual of the {name} balance over {words}", f"g{len(drawn)}")
            )
    return drawn


def shape_panel(diagnosis: Outcome) -> list[str]:
    """What has no name, over the signal that it follows."""
    shape = diagnosis.shape
    if shape is None:
        return []
    factor, unit = scaled(float(np.abs(shape.values).max()), shape.unit)
    words = {"drive": "drive demand"}.get(shape.signal, shape.signal.replace("_", " "))
    label = with_unit(f"missing {QUANTITY.get(shape.balance, '')}", unit)
    figure, axes = panel(
        f"what the {shape.balance} balance lacks", with_unit(words, shape.signal_unit), label, 3.0
    )
    if shape.signal == "time":
        for a, b in diagnosis.held_out:
            axes.axvspan(a, b, color=HELD_OUT, linewidth=0)
    axes.axhline(0.0, color=MEASURED, linewidth=0.6)
    names = [name for name, _ in diagnosis.balances]
    followed = {"time": (diagnosis.time_s, "", ""), **signals_shown(diagnosis)}
    if shape.signal in followed and shape.balance in names:
        size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
        residual = diagnosis.residual_before[names.index(shape.balance)]
        # the nominal simulation's own signal: the shape was found over it
        nominal = {"shaft_speed": "shaft_speed_rad_s", "ship_speed": "ship_speed_m_s"}
        signal = diagnosis.before.get(nominal.get(shape.signal, ""), followed[shape.signal][0])
        axes.plot(
            blocks(signal, size), blocks(residual, size) / factor, ".", color=QUIET, markersize=3.0
        )
    axes.plot(shape.knots, shape.values / factor, "o-", color=BEFORE, linewidth=1.8, markersize=4.5)
    return [svg(figure, f"shape of what the {shape.balance} balance lacks", "s0")]
