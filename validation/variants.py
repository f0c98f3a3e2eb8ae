"""Variants of the validation: the same cases with the limitations of recordings of real ships.

Each variant draws its additional inputs from the case's seed and index alone, so that effect, strength,
sea and programme are those of the plain case.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from .simulator.bench import PROGRAMMES, SHIP_FILE, bench_parameters
from .simulator.effects import BENCH, FRIGATE
from .simulator.instruments import LIVELY
from .simulator.parameters import Parameters, frigate_parameters, ship_file

if TYPE_CHECKING:
    from .cases import Case

PLAIN = "plain"
REALISTIC, SLOW, RAW, ONE_MISSING, CLOSED_LOOP = (
    "realistic",
    "1-hz",
    "100-hz",
    "one-missing",
    "closed-loop",
)

VARIANTS = {
    PLAIN: "ten rows per second, all channels, a ship file that is right within its tolerances",
    REALISTIC: "inertia and friction of the ship file off by 10 %, resistance, KT and KQ by 5 %; "
    "calibrated on a reference period of the same ship",
    SLOW: "one row per second",
    RAW: "a hundred rows per second, unfiltered, with the same noise density",
    ONE_MISSING: "shaft torque, ship speed or measured pitch is not recorded (for the thruster: the "
    "current)",
    CLOSED_LOOP: "a governor controls the shaft speed by the encoder's measurement with its noise",
}
"""Description of each variant by name."""

TITLES = {
    PLAIN: "Validation on concealed effects",
    REALISTIC: "Validation with realistic ship files",
    SLOW: "Validation with one row a second",
    RAW: "Validation with a hundred rows a second",
    ONE_MISSING: "Validation with a channel missing",
    CLOSED_LOOP: "Validation with a governor in the loop",
}
"""Title of the page of each variant."""

OFF = {
    FRIGATE: {
        "inertia_front": 0.1,
        "inertia_back": 0.1,
        "rub": 0.1,
        "resistance": 0.05,
        "kt_scale": 0.05,
        "rotative": 0.05,
    },
    BENCH: {"inertia": 0.1, "rub": 0.1, "kt": 0.05, "kq": 0.05},
}
"""Relative errors of a realistic ship file, of either sign."""

FRIGATE_RUB = 3000.0
"""Coulomb friction on the engine side of the shaft torque meter in a realistic frigate's file [N m]."""

LOGGED_S = {SLOW: 1.0, RAW: 0.01}
"""Sampling interval of the log [s] where it differs from the case's."""

MISSING = {
    "shaft_torque_N_m": "torque-sensor",
    "ship_speed_m_s": "speed-log",
    "pitch_ratio": "pitch-sensor",
}
"""Columns that may be missing, with the beginning of the ids of their instrument effects."""

HEALTHY_S = {FRIGATE: 900.0, BENCH: 450.0}
"""Duration of the recording of a reference period [s]."""


def vary_case(case: Case, variant: str) -> Case:
    """Return a plain case in another one of :data:`VARIANTS`."""
    rng = np.random.default_rng([case.seed, case.index, 21])
    more: dict[str, Any] = {}
    if variant == REALISTIC:
        lively = PROGRAMMES if case.ship == BENCH else LIVELY
        more = {
            "factors": dict.fromkeys(case.factors, 1.0),
            "off": {k: float(1.0 + o * rng.choice([-1.0, 1.0])) for k, o in OFF[case.ship].items()},
            "columns": tuple(c for c in case.columns if c != "thrust_N"),  # no key scales KT alone
            "healthy_programme": str(rng.choice([p for p in lively if p != case.programme])),
            "healthy_seed": int(rng.integers(2**31)),
        }
    elif variant == ONE_MISSING:
        ids = [one.effect.id for one in case.effects]
        allowed = [c for c, fault in MISSING.items() if not any(i.startswith(fault) for i in ids)]
        missing = str(rng.choice(allowed))
        more = {"missing": "motor_current_A" if case.ship == BENCH else missing}
    return replace(case, variant=variant, **more)


def reference_case(case: Case) -> Case | None:
    """Return the case of the reference period; None if there is none."""
    if not case.healthy_programme:
        return None
    return replace(
        case,
        kind="null-calm",
        effects=(),
        programme=case.healthy_programme,
        programme_seed=case.healthy_seed,
        noise_seed=case.healthy_seed + 1,
        seconds=HEALTHY_S[case.ship],
    )


def file_parameters(case: Case) -> Parameters:
    """Return the parameters of a case's ship in its ship file."""
    if case.ship == BENCH:
        return bench_parameters()
    rub = FRIGATE_RUB if case.variant == REALISTIC else 0.0
    return frigate_parameters() | {"rub": rub}


def calibrated_parameters(case: Case) -> Parameters:
    """Return the parameters of the ship file with its deliberate errors corrected."""
    found = file_parameters(case)
    return found | {name: found[name] * factor for name, factor in case.off.items()}


def true_parameters(case: Case) -> Parameters:
    """Return the parameters of the true ship without effects."""
    found = calibrated_parameters(case)
    return found | {name: found[name] * factor for name, factor in case.factors.items()}


def file_text(case: Case) -> str | None:
    """Return the text of the ship file for the tool; None if it is the preset of that name."""
    if case.ship == BENCH:
        return SHIP_FILE
    if case.variant != REALISTIC:
        return None
    tree = ship_file(case.ship)
    rub = {"coulomb_friction_engine_side_N_m": FRIGATE_RUB}
    return tomli_w.dumps(tree | {"transmission": tree["transmission"] | rub})
