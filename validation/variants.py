"""Variants of the proof: the same cases, met as recordings of real ships are.

Each draws what it needs from the case's seed and index alone, beside what the plain case has drawn, so
that effect, strength, sea and programme stay the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from .reality.bench import PROGRAMMES, SHIP_FILE, bench_numbers
from .reality.effects import BENCH, FRIGATE
from .reality.instruments import LIVELY
from .reality.numbers import Numbers, frigate_numbers, ship_file

if TYPE_CHECKING:
    from .cases import Case

PLAIN = "plain"
REALISTIC, SLOW, RAW, ONE_MISSING, CLOSED_LOOP = (
    "realistic", "1-hz", "100-hz", "one-missing", "closed-loop",
)  # fmt: skip

VARIANTS = {
    PLAIN: "ten rows a second, every channel, a file that is right within its tolerances",
    REALISTIC: "inertia and friction of the file off by 10 %, resistance, KT and KQ by 5 %; calibrated "
    "on a healthy record of the same ship",
    SLOW: "a log that keeps one row a second of ten",
    RAW: "a hundred rows a second, unfiltered, with as much noise in each hertz",
    ONE_MISSING: "one of shaft torque, ship speed and pitch reading is not recorded (of the thruster: "
    "the current)",
    CLOSED_LOOP: "a governor holds the shaft speed by what the encoder shows, noise and all",
}
"""By name: how the recordings are."""

OFF = {
    FRIGATE: {
        "inertia_front": 0.1, "inertia_back": 0.1, "rub": 0.1, "resistance": 0.05, "kt_scale": 0.05,
        "rotative": 0.05,
    },
    BENCH: {"inertia": 0.1, "rub": 0.1, "kt": 0.05, "kq": 0.05},
}  # fmt: skip
"""By how much a realistic file's numbers differ from the true ship's, as a share, either way."""

FRIGATE_RUB = 3000.0
"""Coulomb friction [N m] before the gauge of which a realistic frigate's file knows."""

LOGGED_S = {SLOW: 1.0, RAW: 0.01}
"""Interval of the rows [s] where it is not the case's own."""

MISSING = {
    "shaft_torque_N_m": "torque-sensor",
    "ship_speed_m_s": "speed-log",
    "pitch_ratio": "pitch-sensor",
}
"""Columns that may be missing, and how the ids of faults begin that would be missing with them."""

HEALTHY_S = {FRIGATE: 900.0, BENCH: 450.0}
"""Length of a healthy record."""


def varied(case: Case, variant: str) -> Case:
    """A case in another variant.

    Args:
        case: plain.
        variant: of :data:`VARIANTS`.
    """
    rng = np.random.default_rng([case.seed, case.index, 21])
    more: dict[str, Any] = {}
    if variant == REALISTIC:
        lively = PROGRAMMES if case.ship == BENCH else LIVELY
        more = {
            "factors": dict.fromkeys(case.factors, 1.0),
            "off": {k: float(1.0 + o * rng.choice([-1.0, 1.0])) for k, o in OFF[case.ship].items()},
            "columns": tuple(c for c in case.columns if c != "thrust_N"),  # no key says KT alone
            "healthy_programme": str(rng.choice([p for p in lively if p != case.programme])),
            "healthy_seed": int(rng.integers(2**31)),
        }
    elif variant == ONE_MISSING:
        allowed = [
            column for column, fault in MISSING.items()
            if not any(one.effect.id.startswith(fault) for one in case.effects)
        ]  # fmt: skip
        missing = str(rng.choice(allowed))
        more = {"missing": "motor_current_A" if case.ship == BENCH else missing}
    return replace(case, variant=variant, **more)


def healthy_of(case: Case) -> Case | None:
    """The case of the healthy record; None where there is none."""
    if not case.healthy_programme:
        return None
    return replace(
        case, kind="null-calm", effects=(), programme=case.healthy_programme,
        programme_seed=case.healthy_seed, noise_seed=case.healthy_seed + 1,
        seconds=HEALTHY_S[case.ship],
    )  # fmt: skip


def file_numbers(case: Case) -> Numbers:
    """Numbers of a case's ship as its file has them."""
    if case.ship == BENCH:
        return bench_numbers()
    rub = FRIGATE_RUB if case.variant == REALISTIC else 0.0
    return frigate_numbers() | {"rub": rub}


def calibrated_numbers(case: Case) -> Numbers:
    """The same once what the file is wrong about was put right."""
    found = file_numbers(case)
    return found | {name: found[name] * factor for name, factor in case.off.items()}


def true_numbers(case: Case) -> Numbers:
    """The true ship's, without effects."""
    found = calibrated_numbers(case)
    return found | {name: found[name] * factor for name, factor in case.factors.items()}


def file_text(case: Case) -> str | None:
    """The ship's file as a tool sees it; None where it is the preset of that name."""
    if case.ship == BENCH:
        return SHIP_FILE
    if case.variant != REALISTIC:
        return None
    tree = ship_file(case.ship)
    rub = {"coulomb_friction_engine_side_N_m": FRIGATE_RUB}
    return tomli_w.dumps(tree | {"transmission": tree["transmission"] | rub})
