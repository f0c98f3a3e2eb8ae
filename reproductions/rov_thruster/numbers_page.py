"""The page's part on the numbers: how far ``identify`` comes, beside the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from shaftline.display.tables import markdown
from shaftline.mismatch.identify import Identification

from .numbers import CONSTANT, DEAD_ZONE, OFFSET, RESISTANCE, SETS, Freed, Refit
from .runs import CONSTANTS, OWNERS_DEAD_ZONE_V, SPEED, TOLERANCE_FACTOR, WHOLE

_SYMBOLS = {
    "motor_constant_V_s_rad": "K_e [V s/rad]",
    "armature_resistance_ohm": "R_a [ohm]",
    "coulomb_friction_engine_side_N_m": "Coulomb friction [N m]",
    "reverse_torque_fraction": "torque astern / ahead",
    "command_dead_zone_V": "dead zone [V]",
    "torque_offset_N_m": "torque offset [N m]",
}

INTRODUCTION = f"""\
## The numbers instead: `shaftline identify`

The same question to the other command: how far do the owners' constants come when they are found
anew? The same rows are shown, the numbers that are not free may be off by {TOLERANCE_FACTOR:g} times
the usual, and the third controller's runs are judged as above. In brackets the least that the same
numbers reach when they are fitted to the unseen run itself, by its own rms error: no result, but the
bound on one. Free is what `--free auto` tells, then with it what the diagnosis names, and from the
owners' whole model what may differ between astern and ahead.
"""

_WHY = """\
The speed obeys dω/dt = −(K²/RI) ω − (KQ/I) c ω|ω| + (K/RI) u. Three coefficients, four numbers:
R_a, I and KQ have one scale in common, which only a measured torque or current would tell. Of KQ the
speed says little even so: by the owners' constants the propeller's torque is 4 % of what the back-EMF
holds back at 110 rad/s, about the fastest that they run, and one looks much like the other."""


def section(
    found: Sequence[Refit], table: pd.DataFrame, diagnosed: pd.DataFrame, refused: Sequence[str]
) -> str:
    """The part of the page.

    Args:
        found: every refit.
        table: of the refits.
        diagnosed: table of the diagnoses, for what stands beside.
        refused: what the tool said of numbers that are not told together.
    """
    parts = [INTRODUCTION]
    for start in (CONSTANTS, WHOLE):
        parts += [f"**Start: {start}.** Rms error, rad/s.\n", _errors(start, table, diagnosed), ""]
    parts += ["**The numbers**, with 95 % intervals.\n", _numbers(found), ""]
    parts += [_conclusions(found, table, diagnosed)]
    parts += ["\n**What is refused together.**\n", *(f"- {sentence}." for sentence in refused)]
    left = found[0].identification.left_out
    parts += [f"- `--free auto` leaves {key}: {why}." for key, why in left.items()]
    return "\n".join([*parts, "", _WHY, ""])


def _of(table: pd.DataFrame, freed: Freed) -> pd.DataFrame:
    return table[(table["start"] == freed.start) & (table["freed"] == freed.title)]


def _errors(start: str, table: pd.DataFrame, diagnosed: pd.DataFrame) -> str:
    said = diagnosed[diagnosed["start"] == start]
    shown = pd.DataFrame({"unseen": said["unseen"].to_numpy()})
    shown["as it stands"] = said["rms_before_rad_s"].to_numpy()
    shown["diagnosed"] = said["rms_after_rad_s"].to_numpy()
    for freed in (freed for freed in SETS if freed.start == start):
        part = _of(table, freed).set_index("unseen").loc[shown["unseen"]]
        pairs = zip(part["rms_after_rad_s"], part["rms_least_rad_s"], strict=True)
        shown[freed.title] = [f"{after:.2f} ({least:.2f})" for after, least in pairs]
    return markdown(shown)


def _numbers(found: Sequence[Refit]) -> str:
    rows = []
    for one in found:
        told = []
        for e in one.identification.estimates:
            low, high = e.ci95
            told.append(f"{_SYMBOLS[e.name]} {e.value:.4g} ({low:.4g} to {high:.4g})")
        rows.append(
            {
                "start": one.freed.start,
                "free": one.freed.title,
                "unseen": one.unseen,
                "found": "; ".join(told),
            }
        )
    return markdown(pd.DataFrame(rows))


def _span(values: pd.Series[float], digits: int = 2) -> str:
    return f"{values.min():.{digits}f} to {values.max():.{digits}f}"


def _smooth(table: pd.DataFrame) -> pd.DataFrame:
    return table[~table["unseen"].str.endswith("step")]


def _conclusions(found: Sequence[Refit], table: pd.DataFrame, diagnosed: pd.DataFrame) -> str:
    told, friction, zone, whole, astern, offset = (_smooth(_of(table, freed)) for freed in SETS)
    said = {s: _smooth(diagnosed[diagnosed["start"] == s]) for s in (CONSTANTS, WHOLE)}
    ratio = "after/before"
    first = [one.identification for one in found if one.freed == SETS[0]]
    constants = pd.Series([i.parameters[CONSTANT] / _nominal(i, CONSTANT) for i in first])
    warned = sum(bool(i.warnings) for i in first)
    last = [one.identification for one in found if one.freed == SETS[-1]]
    intervals = [e.ci95 for i in last for e in i.estimates if e.key == DEAD_ZONE]
    within = sum(low <= OWNERS_DEAD_ZONE_V <= high for low, high in intervals)
    volts = pd.Series(
        [i.parameters[OFFSET] * i.parameters[RESISTANCE] / i.parameters[CONSTANT] for i in last]
    )
    return "\n".join(
        [
            f"- **Numbers cannot stand in for physics.** Where the loss is left out, K_e and R_a bring "
            f"unseen sine and ramp to {_span(told[ratio])} of what they were, the diagnosis to "
            f"{_span(said[CONSTANTS][ratio])}; the best that the two could do is "
            f"{_span(told['rms_least_rad_s'] / told['rms_before_rad_s'])}. K_e comes out at "
            f"{_span(constants)} times the owners', and its intervals are of no use: {warned} of "
            f"{len(first)} times the tool says that what is left is no noise.",
            f"- **Physics named, the numbers hardly matter.** With friction free beside them the ratio "
            f"is {_span(friction[ratio])}, with the dead zone {_span(zone[ratio])}; the diagnosis, "
            f"which moves nothing else, is beaten on {_better(friction, said[CONSTANTS])} and "
            f"{_better(zone, said[CONSTANTS])} of {len(zone)} sines and ramps.",
            f"- **From the owners' whole model** K_e, R_a and dead zone gain on the sines only "
            f"({_span(whole[ratio])} over sines and ramps). With a constant torque offset free, the "
            f"ratio is {_span(offset[ratio])}, beside {_span(said[WHOLE][ratio])} by the diagnosis's "
            f"shape that has no name; {_span(offset['rms_after_rad_s'])} rad/s where "
            f"{_span(offset['rms_least_rad_s'])} is the bound. The offset is {_span(volts, 3)} V taken "
            "as a voltage: the asymmetry between astern and ahead that the diagnosis saw and could not "
            f"name. The owners' {OWNERS_DEAD_ZONE_V:g} V of dead zone lies in {within} of "
            f"{len(intervals)} intervals. Its rival, another torque constant astern, gives "
            f"{_span(astern[ratio])}; the tool can tell without the unseen runs, by the ramp that it "
            f"kept: FitPercent {_span(_kept(found, SETS[-1]), 1)} with the offset, "
            f"{_span(_kept(found, SETS[-2]), 1)} with the rival, {_span(_kept(found, SETS[-3]), 1)} "
            "with neither.",
            "- **The steps** gain nothing that a dead zone does not give: the rows in which the sign of "
            "the speed was guessed make up their error, and those are not fitted.",
        ]
    )


def _better(table: pd.DataFrame, than: pd.DataFrame) -> int:
    """On how many unseen runs the error is less."""
    error, other = (t.set_index("unseen")["rms_after_rad_s"] for t in (table, than))
    return int((error < other.loc[error.index]).sum())


def _kept(found: Sequence[Refit], freed: Freed) -> pd.Series[float]:
    """FitPercent on the ramp that the tool itself kept to judge by."""
    return pd.Series([o.identification.fit_after[SPEED] for o in found if o.freed == freed])


def _nominal(identification: Identification, key: str) -> float:
    return next(e.neutral for e in identification.estimates if e.key == key)
