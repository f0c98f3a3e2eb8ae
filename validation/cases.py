"""Draw the cases of a validation: ship, effects, sea and instruments by seed, before any simulation."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

from .simulator.bench import CALM_PROGRAMME, PROGRAMMES
from .simulator.effects import BENCH, BY_KEY, CONFOUNDED, EFFECTS, FRIGATE, UNKNOWN, TrueEffect
from .simulator.instruments import DULL, LIVELY
from .simulator.parameters import Parameters
from .variants import PLAIN, vary_case

BLOCK = (
    ("single",) * 8
    + ("two",) * 2
    + ("ablated",) * 2
    + ("null-calm",) * 2
    + ("null-waves",) * 2
    + ("null-wrong-number", "unknown", "unknown", "confounded")
)
"""Kinds of every twenty cases; eight have no effect, an unknown effect or a confounded one."""

KINDS = tuple(dict.fromkeys(BLOCK))
STRENGTHS = {"weak": (0.2, 0.2), "medium": (0.5, 1.0), "strong": (2.0, 4.0)}
"""Strength: rms of an effect's change relative to the rms residual of the ship file without the
effect."""

TOLERANCES = {
    FRIGATE: {"resistance": 0.01, "inertia_front": 0.01, "inertia_back": 0.01, "map_rack": 0.005},
    BENCH: {"inertia": 0.01, "kq": 0.005, "ohm": 0.005},
}
NOISE = {
    FRIGATE: {
        "encoder_noise": (0.005, 0.02),
        "gauge_noise": (500.0, 1500.0),
        "pitch_noise": (0.001, 0.003),
        "log_noise": (0.02, 0.06),
    },
    BENCH: {"encoder_noise": (0.03, 0.15), "current_noise": (0.01, 0.05)},
}
"""Range of the standard deviation of each instrument's noise."""


@dataclass(frozen=True)
class Concealed:
    """Concealed effect as drawn: shape, sign and wanted strength."""

    key: str
    ratio: float
    sign: float
    shape: Parameters

    @property
    def effect(self) -> TrueEffect:
        """Entry of the table of true effects."""
        return BY_KEY[self.key]


@dataclass(frozen=True)
class Case:
    """All inputs of a simulated recording, and the effects that the tool may not use."""

    seed: int
    index: int
    kind: str
    ship: str
    strength: str  # weak, medium, strong, or "none"
    effects: tuple[Concealed, ...]
    exclude: tuple[str, ...]  # ids to be taken out of the tool's catalogue
    programme: str
    programme_seed: int
    noise_seed: int
    seconds: float
    period: float
    wave_height: float  # m; 0 is calm
    wave_period: float  # s
    instruments: Parameters
    factors: Parameters  # true parameters over those of the ship file
    columns: tuple[str, ...]  # recorded optional columns
    variant: str = PLAIN
    off: Parameters = field(default_factory=dict)  # true parameters over those of a biased file
    missing: str = ""  # column that is not recorded
    healthy_programme: str = ""  # programme of the recording of a reference period, if there is one
    healthy_seed: int = 0


def _order(seed: int, label: str, count: int, turn: int) -> list[int]:
    """Return a permutation of a list, a different one for each pass."""
    digest = hashlib.sha256(f"{seed}/{label}/{turn}".encode()).digest()
    return [int(i) for i in np.random.default_rng(list(digest[:8])).permutation(count)]


def _turn(seed: int, label: str, items: tuple[Any, ...], number: int) -> Any:
    """Return the ``number``-th item of shuffled passes through all items."""
    turn, place = divmod(number, len(items))
    return items[_order(seed, label, len(items), turn)[place]]


def case_kind(seed: int, index: int) -> tuple[str, int]:
    """Return the kind of a case, and the number of earlier cases of this kind."""
    block, place = divmod(index, len(BLOCK))
    shuffled = [BLOCK[i] for i in _order(seed, "kinds", len(BLOCK), block)]
    kind = shuffled[place]
    return kind, block * BLOCK.count(kind) + shuffled[:place].count(kind)


def indices_of(seed: int, count: int, is_wanted: Callable[[str], bool]) -> list[int]:
    """Return the indices of the first cases of a seed whose kind is wanted."""
    wanted = (index for index in itertools.count() if is_wanted(case_kind(seed, index)[0]))
    return [*itertools.islice(wanted, count)]


def conceal(effect: TrueEffect, ratio: float, rng: Generator) -> Concealed:
    """Draw sign and shape of an effect with a wanted strength [-]."""
    shape = {name: float(rng.uniform(*limits)) for name, limits in effect.shape.items()}
    sign = -1.0 if effect.signs and rng.random() < 0.5 else 1.0
    return Concealed(effect.key, ratio, sign, shape)


