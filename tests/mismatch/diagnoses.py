"""Diagnoses made by hand, for what is shown of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from shaftline.mismatch import Diagnosis, Estimate
from shaftline.mismatch.judge.shapes import Shape, term_from_shape
from shaftline.mismatch.judge.verdict import Detectable, Finding
from shaftline.mismatch.search.catalogue import Effect, SizedEffect, catalogue
from shaftline.mismatch.search.fitting import Colour
from shaftline.mismatch.search.selection import Candidate
from shaftline.plant import Ship, load_ship

ROWS, INTERVAL_S = 1200, 0.2
TIME = np.arange(ROWS) * INTERVAL_S
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
BALANCES = [("hull", "N"), ("engine", "N m")]


def entry(label: str) -> Effect:
    return next(effect for effect in catalogue() if effect.label == label)


def candidate(label: str, gain: float, *values: float) -> Candidate:
    placed = SizedEffect(entry(label), values)
    return Candidate(placed.effect, cast(Any, SimpleNamespace(effects=(placed,))), gain)


def channels(slower: float) -> dict[str, Any]:
    rng = np.random.default_rng(3)
    speed = 10.0 + np.sin(TIME / 40.0) - slower
    return {
        "pitch_ratio": 1.2 + 0.001 * rng.standard_normal(ROWS),
        "shaft_speed_rad_s": speed,
    }


def ranked() -> list[tuple[Candidate, float]]:
    return [
        (candidate("coulomb-friction (engine)", 347.0, 8000.0), 10.5),
        (candidate("viscous-friction (engine)", 343.0, 700.0), 10.5),
        (candidate("hull-fouling (hull)", -12.0, 0.03), 10.5),
    ]


def friction(ship: Ship, trace: Any) -> dict[str, Any]:
    finding = Finding(
        entry("coulomb-friction (engine)"),
        (Estimate.of(ship, FRICTION, 8000.0, 1050.0 / 1.96),),
        347.0,
        10.5,
        (ranked()[1][0],),
        trace,
        1,
        [(60.0, 120.0)],
        "shaft_speed above 11 rad/s",
    )
    corrected = ship.with_values({FRICTION: 8000.0})
    return {"verdict": "explained", "findings": [finding], "corrected": corrected}


def nameless(ship: Ship, trace: Any) -> dict[str, Any]:
    knots, values = np.array([9.0, 10.0, 11.0]), np.array([0.0, -12000.0, 500.0])
    shape = Shape("engine", "N m", "shaft_speed", "rad/s", knots, values, 300.0, 40.0, trace)
    term = term_from_shape(shape, ship)
    assert term is not None
    return {
        "verdict": "unexplained",
        "shape": shape,
        "shape_windows": [(20.0, 50.0)],
        "corrected": ship.with_term(term),
        "left_over": Colour(0, 1, 0.005, 0.02, 14.0),
    }


def diagnosis_of(verdict: str, **changes: Any) -> Diagnosis:
    ship = load_ship("frigate")
    rng = np.random.default_rng(1)
    noise = np.array([[1e6], [5e3]]) * rng.standard_normal((2, ROWS))
    lacking = noise + np.array([[0.0], [-8e3]])
    fit = dict.fromkeys(channels(0.0), 84.5)
    fields: dict[str, Any] = {
        "verdict": verdict, "ship": ship, "corrected": ship, "time_s": TIME,
        "held_out": [(180.0, 240.0)], "drive": 20.0 + 0.02 * TIME,
        "measured": channels(0.0), "before": channels(-0.3),
        "after": channels(0.0), "balances": BALANCES, "residual_before": lacking,
        "residual_after": noise, "findings": [], "shape": None, "shape_windows": [],
        "shape_regime": "", "explained": 0.98, "left_over": None, "ranking": ranked(),
        "tried": tuple(c.effect.label for c, _ in ranked()),
        "detectable": [
            Detectable(SizedEffect(entry("coulomb-friction (engine)"), (324.0,)), 324.0, "N m")
        ],
        "fit_before": fit, "fit_after": dict.fromkeys(fit, 99.4), "held_out_gain": 285.0,
        "excited": True, "limits": [], "warnings": [],
    }  # fmt: skip
    if verdict == "explained":
        fields |= friction(ship, lacking[1])
    if verdict == "unexplained":
        fields |= nameless(ship, lacking[1])
    return Diagnosis(**(fields | changes))
