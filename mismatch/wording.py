"""Words and numbers of the report's page, as an engineer reads them."""

from __future__ import annotations

import math
import re

import numpy as np
from markupsafe import Markup, escape

from .catalogue import Effect
from .diagnosis import Diagnosis
from .figures import interval
from .panels import block_rows, blocks, channel_name, scaled, superscript

_WORSE = 1.0
"""Points of FitPercent that a channel may lose to the correction without a word."""

_ELSEWHERE = 3.0
"""Ratio of what is missing on the part set aside to elsewhere, from which it is said."""


def number(value: float, digits: int = 3) -> str:
    """A number as it is read: thousands apart, powers of ten written out."""
    if math.isinf(value) or math.isnan(value):
        return "∞" if value > 0 else "−∞" if value < 0 else "?"
    if value == 0.0:
        return "0"
    power = int(f"{value:.{digits - 1}e}".split("e")[1])  # of the rounded number
    if -4 < power < 6:
        rounded = round(value, digits - 1 - power)
        apart = "," if abs(rounded) >= 1e4 else ""
        text = f"{rounded:{apart}.{max(0, digits - 1 - power)}f}".replace(",", " ")
    else:
        raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{value / 10.0**power:.{digits - 1}f}·10{raised}"
    return text.replace("-", "−")


def measure(value: float, unit: str) -> str:
    """A number with its unit, large forces and torques with a prefix."""
    factor, shown = scaled(abs(value), unit) if math.isfinite(value) else (1.0, superscript(unit))
    return f"{number(value / factor)} {shown}".strip()


def effect_words(effect: Effect) -> str:
    """An effect's name for people."""
    words = effect.id.replace("-", " ")
    return words[:1].upper() + words[1:]


def span(start: float, end: float) -> str:
    """A stretch of time, in whole seconds unless it is short."""
    digits = 0 if end - start >= 20.0 else 1
    return f"{start:.{digits}f} to {end:.{digits}f} s"


def spans(windows: list[tuple[float, float]], duration: float) -> str:
    """Windows of a recording in words."""
    if not windows:
        return "not located"
    if windows[0][0] <= 0.0 and windows[0][1] >= 0.98 * duration:
        return f"the whole recording, 0 to {duration:.0f} s"
    said = ", ".join(span(a, b) for a, b in windows[:6])
    return said + (f" and {len(windows) - 6} more" if len(windows) > 6 else "")


def breakable(key: str) -> Markup:
    """A key that a narrow column may break at its joints."""
    return Markup(re.sub(r"([._])", r"\1<wbr>", str(escape(key))))


def remarks(diagnosis: Diagnosis) -> list[str]:
    """What a careful reader should be told beside the verdict."""
    said = []
    worse = [
        channel_name(column)[0]
        for column, before in diagnosis.fit_before.items()
        if diagnosis.fit_after[column] < before - _WORSE
    ]
    if worse:
        said.append(
            f"On the part set aside the corrected ship follows {', '.join(worse)} worse than the "
            "nominal one: take the correction as a description of this recording, not as a model."
        )
    inside = np.zeros(len(diagnosis.time_s), bool)
    for a, b in diagnosis.held_out:
        inside |= (diagnosis.time_s >= a) & (diagnosis.time_s < b)
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    where = blocks(inside.astype(float), size) > 0.5
    for (name, _), residual in zip(diagnosis.balances, diagnosis.residual_after, strict=True):
        means = blocks(residual, size) - float(np.median(residual[~inside]))
        here, there = (float(np.sqrt(np.mean(means[part] ** 2))) for part in (where, ~where))
        if not worse and here > _ELSEWHERE * there > 0.0:
            said.append(
                f"In the {name} balance, {here / there:.0f} times as much is missing on the part set "
                "aside as elsewhere. What acts only there was never fitted: set another part aside "
                "and diagnose again."
            )
    colour = diagnosis.left_over
    if colour is not None and diagnosis.findings:
        name = diagnosis.balances[colour.balance][0]
        said.append(
            f"What is named leaves more than the instruments' noise: in the {name} balance, "
            f"{number(colour.ratio, 2)} times its power between {number(colour.low_Hz, 2)} and "
            f"{number(colour.high_Hz, 2)} Hz. The named form is close, not exact."
        )
    return said