def _two(seed: int, number: int) -> list[TrueEffect]:
    ours = tuple(effect for effect in EFFECTS if effect.ship == FRIGATE)
    first = _turn(seed, "first", ours, number)
    others = tuple(
        e
        for e in ours
        if e.balance != first.balance
        and e.family != first.family
        and set(e.programmes) & set(first.programmes)
    )
    return [first, _turn(seed, "second", others, number)]


def _effects(seed: int, kind: str, number: int) -> list[TrueEffect]:
    if kind == "two":
        return _two(seed, number)
    confounded = tuple(BY_KEY[key] for key in CONFOUNDED)
    table = {"single": EFFECTS, "ablated": EFFECTS, "unknown": UNKNOWN, "confounded": confounded}
    return [_turn(seed, kind, table[kind], number)] if kind in table else []


def _instruments(ship: str, rng: Generator) -> Parameters:
    rounding = float(rng.random() < 0.3)
    drawn = {name: float(rng.uniform(*ends)) for name, ends in NOISE[ship].items()}
    return drawn | {"rounding": rounding}


def _factors(ship: str, always: bool, rng: Generator) -> Parameters:
    wrong = always or rng.random() < 0.3
    return {
        name: float(1.0 + wrong * tolerance * rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 1.0))
        for name, tolerance in TOLERANCES[ship].items()
    }


def _programme(kind: str, ship: str, effects: list[TrueEffect], rng: Generator) -> str:
    if kind == "confounded":
        return DULL
    own = PROGRAMMES if ship == BENCH else LIVELY
    allowed = [
        name for name in own if all(name in e.programmes or e.programmes == LIVELY for e in effects)
    ]
    if kind.startswith("null") and rng.random() < 0.2:
        return CALM_PROGRAMME if ship == BENCH else DULL
    return str(rng.choice(allowed))


def draw_case(
    seed: int, index: int, variant: str = PLAIN, keys: tuple[str, ...] | None = None
) -> Case:
    """Draw a case; the same arguments always give the same case.

    ``keys`` are the keys of the concealed effects in place of drawn ones, which depend on the table of
    effects.
    """
    case = _plain(seed, index, keys)
    return case if variant == PLAIN else vary_case(case, variant)


def _plain(seed: int, index: int, keys: tuple[str, ...] | None) -> Case:
    kind, number = case_kind(seed, index)
    rng = np.random.default_rng([seed, index, 20])
    drawn = _effects(seed, kind, number)
    effects = drawn if keys is None else [BY_KEY[key] for key in keys]
    bench_null = kind in ("null-calm", "null-wrong-number") and number % 5 == 2
    ship = effects[0].ship if effects else (BENCH if bench_null else FRIGATE)
    strengths: tuple[str, ...] = tuple(STRENGTHS)
    if kind in ("two", "unknown", "confounded", "ablated"):
        strengths = ("medium", "strong")
    strength = _turn(seed, f"strength {kind}", strengths, number) if effects else "none"
    concealed = tuple(conceal(e, float(rng.uniform(*STRENGTHS[strength])), rng) for e in effects)
    airy = any(effect.waves for effect in effects)
    wavy = kind == "null-waves" or airy or (kind != "null-calm" and rng.random() < 0.5)
    wavy &= ship == FRIGATE
    low, high = (4.0, 6.5) if airy else (0.5, 3.5)
    height = float(rng.uniform(low, high))
    columns = ["thrust_N"] if rng.random() < 0.3 else []
    if airy or (wavy and rng.random() < 0.5):
        columns.append("propeller_submergence_m")
    return Case(
        seed=seed,
        index=index,
        kind=kind,
        ship=ship,
        strength=strength,
        effects=concealed,
        exclude=(effects[0].id,) if kind == "ablated" else (),
        programme=_programme(kind, ship, effects, rng),
        programme_seed=int(rng.integers(2**31)),
        noise_seed=int(rng.integers(2**31)),
        seconds=float(rng.integers(6, 13) * (50.0 if ship == BENCH else 100.0)),
        period=0.1,
        wave_height=height if wavy else 0.0,
        wave_period=float(4.3 * height**0.5 + rng.uniform(0.0, 2.5)),
        instruments=_instruments(ship, rng),
        factors=_factors(ship, kind == "null-wrong-number", rng),
        columns=tuple(columns),
    )


def truth_of(case: Case, sizes: dict[str, float], ratios: dict[str, float], notes: Any) -> Any:
    """Return the sealed truth: the case, the sizes and strengths of its effects, and notes for scoring.

    A nonce prevents a guess of the case by comparison of hashes.
    """
    nonce = hashlib.sha256(f"nonce/{case.seed}/{case.index}/{case.noise_seed}".encode()).hexdigest()
    return json.loads(
        json.dumps(
            {"nonce": nonce, "case": asdict(case), "sizes": sizes, "ratios": ratios, **notes}
        )
    )


def hash_truth(truth: Any) -> str:
    """Return the SHA-256 of the truth's canonical JSON."""
    text = json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
