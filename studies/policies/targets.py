"""What the packaged policies were asked for, and whether they do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from .comparison import ALL, EVEN_FUEL, FUEL, Difference


class Target(NamedTuple):
    """One thing asked for, over all held-out seas.

    ``below`` is met where the whole interval lies below the bound, which is a percentage of the
    baseline. ``no more`` and ``no less`` are met unless the whole interval lies on the bad side of zero.
    """

    task: str
    baseline: str
    quantity: str
    wanted: str
    relation: Literal["below", "no more", "no less"]
    bound_percent: float = 0.0


TARGETS = (
    Target("transit", "combinator", FUEL, "less fuel per mile", "below"),
    Target("transit", "combinator", EVEN_FUEL, "less fuel per mile at equal speed", "below"),
    Target("transit", "combinator", "speed_error_rms_m_s", "no larger speed error", "no more"),
    Target("transit", "combinator", "overload_s", "no more overload", "no more"),
    Target("transit", "cpp-optimiser", FUEL, "fuel per mile at most 1 % higher", "below", 1.0),
    Target("transit", "cpp-optimiser", EVEN_FUEL,
           "the same at equal speed, at most 1 % higher", "below", 1.0),
    Target("transit", "cpp-optimiser", "torque_sd_kN_m",
           "torque fluctuation at least 20 % lower", "below", -20.0),
    *(
        Target("storm", baseline, quantity, wanted, "below")
        for baseline in ("combinator", "no-anti-spin")
        for quantity, wanted in (
            ("overspeed_s", "less overspeed"),
            ("shaft_speed_peak_rad_s", "lower peaks of shaft speed"),
            ("power_peak_kW", "lower power peaks"),
        )
    ),
    Target("storm", "anti-spin", "thrust_mean_kN", "no less thrust", "no less"),
)  # fmt: skip


def met(target: Target, found: Difference) -> bool:
    """Whether a difference does what was asked for."""
    if target.relation == "no more":
        return found.low <= 0.0
    if target.relation == "no less":
        return found.high >= 0.0
    if target.bound_percent == 0.0:
        return found.high < 0.0
    return found.percent_high <= target.bound_percent  # never where the baseline has none


def said(found: Difference, digits: int = 3) -> str:
    """A difference with its interval, in its unit and in percent of the baseline."""
    text = f"{found.difference:+.{digits}g} ({found.low:+.{digits}g} to {found.high:+.{digits}g})"
    if found.percent == found.percent:  # not nan
        text += f", {found.percent:+.1f} % ({found.percent_low:+.1f} to {found.percent_high:+.1f})"
    return text


def verdicts(found: Sequence[Difference]) -> list[str]:
    """One line a target whose task and baseline were sailed: met or not, with its numbers."""
    by = {(one.task, one.baseline, one.quantity): one for one in found if one.sea == ALL}
    lines = []
    for target in TARGETS:
        one = by.get((target.task, target.baseline, target.quantity))
        if one is None:
            continue
        word = "met" if met(target, one) else "not met"
        note = "" if one.excludes_zero else "; not told apart from zero"
        if one.percent != one.percent:  # nan
            note += f"; the {one.statistic} of {target.baseline} itself is zero"
        lines.append(
            f"- **{word}**: {target.task} against {target.baseline}, {target.wanted}: "
            f"`{one.quantity}` {one.statistic} {said(one)}{note}"
        )
    return lines
