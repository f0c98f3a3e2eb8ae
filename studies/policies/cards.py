"""Model cards of policies: what each was made with, what it does, where it is worse, what it is for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from ...core.files import write_text
from ...display.tables import markdown
from ...envs.tasks import HELD_OUT, get_task
from .comparison import (
    ALL,
    EVEN_FUEL,
    FIRST_SEED,
    FUEL,
    OBSERVER,
    QUANTITIES,
    Comparison,
    Difference,
    middle_of,
)
from .recipes import resistance, training
from .targets import said, verdicts

_SHOWN = (FUEL, EVEN_FUEL, "speed_error_rms_m_s", "torque_sd_kN_m", "torque_peak_kN_m",
          "rack_travel_mm_min", "overload_s", "overspeed_s", "shaft_speed_peak_rad_s",
          "power_peak_kW", "thrust_mean_kN", "failed", "reward")  # fmt: skip
_MORE_IS_BETTER = ("reward",)
_NEITHER = ("speed_mean_m_s",)  # the order is a number, not a bound
_LIMITS = """\
For simulation: a baseline to compare with and a start for one's own training, on the ship and task
above. It is not for a real ship. It was never tried outside this simulator, and nothing about its
stability is proven: high gains within its reach can swing. Of protections of the engine it has the
speed pilot's limiters alone. Beyond the speeds, seas and resistances above its behaviour is unknown;
waves come from ahead only. It reads eight instruments, with the noise and the observer above; others
were not tried here. It refuses a ship with other ranges
of pitch, rack or engine speed, and another version of the package."""


def write(one: Comparison, found: Sequence[Difference]) -> Path:
    """Write a policy's card beside its file.

    Args:
        one: comparison of the policy.
        found: paired differences, of other tasks too.

    Returns:
        The card's path.
    """
    path = one.source.with_suffix(".md")
    write_text(path, card(one, found))
    return path


def card(one: Comparison, found: Sequence[Difference]) -> str:
    """The card in Markdown."""
    own = [difference for difference in found if difference.task == one.task]
    # over a single sea, all seas say the same again
    apart = [d for d in own if len(one.seas) > 1 or d.sea != ALL]
    seas = ", ".join(one.seas)
    parts = [
        f"# Policy `{one.source.stem}`",
        f"Task: {get_task(one.task).description}. File: `{one.source.name}`.",
        "## Training",
        training(one),
        "## On held-out seas",
        f"{one.seeds} episodes of {one.episode_s:g} s a sea ({seas}), seeds from {FIRST_SEED:,}, "
        f"observer `{OBSERVER}`; mean over the seas, interquartile mean over the seeds with its 95 % "
        f"bootstrap interval. With {resistance(get_task(f'{one.task}:{HELD_OUT}'))}.",
        markdown(_kpis(one)),
        "\n".join(verdicts(own)),
        "## Where it is worse",
        "Paired differences, policy minus baseline, whose whole 95 % interval is on the bad side:",
        _worse(apart) or "- nowhere among these figures",
        "## Use and limits",
        _LIMITS,
        "## Columns",
        "\n".join(f"- `{name}`: {QUANTITIES[name]}" for name in _SHOWN),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _kpis(one: Comparison) -> pd.DataFrame:
    rows = []
    for name in _SHOWN:
        row = {"": name}
        for controller in one.controllers:
            middle, low, high = middle_of(name, one.of(controller, ALL)[name])
            row[controller] = f"{middle:.4g} ({low:.4g} to {high:.4g})"
        rows.append(row)
    return pd.DataFrame(rows)


def worse(found: Difference) -> bool:
    """Whether the whole interval of a difference is on the bad side."""
    if found.quantity in _NEITHER or found.difference == 0.0:
        return False
    better_up = found.quantity in _MORE_IS_BETTER
    if found.quantity == "thrust_mean_kN":
        if found.task != "storm":  # elsewhere thrust only follows the speed
            return False
        better_up = True
    return found.high < 0.0 if better_up else found.low > 0.0


def _worse(found: Sequence[Difference]) -> str:
    """A line a baseline and quantity, with the seas in which it is so."""
    lines: dict[tuple[str, str], list[str]] = {}
    for one in found:
        if worse(one):
            lines.setdefault((one.baseline, one.quantity), []).append(f"{one.sea}: {said(one)}")
    return "\n".join(
        f"- against {baseline}, `{quantity}`: {'; '.join(seas)}"
        for (baseline, quantity), seas in lines.items()
    )
