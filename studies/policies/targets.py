"""What is asked of the policies, and whether they do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .comparison import HELD, TUNED, VA_PITCH, Difference


class Target(NamedTuple):
    """One thing asked for on a task's held-out seas.

    Met where the whole interval of the difference, in percent of the baseline, lies within the bounds.
    """

    task: str
    baseline: str
    quantity: str
    low: float
    high: float


TARGETS = (
    Target("rough-sea", HELD, "wave_torque_kN_m", -100.0, -30.0),
    Target("rough-sea", HELD, "wave_engine_torque_kN_m", -100.0, -80.0),
    Target("rough-sea", HELD, "power_peak_kW", -100.0, -20.0),
    Target("rough-sea", HELD, "speed_mean_m_s", -1.0, 1.0),
    Target("rough-sea", HELD, "fuel_kg_nmi", -100.0, 2.0),
    Target("rough-sea", VA_PITCH, "wave_torque_kN_m", -100.0, -12.0),
    Target("calm-machinery", HELD, "wave_torque_kN_m", -100.0, -25.0),
    Target("calm-machinery", HELD, "wave_engine_torque_kN_m", -100.0, -60.0),
    Target("calm-machinery", HELD, "fuel_kg_nmi", -100.0, 2.0),
    Target("acceleration", VA_PITCH, "rise_s", -100.0, -20.0),
    Target("acceleration", TUNED, "rise_s", -100.0, -20.0),
    Target("flank", HELD, "limit_s", -100.0, -90.0),
    Target("flank", HELD, "speed_mean_m_s", -1.0, 100.0),
    Target("silent", HELD, "outside_bucket_s", -100.0, -50.0),
)


def met(target: Target, found: Difference) -> bool:
    """Whether a difference does what was asked for."""
    return target.low <= found.percent_low and found.percent_high <= target.high


def rows(found: Sequence[Difference]) -> list[dict[str, str]]:
    """A row a target whose task and baseline were sailed, as a table has them."""
    by = {(one.task, one.baseline, one.quantity): one for one in found}
    table = []
    for target in TARGETS:
        one = by.get((target.task, target.baseline, target.quantity))
        if one is None:
            continue
        ends = [f"{end:+g} %" for end in (target.low, target.high) if abs(end) < 99.5]
        table.append(
            {
                "task": target.task,
                "against": target.baseline,
                "figure": f"`{target.quantity}`",
                "asked for": " to ".join(ends),
                "found": f"{one.percent:+.1f} % ({one.percent_low:+.1f} to {one.percent_high:+.1f})",
                "": "met" if met(target, one) else "**short**",
            }
        )
    return table
